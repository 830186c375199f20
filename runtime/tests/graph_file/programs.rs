//! `exec`: user programs, queried for their declarations.

use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::sync::Mutex;

use super::load;

/// A program is written and then started. A process started by another thread in between would keep it open
/// for writing.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Checks a graph with one component that runs this shell script. Returns the declared ports or the errors.
fn check(script: &str) -> Result<Vec<String>, String> {
    let _guard = ONE_AT_A_TIME.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let folder = tempfile::tempdir().expect("a folder");
    let program = folder.path().join("my-component");
    std::fs::write(&program, format!("#!/bin/sh\n{script}\n")).expect("a script");
    std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).expect("a program");
    check_graph(folder.path(), "my-component")
}

fn check_graph(folder: &Path, exec: &str) -> Result<Vec<String>, String> {
    let graph = folder.join("graph.toml");
    let text = format!(
        "name = \"exec\"\n\n[component.mine]\nexec = \"{exec}\"\nrate = \"10 Hz\"\n\
         publish = {{ out = \"out\" }}\nconfig = {{ gain = 2 }}\n"
    );
    std::fs::write(&graph, text).expect("a graph");
    match load(&graph) {
        Ok(checked) => Ok(checked.plan.components[0].outputs.iter().map(|port| port.port.clone()).collect()),
        Err(error) => Err(error.render(false).replace(&format!("{}/", folder.display()), "")),
    }
}

/// Returns a declaration with these ports.
fn declaration(ports: &[&str]) -> String {
    let ports: Vec<_> = ports
        .iter()
        .map(|name| {
            serde_json::json!({
                "name": name, "direction": "output", "pattern": "state", "required": false, "doc": "",
                "layout": { "type_name": "test.Out", "size": 8, "alignment": 8, "fields": [] },
            })
        })
        .collect();
    serde_json::json!({
        "motorium": VERSION,
        "memory": motorium::region::layout_digest(),
        "declaration": { "ports": ports, "parameters": [], "actuator": false },
    })
    .to_string()
}

#[test]
fn program_gets_its_period_clock_and_folder() {
    let _guard = ONE_AT_A_TIME.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
    let folder = tempfile::tempdir().expect("a folder");
    let program = folder.path().join("my-component");
    let mut answer: serde_json::Value = serde_json::from_str(&declaration(&["out"])).expect("JSON");
    answer["declaration"]["warnings"] = serde_json::json!([{ "key": "gain", "message": "a large gain" }]);
    let script = format!("#!/bin/sh\ncat > {}/request\necho '{answer}'\n", folder.path().display());
    std::fs::write(&program, script).expect("a script");
    std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).expect("a program");
    check_graph(folder.path(), "my-component").expect("a good graph");
    let request = std::fs::read_to_string(folder.path().join("request")).expect("the request");
    let placement = &serde_json::from_str::<serde_json::Value>(&request).expect("JSON")["placement"];
    assert_eq!(placement["period"], serde_json::json!({ "secs": 0, "nanos": 100_000_000 }));
    assert_eq!(placement["clock"], "realtime");
    assert_eq!(placement["folder"], folder.path().to_str().expect("a path of text"));
    let warnings = load(&folder.path().join("graph.toml")).expect("a good graph").warnings;
    let text: String = warnings.iter().map(|warning| warning.render(false)).collect();
    assert!(text.contains("`mine.config.gain`: a large gain"), "{text}");
}

#[test]
fn program_that_answers_is_a_component() {
    let answer = declaration(&["out"]);
    assert_eq!(check(&format!("cat > /dev/null; echo '{answer}'")), Ok(vec!["out".to_string()]));
}

#[test]
fn program_is_queried_once_with_its_configuration() {
    let answer = declaration(&["out"]);
    let script = format!(
        "[ \"$#\" = 1 ] && [ \"$1\" = motorium-describe ] || exit 3\n\
         grep -q '\"config\":{{\"gain\":2}}' || exit 4\n\
         [ -e \"$0.asked\" ] && exit 5\n\
         touch \"$0.asked\"\n\
         echo '{answer}'"
    );
    assert_eq!(check(&script), Ok(vec!["out".to_string()]));
}

#[test]
fn program_may_answer_without_reading_the_request() {
    let answer = declaration(&["out"]);
    assert_eq!(check(&format!("echo '{answer}'")), Ok(vec!["out".to_string()]));
}

#[test]
fn refused_configuration_is_shown_in_the_file() {
    let answer = serde_json::json!({
        "motorium": VERSION,
        "memory": motorium::region::layout_digest(),
        "error": { "key": "gain", "message": "is 2, expected at most 1", "advice": "try 0.5" },
    });
    insta::assert_snapshot!("exec__config-refused", check(&format!("echo '{answer}'")).expect_err("refused"));
}

#[test]
fn program_of_another_version_is_refused() {
    let text = check("echo '{\"motorium\":\"0.0.7\",\"declaration\":{}}'").expect_err("refused");
    let text = text.replace(VERSION, "VERSION");
    insta::assert_snapshot!("exec__other-version", text);
}

#[test]
fn program_that_is_not_a_component_is_refused() {
    insta::assert_snapshot!("exec__no-json", check("echo hello").expect_err("refused"));
    insta::assert_snapshot!("exec__no-answer", check("exit 0").expect_err("refused"));
    insta::assert_snapshot!("exec__no-version", check("echo '{}'").expect_err("refused"));
    insta::assert_snapshot!("exec__failed", check("echo 'no such option' >&2; exit 2").expect_err("refused"));
    insta::assert_snapshot!(
        "exec__half-a-declaration",
        check(&format!("echo '{{\"motorium\":\"{VERSION}\",\"declaration\":{{\"ports\":3}}}}'"))
            .expect_err("refused")
    );
}

#[test]
fn contradictory_declaration_is_refused() {
    let answer = declaration(&["out", "out"]);
    insta::assert_snapshot!("exec__port-twice", check(&format!("echo '{answer}'")).expect_err("refused"));
}

#[test]
fn hanging_program_is_killed_and_refused() {
    // `exec`, so that killing the program also kills the command
    insta::assert_snapshot!("exec__hangs", check("exec sleep 600").expect_err("refused"));
}

#[test]
fn program_that_cannot_be_started_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    insta::assert_snapshot!(
        "exec__missing",
        check_graph(folder.path(), "target/release/mine").expect_err("refused")
    );
    insta::assert_snapshot!(
        "exec__folder",
        check_graph(folder.path(), ".")
            .expect_err("refused")
            .replace(&folder.path().display().to_string(), "FOLDER")
    );
}
