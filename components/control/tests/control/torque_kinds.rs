//! Velocity task kinds used with torques, in a graph in lockstep.

use motorium::launcher::Report;
use motorium::state::TwistTarget;
use motorium::testing::Source;
use nalgebra::Vector3;

use crate::component::number;
use crate::graph::{Targets, bare_controller, graph, run};

/// Runs a Panda with torques and these tasks, without a target.
#[track_caller]
fn ran(tasks: &str) -> Report {
    driven(tasks, None)
}

/// Runs a Panda with torques and these tasks, with a target for `input`.
#[track_caller]
fn driven(tasks: &str, target: Option<(&str, TwistTarget)>) -> Report {
    let still = Targets { offsets: vec![[0.0; 3]], ..Targets::default() };
    let config = format!("{{ inverse_dynamics = {{}}, tasks = [{tasks}] }}");
    let mut controller = bare_controller(&config).robot("panda");
    if let Some((input, _)) = target {
        controller = controller.subscribe(input, "panda/twist");
    }
    let mut graph = graph("{}", still, controller);
    if let Some((_, twist)) = target {
        graph = graph.with(Source::new("twist", "panda/twist", move |_| Some(twist)));
    }
    let report = run(graph);
    let component = report.components.iter().find(|component| component.name == "controller").unwrap();
    assert_eq!((component.allocations, component.allocations_apart), (Some(0), Some(0)));
    assert_eq!(report.results["controller"]["steps_without_solution"], 0, "{}", report.results["controller"]);
    report
}

fn hand(report: &Report) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| number(&report.results["plant"]["hand"][axis]))
}

/// A posture that moves the whole arm.
const AWAY: &str =
    "{ posture = { positions = [0.4, -0.5, -0.3, -2.0, 0.2, 1.8, 0.5, 0.02], weight = 0.1, gain = 3.0 } }";

#[test]
fn relative_task_keeps_its_pose_while_the_arm_moves() {
    let relative = "{ relative = { frame = \"panda_hand_tcp\", other = \"panda_link2\" } }";
    let with = ran(&format!("{relative}, {AWAY}"));
    let result = &with.results["controller"]["tasks"]["relative"];
    assert!(number(&result["last_position_error_m"]) < 0.02, "{result}");
    let free = ran(AWAY);
    assert!((hand(&with) - hand(&free)).norm() > 0.02);
}

#[test]
fn a_frame_drives_forward_and_never_sideways() {
    let twist = TwistTarget { linear: [0.05, 0.0, 0.0], ..TwistTarget::default() };
    let task = "{ unicycle = { frame = \"panda_hand\", rate = 30.0 } }, { posture = { weight = 1e-4 } }";
    let stood = hand(&ran(task));
    let moved = hand(&driven(task, Some(("unicycle_target", twist)))) - stood;
    // 4 s of 5 cm/s, less the weak pull of the posture; the hand's x points to the front, its y to the side
    assert!((0.15..0.205).contains(&moved.norm()) && moved.y.abs() < 0.01, "{moved}");
}

#[test]
fn wheels_steer_and_roll_without_slip() {
    let twist = TwistTarget { linear: [0.1, 0.05, 0.0], ..TwistTarget::default() };
    let steer = format!(
        "{{ rigid_rotation = {{ frame = \"panda_hand\", base = \"panda_link0\" }} }}, {}",
        AWAY.replace("weight = 0.1", "weight = 1e-3")
    );
    let steered = driven(&steer, Some(("base_target", twist)));
    let error = number(&steered.results["controller"]["tasks"]["rigid_rotation"]["last_error_rad"]);
    assert!(error.abs() < 0.02, "{error}");
    // the contact point of a wheel of negligible radius is its centre, which must not move
    let start = hand(&ran("{ posture = {} }"));
    let held = ran(&format!(
        "{{ rolling = {{ frame = \"panda_hand_tcp\", axis = [1, 0, 0], radius = 1e-6, weight = 100.0 }} }}, {AWAY}"
    ));
    assert!((hand(&held) - start).norm() < 5e-3, "{} {start}", hand(&held));
}

#[test]
fn measures_grow_or_shrink_under_their_tasks() {
    let panda = motorium_robots::load("panda", std::path::Path::new(".")).unwrap().model;
    let end = |tasks: &str| -> Vec<f64> {
        let report = ran(tasks);
        (0..8).map(|joint| number(&report.results["plant"]["q"][joint])).collect()
    };
    let measure = |q: &[f64]| {
        let mut kinematics = motorium_robots::Kinematics::new(&panda);
        kinematics.update(&panda, q);
        let tool = panda.frame("panda_hand_tcp").unwrap();
        kinematics.manipulability(&panda, tool, motorium_robots::TaskRows::POSITION)
    };
    let toward = |of: &str| {
        measure(&end(&format!("{{ manipulability = {{ of = \"{of}\", gain = 10.0, weight = 1.0 }} }}")))
    };
    assert!(toward("velocity") > 1.05 * toward("force"));

    let load = |q: &[f64]| {
        let mut effort = vec![0.0; 8];
        let gravity = Vector3::new(0.0, 0.0, -9.81);
        motorium_robots::Dynamics::new(&panda).gravity(&panda, q, gravity, &mut effort);
        effort.iter().zip(panda.effort_limit()).map(|(effort, limit)| (effort / limit).powi(2)).sum::<f64>()
    };
    let rest = load(&end("{ minimum = { of = \"velocity\", weight = 1.0 } }"));
    let less = load(&end("{ minimum = { of = \"effort\", gain = 20.0, weight = 1.0 } }"));
    assert!(less < 0.7 * rest, "{less} {rest}");
}

#[test]
fn wheel_task_holds_exactly_as_a_torque_constraint() {
    let held = ran(&format!(
        "{{ constraint = {{ task = {{ unicycle = {{ frame = \"panda_hand_tcp\", yaw_weight = 0.0 }} }} }} }}, {AWAY}"
    ));
    let (start, free) = (hand(&ran("{ posture = {} }")), hand(&ran(AWAY)));
    // the axis of the hand, along which it can move, tilts with the posture
    let (kept, away) = ((hand(&held) - start).xy().norm(), (free - start).xy().norm());
    assert!(kept < 0.2 * away, "{kept} {away}");
    let relaxed = &held.results["controller"]["solver"]["steps_relaxed"];
    assert_eq!(relaxed, 0, "the constraint must hold exactly");
}

#[test]
fn impedances_replace_the_gains_of_hand_and_joints() {
    let spring = "impedance = { stiffness = 400.0, damping = 80.0, rotational_stiffness = 10.0, rotational_damping = 1.0 }";
    let joints = "impedance = { stiffness = 20.0, damping = 4.0 }";
    let tasks = format!("{{ cartesian = {{ {spring} }} }}, {{ posture = {{ level = 2, {joints} }} }}");
    let config = |tasks: &str| format!("{{ inverse_dynamics = {{}}, tasks = [{tasks}] }}");
    let moving = |tasks: &str, parameter: Option<(&str, f64)>| {
        let controller = bare_controller(&config(tasks)).robot("panda").subscribe("target", "panda/target");
        let controller = parameter
            .into_iter()
            .fold(controller, |controller, (name, value)| controller.parameter(name, value));
        run(graph("{}", Targets::default(), controller))
    };
    let report = moving(&tasks, None);
    let component = report.components.iter().find(|component| component.name == "controller").unwrap();
    assert_eq!((component.allocations, component.allocations_apart), (Some(0), Some(0)));
    let error = |report: &Report| {
        number(&report.results["controller"]["tasks"]["cartesian"]["last_position_error_m"])
    };
    assert!(error(&report) < 0.01, "must reach its target: {}", error(&report));
    let softer = moving(&tasks, Some(("cartesian_stiffness", 40.0)));
    assert!(error(&softer) > 2.0 * error(&report), "{} {}", error(&softer), error(&report));

    let refused = |config: &str, words: &[&str]| {
        let graph = graph(
            "{}",
            Targets::default(),
            bare_controller(config).robot("panda").subscribe("target", "panda/target"),
        );
        let error = graph.check().expect_err("it must be refused").render(false);
        for word in words {
            assert!(error.contains(word), "no `{word}` in\n{error}");
        }
    };
    refused(
        &format!("{{ tasks = [{{ cartesian = {{ {spring} }} }}] }}"),
        &["cartesian.impedance", "inverse_dynamics"],
    );
    refused(
        &config(&format!("{{ cartesian = {{ gain = 3.0, {spring} }} }}")),
        &["cartesian.gain", "together with `impedance`"],
    );
    refused(
        &config("{ posture = { impedance = { stiffness = [1.0], damping = 1.0 } } }"),
        &["impedance.stiffness", "expected 8"],
    );
    refused(
        &config("{ posture = { impedance = { stiffness = -1.0, damping = 1.0 } } }"),
        &["impedance.stiffness", "-1"],
    );
    refused(&config("{ cartesian = { impedance = { stiffness = 1.0 } } }"), &["damping"]);
}
