//! Runs that an operator names, inspects, and damages.

use std::time::{Duration, Instant};

use rustix::process::Signal;
use serde_json::Value;

use crate::program::{complaint, completed, json, printed, run as command};
use crate::support::{Run, machine, signal, workspace};

#[test]
fn a_component_killed_by_hand_restarts_in_the_named_run() {
    let _machine = machine();
    let graph = workspace().join("graphs/panda-reach.toml");
    let run = Run::start(
        &graph,
        &["--for", "60 s", "--name", "killed-by-hand", "--force", "--set", "policy.restart.when=failure"],
    );
    assert!(run.folder.id().starts_with("killed-by-hand-"), "{}", run.folder.id());

    // another run of this user may be the newest: ours is one of those listed
    assert!(completed(&["topic", "list", "--run", "killed-"]).iter().any(|id| id == run.folder.id()));
    let is_newest = || printed(&["topic", "list", "--json"]).contains("panda/joint_command");
    let of_the_newest = is_newest().then(|| {
        let topics = completed(&["topic", "echo", "panda/joint_c"]);
        (topics, completed(&["param", "get", "policy."]))
    });
    // another run may have started in between
    if let Some((topics, parameters)) = of_the_newest.filter(|_| is_newest()) {
        assert_eq!(topics, ["panda/joint_command"]);
        assert!(parameters.contains(&"policy.speed".to_string()), "{parameters:?}");
    }
    assert_eq!(completed(&["kill", run.folder.id(), "contr"]), ["controller"]);
    let message = complaint(&["kill", "killed-by-hand", "polisy"]);
    assert!(message.contains("did you mean `policy`?"), "{message}");
    let killed = json(&["kill", "killed-by-hand", "policy", "--json"]);
    let first = killed["pid"].as_u64().expect("a process");
    let deadline = Instant::now() + Duration::from_secs(20);
    let restarts = || {
        let top = json(&["top", "killed-by-hand", "--once", "--json", "--interval", "100ms"]);
        let policy = top["components"].as_array().expect("components").iter().find(|c| c["name"] == "policy");
        policy.expect("it is one of them")["restarts"].as_u64()
    };
    while restarts() != Some(1) {
        assert!(Instant::now() < deadline, "it does not restart");
        std::thread::sleep(Duration::from_millis(100));
    }
    let message = printed(&["kill", "killed-by-hand", "policy", "--signal", "continue"]);
    assert!(message.contains("continued") && !message.contains(&format!("process {first} ")), "{message}");

    signal(run.launcher(), Signal::INT);
    let ended = run.finish();
    let report = ended.report();
    let policy = report.components.iter().find(|component| component.name == "policy").expect("there");
    assert_eq!(policy.restarts, 1, "{}", ended.stderr);
}

#[test]
fn component_in_a_launcher_thread_cannot_be_killed() {
    let _machine = machine();
    let graph = workspace().join("graphs/panda-reach.toml");
    let arguments = ["--for", "60 s", "--name", "hosted-by-hand", "--hosting", "threads", "--force"];
    let run = Run::start(&graph, &arguments);
    let message = complaint(&["kill", "hosted-by-hand", "policy"]);
    assert!(message.contains("is a thread of the launcher"), "{message}");
    signal(run.launcher(), Signal::INT);
    run.finish();
}

#[test]
fn built_in_graph_runs_from_any_folder() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, graph) in
        [(&["--example", "two-arms", "--name", "mine"][..], "mine"), (&[], "panda-reach")]
    {
        let fixed =
            ["run", "--clock", "lockstep", "--hosting", "inline", "--for", "500 ms", "--json", "--no-expect"];
        let output = crate::program::motorium(&[&fixed[..], arguments].concat())
            .current_dir(folder.path())
            .output()
            .expect("the program starts");
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(0), "{errors}");
        let report: Value = serde_json::from_slice(&output.stdout).expect("a report");
        assert_eq!(report["graph"], graph);
        assert_eq!(errors.contains("using the built-in example"), arguments.is_empty(), "{errors}");
    }
    assert_eq!(command(&["run", "--example", "no-such"]).status.code(), Some(2));
}
