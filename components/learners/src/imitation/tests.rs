//! Imitation of a linear controller on the cart-pole.

use std::path::Path;

use motorium_models::inference::Unary;
use motorium_models::onnx::{self, Model};
use motorium_physics::Articulated;

use super::*;
use crate::environment::{End, Environment, Scene};
use crate::learner::ConvolutionSettings;

const TASK: &str = include_str!("../../../../tasks/cart-pole.toml");

/// Returns a balancing controller with inputs position, angle and their rates. The force is ten times its
/// output.
fn expert(task: &Task) -> PolicyNetwork {
    let weights = vec![0.1, 3.0, 0.2, 0.6, 0.0, 0.0, 0.0, 0.0];
    let bytes = onnx::write_mlp(4, &[(weights, vec![0.0; 2])], Unary::Tanh, &[]);
    let program = Model::read(&bytes).and_then(|model| model.program(1)).expect("a network");
    PolicyNetwork::new(&task.policy().expect("a policy"), program).expect("it fits")
}

fn settings() -> ImitationSettings {
    ImitationSettings {
        iterations: 3,
        steps: 400,
        worlds: 4,
        epochs: 20,
        hidden: vec![8],
        ..Default::default()
    }
}

fn run(seed: u64, threads: usize, settings: ImitationSettings) -> Imitation<Articulated> {
    let task = Task::parse(TASK).expect("a task");
    let scene = Scene::load(&task, Path::new(".")).expect("a robot of the catalogue");
    Imitation::new(&task, settings, &expert(&task), (seed, threads), || scene.simulation()).expect("a run")
}

/// Returns the mean length of five episodes.
fn length(mut act: impl FnMut(&[f32]) -> Vec<f32>) -> f64 {
    let task = Task::parse(TASK).expect("a task");
    let scene = Scene::load(&task, Path::new(".")).expect("a robot");
    let mut world =
        Environment::new(&task, scene.simulation().expect("a simulation"), 9, 0).expect("a world");
    let mut steps = 0;
    for _ in 0..5 {
        world.reset().expect("an episode");
        loop {
            let action = act(world.observation());
            steps += 1;
            if let Some(end) = world.step(&action).end {
                assert_ne!(end, End::Success);
                break;
            }
        }
    }
    f64::from(steps) / 5.0
}

#[test]
fn imitation_weights_do_not_depend_on_threads() {
    let finish = |mut run: Imitation<Articulated>| {
        while !run.is_finished() {
            run.advance().expect("an iteration");
        }
        run.weights_sha256()
    };
    let first = finish(run(1, 1, settings()));
    assert_eq!(finish(run(1, 2, settings())), first);
    assert_ne!(finish(run(2, 1, settings())), first);
}

#[test]
fn expert_acts_with_the_scheduled_probability() {
    let mut imitation = run(1, 1, settings());
    let betas: Vec<f64> = (0..3).map(|_| imitation.advance().expect("an iteration").beta).collect();
    assert_eq!(betas, [1.0, 0.5, 0.25]);
    // a label for every step of every world
    assert_eq!(imitation.regression.labels(), 3 * 400);
}

#[test]
fn network_balances_like_its_expert() {
    let task = Task::parse(TASK).expect("a task");
    let mut teacher = expert(&task);
    let expected = length(|observation| {
        teacher.observation_mut().copy_from_slice(observation);
        teacher.run().to_vec()
    });
    assert!(expected > 450.0, "the expert balances for {expected} steps");
    let mut imitation = run(1, 2, ImitationSettings { hidden: vec![16], ..settings() });
    let mut losses = Vec::new();
    while !imitation.is_finished() {
        losses.push(imitation.advance().expect("an iteration").loss);
    }
    let layers = imitation.policy().layers;
    let program =
        Model::read(&onnx::write_mlp(4, &layers, Unary::Tanh, &[])).and_then(|model| model.program(1));
    let mut program = program.expect("a network");
    let found = length(|observation| {
        program.input_mut(0).copy_from_slice(observation);
        program.run();
        program.output(0).to_vec()
    });
    assert!(found > 0.9 * expected, "{found} steps, the expert {expected}; losses {losses:?}");
}

/// Returns the cart-pole with a choice for each of some forces.
fn discrete(forces: &[f64]) -> Task {
    let rows: Vec<String> = forces.iter().map(|force| format!("[{force:?}, 0.0]")).collect();
    let choices = format!("[action]\nchoices = [{}]", rows.join(", "));
    Task::parse(&TASK.replace("[action]", &choices)).expect("a task")
}

#[test]
fn choices_are_imitated_by_their_number() {
    let task = discrete(&[-1.0, -0.6, -0.3, -0.1, 0.0, 0.1, 0.3, 0.6, 1.0]);
    let plain = Task::parse(TASK).expect("a task");
    let rows = task.choices().expect("rows").expect("choices");
    let mut teacher = expert(&plain);
    let expected = length(|observation| {
        teacher.observation_mut().copy_from_slice(observation);
        rows.row(rows.nearest(teacher.run())).to_vec()
    });
    assert!(expected > 300.0, "the choices nearest to the expert's forces balance for {expected} steps");
    let scene = Scene::load(&task, Path::new(".")).expect("a robot");
    let settings = ImitationSettings { steps: 800, epochs: 150, rate: 3e-3, hidden: vec![16], ..settings() };
    let begin = |threads| {
        // labels are the choices nearest to the expert's forces
        let build = || scene.simulation();
        Imitation::new(&task, settings.clone(), &expert(&plain), (1, threads), build).expect("a run")
    };
    let (mut imitation, mut other) = (begin(1), begin(2));
    while !imitation.is_finished() {
        let progress = imitation.advance().expect("an iteration");
        assert!(progress.loss < 9.0_f64.ln(), "better than chance: {progress:?}");
        other.advance().expect("an iteration");
    }
    assert_eq!(other.weights_sha256(), imitation.weights_sha256(), "two threads");
    let program = Model::read(&imitation.policy().to_onnx(&[])).and_then(|model| model.program(1));
    let mut program = program.expect("a network");
    let found = length(|observation| {
        program.input_mut(0).copy_from_slice(observation);
        program.run();
        let action = program.output(0).to_vec();
        assert_eq!(rows.row(rows.nearest(&action)), action, "an action is a choice");
        action
    });
    assert!(found > 0.8 * expected, "{found} steps, the expert {expected}");
}

#[test]
fn recorded_choices_are_cloned() {
    let task = discrete(&[-1.0, -0.3, 0.0, 0.3, 1.0]);
    let scene = Scene::load(&task, Path::new(".")).expect("a robot");
    let settings = ImitationSettings { epochs: 60, hidden: vec![16], ..settings() };
    let shown = demonstration(1200);
    let mut imitation = Imitation::<Articulated>::from_recorded(
        &task,
        settings,
        std::slice::from_ref(&shown),
        (1, 1),
        || scene.simulation(),
    )
    .expect("a run");
    let progress = imitation.advance().expect("an iteration");
    assert_eq!((progress.labels, imitation.is_finished()), (1200, true));
    let rows = task.choices().expect("rows").expect("choices");
    let logits = imitation.regression.predict(&shown.observations);
    let pairs = logits.chunks_exact(5).zip(shown.actions.chunks_exact(2));
    let equal = pairs.filter(|(logits, action)| best(logits.iter().copied()) == rows.nearest(action)).count();
    assert!(equal > 1080, "{equal} of 1200 choices");
}

/// Returns observations and actions of the expert.
fn demonstration(steps: usize) -> Recorded {
    let task = Task::parse(TASK).expect("a task");
    let scene = Scene::load(&task, Path::new(".")).expect("a robot");
    let mut teacher = expert(&task);
    let mut world =
        Environment::new(&task, scene.simulation().expect("a simulation"), 5, 0).expect("a world");
    world.reset().expect("an episode");
    let mut shown = Recorded { widths: [4, 2], observations: Vec::new(), actions: Vec::new() };
    for step in 0..steps {
        if step % 200 == 0 {
            world.reset().expect("an episode");
        }
        let observation = world.observation().to_vec();
        teacher.observation_mut().copy_from_slice(&observation);
        let action = teacher.run().to_vec();
        shown.observations.extend_from_slice(&observation);
        shown.actions.extend_from_slice(&action);
        world.step(&action);
    }
    shown
}

#[test]
fn recorded_actions_are_cloned_without_an_expert() {
    let task = Task::parse(TASK).expect("a task");
    let scene = Scene::load(&task, Path::new(".")).expect("a robot");
    let settings = ImitationSettings { epochs: 60, hidden: vec![16], ..settings() };
    let clone = |recorded: &[Recorded]| {
        Imitation::<Articulated>::from_recorded(&task, settings.clone(), recorded, (1, 1), || {
            scene.simulation()
        })
    };
    let shown = demonstration(1200);
    let mut imitation = clone(&[shown.clone(), demonstration(200)]).expect("a run");
    let progress = imitation.advance().expect("an iteration");
    assert_eq!((progress.labels, progress.episodes, imitation.is_finished()), (1400, 0, true));
    let first = shown.observations[..4].to_vec();
    let expected = shown.actions[0];
    let found = imitation.regression.predict(&first)[0];
    assert!((found - expected).abs() < 0.05, "{found}, recorded {expected}; loss {}", progress.loss);

    let wide = Recorded { widths: [4, 3], ..shown.clone() };
    let refused = clone(&[wide]).err();
    let expected = RecordedError::Width { part: "action", found: 3, expected: 2 };
    assert_eq!(refused.map(|error| error.to_string()), Some(expected.to_string()));
    let short = Recorded { actions: shown.actions[1..].to_vec(), ..shown.clone() };
    assert!(matches!(clone(&[short]).err(), Some(RecordedError::Rows { .. })));
    let mut broken = shown;
    broken.observations[3] = f32::NAN;
    assert!(matches!(clone(&[broken]).err(), Some(RecordedError::NotFinite { part: "observation", .. })));
}

#[test]
fn convolutions_fit_recorded_images() {
    let task = Task::parse(include_str!("../../../../tasks/cart-pole-camera.toml")).expect("a task");
    let scene = Scene::load(&task, Path::new(".")).expect("a robot");
    let convolutions = vec![ConvolutionSettings { channels: 4, kernel: 4, stride: 2, padding: 1 }];
    let settings = ImitationSettings { convolutions, epochs: 100, rate: 3e-3, ..settings() };
    // a bright column in the newest image, and a force that follows it
    let (mut observations, mut actions) = (Vec::new(), Vec::new());
    for sample in 0..160 {
        let bright = sample % 16;
        let pixels = (0..2 * 192).map(|k| f32::from(u8::from(k >= 192 && k % 16 == bright)));
        observations.extend(pixels.chain([0.1 * (sample as f32).sin(), 0.0]));
        actions.push((bright as f32 - 7.5) / 7.5);
    }
    let shown = Recorded { widths: [386, 1], observations, actions };
    let mut imitation = Imitation::<Articulated>::from_recorded(
        &task,
        settings.clone(),
        std::slice::from_ref(&shown),
        (1, 1),
        || scene.simulation(),
    )
    .expect("a run");
    let loss = imitation.advance().expect("an iteration").loss;
    assert!(loss < 0.02, "{loss}");
    let found = imitation.regression.predict(&shown.observations[..386])[0];
    assert!((found + 1.0).abs() < 0.3, "{found}");
    let error = Regression::new(386, vec![true], settings, 1).expect_err("no images").to_string();
    assert!(error.contains("`algorithms.dagger.convolutions`: found 1, expected none"), "{error}");
}

#[test]
fn recordings_replace_the_first_iteration_of_dagger() {
    let mut imitation = run(1, 1, settings());
    imitation.add(&[demonstration(300)]).expect("the task's numbers");
    let first = imitation.advance().expect("an iteration");
    assert_eq!((first.labels, first.beta, first.mean_return), (300, 1.0, None));
    let second = imitation.advance().expect("an iteration");
    assert_eq!((second.labels, second.beta, second.iteration), (300 + 400, 0.5, 2));
}
