//! `policy.trajectory` and `policy.home` in a running graph, with joints that follow their commands exactly.

use motorium::component::Component;
use motorium::launcher::Report;
use motorium::prelude::*;
use motorium::testing::{Function, Graph, Instance, Probe, Source};
use motorium_policies::{HomePolicy, TrajectoryPolicy};

const START: [f64; 3] = [0.5, 0.8, 0.8];

/// An arm at its commanded position, offset by `off` rad.
fn arm(off: f64) -> Function {
    Function::new::<JointCommand, JointState>("arm", "command", "state", move |_, command| {
        let mut state = JointState::default();
        state.set_count(3);
        match command {
            Some(command) => {
                state.velocity_mut().copy_from_slice(command.velocity());
                for (q, position) in state.position_mut().iter_mut().zip(command.position()) {
                    *q = position + off;
                }
            }
            None => state.position_mut().copy_from_slice(&START),
        }
        Some(state)
    })
}

fn graph<C: Component>(off: f64, config: &str) -> Graph {
    let config: toml::Table = format!("config = {config}").parse().unwrap();
    let policy = Instance::of::<C>("policy")
        .robot("arm")
        .trigger("state")
        .subscribe("joint_state", "state")
        .publish("joint_command", "command")
        .set("config", config["config"].clone());
    Graph::new("trajectory-test").robot("arm", "planar-3r").with(arm(off)).with(policy)
}

fn number(report: &Report, key: &str) -> f64 {
    report.results["policy"][key].as_f64().unwrap_or_else(|| panic!("{}", report.results["policy"]))
}

pub(crate) const LIMITS: &str =
    "limits = { velocity = 1.0, acceleration = 4.0, jerk = [40.0, 50.0, 60.0], fraction = 1.0 }";

#[test]
fn probable_degrees_of_goals_are_doubted() {
    let doubts = |roll: f64| {
        let config = format!(
            "goals = [{{ end_effector = {{ position = [0.4, 0.0, 0.4], rpy = [{roll}, 0.0, 0.0] }} }}]"
        );
        let config: toml::Table = format!("config = {{ {config} }}").parse().unwrap();
        let policy = Instance::of::<TrajectoryPolicy>("policy")
            .robot("arm")
            .trigger("state")
            .subscribe("joint_state", "state")
            .publish("joint_command", "command")
            .set("config", config["config"].clone());
        let state = Source::new("arm", "state", |_| None::<JointState>);
        let checked = Graph::new("degrees-test").robot("arm", "panda").with(state).with(policy).check();
        let warnings = checked.expect("warnings alone").warnings;
        let warnings = warnings.iter().map(|warning| warning.message().to_string());
        warnings.filter(|text| text.contains("degrees")).collect::<Vec<_>>()
    };
    assert_eq!(doubts(std::f64::consts::PI), Vec::<String>::new());
    let rule = "angles are in radians: if these are degrees, write 3.1416";
    assert_eq!(
        doubts(180.0),
        [format!("`policy.config.goals[0].end_effector.rpy`: an angle of 180 rad; {rule}")]
    );

    let config = "{ goals = [{ position = [90.0, 0.0, 0.0] }] }";
    let text = graph::<TrajectoryPolicy>(0.0, config).check().expect_err("it is refused").render(false);
    assert!(text.contains("outside of its range") && text.contains("90 degrees are 1.5708 rad"), "{text}");
}

/// The commands of a run.
fn commands<C: Component>(config: &str, time: &str) -> (Vec<JointCommand>, Report) {
    let probe = Probe::<JointCommand>::for_topic("command").triggered();
    let report = graph::<C>(0.0, config).with(&probe).run(time).unwrap();
    (probe.values(), report)
}

/// Asserts that commands at 1 kHz, from rest, keep the [`LIMITS`].
#[track_caller]
pub(crate) fn assert_within_limits(commands: &[JointCommand], profile: &str) {
    let (dt, mut before) = (1e-3, ([0.0; 3], [0.0; 3]));
    for (step, command) in commands.iter().enumerate() {
        for joint in 0..3 {
            let velocity = command.velocity()[joint];
            let acceleration = (velocity - before.0[joint]) / dt;
            let jerk = (acceleration - before.1[joint]) / dt;
            assert!(velocity.abs() <= 1.0 + 1e-9, "{profile} step {step}");
            assert!(acceleration.abs() <= 4.0 + 1e-6, "{profile} step {step}: {acceleration}");
            let most = [40.0, 50.0, 60.0][joint];
            assert!(step < 2 || jerk.abs() <= most + 1e-3, "{profile} step {step}: {jerk} of {most}");
            (before.0[joint], before.1[joint]) = (velocity, acceleration);
        }
    }
}

#[test]
fn joints_reach_their_goals_within_limits() {
    for profile in ["time_optimal", "minimum_jerk"] {
        let config = format!(
            "{{ profile = \"{profile}\", {LIMITS}, goals = [{{ position = [0.0, 0.0, 1.0] }}, \
             {{ offset = {{ joint2 = 0.7 }}, dwell = \"100 ms\" }}, \"bent\"] }}"
        );
        let (commands, report) = commands::<TrajectoryPolicy>(&config, "6 s");
        assert_eq!(report.results["policy"]["goals_reached"], 3, "{profile}: {}", report.results["policy"]);
        assert!(number(&report, "joint_error") < 1e-3, "{}", report.results["policy"]);
        assert_within_limits(&commands, profile);
        let last = commands.last().unwrap();
        let off = last.position().iter().zip(START).map(|(q, goal)| (q - goal).abs()).fold(0.0, f64::max);
        assert!(off < 1e-12 && last.velocity() == [0.0; 3], "{:?}", last.position());
        let policy = report.components.iter().find(|component| component.name == "policy").unwrap();
        assert_eq!(policy.allocations, Some(0));
    }
}

#[test]
fn motion_lasts_the_shortest_or_the_given_time() {
    // one joint by 1 rad: d / v + v / a + a / j
    let goal = |rest: &str| format!("{{ {LIMITS}, goals = [{{ offset = {{ joint1 = -1.0 }}{rest} }}] }}");
    let (_, report) = commands::<TrajectoryPolicy>(&goal(""), "3 s");
    assert!((number(&report, "moving_s") - (1.0 + 0.25 + 0.1)).abs() < 1e-9, "{}", report.results["policy"]);
    let (_, report) = commands::<TrajectoryPolicy>(&goal(", duration = \"2 s\""), "3 s");
    assert!((number(&report, "moving_s") - 2.0).abs() < 1e-9);
    let (_, report) = commands::<TrajectoryPolicy>(&goal(", duration = \"10 ms\""), "3 s");
    assert!((number(&report, "moving_s") - 1.35).abs() < 1e-9, "limits take precedence over a duration");
}

#[test]
fn home_is_a_trajectory_to_the_pose_of_the_profile() {
    let (commands, report) = commands::<HomePolicy>("{ pose = \"stretched\" }", "8 s");
    assert_eq!(report.results["policy"]["goals_reached"], 1, "{}", report.results["policy"]);
    assert!(commands.last().unwrap().position().iter().all(|q| q.abs() < 1e-12));
    let (commands, _) = self::commands::<HomePolicy>("{}", "1 s");
    assert_eq!(commands.last().unwrap().position(), START, "the arm is at home");
}

#[test]
fn a_missed_goal_names_its_joint() {
    let config = "{ goals = [\"stretched\"], tolerance = 0.02 }";
    let report = graph::<TrajectoryPolicy>(0.03, config).run("12 s").unwrap();
    assert_eq!(report.results["policy"]["goals_missed"], 1, "{}", report.results["policy"]);
    assert!((number(&report, "joint_error") - 0.03).abs() < 1e-3);
    assert!(report.results["policy"]["joint_of_the_error"].as_str().unwrap().starts_with("joint"));
}

#[test]
fn unreachable_goals_are_refused_with_the_reason() {
    for (config, words) in [
        ("{ goals = [] }", "at least one"),
        ("{ goals = [\"folded\"] }", "folded"),
        ("{ goals = [{ position = [0.0, 0.0] }] }", "2 numbers, expected 3"),
        ("{ goals = [{ position = { elbow = 1.0 } }] }", "no joint \"elbow\""),
        ("{ goals = [{ position = [0.0, 0.0, 9.0] }] }", "outside of its range"),
        (
            "{ goals = [{ position = [0.0, 0.0, 2.0] }, { offset = [0.0, 0.0, 2.0] }] }",
            "outside of its range",
        ),
        ("{ goals = [{ duration = \"1 s\" }] }", "`end_effector` and `gripper` are all missing"),
        ("{ goals = [{ pose = \"bent\", offset = [0.0, 0.0, 0.0] }] }", "more than one of"),
        (
            "{ goals = [{ end_effector = { position = [0.4, 0.2, 0.0] } }] }",
            "the previous goal does not determine it",
        ),
        (
            "{ goals = [\"bent\", { end_effector = { position = [3.0, 0.0, 0.0] } }] }",
            "and the links reach 1.200 m in one line",
        ),
        (
            "{ goals = [{ pose = \"bent\", end_effector = { position = [0.4, 0.2, 0.0] } }] }",
            "more than one of",
        ),
        ("{ goals = [{ gripper = \"open\" }] }", "has no `fingers` in its profile"),
        ("{ goals = [{ gripper = \"shut\" }] }", "expected \"open\", \"close\""),
        ("{ goals = [\"bent\"], frame = \"wrist\" }", "wrist"),
        ("{ goals = [\"bent\"], limits = { fraction = 1.5 } }", "at most 1"),
        ("{ goals = [\"bent\"], limits = { jerk = 0.0 } }", "expected a positive number"),
        ("{ goals = [\"bent\"], tolerance = 0.0 }", "expected a positive number"),
    ] {
        let error = graph::<TrajectoryPolicy>(0.0, config).check().expect_err("it is refused").render(false);
        assert!(error.contains(words), "no `{words}` in\n{error}");
    }
    let error = graph::<HomePolicy>(0.0, "{ pose = \"folded\" }").check().expect_err("it is refused");
    assert!(error.render(false).contains("pose"), "{}", error.render(false));
}
