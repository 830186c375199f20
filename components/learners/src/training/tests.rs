//! All algorithms on the cart-pole and the pendulum.

use std::path::Path;

use motorium_models::onnx::Model;
use motorium_models::policy::{PolicyFolder, PolicyNetwork};
use rand::RngExt as _;

use super::*;
use crate::environment::Environment;
use crate::evaluation::evaluate;
use crate::folder::FolderError;
use crate::imitation;
use crate::learner::{CheckpointError, LearnerError, UnknownAlgorithm};
use crate::random::{Counter, Purpose};
use crate::task::TaskError;

const CART_POLE: &str = include_str!("../../../../tasks/cart-pole.toml");
const PENDULUM: &str = include_str!("../../../../tasks/pendulum.toml");

/// Returns the task in a text with these algorithm settings.
fn task(text: &str, algorithms: &str) -> Task {
    let mut task = Task::parse(text).expect("a task");
    task.algorithms = algorithms.parse().expect("tables");
    task
}

fn scene(task: &Task) -> Scene {
    Scene::load(task, Path::new(".")).expect("a robot of the catalogue")
}

fn begin(algorithm: Algorithm, task: &Task, run: (u64, usize)) -> Result<Box<dyn Learner>, EnvironmentError> {
    start(algorithm, task, &scene(task), None, run)
}

fn finish(learner: &mut dyn Learner) -> String {
    while !learner.is_finished() {
        learner.advance().expect("an update");
    }
    learner.weights_sha256()
}

/// Returns the mean return of ten episodes.
fn mean_return(task: &Task, mut act: impl FnMut(&[f32]) -> Vec<f32>) -> f64 {
    let simulation = scene(task).simulation().expect("a simulation");
    let mut world = Environment::new(task, simulation, 1000, 0).expect("a world");
    let mut total = 0.0;
    for _ in 0..10 {
        world.reset().expect("an episode");
        loop {
            let step = world.step(&act(world.observation()));
            total += step.reward;
            if step.end.is_some() {
                break;
            }
        }
    }
    total / 10.0
}

/// Returns the mean returns of random actions and of the exported policy of a finished run.
fn returns(algorithm: Algorithm, text: &str, algorithms: &str) -> [f64; 2] {
    let task = task(text, algorithms);
    let mut learner = begin(algorithm, &task, (1, 2)).expect("a run");
    finish(&mut *learner);
    let mut program = Model::read(&learner.policy().to_onnx(&[]))
        .and_then(|model| model.program(1))
        .expect("the operators of a policy");
    let trained = mean_return(&task, |observation| {
        program.input_mut(0).copy_from_slice(observation);
        program.run();
        program.output(0).to_vec()
    });
    let mut random = Counter::default().stream(Purpose::Action);
    let width = program.output(0).len();
    let untrained = mean_return(&task, |_| (0..width).map(|_| random.random::<f32>() * 2.0 - 1.0).collect());
    [untrained, trained]
}

/// Asserts that a policy balances much longer than random actions, which last about 23 steps.
fn assert_balances(random: f64, trained: f64) {
    assert!(random < 30.0 && trained > 3.0 * random, "{random} of random actions, {trained}");
    assert!(trained > 75.0, "{trained}");
}

/// Settings of short off-policy runs.
const SHORT: &str = "
worlds = 4
horizon = 100
warmup = 500
buffer = 20000
minibatch = 64
rate = 1e-3
hidden = [32, 32]
";

#[test]
fn sac_learns_to_balance() {
    let settings = format!("[sac]\nsteps = 6000\ngradients = 2\n{SHORT}");
    let [random, trained] = returns(Algorithm::Sac, CART_POLE, &settings);
    assert_balances(random, trained);
}

#[test]
fn td3_learns_to_balance() {
    let settings = format!("[td3]\nsteps = 6000\ngradients = 2\n{SHORT}");
    let [random, trained] = returns(Algorithm::Td3, CART_POLE, &settings);
    assert_balances(random, trained);
}

#[test]
fn ddpg_learns_to_balance() {
    let settings = format!("[ddpg]\nsteps = 6000\ngradients = 2\n{SHORT}");
    let [random, trained] = returns(Algorithm::Ddpg, CART_POLE, &settings);
    assert_balances(random, trained);
}

#[test]
fn dqn_learns_to_balance() {
    let settings = format!("[dqn]\nsteps = 8000\ngradients = 2\nbins = 2\n{SHORT}");
    let [random, trained] = returns(Algorithm::Dqn, CART_POLE, &settings);
    assert_balances(random, trained);
}

#[test]
fn a2c_learns_to_balance() {
    let settings = "[a2c]\nsteps = 40000\nworlds = 16\nhorizon = 8\nrate = 3e-3\nhidden = [16, 16]";
    let [random, trained] = returns(Algorithm::A2c, CART_POLE, settings);
    assert_balances(random, trained);
}

#[test]
fn reinforce_learns_to_balance() {
    let settings = "[reinforce]\nsteps = 40000\nworlds = 8\nrate = 1e-2\nhidden = [16, 16]";
    let [random, trained] = returns(Algorithm::Reinforce, CART_POLE, settings);
    assert_balances(random, trained);
}

#[test]
fn sac_learns_to_swing_a_pendulum() {
    let settings = format!("[sac]\nsteps = 8000\ngradients = 2\nn_step = 3\n{SHORT}");
    let [random, trained] = returns(Algorithm::Sac, PENDULUM, &settings);
    // the reward of a step is at most 0 for a hanging pendulum and 1 for an upright one
    assert!(random < 6.0 && trained > 3.0 * random, "{random} of random actions, {trained}");
}

/// Returns the settings of a tiny run of an algorithm.
fn tiny(algorithm: Algorithm) -> String {
    let name = algorithm.name();
    match algorithm {
        Algorithm::Ppo => format!("[{name}]\nsteps = 512\nworlds = 4\nhorizon = 32\nhidden = [8]"),
        Algorithm::A2c => format!("[{name}]\nsteps = 300\nworlds = 5\nhorizon = 20\nhidden = [8]"),
        Algorithm::Reinforce => format!("[{name}]\nsteps = 300\nworlds = 3\nhidden = [8]"),
        Algorithm::Sac | Algorithm::Td3 | Algorithm::Ddpg | Algorithm::Dqn => format!(
            "[{name}]\nsteps = 240\nworlds = 3\nhorizon = 20\nwarmup = 30\ngradients = 2\nbuffer = 150\n\
             minibatch = 100\nn_step = 2\nhidden = [8]"
        ),
    }
}

#[test]
fn all_algorithms_repeat_on_any_number_of_threads() {
    for algorithm in Algorithm::ALL {
        let task = task(CART_POLE, &tiny(algorithm));
        let run = |seed, threads| finish(&mut *begin(algorithm, &task, (seed, threads)).expect("a run"));
        let first = run(1, 1);
        assert_eq!(run(1, 1), first, "{algorithm:?}");
        assert_eq!(run(1, 2), first, "{algorithm:?}");
        assert_eq!(run(1, 3), first, "{algorithm:?}");
        assert_ne!(run(2, 1), first, "{algorithm:?}");
    }
}

const SEEING: &str = include_str!("../../../../tasks/cart-pole-camera.toml");

/// A task with a noisy camera among the observations.
fn seeing(algorithms: &str) -> Task {
    let text =
        SEEING.replace("least = 0.3", "least = 0.3\ndepth = { noise = 0.005, bias = 0.01 }\nlost = 0.05");
    assert_ne!(text, SEEING);
    task(&text, algorithms)
}

#[test]
fn runs_with_a_camera_repeat_and_resume_bit_for_bit() {
    for algorithm in [Algorithm::Ppo, Algorithm::Sac] {
        let task = seeing(&tiny(algorithm));
        let run = |seed, threads| finish(&mut *begin(algorithm, &task, (seed, threads)).expect("a run"));
        let straight = run(1, 1);
        assert_eq!(run(1, 1), straight, "{algorithm:?}: a second run");
        assert_eq!(run(1, 2), straight, "{algorithm:?}: two threads");
        assert_ne!(run(2, 1), straight, "{algorithm:?}: another seed");
        let mut half = begin(algorithm, &task, (1, 2)).expect("a run");
        half.advance().expect("an update");
        half.advance().expect("an update");
        assert!(!half.is_finished(), "{algorithm:?}");
        let checkpoint = half.checkpoint().expect("a checkpoint");
        let mut resumed = begin(algorithm, &task, (77, 1)).expect("a run");
        resumed.restore(&checkpoint).expect("the checkpoint of an equal run");
        assert_eq!(finish(&mut *resumed), straight, "{algorithm:?}: resumed");
    }
}

/// Convolutions for images of 16 x 12 pixels.
const CONVOLUTIONS: &str =
    "convolutions = [{ channels = 4, kernel = 4, stride = 2, padding = 1 }, { channels = 8, kernel = 3 }]";

#[test]
fn runs_with_convolutions_repeat_and_resume_bit_for_bit() {
    for algorithm in Algorithm::ALL {
        let pixels = seeing(&tiny(algorithm));
        let task = seeing(&format!("{}\n{CONVOLUTIONS}", tiny(algorithm)));
        let run = |seed, threads| finish(&mut *begin(algorithm, &task, (seed, threads)).expect("a run"));
        let straight = run(1, 1);
        assert_eq!(run(1, 1), straight, "{algorithm:?}: a second run");
        assert_eq!(run(1, 2), straight, "{algorithm:?}: two threads");
        assert_ne!(run(2, 1), straight, "{algorithm:?}: another seed");
        let mut half = begin(algorithm, &task, (1, 2)).expect("a run");
        half.advance().expect("an update");
        half.advance().expect("an update");
        assert!(!half.is_finished(), "{algorithm:?}");
        let checkpoint = half.checkpoint().expect("a checkpoint");
        let mut resumed = begin(algorithm, &task, (77, 1)).expect("a run");
        resumed.restore(&checkpoint).expect("the checkpoint of an equal run");
        assert_eq!(resumed.checkpoint().expect("a checkpoint"), checkpoint, "{algorithm:?}");
        assert_eq!(finish(&mut *resumed), straight, "{algorithm:?}: resumed");
        let mut other = begin(algorithm, &pixels, (1, 1)).expect("a run");
        let error = other.restore(&checkpoint).expect_err("other networks").to_string();
        assert!(error.contains("numbers, expected"), "{algorithm:?}: {error}");
        // the policy is the network of the task's policy
        let program = Model::read(&resumed.policy().to_onnx(&[])).and_then(|model| model.program(1));
        let network = PolicyNetwork::new(&task.policy().expect("a policy"), program.expect("operators"));
        let mut network = network.expect("the inputs and outputs of the task");
        network.observation_mut().fill(0.5);
        assert!(network.run()[0].is_finite(), "{algorithm:?}");
    }
}

#[test]
fn convolutions_that_do_not_fit_are_refused() {
    let error = |algorithm: Algorithm, text: &str, keys: &str| {
        let task = task(text, &format!("{}\n{keys}", tiny(algorithm)));
        begin(algorithm, &task, (1, 1)).err().expect("an error").to_string()
    };
    for algorithm in Algorithm::ALL {
        let name = algorithm.name();
        let expected = format!("`algorithms.{name}.convolutions`: found 2, expected none: the task observes");
        let found = error(algorithm, CART_POLE, CONVOLUTIONS);
        assert!(found.contains(&expected), "{found}");
    }
    for (keys, expected) in [
        (
            "convolutions = [{ channels = 0, kernel = 3 }]",
            "convolutions[0].channels`: found 0, expected 1 to 256",
        ),
        (
            "convolutions = [{ channels = 4, kernel = 0 }]",
            "convolutions[0].kernel`: found 0, expected at least 1",
        ),
        (
            "convolutions = [{ channels = 4, kernel = 3, stride = 0 }]",
            "convolutions[0].stride`: found 0, expected at least 1",
        ),
        (
            "convolutions = [{ channels = 4, kernel = 3, padding = 3 }]",
            "convolutions[0].padding`: found 3, expected less than `kernel` = 3",
        ),
        (
            "convolutions = [{ channels = 4, kernel = 4, stride = 4 }, { channels = 4, kernel = 6, padding = 1 }]",
            "convolutions[1].kernel`: found 6, expected at most 5: the image of `cameras.pole` has 4 x 3 pixels",
        ),
        (
            "recurrent = 8\nconvolutions = [{ channels = 4, kernel = 3 }]",
            "algorithms.ppo.recurrent`: found 8, expected 0 with `convolutions`",
        ),
        ("convolutions = [{ channels = 4, kernal = 3 }]", "unknown field `kernal`"),
    ] {
        let found = error(Algorithm::Ppo, SEEING, keys);
        assert!(found.contains(expected), "{found}");
    }
    let found = error(Algorithm::Sac, SEEING, "convolutions = [{ channels = 4, kernal = 3 }]");
    assert!(found.contains("unknown field `kernal`"), "{found}");
}

#[test]
fn convolutions_learn_to_balance_by_sight() {
    let settings = format!(
        "[ppo]\nsteps = 49152\nworlds = 16\nhorizon = 64\nminibatch = 256\nrate = 1e-3\nhidden = [32]\n\
         {CONVOLUTIONS}"
    );
    let [random, trained] = returns(Algorithm::Ppo, SEEING, &settings);
    assert_balances(random, trained);
}

#[test]
fn ppo_learns_to_balance_by_sight() {
    let settings =
        "[ppo]\nsteps = 49152\nworlds = 16\nhorizon = 64\nminibatch = 256\nrate = 1e-3\nhidden = [32]";
    let [random, trained] = returns(Algorithm::Ppo, SEEING, settings);
    assert_balances(random, trained);
}

#[test]
fn all_algorithms_resume_bit_for_bit() {
    for algorithm in Algorithm::ALL {
        let task = task(CART_POLE, &tiny(algorithm));
        let straight = finish(&mut *begin(algorithm, &task, (1, 1)).expect("a run"));
        let mut half = begin(algorithm, &task, (1, 2)).expect("a run");
        half.advance().expect("an update");
        half.advance().expect("an update");
        assert!(!half.is_finished(), "{algorithm:?}");
        let checkpoint = half.checkpoint().expect("a checkpoint");
        let mut resumed = begin(algorithm, &task, (77, 1)).expect("a run");
        resumed.restore(&checkpoint).expect("the checkpoint of an equal run");
        assert_eq!(resumed.weights_sha256(), half.weights_sha256(), "{algorithm:?}");
        assert_eq!(resumed.checkpoint().expect("a checkpoint"), checkpoint, "{algorithm:?}");
        assert_eq!(finish(&mut *resumed), straight, "{algorithm:?}");
        assert_eq!(finish(&mut *half), straight, "{algorithm:?}");
    }
}

#[test]
fn runs_write_policies_that_load() {
    let base = std::env::temp_dir().join(format!("motorium-learners-{}", std::process::id()));
    std::fs::create_dir_all(&base).expect("a folder");
    for algorithm in Algorithm::ALL {
        let (file, folder) = (base.join(format!("{}.toml", algorithm.name())), base.join(algorithm.name()));
        let settings = tiny(algorithm).replace('[', "[algorithms.").replace("= [algorithms.", "= [");
        let text = CART_POLE.split("[algorithms").next().expect("the task before its settings");
        std::fs::write(&file, format!("{text}\n{settings}\n")).expect("a file");
        let mut run = Run::create(algorithm, &file, &folder, (1, 2), None).expect("a run");
        while run.advance().expect("an update").is_some() {}
        let trained = run.summary();
        assert_eq!(trained.algorithm, algorithm);
        let taken = Run::create(algorithm, &file, &folder, (1, 2), None).err();
        let expected =
            matches!(taken, Some(RunError::Folder(FolderError::Exists { has_checkpoint: true, .. })));
        assert!(expected, "{algorithm:?}: {taken:?}");
        // a finished run has nothing left to do
        let mut resumed = Run::resume(&folder, 1).expect("the run");
        assert_eq!(resumed.advance().expect("no update"), None);
        assert_eq!(resumed.summary().weights_sha256, trained.weights_sha256, "{algorithm:?}");
        let mut network = PolicyFolder::read(&folder).expect("a policy").network().expect("its network");
        network.observation_mut().copy_from_slice(&[0.1, 0.02, -0.3, 0.4]);
        assert!(network.run().iter().all(|number| number.is_finite()), "{algorithm:?}");
        let found = evaluate(&folder, &file, 2, 1).expect("returns");
        assert!((1.0..=500.0).contains(&found.mean), "{algorithm:?}: {}", found.mean);
        let progress = std::fs::read_to_string(folder.join("progress.csv")).expect("lines");
        let columns = |line: &str| line.split(',').count();
        assert!(progress.lines().all(|line| columns(line) == 5 + run_measures(algorithm)), "{progress}");
        assert_eq!(progress.lines().count() as u64, 1 + trained.updates, "{algorithm:?}");
    }
    std::fs::remove_dir_all(&base).expect("the folder");
}

#[test]
fn runs_of_imitation_are_not_continued() {
    let base = std::env::temp_dir().join(format!("motorium-imitation-{}", std::process::id()));
    let (expert, folder, file) = (base.join("expert"), base.join("clone"), base.join("task.toml"));
    std::fs::create_dir_all(&base).expect("a folder");
    let text = CART_POLE.split("[algorithms").next().expect("the task before its settings");
    let settings = "[algorithms.ppo]\nsteps = 64\nworlds = 2\nhorizon = 32\nhidden = [4]\n\
                    [algorithms.dagger]\nsteps = 20\niterations = 1\nepochs = 1\nhidden = [4]\n";
    std::fs::write(&file, format!("{text}\n{settings}")).expect("a file");
    let mut trained = Run::create(Algorithm::Ppo, &file, &expert, (1, 1), None).expect("a run");
    while trained.advance().expect("an update").is_some() {}
    let begin = || {
        let sources = imitation::Sources { expert: Some(&expert), ..Default::default() };
        imitation::Run::create((&file, sources), &folder, (1, 1), (imitation::Algorithm::Clone, None))
    };
    let first = begin().expect("a run").advance().expect("an iteration");
    assert!(first.is_some_and(|first| first.loss.is_finite()), "{first:?}");
    let taken = begin().err();
    let is_refused = |error: &imitation::RunError| {
        matches!(error, imitation::RunError::Folder(FolderError::Exists { has_checkpoint: false, .. }))
    };
    assert!(taken.as_ref().is_some_and(is_refused), "{taken:?}");
    let resumed = Run::resume(&folder, 1).err();
    assert!(matches!(resumed, Some(RunError::NoCheckpoint { .. })), "{resumed:?}");
    std::fs::remove_dir_all(&base).expect("the folder");
}

#[cfg(target_os = "linux")]
#[test]
fn tasks_whose_path_is_not_utf_8_are_refused() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt as _;
    let base = std::env::temp_dir().join(format!("motorium-path-{}", std::process::id()));
    let named = base.join(OsStr::from_bytes(b"caf\xe9"));
    std::fs::create_dir_all(&named).expect("a folder");
    let (file, output) = (named.join("task.toml"), base.join("run"));
    std::fs::write(&file, CART_POLE).expect("a file");
    let trained = Run::create(Algorithm::Ppo, &file, &output, (1, 1), None).err();
    let is_refused =
        |error: &FolderError| matches!(error, FolderError::NotText { folder } if *folder == named);
    assert!(matches!(&trained, Some(RunError::Folder(error)) if is_refused(error)), "{trained:?}");
    let sources = imitation::Sources::default();
    let cloned =
        imitation::Run::create((&file, sources), &output, (1, 1), (imitation::Algorithm::Clone, None)).err();
    assert!(matches!(&cloned, Some(imitation::RunError::Folder(error)) if is_refused(error)), "{cloned:?}");
    assert!(!output.exists());
    std::fs::remove_dir_all(&base).expect("the folder");
}

/// Returns the number of values measured in an update.
fn run_measures(algorithm: Algorithm) -> usize {
    let task = task(CART_POLE, &tiny(algorithm));
    begin(algorithm, &task, (1, 1)).expect("a run").measures().len()
}

#[test]
fn checkpoints_of_other_algorithms_are_refused() {
    let task = task(CART_POLE, &[Algorithm::Td3, Algorithm::Ddpg].map(tiny).join("\n"));
    let checkpoint = begin(Algorithm::Td3, &task, (1, 1)).expect("a run").checkpoint().expect("a checkpoint");
    let mut other = begin(Algorithm::Ddpg, &task, (1, 1)).expect("a run");
    let error = other.restore(&checkpoint).expect_err("another algorithm");
    assert!(matches!(&error, CheckpointError::Mismatch { what, .. } if what == "algorithm"), "{error}");
}

#[test]
fn losses_that_are_not_finite_name_their_term() {
    for algorithm in Algorithm::ALL {
        let mut settings = tiny(algorithm);
        settings.push_str("\nrate = 1e38");
        let task = task(CART_POLE, &settings);
        let mut learner = begin(algorithm, &task, (1, 2)).expect("a run");
        let failure =
            core::iter::from_fn(|| (!learner.is_finished()).then(|| learner.advance())).find_map(Result::err);
        let Some(LearnerError::NotFinite { term, value, .. }) = failure else {
            panic!("{algorithm:?}: {failure:?}")
        };
        assert!(!value.is_finite() && !term.is_empty(), "{algorithm:?}");
    }
}

#[test]
fn settings_of_all_algorithms_are_checked() {
    let key = |algorithm: Algorithm, text: &str| match begin(algorithm, &task(CART_POLE, text), (1, 1)).err()
    {
        Some(EnvironmentError::Task(TaskError::Value { key, .. })) => key,
        other => panic!("{algorithm:?}: {other:?}"),
    };
    assert_eq!(key(Algorithm::Sac, "[sac]\ntemperature = 0"), "algorithms.sac.temperature");
    assert_eq!(key(Algorithm::Sac, "[sac]\npolyak = 1.5"), "algorithms.sac.polyak");
    assert_eq!(key(Algorithm::Td3, "[td3]\ndelay = 0"), "algorithms.td3.delay");
    assert_eq!(key(Algorithm::Ddpg, "[ddpg]\nnoise = -0.1"), "algorithms.ddpg.noise");
    assert_eq!(key(Algorithm::Dqn, "[dqn]\nbins = 1"), "algorithms.dqn.bins");
    assert_eq!(key(Algorithm::Dqn, "[dqn]\nbins = 300"), "algorithms.dqn.bins");
    assert_eq!(key(Algorithm::A2c, "[a2c]\nlambda = 2"), "algorithms.a2c.lambda");
    assert_eq!(key(Algorithm::Reinforce, "[reinforce]\nhidden = []"), "algorithms.reinforce.hidden");
    let unknown = begin(Algorithm::Sac, &task(CART_POLE, "[sac]\ntemperatures = 1"), (1, 1)).err();
    assert!(matches!(&unknown, Some(EnvironmentError::Task(TaskError::Parse(_)))), "{unknown:?}");
    let mut unbounded = task(CART_POLE, "");
    unbounded.action.remove("clip");
    let error = begin(Algorithm::Td3, &unbounded, (1, 1)).err();
    let Some(EnvironmentError::Task(TaskError::Value { key, .. })) = error else { panic!("{error:?}") };
    assert_eq!(key, "action.clip");
}

/// The cart-pole with two choices: full force to the left or to the right.
fn discrete() -> String {
    CART_POLE.replace("[action]", "[action]\nchoices = [[-1.0, 0.0], [1.0, 0.0]]")
}

/// Algorithms that learn discrete actions.
const DISCRETE: [Algorithm; 4] = [Algorithm::Ppo, Algorithm::A2c, Algorithm::Reinforce, Algorithm::Dqn];

#[test]
fn dqn_learns_to_balance_by_choices() {
    let settings = format!("[dqn]\nsteps = 8000\ngradients = 2\n{SHORT}");
    let [random, trained] = returns(Algorithm::Dqn, &discrete(), &settings);
    assert_balances(random, trained);
}

#[test]
fn ppo_learns_to_balance_by_choices() {
    let settings =
        "[ppo]\nsteps = 24576\nworlds = 8\nhorizon = 128\nrate = 1e-3\nentropy = 0.01\nhidden = [32, 32]";
    let [random, trained] = returns(Algorithm::Ppo, &discrete(), settings);
    assert_balances(random, trained);
}

#[test]
fn discrete_runs_repeat_and_resume_bit_for_bit() {
    for algorithm in DISCRETE {
        let task = task(&discrete(), &tiny(algorithm));
        let straight = finish(&mut *begin(algorithm, &task, (1, 1)).expect("a run"));
        let mut half = begin(algorithm, &task, (1, 2)).expect("a run");
        half.advance().expect("an update");
        let checkpoint = half.checkpoint().expect("a checkpoint");
        let mut resumed = begin(algorithm, &task, (77, 1)).expect("a run");
        resumed.restore(&checkpoint).expect("the checkpoint of an equal run");
        assert_eq!(finish(&mut *resumed), straight, "{algorithm:?}");
        assert_eq!(finish(&mut *half), straight, "{algorithm:?}: two threads");
        let other = finish(&mut *begin(algorithm, &task, (2, 1)).expect("a run"));
        assert_ne!(other, straight, "{algorithm:?}: another seed");
    }
}

#[test]
fn memories_and_mirrors_of_choices_repeat_and_resume() {
    let recurrent = task(&discrete(), &format!("{}\nrecurrent = 6\nsequence = 8", tiny(Algorithm::Ppo)));
    let text = PENDULUM.replace(
        "[action]",
        "[symmetry]\nreversed = [\"hinge\"]\n[action]\nchoices = [[-1.0], [0.25], [1.0], [-0.25]]",
    );
    let mirrored = task(&text, &format!("{}\nmirror = true", tiny(Algorithm::Ppo)));
    for (name, task) in [("recurrent", recurrent), ("mirrored", mirrored)] {
        let straight = finish(&mut *begin(Algorithm::Ppo, &task, (1, 1)).expect("a run"));
        let mut half = begin(Algorithm::Ppo, &task, (1, 2)).expect("a run");
        half.advance().expect("an update");
        let checkpoint = half.checkpoint().expect("a checkpoint");
        let mut resumed = begin(Algorithm::Ppo, &task, (77, 1)).expect("a run");
        resumed.restore(&checkpoint).expect("the checkpoint of an equal run");
        assert_eq!(finish(&mut *resumed), straight, "{name}");
        assert_eq!(finish(&mut *half), straight, "{name}: two threads");
    }
}

#[test]
fn policies_of_discrete_runs_put_out_rows() {
    let base = std::env::temp_dir().join(format!("motorium-discrete-{}", std::process::id()));
    std::fs::create_dir_all(&base).expect("a folder");
    for algorithm in DISCRETE {
        let (file, folder) = (base.join(format!("{}.toml", algorithm.name())), base.join(algorithm.name()));
        let settings = tiny(algorithm).replace('[', "[algorithms.").replace("= [algorithms.", "= [");
        let text = discrete();
        let text = text.split("[algorithms").next().expect("the task before its settings");
        std::fs::write(&file, format!("{text}\n{settings}\n")).expect("a file");
        let mut run = Run::create(algorithm, &file, &folder, (1, 2), None).expect("a run");
        while run.advance().expect("an update").is_some() {}
        let mut network = PolicyFolder::read(&folder).expect("a policy").network().expect("its network");
        for k in 0..20 {
            let observation = [0.3, -0.2, 0.9, 1.1].map(|number: f32| number * (k as f32).cos());
            network.observation_mut().copy_from_slice(&observation);
            let action = network.run();
            assert!(action == [-1.0, 0.0] || action == [1.0, 0.0], "{algorithm:?}: {action:?}");
        }
        let found = evaluate(&folder, &file, 2, 1).expect("returns");
        assert!((1.0..=500.0).contains(&found.mean), "{algorithm:?}: {}", found.mean);
    }
    std::fs::remove_dir_all(&base).expect("the folder");
}

#[test]
fn settings_that_choices_exclude_are_refused() {
    let key =
        |algorithm: Algorithm, text: &str| match begin(algorithm, &task(&discrete(), text), (1, 1)).err() {
            Some(EnvironmentError::Task(TaskError::Value { key, .. })) => key,
            other => panic!("{algorithm:?}: {other:?}"),
        };
    for algorithm in [Algorithm::Sac, Algorithm::Td3, Algorithm::Ddpg] {
        assert_eq!(key(algorithm, ""), "action.choices", "{algorithm:?}");
        let error = begin(algorithm, &task(&discrete(), ""), (1, 1)).err().map(|error| error.to_string());
        let named = format!("expected no choices for `{}`", algorithm.name());
        assert!(error.as_ref().is_some_and(|error| error.contains(&named)), "{error:?}");
    }
    assert_eq!(key(Algorithm::Dqn, "[dqn]\nbins = 3"), "algorithms.dqn.bins");
    for algorithm in [Algorithm::Ppo, Algorithm::A2c, Algorithm::Reinforce] {
        let name = algorithm.name();
        let found = key(algorithm, &format!("[{name}]\ndeviation = 0.5"));
        assert_eq!(found, format!("algorithms.{name}.deviation"));
    }
    // a push to the left has no mirror image among the choices
    let lopsided = PENDULUM
        .replace("[action]", "[symmetry]\nreversed = [\"hinge\"]\n[action]\nchoices = [[-1.0], [0.5]]");
    let error = begin(Algorithm::Ppo, &task(&lopsided, "[ppo]\nmirror = true"), (1, 1)).err();
    let Some(EnvironmentError::Task(TaskError::Value { key, .. })) = error else { panic!("{error:?}") };
    assert_eq!(key, "action.choices[0]");
}

#[test]
fn settings_of_a_task_are_completed_by_defaults() {
    for algorithm in Algorithm::ALL {
        let given = task(CART_POLE, &format!("[{}]\nsteps = 77", algorithm.name()));
        let found = settings(algorithm, &given).expect("settings");
        let number = |key: &str| found.get(key).and_then(toml::Value::as_integer);
        assert_eq!(number("steps"), Some(77), "{algorithm:?}");
        assert!(found.contains_key("discount") && found.contains_key("rate"), "{algorithm:?}: {found:?}");
        assert!(settings(algorithm, &task(CART_POLE, &format!("{} = 1", algorithm.name()))).is_err());
    }
}

#[test]
fn names_of_algorithms_are_read_back() {
    for algorithm in Algorithm::ALL {
        assert_eq!(algorithm.name().parse(), Ok(algorithm));
    }
    assert_eq!("a3c".parse::<Algorithm>(), Err(UnknownAlgorithm { found: "a3c".to_owned() }));
}

const MASKED: &str = include_str!("../../../../tasks/cart-pole-masked.toml");

#[test]
fn recurrent_units_balance_without_velocities() {
    let [recurrent, feed_forward] = recurrent_and_feed_forward("numbers", MASKED);
    assert!(recurrent > 2.0 * feed_forward && recurrent > 150.0, "{recurrent}, without {feed_forward}");
}

#[test]
fn recurrent_units_balance_by_choices() {
    let text = MASKED.replace("[action]", "[action]\nchoices = [[-1.0, 0.0], [1.0, 0.0]]");
    let [recurrent, feed_forward] = recurrent_and_feed_forward("choices", &text);
    assert!(recurrent > 1.5 * feed_forward && recurrent > 100.0, "{recurrent}, without {feed_forward}");
}

/// Returns the mean returns of policies with and without recurrent units after equal training.
fn recurrent_and_feed_forward(name: &str, text: &str) -> [f64; 2] {
    let base = std::env::temp_dir().join(format!("motorium-recurrent-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&base).expect("a folder");
    let text = text.split("[algorithms").next().expect("the task before its settings");
    let [feed_forward, recurrent] = [0, 16].map(|units| {
        let (file, folder) = (base.join(format!("{units}.toml")), base.join(units.to_string()));
        let settings = format!(
            "[algorithms.ppo]\nsteps = 49152\nworlds = 16\nhorizon = 64\nminibatch = 256\nhidden = [16]\n\
             rate = 3e-3\nrecurrent = {units}\n"
        );
        std::fs::write(&file, format!("{text}\n{settings}")).expect("a file");
        let mut run = Run::create(Algorithm::Ppo, &file, &folder, (1, 2), None).expect("a run");
        while run.advance().expect("an update").is_some() {}
        // the policy folder, which `policy.network` reads too; its state restarts with each episode
        evaluate(&folder, &file, 10, 1).expect("returns").mean
    });
    std::fs::remove_dir_all(&base).expect("the folder");
    [recurrent, feed_forward]
}
