//! Imitation of a linear controller on the cart-pole.

use std::path::Path;

use motorium_models::inference::Unary;
use motorium_models::onnx::{self, Model};
use motorium_physics::Articulated;

use super::*;
use crate::environment::{End, Environment, Scene};

const TASK: &str = include_str!("../../../../tasks/cart-pole.toml");

/// A controller that balances: position, angle, and their rates; the force is ten times its output.
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

/// Mean length of five episodes.
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
fn weights_of_imitation_repeat_on_any_threads() {
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
fn the_expert_acts_with_the_scheduled_probability() {
    let mut imitation = run(1, 1, settings());
    let betas: Vec<f64> = (0..3).map(|_| imitation.advance().expect("an iteration").beta).collect();
    assert_eq!(betas, [1.0, 0.5, 0.25]);
    // a label for every step of every world
    assert_eq!(imitation.regression.labels(), 3 * 400);
}

#[test]
fn the_network_balances_as_its_expert_does() {
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
