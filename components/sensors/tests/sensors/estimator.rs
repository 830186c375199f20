//! `estimator.base` against the simulator's truth.

use std::path::{Path, PathBuf};

use motorium::launcher::Report;
use motorium::testing::Graph;
use motorium_physics::ArticulatedPhysics;

fn file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../graphs/quadruped-estimate.toml")
}

fn run(set: &[(&str, &str)], duration: &str) -> Report {
    let text = std::fs::read_to_string(file()).unwrap();
    let mut graph = Graph::from_toml(text).at_path(&file()).kind::<ArticulatedPhysics>();
    graph = graph
        .kind::<motorium_policies::CpgPolicy>()
        .kind::<motorium_sensors::JointEncoder>()
        .kind::<motorium_sensors::component::imu::Imu>()
        .kind::<motorium_sensors::component::contact::FootContactSensor>()
        .kind::<motorium_sensors::component::estimator::BaseEstimator>()
        .set("clock", "lockstep");
    for (key, value) in set {
        graph = graph.set(key, value);
    }
    graph.run(duration).unwrap()
}

fn number(report: &Report, key: &str) -> f64 {
    report.results["estimator"]["score"][key].as_f64().unwrap_or_else(|| panic!("{key}: {report:?}"))
}

/// The drift is the final drift, relative to the distance from the start.
#[test]
fn trot_drift_and_attitude_error_are_bounded() {
    for seed in ["1", "2", "3"] {
        let report = run(&[("seed", seed)], "10 s");
        assert!(number(&report, "way_m") > 1.5);
        assert!(number(&report, "position_drift_percent") <= 2.0, "{}", report.results["estimator"]);
        assert!(number(&report, "attitude_error_rms_deg") <= 1.0);
        let estimator = report.components.iter().find(|component| component.name == "estimator").unwrap();
        assert_eq!((estimator.allocations, estimator.errors), (Some(0), 0));
    }
}

#[test]
fn truth_is_used_for_the_score_only() {
    let without =
        "{ imu = \"quadruped/imu\", joint_state = \"quadruped/joint_state\", feet = \"quadruped/feet\" }";
    let (one, other) = (run(&[], "1 s"), run(&[("component.estimator.subscribe", without)], "1 s"));
    assert_eq!(one.state_hash, other.state_hash);
    assert!(one.results["estimator"]["score"].is_object() && other.results["estimator"]["score"].is_null());
}
