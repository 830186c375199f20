//! Typical mistakes on the command line: each is reported once, with the typed option or file.

use std::os::unix::ffi::OsStrExt as _;
use std::path::Path;

use crate::first_day::{REACH, bare_robot, file, tried};
use crate::program::motorium;

#[test]
fn invalid_time_is_reported_with_the_typed_option() {
    for (arguments, words) in [
        (&["run", REACH, "--for", "abc"][..], "is \"abc\", which does not begin with a number"),
        (&["run", REACH, "--for", "-1s"], "is negative (-1)"),
        (&["calibrate", REACH, "--for", "--save"], "does not begin with a number"),
        (&["topic", "hz", "a/b", "--for", "-5 s"], "is negative (-5)"),
        (&["bench", "recording", REACH, "--for", "soon"], "does not begin with a number"),
    ] {
        let (code, errors) = tried(arguments);
        assert_eq!(code, Some(2), "{arguments:?}: {errors}");
        assert!(errors.contains("for '--for <") && errors.contains(words), "{arguments:?}: {errors}");
    }
}

#[test]
fn unsupported_run_options_are_refused_at_start() {
    let folder = tempfile::tempdir().expect("a folder");
    let within = folder.path().to_str().expect("a plain path");
    let lockstep = ["run", REACH, "--clock", "lockstep"];
    for (arguments, code, words) in [
        (
            &["--record", "a.mcap", "--record-last", "30"][..],
            2,
            &["'--record-last <TIME>'", "without a unit"][..],
        ),
        (&["--record", within], 1, &["is a folder, expected the file of a recording"]),
        (&["--core", "4096"], 2, &["`--core 4096` is not a core of this machine; its cores: 0"]),
        (&["--pace", "-1"], 2, &["'--pace <FACTOR>'", "expected a number above 0"]),
        (&["--episodes", "-1"], 2, &["'-1'", "'--episodes <N>'"]),
    ] {
        let (found, errors) = tried(&[&lockstep[..], arguments].concat());
        assert_eq!(found, Some(code), "{arguments:?}: {errors}");
        assert!(words.iter().all(|words| errors.contains(words)), "{arguments:?}: {errors}");
    }
    let (code, errors) = tried(&["run", REACH, "--core", "0"]);
    assert!(code == Some(2) && errors.contains("for `--clock lockstep`"), "{errors}");
}

#[test]
fn first_part_of_a_kind_lists_matching_kinds() {
    let (code, errors) = tried(&["kinds", "control"]);
    assert_eq!(code, Some(1));
    assert!(errors.contains("there are `control.mpc`") && !errors.contains("policy"), "{errors}");
}

#[test]
fn graph_from_stdin_resolves_paths_from_current_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let [_, graph] = bare_robot(folder.path());
    let checked = |text: &str| {
        let input = folder.path().join("input");
        std::fs::write(&input, text).expect("the folder takes files");
        let mut command = motorium(&["check", "-"]);
        command.current_dir(folder.path()).stdin(std::fs::File::open(input).expect("it is there"));
        let output = command.output().expect("it runs");
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let text = std::fs::read_to_string(graph).expect("it was written");
    let (code, errors) = checked(&text);
    assert_eq!(code, Some(0), "{errors}");
    let (code, errors) = checked(&text.replace("rate      = \"500 Hz\"", "raet      = \"500 Hz\""));
    assert!(
        code == Some(3) && errors.contains("stdin:") && errors.contains("did you mean `rate`?"),
        "{errors}"
    );
}

#[test]
fn graph_from_stdin_is_refused_if_read_twice() {
    let folder = tempfile::tempdir().expect("a folder");
    let [_, graph] = bare_robot(folder.path());
    for command in [&["bench", "recording", "-"][..], &["bench", "kill", "-"], &["view", "-"]] {
        let mut command = motorium(command);
        command.stdin(std::fs::File::open(&graph).expect("it was written"));
        let output = command.output().expect("it runs");
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(
            errors.contains("standard input can only be read once: write the graph to a file"),
            "{command:?}: {errors}"
        );
        assert_eq!(output.status.code(), Some(2), "{command:?}: {errors}");
    }
}

#[test]
fn wrong_file_types_give_few_errors() {
    let folder = tempfile::tempdir().expect("a folder");
    let lines: String = (0..40).map(|line| format!("user{line}:x:{line}:/bin/sh\n")).collect();
    let (code, errors) = tried(&["check", &file(folder.path(), "passwd", &lines)]);
    let count = errors.matches("the file is not TOML").count();
    assert!(
        code == Some(3) && (1..=5).contains(&count) && errors.contains("39 more errors"),
        "{count} errors: {errors}"
    );
    let mut command = motorium(&["check"]);
    command.arg(std::ffi::OsStr::from_bytes(b"nowhere-\xff.toml"));
    let output = command.output().expect("it runs");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(3) && errors.contains("--example panda-reach"), "{errors}");
}

#[test]
fn bad_recordings_give_the_same_error_in_every_command() {
    let folder = tempfile::tempdir().expect("a folder");
    let missing = folder.path().join("nowhere.mcap");
    let within = folder.path().join("folder.mcap");
    std::fs::create_dir(&within).expect("a folder takes folders");
    let other = file(folder.path(), "other.mcap", "name = \"a graph in place of a recording\"");
    let text = |path: &Path| path.to_str().expect("a plain path").to_string();
    for (path, words) in [
        (text(&missing), "No such file or directory"),
        (text(&within), "it is a folder, expected the file of a recording"),
        (other, "the file is not a recording (MCAP)"),
    ] {
        for arguments in [
            &["plot", &path, "a.b"][..],
            &["report", &path],
            &["animate", &path],
            &["score", &path],
            &["export", &path],
            &["replay", &path, "--verify"],
        ] {
            let (code, errors) = tried(arguments);
            assert_eq!(code, Some(1), "{arguments:?}: {errors}");
            assert_eq!(errors.lines().count(), 1, "{arguments:?}: {errors}");
            assert!(errors.trim_end().ends_with(words) || errors.contains("(os error 2)"), "{errors}");
            assert!(errors.matches(words).count() == 1, "{arguments:?}: {errors}");
        }
    }
    let (code, errors) = tried(&["view", &text(&missing)]);
    assert!(code == Some(1) && errors.matches("os error 2").count() == 1, "{errors}");
}

#[test]
fn options_without_a_meaning_are_refused() {
    for (arguments, words) in [
        (&["library", "build", "a.jsonl", "--output", "b", "--rank", "0"][..], "0 is not in 1.."),
        (&["library", "build", "a.jsonl", "--output", "b", "--error", "5"], "expected a number from 0 to 1"),
        (&["library", "build", "a.jsonl", "--output", "b", "--error=-0.1"], "expected a number from 0 to 1"),
        (&["library", "build", "a.jsonl", "--output", "b", "--rate", "0"], "expected a positive number"),
        (&["library", "build", "a.jsonl", "--output", "b", "--smooth", "-1"], "expected a number from 0 up"),
        (&["library", "build", "a.jsonl", "--output", "b", "--window", "1"], "1 is not in 2.."),
        (&["library", "letters", "--output", "b.jsonl", "--each", "0"], "0 is not in 1.."),
        (&["library", "generate", "a", "--movement", "a", "--with", "b", "--blend", "30"], "from 0 to 1"),
        (&["library", "generate", "a", "--weights", "1,nan"], "expected a finite number"),
        (&["library", "generate", "a", "--movement", "a", "--duration", "0"], "expected a positive number"),
        (&["library", "evaluate", "a.jsonl", "--hold-out", "1"], "1 is not in 2.."),
        (&["primitive", "fit", "a.csv", "--kernels", "100000"], "100000 is not in 0..=2000"),
        (&["primitive", "fit", "a.csv", "--rate", "nan"], "expected a positive number"),
        (&["robot", "show", ""], "a value is required"),
        (&["plot", "a.mcap", "a.b", "--from", "5s"], "expected a finite number"),
        (&["library", "update", "a", "b", "--output", "c", "--capacity", "0"], "0 is not in 1.."),
    ] {
        let (code, errors) = tried(arguments);
        assert!(code == Some(2) && errors.contains(words), "{arguments:?}: {errors}");
    }
}
