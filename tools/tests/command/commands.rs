//! The command as a whole: help, exit codes, completions, the doctor's answers.

use std::io::Read as _;

use clap::ArgAction;

use crate::program::{completed, motorium, printed, run};

/// Every command below the program itself, with its words, such as `topic list`.
fn commands() -> Vec<(String, clap::Command)> {
    fn below(words: &str, command: &clap::Command, found: &mut Vec<(String, clap::Command)>) {
        for sub in command.get_subcommands().filter(|sub| sub.get_name() != "help") {
            let words = format!("{words} {}", sub.get_name()).trim().to_string();
            found.push((words.clone(), sub.clone()));
            below(&words, sub, found);
        }
    }
    let mut root = motorium_tools::command();
    root.build();
    let mut found = Vec::new();
    below("", &root, &mut found);
    assert!(found.len() > 40, "only {} commands are found", found.len());
    found
}

#[test]
fn help_has_an_example_and_fits_its_line_limit() {
    for (words, mut command) in commands() {
        let help = command.render_long_help().to_string();
        assert!(help.contains(&format!("Example: motorium {words}")), "{words}: {help}");
        // Two have the options of recordings, forces and sizes, two the options of a graph, a clock and a
        // recording, one the options of a robot, a pose and a picture, one the options of fits, one the
        // options of four formats.
        let long = [
            "library build",
            "library evaluate",
            "run",
            "replay",
            "robot draw",
            "primitive fit",
            "model import",
        ];
        // three lines of these are `--overwrite`
        let most = if long.contains(&words.as_str()) { 83 } else { 63 };
        assert!(help.lines().count() <= most, "{words}: {} lines", help.lines().count());
    }
}

#[test]
fn every_command_is_in_the_page_of_the_book() {
    let page = include_str!("../../../docs/src/commands.md");
    for (words, _) in commands() {
        let (command, sub) = words.split_once(' ').unwrap_or((&words, ""));
        let section = page.split("\n## ").find(|section| section.starts_with(&format!("{command}\n")));
        let section = section.unwrap_or_else(|| panic!("no section `{command}`"));
        assert!(section.contains(&format!("$ motorium {command}")), "no example of `{command}`");
        let row = [format!("| `{sub}"), format!("$ motorium {words}")];
        assert!(row.iter().any(|row| section.contains(row)), "`{words}` is not described");
    }
}

#[test]
fn json_goes_to_stdout_and_output_names_a_file() {
    for (words, command) in commands() {
        for argument in command.get_arguments() {
            let takes_value = matches!(argument.get_action(), ArgAction::Set | ArgAction::Append);
            match argument.get_long() {
                Some("json") => assert!(!takes_value, "{words}: --json takes a value"),
                Some("output") => {
                    assert!(takes_value, "{words}: --output takes no value");
                    assert_eq!(argument.get_short(), Some('o'), "{words}");
                }
                _ => {}
            }
        }
    }
}

#[test]
fn exit_codes_of_the_book_match_the_commands() {
    let page = include_str!("../../../docs/src/safety.md");
    let table =
        page.split("## Exit codes").nth(1).expect("a section").split("\n## ").next().expect("its text");
    let listed: Vec<i32> =
        table.lines().filter_map(|line| line.strip_prefix("| ")?.split(' ').next()?.parse().ok()).collect();
    assert_eq!(listed, [0, 1, 2, 3, 4, 5, 6, 7, 8]);
    // Usage errors are the same for every command. Codes 4 to 8 are tested next to their causes: a component
    // that dies (tests/graphs/faults.rs), a machine that is not fit (below), a hop that became slower
    // (bench.rs), a component that loses steps (tests/graphs/hangs.rs), a missed goal (expect.rs).
    for (words, command) in commands() {
        let mut arguments: Vec<&str> = words.split(' ').collect();
        arguments.push("--no-such-option");
        assert_eq!(run(&arguments).status.code(), Some(2), "{words}");
        if !command.has_subcommands() {
            arguments.pop();
            arguments.push("--help");
            assert_eq!(run(&arguments).status.code(), Some(0), "{words}");
        }
    }
    let folder = tempfile::tempdir().expect("a folder");
    let broken = folder.path().join("broken.urdf");
    std::fs::write(&broken, "<robot name=\"x\"><link/></robot>").expect("written");
    let broken = broken.to_str().expect("a path of text");
    let overloaded = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/broken/overloaded.toml");
    let ends: [(&[&str], i32); 14] = [
        (&["robot", "list"], 0),
        (&["topic", "list", "--run", "no-such-run"], 1),
        (&["robot", "show", "no-such-robot"], 1),
        (&["robot", "check", "no-such-file.urdf"], 3),
        (&["run", "../graphs/panda-reach.toml", "--clock", "lockstep", "--core", "4096"], 2),
        (&["primitive", "show", "no-such-file.json"], 1),
        (&["library", "inspect", "no-such-file.library"], 1),
        (&["new", "My Arm"], 1),
        (&["topic", "hz", "x", "--for", "5 parsecs"], 2),
        (&["check", "no-such-graph.toml"], 3),
        (&["run", overloaded, "--for", "1s"], 3),
        (&["graph", "no-such-graph.toml"], 3),
        (&["robot", "check", broken], 3),
        (&["bench", "compare", "no-such-file.json", "no-such-file.json"], 3),
    ];
    for (arguments, code) in ends {
        let output = run(arguments);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {errors}");
    }
}

#[test]
fn completions_know_the_commands_in_every_shell() {
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = printed(&["completions", shell]);
        assert!(script.contains("COMPLETE") && script.contains("motorium"), "{shell}: {script}");
        let mut command = motorium(&["--", "motorium", "doctor", "--mea"]);
        command.env("COMPLETE", shell).env("_CLAP_COMPLETE_INDEX", "2").env("_CLAP_IFS", "\n");
        let output = command.output().expect("it runs");
        let words = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success() && words.contains("--measure"), "{shell}: {words}");
    }
}

#[test]
fn completions_know_graphs_robots_kinds_and_examples() {
    for (words, expected) in [
        (&["doc"][..], "doctor"),
        (&["robot", "show", "pan"], "panda"),
        (&["kinds", "control."], "control.qp"),
        (&["kinds", "control.qp", "--robot", "quadru"], "quadruped"),
        (&["run", "--example", "two"], "two-arms"),
        (&["check", "../graphs/panda-reach-r"], "../graphs/panda-reach-rapier.toml"),
    ] {
        let found = completed(words);
        assert!(found.iter().any(|word| word == expected), "{words:?}: {found:?}");
    }
    let graphs = completed(&["check", "../graphs/broken/not-a-r"]);
    assert!(graphs.iter().all(|word| !word.ends_with(".urdf")), "only graphs: {graphs:?}");
}

#[test]
fn doctor_json_agrees_with_its_exit_code() {
    let output = run(&["doctor", "--measure", "20ms", "--json"]);
    let answer: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let findings = answer["findings"].as_array().expect("findings");
    let failed = findings.iter().any(|finding| finding["verdict"] == "fail");
    assert_eq!(answer["fit"], !failed);
    assert_eq!(output.status.code(), Some(if failed { 5 } else { 0 }));
    for finding in findings {
        let passed = finding["verdict"] == "pass";
        assert_eq!(finding["fix"].is_null(), passed, "every problem has a fix: {finding}");
    }
    assert_eq!(answer["wakeup"]["count"], 20);
    assert_eq!(answer["removed"], serde_json::json!([]), "nothing is removed without --clean");
}

#[test]
fn colours_are_off_in_pipes_unless_forced() {
    let plain = run(&["doctor", "--measure", "0s"]);
    assert!(!plain.stdout.contains(&0x1b));
    let forced =
        motorium(&["doctor", "--measure", "0s"]).env("CLICOLOR_FORCE", "1").output().expect("it runs");
    assert!(forced.stdout.contains(&0x1b));
    let refused = motorium(&["doctor", "--measure", "0s"]).env("NO_COLOR", "1").output().expect("it runs");
    assert!(!refused.stdout.contains(&0x1b));
}

/// The reader closes the pipe after one byte, although the commands print more than a pipe holds.
#[test]
fn closed_pipe_keeps_the_exit_code() {
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
        // some finish printing before they are read
        let _ = stdout.read(&mut [0; 1]).expect("readable");
        drop(stdout);
        let output = child.wait_with_output().expect("it ends");
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(!errors.contains("panicked") && !errors.contains("ipe"), "{arguments:?}: {errors}");
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {errors}");
    }
}

#[test]
fn closed_output_streams_do_not_cause_a_panic() {
    for arguments in [&["schema", "graph"][..], &["robot", "list"], &["check", "no-such-graph.toml"]] {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        let errors = writer.try_clone().expect("another end");
        let status = motorium(arguments).stdout(writer).stderr(errors).status().expect("it runs");
        assert_eq!(status.code(), Some(if arguments[0] == "check" { 3 } else { 0 }), "{arguments:?}");
    }
}

/// Arguments with which a command fails before it starts any long operation.
fn hopeless(words: &str, command: &clap::Command) -> Vec<String> {
    let mut arguments: Vec<String> = words.split(' ').map(str::to_string).collect();
    let mut options = Vec::new();
    for argument in command.get_arguments().filter(|argument| !argument.is_hide_set()) {
        let takes_value = matches!(argument.get_action(), ArgAction::Set | ArgAction::Append);
        match (argument.get_long(), takes_value) {
            (None, _) if argument.is_positional() => {
                let count = argument.get_num_args().map_or(1, |range| range.min_values().max(1));
                arguments.extend(std::iter::repeat_n("no-such/Thing".to_string(), count));
            }
            (Some("run" | "only" | "data" | "states" | "example" | "robot" | "seeds"), true) => {
                let option = argument.get_long().expect("it has one");
                options.extend([format!("--{option}"), "no-such-thing".to_string()]);
            }
            (Some(option), true) if argument.is_required_set() => {
                options.extend([format!("--{option}"), "/no-such/folder/file".to_string()]);
            }
            _ => {}
        }
    }
    // an example is named in place of a graph
    if words != "graph" && options.iter().any(|option| option == "--example") {
        options.retain(|option| option != "--example" && option != "no-such-thing");
    }
    arguments.into_iter().chain(options).chain(["--json".to_string()]).collect()
}

#[test]
fn json_errors_follow_the_error_schema() {
    let schema = crate::program::json(&["schema", "error"]);
    let validator = jsonschema::validator_for(&schema).expect("a schema");
    let read = |arguments: &[String]| {
        let output = run(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let message = format!("{arguments:?}: {text}{}", String::from_utf8_lossy(&output.stderr));
        // a result with the exit code of its findings: the doctor's 5
        if matches!(output.status.code(), Some(0 | 4..)) {
            return (0, serde_json::Value::Null, message);
        }
        let object: serde_json::Value =
            serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {message}"));
        assert_eq!(text.lines().count(), 1, "{message}");
        let errors: Vec<String> = validator.iter_errors(&object).map(|error| error.to_string()).collect();
        assert!(errors.is_empty(), "{errors:?}: {message}");
        let code = output.status.code().expect("an exit code");
        assert_eq!(object["exit_code"], code, "{message}");
        assert!(object["error"].as_str().is_some_and(|error| !error.is_empty()), "{message}");
        assert!(!output.stderr.is_empty(), "standard error has the message, too: {message}");
        (code, object, message)
    };
    let (mut tried, mut succeeded) = (0, Vec::new());
    for (words, command) in commands() {
        if !command.get_arguments().any(|argument| argument.get_long() == Some("json")) {
            continue;
        }
        tried += 1;
        let wrong: Vec<String> =
            words.split(' ').chain(["--json", "--no-such-option"]).map(str::to_string).collect();
        let (code, object, message) = read(&wrong);
        assert_eq!((code, &object["kind"]), (2, &"usage".into()), "{message}");
        assert_eq!(object["found"], "--no-such-option", "{message}");
        // commands that only inspect the machine cannot fail
        let (code, object, message) = read(&hopeless(&words, &command));
        match code {
            0 => succeeded.push(words),
            1 => assert_eq!(object["kind"], "failed", "{message}"),
            2 => assert_eq!(object["kind"], "usage", "{message}"),
            _ => assert_eq!((code, &object["kind"]), (3, &"invalid".into()), "{message}"),
        }
    }
    assert!(tried > 30, "{tried} commands print JSON");
    assert!(succeeded.len() <= 4, "these should have failed: {succeeded:?}");
}

#[test]
fn json_error_names_its_place_values_and_advice() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).expect("written");
        path.to_str().expect("a path of text").to_string()
    };
    let error = |arguments: &[&str]| -> serde_json::Value {
        let output = run(&[arguments, &["--json"]].concat());
        serde_json::from_slice(&output.stdout).expect("one object")
    };
    let graph = path(
        "graph.toml",
        "name = \"x\"\nclokc = \"lockstep\"\n\n[component.a]\nkind = \"physics.articulated\"\nrate = \"1 kHz\"\n",
    );
    let found = error(&["check", &graph]);
    assert_eq!((&found["line"], &found["column"]), (&2.into(), &1.into()), "{found}");
    assert_eq!((&found["file"], &found["kind"]), (&graph.clone().into(), &"invalid".into()), "{found}");
    assert!(found["help"].as_str().is_some_and(|help| help.contains("did you mean `clock`?")), "{found}");
    assert!(found["diagnostics"].as_array().is_some_and(|all| !all.is_empty()), "{found}");
    let recording = path("shown.csv", "time_s,x\n0.0,1\n0.1,one\n0.2,3\n");
    let found = error(&["primitive", "fit", &recording, "--output", "/no-such/file.json"]);
    assert_eq!((&found["line"], &found["column"]), (&3.into(), &2.into()), "{found}");
    assert!(found["found"].as_str().is_some_and(|text| text.contains("one")), "{found}");
    assert!(found["expected"].as_str().is_some_and(|text| text.contains("number")), "{found}");
    let timed = path("timed.csv", "time_s,x\n0.0,1\n0.1,2\n0.2,3\n");
    let found = error(&["primitive", "fit", &timed, "--cutoff", "0"]);
    assert_eq!(found["found"], "0", "{found}");
    let found = error(&["robot", "show", "pandda"]);
    assert_eq!((&found["found"], &found["help"]), (&"pandda".into(), &"did you mean `panda`?".into()));
    let found = error(&["run", "--clokc", "lockstep"]);
    assert!(found["help"].as_str().is_some_and(|help| help.contains("--clock")), "{found}");
}
