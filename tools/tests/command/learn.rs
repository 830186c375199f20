//! `motorium learn`: one set of weights on any number of threads, straight or resumed; a policy folder.

use crate::program::{json, printed, run};

const TASK: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../tasks/cart-pole.toml");

#[test]
fn training_repeats_on_threads_and_makes_a_policy() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name).to_str().expect("a path of text").to_string();
    let train = |threads: &str, output: &str| {
        json(&[
            "learn",
            "train",
            TASK,
            "--seed",
            "3",
            "--steps",
            "2048",
            "--threads",
            threads,
            "--output",
            output,
            "--json",
        ])
    };
    let (first, second) = (file("a"), file("b"));
    let trained = train("1", &first);
    assert_eq!(trained["steps"], 2048);
    assert_eq!(trained["weights_sha256"].as_str().map(str::len), Some(64));
    assert_eq!(train("2", &second)["weights_sha256"], trained["weights_sha256"]);
    for name in ["policy.toml", "policy.onnx", "checkpoint.safetensors", "task.toml", "progress.csv"] {
        assert!(folder.path().join("a").join(name).is_file(), "{name}");
    }
    // a finished run has nothing left to do
    let resumed = json(&["learn", "resume", &first, "--json"]);
    assert_eq!(resumed["weights_sha256"], trained["weights_sha256"]);
    let checked = json(&["model", "check", &first, "--json"]);
    assert_eq!((&checked["robot"], &checked["inputs"]), (&"cart-pole".into(), &4.into()));
    let evaluated = json(&["learn", "evaluate", &first, "--task", TASK, "--episodes", "5", "--json"]);
    assert_eq!(evaluated["returns"].as_array().map(Vec::len), Some(5));
    assert!(evaluated["mean"].as_f64() > Some(5.0), "{evaluated}");

    let imitate = ["learn", "train", TASK, "--algorithm", "dagger", "--steps", "400", "--json", "--output"];
    let imitated = json(&[&imitate[..], &[&file("c"), "--expert", &first]].concat());
    assert_eq!((&imitated["iterations"], &imitated["labels"]), (&10.into(), &400.into()));
    let checked = json(&["model", "check", &file("c"), "--json"]);
    assert_eq!(checked["inputs"], 4);
    let refused = run(&[&imitate[..], &[&file("d")]].concat());
    assert!(String::from_utf8_lossy(&refused.stderr).contains("--expert <FOLDER>"), "an expert is missing");

    let refused = run(&["learn", "train", TASK, "--output", &first]);
    let errors = String::from_utf8_lossy(&refused.stderr);
    assert!(!refused.status.success() && errors.contains("motorium learn resume"), "{errors}");
}

#[test]
fn the_tasks_of_the_project_are_listed_with_their_rewards() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../tasks");
    let listed = json(&["learn", "list", folder, "--json"]);
    let tasks = listed["tasks"].as_array().expect("tasks");
    assert!(tasks.len() >= 3, "{listed}");
    for task in tasks {
        let [low, high] = [0, 1].map(|k| task["reward"][k].as_f64().expect("a number"));
        assert!(low <= high && low.is_finite() && high.is_finite(), "{task}");
    }
    assert!(printed(&["learn", "list", folder]).contains("reward of a step 1 to 1"), "cart-pole");
}
