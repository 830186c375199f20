//! Every robot of the catalogue compared with Pinocchio, by vectors written by `golden/catalogue.py`.

use std::path::Path;

use crate::golden::Golden;
use motorium_robots::{LoadOptions, MimicMode, Model, catalogue, load_with};
use serde_json::Value;

fn vectors(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/golden/catalogue/{name}.json"));
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Returns the robot with all joints independent, as in the vectors.
fn model(name: &str) -> Model {
    let options = LoadOptions { mimic: MimicMode::Independent, ..LoadOptions::default() };
    load_with(name, Path::new("."), &options).unwrap().model
}

#[test]
fn every_catalogue_robot_matches_pinocchio() {
    for entry in catalogue() {
        let errors = Golden::parse(&vectors(entry.name)).compare(&model(entry.name));
        println!("{}: {}", entry.name, errors.summary());
        assert!(errors.0.len() >= 30, "{}: {}", entry.name, errors.summary());
        errors.stay_below(1e-10, 1e-10);
    }
}

#[test]
fn every_catalogue_robot_has_the_mass_and_limits_of_pinocchio() {
    for entry in catalogue() {
        let document: Value = serde_json::from_str(&vectors(entry.name)).unwrap();
        let model = model(entry.name);
        let mass = document["total_mass"].as_f64().unwrap();
        // Pinocchio excludes links fixed to the world
        assert!(
            (model.mass() - mass).abs() <= 1e-12 * mass,
            "{}: {} kg, {mass} kg",
            entry.name,
            model.mass()
        );
        let mut count = 0;
        for (name, theirs) in document["limits"].as_object().unwrap() {
            let index = model.joint_index(name).unwrap();
            let ours = [model.lower(), model.upper(), model.velocity_limit(), model.effort_limit()];
            for (limits, theirs) in ours.into_iter().zip(theirs.as_array().unwrap()) {
                assert_eq!(limits[index], theirs.as_f64().unwrap(), "{}: {name}", entry.name);
            }
            count += 1;
        }
        let bounded = model.lower().iter().filter(|lower| lower.is_finite()).count();
        assert_eq!(count, bounded, "{}", entry.name);
    }
}
