//! Tests of the tasks in `tasks/`.

use std::f64::consts::PI;
use std::path::{Path, PathBuf};

use motorium_models::onnx::Model;
use motorium_physics::{Articulated, Simulator as _};
use rand::RngExt as _;

use super::*;
use crate::learner::Algorithm;
use crate::random::{Counter, Purpose};
use crate::task::{Task, Terms};
use crate::training::start;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tasks")
}

fn text(name: &str) -> String {
    std::fs::read_to_string(folder().join(format!("{name}.toml"))).expect("a task of the project")
}

/// Returns the task in a file after replacements, each of which must match.
fn changed(name: &str, changes: &[(&str, &str)]) -> Task {
    let mut text = text(name);
    for (from, to) in changes {
        assert!(text.contains(from), "{name}: {from}");
        text = text.replace(from, to);
    }
    Task::parse(&text).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn scene(task: &Task) -> Scene {
    Scene::load(task, &folder()).expect("a robot and its world")
}

fn world(task: &Task, seed: u64) -> Environment<Articulated> {
    let simulation = scene(task).simulation().expect("a simulation");
    Environment::new(task, simulation, seed, 0).expect("an environment")
}

/// Runs an episode of zero actions; all observations are finite and all rewards in the range of the task.
fn rest(task: &Task, seed: u64) -> EpisodeSummary {
    let [low, high] = task.reward_range().expect("bounded rewards");
    let mut world = world(task, seed);
    world.reset().expect("an episode");
    let action = vec![0.0; world.terms().actions()];
    let (mut total, mut steps) = (0.0, 0);
    loop {
        let step = world.step(&action);
        assert!(low <= step.reward && step.reward <= high, "{}: {} at {steps}", task.title, step.reward);
        assert!(world.observation().iter().all(|number| number.is_finite()), "{}", task.title);
        (total, steps) = (total + step.reward, steps + 1);
        if let Some(end) = step.end {
            return EpisodeSummary { total, steps, end };
        }
    }
}

/// The tasks, and the end and the least number of steps of an episode of zero actions.
const TASKS: [(&str, End, usize); 12] = [
    ("acrobot", End::Truncated, 200),
    ("ball-in-cup", End::Truncated, 200),
    ("cart-pole", End::Failure, 10),
    ("cart-pole-camera", End::Failure, 10),
    ("cart-pole-masked", End::Failure, 10),
    ("humanoid-stand", End::Failure, 20),
    ("pendulum", End::Truncated, 200),
    ("ping-pong", End::Truncated, 500),
    ("quadruped-cpg", End::Truncated, 200),
    ("quadruped-velocity", End::Truncated, 1000),
    ("reacher", End::Truncated, 250),
    ("rover-velocity", End::Truncated, 200),
];

#[test]
fn zero_actions_have_sane_episodes_in_every_task() {
    let files = std::fs::read_dir(folder()).expect("tasks").flatten().map(|entry| entry.path());
    let mut names: Vec<String> = files
        .filter(|file| file.extension().is_some_and(|extension| extension == "toml"))
        .map(|file| file.file_stem().expect("a name").to_string_lossy().into_owned())
        .collect();
    names.sort();
    assert_eq!(names, TASKS.map(|(name, ..)| name), "every file is one of the tasks below");
    for (name, end, least) in TASKS {
        let task = changed(name, &[]);
        let found = rest(&task, 1);
        assert_eq!(found.end, end, "{name}: {found:?}");
        assert!(found.steps >= least, "{name}: {found:?}");
    }
}

#[test]
fn equal_seeds_give_equal_bits_in_every_task() {
    for (name, ..) in TASKS {
        let task = changed(name, &[]);
        let scene = scene(&task);
        let run = |seed, threads| {
            let build = || scene.simulation();
            let mut worlds = VectorEnvironment::new(&task, (3, threads), seed, build).expect("worlds");
            let width = worlds.terms().actions();
            let mut seen: Vec<u32> = Vec::new();
            for step in 0..40 {
                let counter = Counter { step, ..Counter::default() };
                let mut random = counter.stream(Purpose::Action);
                let actions: Vec<f32> = (0..3 * width).map(|_| random.random::<f32>() * 2.0 - 1.0).collect();
                let steps = worlds.step(&actions).expect("a step");
                seen.extend(steps.iter().map(|step| (step.reward as f32).to_bits()));
                seen.extend(worlds.observations().iter().map(|number| number.to_bits()));
            }
            seen
        };
        let first = run(1, 1);
        assert!(run(1, 2) == first, "{name}: two threads");
        assert!(run(1, 1) == first, "{name}: a second run");
        assert!(run(2, 1) != first, "{name}: another seed");
    }
}

/// Returns the mean returns of random actions and of a policy trained for some steps.
fn returns(name: &str, ppo: &str) -> [f64; 2] {
    let mut task = changed(name, &[]);
    task.algorithms = format!("[ppo]\n{ppo}").parse().expect("settings");
    let scene = scene(&task);
    let mut learner = start(Algorithm::Ppo, &task, &scene, None, (1, 2)).expect("a learner");
    while !learner.is_finished() {
        learner.advance().expect("an update");
    }
    let mut program = Model::read(&learner.policy().to_onnx(&[]))
        .and_then(|model| model.program(1))
        .expect("the operators of a policy");
    let mean = |act: &mut dyn FnMut(&[f32], &mut [f32])| {
        let mut world = world(&task, 1000);
        let totals = (0..10).map(|_| world.run_episode(&mut *act).expect("an episode").total);
        totals.sum::<f64>() / 10.0
    };
    let mut random = Counter::default().stream(Purpose::Action);
    let untrained = mean(&mut |_, action| {
        action.iter_mut().for_each(|number| *number = random.random::<f32>() * 2.0 - 1.0);
    });
    let trained = mean(&mut |observation, action| {
        program.input_mut(0).copy_from_slice(observation);
        program.run();
        action.copy_from_slice(program.output(0));
    });
    [untrained, trained]
}

#[test]
fn ppo_learns_to_reach() {
    let [random, trained] = returns("reacher", "steps = 30000\nworlds = 8\nhorizon = 256\nrate = 1e-3");
    assert!(trained > random + 20.0, "{random} of random actions, {trained}");
}

#[test]
fn ppo_learns_to_stand() {
    let settings =
        "steps = 12288\nworlds = 8\nhorizon = 192\ndeviation = 0.3\nhidden = [32, 32]\nrate = 1e-3";
    let [random, trained] = returns("humanoid-stand", settings);
    assert!(trained > random, "{random} of random actions, {trained}");
}

#[test]
fn ppo_learns_to_bounce_and_to_catch() {
    for (name, settings) in [
        ("ping-pong", "steps = 50000\nworlds = 16\nhorizon = 128\nrate = 1e-3"),
        ("ball-in-cup", "steps = 80000\nworlds = 16\nhorizon = 128\nrate = 1e-3"),
    ] {
        let [random, trained] = returns(name, settings);
        assert!(trained > random, "{name}: {random} of random actions, {trained}");
    }
}

#[test]
fn a_pattern_generator_walks_by_its_amplitude() {
    let changes = [("mass = [0.9, 1.1]\nfriction = [0.7, 1.2]", ""), ("duration = 20.0", "duration = 6.0")];
    let task = changed("quadruped-cpg", &changes);
    let travelled = |amplitude: f32| {
        let mut world = world(&task, 1);
        world.reset().expect("an episode");
        let mut action = vec![0.0; world.terms().actions()];
        assert_eq!(action.len(), 14, "12 joints, frequency and amplitude");
        action[13] = amplitude;
        let steps: Vec<Step> = (0..60).map(|_| world.step(&action)).collect();
        assert!(steps[..59].iter().all(|step| step.end.is_none()), "amplitude {amplitude}: it falls");
        world.simulation().configuration()[0]
    };
    let (still, half, whole) = (travelled(-1.0), travelled(0.0), travelled(0.5));
    assert!(still.abs() < 0.02, "{still} m without an amplitude");
    assert!(half > 0.5 && whole > half, "{half} m, {whole} m");
}

#[test]
fn ppo_learns_to_walk_by_a_pattern_generator() {
    let settings = "steps = 8192\nworlds = 8\nhorizon = 64\ndeviation = 0.5\nhidden = [32, 32]\nrate = 1e-3";
    let [random, trained] = returns("quadruped-cpg", settings);
    assert!(trained > random, "{random} of random actions, {trained}");
}

#[test]
fn a_humanoid_starts_with_its_weight_on_both_feet() {
    let changes = [
        ("velocity_spread = 0.8", "velocity_spread = 0.0"),
        ("start = [-0.03, 0.03]\nmass = [0.9, 1.1]\nfriction = [0.7, 1.2]", ""),
    ];
    let mut world = world(&changed("humanoid-stand", &changes), 1);
    world.reset().expect("an episode");
    let mut load = [0.0; 2];
    for step in 1..=50 {
        assert_eq!(world.step(&[0.0; 31]).end, None, "step {step}");
        load = [0.0; 2];
        world.simulation().visit_contacts(&mut |contact| {
            for (sum, foot) in load.iter_mut().zip(["left_foot", "right_foot"]) {
                if [contact.first, contact.second].contains(&foot) {
                    *sum += contact.force;
                }
            }
        });
        assert!(load.iter().all(|force| *force > 20.0), "step {step}: {load:?} N");
        let height = world.simulation().configuration()[2];
        assert!((height - 0.5324).abs() < 0.02, "step {step}: {height} m");
    }
    let weight = 31.0 * 9.81;
    assert!((load[0] + load[1] - weight).abs() < 0.05 * weight, "{load:?} N, {weight} N");
}

#[test]
fn a_target_is_observed_rewarded_and_replaced() {
    let task = changed("reacher", &[]);
    let mut world = world(&task, 3);
    world.reset().expect("an episode");
    let mut targets = vec![world.command()];
    for step in 1..=250 {
        let before = world.command();
        let found = world.step(&[0.3, -0.2]);
        let q = world.simulation().positions();
        let tip = [
            0.1 * q[0].cos() + 0.11 * (q[0] + q[1]).cos(),
            0.1 * q[0].sin() + 0.11 * (q[0] + q[1]).sin(),
            0.0,
        ];
        let distance = |target: [f64; 3]| {
            let squares = target.iter().zip(tip).map(|(a, b)| (a - b) * (a - b));
            squares.sum::<f64>().sqrt()
        };
        let action = (0.3_f64.powi(2) + 0.2_f64.powi(2)) / 2.0;
        let [near, far] = [(-(distance(before) / 0.02).powi(2)).exp(), distance(before).min(0.4)];
        let expected = near - 2.5 * far - 0.02 * action;
        assert!((found.reward - expected).abs() < 1e-6, "step {step}: {} {expected}", found.reward);
        let target = world.command();
        let observed = &world.observation()[4..];
        for axis in 0..3 {
            let relative = 10.0 * (target[axis] - tip[axis]);
            assert_eq!(observed[axis], (10.0 * target[axis]) as f32, "step {step}");
            assert!((f64::from(observed[3 + axis]) - relative).abs() < 1e-6, "step {step}: {observed:?}");
        }
        if target != targets[targets.len() - 1] {
            assert!(step % 125 == 0, "step {step}");
            targets.push(target);
        }
    }
    assert_eq!(targets.len(), 3, "one at the start, and one after each interval");
    assert!(targets.iter().all(|[x, y, z]| x.abs() <= 0.14 && y.abs() <= 0.14 && *z == 0.0), "{targets:?}");
}

#[test]
fn a_rover_moves_at_the_velocity_of_its_action() {
    let changes = [("mass = [0.9, 1.1]\nfriction = [0.7, 1.2]", "")];
    let task = changed("rover-velocity", &changes);
    let mut world = world(&task, 1);
    world.reset().expect("an episode");
    assert_eq!(world.terms().actions(), 2, "forward and turn");
    // 0.1 m/s and 0.6 rad/s, reached after 0.15 s at 1 m/s^2
    for step in 0..100 {
        assert_eq!(world.step(&[0.5, 0.4]).end, None, "step {step}");
    }
    let v = world.simulation().velocity().to_vec();
    assert!((v[0] - 0.1).abs() < 2e-3 && v[1].abs() < 2e-3 && (v[5] - 0.6).abs() < 0.02, "{v:?}");
    // on a circle of 1/6 m about a point to the left
    let q = world.simulation().configuration();
    let radius = q[0].hypot(q[1] - 1.0 / 6.0);
    assert!((radius - 1.0 / 6.0).abs() < 0.01, "{radius} m, at {:?}", &q[..2]);
    // an episode starts at rest
    world.reset().expect("an episode");
    world.step(&[0.0, 0.0]);
    assert!(world.simulation().velocity().iter().all(|v| v.abs() < 0.02), "it stands");
}

#[test]
fn ppo_learns_to_drive_a_rover() {
    let settings = "steps = 24576\nworlds = 16\nhorizon = 64\nhidden = [16, 16]\ndeviation = 0.5\n\
                    rate = 3e-3\nmirror = true";
    let [random, trained] = returns("rover-velocity", settings);
    let task = changed("rover-velocity", &[]);
    let standing = (0..10).map(|seed| rest(&task, seed).total).sum::<f64>() / 10.0;
    // 2 in each of 200 steps at the commanded velocity
    let found = format!("{random} of random actions, {standing} at rest, {trained}");
    assert!(trained > 250.0 && trained > 1.5 * standing && trained > random, "{found}");
}

#[test]
fn base_twists_that_the_robot_cannot_follow_are_refused() {
    let error = |changes: &[(&str, &str)]| {
        let task = changed("rover-velocity", changes);
        let simulation = scene(&task).simulation().expect("a simulation");
        match Environment::new(&task, simulation, 1, 0).err() {
            Some(EnvironmentError::Task(error)) => error,
            other => panic!("{changes:?}: {other:?}"),
        }
    };
    let key = |error: TaskError| match error {
        TaskError::Value { key, .. } => key,
        other => panic!("{other}"),
    };
    let sideways = ("turn = [-1.5", "left = [-0.1, 0.1], turn = [-1.5");
    assert_eq!(key(error(&[sideways])), "action.twist.left");
    assert_eq!(key(error(&[("decimation = 8", "decimation = 21")])), "decimation");
    let effort = ("\"action_change\"", "\"effort\", clip = [0.0, 1.0]");
    assert_eq!(key(error(&[effort])), "rewards[2].term");
    assert_eq!(key(error(&[("turn = [-1.5, 1.5]", "turn = [-1.0, 1.5]")])), "action.twist.turn");
    let pose = "position = [0.0, 0.0, 0.239446147, 0.0, 0.0, 0.0, 1.0,
        0.0, 0.8, -1.6, 0.0, 0.8, -1.6, 0.0, -0.8, 1.6, 0.0, -0.8, 1.6]";
    let legs = [
        ("differential-drive", "quadruped"),
        ("position = [0.0, 0.0, 0.033, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0]", pose),
    ];
    let without_wheels = error(&legs).to_string();
    assert!(
        without_wheels.contains("has no wheels") && without_wheels.contains("help: "),
        "{without_wheels}"
    );
}

#[test]
fn a_ball_that_falls_into_the_cup_is_caught() {
    // the string is slack, and the ball above the cup
    let above = format!("position = [0.0, 0.0, {PI}, 0.2]");
    let changes = [("position = [0.0, 0.0, 0.0, 0.3]", &*above), ("start = [-0.05, 0.05]\n", "")];
    let found = rest(&changed("ball-in-cup", &changes), 1);
    assert_eq!(found.end, End::Success, "{found:?}");
    // it starts 0.155 m above the catch height and falls for 0.16 s, longer while the cup sags
    assert!((7..=12).contains(&found.steps), "{found:?}");
    assert!(found.total > 2.0, "{found:?}");
}

#[test]
fn a_string_holds_its_ball_below_the_cup() {
    let task = changed("ball-in-cup", &[]);
    let mut world = world(&task, 5);
    world.reset().expect("an episode");
    for step in 0..200 {
        let phase = f64::from(step) * 0.6;
        let found = world.step(&[phase.sin() as f32, (0.7 * phase).cos() as f32, 0.0, 0.0]);
        let observed = &world.observation()[8..11];
        let [x, _, z] = [0, 1, 2].map(|axis| f64::from(observed[axis]) / 3.0);
        let length = (x * x + (z + 0.045) * (z + 0.045)).sqrt();
        assert!(length < 0.305, "step {step}: the string is {length} m long");
        // the bottom of the cup is solid
        assert!(x.abs() > 0.05 || !(-0.06..=-0.03).contains(&z), "step {step}: the ball is at {x} {z}");
        if found.end.is_some() {
            return;
        }
    }
}

#[test]
fn balls_bounce_and_rest_on_their_paddles() {
    let mut world = world(&changed("ping-pong", &[("\"red ball\" = { z = [-0.1, 0.2] }", "")]), 1);
    world.reset().expect("an episode");
    let heights: Vec<f64> = (0..500)
        .map(|step| {
            assert_eq!(world.step(&[0.0; 2]).end.is_some(), step == 499);
            f64::from(world.observation()[6]) / 3.0
        })
        .collect();
    // from 0.38 m above the paddle, restitution 0.5: a quarter as high after the bounce
    let bounce = heights.iter().position(|height| *height < 0.06).expect("it falls");
    let apex = heights[bounce + 2..bounce + 30].iter().copied().fold(0.0, f64::max);
    assert!((0.08..0.15).contains(&apex), "{apex} m after a fall from {}", heights[0]);
    assert!((heights[499] - 0.02).abs() < 0.003, "at rest: {}", heights[499]);
}

#[test]
fn objects_and_links_that_are_missing_are_named() {
    let key = |name: &str, from: &str, to: &str| {
        let task = changed(name, &[(from, to)]);
        let made = scene(&task).simulation().map(|simulation| Environment::new(&task, simulation, 1, 0));
        match made.expect("a simulation").err() {
            Some(EnvironmentError::Task(TaskError::Value { key, found, .. })) => (key, found),
            other => panic!("{name}: {other:?}"),
        }
    };
    let missing = key("ping-pong", "points = [\"red ball\", \"left_paddle\"]", "points = [\"blue ball\"]");
    assert_eq!(missing, ("points".to_owned(), "\"blue ball\"".to_owned()));
    let missing = key("reacher", "target = [[-0.14, 0.14], [-0.14, 0.14], [0.0, 0.0]]\n", "");
    assert_eq!(missing, ("points".to_owned(), "\"target\"".to_owned()));
    let term = "{ term = \"projected_gravity\" }";
    let floating = key("humanoid-stand", term, "{ term = \"point_position\", points = [\"left_hand\"] }");
    assert_eq!(floating, ("observations[2].points".to_owned(), "\"left_hand\"".to_owned()));
    let task = changed("reacher", &[]);
    let model = motorium_robots::load(&task.robot, &folder()).expect("a robot").model;
    assert!(Terms::new(&task, &model).expect("terms").objects().is_empty());
}

#[test]
fn mirrored_actions_move_the_quadruped_as_its_mirror_image() {
    let task = changed(
        "quadruped-velocity",
        &[
            ("mass = [0.9, 1.1]\nfriction = [0.7, 1.2]", ""),
            ("forward = [-0.3, 0.6]", "forward = [0.2, 0.2]"),
            ("left = [-0.2, 0.2]", "left = [0.0, 0.0]"),
            ("turn = [-0.6, 0.6]", "turn = [0.0, 0.0]"),
        ],
    );
    let mut worlds = [1, 1].map(|seed| world(&task, seed));
    let mirror = worlds[0].terms().mirror().expect("a symmetry").clone();
    let (inputs, actions) = (worlds[0].terms().inputs(), worlds[0].terms().actions());
    let (mut image, mut expected) = (vec![0.0; actions], vec![0.0; inputs]);
    worlds.iter_mut().for_each(|world| {
        world.reset().expect("an episode");
    });
    let mut sideways = 0.0_f32;
    for step in 0..12 {
        let counter = Counter { step, ..Counter::default() };
        let mut random = counter.stream(Purpose::Action);
        let action: Vec<f32> = (0..actions).map(|_| random.random::<f32>() * 2.0 - 1.0).collect();
        mirror.action(&action, &mut image);
        worlds[0].step(&action);
        worlds[1].step(&image);
        mirror.observation(worlds[0].observation(), &mut expected);
        for (found, expected) in worlds[1].observation().iter().zip(&expected) {
            assert!((found - expected).abs() < 1e-3, "step {step}: {found} {expected}");
        }
        sideways = sideways.max(expected[1].abs());
    }
    assert!(sideways > 0.02, "the motion is not symmetric itself: {sideways}");
}
