//! Properties that change between resets, and properties that are sampled for each episode.

use std::path::{Path, PathBuf};

use motorium::graph;
use motorium::launcher::{Options, Report};
use motorium::session::run;
use motorium_physics::{ArticulatedSimulator, Properties};
use motorium_physics::{
    Ground, JointSetpoint, Object, ObjectShape, Options as Engine, RapierSimulator, ResetError, RobotSetup,
    Simulator, World,
};
use motorium_robots::{BodyFactors, Model, load};
use serde_json::Value;

use crate::component::registry;

fn world(scale: f64) -> World {
    World {
        gravity: [0.0, 0.0, -9.81 * scale],
        ground: Some(Ground { friction: 0.8 * scale, ..Ground::default() }),
        objects: vec![Object {
            name: "cube".into(),
            shape: ObjectShape::Box { size: [0.1; 3] },
            mass: Some(0.5 * scale),
            position: [0.6, 0.1 * scale, 0.0505],
            rpy: [0.0, 0.0, 0.3 * scale],
            friction: 0.6 * scale,
            ..Object::default()
        }],
        ..World::default()
    }
}

fn heavy(model: &Model) -> Model {
    let factors: Vec<_> = (0..model.bodies().len())
        .map(|body| BodyFactors {
            mass: 1.0 + 0.02 * body as f64,
            damping: 2.0,
            friction: 0.5,
            effort_limit: 0.9,
        })
        .collect();
    model.with_factors(1.1, &factors)
}

/// Drops the robot, moves a drive, and returns all numbers of the state.
fn motion(simulator: &mut dyn Simulator) -> Vec<u64> {
    let mut found = Vec::new();
    for step in 0..300 {
        let commands = simulator.commands_mut();
        commands.fill(JointSetpoint::hold(0.2, 30.0, 1.0));
        commands[0] = JointSetpoint::effort((0.05 * f64::from(step)).sin());
        simulator.step(1e-3).unwrap();
        let pose = simulator.object("cube").map(|cube| simulator.object_pose(cube));
        let cube =
            pose.into_iter().flat_map(|pose| pose.to_homogeneous().iter().copied().collect::<Vec<_>>());
        found.extend(simulator.configuration().iter().copied().chain(cube).map(f64::to_bits));
    }
    found
}

/// Returns the parts from which a simulation with these properties is built.
fn built(model: &Model) -> (RobotSetup, World, Engine) {
    let options = Engine { friction: 0.8 * 0.7, ..Engine::default() };
    (RobotSetup::from(heavy(model)), world(0.7), options)
}

/// Changes properties for a simulation that was built with other ones.
fn changed(mut properties: Properties) -> Properties {
    properties.model = heavy(&properties.model);
    properties.world = World { ground: properties.world.ground, ..world(0.7) };
    for surface in &mut properties.surfaces {
        surface.friction *= 0.7;
    }
    properties
}

#[test]
fn a_reset_with_other_properties_equals_a_new_simulation() {
    for (robot, height) in [("quadruped", 0.3), ("rrbot", 0.0)] {
        let model = load(robot, Path::new(".")).unwrap().model;
        let mut q = model.neutral();
        if model.base().floating {
            q[2] = height;
        }
        let v = vec![0.0; model.nv()];
        let (setup, there, options) = built(&model);
        let mut fresh = ArticulatedSimulator::new(setup, there, &q, options).unwrap();
        let mut reset = ArticulatedSimulator::new(model.clone(), world(1.0), &q, Engine::default()).unwrap();
        let nominal = reset.properties();
        let before = motion(&mut reset);
        reset.reset_with(&changed(nominal.clone()), &q, &v).unwrap();
        assert!(motion(&mut reset) == motion(&mut fresh), "{robot}");
        // back to the nominal properties
        reset.reset_with(&nominal, &q, &v).unwrap();
        assert!(motion(&mut reset) == before, "{robot}");
    }
    let model = load("rrbot", Path::new(".")).unwrap().model;
    let (q, v) = (model.neutral(), vec![0.0; model.nv()]);
    let (setup, there, options) = built(&model);
    let mut fresh = RapierSimulator::new(setup, there, &q, options).unwrap();
    let mut reset = RapierSimulator::new(model, world(1.0), &q, Engine::default()).unwrap();
    let nominal = reset.properties();
    motion(&mut reset);
    reset.reset_with(&changed(nominal), &q, &v).unwrap();
    assert!(motion(&mut reset) == motion(&mut fresh), "rapier");
}

#[test]
fn impossible_properties_and_surfaces_are_rejected() {
    let model = load("rrbot", Path::new(".")).unwrap().model;
    let (q, v) = (model.neutral(), vec![0.0; model.nv()]);
    let mut simulator = ArticulatedSimulator::new(model, world(1.0), &q, Engine::default()).unwrap();
    let nominal = simulator.properties();
    let mut other = nominal.clone();
    other.model = load("acrobot", Path::new(".")).unwrap().model;
    assert_eq!(simulator.reset_with(&other, &q, &v), Err(ResetError::Properties));
    let mut other = nominal.clone();
    other.world.objects[0].mass = None;
    assert_eq!(simulator.reset_with(&other, &q, &v), Err(ResetError::Properties));
    let mut other = nominal.clone();
    other.world.objects[0].mass = Some(-1.0);
    assert!(matches!(simulator.reset_with(&other, &q, &v), Err(ResetError::World(_))));
    let mut other = nominal;
    other.surfaces[0].friction = f64::NAN;
    assert!(matches!(simulator.reset_with(&other, &q, &v), Err(ResetError::Surface(_))));
}

pub(crate) fn text(robot: &str, config: &str, rest: &str) -> String {
    format!(
        r#"
name = "randomise-test"
clock = "lockstep"
duration = "100 ms"
{rest}
[robot.one]
urdf = "{robot}"

[component.physics]
kind = "physics.articulated"
robot = "one"
rate = "1 kHz"
publish = {{ joint_state = "one/joint_state" }}
subscribe = {{ joint_command = "one/joint_command" }}

[component.physics.config]
world = {{ ground = {{}}, objects = [
    {{ name = "cube", shape = {{ box = {{ size = [0.1, 0.1, 0.1] }} }}, mass = 0.5, position = [0.9, 0.0, 0.05] }},
    {{ name = "wall", shape = {{ box = {{ size = [0.1, 0.1, 0.1] }} }}, position = [5.0, 0.0, 0.05] }},
] }}
{config}

[component.driver]
kind = "test.driver"
trigger = "one/joint_state"
subscribe = {{ state = "one/joint_state" }}
publish = {{ command = "one/joint_command" }}
config = {{ offset = 0.0, until = 0, stiffness = 1.0 }}
"#
    )
}

pub(crate) fn check(text: String) -> Result<graph::Checked, graph::GraphError> {
    graph::check(&PathBuf::from("randomise.toml"), text, &[], &registry(), &graph::Machine::detect())
}

pub(crate) fn run_of(robot: &str, config: &str, rest: &str) -> Report {
    let plan =
        check(text(robot, config, rest)).unwrap_or_else(|error| panic!("{}", error.render(false))).plan;
    run(plan, &registry(), &Options::inline(), &mut |_| ()).unwrap()
}

const RANGES: &str = r#"
[component.physics.config.randomise]
gravity      = [0.9, 1.1]
mass         = [0.8, 1.2]
friction     = [0.5, 1.0]
restitution  = [0.0, 0.3]
effort_limit = [0.7, 1.0]
start        = [-0.05, 0.05]
base         = { x = [-0.1, 0.1], z = [0.0, 0.02], yaw = [-0.5, 0.5] }
ground       = { friction = [0.6, 1.0] }
objects      = { cube = { mass = [0.5, 2.0], friction = [0.5, 1.5], y = [-0.1, 0.1], yaw = [-1.0, 1.0] }, wall = { friction = [1.0, 1.0] } }
"#;

pub(crate) fn episodes(report: &Report) -> &Vec<Value> {
    report.results["physics"]["randomised"].as_array().unwrap()
}

#[test]
fn without_ranges_nothing_changes_and_nothing_is_reported() {
    let (plain, empty) =
        (run_of("quadruped", "", "seed = 3"), run_of("quadruped", "randomise = {}", "seed = 3"));
    assert!(plain.state_hash.is_some());
    assert_eq!(plain.state_hash, empty.state_hash);
    assert!(plain.results["physics"].get("randomised").is_none());
    let other = run_of("quadruped", "", "seed = 4");
    assert_eq!(plain.state_hash, other.state_hash, "a simulation without ranges has no seed");
}

#[test]
fn equal_seeds_sample_and_move_equally() {
    let runs = ["seed = 3", "seed = 3", "seed = 4"].map(|seed| run_of("quadruped", RANGES, seed));
    assert_eq!(runs[0].state_hash, runs[1].state_hash);
    assert_eq!(episodes(&runs[0]), episodes(&runs[1]));
    assert_ne!(runs[0].state_hash, runs[2].state_hash);
    assert_ne!(episodes(&runs[0])[0]["mass"], episodes(&runs[2])[0]["mass"]);
    assert_eq!(episodes(&runs[0]).len(), 1);
}

#[test]
fn every_episode_draws_from_its_own_seed_within_the_ranges() {
    let several = run_of("quadruped", RANGES, "seed = 3\nepisodes = { count = 5, vary_seed = true }");
    let drawn = episodes(&several);
    assert_eq!((drawn.len(), several.episodes.len()), (5, 5));
    for (index, (draw, episode)) in drawn.iter().zip(&several.episodes).enumerate() {
        // a single run with this seed equals this episode
        let alone = run_of("quadruped", RANGES, &format!("seed = {}", 3 + index));
        assert_eq!(alone.state_hash, episode.state_hash, "episode {index}");
        assert_eq!(episodes(&alone)[0]["mass"], draw["mass"]);
        let within = |value: &Value, low: f64, high: f64| {
            let value = value.as_f64().unwrap();
            assert!((low..=high).contains(&value), "{value} in {draw}");
        };
        within(&draw["gravity"], 0.9, 1.1);
        within(&draw["objects"]["cube"]["mass"], 0.5, 2.0);
        within(&draw["base"]["z"], 0.0, 0.02);
        assert_eq!(draw["objects"]["wall"]["friction"], 1.0);
        let masses = draw["mass"].as_object().unwrap();
        assert_eq!(masses.len(), 13, "a base and three bodies a leg: {masses:?}");
        masses.values().for_each(|mass| within(mass, 0.8, 1.2));
        assert_eq!(draw["start"].as_object().unwrap().len(), 12);
    }
    assert_ne!(drawn[0]["mass"], drawn[1]["mass"]);
    // with one seed for all, all episodes are equal
    let same = run_of("quadruped", RANGES, "seed = 3\nepisodes = { count = 2 }");
    assert_eq!(same.episodes[0].state_hash, same.episodes[1].state_hash);
}

#[test]
fn adding_a_range_keeps_the_other_samples() {
    let all = run_of("quadruped", RANGES, "seed = 3");
    let mass = "[component.physics.config.randomise]\nmass = [0.8, 1.2]";
    let alone = run_of("quadruped", mass, "seed = 3");
    assert_eq!(episodes(&all)[0]["mass"], episodes(&alone)[0]["mass"]);
}

#[test]
fn a_random_start_keeps_the_feet_on_the_ground() {
    let config = "[component.physics.config.randomise]\nstart = [-0.2, 0.2]\nbase = { x = [0.4, 0.5], yaw = [1.0, 1.0] }";
    let report = run_of("quadruped", config, "seed = 3");
    let physics = &report.results["physics"];
    let position: Vec<f64> = serde_json::from_value(physics["base_position"].clone()).unwrap();
    let rpy: Vec<f64> = serde_json::from_value(physics["base_rpy"].clone()).unwrap();
    assert!((0.39..0.51).contains(&position[0]), "{position:?}");
    assert!((rpy[2] - 1.0).abs() < 0.1, "{rpy:?}");
    // it neither falls from above nor is pushed out of the ground
    let range = ["base_height_lowest_m", "base_height_highest_m"].map(|key| physics[key].as_f64().unwrap());
    assert!(range[1] - range[0] < 0.03, "{range:?}");
}

#[test]
fn impossible_ranges_are_rejected_at_their_position() {
    let line = |text: &str, part: &str| text[..text.find(part).unwrap()].lines().count();
    for (robot, ranges, expected, at) in [
        ("quadruped", "mass = [1.2, 0.8]", "expected the lower value first", "mass"),
        ("quadruped", "mass = [0.0, 1.0]", "factors from 0.001 to 100", "mass"),
        ("quadruped", "restitution = [0.5, 1.5]", "numbers from 0 to 1", "restitution"),
        ("quadruped", "friction = [-0.5, 1.0]", "factors from 0 to 100", "friction"),
        ("quadruped", "gravity = [1.0]", "found 1 value, expected a list of 2", "gravity"),
        (
            "quadruped",
            "objects = { cub = { mass = [1.0, 2.0] } }",
            "use an object of the world: cube, wall",
            "cub",
        ),
        ("quadruped", "objects = { wall = { mass = [1.0, 2.0] } }", "`wall` has no mass", "wall"),
        ("rrbot", "base = { x = [0.0, 1.0] }", "no robot has a floating base", "base"),
        (
            "quadruped",
            "robots = { two = { mass = [1.0, 2.0] } }",
            "`two` is not one of several robots",
            "two",
        ),
        ("quadruped", "masses = [1.0, 2.0]", "masses", "masses"),
        ("pendulum", "damping = [1.0, 2.0]", "robot `pendulum` has no part with this property", "damping"),
    ] {
        let text = text(robot, &format!("[component.physics.config.randomise]\n{ranges}"), "");
        let place = line(&text, ranges) + 1;
        let error = check(text).map(|_| ()).unwrap_err().render(false);
        assert!(error.contains(expected) && error.contains(at), "{ranges}: {error}");
        assert!(error.contains(&format!("randomise.toml:{place}:")), "{ranges}, line {place}: {error}");
    }
}

#[test]
fn each_robot_has_separate_ranges_and_samples() {
    let text = r#"
name = "several"
clock = "lockstep"
duration = "50 ms"
seed = 2

[robot.left]
urdf = "panda"
base = { position = [0.0, 1.0, 0.0] }

[robot.right]
urdf = "panda"
base = { position = [0.0, -1.0, 0.0] }

[component.physics]
kind = "physics.articulated"
robots = ["left", "right"]
rate = "1 kHz"
publish = { "left.joint_state" = "left/state", "right.joint_state" = "right/state", "right.randomisation" = "right/drawn" }
subscribe = { "left.joint_command" = "left/command", "right.joint_command" = "right/command" }

[component.physics.config.randomise]
mass  = [0.9, 1.1]
start = [-0.1, 0.1]
robots = { left = { mass = [2.0, 2.0], start = [0.05, 0.05] } }

[component.one]
kind = "test.driver"
trigger = "left/state"
subscribe = { state = "left/state" }
publish = { command = "left/command" }
config = { offset = 0.0, until = 0, stiffness = 1.0 }

[component.other]
kind = "test.driver"
trigger = "right/state"
subscribe = { state = "right/state" }
publish = { command = "right/command" }
config = { offset = 0.0, until = 0, stiffness = 1.0 }
"#;
    let plan = check(text.to_owned()).unwrap_or_else(|error| panic!("{}", error.render(false))).plan;
    let report = run(plan, &registry(), &Options::inline(), &mut |_| ()).unwrap();
    let drawn = &episodes(&report)[0]["robots"];
    let numbers = |robot: &str, key: &str| -> Vec<f64> {
        drawn[robot][key].as_object().unwrap().values().map(|value| value.as_f64().unwrap()).collect()
    };
    assert_eq!(numbers("left", "mass"), [2.0; 9]);
    assert_eq!(numbers("left", "start"), [0.05; 8]);
    let right = numbers("right", "mass");
    assert!(right.len() == 9 && right.iter().all(|mass| (0.9..=1.1).contains(mass)), "{right:?}");
    // each robot starts at its own sampled position: joint 5 of the home pose is at 0
    let starts = ["one", "other"].map(|driver| report.results[driver]["start"][4].as_f64().unwrap());
    assert!((starts[0] - 0.05).abs() < 0.01, "{starts:?}");
    let own = drawn["right"]["start"]["panda_joint5"].as_f64().unwrap();
    assert!((starts[1] - own).abs() < 0.01, "{starts:?}, {own}");
    let wrong =
        text.replace("robots = { left = { mass = [2.0, 2.0]", "robots = { left = { mass = [3.0, 2.0]");
    let error = check(wrong).map(|_| ()).unwrap_err().render(false);
    assert!(error.contains("expected the lower value first") && error.contains("write [2, 3]"), "{error}");
}

#[test]
fn one_world_of_a_batch_accepts_other_properties() {
    let model = load("rrbot", Path::new(".")).unwrap().model;
    let (q, v) = (vec![0.3; model.nq()], vec![0.0; model.nv()]);
    let build = |_| ArticulatedSimulator::new(model.clone(), World::default(), &q, Engine::default());
    let mut batch = motorium_physics::Batch::new(3, 2, build).unwrap();
    let mut light = batch.world(1).properties();
    light.world.gravity = [0.0; 3];
    batch.reset_with(1, &light, &q, &v).unwrap();
    assert!(batch.step(1e-3, 50).iter().all(Result::is_ok));
    assert_eq!(batch.positions(0), batch.positions(2));
    assert!(batch.velocities(1).iter().all(|v| v.abs() < 1e-9), "{:?}", batch.velocities(1));
    assert_ne!(batch.positions(0), batch.positions(1));
}

#[test]
fn graph_actuators_change_motion_or_are_rejected() {
    let start = "[component.physics.config.randomise]\nstart = [-0.1, 0.1]";
    let hash = |actuator: &str| run_of("quadruped", &format!("{actuator}\n{start}"), "seed = 3").state_hash;
    let ideal = hash("");
    assert_eq!(hash("actuator = {}"), ideal, "all stages left out");
    assert_ne!(hash("actuator = { lag = \"5 ms\" }"), ideal);
    assert_ne!(hash("actuators = { front_left_knee = { rate_limit = 10.0 } }"), ideal);
    for (actuator, expected) in [
        ("actuator = { lag = \"20 s\" }", "a time from 0 to 10 s"),
        ("actuator = { rate_limit = 0.0 }", "a positive number"),
        ("actuator = { envelope = { stall_effort = 1.0 } }", "no_load_velocity"),
        ("actuators = { nee = {} }", "front_left_knee"),
        (
            "actuators = { front_left_knee = { thermal = { continuous_effort = -1.0, time_constant = \"1 s\" } } }",
            "continuous_effort = -1",
        ),
    ] {
        let text = text("quadruped", actuator, "");
        let line = text[..text.find(actuator).unwrap()].lines().count() + 1;
        let error = check(text).map(|_| ()).unwrap_err().render(false);
        assert!(error.contains(expected), "{actuator}: {error}");
        assert!(error.contains(&format!("randomise.toml:{line}:")), "{actuator}, line {line}: {error}");
    }
    let rapier =
        text("rrbot", "actuator = { lag = \"1 ms\" }", "").replace("physics.articulated", "physics.rapier");
    let error = check(rapier).map(|_| ()).unwrap_err().render(false);
    assert!(error.contains("only ideal actuators") && error.contains("lag"), "{error}");
}
