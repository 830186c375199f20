//! `control.qp` in a graph: a simulated Panda, targets, and the controller between them, in lockstep.

use std::path::Path;

use motorium::launcher::Report;
use motorium::testing::Graph;

use crate::graph::{Targets, bare_controller, controller, graph, run};

pub(crate) fn number(value: &serde_json::Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

#[test]
fn hand_reaches_its_goals_within_limits() {
    let report = run(graph("{}", Targets::default(), controller("{}")));
    let result = &report.results["controller"];
    assert_eq!(result["goals_reached"], 2);
    assert!(number(&result["position_error_m"]) < 1e-5, "{result}");
    assert!(number(&result["orientation_error_rad"]) < 1e-4, "{result}");
    assert_eq!(result["steps_without_solution"], 0);
    assert_eq!(report.results["plant"]["broken_limits"], 0);
    // the position of the hand, computed independently
    let hand = &report.results["plant"]["hand"];
    let home = number(&run(graph("{}", resting(), controller("{}"))).results["plant"]["hand"][1]);
    assert!((number(&hand[1]) - home + 0.2).abs() < 1e-5, "{hand}");
}

#[test]
fn an_empty_list_of_tasks_is_refused() {
    let error = graph("{}", Targets::default(), controller("{ tasks = [] }"));
    let error = error.check().expect_err("it must be refused").render(false);
    for word in ["tasks", "an empty list", "posture = {}", "leave `tasks` out"] {
        assert!(error.contains(word), "no `{word}` in\n{error}");
    }
}

#[test]
fn a_step_allocates_nothing() {
    let report = run(graph("{}", Targets::default(), controller("{}")));
    let controller = report.components.iter().find(|component| component.name == "controller").unwrap();
    assert_eq!((controller.allocations, controller.allocations_apart), (Some(0), Some(0)));
}

#[test]
fn parameters_override_the_configuration() {
    let configured = "{ tasks = [{ cartesian = { gain = 5.0 } }, { posture = { weight = 0.01 } }] }";
    let configured = run(graph("{}", Targets::default(), controller(configured)));
    let set = controller("{}").parameter("cartesian_gain", 5.0).parameter("posture_weight", 0.01);
    let set = run(graph("{}", Targets::default(), set));
    assert_eq!(configured.state_hash, set.state_hash);
    let softer = controller("{}").parameter("kp_scale", 0.5);
    let softer = graph("{ gravity = -10.5 }", Targets::default(), softer);
    let stiff = run(graph("{ gravity = -10.5 }", Targets::default(), controller("{}")));
    assert_ne!(run(softer).state_hash, stiff.state_hash);
}

#[test]
fn a_strong_posture_disturbs_the_hand_only_in_a_sum() {
    let error = |level: u32| {
        let tasks = format!(
            "{{ tasks = [{{ cartesian = {{}} }}, {{ posture = {{ level = {level}, weight = 1.0, gain = 5.0 }} }}] }}"
        );
        let report = run(graph("{}", Targets::default(), controller(&tasks)));
        assert_eq!(report.results["controller"]["steps_without_solution"], 0);
        number(&report.results["controller"]["position_error_m"])
    };
    let (sum, below) = (error(1), error(2));
    assert!(sum > 0.02, "{sum}");
    assert!(below < 1e-4, "{below}");
}

#[test]
fn regularising_a_level_does_not_change_higher_levels() {
    let ran = |levels: &str| {
        let tasks = "tasks = [{ cartesian = {} }, { posture = { level = 2, weight = 0.1, positions = [0.6, -0.5, 0.3, -2.0, 0.2, 1.8, 0.5, 0.02] } }]";
        run(graph("{}", resting(), controller(&format!("{{ {tasks}, {levels} }}"))))
    };
    let (usual, calm) = (ran("levels = []"), ran("levels = [{ level = 2, damping = 0.5 }]"));
    let elbow = |report: &Report| number(&report.results["plant"]["q"][2]).abs();
    // weighted against fifty times its weight, the posture has hardly moved the elbow
    assert!(elbow(&usual) > 0.03 && elbow(&calm) < 0.2 * elbow(&usual), "{} {}", elbow(&calm), elbow(&usual));
    for report in [&usual, &calm] {
        assert!(number(&report.results["controller"]["position_error_m"]) < 1e-4);
    }
    let same = ran("levels = [{ level = 1, damping = 1e-7 }, { level = 2, damping = 1e-7 }]");
    assert_eq!(same.state_hash, usual.state_hash);
}

#[test]
fn gravity_comes_from_the_world_unless_configured() {
    let hash = |config: &str, world: Option<&str>| {
        let graph = graph("{ gravity = -1.62 }", Targets::default(), controller(config));
        run(world.into_iter().fold(graph, |graph, gravity| graph.set("world.gravity", gravity))).state_hash
    };
    let stated = hash("{ gravity = [0.0, 0.0, -1.62] }", None);
    assert_eq!(hash("{}", Some("[0.0, 0.0, -1.62]")), stated);
    assert_eq!(hash("{ gravity = [0.0, 0.0, -1.62] }", Some("[0.0, 0.0, -9.0]")), stated);
    assert_ne!(hash("{}", None), stated);
}

#[test]
fn feedback_corrects_sagging_drives() {
    // gravity is stronger than the controller believes
    let plant = "{ gravity = -10.5 }";
    let measured = run(graph(plant, Targets::default(), controller("{ feedback = \"measured\" }")));
    let setpoint = run(graph(plant, Targets::default(), controller("{ feedback = \"setpoint\" }")));
    let error = |report: &Report| number(&report.results["controller"]["position_error_m"]);
    assert!(error(&measured) < 1e-4, "{}", error(&measured));
    assert!(error(&setpoint) > 1e-3, "{}", error(&setpoint));
}

#[test]
fn no_command_is_sent_without_a_joint_state() {
    let report = run(graph("{ silent_from = 0.5, silent_to = 0.8 }", Targets::default(), controller("{}")));
    let result = &report.results["controller"];
    // the controller is triggered by the state, so it does not step
    let steps = report.components.iter().find(|component| component.name == "controller").unwrap().steps;
    assert!((3_690..=3_702).contains(&steps), "{steps} steps");
    let commands = report.results["plant"]["commands"].as_u64().unwrap();
    assert!((3_690..=3_715).contains(&commands), "{commands} fresh commands");
    assert!(number(&result["position_error_m"]) < 1e-3, "{result}");
    // the arm was released and fell; it continues from its measured position without a discontinuity
    assert_eq!(report.results["plant"]["broken_limits"], 0);
    assert!(number(&report.results["plant"]["largest_lead"]) < 0.05, "{}", report.results["plant"]);
}

#[test]
fn a_timed_controller_does_not_act_on_a_stale_state() {
    let controller = controller("{}").rate("1 kHz");
    let report = run(graph("{ silent_from = 0.5, silent_to = 0.8 }", Targets::default(), controller));
    let result = &report.results["controller"];
    let stale = result["steps_without_fresh_state"].as_u64().unwrap();
    assert!((285..=295).contains(&stale), "{stale} steps");
    assert!(number(&result["position_error_m"]) < 1e-4, "{result}");
}

#[test]
fn silent_target_stands_still_at_its_last_position() {
    let targets = Targets { offsets: vec![[0.0, 0.3, 0.0]], silent_from: 0.5, ..Targets::default() };
    let report = run(graph("{}", targets, controller("{}")));
    // half-way, at 0.56 m/s: extrapolating the velocity would leave an error of 56 mm
    let last = number(&report.results["controller"]["tasks"]["cartesian"]["last_position_error_m"]);
    assert!(last < 1e-4, "{last}");
    assert!(report.results["controller"]["position_error_m"].is_null(), "the target must not rest at a goal");
}

#[test]
fn a_blocked_joint_is_pushed_with_no_more_than_the_lead_allows() {
    let report = run(graph("{ blocked = 3 }", Targets::default(), controller("{ max_lead = 0.03 }")));
    assert_eq!(report.results["controller"]["steps_without_solution"], 0);
    let plant = &report.results["plant"];
    assert_eq!(plant["broken_limits"], 0);
    let lead = number(&plant["largest_lead"]);
    assert!((0.029..0.032).contains(&lead), "{lead}");
}

#[test]
fn same_graph_publishes_identical_bits() {
    let once = run(graph("{}", Targets::default(), controller("{}")));
    let twice = run(graph("{}", Targets::default(), controller("{}")));
    assert!(once.state_hash.is_some());
    assert_eq!(once.state_hash, twice.state_hash);
    let weaker = controller("{ tasks = [{ cartesian = { gain = 5.0 } }, { posture = {} }] }");
    let weaker = run(graph("{}", Targets::default(), weaker));
    assert_ne!(once.state_hash, weaker.state_hash);
}

/// A target that stays at its initial position.
fn resting() -> Targets {
    Targets { offsets: vec![[0.0; 3]], ..Targets::default() }
}

fn position(value: &serde_json::Value) -> [f64; 3] {
    std::array::from_fn(|axis| number(&value[axis]))
}

/// The centre of mass of the arm at its initial position.
fn resting_centre_of_mass() -> [f64; 3] {
    position(&run(graph("{}", resting(), controller("{}"))).results["plant"]["centre_of_mass"])
}

#[test]
fn the_centre_of_mass_comes_to_its_goals_within_limits() {
    let start = resting_centre_of_mass();
    let offsets = vec![[0.02, 0.05, 0.0], [-0.03, 0.04, 0.03]];
    let targets = Targets { offsets, start: Some(start), ..Targets::default() };
    let tasks = "{ tasks = [{ centre_of_mass = { target = \"target\" } }, { posture = {} }] }";
    let report = run(graph("{}", targets, controller(tasks)));
    let result = &report.results["controller"];
    assert_eq!(result["goals_reached"], 2, "{result}");
    assert!(number(&result["position_error_m"]) < 1e-5, "{result}");
    assert!(result["orientation_error_rad"].is_null(), "a point has no orientation: {result}");
    assert_eq!(result["tasks"]["centre_of_mass"]["goals_reached"], 2);
    assert_eq!(result["steps_without_solution"], 0);
    assert_eq!(report.results["plant"]["broken_limits"], 0);
    let controller = report.components.iter().find(|component| component.name == "controller").unwrap();
    assert_eq!(controller.allocations, Some(0));
    let end = position(&report.results["plant"]["centre_of_mass"]);
    for (axis, offset) in [-0.03, 0.04, 0.03].into_iter().enumerate() {
        assert!((end[axis] - start[axis] - offset).abs() < 1e-5, "axis {axis}: {end:?} from {start:?}");
    }
}

#[test]
fn centre_of_mass_without_a_target_keeps_its_position() {
    // the posture moves the elbow and cannot move the centre of mass
    let posture = "{ posture = { positions = [0.3, -0.6, -0.3, -2.0, 0.2, 1.8, 0.5, 0.02], weight = 0.01 } }";
    let unwired = |tasks: &str| {
        let controller = bare_controller(&format!("{{ tasks = [{tasks}] }}")).robot("panda");
        run(graph("{}", resting(), controller))
    };
    let start = resting_centre_of_mass();
    let moved = |report: &Report| {
        let end = position(&report.results["plant"]["centre_of_mass"]);
        (0..3).map(|axis| (end[axis] - start[axis]).powi(2)).sum::<f64>().sqrt()
    };
    let held = unwired(&format!("{{ centre_of_mass = {{}} }}, {posture}"));
    let free = unwired(posture);
    assert!(moved(&held) < 1e-4, "{} m", moved(&held));
    assert!(moved(&free) > 0.01, "{} m", moved(&free));
    let elbow = |report: &Report| number(&report.results["plant"]["q"][2]);
    assert!(elbow(&held).abs() > 0.05, "the posture moves the elbow: {}", elbow(&held));
}

#[test]
fn a_hand_keeps_its_box_and_speed_for_any_target() {
    let limited =
        |limits: &str| run(graph("{}", Targets::default(), controller(&format!("{{ limits = {limits} }}"))));
    let free = position(&run(graph("{}", Targets::default(), controller("{}"))).results["plant"]["hand"]);
    let wall = free[1] + 0.05;
    let boxed = limited(&format!("{{ frames = [{{ y = [{wall}, 10.0] }}] }}"));
    let hand = position(&boxed.results["plant"]["hand"]);
    assert!(hand[1] > wall - 1e-4 && hand[1] < wall + 2e-3, "{hand:?}, free {free:?}");
    // motion that the box allows is unaffected
    assert!((hand[0] - free[0]).abs() < 1e-2 && (hand[2] - free[2]).abs() < 1e-2, "{hand:?}, free {free:?}");
    assert_eq!(boxed.results["controller"]["steps_without_solution"], 0);
    let component = boxed.components.iter().find(|component| component.name == "controller").unwrap();
    assert_eq!((component.allocations, component.allocations_apart), (Some(0), Some(0)));
    // at 0.05 m/s it has not moved far in 4 s
    let slow = position(&limited("{ frames = [{ max_linear = 0.05 }] }").results["plant"]["hand"]);
    let start = position(&run(graph("{}", resting(), controller("{}"))).results["plant"]["hand"]);
    for axis in 0..3 {
        assert!((slow[axis] - start[axis]).abs() < 0.05 * 4.0 + 1e-3, "{slow:?}");
    }
    assert_refused("{ limits = { frames = [{}] } }", &["limits.frames[0].frame", "neither a position"]);
    assert_refused(
        "{ limits = { frames = [{ z = [0.5, 0.4] }] } }",
        &["limits.frames[0].z", "the range 0.5 to 0.4 is too narrow"],
    );
}

#[test]
fn commands_use_the_gains_of_the_profile_or_configuration() {
    let profile = run(graph("{}", Targets::default(), controller("{}")));
    let gains = motorium_robots::load("panda", Path::new(".")).unwrap();
    let gains = gains.profile.unwrap().gains(&gains.model).unwrap();
    let published = &profile.results["plant"];
    assert_eq!(published["kp"], serde_json::json!(gains.kp.as_slice()));
    assert_eq!(published["kd"], serde_json::json!(gains.kd.as_slice()));
    let given = run(graph(
        "{}",
        Targets::default(),
        controller("{ kp = 700, kd = [50, 51, 52, 53, 54, 55, 56, 57] }"),
    ));
    assert_eq!(given.results["plant"]["kp"], serde_json::json!(vec![700.0; 8]));
    assert_eq!(given.results["plant"]["kd"][7], 57.0);
}

/// Returns the error message of a refused graph.
#[track_caller]
fn refused(graph: Graph) -> String {
    graph.check().expect_err("it must be refused").render(false)
}

#[track_caller]
fn assert_refused(config: &str, words: &[&str]) {
    let error = refused(graph("{}", Targets::default(), controller(config)));
    for words in words {
        assert!(error.contains(words), "no `{words}` in\n{error}");
    }
}

#[test]
fn invalid_configurations_are_refused_with_key_and_advice() {
    assert_refused(
        "{ tasks = [{ cartesian = { frame = \"panda_hand_tpc\" } }] }",
        &["tasks[0].cartesian.frame", "panda_hand_tcp"],
    );
    assert_refused("{ tasks = [{ cartesian = { gain = -1.0 } }] }", &["tasks[0].cartesian.gain", "-1"]);
    assert_refused(
        "{ tasks = [{ centre_of_mass = { shares = [1.0, 0.0, 2.0] } }] }",
        &["tasks[0].centre_of_mass.shares", "2, expected a number from 0 to 1"],
    );
    assert_refused("{ tasks = [{ posture = { level = 0 } }] }", &["tasks[0].posture.level", "1 to 8"]);
    assert_refused("{ tasks = [{ cartesian = { gian = 1.0 } }] }", &["gian", "gain"]);
    assert_refused("{ tasks = [{ posture = { pose = \"raedy\" } }] }", &["tasks[0].posture.pose", "ready"]);
    assert_refused(
        "{ tasks = [{ posture = { positions = [0.0, 1.0] } }] }",
        &["tasks[0].posture.positions", "2 numbers, expected 8", "panda_joint1"],
    );
    assert_refused(
        "{ tasks = [{ cartesian = {} }, { cartesian = { name = \"other\" } }] }",
        &["two tasks read their target from `target`"],
    );
    assert_refused("{ tasks = [{ posture = {} }, { posture = {} }] }", &["task name `posture`"]);
    assert_refused("{ kd = [1.0] }", &["kd", "1 numbers, expected 8"]);
    assert_refused("{ kp = -5 }", &["kp of joint \"panda_joint1\" is -5"]);
    assert_refused(
        "{ levels = [{ level = 2, damping = 1e-3 }] }",
        &["levels[0].level", "no task", "level 1"],
    );
    let twice = "{ levels = [{ level = 1, damping = 1e-3 }, { level = 1, damping = 1e-4 }] }";
    assert_refused(twice, &["levels[1].level", "twice"]);
    assert_refused(
        "{ levels = [{ level = 1, damping = 2.0 }] }",
        &["levels[0].damping", "2, expected a number from"],
    );
    assert_refused("{ levels = [{ level = 1 }] }", &["damping"]);
    assert_refused("{ limits = { velocity = { fraction = 1.5 } } }", &["limits.velocity.fraction", "1.5"]);
    assert_refused("{ state_timeout = \"10\" }", &["state_timeout", "unit"]);
    assert_refused("{ max_lead = 0.0 }", &["max_lead"]);
}

#[test]
fn a_controller_without_a_robot_is_refused() {
    let error = refused(graph("{}", Targets::default(), bare_controller("{}")));
    assert!(error.contains("add `robot = \"NAME\"`"), "{error}");
}
