//! `motorium learn`: one set of weights on any number of threads, straight or resumed; a policy folder; a
//! tuned graph.

use std::io::{BufRead as _, BufReader};
use std::time::{Duration, Instant};

use crate::program::{json, motorium, printed, run};

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
    let phases = trained["seconds_by_phase"].as_object().expect("phases").values();
    let phases: Vec<f64> = phases.map(|seconds| seconds.as_f64().expect("a number")).collect();
    assert!(phases.len() == 6 && phases.iter().all(|seconds| *seconds > 0.0), "{trained}");
    assert!(phases.iter().sum::<f64>() <= trained["seconds"].as_f64().expect("a number"), "{trained}");
    assert_eq!(train("2", &second)["weights_sha256"], trained["weights_sha256"]);
    for name in ["policy.toml", "policy.onnx", "checkpoint.safetensors", "task.toml", "progress.csv"] {
        assert!(folder.path().join("a").join(name).is_file(), "{name}");
    }
    let page = std::fs::read_to_string(folder.path().join("a/report.html")).expect("a page");
    for text in ["Cart-pole: balance", "mean return", "policy loss", "divergence", "</html>"] {
        assert!(page.contains(text), "{text}");
    }
    assert!(page.contains(trained["weights_sha256"].as_str().expect("a text")), "weights");
    // return and length of episodes, their number, five values of an update
    assert_eq!(page.matches("<svg").count(), 8, "charts");
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
    assert!(String::from_utf8_lossy(&refused.stderr).contains("--expert"), "an expert is missing");

    let refused = run(&["learn", "train", TASK, "--output", &first]);
    let errors = String::from_utf8_lossy(&refused.stderr);
    assert!(!refused.status.success() && errors.contains("motorium learn resume"), "{errors}");
}

#[test]
fn progress_is_published_until_a_signal_ends_the_training() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = folder.path().join("a").to_str().expect("a path of text").to_string();
    let start = ["learn", "train", TASK, "--steps", "1e12", "--publish", "--output", &output];
    let mut child = motorium(&start).spawn().expect("the program starts");
    let mut errors = BufReader::new(child.stderr.take().expect("standard error"));
    let (mut line, mut id) = (String::new(), None);
    while id.is_none() && errors.read_line(&mut line).expect("text") > 0 {
        id = line.split_once("--run ").map(|(_, rest)| rest.trim_end().trim_end_matches('`').to_string());
        line.clear();
    }
    let id = id.expect("the name of the run");
    let rest = std::thread::spawn(move || std::io::read_to_string(errors).expect("text"));
    let echo = ["topic", "echo", "learn/progress", "--run", &id, "--count", "2", "--json"];
    let printed = printed(&echo);
    let samples: Vec<serde_json::Value> =
        printed.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let updates: Vec<u64> =
        samples.iter().map(|sample| sample["value"]["update"].as_u64().expect("a number")).collect();
    assert!(updates[0] >= 1 && updates[0] < updates[1], "{printed}");
    assert!(samples[1]["value"]["steps_per_second"].as_f64() > Some(0.0), "{printed}");
    let listed = json(&["topic", "list", "--run", &id, "--for", "10ms", "--json"]);
    assert!(listed.to_string().contains("motorium.LearningProgress"), "{listed}");

    rustix::process::kill_process(rustix::process::Pid::from_child(&child), rustix::process::Signal::INT)
        .expect("the program is there");
    let ended = child.wait().expect("a child");
    let errors = rest.join().expect("a thread");
    assert!(!ended.success() && errors.contains("motorium learn resume"), "{errors}");
    assert!(!run(&["topic", "list", "--run", &id]).status.success(), "a run is left behind");
    // the checkpoint is of the last update
    let text = std::fs::read_to_string(folder.path().join("a/progress.csv")).expect("a table");
    let last = text.lines().last().and_then(|line| line.split(',').nth(1)).expect("steps");
    assert!(errors.contains(&format!("interrupted after {last} of")), "{last}: {errors}");
    let evaluated = json(&["learn", "evaluate", &output, "--episodes", "1", "--json"]);
    assert!(evaluated["mean"].as_f64() >= Some(1.0), "{evaluated}");
}

#[test]
fn demonstrated_movements_are_fitted_and_reproduced() {
    let folder = tempfile::tempdir().expect("a folder");
    let graph = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/imitate/loop.toml");
    let output = folder.path().join("a").to_str().expect("a path of text").to_string();
    let imitate = ["learn", "imitate", graph, "--demonstrations", "5", "--tests", "2", "--json", "--output"];
    let found = json(&[&imitate[..], &[&output]].concat());
    let models = found["models"].as_array().expect("models");
    let errors: Vec<f64> = models.iter().map(|model| model["rms_m"].as_f64().expect("a number")).collect();
    let [dmp, promp, library, replay] = errors[..] else { panic!("{found}") };
    assert!(dmp < 0.5 * replay && promp < 0.5 * replay && library < 0.5 * replay, "{found}");
    for name in ["movement.library", "imitation.json", "imitation.svg"] {
        assert!(folder.path().join("a").join(name).is_file(), "{name}");
    }
    for name in ["dmp.json", "promp.json"] {
        printed(&["primitive", "show", &format!("{output}/{name}")]);
    }
    let again = folder.path().join("b").to_str().expect("a path of text").to_string();
    assert_eq!(json(&[&imitate[..], &[&again]].concat())["models"], found["models"]);
    let none = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/cart-pole-policy.toml");
    let none = run(&["learn", "imitate", none, "--output", &output]);
    assert!(String::from_utf8_lossy(&none.stderr).contains("motorium.PoseTarget"), "no pose targets");
}

#[test]
fn recorded_actions_are_cloned_and_aggregated() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name).to_str().expect("a path of text").to_string();
    let graph = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/cart-pole-policy.toml");
    let expert = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/cart-pole-policy");
    let (shown, task) = (file("shown.mcap"), file("task.toml"));
    let settings = "[algorithms.dagger]\niterations = 4\nepochs = 200\nhidden = [32]\n";
    let text = std::fs::read_to_string(TASK).expect("the task");
    std::fs::write(&task, format!("{text}\n{settings}")).expect("a file");
    printed(&["run", graph, "--hosting", "inline", "--for", "6s", "--record", &shown]);
    let learn = ["learn", "train", &task, "--recording", &shown, "--json"];
    let clone = |more: &[&str]| json(&[&learn[..], &["--algorithm", "clone"], more].concat());
    let cloned = clone(&["--action", "cart/action", "--output", &file("clone")]);
    // 50 answers a second, but for those to the first measurements
    let labels = cloned["labels"].as_u64().expect("a number");
    assert!((280..=300).contains(&labels), "{cloned}");
    assert!(cloned["loss"].as_f64().is_some_and(|loss| loss < 0.02), "{cloned}");
    let found = clone(&["--output", &file("again")]);
    assert_eq!(found["weights_sha256"], cloned["weights_sha256"], "topics are found by their types");
    let evaluated = json(&["learn", "evaluate", &file("clone"), "--episodes", "3", "--json"]);
    assert!(evaluated["mean"].as_f64() > Some(400.0), "the clone balances: {evaluated}");

    let dagger = ["--algorithm", "dagger", "--expert", expert, "--steps", "400", "--output"];
    let aggregated = json(&[&learn[..], &dagger, &[&file("dagger")]].concat());
    assert_eq!(aggregated["labels"], labels + 3 * 104, "three iterations follow the recording: {aggregated}");

    let refused = |more: &[&str]| {
        let refused = run(&[&learn[..], &["--output", &file("refused")], more].concat());
        assert!(!refused.status.success(), "{more:?}");
        String::from_utf8_lossy(&refused.stderr).into_owned()
    };
    assert!(refused(&["--algorithm", "clone", "--action", "cart/acton"]).contains("cart/action"));
    assert!(refused(&["--algorithm", "clone", "--expert", expert]).contains("not from both"));
    assert!(refused(&["--algorithm", "dagger"]).contains("dagger learns from an expert"));
    assert!(refused(&["--algorithm", "ppo"]).contains("--recording"));
}

#[test]
fn policies_are_compared_on_equal_episodes() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name).to_str().expect("a path of text").to_string();
    let (short, long, curves) = (file("short"), file("long"), file("curves.svg"));
    for (output, steps) in [(&short, "2048"), (&long, "8192")] {
        json(&["learn", "train", TASK, "--steps", steps, "--json", "--output", output]);
    }
    let compare = ["learn", "compare", &short, &long, &short, "--episodes", "20", "--json"];
    let found = json(&[&compare[..], &["--curves", &curves]].concat());
    let policies = found["policies"].as_array().expect("policies");
    let difference = |index: usize| policies[index]["comparison"]["difference"].as_f64().expect("a number");
    assert!(difference(1) > 0.0, "{found}");
    assert_eq!((difference(0), difference(2)), (0.0, 0.0));
    let evaluated = json(&["learn", "evaluate", &long, "--episodes", "20", "--json"]);
    assert_eq!(policies[1]["evaluation"]["returns"], evaluated["returns"]);
    let drawn = std::fs::read_to_string(&curves).expect("a chart");
    assert!(drawn.starts_with("<svg") && drawn.contains("mean return of 100 episodes"));
}

#[test]
fn every_listed_algorithm_trains() {
    let folder = tempfile::tempdir().expect("a folder");
    let tasks = concat!(env!("CARGO_MANIFEST_DIR"), "/../tasks");
    let listed = json(&["learn", "list", tasks, "--json"]);
    let names: Vec<&str> =
        listed["algorithms"].as_array().expect("names").iter().filter_map(|name| name.as_str()).collect();
    assert_eq!(names, ["ppo", "a2c", "reinforce", "sac", "td3", "ddpg", "dqn"]);
    for name in names {
        let output = folder.path().join(name).to_str().expect("a path of text").to_string();
        let start = ["learn", "train", TASK, "--algorithm", name, "--steps", "100", "--json", "--output"];
        let trained = json(&[&start[..], &[&output]].concat());
        assert_eq!(trained["algorithm"], name);
        assert!(trained["steps"].as_u64() >= Some(100), "{trained}");
        let evaluated = json(&["learn", "evaluate", &output, "--episodes", "1", "--json", "--task", TASK]);
        assert!(evaluated["mean"].as_f64() >= Some(1.0), "{evaluated}");
    }
}

#[test]
fn missing_and_empty_folders_are_refused_with_help() {
    let folder = tempfile::tempdir().expect("a folder");
    let empty = folder.path().to_str().expect("a path of text").to_string();
    let missing = folder.path().join("nowhere").to_str().expect("a path of text").to_string();
    for (command, words) in [
        (
            "list",
            [
                "No such file or directory (os error 2), expected a folder of task files",
                "found no task file, expected",
            ],
        ),
        (
            "resume",
            ["no such folder, expected the folder of a training run", "the folder has no run.json, expected"],
        ),
        (
            "evaluate",
            [
                "no such folder, expected the folder of a trained policy",
                "the folder has no policy.toml, expected",
            ],
        ),
    ] {
        let help = if command == "list" { "help: name " } else { "help: pass the folder" };
        for (folder, words) in [&missing, &empty].into_iter().zip(words) {
            let output = run(&["learn", command, folder]);
            let errors = String::from_utf8_lossy(&output.stderr).into_owned();
            assert_eq!(output.status.code(), Some(1), "{command}: {errors}");
            assert!(errors.contains(words) && errors.contains(help), "{command}: {errors}");
            assert!(output.stdout.is_empty(), "{command}");
        }
    }
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

#[test]
fn tuning_repeats_and_its_best_overlay_runs() {
    const GRAPH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/quadruped-trot.toml");
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name).to_str().expect("a path of text").to_string();
    let tune = |threads: &str, output: &str| {
        let mut arguments = vec!["learn", "tune", GRAPH, "--method", "cross-entropy", "--seed", "4"];
        arguments.extend(["--parameter", "policy.config.frequency=1:4"]);
        arguments.extend(["--parameter", "policy.config.joint_command.kp=5:30:log"]);
        arguments.extend(["--reward", "physics.base_travel_x_m", "--reward", "-0.1*physics.base_travel_y_m"]);
        arguments.extend(["--expect", "physics.base_height_lowest_m > 0.12", "--for", "400 ms"]);
        arguments.extend(["--evaluations", "6", "--threads", threads, "--output", output, "--json"]);
        json(&arguments)
    };
    let (first, second) = (file("a"), file("b"));
    let tuned = tune("1", &first);
    assert_eq!((&tuned["evaluations"], &tuned["outcomes"]["finished"]), (&6.into(), &6.into()), "{tuned}");
    assert_eq!(tune("2", &second)["table_sha256"], tuned["table_sha256"]);
    let resumed = json(&["learn", "resume", &first, "--json"]);
    assert_eq!((&resumed["table_sha256"], &resumed["reward"]), (&tuned["table_sha256"], &tuned["reward"]));

    let overlay = tuned["overlay"].as_str().expect("a file");
    let best = json(&["run", GRAPH, "--with", overlay, "--clock", "lockstep", "--for", "400 ms", "--json"]);
    let travel = |axis: &str| best["results"]["physics"][axis].as_f64().expect("a number");
    let reward = travel("base_travel_x_m") - 0.1 * travel("base_travel_y_m");
    assert_eq!(tuned["reward"].as_f64(), Some(reward));

    let again =
        run(&["learn", "tune", GRAPH, "--parameter", "seed=1:2", "--reward", "a.b", "--output", &first]);
    let errors = String::from_utf8_lossy(&again.stderr);
    assert_eq!(again.status.code(), Some(3), "a seed is a whole number: {errors}");
    let unknown =
        ["--parameter", "policy.config.frequency=1:4", "--reward", "walker.speed", "--output", &first];
    let unknown = run(&[&["learn", "tune", GRAPH][..], &unknown].concat());
    let errors = String::from_utf8_lossy(&unknown.stderr);
    assert!(!unknown.status.success() && errors.contains("`walker`, expected one of physics"), "{errors}");
}

#[test]
fn interrupted_tuning_resumes_to_the_same_table() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name).to_str().expect("a path of text").to_string();
    let (straight, interrupted) = (file("a"), file("b"));
    let graph = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/quadruped-trot.toml");
    let mut arguments =
        vec!["learn", "tune", graph, "--parameter", "policy.config.frequency=1:4", "--for", "1s"];
    arguments.extend(["--reward", "physics.base_travel_x_m", "--evaluations", "16", "--json", "--output"]);
    let mut other = arguments.clone();
    arguments.push(&straight);
    other.push(&interrupted);
    let expected = json(&arguments);

    let mut child = motorium(&other).spawn().expect("the program starts");
    let table = folder.path().join("b/evaluations.csv");
    let began = Instant::now();
    // the header and two evaluations
    while std::fs::read_to_string(&table).map_or(0, |text| text.lines().count()) < 3 {
        assert!(child.try_wait().expect("a child").is_none(), "it ended before the signal");
        assert!(began.elapsed() < Duration::from_secs(120), "no evaluation");
        std::thread::yield_now();
    }
    rustix::process::kill_process(rustix::process::Pid::from_child(&child), rustix::process::Signal::INT)
        .expect("the program is there");
    let ended = child.wait_with_output().expect("a child");
    assert!(!ended.status.success(), "{}", String::from_utf8_lossy(&ended.stdout));
    let before = std::fs::read_to_string(&table).expect("a table").lines().count();
    assert!(before < 17, "{before} lines");

    let resumed = json(&["learn", "resume", &interrupted, "--threads", "1", "--json"]);
    for key in ["evaluations", "outcomes", "reward", "parameters", "table_sha256"] {
        assert_eq!(resumed[key], expected[key], "{key}");
    }
}

#[test]
fn walking_by_bayesian_optimisation_is_reproduced() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name).to_str().expect("a path of text").to_string();
    let reproduce = |threads: &str, output: &str| {
        let mut arguments = vec!["reproduce", "locomotion", "--seeds", "2", "--evaluations", "7"];
        arguments.extend(["--seconds", "0.4", "--threads", threads, "--output", output, "--json"]);
        json(&arguments)
    };
    let (first, second) = (file("a"), file("b"));
    let report = reproduce("2", &first);
    assert_eq!(report["claims"].as_array().map(Vec::len), Some(4), "{report}");
    assert_eq!(report["files"].as_array().map(Vec::len), Some(8), "{report}");
    reproduce("1", &second);
    let read = |folder: &str, name: &str| {
        std::fs::read_to_string(format!("{folder}/{name}")).unwrap_or_else(|error| panic!("{name}: {error}"))
    };
    for name in [
        "locomotion-evaluations.csv",
        "locomotion-speed.csv",
        "locomotion-gait.toml",
        "locomotion-claims.json",
    ] {
        assert_eq!(read(&first, name), read(&second, name), "{name}");
    }
    assert_eq!(read(&first, "locomotion-evaluations.csv").lines().count(), 1 + 3 * 2 * 7);
    let summary: serde_json::Value = serde_json::from_str(&read(&first, "locomotion.json")).expect("JSON");
    let speed = summary["fastest"]["speed_m_s"].as_f64().expect("a speed");
    // the written gait walks at the speed of its evaluation
    let gait = format!("{first}/locomotion-gait.toml");
    let mut arguments = vec!["run", "--example", "quadruped-trot", "--with", &gait, "--clock", "lockstep"];
    arguments.extend(["--for", "400 ms", "--json"]);
    let run = json(&arguments);
    let travel = run["results"]["physics"]["base_travel_x_m"].as_f64().expect("a number");
    assert!((travel / 0.4 - speed).abs() < 1e-12, "{travel} {speed}");
}

#[test]
fn balls_caught_by_policy_search_are_reproduced() {
    const CUP: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../tasks/ball-in-cup.toml");
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name).to_str().expect("a path of text").to_string();
    let reproduce = |threads: &str, output: &str| {
        let mut arguments = vec!["reproduce", "ball-in-cup", "--task", CUP, "--seeds", "2"];
        arguments.extend(["--weights", "4,6", "--rollouts", "10", "--threads", threads]);
        arguments.extend(["--output", output, "--json"]);
        json(&arguments)
    };
    let (first, second) = (file("a"), file("b"));
    let report = reproduce("2", &first);
    assert_eq!(report["claims"].as_array().map(Vec::len), Some(4), "{report}");
    assert_eq!(report["files"].as_array().map(Vec::len), Some(7), "{report}");
    reproduce("1", &second);
    let read = |folder: &str, name: &str| {
        std::fs::read_to_string(format!("{folder}/{name}")).unwrap_or_else(|error| panic!("{name}: {error}"))
    };
    for name in [
        "ball-in-cup-trials.csv",
        "ball-in-cup-return.csv",
        "ball-in-cup-caught.csv",
        "ball-in-cup-claims.json",
    ] {
        assert_eq!(read(&first, name), read(&second, name), "{name}");
    }
    // after 0 and 10 rollouts; three spaces, two numbers of weights, two seeds
    assert_eq!(read(&first, "ball-in-cup-trials.csv").lines().count(), 1 + 3 * 2 * 2 * 2);
}

#[test]
fn cart_poles_by_imitation_are_reproduced() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name).to_str().expect("a path of text").to_string();
    let reproduce = |threads: &str, output: &str| {
        let mut arguments = vec!["reproduce", "cartpole", "--seeds", "2", "--rollouts", "20"];
        arguments.extend(["--demonstration", "400", "--steps", "1100", "--threads", threads]);
        arguments.extend(["--output", output, "--json"]);
        json(&arguments)
    };
    let (first, second) = (file("a"), file("b"));
    let report = reproduce("2", &first);
    assert_eq!(report["claims"].as_array().map(Vec::len), Some(6), "{report}");
    assert_eq!(report["files"].as_array().map(Vec::len), Some(7), "{report}");
    reproduce("1", &second);
    let read = |folder: &str, name: &str| {
        std::fs::read_to_string(format!("{folder}/{name}")).unwrap_or_else(|error| panic!("{name}: {error}"))
    };
    for name in ["cartpole-returns.csv", "cartpole-power.csv", "cartpole-ppo.csv", "cartpole-claims.json"] {
        assert_eq!(read(&first, name), read(&second, name), "{name}");
    }
    // PoWER after 0, 10 and 20 episodes, PPO after 0 and all updates; with and without imitation, two seeds
    assert_eq!(read(&first, "cartpole-returns.csv").lines().count(), 1 + 2 * 2 * (3 + 2));
}
