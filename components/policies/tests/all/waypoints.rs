//! `policy.waypoints` in a running graph, with a base that follows its commands exactly.

use motorium::launcher::Report;
use motorium::prelude::*;
use motorium::testing::{Function, Graph, Instance, Probe, Source};
use motorium_policies::WaypointsPolicy;

/// A base that moves at `share` of the target velocity and reports its pose.
fn base(share: f64) -> Function {
    let mut odometry = Odometry::default();
    Function::new::<TwistTarget, Odometry>("base", "target", "odometry", move |tick, target| {
        let twist = target.copied().unwrap_or_default();
        let (sin, cos) = odometry.yaw.sin_cos();
        let [x, y] = [0, 1].map(|axis| share * twist.linear[axis] * tick.dt());
        odometry.position[0] += cos * x - sin * y;
        odometry.position[1] += sin * x + cos * y;
        odometry.yaw += share * twist.angular[2] * tick.dt();
        Some(odometry)
    })
}

fn policy(config: &str) -> Instance {
    let config: toml::Table = format!("config = {config}").parse().unwrap();
    Instance::of::<WaypointsPolicy>("policy")
        .robot("rover")
        .trigger("odometry")
        .subscribe("odometry", "odometry")
        .publish("target", "target")
        .set("config", config["config"].clone())
}

fn graph(robot: &str, share: f64, policy: Instance) -> Graph {
    Graph::new("waypoints-test").robot("rover", robot).with(base(share)).with(policy)
}

const CORNERS: &str = "{ goals = [{ position = [0.4, 0.0], yaw = 1.5708 }, { position = [0.4, 0.4] }] }";

fn number(report: &Report, key: &str) -> f64 {
    report.results["policy"][key].as_f64().unwrap_or_else(|| panic!("{}", report.results["policy"]))
}

#[test]
fn a_two_wheeled_base_reaches_its_goals() {
    let target = Probe::<TwistTarget>::for_topic("target");
    let report = graph("differential-drive", 1.0, policy(CORNERS)).with(&target).run("16 s").unwrap();
    assert_eq!(report.results["policy"]["goals_reached"], 2, "{}", report.results["policy"]);
    assert_eq!(report.results["policy"]["finished"], true);
    assert!(number(&report, "position_error_m") < 3e-3 && number(&report, "yaw_error_rad") < 3e-3);
    // four fifths of 6.67 rad/s at 33 mm, and zero sideways velocity
    let fastest = target.values().iter().map(|target| target.linear[0]).fold(0.0, f64::max);
    assert!((fastest - 0.8 * 6.67 * 0.033).abs() < 2e-3, "{fastest} m/s");
    assert!(target.values().iter().all(|target| target.linear[1] == 0.0));
    let policy = report.components.iter().find(|component| component.name == "policy").unwrap();
    assert_eq!(policy.allocations, Some(0));
}

#[test]
fn omnidirectional_base_drives_sideways() {
    let config = "{ goals = [{ position = [0.0, 0.5] }] }";
    let target = Probe::<TwistTarget>::for_topic("target");
    let report = graph("mobile-manipulator", 1.0, policy(config)).with(&target).run("4 s").unwrap();
    assert_eq!(report.results["policy"]["goals_reached"], 1, "{}", report.results["policy"]);
    assert!(target.values().iter().all(|target| target.linear[0].abs() < 1e-9 && target.angular[2] == 0.0));
}

#[test]
fn blocked_base_misses_its_goals_in_turn() {
    let report = graph("differential-drive", 0.0, policy(CORNERS)).run("30 s").unwrap();
    assert_eq!(report.results["policy"]["goals_missed"], 2, "{}", report.results["policy"]);
    assert!((number(&report, "position_error_m") - 0.4 * 2.0_f64.sqrt()).abs() < 1e-9);
}

#[test]
fn goals_are_judged_by_the_true_pose_if_wired() {
    let truth = Source::new("truth", "truth", |_| {
        Some(BaseState {
            position: [0.4, 0.1, 0.0],
            orientation: [0.0, 0.0, 0.0, 1.0],
            ..BaseState::default()
        })
    });
    let config = "{ goals = [{ position = [0.4, 0.0] }] }";
    let judged = policy(config).subscribe("true_base", "truth");
    let report = graph("differential-drive", 1.0, judged).with(truth).run("6 s").unwrap();
    assert_eq!(report.results["policy"]["goals_missed"], 1, "{}", report.results["policy"]);
    assert!((number(&report, "position_error_m") - 0.1).abs() < 1e-9);
}

#[test]
fn half_the_speed_doubles_the_time_on_the_same_path() {
    let config = "{ goals = [{ position = [0.4, 0.0], dwell = \"0 s\" }] }";
    let distance = |factor: f64, time: &str| {
        let odometry = Probe::<Odometry>::for_topic("odometry");
        let policy = policy(config).parameter("speed", factor);
        graph("differential-drive", 1.0, policy).with(&odometry).run(time).unwrap();
        odometry.values().last().unwrap().position[0]
    };
    let (whole, half) = (distance(1.0, "1.5 s"), distance(0.5, "3 s"));
    assert!((0.1..0.3).contains(&whole) && (whole - half).abs() < 2e-3, "{whole} m, {half} m");
}

#[test]
fn invalid_bases_and_goals_are_refused_with_the_reason() {
    for (robot, config, words) in [
        ("ackermann", CORNERS, "cannot turn on the spot"),
        ("panda", CORNERS, "has no wheels"),
        ("differential-drive", "{ goals = [] }", "at least one"),
        (
            "differential-drive",
            "{ goals = [{ position = [1.0, 0.0] }], speed = 0.0 }",
            "expected a positive number",
        ),
        ("differential-drive", "{ goals = [{ position = [1.0, 1e9] }] }", "expected a number of at most 1e6"),
    ] {
        let error = graph(robot, 1.0, policy(config)).check().expect_err("it is refused");
        assert!(error.render(false).contains(words), "{}", error.render(false));
    }
}

#[test]
fn probable_degrees_of_a_goal_are_doubted() {
    let policy = policy("{ goals = [{ position = [0.4, 0.0] }, { position = [0.4, 0.4], yaw = 90.0 }] }");
    let warnings = graph("differential-drive", 1.0, policy).check().expect("warnings alone").warnings;
    let text = warnings.iter().map(|warning| warning.message()).collect::<Vec<_>>().join("\n");
    assert!(text.contains(".config.goals[1].yaw`: an angle of 90 rad"), "{text}");
}
