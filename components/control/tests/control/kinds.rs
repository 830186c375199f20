//! The less common kinds of tasks and limits of `control.qp`, in a graph in lockstep.

use motorium::launcher::Report;

use crate::component::number;
use crate::graph::{Targets, bare_controller, checked, controller, graph, run};

/// Runs a Panda with this configuration, without a target. Nothing allocates, and every step has a solution.
#[track_caller]
fn ran(config: &str) -> Report {
    let targets = Targets { offsets: vec![[0.0; 3]], ..Targets::default() };
    checked(run(graph("{}", targets, bare_controller(config).robot("panda"))))
}

#[track_caller]
fn refused(config: &str, words: &[&str]) {
    let graph = graph("{}", Targets::default(), bare_controller(config).robot("panda"));
    let error = graph.check().expect_err("it must be refused").render(false);
    for word in words {
        assert!(error.contains(word), "no `{word}` in\n{error}");
    }
}

fn hand(report: &Report) -> [f64; 3] {
    std::array::from_fn(|axis| number(&report.results["plant"]["hand"][axis]))
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// A posture that moves the whole arm.
const AWAY: &str =
    "{ posture = { positions = [0.4, -0.5, -0.3, -2.0, 0.2, 1.8, 0.5, 0.02], weight = 0.1, gain = 3.0 } }";

#[test]
fn relative_task_without_a_target_keeps_the_initial_pose() {
    let with = ran(&format!(
        "{{ tasks = [{{ relative = {{ frame = \"panda_hand_tcp\", other = \"panda_link2\" }} }}, {AWAY}] }}"
    ));
    let result = &with.results["controller"]["tasks"]["relative"];
    // in a sum with a weak posture the last joints keep their positions relative to the second link
    assert!(number(&result["last_position_error_m"]) < 0.02, "{result}");
    let free = ran(&format!("{{ tasks = [{AWAY}] }}"));
    assert!(distance(hand(&with), hand(&free)) > 0.02);
    refused("{ tasks = [{ relative = {} }] }", &["tasks[0].relative.other", "missing"]);
    refused("{ tasks = [{ relative = { other = \"panda_hand_tcp\" } }] }", &["relative.other", "to itself"]);
    refused("{ tasks = [{ relative = { other = \"panda_lnik2\" } }] }", &["relative.other", "panda_link2"]);
}

#[test]
fn velocity_and_force_manipulability_are_opposed() {
    let reach = |of: &str| {
        let task = format!("{{ manipulability = {{ of = \"{of}\", gain = 20.0, weight = 1.0 }} }}");
        let report = ran(&format!("{{ tasks = [{task}] }}"));
        let q: Vec<f64> = (0..7).map(|joint| number(&report.results["plant"]["q"][joint])).collect();
        let panda = motorium_robots::load("panda", std::path::Path::new(".")).unwrap().model;
        let mut kinematics = motorium_robots::Kinematics::new(&panda);
        let q: Vec<f64> = q.into_iter().chain([0.02]).collect();
        kinematics.update(&panda, &q);
        let tool = panda.frame("panda_hand_tcp").unwrap();
        kinematics.manipulability(&panda, tool, motorium_robots::TaskRows::POSITION)
    };
    let (velocity, force) = (reach("velocity"), reach("force"));
    assert!(velocity > 1.05 * force, "{velocity} {force}");
    refused("{ tasks = [{ manipulability = { of = \"speed\" } }] }", &["speed", "velocity"]);
    refused("{ tasks = [{ manipulability = { max_speed = 0.0 } }] }", &["manipulability.max_speed"]);
    refused(
        "{ tasks = [{ manipulability = { rate = 10.0 } }] }",
        &["manipulability.rate", "inverse_dynamics"],
    );
}

#[test]
fn minimum_tasks_reduce_their_quantity() {
    // the effort of the weight falls
    let load = |config: &str| {
        let report = ran(config);
        let q: Vec<f64> = (0..8).map(|joint| number(&report.results["plant"]["q"][joint])).collect();
        let panda = motorium_robots::load("panda", std::path::Path::new(".")).unwrap().model;
        let (mut dynamics, mut effort) = (motorium_robots::Dynamics::new(&panda), vec![0.0; 8]);
        dynamics.gravity(&panda, &q, nalgebra::Vector3::new(0.0, 0.0, -9.81), &mut effort);
        effort.iter().zip(panda.effort_limit()).map(|(effort, limit)| (effort / limit).powi(2)).sum::<f64>()
    };
    let rest = load("{ tasks = [{ minimum = { of = \"velocity\", weight = 1.0 } }] }");
    let less = load("{ tasks = [{ minimum = { of = \"effort\", gain = 20.0, weight = 1.0 } }] }");
    assert!(less < 0.7 * rest, "{less} {rest}");
    let smooth =
        ran(&format!("{{ tasks = [{AWAY}, {{ minimum = {{ of = \"acceleration\", weight = 1.0 }} }}] }}"));
    let sudden = ran(&format!("{{ tasks = [{AWAY}] }}"));
    assert_ne!(smooth.state_hash, sudden.state_hash);
    for of in ["acceleration", "torque", "force"] {
        ran(&format!("{{ inverse_dynamics = {{}}, tasks = [{AWAY}, {{ minimum = {{ of = \"{of}\" }} }}] }}"));
    }
    refused(
        "{ tasks = [{ minimum = { of = \"torque\" } }] }",
        &["tasks[0].minimum", "needs `inverse_dynamics`"],
    );
    refused("{ tasks = [{ minimum = { of = \"velocity\", rate = 1.0 } }] }", &["minimum.rate"]);
    refused(
        "{ inverse_dynamics = {}, tasks = [{ minimum = { of = \"force\", rate = 1.0 } }] }",
        &["minimum.rate", "no effect on a quantity other than"],
    );
    refused(
        "{ inverse_dynamics = {}, tasks = [{ limit = { frames = [{ max_linear = 1.0 }] } }] }",
        &["tasks[0].limit", "not available with `inverse_dynamics`", "list limits under `limits`"],
    );
}

#[test]
fn wheels_roll_steer_and_drive() {
    let start = hand(&ran("{ tasks = [{ minimum = { of = \"velocity\" } }] }"));
    // a hand that must not move sideways, and stands still without a target
    let driven = ran(&format!(
        "{{ tasks = [{{ unicycle = {{ frame = \"panda_hand_tcp\", forward_weight = 100.0, sideways_weight = 100.0 }} }}, {AWAY}] }}"
    ));
    let free = hand(&ran(&format!("{{ tasks = [{AWAY}] }}")));
    assert!(
        distance(hand(&driven), start) < 0.5 * distance(free, start),
        "{:?} {start:?} {free:?}",
        hand(&driven)
    );
    ran(&format!(
        "{{ tasks = [{{ rolling = {{ frame = \"panda_hand\", radius = 0.05, weight = 10.0 }} }}, {AWAY}] }}"
    ));
    let steered = ran(&format!(
        "{{ tasks = [{{ rigid_rotation = {{ frame = \"panda_hand\", base = \"panda_link0\" }} }}, {AWAY}] }}"
    ));
    let result = &steered.results["controller"]["tasks"]["rigid_rotation"];
    assert_eq!(result["last_error_rad"], 0.0, "inactive without a target");
    refused("{ tasks = [{ rolling = { frame = \"panda_hand\" } }] }", &["tasks[0].rolling.radius"]);
    refused(
        "{ tasks = [{ rolling = { frame = \"panda_hand\", radius = 0.1, axis = [0, 0, 0] } }] }",
        &["rolling.axis", "has no direction"],
    );
    refused("{ tasks = [{ unicycle = {} }] }", &["tasks[0].unicycle.frame", "missing"]);
    refused(
        "{ tasks = [{ rigid_rotation = { frame = \"panda_hand\" } }] }",
        &["rigid_rotation.base", "missing"],
    );
}

#[test]
fn a_constraint_task_is_kept_by_velocities_and_torques() {
    let start = hand(&ran("{ tasks = [{ minimum = { of = \"velocity\" } }] }"));
    let strong = AWAY.replace("weight = 0.1", "weight = 100.0");
    let held = "{ constraint = { task = { cartesian = { frame = \"panda_hand_tcp\" } } } }";
    let targets = || Targets { offsets: vec![[0.0; 3]], ..Targets::default() };
    for (level, limit) in [("", 1e-4), ("inverse_dynamics = {},", 2e-3)] {
        let config = format!("{{ {level} tasks = [{held}, {strong}] }}");
        let report = checked(run(graph("{}", targets(), controller(&config))));
        assert!(distance(hand(&report), start) < limit, "{level} {:?} {start:?}", hand(&report));
        let relaxed = &report.results["controller"]["solver"]["steps_relaxed"];
        assert!(relaxed.is_null() || relaxed == 0, "{relaxed}");
    }
    refused(
        "{ tasks = [{ constraint = { task = { limit = { frames = [{ max_linear = 1.0 }] } } } }] }",
        &["tasks[0].constraint.task", "`limit` is not a task that can hold exactly"],
    );
    refused(
        "{ tasks = [{ constraint = { task = { cartesian = { gain = -1.0 } } } }] }",
        &["tasks[0].constraint.task.cartesian.gain", "-1"],
    );
}

#[test]
fn limit_task_yields_only_to_higher_levels() {
    let free = hand(&checked(run(graph("{}", Targets::default(), controller("{}")))));
    let wall = free[1] + 0.05;
    let end = |limit: u32, reach: u32| {
        let tasks = format!(
            "{{ tasks = [{{ cartesian = {{ level = {reach} }} }}, {{ limit = {{ level = {limit}, frames = [{{ y = [{wall}, 10.0] }}] }} }}, {{ posture = {{ level = 3 }} }}] }}"
        );
        hand(&checked(run(graph("{}", Targets::default(), controller(&tasks)))))[1]
    };
    assert!((end(2, 1) - free[1]).abs() < 1e-3, "{} {}", end(2, 1), free[1]);
    assert!(end(1, 2) > wall - 1e-3, "{} {wall}", end(1, 2));
    refused("{ tasks = [{ limit = {} }] }", &["tasks[0].limit", "without a limit"]);
    refused("{ tasks = [{ limit = { weight = 0.0, frames = [{ max_linear = 1.0 }] } }] }", &["limit.weight"]);
}

#[test]
fn frame_limits_hold_for_torques() {
    let free = hand(&run(graph("{}", Targets::default(), controller("{ inverse_dynamics = {} }"))));
    let wall = free[1] + 0.05;
    let config = format!("{{ inverse_dynamics = {{}}, limits = {{ frames = [{{ y = [{wall}, 10.0] }}] }} }}");
    let boxed = hand(&checked(run(graph("{}", Targets::default(), controller(&config)))));
    assert!(boxed[1] > wall - 2e-3 && boxed[1] < wall + 5e-3, "{boxed:?} {wall}");
    refused("{ inverse_dynamics = { barrier_rate = 0.0 } }", &["inverse_dynamics.barrier_rate"]);
}

#[test]
fn a_hand_keeps_its_distance_from_the_ground() {
    let down = || Targets { offsets: vec![[0.0, 0.0, -0.25]], ..Targets::default() };
    for level in ["", "inverse_dynamics = {},"] {
        let free = hand(&run(graph("{}", down(), controller(&format!("{{ {level} }}")))))[2];
        let ground = free + 0.1;
        let limit = format!(
            "collision = {{ ground = {ground}, ignore = [[\"panda_link0\", \"ground\"], [\"panda_link1\", \"ground\"], [\"panda_link2\", \"ground\"]] }}"
        );
        let report =
            checked(run(graph("{}", down(), controller(&format!("{{ {level} limits = {{ {limit} }} }}")))));
        let height = hand(&report)[2];
        assert!(height > ground && height < ground + 0.08, "{level} {height} {ground} {free}");
    }
    refused("{ limits = { collision = { pairs = 0 } } }", &["limits.collision.pairs", "1 to 256"]);
    refused("{ limits = { collision = { range = 0.01 } } }", &["limits.collision.range"]);
    refused(
        "{ limits = { collision = { ignore = [[\"panda_lnik1\", \"ground\"]] } } }",
        &["limits.collision.ignore", "panda_link1"],
    );
}

#[test]
fn support_comes_from_points_or_contacts() {
    let points = "points = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]";
    for of in ["centre_of_mass", "capture_point"] {
        ran(&format!("{{ tasks = [{AWAY}], limits = {{ support = {{ of = \"{of}\", {points} }} }} }}"));
    }
    // the centre of mass of the arm cannot move to the side
    let narrow = "points = [[-1.0, -0.005], [1.0, -0.005], [1.0, 0.005], [-1.0, 0.005]], margin = 0.0";
    let held = ran(&format!("{{ tasks = [{AWAY}], limits = {{ support = {{ {narrow} }} }} }}"));
    let side = number(&held.results["plant"]["centre_of_mass"][1]);
    let free = number(&ran(&format!("{{ tasks = [{AWAY}] }}")).results["plant"]["centre_of_mass"][1]);
    assert!(side.abs() < 0.0051 && free.abs() > 0.01, "{side} {free}");
    refused("{ limits = { support = {} } }", &["limits.support.points", "0 points"]);
    refused("{ limits = { support = { points = [[0, 0], [1, 1]] } } }", &["limits.support.points", "area"]);
}

#[test]
fn wrenches_of_contacts_are_named_by_their_contact() {
    let contact = "contacts = [{ frame = \"panda_hand\", sole = [0.1, 0.1] }]";
    let hanging = "{ contact_wrench = { contact = \"panda_hand\", force = [0.0, 0.0, 5.0] } }";
    let with = |rest: &str, tasks: &str| {
        format!("{{ inverse_dynamics = {{ {contact}{rest} }}, tasks = [{tasks}] }}")
    };
    ran(&with("", &format!("{hanging}, {AWAY}")));
    let wrench = |wrench: &str| {
        format!(
            "{{ inverse_dynamics = {{ contacts = [{{ frame = \"panda_hand\", sole = [0.1, 0.1], wrench = {wrench} }}] }} , tasks = [{AWAY}] }}"
        )
    };
    ran(&wrench("{ max_yaw = 1.0, max_force = 50.0 }"));
    refused(
        &with("", "{ contact_wrench = { contact = \"foot\" } }"),
        &["contact_wrench.contact", "`foot`", "panda_hand"],
    );
    refused(
        "{ tasks = [{ contact_wrench = { contact = \"x\" } }] }",
        &["tasks[0].contact_wrench", "needs `inverse_dynamics`"],
    );
    refused(&wrench("{ min_force = 10.0, max_force = 5.0 }"), &["wrench.max_force", "5 N"]);
    refused(&wrench("{ friction = 0.0 }"), &["wrench.friction"]);
    refused(
        "{ inverse_dynamics = { contacts = [{ frame = \"panda_hand\", wrench = {} }] } }",
        &["contacts[0].wrench", "no sole"],
    );
}

#[test]
fn friction_cones_support_several_levels() {
    let config = "{ inverse_dynamics = { friction_model = \"cone\", contacts = [] }, tasks = [{ cartesian = {} }, { posture = { level = 2 } }] }";
    let report = run(graph("{}", Targets::default(), controller(config)));
    assert_eq!(report.results["controller"]["steps_without_solution"], 0);
    assert!(number(&report.results["controller"]["position_error_m"]) < 5e-3);
}

#[test]
fn uncontrolled_orientation_has_no_error() {
    let config = "{ tasks = [{ cartesian = { orientation_weight = 0.0 } }, { posture = {} }] }";
    let report = checked(run(graph("{}", Targets::default(), controller(config))));
    let result = &report.results["controller"];
    assert_eq!(result["goals_reached"], 2);
    for found in
        [&result["orientation_error_rad"], &result["tasks"]["cartesian"]["last_orientation_error_rad"]]
    {
        assert!(found.is_null(), "{result}");
    }
    assert!(number(&result["position_error_m"]) < 1e-4);
}

#[test]
fn the_centre_of_mass_keeps_its_speed_limit() {
    // at 1 cm/s it moves at most 4 cm in 4 s; without a limit it moves much farther
    let moved = |config: &str| {
        let report = ran(config);
        let centre = |axis: usize| number(&report.results["plant"]["centre_of_mass"][axis]);
        [centre(0), centre(1), centre(2)]
    };
    for dynamics in ["", "inverse_dynamics = {}, "] {
        let of = |limits: &str| moved(&format!("{{ {dynamics}limits = {limits}, tasks = [{AWAY}] }}"));
        let (free, slow) = (of("{}"), of("{ centre_of_mass_velocity = { x = 0.01 } }"));
        let still = moved("{ tasks = [{ minimum = { of = \"velocity\" } }] }");
        assert!((free[0] - still[0]).abs() > 0.05, "{dynamics} {free:?} {still:?}");
        assert!((slow[0] - still[0]).abs() < 0.0415, "{dynamics} {slow:?} {still:?}");
    }
    refused(
        "{ limits = { centre_of_mass_velocity = { x = -0.2 } } }",
        &["limits.centre_of_mass_velocity.x", "-0.2, expected at least 0"],
    );
    refused(
        "{ limits = { centre_of_mass_velocity = {} } }",
        &["limits.centre_of_mass_velocity", "has no axis"],
    );
}
