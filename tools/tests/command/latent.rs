//! `motorium latent` from poses to a transferred robot.

use std::fmt::Write as _;
use std::path::Path;

use crate::program::{json, run};

/// Poses that follow two hidden causes.
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

    let added = json(&["latent", "transfer", &model, "--data", &data, "--robot", "second", "--json"]);
    assert_eq!(added["spaces"][2]["name"], "second");
    assert_eq!(added["warning"], serde_json::Value::Null);
    let shown = json(&["latent", "show", &model, "--json"]);
    assert_eq!(shown["spaces"], added["spaces"]);

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
