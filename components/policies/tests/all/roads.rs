//! One task, run by a learner's environment and by a graph: both produce the same observations and rewards.

use std::collections::HashSet;
use std::path::Path;
use std::time::Duration;

use motorium::declare::RobotReference;
use motorium::graph::{self, Machine};
use motorium::launcher::Options;
use motorium::session::{self, Session};
use motorium::state::{BaseState, Observation, Randomisation, Reward, TwistTarget};
use motorium::worker::{Registry, RobotSource};
use motorium_learners::environment::{Environment, Scene};
use motorium_learners::task::{End, Task};
use motorium_models::policy::PolicyFolder;
use motorium_models::{inference::Unary, onnx};
use motorium_physics::Simulator as _;

/// Numbers of an episode as bits.
#[derive(Debug, Default, PartialEq)]
struct Record {
    observations: Vec<Vec<u64>>,
    rewards: Vec<u64>,
    /// `true` for a terminal end, `false` for a truncated one.
    end: Option<bool>,
}

fn bits(numbers: &[f64]) -> Vec<u64> {
    numbers.iter().map(|number| number.to_bits()).collect()
}

/// Writes a policy with two layers of random weights, at most `largest`, for a task.
fn write_policy(task: &Task, folder: &Path, largest: f32) {
    let policy = task.policy().unwrap();
    let choices = task.choices().unwrap().map_or(policy.outputs(), |choices| choices.count());
    let (inputs, outputs) = (policy.inputs().unwrap(), choices);
    let mut state = 7_u64;
    let mut random = |count: usize| -> Vec<f32> {
        (0..count)
            .map(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                largest * ((state >> 40) as f32 / (1_u32 << 24) as f32 * 2.0 - 1.0)
            })
            .collect()
    };
    let layers = [(random(16 * inputs), random(16)), (random(outputs * 16), random(outputs))];
    std::fs::create_dir(folder).unwrap();
    std::fs::write(folder.join("policy.toml"), task.policy_text(None).unwrap()).unwrap();
    let network = match task.choices().unwrap() {
        None => onnx::write_mlp(inputs, &layers, Unary::Tanh, &[]),
        Some(choices) => onnx::write_choice(inputs, &layers, Unary::Tanh, choices.rows(), &[]),
    };
    std::fs::write(folder.join(&policy.network), network).unwrap();
}

/// A graph of a task. Without `plant` a command gate is between the policy and the drives.
fn graph_text(task: &toml::Table, plant: bool) -> String {
    let number = |key: &str| task[key].as_float().unwrap();
    let decimation = task["decimation"].as_integer().unwrap();
    let physics_hz = (1.0 / number("step")).round();
    let policy_hz = physics_hz / decimation as f64;
    let (robot, position) = (&task["robot"], &task["start"]["position"]);
    let randomise = toml::to_string(&task["randomise"]).unwrap();
    let target = if task.contains_key("command") { ", target = \"target\"" } else { "" };
    format!(
        r#"
name = "roads"
clock = "lockstep"
duration = "60 s"
seed = 5

[robot.one]
urdf = {robot}

[component.physics]
kind = "physics.articulated"
robot = "one"
rate = "{physics_hz} Hz"
subscribe = {{ joint_command = "command" }}
publish = {{ joint_state = "state", randomisation = "randomisation" }}

[component.physics.config]
plant = {plant}
position = {position}

[component.physics.config.randomise]
{randomise}

[component.task]
kind = "learner.task"
robot = "one"
rate = "{policy_hz} Hz"
ends_episode = true
subscribe = {{ joint_state = "state", action = "action" }}
publish = {{ observation = "observation", reward = "reward"{target} }}
config = {{ task = "task.toml" }}

[component.policy]
kind = "policy.network"
robot = "one"
rate = "{policy_hz} Hz"
subscribe = {{ joint_state = "state"{target} }}
publish = {{ action = "action" }}
config = {{ policy = "policy" }}

[component.drives]
kind = "policy.joint_targets"
robot = "one"
trigger = "state"
subscribe = {{ joint_state = "state", action = "action" }}
publish = {{ joint_command = "command" }}
config = {{ policy = "policy" }}

[safety]
stale_after = "1 s"
safe_state = "hold"
"#
    )
}

/// A graph of the rover's task: its policy commands `control.wheels`.
fn rover_graph(task: &toml::Table) -> String {
    let randomise = toml::to_string(&task["randomise"]).unwrap();
    format!(
        r#"
name = "rover"
clock = "lockstep"
duration = "60 s"
seed = 5

[world]
ground = {{ friction = 0.8 }}

[robot.one]
urdf = "differential-drive"

[component.physics]
kind = "physics.articulated"
robot = "one"
rate = "200 Hz"
subscribe = {{ joint_command = "command" }}
publish = {{ joint_state = "state", base_state = "base", randomisation = "randomisation" }}

[component.physics.config]
plant = true

[component.physics.config.randomise]
{randomise}

[component.task]
kind = "learner.task"
robot = "one"
rate = "25 Hz"
ends_episode = true
subscribe = {{ joint_state = "state", base_state = "base", action = "action" }}
publish = {{ observation = "observation", reward = "reward", command = "desired" }}
config = {{ task = "task.toml" }}

[component.policy]
kind = "policy.network"
robot = "one"
rate = "25 Hz"
subscribe = {{ base_state = "base", command = "desired" }}
publish = {{ action = "action", twist = "target" }}
config = {{ policy = "policy", attitude = "base_state" }}

[component.wheels]
kind = "control.wheels"
robot = "one"
trigger = "state"
subscribe = {{ joint_state = "state", target = "target" }}
publish = {{ joint_command = "command", odometry = "odometry" }}

[safety]
stale_after = "1 s"
safe_state = "hold"
"#
    )
}

/// Adds the depth camera `eye` of a task to its graph, with the wiring of its images.
fn with_camera(text: &str, task: &toml::Table) -> String {
    let mut config = task["cameras"]["eye"].clone();
    for key in ["config", "eye", "component"] {
        config = toml::Value::Table(toml::Table::from_iter([(key.to_owned(), config)]));
    }
    let config = toml::to_string(&config).unwrap();
    let wire = "joint_state = \"state\"";
    let wired = format!("{wire}, eye_depth = \"depth\", eye_grey = \"grey\", eye_info = \"info\"");
    let (before, task_and_policy) = text.split_once("[component.task]").unwrap();
    let (task_and_policy, after) = task_and_policy.split_once("[component.drives]").unwrap();
    let seeing = task_and_policy.replace(wire, &wired);
    format!(
        r#"{before}[component.eye]
kind = "sensor.depth_camera"
robot = "one"
rate = "50 Hz"
subscribe = {{ joint_state = "state" }}
publish = {{ depth = "depth", grey = "grey", info = "info" }}

{config}

[component.task]{seeing}[component.drives]{after}"#
    )
}

/// Component kinds of these graphs.
fn registry() -> Registry {
    let kinds = motorium_physics::kinds().into_iter().chain(motorium_learners::kinds());
    let kinds = kinds.chain(motorium_sensors::kinds());
    let kinds = kinds.chain(motorium_locomotion::kinds());
    Registry::new(RobotSource { check: |_| Ok(Vec::new()) }, kinds.chain(motorium_policies::kinds()))
}

/// A session of a graph whose components run as steps of this thread.
fn launch(folder: &Path, text: String) -> Session<'static> {
    let registry = registry();
    let checked = graph::check(&folder.join("graph.toml"), text, &[], &registry, &Machine::detect())
        .unwrap_or_else(|error| panic!("{}", error.render(false)));
    Session::launch(checked.plan, &registry, &Options::inline()).unwrap()
}

/// The episodes of a graph with these seeds, each with the seed of its physics.
fn graph_episodes(folder: &Path, text: String, seeds: &[u64]) -> Vec<(u64, Record)> {
    let mut session = launch(folder, text);
    // streams are read from the first call on
    session.read::<Reward>("reward").unwrap();
    session.read::<Observation>("observation").unwrap();
    let mut episodes = Vec::new();
    for seed in seeds {
        session.reset(*seed).unwrap();
        let mut record = Record::default();
        let mut seen = [0; 2];
        while !session.is_episode_over() {
            session.step().unwrap();
            if let Some(reward) = session.read::<Reward>("reward").unwrap()
                && reward.stamp.sequence != std::mem::replace(&mut seen[0], reward.stamp.sequence)
            {
                assert_eq!(reward.value.step as usize, record.rewards.len());
                record.rewards.push(reward.value.reward.to_bits());
                record.end = reward.value.is_last().then_some(reward.value.terminal == 1);
            }
            if let Some(found) = session.read::<Observation>("observation").unwrap()
                && found.stamp.sequence != std::mem::replace(&mut seen[1], found.stamp.sequence)
            {
                assert_eq!(found.value.step as usize, record.observations.len());
                record.observations.push(bits(found.value.value()));
            }
            assert!(session.time().as_secs() < 60, "the episode has no end");
        }
        let drawn = session.read::<Randomisation>("randomisation").unwrap().unwrap();
        episodes.push((drawn.value.seed, record));
    }
    let report = session.stop();
    assert_eq!(report.results["task"]["episodes"], seeds.len(), "{}", report.results["task"]);
    episodes
}

/// An episode of an environment whose physical properties are sampled from this seed.
fn environment_episode(task: &Task, folder: &Path, seed: u64) -> Record {
    let simulation = Scene::load(task, folder).unwrap().simulation().unwrap();
    let mut environment = Environment::new(task, simulation, 1, 0).unwrap();
    let mut network = PolicyFolder::read(&folder.join("policy")).unwrap().network().unwrap();
    let numbers = |observation: &[f32]| bits(&observation.iter().map(|x| f64::from(*x)).collect::<Vec<_>>());
    environment.reset_from(seed).unwrap();
    let mut record = Record { observations: vec![numbers(environment.observation())], ..Record::default() };
    while record.end.is_none() {
        network.observation_mut().copy_from_slice(environment.observation());
        let step = environment.step(network.run());
        record.rewards.push(step.reward.to_bits());
        record.observations.push(numbers(environment.observation()));
        record.end = step.end.map(End::is_terminal);
    }
    record
}

/// Prepares a task of the project in a folder, with its robot and a random policy. The spread of velocities
/// is removed, because physics in a graph does not support it. A target has a single position, because in a
/// graph its position depends on the name of the component.
fn prepare(name: &str, folder: &Path, change: impl FnOnce(&mut toml::Table)) -> (Task, toml::Table) {
    let tasks = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tasks"));
    let mut table: toml::Table =
        std::fs::read_to_string(tasks.join(format!("{name}.toml"))).unwrap().parse().unwrap();
    table["start"].as_table_mut().unwrap().remove("velocity_spread");
    change(&mut table);
    if let Some(target) = table.get_mut("command").and_then(|command| command.get_mut("target")) {
        *target = toml::Value::try_from([[0.07, 0.07], [-0.11, -0.11], [0.0, 0.0]]).unwrap();
    }
    let robot = table["robot"].as_str().unwrap();
    if tasks.join(robot).is_file() {
        std::fs::create_dir(folder.join(name)).unwrap();
        // the model and its profile
        for file in [Path::new(robot).to_path_buf(), Path::new(robot).with_extension("toml")] {
            std::fs::copy(tasks.join(&file), folder.join(&file)).unwrap();
        }
    }
    let text = toml::to_string(&table).unwrap();
    std::fs::write(folder.join("task.toml"), &text).unwrap();
    let task = Task::parse(&text).unwrap();
    write_policy(&task, &folder.join("policy"), 1.0);
    (task, table)
}

/// Asserts that three episodes of a graph, the first and the last with equal seeds, equal an environment's
/// to the bit. Returns them.
fn assert_agree(name: &str, folder: &Path, task: &Task, text: String) -> Vec<Record> {
    let episodes = graph_episodes(folder, text, &[11, 12, 11]);
    assert_eq!(episodes[0], episodes[2], "{name}: equal seeds");
    assert_ne!(episodes[0].1, episodes[1].1, "{name}: other seeds");
    let mut records = Vec::new();
    for (seed, found) in episodes {
        let expected = environment_episode(task, folder, seed);
        assert!(found.end.is_some(), "{name}: an episode without an end");
        assert!(found.rewards.len() > 5, "{name}: {} steps", found.rewards.len());
        assert_eq!(found.observations.len(), found.rewards.len() + 1, "{name}");
        let differs = found.observations.iter().zip(&expected.observations).position(|(a, b)| a != b);
        assert_eq!(differs, None, "{name}: first observation that differs");
        assert_eq!(found, expected, "{name}");
        records.push(found);
    }
    records
}

#[test]
fn graphs_and_environments_agree_to_the_bit() {
    let mut ends = HashSet::new();
    for name in ["cart-pole", "pendulum", "acrobot", "reacher"] {
        let folder = tempfile::tempdir().unwrap();
        let (task, table) = prepare(name, folder.path(), |_| {});
        let records = assert_agree(name, folder.path(), &task, graph_text(&table, true));
        assert_ne!(records[0].observations[0], records[1].observations[0], "{name}: other starts");
        ends.extend(records.iter().map(|record| record.end));
    }
    assert_eq!(ends.len(), 2, "terminal and truncated episodes");
}

#[test]
fn discrete_actions_agree_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let (task, table) = prepare("cart-pole", folder.path(), |table| {
        let rows = toml::Value::try_from([[-1.0, 0.0], [0.1, 0.0], [0.7, 0.0]]).unwrap();
        table["action"].as_table_mut().unwrap().insert("choices".into(), rows);
    });
    assert_agree("cart-pole", folder.path(), &task, graph_text(&table, true));
}

/// Prepares the cart-pole with a camera `eye` that sees a wall in depth and in grey.
fn prepare_images(folder: &Path) -> (Task, toml::Table) {
    prepare("cart-pole-camera", folder, |table| {
        let world = "ground = { height = -0.2 }\n            objects = [{ name = \"wall\", shape = { box = { size = [0.1, 1.0, 0.9] } }, position = [2.0, 0.0, 0.5] }]";
        table.insert("world".into(), toml::Value::Table(world.parse().unwrap()));
        let cameras = table["cameras"].as_table_mut().unwrap();
        let mut eye = cameras.remove("pole").unwrap();
        eye.as_table_mut().unwrap().insert("most".into(), 4.0.into());
        cameras.insert("eye".into(), eye);
        let image = "observations = [{ term = \"depth_image\", camera = \"eye\", range = [0.3, 3.5] },             { term = \"grey_image\", camera = \"eye\" }, { term = \"joint_positions\" }]";
        table.extend(image.parse::<toml::Table>().unwrap());
    })
}

/// Returns the graph of these images and their world.
fn graph_of_images(table: &toml::Table) -> String {
    let world = toml::Table::from_iter([("world".to_owned(), table["world"].clone())]);
    format!("{}\n{}", with_camera(&graph_text(table, true), table), toml::to_string(&world).unwrap())
}

#[test]
fn images_of_another_shape_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (_, mut table) = prepare_images(folder.path());
    let eye = table["cameras"]["eye"].as_table_mut().unwrap();
    // as many pixels as in training
    assert_eq!((eye["width"].as_integer(), eye["height"].as_integer()), (Some(16), Some(12)));
    eye.insert("width".into(), 12.into());
    eye.insert("height".into(), 16.into());
    let mut session = launch(folder.path(), graph_of_images(&table));
    let error = (0..100).find_map(|_| session.step().err()).expect("no step uses these images").to_string();
    let expected = "image of `eye`: 12 x 16 pixels, expected 16 x 12 as in the policy";
    assert!(error.contains(expected), "{error}");
}

#[test]
fn images_of_a_camera_agree_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let (task, table) = prepare_images(folder.path());
    let text = graph_of_images(&table);
    let records = assert_agree("cart-pole-camera", folder.path(), &task, text);
    let seen: HashSet<u64> =
        records[0].observations.iter().flat_map(|numbers| &numbers[..192]).copied().collect();
    assert!(seen.len() > 100, "{} different depths", seen.len());
}

#[test]
fn base_twists_agree_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    // one command: in a graph it depends on the name of the component
    let (task, table) = prepare("rover-velocity", folder.path(), |table| {
        let command = "forward = [0.12, 0.12]\nturn = [-0.4, -0.4]".parse().unwrap();
        table.insert("command".into(), toml::Value::Table(command));
    });
    let records = assert_agree("rover-velocity", folder.path(), &task, rover_graph(&table));
    assert!(records.iter().all(|record| record.end == Some(false)), "truncated episodes");
}

#[test]
fn settings_of_wheels_agree_to_the_bit() {
    let settings =
        "speed = 0.12\nacceleration = 0.4\nwheel_kp = 0.9\nmax_lead = 0.2\ngravity_compensation = false\n";
    let change = |wheels: Option<&str>| {
        let wheels: Option<toml::Table> = wheels.map(|text| text.parse().unwrap());
        move |table: &mut toml::Table| {
            let command = "forward = [0.12, 0.12]\nturn = [-0.4, -0.4]".parse().unwrap();
            table.insert("command".into(), toml::Value::Table(command));
            table.extend(wheels.map(|wheels| ("wheels".to_owned(), toml::Value::Table(wheels))));
        }
    };
    let folder = tempfile::tempdir().unwrap();
    let (task, table) = prepare("rover-velocity", folder.path(), change(Some(settings)));
    let text = rover_graph(&table);
    let config = format!("\n[component.wheels.config]\n{settings}\n[safety]");
    let records = assert_agree("rover-velocity", folder.path(), &task, text.replace("[safety]", &config));
    let plain = tempfile::tempdir().unwrap();
    let (task, table) = prepare("rover-velocity", plain.path(), change(None));
    let others = assert_agree("rover-velocity", plain.path(), &task, rover_graph(&table));
    assert_ne!(records, others, "the settings have an effect");
}

#[test]
fn base_twists_are_no_joint_targets() {
    let folder = tempfile::tempdir().unwrap();
    let (_, table) = prepare("rover-velocity", folder.path(), |_| {});
    let wheels = "kind = \"control.wheels\"";
    let text = rover_graph(&table)
        .replace(wheels, "kind = \"policy.joint_targets\"\nconfig = { policy = \"policy\" }");
    let text =
        text.replace("target = \"target\"", "action = \"action\"").replace(", odometry = \"odometry\"", "");
    let checked = graph::check(&folder.path().join("graph.toml"), text, &[], &registry(), &Machine::detect());
    let error = checked.expect_err("it commands no joints").render(false);
    assert!(error.contains("the action is a base twist, expected an action for joints"), "{error}");
    assert!(error.contains("control.wheels"), "{error}");
}

/// Writes a task of the project, and a policy for it whose actions are zero.
fn write_without_actions(name: &str, folder: &Path) -> Task {
    let file =
        Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tasks")).join(name).with_extension("toml");
    let text = std::fs::read_to_string(file).unwrap();
    let task = Task::parse(&text).unwrap();
    std::fs::write(folder.join("task.toml"), text).unwrap();
    write_policy(&task, &folder.join("policy"), 0.0);
    task
}

/// A graph of a quadruped on flat ground, its task and its policy at a rate.
fn quadruped_graph(rate: &str) -> String {
    format!(
        r#"
name = "quadruped"
clock = "lockstep"
duration = "60 s"

[robot.one]
urdf = "quadruped"

[component.physics]
kind = "physics.articulated"
robot = "one"
rate = "200 Hz"
subscribe = {{ joint_command = "command" }}
publish = {{ joint_state = "state", base_state = "base", contacts = "contacts" }}
config = {{ plant = true, world = {{ ground = {{}} }} }}

[component.task]
kind = "learner.task"
robot = "one"
rate = "{rate}"
ends_episode = true
subscribe = {{ joint_state = "state", base_state = "base", contacts = "contacts", action = "action" }}
publish = {{ observation = "observation", reward = "reward", command = "desired" }}
config = {{ task = "task.toml" }}

[component.policy]
kind = "policy.network"
robot = "one"
rate = "{rate}"
subscribe = {{ joint_state = "state", base_state = "base", command = "desired" }}
publish = {{ action = "action" }}
config = {{ policy = "policy", attitude = "base_state" }}

[component.drives]
kind = "policy.joint_targets"
robot = "one"
trigger = "state"
subscribe = {{ joint_state = "state", action = "action" }}
publish = {{ joint_command = "command" }}
config = {{ policy = "policy" }}
"#
    )
}

#[test]
fn quadruped_gets_rewards_and_observations_by_topics() {
    let folder = tempfile::tempdir().unwrap();
    // a policy whose actions are zero holds the default pose
    let task = write_without_actions("quadruped-velocity", folder.path());
    let mut session = launch(folder.path(), quadruped_graph("50 Hz"));
    session.read::<Reward>("reward").unwrap();
    session.read::<Observation>("observation").unwrap();
    session.step_until(Duration::from_millis(990)).unwrap();
    let reward = session.read::<Reward>("reward").unwrap().unwrap().value;
    assert_eq!((reward.step, reward.is_last()), (48, false), "it stands");
    let [low, high] = task.reward_range().unwrap();
    assert!(low < reward.reward && reward.reward < high && reward.total > 0.0, "{reward:?}");
    let seen = session.read::<Observation>("observation").unwrap().unwrap().value;
    assert_eq!((seen.step, seen.count()), (49, 48));
    assert!(seen.value()[8] < -0.999, "gravity points down: {:?}", seen.value());
    let desired = session.read::<TwistTarget>("desired").unwrap().unwrap().value;
    let command = [desired.linear[0], desired.linear[1], desired.angular[2]];
    let ranges = task.command.as_ref().unwrap();
    for (index, [low, high]) in [ranges.forward, ranges.left, ranges.turn].into_iter().enumerate() {
        let scale = [2.0, 2.0, 0.25][index];
        assert!((low..=high).contains(&command[index]), "{command:?}");
        assert_eq!(seen.value()[9 + index], f64::from((scale * command[index]) as f32));
    }
    // other episodes have other commands
    session.reset(7).unwrap();
    session.step_until(Duration::from_millis(100)).unwrap();
    let next = session.read::<TwistTarget>("desired").unwrap().unwrap().value;
    assert_ne!(next, desired);
}

#[test]
fn a_quadruped_without_actions_stands_in_its_environment() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tasks"));
    let text = std::fs::read_to_string(folder.join("quadruped-velocity.toml")).unwrap();
    let task = Task::parse(&text).unwrap();
    let simulation = Scene::load(&task, folder).unwrap().simulation().unwrap();
    let mut environment = Environment::new(&task, simulation, 1, 0).unwrap();
    let episode = environment.run_episode(|_, action| action.fill(0.0)).unwrap();
    assert_eq!((episode.steps, episode.end), (task.steps(), End::Truncated));
}

#[test]
fn tasks_with_objects_are_refused_in_graphs() {
    let [kind] = motorium_learners::kinds();
    let tasks = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tasks"));
    let robot = RobotReference {
        name: "paddles".into(),
        urdf: "../graphs/ping-pong/paddles.urdf".into(),
        base: tasks.into(),
        ..RobotReference::default()
    };
    let config = serde_json::json!({ "task": tasks.join("ping-pong.toml") });
    let error = kind.declare(config, Some(robot)).unwrap_err().error;
    assert_eq!(error.key.as_deref(), Some("task"));
    assert!(error.message.starts_with("\"red ball\" is an object"), "{}", error.message);
}

#[test]
fn quadruped_walks_with_the_pattern_of_its_policy() {
    let folder = tempfile::tempdir().unwrap();
    // zero actions command the middle of all ranges
    let task = write_without_actions("quadruped-cpg", folder.path());
    let mut session = launch(folder.path(), quadruped_graph("10 Hz"));
    session.read::<Reward>("reward").unwrap();
    session.step_until(Duration::from_millis(5990)).unwrap();
    let reward = session.read::<Reward>("reward").unwrap().unwrap().value;
    assert!(!reward.is_last() && reward.step >= 57, "it does not fall: {reward:?}");
    let travelled = session.read::<BaseState>("base").unwrap().unwrap().value.position[0];
    // in the training environment the robot walks as far
    let simulation = Scene::load(&task, folder.path()).unwrap().simulation().unwrap();
    let mut environment = Environment::new(&task, simulation, 1, 0).unwrap();
    environment.reset().unwrap();
    for _ in 0..60 {
        environment.step(&[0.0; 14]);
    }
    let expected = environment.simulation().configuration()[0];
    assert!(travelled > 0.4 && (travelled - expected).abs() < 0.25, "{travelled} m, {expected} m");
}

#[test]
fn the_trained_cart_pole_balances_on_every_engine() {
    assert_balances("cart-pole-policy", 500.0);
}

#[test]
fn the_cart_pole_balances_by_sight_on_every_engine() {
    assert_balances("cart-pole-camera", 250.0);
}

/// Asserts that five episodes of a graph have the return of a pole that does not fall, on every engine.
fn assert_balances(name: &str, expected: f64) {
    let graphs = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../graphs"));
    let file = &graphs.join(name).with_extension("toml");
    let text = std::fs::read_to_string(file).unwrap();
    let episodes = "[episodes]\ncount = 5\nvary_seed = true\n\n[robot.cart]";
    assert!(text.contains("physics.articulated") && text.contains("[robot.cart]"));
    let text = text.replace("[robot.cart]", episodes);
    for engine in ["articulated", "rapier", "mujoco"] {
        let text = text.replace("physics.articulated", &format!("physics.{engine}"));
        let checked = graph::check(file, text, &[], &registry(), &Machine::detect());
        let plan = match checked {
            Ok(checked) => checked.plan,
            Err(error) if engine == "mujoco" && error.render(false).contains("pip install mujoco") => {
                eprintln!("skipped: MuJoCo's library is missing");
                continue;
            }
            Err(error) => panic!("{}", error.render(false)),
        };
        let report = session::run(plan, &registry(), &Options::inline(), &mut |_| {}).unwrap();
        let task = &report.results["task"];
        assert_eq!((&task["episodes"], &task["truncations"]), (&5.into(), &5.into()), "{engine}: {task}");
        assert_eq!(task["mean_return"], expected, "{engine}: {task}");
    }
}
