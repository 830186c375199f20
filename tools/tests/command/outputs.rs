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
