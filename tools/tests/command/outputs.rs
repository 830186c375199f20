//! Files that commands write: names that do not fit their format, and existing files, are refused.

use std::path::Path;

use crate::animate::recorded;
use crate::first_day::{REACH, tried};
use crate::program::printed;

/// A recording of another program, of joint states.
const FOREIGN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../fixtures/mcap/json-none.mcap");

fn text(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

#[test]
fn names_that_do_not_fit_the_format_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let (gif, txt, none) =
        (folder.path().join("z.gif"), folder.path().join("d.txt"), folder.path().join("d"));
    for (arguments, output, words) in [
        (&["animate", FOREIGN, "--output", text(&gif)][..], &gif, "ending .gif, expected .png; write"),
        (
            &["robot", "draw", "pendulum", "--output", text(&txt)],
            &txt,
            "ending .txt, expected .svg or .png; write",
        ),
        (
            &["robot", "draw", "pendulum", "--output", text(&none)],
            &none,
            "no ending, expected .svg or .png; write",
        ),
        (
            &["plot", FOREIGN, "/joint_states.position", "--output", text(&txt)],
            &txt,
            "ending .txt, expected .svg, .png or .csv; write",
        ),
        (
            &["run", REACH, "--clock", "lockstep", "--record", text(&txt)],
            &txt,
            "ending .txt, expected .mcap; write",
        ),
    ] {
        let (code, errors) = tried(arguments);
        let message = errors.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(code == Some(1) && message.contains(words), "{arguments:?}: {errors}");
        assert!(!output.exists(), "{arguments:?}");
    }
    let picture = folder.path().join("d.PNG");
    printed(&["robot", "draw", "pendulum", "--size", "32x32", "--output", text(&picture)]);
    assert!(std::fs::read(&picture).expect("a picture").starts_with(b"\x89PNG"));
}

#[test]
fn existing_files_are_replaced_on_request_only() {
    let folder = tempfile::tempdir().expect("a folder");
    let (page, tables) = (folder.path().join("a.html"), folder.path().join("tables"));
    let table = tables.join("joint_states.csv");
    let file = |name: &str| folder.path().join(name);
    let (plot, picture, whole, graph) = (file("a.csv"), file("a.svg"), file("whole.mcap"), file("g.svg"));
    let moving = file("a.png");
    let recording = recorded(folder.path());
    let example = ["graph", "--example", "panda-reach", "--format", "svg", "--output", text(&graph)];
    for (arguments, file) in [
        (&["report", FOREIGN, "--output", text(&page)][..], &page),
        (&["export", FOREIGN, "--output", text(&tables)], &table),
        (&["plot", FOREIGN, "/joint_states.position", "--output", text(&plot)], &plot),
        (&["robot", "draw", "pendulum", "--output", text(&picture)], &picture),
        (&["recover", FOREIGN, "--output", text(&whole)], &whole),
        (&example, &graph),
        (&["animate", &recording, "--size", "32x32", "--output", text(&moving)], &moving),
    ] {
        printed(arguments);
        std::fs::write(file, "mine").expect("a file");
        let (code, errors) = tried(arguments);
        let message = errors.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(code, Some(1), "{errors}");
        assert!(message.contains("exists: name another file, or replace it with `--overwrite`"), "{errors}");
        assert_eq!(std::fs::read(file).expect("a file"), b"mine");
        printed(&[arguments, &["--overwrite"]].concat());
        assert!(std::fs::read(file).expect("a file").len() > 100);
    }
    // tables of another format are other files
    printed(&["export", FOREIGN, "--format", "parquet", "--output", text(&tables)]);
}

/// Tries a command whose outputs exist, then with `--overwrite`.
fn assert_kept(arguments: &[&str], outputs: &[&Path]) {
    for output in outputs {
        std::fs::write(output, "mine").expect("a file");
        let (code, errors) = tried(arguments);
        let message = errors.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(code, Some(1), "{arguments:?}: {errors}");
        assert!(
            message.contains("exists: name another file, or replace it with `--overwrite`"),
            "{arguments:?}: {errors}"
        );
        assert_eq!(std::fs::read(output).expect("a file"), b"mine", "{arguments:?}");
    }
    printed(&[arguments, &["--overwrite"]].concat());
    for output in outputs {
        assert_ne!(std::fs::read(output).expect("a file"), b"mine", "{arguments:?}");
    }
}

#[test]
fn library_and_primitive_outputs_are_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name);
    let [letters, library, csv, plot] = ["l.jsonl", "l.library", "a.csv", "a.svg"].map(file);
    printed(&["library", "letters", "--each", "2", "--output", text(&letters)]);
    printed(&["library", "build", text(&letters), "--rank", "4", "--output", text(&library)]);
    let [l, lib] = [text(&letters), text(&library)];
    let other = file("other/b.library");
    printed(&["library", "build", l, "--output", text(&other)]);
    assert_kept(&["library", "build", l, "--rank", "4", "--output", text(&other)], &[&other]);
    assert_kept(&["library", "merge", lib, lib, "--output", text(&other)], &[&other]);
    assert_kept(&["library", "update", lib, l, "--output", text(&other)], &[&other]);
    let parts = file("parts");
    let split = ["library", "split", lib, "across=x", "up=y", "--output", text(&parts)];
    printed(&split);
    assert_kept(&split, &[&parts.join("across.library"), &parts.join("up.library")]);
    let generate =
        ["library", "generate", lib, "--movement", "a", "--output", text(&csv), "--plot", text(&plot)];
    assert_kept(&generate, &[&csv, &plot]);
    assert_kept(&["library", "inspect", lib, "--plot", text(&plot)], &[&plot]);
    let coupling = file("l.coupling");
    let couple = ["library", "couple", l, "--epochs", "1", "--eigenforces", "3", "--output", text(&coupling)];
    assert_kept(&couple, &[&coupling]);
    let more = file("more.jsonl");
    let make = ["library", "letters", "--each", "1", "--output", text(&more), "--plot", text(&plot)];
    assert_kept(&make, &[&more, &plot]);
    let evaluate = ["library", "evaluate", l, "--hold-out", "2", "--eigenforces", "2", "--plot", text(&plot)];
    assert_kept(&evaluate, &[&plot]);

    let [shown, model] = ["shown.csv", "model.json"].map(file);
    std::fs::write(&shown, "time_s,x\n0,0\n0.1,0.2\n0.2,0.5\n0.3,0.8\n0.4,1\n").expect("a file");
    let fit = ["primitive", "fit", text(&shown), "--output", text(&model), "--plot", text(&plot)];
    assert_kept(&fit, &[&model, &plot]);
    let replay = ["primitive", "replay", text(&model), "--output", text(&csv), "--plot", text(&plot)];
    assert_kept(&replay, &[&csv, &plot]);
    assert_kept(&["primitive", "show", text(&model), "--plot", text(&plot)], &[&plot]);
    let timeline = ["check", REACH, "--timeline", "svg", "--output", text(&plot)];
    assert_kept(&timeline, &[&plot]);
}

#[test]
fn inputs_and_charts_of_another_format_are_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name);
    let letters = file("letters of a child.jsonl");
    printed(&["library", "letters", "--each", "1", "--output", text(&letters)]);
    let before = std::fs::read(&letters).expect("letters");
    let (png, same) = (file("a.png"), file("a.svg"));
    let [l, png, same] = [text(&letters), text(&png), text(&same)];
    for (arguments, words) in [
        (&["library", "build", l, "--output", l, "--overwrite"][..], "is an input of the command"),
        (&["library", "evaluate", l, "--plot", png], "ending .png, expected .svg; write"),
        (&["library", "letters", "--output", same], "ending .svg, expected .jsonl or .ndjson; write"),
        (&["primitive", "fit", l, "--output", same, "--plot", same], "is named for two outputs"),
        (
            &["library", "build", l, "--output", text(folder.path())],
            "is a folder, expected the name of a file",
        ),
        (&["library", "build", l, "--output", &format!("{l}/b.library")], "is a file, expected a folder"),
    ] {
        let (code, errors) = tried(arguments);
        let message = errors.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(code == Some(1) && message.contains(words), "{arguments:?}: {errors}");
    }
    assert_eq!(std::fs::read(&letters).expect("letters"), before);
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 1, "nothing is written");
}

#[test]
fn foreign_folders_are_not_half_replaced() {
    const TASK: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../tasks/cart-pole.toml");
    let folder = tempfile::tempdir().expect("a folder");
    let output = text(folder.path());
    let train = ["learn", "train", TASK, "--steps", "10", "--output", output];
    let mut tune =
        vec!["learn", "tune", "../graphs/quadruped-trot.toml", "--reward", "physics.base_travel_x_m"];
    tune.extend(["--parameter", "policy.config.frequency=1:4", "--for", "100 ms", "--output", output]);
    let imitate = ["learn", "imitate", "../graphs/imitate/loop.toml", "--output", output];
    for (arguments, names) in [
        (&train[..], &["policy.toml", "policy.onnx", "task.toml", "progress.csv"][..]),
        (&tune, &["evaluations.csv", "checkpoint.json", "best.toml"]),
        (&imitate, &["dmp.json", "imitation.svg"]),
    ] {
        for name in names {
            let file = folder.path().join(name);
            std::fs::write(&file, "mine").expect("a file");
            let (code, errors) = tried(arguments);
            assert_eq!(code, Some(1), "{arguments:?}: {errors}");
            assert!(errors.contains(&format!("{name} exists")), "{arguments:?}: {errors}");
            let found = std::fs::read_dir(folder.path()).expect("a folder").count();
            assert_eq!((found, std::fs::read(&file).expect("a file")), (1, b"mine".to_vec()), "{name}");
            std::fs::remove_file(&file).expect("it is there");
        }
    }
    let file = folder.path().join("a file");
    std::fs::write(&file, "mine").expect("a file");
    let (code, errors) = tried(&[&train[..6], &[text(&file)]].concat());
    assert!(code == Some(1) && errors.contains("a file is a file, expected a folder"), "{errors}");
}

#[test]
fn recording_without_content_is_not_said_to_be_recoverable() {
    let folder = tempfile::tempdir().expect("a folder");
    let (torn, whole) = (folder.path().join("torn.mcap"), folder.path().join("whole.mcap"));
    let bytes = std::fs::read(FOREIGN).expect("a recording");
    std::fs::write(&torn, &bytes[..8]).expect("a file");
    for arguments in [
        &["plot", text(&torn), "a.b"][..],
        &["report", text(&torn)],
        &["recover", text(&torn), "--output", text(&whole)],
    ] {
        let (code, errors) = tried(arguments);
        assert_eq!(code, Some(1), "{arguments:?}: {errors}");
        assert!(errors.contains("cut off after 8 bytes, before the first message"), "{errors}");
        assert!(
            errors.contains("nothing can be recovered") && !errors.contains("motorium recover"),
            "{errors}"
        );
    }
    assert!(!whole.exists());
    // behind its first records there is something to recover
    std::fs::write(&torn, &bytes[..bytes.len() / 2]).expect("a file");
    printed(&["recover", text(&torn), "--output", text(&whole)]);
}

#[test]
fn paths_that_are_not_utf8_are_accepted() {
    use std::os::unix::ffi::OsStrExt as _;
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &[u8]| folder.path().join(std::ffi::OsStr::from_bytes(name));
    let [letters, library, plot] = [&b"\xff \xe9.jsonl"[..], b"\xff.library", b"\xff.svg"].map(file);
    let run = |words: &[&str], paths: &[&Path]| {
        let output = crate::program::motorium(words).args(paths).output().expect("the program starts");
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{words:?}: {errors}");
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        serde_json::from_str::<serde_json::Value>(&text).unwrap_or_else(|error| panic!("{error}: {text}"))
    };
    let report = run(&["library", "letters", "--each", "1", "--json", "--output"], &[&letters]);
    assert!(
        report["file"].as_str().is_some_and(|file| file.ends_with("\u{fffd} \u{fffd}.jsonl")),
        "{report}"
    );
    run(&["library", "build", "--rank", "2", "--json", "--output"], &[&library, &letters]);
    let shown = folder.path().join("shown é.csv");
    std::fs::write(&shown, "time_s,x\n0,0\n0.1,0.2\n0.2,0.5\n0.3,0.8\n0.4,1\n").expect("a file");
    run(&["primitive", "fit", "--json", "--plot"], &[&plot, &shown]);
    assert!([letters, library, plot].iter().all(|file| file.is_file()));
}
