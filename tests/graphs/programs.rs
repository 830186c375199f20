//! Programs of the user: the output of `motorium kinds --exec` for them, and the display of their errors.

use std::process::Command;

use serde_json::Value;

use crate::MOTORIUM;

const NEW: &str = env!("CARGO_BIN_EXE_new-component");
/// A component whose ports follow from its configuration.
const DYNAMIC: &str = env!("CARGO_BIN_EXE_dynamic-component");

fn motorium(arguments: &[&str]) -> (bool, String, String) {
    let output = Command::new(MOTORIUM).args(arguments).output().expect("motorium starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.success(), text(&output.stdout), text(&output.stderr))
}

#[test]
fn the_component_of_motorium_new_has_a_valid_example() {
    let (success, sheet, errors) = motorium(&["kinds", "--exec", NEW, "--json"]);
    assert!(success, "{errors}");
    let sheet: Value = serde_json::from_str(&sheet).expect("JSON");
    assert!(sheet["refused"].is_null(), "{sheet}");
    let keys: Vec<&str> =
        sheet["config"].as_array().unwrap().iter().filter_map(|key| key["key"].as_str()).collect();
    assert_eq!(keys, ["amplitude", "joint", "kd", "kp"]);
    assert_eq!(sheet["parameters"][0]["name"], "frequency");
    assert_eq!(sheet["parameters"][0]["unit"], "Hz");
    assert_eq!(sheet["ports"][0]["type"], "motorium.JointState");
    let (success, text, errors) = motorium(&["kinds", "--exec", NEW]);
    assert!(success && text.contains(&format!("exec      = {NEW:?}")), "{text}{errors}");

    let folder = tempfile::tempdir().unwrap();
    let graph = folder.path().join("graph.toml");
    let example = sheet["example"].as_str().unwrap().replace("subscribe", "# subscribe");
    std::fs::write(&graph, format!("name = \"example\"\n\n{example}")).unwrap();
    let (_, _, errors) = motorium(&["check", graph.to_str().unwrap()]);
    let found: Vec<&str> = errors.lines().filter(|line| line.starts_with("error")).collect();
    assert_eq!(found.len(), 1, "only the wire that was taken away is missing: {errors}");
    assert!(found[0].contains("`state`"), "{errors}");
}

#[test]
fn misspelt_key_of_a_program_is_underlined_in_place() {
    let folder = tempfile::tempdir().unwrap();
    let graph = folder.path().join("graph.toml");
    let check = |config: &str| {
        let text = format!(
            "name = \"mine\"\n\n[component.mine]\nexec = {NEW:?}\nrate = \"100 Hz\"\nschedule = \"normal\"\n\
             \n[component.mine.config]\n{config}\n"
        );
        std::fs::write(&graph, text).unwrap();
        motorium(&["check", graph.to_str().unwrap()]).2
    };
    let message = check("kp = [1.0]\nkd = [1.0]\namplitude = 0.1\namplitud = 0.2");
    assert!(message.contains("graph.toml:12:1"), "{message}");
    assert!(message.contains("`mine.config.amplitud`: unknown key `amplitud`"), "{message}");
    assert!(
        message.contains("^^^^^^^^ refused by") && message.contains("did you mean `amplitude`?"),
        "{message}"
    );
    let message = check("amplitude = 0.1\nkd = [1.0]\nkp = [1.0, \"stiff\"]");
    assert!(
        message.contains("graph.toml:11:6")
            && message.contains("`mine.config.kp`: expected one number, or a"),
        "{message}"
    );
    let message = check("kp = [1.0]\nkd = [1.0]");
    assert!(
        message.contains("key `amplitude` is missing") && message.contains("motorium kinds --exec"),
        "{message}"
    );
}

#[test]
fn program_without_components_is_reported() {
    let (success, _, errors) = motorium(&["kinds", "--exec", "/bin/true"]);
    assert!(!success && errors.contains("gave an invalid answer to `motorium-kinds`"), "{errors}");
    assert!(errors.contains("motorium::main!"), "{errors}");
}

/// A constant wrench, and the double of it: both by the program whose ports follow from its configuration.
fn scaled(resets: bool, output: &str) -> String {
    let component = |name: &str, subscribe: &str, config: &str| {
        format!(
            "[component.{name}]\nexec = {DYNAMIC:?}\nrate = \"1 kHz\"\n{subscribe}publish = {{ output = \"{name}\" }}\n\
             config = {{ type = \"{output}\", resets = {resets}, {config} }}\n"
        )
    };
    let source = component("source", "", "constant = 1.5");
    let double = component("double", "subscribe = { input = \"source\" }\n", "gain = 2.0");
    format!("name = \"scaled\"\nclock = \"lockstep\"\nduration = \"100 ms\"\n{source}{double}")
}

#[test]
fn a_component_made_at_run_time_runs_and_resets() {
    let folder = tempfile::tempdir().unwrap();
    let graph = folder.path().join("graph.toml");
    std::fs::write(&graph, scaled(true, "motorium.Wrench")).unwrap();
    let report = crate::support::run(&graph, &["--episodes", "2"]);
    let report = report.report();
    assert_eq!(report.exit, motorium::launcher::Exit::Finished);
    let double = &report.results["double"];
    assert_eq!(double["last"], serde_json::json!([3.0, 3.0, 3.0, 3.0, 3.0, 3.0]), "{double}");
    assert_eq!((&double["steps"], &double["resets"]), (&200.into(), &1.into()), "{double}");
    let hashes: Vec<_> = report.episodes.iter().map(|episode| episode.state_hash.clone()).collect();
    assert_eq!(hashes[0], hashes[1]);

    std::fs::write(&graph, scaled(false, "motorium.Wrench")).unwrap();
    let refused = crate::support::run(&graph, &["--episodes", "2"]);
    assert!(refused.stderr.contains("cannot be reset for a new episode"), "{}", refused.stderr);
    std::fs::write(&graph, scaled(true, "motorium.Wrenches")).unwrap();
    let (success, _, errors) = motorium(&["check", graph.to_str().unwrap()]);
    assert!(!success && errors.contains("there is no built-in state `motorium.Wrenches`"), "{errors}");
    let (success, sheet, errors) = motorium(&["kinds", "--exec", DYNAMIC, "--json"]);
    assert!(success && sheet.contains("scales the numbers of any type"), "{errors}");
}
