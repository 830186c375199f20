//! `motorium latent` from poses to a transferred robot.

use std::fmt::Write as _;
use std::path::Path;

use crate::program::{json, run};

/// Poses that depend on two latent variables.
fn poses(path: &Path, columns: usize, phase: f64) {
    let names: Vec<String> = (0..columns).map(|c| format!("joint{c}")).collect();
    let mut text = names.join(",") + "\n";
    for i in 0..40 {
        let (u, v) = ((0.37 * f64::from(i)).sin(), (0.23 * f64::from(i) + 1.0).cos());
        let cells =
            (0..columns).map(|c| ((c as f64 + phase).cos() * u + (c as f64 + phase).sin() * v).to_string());
        let _ = writeln!(text, "{}", cells.collect::<Vec<_>>().join(","));
    }
    std::fs::write(path, text).expect("the folder takes files");
}

#[test]
fn robots_are_trained_transferred_and_evaluated() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name).to_str().expect("a path of text").to_string();
    for (name, columns, phase) in [("human", 5, 0.1), ("first", 3, 0.8), ("second", 4, 2.1)] {
        poses(&folder.path().join(format!("{name}.csv")), columns, phase);
    }
    let (data, model) = (file(""), file("arms.latent"));
    let options = ["--robot", "first", "--latents", "2", "--iterations", "30"];
    let mut train = vec!["latent", "train", &data, "--output", &model, "--json"];
    train.extend(options);
    let trained = json(&train);
    assert_eq!(trained["poses"], 40);
    assert_eq!(trained["spaces"].as_array().map(Vec::len), Some(2));
    assert!(trained["objective"]["end"].as_f64() < trained["objective"]["start"].as_f64(), "{trained}");

    // the model names the folder of its poses
    let added = json(&["latent", "transfer", &model, "--robot", "second", "--json"]);
    assert_eq!(added["spaces"][2]["name"], "second");
    assert_eq!(added["warning"], serde_json::Value::Null);
    let shown = json(&["latent", "show", &model, "--json"]);
    assert_eq!(shown["spaces"], added["spaces"]);

    let (plot, free) = (file("objective.svg"), file("free.latent"));
    let mut dynamics = vec!["latent", "train", &data, "--output", &free, "--json", "--back", "none"];
    dynamics.extend(["--prior", "dynamics", "--plot", &plot, "--overwrite"]);
    dynamics.extend(options);
    let free = json(&dynamics);
    assert!(free["objective"]["end"].as_f64() < free["objective"]["start"].as_f64(), "{free}");
    assert!(std::fs::read_to_string(&plot).expect("a plot").contains("all spaces"), "no series");
    dynamics[7] = "pose";
    let refused = run(&dynamics);
    assert!(String::from_utf8_lossy(&refused.stderr).contains("prior is dynamics"), "{refused:?}");

    let mut evaluate = vec!["latent", "evaluate", &data, "--folds", "2", "--json"];
    evaluate.extend(options);
    let errors = json(&evaluate);
    let methods = errors["methods"].as_array().expect("methods");
    let error = |i: usize| methods[i]["mean_squared_error"].as_f64().expect("a number");
    assert_eq!(methods.len(), 5);
    assert!(error(0) < 0.1 * error(4), "{errors}");

    let refused = run(&["latent", "transfer", &model, "--data", &data, "--robot", "second"]);
    assert!(!refused.status.success());
    assert!(
        String::from_utf8_lossy(&refused.stderr).contains("the space second exists twice"),
        "{refused:?}"
    );
}

#[test]
fn a_recorded_movement_is_retargeted_to_a_robot() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = |name: &str| folder.path().join(name).to_str().expect("a path of text").to_string();
    // the upper arm swings sideways, the forearm bends
    let mut text = "time_s,arm_x,arm_y,arm_z,fore_x,fore_y,fore_z\n".to_string();
    for i in 0..50 {
        let (t, u, v) = (0.04 * f64::from(i), 0.4 * (0.1 * f64::from(i)).sin(), 0.6 + 0.01 * f64::from(i));
        let _ = writeln!(text, "{t},{},0,{},{},0,{}", u.sin(), u.cos(), (u + v).sin(), (u + v).cos());
    }
    std::fs::write(folder.path().join("take.csv"), text).expect("the folder takes files");
    let limbs = ["--limb", "arm=panda_link2:panda_link4", "--limb", "fore=panda_link4:panda_link6"];
    let (take, output, human) = (file("take.csv"), file("panda.csv"), file("human.csv"));
    let mut arguments = vec!["latent", "retarget", &take, "--robot", "panda", "--output", &output];
    arguments.extend(["--human", &human, "--every", "5", "--json"]);
    arguments.extend(limbs);
    let found = json(&arguments);
    assert_eq!(found["samples"], 50);
    for limb in ["arm", "fore"] {
        assert!(found["median_error_deg"][limb].as_f64() < Some(2.0), "{found}");
    }
    assert_eq!(found["branch_changes"], serde_json::json!([]));
    for path in [&output, &human] {
        assert_eq!(std::fs::read_to_string(path).expect("a table").lines().count(), 11);
    }
    let retarget = ["latent", "retarget", &take, "--robot", "panda", "--overwrite", "--output", &output];
    let unknown = run(&[&retarget[..], &["--limb", "arm=a:b"]].concat());
    assert!(String::from_utf8_lossy(&unknown.stderr).contains("\"a\""), "{unknown:?}");
}

#[test]
fn chapter_4_is_reproduced_from_a_folder_of_poses() {
    let folder = tempfile::tempdir().expect("a folder");
    let arms = folder.path().join("human-robot-arms");
    std::fs::create_dir(&arms).expect("a folder");
    for (name, columns, phase) in
        [("human", 7, 0.1), ("walkman", 6, 0.8), ("coman", 6, 2.1), ("centauro", 6, 1.1)]
    {
        poses(&arms.join(format!("{name}.csv")), columns, phase);
    }
    let [data, out] = [folder.path().to_path_buf(), folder.path().join("out")]
        .map(|path| path.to_str().expect("a path of text").to_string());
    let arguments = [
        "reproduce",
        "chapter4",
        "--data",
        &data,
        "--output",
        &out,
        "--splits",
        "2",
        "--iterations",
        "5",
        "--json",
    ];
    let report = json(&arguments);
    let claims = report["claims"].as_array().expect("claims");
    assert_eq!(claims.len(), 11, "{report}");
    assert!(
        claims[0]["evidence"].as_str().is_some_and(|text| text.contains("of 12: coman q = 2 free")),
        "{report}"
    );
    let transfers = std::fs::read_to_string(folder.path().join("out/transfer-coman.csv")).expect("a chart");
    for series in
        ["transferred; free", "trained with all robots; free", "gaussian_process", "ridge", "nearest"]
    {
        assert!(transfers.contains(series), "no {series} in\n{transfers}");
    }
    let chart = std::fs::read_to_string(folder.path().join("out/poses-coman.csv")).expect("a chart");
    for series in
        ["transferred; default; the pose", "alone; free latent; q = 6", "gaussian_process", "nearest"]
    {
        assert!(chart.contains(series), "no {series} in\n{chart}");
    }
}
