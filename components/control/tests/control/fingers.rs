//! Goals of fingers, next to a Cartesian task of the hand.

use motorium::launcher::Report;
use motorium::state::MotionGoal;
use motorium::testing::Source;

use crate::component::number;
use crate::graph::{Targets, checked, controller, graph, run};

const FINGER: usize = 7;

/// Publishes each goal at its time, s.
fn sender(goals: Vec<(f64, MotionGoal)>) -> Source {
    Source::new("sender", "panda/fingers", move |tick| {
        let due = goals.iter().find(|(time, _)| (tick.time() - time).abs() < 0.5 * tick.dt());
        due.map(|(_, goal)| *goal)
    })
}

fn finger(number: u64, position: f64, duration: f64) -> MotionGoal {
    let mut goal = MotionGoal::new(number);
    goal.set_joint(FINGER, position);
    goal.duration = duration;
    goal
}

fn run_with(plant: &str, config: &str, goals: Vec<(f64, MotionGoal)>) -> Report {
    let controller = controller(config).subscribe("fingers", "panda/fingers");
    checked(run(graph(plant, Targets::default(), controller).with(sender(goals))))
}

#[test]
fn fingers_follow_their_goals_while_the_hand_moves() {
    for config in ["{}", "{ inverse_dynamics = {} }"] {
        let report = run_with("{}", config, vec![(0.5, finger(1, 0.01, 0.5)), (2.5, finger(2, 0.04, 0.0))]);
        let (plant, result) = (&report.results["plant"], &report.results["controller"]);
        assert!((number(&plant["q"][FINGER]) - 0.04).abs() < 1e-3, "{config}: {plant}");
        assert_eq!(plant["broken_limits"], 0, "{config}");
        assert_eq!((&result["finger_goals"], &result["finger_goals_refused"]), (&2.into(), &0.into()));
        assert_eq!(result["goals_reached"], 2, "{config}: {result}");
        // the gains of the profile, independent of the arm's fraction
        assert_eq!(number(&plant["kp"][FINGER]), 1000.0, "{config}");
    }
}

#[test]
fn a_goal_lasts_its_duration_and_no_longer() {
    let at = |end: f64, duration: f64| {
        let controller = controller("{}").subscribe("fingers", "panda/fingers");
        let graph = graph("{}", Targets::default(), controller);
        let report = graph.with(sender(vec![(0.5, finger(1, 0.005, duration))])).run(&format!("{end} s"));
        number(&report.unwrap().results["plant"]["q"][FINGER])
    };
    // from 35 mm to 5 mm: half way after half of the time
    assert!((at(1.0, 1.0) - 0.02).abs() < 1e-3, "{}", at(1.0, 1.0));
    assert!((at(1.6, 1.0) - 0.005).abs() < 1e-3, "{}", at(1.6, 1.0));
    // 0.2 m/s without a duration
    assert!((at(0.55, 0.0) - 0.025).abs() < 3e-3, "{}", at(0.55, 0.0));
}

#[test]
fn before_the_first_goal_the_tasks_move_the_fingers() {
    let tasks = "{ tasks = [{ cartesian = {} }, { posture = { positions = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785, 0.01], level = 2, gain = 5.0, weight = 1.0 } }] }";
    let without = run_with("{}", tasks, Vec::new());
    let without = number(&without.results["plant"]["q"][FINGER]);
    assert!((without - 0.01).abs() < 1e-3, "{without}");
    let with = run_with("{}", tasks, vec![(1.0, finger(1, 0.03, 0.2))]);
    assert!((number(&with.results["plant"]["q"][FINGER]) - 0.03).abs() < 1e-3);
}

#[test]
fn a_blocked_finger_is_pushed_by_the_distance_to_its_goal() {
    let report = run_with("{ blocked = 7 }", "{}", vec![(0.5, finger(1, 0.0, 0.2))]);
    let lead = number(&report.results["plant"]["largest_lead"]);
    assert!((lead - 0.035).abs() < 1e-6, "{lead}");
}

#[test]
fn goals_that_are_not_for_fingers_are_refused() {
    let mut pose = finger(1, 0.01, 0.1);
    pose.set_position([0.4, 0.0, 0.4]);
    let mut arm = finger(2, 0.01, 0.1);
    arm.set_joint(3, -2.0);
    let wide = finger(3, 0.05, 0.1);
    let late = finger(4, 0.01, -1.0);
    let goals = vec![(0.5, pose), (0.6, arm), (0.7, wide), (0.8, late)];
    let report = run_with("{}", "{}", goals);
    let result = &report.results["controller"];
    assert_eq!((&result["finger_goals"], &result["finger_goals_refused"]), (&0.into(), &4.into()));
    assert!((number(&report.results["plant"]["q"][FINGER]) - 0.035).abs() < 1e-3);
}

#[test]
fn a_repeated_goal_has_no_effect() {
    let again = (0..20).map(|step| (0.5 + 0.05 * f64::from(step), finger(1, 0.005, 1.0))).collect();
    let report = run_with("{}", "{}", again);
    assert_eq!(report.results["controller"]["finger_goals"], 1);
    assert!((number(&report.results["plant"]["q"][FINGER]) - 0.005).abs() < 1e-3);
}
