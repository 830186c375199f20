//! Robots: URDF and MJCF.

use motorium_robots::{Dynamics, Kinematics, LoadOptions, Model, parse_mjcf, parse_urdf_with};

use crate::target::{files, target};

/// First computations after loading a model.
fn use_model(model: &Model) {
    let q = model.neutral();
    Kinematics::new(model).update(model, &q);
    Dynamics::new(model);
}

#[test]
fn urdf() {
    let folders: Vec<String> = ["panda", "rrbot", "quadruped", "differential-drive", "cart-pole"]
        .iter()
        .map(|name| format!("robots/catalogue/{name}"))
        .chain(["robots/tests/fixtures".to_string(), "tests/fuzz/corpus/urdf".to_string()])
        .collect();
    let folders: Vec<&str> = folders.iter().map(String::as_str).collect();
    target("urdf", &files(&folders, &[".urdf"]), |bytes| {
        let text = String::from_utf8_lossy(bytes);
        match parse_urdf_with(&text, None, &LoadOptions::default()) {
            Ok(robot) => use_model(&robot.model),
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    });
}

#[test]
fn mjcf() {
    let corpus = files(&["robots/tests/mujoco", "tests/fuzz/corpus/mjcf"], &[".xml"]);
    target("mjcf", &corpus, |bytes| {
        let text = String::from_utf8_lossy(bytes);
        match parse_mjcf(&text, None, &LoadOptions::default()) {
            Ok(robot) => use_model(&robot.model),
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    });
}
