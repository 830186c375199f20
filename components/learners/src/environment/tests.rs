//! Environments on the robots of the catalogue.

use std::path::Path;

use motorium_physics::{ArticulatedSimulator, BuildError, Options, Simulator as _, World};
use motorium_robots::load;

use super::*;
use crate::task::{Task, TaskError};

const TEXT: &str = r#"
title = "Balance"
robot = "cart-pole"
step = 0.01
decimation = 2
duration = 0.5
observations = [
    { term = "joint_positions", history = 2 },
    { term = "joint_velocities", scale = 0.5, clip = [-1.0, 1.0] },
    { term = "last_action" },
]
rewards = [{ term = "alive" }, { term = "joint_position", joint = "slider", shape = "absolute", clip = [0, 3] }]
terminations = [{ term = "joint_position", joint = "hinge", outside = [2.6, 3.7] }]
[start]
position = [0.0, 3.141592653589793]
velocity_spread = 0.05
[action]
joints = ["slider", "hinge"]
kind = "effort"
scale = [10.0, 0.0]
default_pose = [0.0, 3.141592653589793]
clip = [-1.0, 1.0]
[randomise]
start = [-0.05, 0.05]
mass = [0.9, 1.1]
"#;

fn simulation() -> Result<ArticulatedSimulator, BuildError> {
    let model = load("cart-pole", Path::new(".")).expect("a robot of the catalogue").model;
    ArticulatedSimulator::new(model, World::default(), &[0.0, 3.0], Options::default())
}

fn one(seed: u64, world: u64) -> Environment<motorium_physics::Articulated> {
    let task = Task::parse(TEXT).expect("a task");
    Environment::new(&task, simulation().expect("a simulation"), seed, world).expect("an environment")
}

fn many(worlds: usize, threads: usize) -> VectorEnvironment<motorium_physics::Articulated> {
    let task = Task::parse(TEXT).expect("a task");
    VectorEnvironment::new(&task, (worlds, threads), 7, simulation).expect("environments")
}

/// Returns an action that depends on world and step. Odd worlds push until they fail.
fn action(world: usize, step: usize) -> [f32; 2] {
    if world.is_multiple_of(2) { [((world + step) as f32).sin() * 0.05, 0.3] } else { [0.9, 0.0] }
}

#[test]
fn worlds_match_single_environments_on_any_threads() {
    let run = |threads| {
        let mut worlds = many(5, threads);
        let mut seen = vec![worlds.observations().to_vec()];
        let mut ends = 0;
        for step in 0..60 {
            let actions: Vec<f32> = (0..5).flat_map(|world| action(world, step)).collect();
            let steps = worlds.step(&actions).expect("a step").to_vec();
            ends += steps.iter().filter(|step| step.end.is_some()).count();
            seen.push(steps.iter().map(|step| step.reward as f32).collect());
            seen.push(worlds.observations().to_vec());
        }
        assert!(ends >= 8, "{ends} episodes ended");
        seen
    };
    let seen = run(1);
    assert_eq!(run(2), seen);
    for world in 0..5 {
        let mut single = one(7, world as u64);
        let first = single.reset().expect("an episode").to_vec();
        assert_eq!(first, seen[0][world * 8..][..8], "world {world}");
        for step in 0..60 {
            let found = single.step(&action(world, step));
            assert_eq!(found.reward as f32, seen[1 + 2 * step][world], "world {world}, step {step}");
            if found.end.is_some() {
                single.reset().expect("an episode");
            }
            assert_eq!(single.observation(), &seen[2 + 2 * step][world * 8..][..8], "world {world}, {step}");
        }
    }
}

#[test]
fn final_observations_are_kept_before_a_reset() {
    let mut worlds = many(2, 1);
    let mut single = one(7, 1);
    single.reset().expect("an episode");
    for step in 0..60 {
        let actions: Vec<f32> = (0..2).flat_map(|world| action(world, step)).collect();
        worlds.step(&actions).expect("a step");
        let found = single.step(&action(1, step));
        let Some(end) = found.end else {
            assert_eq!(worlds.final_observation(1), None);
            continue;
        };
        assert!(end.is_terminal());
        assert_eq!(worlds.final_observation(1), Some(single.observation()));
        single.reset().expect("an episode");
        assert_eq!(&worlds.observations()[8..], single.observation());
        return;
    }
    panic!("the pole never fell");
}

#[test]
fn truncation_is_not_termination() {
    let mut world = one(3, 0);
    world.reset().expect("an episode");
    let ends: Vec<_> = (0..25).map(|step| world.step(&action(0, step)).end).collect();
    assert_eq!(ends[24], Some(End::Truncated), "{ends:?}");
    assert!(ends[..24].iter().all(Option::is_none), "{ends:?}");
    assert!(!End::Truncated.is_terminal() && End::Failure.is_terminal() && End::Success.is_terminal());
}

#[test]
fn observations_hold_histories_scales_and_clips() {
    let mut world = one(1, 0);
    let first = world.reset().expect("an episode").to_vec();
    // positions twice, velocities, last action
    assert_eq!(first[..2], first[2..4]);
    assert!(first[4..6].iter().all(|v| v.abs() <= 0.025 && *v != 0.0), "{first:?}");
    assert_eq!(first[6..], [0.0; 2]);
    world.step(&[0.9, 0.5]);
    let second = world.observation().to_vec();
    assert_eq!(second[..2], first[2..4], "the older step of the history");
    let positions = world.simulation().positions();
    assert_eq!(second[2], positions[0] as f32);
    assert_eq!(second[3], (positions[1] - std::f64::consts::PI) as f32);
    assert_eq!(second[6..], [0.9, 0.5]);
}

#[test]
fn reward_is_evaluated_after_the_step() {
    let mut world = one(1, 0);
    world.reset().expect("an episode");
    let step = world.step(&[1.0, 0.0]);
    assert_eq!(step.reward, 1.0 + world.simulation().positions()[0].abs());
}

#[test]
fn replayed_worlds_continue_bit_for_bit() {
    let run = |worlds: &mut VectorEnvironment<_>, steps: core::ops::Range<usize>| {
        for step in steps {
            let actions: Vec<f32> = (0..4).flat_map(|world| action(world, step)).collect();
            worlds.step(&actions).expect("a step");
        }
        worlds.observations().to_vec()
    };
    let mut straight = many(4, 1);
    run(&mut straight, 0..37);
    let mut resumed = many(4, 2);
    resumed.resume(7, &straight.progress()).expect("episodes");
    assert_eq!(resumed.observations(), straight.observations());
    assert_eq!(run(&mut resumed, 37..60), run(&mut straight, 37..60));
}

#[test]
fn terms_that_need_other_components_are_refused() {
    let text = TEXT.replace("\"last_action\"", "\"base_angular_velocity\"");
    let task = Task::parse(&text).expect("a task");
    let found = Environment::new(&task, simulation().expect("a simulation"), 1, 0);
    let error = found.err().expect("no base").to_string();
    assert!(error.starts_with("`observations[2].term`: found base_angular_velocity, expected"), "{error}");
}

/// Creates a quadruped with a new command every five steps.
fn quadruped(seed: u64) -> Environment<motorium_physics::Articulated> {
    let text = include_str!("../../../../tasks/quadruped-velocity.toml");
    assert!(text.contains("interval = 5.0") && text.contains("standing = 0.1"));
    let text = text.replace("interval = 5.0", "interval = 0.1").replace("standing = 0.1", "standing = 0.0");
    let task = Task::parse(&text).expect("a task");
    let simulation = Scene::load(&task, Path::new(".")).expect("a robot").simulation().expect("a simulation");
    Environment::new(&task, simulation, seed, 0).expect("an environment")
}

#[test]
fn standing_quadruped_is_observed_and_commanded() {
    let mut world = quadruped(1);
    assert_eq!(world.reset().expect("an episode").len(), 48);
    let mut commands = vec![world.command()];
    for step in 1..=50 {
        let found = world.step(&[0.0; 12]);
        assert_eq!(found.end, None, "step {step}");
        let observation = world.observation();
        // gravity points down, and the command is scaled
        assert!(observation[8] < -0.99, "{observation:?}");
        let command = world.command();
        for (index, scale) in [2.0, 2.0, 0.25].into_iter().enumerate() {
            assert_eq!(observation[9 + index], (scale * command[index]) as f32, "step {step}");
        }
        let is_new = command != commands[commands.len() - 1];
        assert_eq!(is_new, step % 5 == 0, "step {step}");
        commands.push(command);
    }
    // another episode has other commands; an equal environment has the same ones
    world.reset().expect("an episode");
    assert_ne!(world.command(), commands[0]);
    let mut equal = quadruped(1);
    equal.reset().expect("an episode");
    assert_eq!(equal.command(), commands[0]);
}

#[test]
fn falling_quadruped_ends_its_episode() {
    let mut world = quadruped(2);
    world.reset().expect("an episode");
    // both left legs are lifted
    let action: Vec<f32> = (0..12).map(|joint| if matches!(joint / 3, 0 | 2) { 4.0 } else { 0.0 }).collect();
    let end = (0..200).find_map(|_| world.step(&action).end);
    assert_eq!(end, Some(End::Failure));
}

#[test]
fn free_steps_precede_the_first_observation() {
    let run = |text: &str| {
        let task = Task::parse(text).expect("a task");
        let mut world = Environment::new(&task, simulation().expect("a simulation"), 1, 0).expect("a world");
        world.reset_from(9).expect("an episode");
        world.simulation().configuration().to_vec()
    };
    let free = TEXT.replace("[start]", "[start]\nfree_steps = 1").replace("velocity_spread = 0.05", "");
    let [without, with] = [TEXT.replace("velocity_spread = 0.05", ""), free].map(|text| run(&text));
    // the pole falls by a fraction of g dt^2
    let moved = (with[1] - without[1]).abs();
    assert!(moved > 1e-7 && moved < 1e-3, "{moved}");
}

#[test]
fn noise_changes_observations_but_not_states() {
    let exact = TEXT
        .replace(", history = 2", "")
        .replace(", scale = 0.5, clip = [-1.0, 1.0]", "")
        .replace("    { term = \"last_action\" },\n", "");
    let text = exact.clone() + "[noise]\njoint_positions = 0.1\njoint_velocities = 0.5\n";
    let run = |text: &str| {
        let task = Task::parse(text).expect("a task");
        let mut world = Environment::new(&task, simulation().expect("a simulation"), 1, 0).expect("a world");
        let mut rows = vec![world.reset().expect("an episode").to_vec()];
        rows.extend((0..4).map(|_| {
            world.step(&[0.3, 0.0]);
            world.observation().to_vec()
        }));
        (rows, world.simulation().configuration().to_vec())
    };
    let ((exact, reached), (noisy, also_reached)) = (run(&exact), run(&text));
    assert_eq!(reached, also_reached);
    let mut largest = [0.0_f32; 2];
    for (exact, noisy) in exact.iter().zip(&noisy) {
        for (index, (a, b)) in exact.iter().zip(noisy).enumerate() {
            assert_ne!(a, b);
            largest[index / 2] = largest[index / 2].max((a - b).abs());
        }
    }
    let [positions, velocities] = largest;
    assert!(positions > 0.03 && positions <= 0.1 + 1e-6, "{positions}");
    assert!(velocities > 0.15 && velocities <= 0.5 + 1e-6, "{velocities}");
    assert_eq!(run(&text).0, noisy);
}

#[test]
fn delayed_actions_take_effect_within_their_step() {
    let velocity = |delay: &str| {
        let task = Task::parse(&format!("delay = {delay}\n{TEXT}")).expect("a task");
        let mut world = Environment::new(&task, simulation().expect("a simulation"), 1, 0).expect("a world");
        world.reset().expect("an episode");
        let before = world.simulation().velocity()[0];
        world.step(&[1.0, 0.0]);
        world.simulation().velocity()[0] - before
    };
    let [at_once, late] = [velocity("[0, 0]"), velocity("[1, 1]")];
    // one of two physics steps
    assert!((late / at_once - 0.5).abs() < 0.02, "{at_once} {late}");
    assert!(matches!(
        Task::parse(&format!("delay = [0, 2]\n{TEXT}")),
        Err(TaskError::Value { key, .. }) if key == "delay"
    ));
}

/// Returns the maximum speed of a Panda joint after a step of 0.8 rad in its position action, and its
/// distance from the target after a second.
fn jump(lines: &str) -> [f64; 2] {
    let text = format!(
        r#"
        title = "Jump"
        robot = "panda"
        step = 0.002
        decimation = 2
        duration = 2.0
        {lines}
        world = {{ gravity = [0.0, 0.0, 0.0] }}
        observations = [{{ term = "joint_positions" }}]
        rewards = [{{ term = "alive" }}]
        start = {{ position = [0.0, 0.0, 0.0, -1.5, 0.0, 1.5, 0.0, 0.02] }}
        action = {{ joints = ["panda_joint1"], kind = "position", default_pose = [0.0], kp = 600.0, kd = 40.0 }}
        "#
    );
    let task = Task::parse(&text).expect("a task");
    let simulation = Scene::load(&task, Path::new(".")).expect("a robot").simulation().expect("a simulation");
    let mut world = Environment::new(&task, simulation, 1, 0).expect("an environment");
    world.reset().expect("an episode");
    let mut fastest = 0.0_f64;
    for _ in 0..250 {
        world.step(&[0.8]);
        fastest = fastest.max(world.simulation().velocities()[0].abs());
    }
    [fastest, (world.simulation().positions()[0] - 0.8).abs()]
}

#[test]
fn drives_follow_actions_within_their_limits() {
    let model = load("panda", Path::new(".")).expect("a robot of the catalogue").model;
    let limit = model.velocity_limit()[0];
    let ([free, _], [bounded, distance]) = (jump(""), jump("within_limits = true"));
    assert!(free > 1.5 * limit && bounded < 1.05 * limit, "{free} and {bounded} rad/s of {limit}");
    assert!(distance < 0.02, "{distance} rad");
    assert!(matches!(
        Task::parse(&format!("within_limits = true\n{TEXT}")),
        Err(TaskError::Value { key, .. }) if key == "within_limits"
    ));
}

/// Returns the motion of the base of a falling quadruped after three seconds, in a task with these lines.
fn fallen(lines: &str) -> [f64; 3] {
    let text = format!(
        r#"
        title = "Fall"
        robot = "quadruped"
        step = 0.005
        decimation = 4
        duration = 3.0
        observations = [{{ term = "base_linear_velocity" }}]
        rewards = [{{ term = "alive" }}]
        start = {{ position = [0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 1.0, 0.0, 0.8, -1.6, 0.0, 0.8, -1.6, 0.0, -0.8, 1.6, 0.0, -0.8, 1.6] }}
        action = {{ joints = ["front_left_knee"], kind = "effort", default_pose = [0.0] }}
        {lines}
        "#
    );
    let task = Task::parse(&text).expect("a task");
    let model = load("quadruped", Path::new(".")).expect("a robot of the catalogue").model;
    let simulation =
        ArticulatedSimulator::new(model, World::default(), &task.start.position, Options::default());
    let mut environment = Environment::new(&task, simulation.expect("a simulation"), 1, 0).expect("it fits");
    environment.run_episode(|_, action| action.fill(0.0)).expect("an episode");
    let velocity = environment.simulation().velocity();
    [velocity[0], velocity[1], velocity[2]]
}

#[test]
fn push_moves_the_base_sideways() {
    let [x, y, _] = fallen("");
    assert!(x.hypot(y) < 1e-9, "{x} {y}");
    let pushes = "pushes = { force = 20.0, interval = 2.5 }";
    let [x, y, z] = fallen(pushes);
    assert!(x.hypot(y) > 0.05, "{x} {y}");
    assert_eq!(fallen(pushes), [x, y, z]);
}

#[test]
fn pushes_need_a_floating_base() {
    let task = Task::parse(&format!("{TEXT}[pushes]\nforce = 1.0")).expect("a task");
    let refused = Environment::new(&task, simulation().expect("a simulation"), 1, 0);
    let expected = "pushes";
    assert!(
        matches!(&refused, Err(EnvironmentError::Task(TaskError::Value { key, .. })) if key == expected),
        "{:?}",
        refused.err()
    );
}

#[test]
fn mistakes_in_cameras_are_named() {
    let text = include_str!("../../../../tasks/cart-pole-camera.toml");
    let error = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        let made = Task::parse(&text.replace(from, to)).map_err(EnvironmentError::from).and_then(|task| {
            let simulation = Scene::load(&task, Path::new(".")).expect("a scene").simulation()?;
            Environment::new(&task, simulation, 1, 0)
        });
        made.err().map_or_else(String::new, |error| error.to_string())
    };
    for (from, to, expected) in [
        (
            "camera = \"pole\"",
            "camera = \"front\"",
            "`observations[0].camera`: found \"front\", expected a camera of the task: pole",
        ),
        ("camera = \"pole\"", "history = 1", "TOML parse error at line 10, column"),
        (", camera = \"pole\"", "", "`observations[0].camera`: missing"),
        (
            "history = 2",
            "history = 2, pixels = [16, 12]",
            "`observations[0].pixels`: found [16, 12], expected no value",
        ),
        ("history = 2", "range = [0.9, 0.3]", "`observations[0].range`: found [0.9, 0.3]"),
        (
            "width = 16",
            "width = 2000",
            "`observations[0].pixels`: found [2000, 12], expected 1 to 1024 columns and rows",
        ),
        ("width = 16", "width = 0", "`cameras.pole.width`: an image of 0 x 12 pixels"),
        ("most = 0.9", "most = 0.2", "`cameras.pole.least`: 0.3, expected a distance"),
        ("most = 0.9", "most = 0.9\nlatency = \"10 ms\"", "`cameras.pole.latency`: found"),
        ("most = 0.9", "most = 0.9\ndrop_out = 0.1", "`cameras.pole.drop_out`: found 0.1"),
        ("most = 0.9", "most = 0.9\nseed = 3", "`cameras.pole.seed`: found 3"),
        (
            "most = 0.9",
            "most = 0.9\nrandomise = { noise = [0.5, 2.0] }",
            "`cameras.pole.randomise`: found ranges",
        ),
        ("most = 0.9", "most = 0.9\nworld = { ground = {} }", "`cameras.pole.world`: found a world"),
        ("most = 0.9", "most = 0.9\n[cameras.spare]", "`cameras.spare`: found no observation"),
        ("frame = \"cart\"", "frame = \"waggon\"", "`cameras.pole.mount.frame`: "),
        ("most = 0.9", "most = 0.9\nzoom = 2.0", "TOML parse error"),
    ] {
        let found = error(from, to);
        assert!(found.starts_with(expected), "{to}: {found}");
    }
}
