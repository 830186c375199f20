//! Tasks: their file, the derived range, and their terms.

use super::*;

const TEXT: &str = r#"
title = "Balance"
robot = "cart-pole"
step = 0.005
decimation = 4
duration = 10.0
observations = [{ term = "joint_positions" }, { term = "joint_velocities", scale = 0.5 }]
rewards = [
    { term = "alive", weight = 2.0 },
    { term = "joint_position", joint = "hinge", target = 3.0, shape = "kernel", width = 0.5, weight = 0.5 },
    { term = "joint_velocity", joint = "hinge", shape = "square", clip = [0.0, 4.0], weight = -0.1 },
]
terminations = [{ term = "joint_position", joint = "slider", outside = [-2.0, 2.0] }]
[start]
position = [0.0, 3.141592653589793]
[action]
joints = ["slider", "hinge"]
kind = "effort"
scale = [10.0, 0.0]
default_pose = [0.0, 3.141592653589793]
clip = [-1.0, 1.0]
"#;

#[test]
fn range_of_the_reward_is_derived() {
    let task = Task::parse(TEXT).expect("a task");
    let [low, high] = task.reward_range().expect("bounded terms");
    assert!((low - 1.6).abs() < 1e-15 && (high - 2.5).abs() < 1e-15, "{low} {high}");
    // a cosine around a target outside of its range
    let shaped = TEXT.replace(
        r#"{ term = "alive", weight = 2.0 }"#,
        r#"{ term = "joint_cosine", joints = ["hinge"], target = 3.0, shape = "square", weight = -1.0 }"#,
    );
    let [low, high] = Task::parse(&shaped).expect("a task").reward_range().expect("bounded terms");
    assert!((low + 16.4).abs() < 1e-14 && (high + 3.5).abs() < 1e-14, "{low} {high}");
}

#[test]
fn range_of_a_product_is_derived() {
    let product = |factors: &str| {
        let text = TEXT.replace("weight = 2.0 }", &format!("weight = 2.0, times = [{factors}] }}"));
        Task::parse(&text).and_then(|task| task.reward_range())
    };
    // 2 times -0.5 to 0, then times -1 to 1; the other terms are -0.4 to 0.5
    let kernel = r#"{ term = "action", shape = "kernel", width = 1e-9, weight = -0.5 }"#;
    let [low, high] = product(kernel).expect("bounded factors");
    assert!((low + 1.4).abs() < 1e-15 && (high - 0.5).abs() < 1e-15, "{low} {high}");
    let cosine = r#"{ term = "joint_cosine", joints = ["hinge"] }"#;
    let [low, high] = product(&format!("{kernel}, {cosine}")).expect("bounded factors");
    assert!((low + 1.4).abs() < 1e-15 && (high - 1.5).abs() < 1e-15, "{low} {high}");
    // zero times infinity is not bounded
    let endless = r#"{ term = "joint_velocity", joint = "hinge" }"#;
    let found = product(&format!("{{ term = \"alive\", weight = 0.0 }}, {endless}"));
    assert!(matches!(found, Err(TaskError::Unbounded { index: 0, .. })), "{found:?}");
}

#[test]
fn rewards_that_can_be_infinite_are_refused() {
    for (from, to) in [(", clip = [0.0, 4.0]", ""), (r#", shape = "kernel", width = 0.5"#, "")] {
        assert!(TEXT.contains(from), "{from}");
        let error = Task::parse(&TEXT.replace(from, to)).expect_err("an unbounded term");
        assert!(matches!(error, TaskError::Unbounded { .. }), "{error}");
    }
}

#[test]
fn mistakes_in_a_task_are_named() {
    for (from, to, message) in [
        ("step = 0.005", "step = 0.0", "`step`: found 0, expected a time above 0 s"),
        ("decimation = 4", "decimation = 0", "`decimation`: found 0, expected at least 1"),
        ("duration = 10.0", "duration = 0.001", "`duration`: found 0.001, expected at least one step"),
        ("width = 0.5", "width = -0.5", "`rewards[1].width`: found -0.5, expected a width above 0"),
        ("joint = \"hinge\", target", "target", "`rewards[1].joint`: found none, expected a joint"),
        ("outside = [-2.0, 2.0]", "outside = [2.0, -2.0]", "`terminations[0]`: found Some([2.0, -2.0])"),
        (", outside = [-2.0, 2.0]", "", "`terminations[0]`: found none, expected one of `outside`"),
        ("2.0]", "2.0], and = [{ term = \"alive\" }]", "`terminations[0].and[0]`: found none, expected one"),
        ("= 2.0", "= 2.0, times = [{ term = \"tilt\", joint = \"hinge\" }]", "`rewards[0].times[0].joint`"),
        ("\"slider\", \"hinge\"]\nkind", "\"slider\"]\nkind", "`action.default_pose`: found 2 numbers"),
    ] {
        assert!(TEXT.contains(from), "{from}");
        let error = Task::parse(&TEXT.replacen(from, to, 1)).expect_err(to);
        assert!(error.to_string().starts_with(message), "{error}");
    }
    let unknown = Task::parse(&TEXT.replace("title", "titles")).expect_err("an unknown key");
    assert!(unknown.to_string().contains("unknown field `titles`"), "{unknown}");
}

#[test]
fn policy_of_a_task_has_its_terms() {
    let task = Task::parse(TEXT).expect("a task");
    let policy = Policy::parse(&task.policy_text(None).expect("a policy")).expect("a policy");
    assert_eq!((policy.rate, policy.inputs()), (50.0, Ok(4)));
    assert_eq!(policy.robot.as_deref(), Some("cart-pole"));
    assert_eq!(policy.network, NETWORK);
}

#[test]
fn settings_of_wheels_are_checked() {
    let text = include_str!("../../../../tasks/rover-velocity.toml");
    let key = |text: &str| match Task::parse(text).expect_err(text) {
        TaskError::Value { key, .. } | TaskError::Setting { key, .. } => key,
        other => panic!("{other}"),
    };
    let with = |settings: &str| text.replace("[start]", &format!("[wheels]\n{settings}\n[start]"));
    assert!(Task::parse(&with("speed = 0.1\nacceleration = 2.0\ntarget_timeout = \"50 ms\"")).is_ok());
    assert_eq!(key(&with("acceleration = 0.0")), "wheels.acceleration");
    assert_eq!(key(&with("slip = 0.1")), "wheels.slip");
    assert_eq!(key(&with("start = { yaw = 1.0 }")), "wheels.start");
    assert_eq!(key(&with("gravity = [0.0, 0.0, -1.6]")), "wheels.gravity");
    assert_eq!(key(&with("state_timeout = \"1 s\"")), "wheels.state_timeout");
    assert_eq!(key(&format!("{TEXT}\n[wheels]\nspeed = 0.1")), "wheels");
}

#[test]
fn terminations_are_met_inside_or_outside() {
    let task = Task::parse(TEXT).expect("a task");
    let outside = &task.terminations[0];
    assert!(!outside.is_met(2.0) && outside.is_met(2.001) && outside.is_met(-2.001));
    let inside = Termination { outside: None, inside: Some([0.0, 1.0]), ..outside.clone() };
    assert!(inside.is_met(0.5) && !inside.is_met(1.5));
}

#[test]
fn termination_requires_all_conditions() {
    let other = r#", and = [{ term = "joint_velocity", joint = "slider", outside = [-1.0, 1.0] }] }]"#;
    let task = Task::parse(&TEXT.replace("2.0] }]", &format!("2.0]{other}"))).expect("a task");
    let robot = motorium_robots::load("cart-pole", std::path::Path::new(".")).expect("a robot").model;
    let terms = Terms::new(&task, &robot).expect("terms of the cart-pole");
    let end = |position: f64, velocity: f64| {
        let (positions, velocities, efforts) = ([position, 3.0], [velocity, 0.0], [0.0; 2]);
        let state = RobotState {
            positions: &positions,
            velocities: &velocities,
            efforts: &efforts,
            ..RobotState::default()
        };
        let mut trial = Trial::new(&terms);
        trial.begin(&terms, (crate::random::Counter::default(), 1.0), &state);
        trial.act(&terms, [0.0; 2]);
        trial.judge(&terms, &state, true).end
    };
    assert_eq!([end(2.5, 0.5), end(1.5, 1.5), end(1.5, 0.5)], [None; 3]);
    assert_eq!(end(2.5, -1.5), Some(End::Failure));
}

const QUADRUPED: &str = include_str!("../../../../tasks/quadruped-velocity.toml");

/// Returns the reward of a state in the quadruped task with one term, bounded by 100.
fn reward(term: &str, state: &RobotState<'_>) -> f64 {
    let mut table: toml::Table = QUADRUPED.parse().expect("a table");
    let rewards = format!("rewards = [{{ {term}, clip = [-100.0, 100.0] }}]");
    table.extend(rewards.parse::<toml::Table>().expect("a reward"));
    table["command"] = toml::Value::Table(toml::Table::new());
    table.remove("terminations");
    let task = Task::parse(&toml::to_string(&table).expect("a file")).expect("a task");
    let robot = motorium_robots::load("quadruped", std::path::Path::new(".")).expect("a robot").model;
    let terms = Terms::new(&task, &robot).expect("terms of the quadruped");
    let mut trial = Trial::new(&terms);
    trial.begin(&terms, (crate::random::Counter::default(), 1.0), state);
    trial.act(&terms, [0.0; 12]);
    trial.judge(&terms, state, true).reward
}

#[test]
fn quantities_of_a_base_match_their_definitions() {
    let standing = [0.0, 0.8, -1.6, 0.0, 0.8, -1.6, 0.0, -0.8, 1.6, 0.0, -0.8, 1.6];
    let mut positions = standing;
    positions[3] += 0.6;
    let mut efforts = [0.0; 12];
    (efforts[0], efforts[5]) = (-3.0, 3.0_f64.sqrt());
    let base = motorium_models::policy::BaseMotion {
        linear_velocity: [0.3, -0.4, 0.1],
        angular_velocity: [3.0, -4.0, -0.7],
        gravity: [0.0, -1.0, 0.0],
    };
    let state = RobotState {
        positions: &positions,
        velocities: &[0.0; 12],
        efforts: &efforts,
        base,
        height: 0.25,
        forces: &[2.0, 3.5],
        objects: &[],
        images: &[],
    };
    for (term, expected) in [
        ("term = \"velocity_error\"", 0.5),
        ("term = \"turn_error\"", 0.7),
        ("term = \"vertical_velocity\"", 0.1),
        ("term = \"roll_pitch_rate\"", 5.0),
        ("term = \"tilt\"", core::f64::consts::FRAC_PI_2),
        ("term = \"base_height\", target = 0.2", 0.05),
        ("term = \"effort\"", 1.0),
        ("term = \"pose_error\"", (0.36_f64 / 12.0).sqrt()),
        ("term = \"contact_force\", links = [\"base\", \"front_left_shank\"]", 5.5),
    ] {
        let found = reward(term, &state);
        assert!((found - expected).abs() < 1e-12, "{term}: {found}, expected {expected}");
    }
}

#[test]
fn terms_that_a_robot_lacks_are_refused() {
    let robot = motorium_robots::load("quadruped", std::path::Path::new(".")).expect("a robot").model;
    for (from, to, message) in [
        ("\"hind_right_thigh\",", "\"tail\",", "`terminations[2].links`: found \"tail\", expected a link of"),
        (
            "{ term = \"command\", scale = [2.0, 2.0, 0.25] },",
            "{ term = \"height_scan\", rays = 9 },",
            "`obs",
        ),
        ("\"hind_right_hip_pitch\", \"", "\"hip\", \"", "the robot has no joint \"hip\""),
    ] {
        assert!(QUADRUPED.contains(from), "{from}");
        let task = Task::parse(&QUADRUPED.replace(from, to)).expect("a task");
        let error = Terms::new(&task, &robot).expect_err(to).to_string();
        assert!(error.starts_with(message), "{error}");
    }
    let cart = motorium_robots::load("cart-pole", std::path::Path::new(".")).expect("a robot").model;
    let text = TEXT.replace("{ term = \"alive\", weight = 2.0 }", "{ term = \"tilt\" }");
    let error = Terms::new(&Task::parse(&text).expect("a task"), &cart).expect_err("no base").to_string();
    assert!(error.starts_with("`rewards[0].term`: found tilt, expected"), "{error}");
}

#[test]
fn mistakes_in_points_and_targets_are_named() {
    const REACHER: &str = include_str!("../../../../tasks/reacher.toml");
    let distance = "term = \"distance\", points = [\"target\", \"fingertip\"], clip";
    let key = |from: &str, to: &str| {
        assert!(REACHER.contains(from), "{from}");
        match Task::parse(&REACHER.replacen(from, to, 1)) {
            Err(TaskError::Value { key, .. } | TaskError::Policy(PolicyError::Value { key, .. })) => key,
            other => panic!("{to}: {other:?}"),
        }
    };
    assert_eq!(key(distance, "term = \"distance\", clip"), "rewards[0].points");
    assert_eq!(key(distance, "term = \"distance\", points = [\"a\", \"a\"], clip"), "rewards[0].points");
    assert_eq!(key("{ term = \"action\",", "{ term = \"action\", points = [\"a\"],"), "rewards[2].points");
    assert_eq!(key("points = [\"target\"], ", ""), "observations[2].points");
    assert_eq!(key("points = [\"target\"], ", "points = [], "), "observations[2].points");
    assert_eq!(
        key("\"joint_positions\",", "\"joint_positions\", points = [\"target\"],"),
        "observations[0].points"
    );
    assert_eq!(key("target = [[-0.14", "target = [[0.15"), "command.target");
    assert_eq!(key("interval = 2.5", "forward = [0.0, 1.0]"), "command");
    assert_eq!(key("interval = 2.5", "standing = 0.1"), "command");
}

#[test]
fn targets_grow_around_their_middle() {
    let target = Some([[0.0, 2.0], [-1.0, 1.0], [0.5, 0.5]]);
    let ranges: CommandRanges = toml::from_str("interval = 1.0").expect("ranges");
    let ranges = CommandRanges { target, ..ranges };
    let counter = |step| crate::random::Counter { step, ..crate::random::Counter::default() };
    let sampled: Vec<[f64; 3]> = (0..500).map(|step| ranges.sample(counter(step), 0.5)).collect();
    for (axis, [low, high]) in [[0.5, 1.5], [-0.5, 0.5], [0.5, 0.5]].into_iter().enumerate() {
        let values = || sampled.iter().map(|target| target[axis]);
        let (least, most) =
            (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        assert!(
            low <= least && least <= low + 0.02 && high - 0.02 <= most && most <= high,
            "{axis}: {least} {most}"
        );
    }
}

#[test]
fn commands_stay_within_their_ranges() {
    let task = Task::parse(QUADRUPED).expect("a task");
    let ranges = task.command.expect("commands");
    let counter = |step| crate::random::Counter { seed: 3, step, ..crate::random::Counter::default() };
    let commands: Vec<[f64; 3]> = (0..2000).map(|step| ranges.sample(counter(step), 0.5)).collect();
    let standing = commands.iter().filter(|command| **command == [0.0; 3]).count();
    // five standard deviations around a tenth
    assert!((133..=267).contains(&standing), "{standing} of 2000");
    for (axis, [low, high]) in [ranges.forward, ranges.left, ranges.turn].into_iter().enumerate() {
        let values = || commands.iter().map(|command| command[axis]);
        let (least, most) = (values().fold(0.0, f64::min), values().fold(0.0, f64::max));
        assert!(0.5 * low <= least && least < 0.48 * low, "{axis}: {least}");
        assert!(0.48 * high < most && most <= 0.5 * high, "{axis}: {most}");
    }
    assert_eq!(ranges.sample(counter(7), 1.0), ranges.sample(counter(7), 1.0));
    assert_eq!([0, 5_000_000, 9_000_000].map(|steps| ranges.level(steps)), [0.3, 1.0, 1.0]);
    assert!((ranges.level(2_500_000) - 0.65).abs() < 1e-12);
}
