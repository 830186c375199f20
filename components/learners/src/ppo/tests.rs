//! PPO on the cart-pole.

use std::path::Path;

use motorium_models::onnx::Model;
use motorium_physics::Articulated;

use super::*;
use crate::environment::Scene;

const TASK: &str = include_str!("../../../../tasks/cart-pole.toml");

fn settings() -> PpoSettings {
    PpoSettings {
        steps: 512,
        worlds: 4,
        horizon: 32,
        epochs: 2,
        minibatch: 96,
        hidden: vec![8],
        ..PpoSettings::default()
    }
}

fn run(seed: u64, threads: usize, settings: PpoSettings) -> Ppo<Articulated> {
    run_task(TASK, seed, threads, settings)
}

fn run_task(text: &str, seed: u64, threads: usize, settings: PpoSettings) -> Ppo<Articulated> {
    let task = Task::parse(text).expect("a task");
    let scene = Scene::load(&task, Path::new(".")).expect("a robot of the catalogue");
    Ppo::new(&task, settings, (seed, threads), || scene.simulation()).expect("a run")
}

fn finish(mut ppo: Ppo<Articulated>) -> String {
    while !ppo.is_finished() {
        ppo.advance().expect("an update");
    }
    ppo.weights_sha256()
}

#[test]
fn weights_repeat_on_any_number_of_threads() {
    let first = finish(run(1, 1, settings()));
    assert_eq!(finish(run(1, 1, settings())), first);
    assert_eq!(finish(run(1, 2, settings())), first);
    assert_eq!(finish(run(1, 3, settings())), first);
    assert_ne!(finish(run(2, 1, settings())), first);
    assert_eq!(first.len(), 64);
}

#[test]
fn resumed_run_matches_an_uninterrupted_run() {
    let straight = finish(run(1, 1, settings()));
    let mut half = run(1, 2, settings());
    half.advance().expect("an update");
    half.advance().expect("an update");
    let checkpoint = half.checkpoint().expect("a checkpoint");
    let mut resumed = run(77, 1, settings());
    resumed.restore(&checkpoint).expect("the checkpoint of an equal run");
    assert_eq!(resumed.weights_sha256(), half.weights_sha256());
    // the middle of episodes
    assert_eq!(resumed.worlds.observations(), half.worlds.observations());
    assert_eq!(resumed.checkpoint().expect("a checkpoint"), checkpoint);
    assert_eq!(finish(resumed), straight);
    assert_eq!(finish(half), straight);
}

#[test]
fn quadruped_weights_do_not_depend_on_threads() {
    // the steps include contacts, commands, their curriculum and falls
    let text = include_str!("../../../../tasks/quadruped-velocity.toml");
    assert!(text.contains("steps = 5_000_000"));
    let text = text.replace("steps = 5_000_000", "steps = 400");
    let settings = || PpoSettings { steps: 768, worlds: 6, horizon: 64, ..settings() };
    let first = finish(run_task(&text, 1, 1, settings()));
    assert_eq!(finish(run_task(&text, 1, 2, settings())), first);
    let mut half = run_task(&text, 1, 2, settings());
    half.advance().expect("an update");
    let mut resumed = run_task(&text, 5, 1, settings());
    resumed.restore(&half.checkpoint().expect("a checkpoint")).expect("an equal run");
    assert_eq!(finish(resumed), first);
    assert_ne!(finish(run_task(&text, 2, 1, settings())), first);
}

#[test]
fn checkpoints_of_other_settings_are_refused() {
    let checkpoint = run(1, 1, settings()).checkpoint().expect("a checkpoint");
    let mut wider = run(1, 1, PpoSettings { hidden: vec![9], ..settings() });
    let error = wider.restore(&checkpoint).expect_err("another network");
    assert!(error.to_string().starts_with("policy: 58 numbers, expected 65"), "{error}");
    let mut more = run(1, 1, PpoSettings { worlds: 5, ..settings() });
    let error = more.restore(&checkpoint).expect_err("another number of worlds");
    assert!(error.to_string().starts_with("worlds: 4 worlds, expected 5"), "{error}");
    assert!(wider.restore(&checkpoint[..40]).is_err());
}

#[test]
fn first_horizon_is_normalised() {
    let mut ppo = run(1, 1, settings());
    ppo.collect().expect("a rollout");
    let inputs = ppo.worlds.terms().inputs();
    for column in 0..inputs {
        let entries = ppo.rollout.observations.iter().skip(column).step_by(inputs);
        let square = entries.map(|x| f64::from(*x).powi(2)).sum::<f64>() / (4.0 * 32.0);
        assert!((0.3..3.0).contains(&square), "entry {column}: mean square {square}");
    }
}

#[test]
fn advantages_match_explicit_sums() {
    let mut rollout = Rollout::new(3, 1, 1, 1);
    rollout.set_rewards(&[1.0, 2.0, 3.0], &[0.5, 1.5, 2.5], &[1.5, 0.0, 4.0], &[false, true, false]);
    rollout.estimate(1, 0.5, 0.5);
    let d = [1.0 + 0.5 * 1.5 - 0.5, 2.0 - 1.5, 3.0 + 0.5 * 4.0 - 2.5];
    assert_eq!(rollout.advantages, [d[0] + 0.25 * d[1], d[1], d[2]]);
    assert_eq!(rollout.returns, [d[0] + 0.25 * d[1] + 0.5, d[1] + 1.5, d[2] + 2.5]);
}

#[test]
fn short_run_improves_the_cart_pole() {
    let settings = PpoSettings {
        steps: 16_384,
        worlds: 8,
        horizon: 128,
        minibatch: 128,
        hidden: vec![16, 16],
        rate: 2e-3,
        ..PpoSettings::default()
    };
    let mut ppo = run(1, 2, settings);
    let first = ppo.advance().expect("an update").mean_length.expect("episodes that ended");
    let mut last = first;
    while !ppo.is_finished() {
        last = ppo.advance().expect("an update").mean_length.expect("episodes that ended");
    }
    assert!(last > 2.0 * first && last > 60.0, "episodes of {first} steps at first, {last} at the end");
}

#[test]
fn settings_out_of_range_are_refused() {
    for (text, message) in [
        ("[ppo]\nclip = 0.0", "`algorithms.ppo.clip`: found 0, expected above 0"),
        ("[ppo]\ndiscount = 1.0", "`algorithms.ppo.discount`: found 1, expected above 0, below 1"),
        ("[ppo]\nhidden = []", "`algorithms.ppo.hidden`: found 0, expected at least one layer"),
        ("[ppo]\nclips = 0.1", "`algorithms.ppo`: unknown field `clips`"),
    ] {
        let table: toml::Table = text.parse().expect("a table");
        let error = PpoSettings::from_table(&table).expect_err(message);
        assert!(error.to_string().starts_with(message), "{error}");
    }
}

/// Settings with sequences of 8 steps, within which episodes end.
fn recurrent() -> PpoSettings {
    PpoSettings { recurrent: 6, sequence: 8, ..settings() }
}

#[test]
fn recurrent_weights_repeat_on_any_threads_and_after_resume() {
    let first = finish(run(1, 1, recurrent()));
    assert_eq!(finish(run(1, 2, recurrent())), first);
    assert_eq!(finish(run(1, 3, recurrent())), first);
    assert_ne!(finish(run(2, 1, recurrent())), first);
    let mut half = run(1, 2, recurrent());
    half.advance().expect("an update");
    half.advance().expect("an update");
    assert!(half.memories.iter().all(|states| states.iter().any(|state| *state != 0.0)));
    let checkpoint = half.checkpoint().expect("a checkpoint");
    let mut resumed = run(77, 1, recurrent());
    resumed.restore(&checkpoint).expect("the checkpoint of an equal run");
    assert_eq!(resumed.checkpoint().expect("a checkpoint"), checkpoint);
    assert_eq!(finish(resumed), first);
}

#[test]
fn sequences_reproduce_rollout_values() {
    let mut ppo = run(3, 1, recurrent());
    // the second rollout starts in the middle of episodes
    ppo.collect().expect("a rollout");
    ppo.collect().expect("a rollout");
    let samples = ppo.rollout.sequences(&ppo.rollout.firsts());
    assert_eq!(samples.len(), 4 * 32);
    let pieces = ppo.rollout.pieces(&samples, 1);
    assert!(pieces.len() > 4 * 32 / 8, "no episode ended within a sequence");
    let inputs = ppo.worlds.terms().inputs();
    let rows = samples.iter().flat_map(|k| &ppo.rollout.observations[k * inputs..][..inputs]);
    let input = nalgebra::DMatrix::from_iterator(inputs, samples.len(), rows.copied());
    let values = ppo.value.forward(input, pieces);
    for (column, k) in samples.iter().enumerate() {
        let (found, expected) = (values.output()[column], ppo.rollout.values[*k]);
        assert!((found - expected).abs() < 1e-5, "sample {k}: {found}, expected {expected}");
    }
}

#[test]
fn sequences_divide_the_horizon_and_fit_a_minibatch() {
    for (text, expected) in [
        ("[ppo]\nrecurrent = 8\nhorizon = 100", "algorithms.ppo.sequence"),
        ("[ppo]\nrecurrent = 8\nminibatch = 8", "algorithms.ppo.minibatch"),
    ] {
        let table: toml::Table = text.parse().expect("a table");
        let error = PpoSettings::from_table(&table).expect_err(expected);
        assert!(matches!(&error, crate::task::TaskError::Value { key, .. } if key == expected), "{error}");
    }
}

#[test]
fn mirrored_choices_are_equally_probable_in_mirrored_states() {
    let text = include_str!("../../../../tasks/pendulum.toml");
    let text = format!("{text}\n[symmetry]\nreversed = [\"hinge\"]\n");
    let text = text.replace("[action]", "[action]\nchoices = [[-1.0], [0.0], [1.0]]");
    let asymmetry = |mirror: bool| {
        let settings = PpoSettings { steps: 4096, worlds: 8, horizon: 64, mirror, ..settings() };
        let mut ppo = run_task(&text, 1, 2, settings);
        while !ppo.is_finished() {
            ppo.advance().expect("an update");
        }
        let states = (0..40).map(|k| [(0.7 * k as f32).sin(), (1.3 * k as f32).cos()]);
        let logits = |observation: [f32; 2]| {
            let mut normal = [0.0; 2];
            ppo.state.observations.apply(&observation, &mut normal);
            let column = nalgebra::DMatrix::from_column_slice(2, 1, &normal);
            ppo.policy.forward(column, Vec::new()).output().as_slice().to_vec()
        };
        // difference between the preference for the right and the mirrored preference for the left
        let [mut odd, mut even] = [0.0; 2];
        for [x, v] in states {
            let (one, other) = (logits([x, v]), logits([-x, -v]));
            let (right, left) = (one[2] - one[0], other[0] - other[2]);
            odd += (right + left).abs();
            even += (right - left).abs();
        }
        even / odd
    };
    let (with, without) = (asymmetry(true), asymmetry(false));
    assert!(with < 0.5 * without, "{with} {without}");
}

#[test]
fn mirrored_pendulum_has_a_nearly_symmetric_policy() {
    let text = include_str!("../../../../tasks/pendulum.toml");
    let text = format!("{text}\n[symmetry]\nreversed = [\"hinge\"]\n");
    let observations: Vec<[f32; 2]> =
        (0..40).map(|k| [(0.7 * k as f32).sin(), (1.3 * k as f32).cos()]).collect();
    // the policy of a symmetric task changes its sign with the observation
    let asymmetry = |mirror: bool| {
        let settings = PpoSettings { steps: 4096, worlds: 8, horizon: 64, mirror, ..settings() };
        let mut ppo = run_task(&text, 1, 2, settings);
        while !ppo.is_finished() {
            ppo.advance().expect("an update");
        }
        let program = Model::read(&Learner::policy(&ppo).to_onnx(&[])).and_then(|model| model.program(1));
        let mut program = program.expect("the operators of a policy");
        let mut torque = |observation: [f32; 2]| {
            program.input_mut(0).copy_from_slice(&observation);
            program.run();
            program.output(0)[0]
        };
        let pairs = observations.iter().map(|[x, v]| (torque([*x, *v]), torque([-x, -v])));
        let [odd, even] = pairs.fold([0.0, 0.0], |[odd, even], (one, other)| {
            [odd + (one - other).abs(), even + (one + other).abs()]
        });
        even / odd
    };
    let (with, without) = (asymmetry(true), asymmetry(false));
    assert!(with < 0.5 * without, "{with} {without}");
}

#[test]
fn mirroring_needs_a_symmetry_and_no_memory() {
    let task = Task::parse(TASK).expect("a task");
    let scene = Scene::load(&task, Path::new(".")).expect("a robot of the catalogue");
    for settings in
        [PpoSettings { mirror: true, ..settings() }, PpoSettings { mirror: true, recurrent: 4, ..settings() }]
    {
        let refused = Ppo::new(&task, settings, (1, 1), || scene.simulation()).err();
        assert!(matches!(refused, Some(EnvironmentError::Task(TaskError::Value { .. }))), "{refused:?}");
    }
}
