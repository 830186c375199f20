//! What holds for the command as a whole: help, completions, the doctor's answers.

mod program;

use std::io::Read as _;

use program::{motorium, printed, run};

#[test]
fn the_help_of_every_command_has_an_example() {
    for command in [
        "run",
        "check",
        "graph",
        "topic",
        "topic list",
        "topic echo",
        "topic hz",
        "topic info",
        "param",
        "param list",
        "param get",
        "param set",
        "robot",
        "robot list",
        "robot show",
        "robot check",
        "robot draw",
        "robot bench",
        "robot eval",
        "robot install",
        "primitive",
        "primitive fit",
        "primitive show",
        "primitive replay",
        "doctor",
        "schema",
        "new",
        "completions",
    ] {
        let mut arguments: Vec<&str> = command.split(' ').collect();
        arguments.push("--help");
        let help = printed(&arguments);
        assert!(help.contains("Example: motorium"), "{command}: {help}");
        assert!(help.lines().count() <= 60, "{command}: {} lines", help.lines().count());
    }
}

#[test]
fn completions_know_the_commands_in_every_shell() {
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = printed(&["completions", shell]);
        assert!(script.contains("doctor") && script.contains("measure"), "{shell}");
    }
}

#[test]
fn the_doctor_answers_in_json_with_an_exit_code_that_agrees() {
    let output = run(&["doctor", "--measure", "20ms", "--json"]);
    let answer: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let findings = answer["findings"].as_array().expect("findings");
    let failed = findings.iter().any(|finding| finding["verdict"] == "fail");
    assert_eq!(answer["fit"], !failed);
    assert_eq!(output.status.code(), Some(if failed { 5 } else { 0 }));
    for finding in findings {
        let passed = finding["verdict"] == "pass";
        assert_eq!(finding["fix"].is_null(), passed, "what is not right has a fix: {finding}");
    }
    assert_eq!(answer["wakeup"]["count"], 20);
    assert_eq!(answer["removed"], serde_json::json!([]), "nothing is removed unasked");
}

#[test]
fn colours_stay_away_from_pipes_and_come_when_they_are_forced() {
    let plain = run(&["doctor", "--measure", "0s"]);
    assert!(!plain.stdout.contains(&0x1b));
    let forced =
        motorium(&["doctor", "--measure", "0s"]).env("CLICOLOR_FORCE", "1").output().expect("it runs");
    assert!(forced.stdout.contains(&0x1b));
    let refused = motorium(&["doctor", "--measure", "0s"]).env("NO_COLOR", "1").output().expect("it runs");
    assert!(!refused.stdout.contains(&0x1b));
}

/// Whose output nobody reads beyond the first byte, though there is more of it than a pipe holds.
#[test]
fn a_reader_that_has_had_enough_ends_a_command_quietly_and_with_its_own_exit_code() {
    let overloaded = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/broken/overloaded.toml");
    let folder = tempfile::tempdir().expect("a folder");
    let letters = folder.path().join("letters.jsonl");
    let letters = letters.to_str().expect("a path of text");
    let commands: [(&[&str], i32); 5] = [
        (&["schema", "graph"], 0),
        (&["robot", "list"], 0),
        (&["completions", "zsh"], 0),
        (&["library", "letters", "--output", letters], 0),
        (&["check", overloaded, "--json"], 3),
    ];
    for (arguments, code) in commands {
        let mut child = motorium(arguments).spawn().expect("it starts");
        let mut stdout = child.stdout.take().expect("a pipe");
        // some print all they have before they are read
        let _ = stdout.read(&mut [0; 1]).expect("readable");
        drop(stdout);
        let output = child.wait_with_output().expect("it ends");
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(!errors.contains("panicked") && !errors.contains("ipe"), "{arguments:?}: {errors}");
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {errors}");
    }
}

#[test]
fn closed_from_the_start_neither_stream_is_a_reason_to_panic() {
    for arguments in [&["schema", "graph"][..], &["robot", "list"], &["check", "no-such-graph.toml"]] {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let errors = writer.try_clone().expect("another end");
        let status = motorium(arguments).stdout(writer).stderr(errors).status().expect("it runs");
        assert_eq!(status.code(), Some(if arguments[0] == "check" { 3 } else { 0 }), "{arguments:?}");
    }
}
