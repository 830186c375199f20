//! Networks, Gaussian processes, latent spaces, hidden Markov models, and the algebra below them.

use std::hint::black_box;

use motorium_algebra::Cholesky;
use motorium_benches::peers::Work;
use motorium_models::gp::GaussianProcess;
use motorium_models::gplvm::{BackForm, LatentModel, Prior, Settings, SpaceData, Workspace};
use motorium_models::hmm::{Hmm, Shape};
use motorium_models::inference::Unary;
use motorium_models::kernel::Kernel;
use motorium_models::onnx::{self, Model};
use motorium_models::optimise::Options;

/// Poses, outputs and latents of the latent model.
pub(crate) const POSES: usize = 200;
pub(crate) const OUTPUTS: usize = 14;
pub(crate) const LATENTS: usize = 2;
/// Logarithms of its variance, length scales and noise.
pub(crate) const PARAMETERS: [f64; LATENTS + 2] = [0.1, 0.2, -0.3, -4.0];
/// Poses, and columns of the human and of two robots, of the shared latent model.
const SHARED_POSES: usize = 100;
const SHARED: [(&str, usize); 3] = [("human", 9), ("first", 7), ("second", 7)];
/// Points and inputs of the Gaussian process.
const POINTS: usize = 200;
const INPUTS: usize = 6;
/// Units of the network: a policy with 54,000 weights.
const LAYERS: [usize; 5] = [48, 256, 128, 64, 12];
/// States, columns and length of the hidden Markov model and its sequence.
const STATES: usize = 8;
const COLUMNS: usize = 3;
const LENGTH: usize = 500;

/// Returns every measured call. The peers make the same calls on equal data, apart from the weights of the
/// network.
pub(crate) fn all() -> Vec<Work> {
    let work = |name, run| Work { name, run };
    vec![
        work("mlp_inference", network()),
        work("gplvm_gradient", gradient()),
        work("gplvm_100_iterations", training()),
        work("gplvm_latent_of_pose", inference()),
        work("gplvm_back_constraint", back_constraint()),
        work("gplvm_shared_training", shared_training()),
        work("gplvm_transfer", transfer()),
        work("gp_fit", fit()),
        work("gp_point_added", point_added()),
        work("gp_prediction", prediction()),
        work("hmm_log_likelihood", likelihood()),
        work("hmm_viterbi", viterbi()),
        work("cholesky_and_inverse", factor()),
    ]
}

/// Rows of smooth, aperiodic values.
pub(crate) fn values(rows: usize, columns: usize, phase: f64) -> Vec<f64> {
    let value = |i: usize| {
        let (row, column) = (i / columns, i % columns);
        (0.37 * row as f64 + 1.3 * column as f64 + phase).sin() + 0.1 * (5.1 * i as f64).cos()
    };
    (0..rows * columns).map(value).collect()
}

/// Returns the network as an ONNX file.
pub(crate) fn network_file() -> Vec<u8> {
    let layer = |pair: &[usize]| {
        let [inputs, outputs] = [pair[0], pair[1]];
        let scale = 1.0 / (inputs as f64).sqrt();
        let weights = values(outputs, inputs, 0.2).iter().map(|value| (scale * value) as f32).collect();
        (weights, vec![0.1_f32; outputs])
    };
    let layers: Vec<(Vec<f32>, Vec<f32>)> = LAYERS.windows(2).map(layer).collect();
    onnx::write_mlp(LAYERS[0], &layers, Unary::Elu(1.0), &[])
}

/// Fills in the observation.
pub(crate) fn observe(inputs: &mut [f32]) {
    for (number, input) in inputs.iter_mut().enumerate() {
        *input = black_box(0.1 * number as f32 - 2.0);
    }
}

fn network() -> Box<dyn FnMut()> {
    let program = Model::read(&network_file()).and_then(|model| model.program(1));
    let mut program = program.expect("a network");
    Box::new(move || {
        observe(program.input_mut(0));
        program.run();
        black_box(program.output(0));
    })
}

/// Energy and gradient of a latent model.
fn gradient() -> Box<dyn FnMut()> {
    let (x, y) = (values(POSES, LATENTS, 0.4), values(POSES, OUTPUTS, 0.1));
    let mut workspace = Workspace::default();
    Box::new(move || {
        black_box(LatentModel::energy(&x, &y, &PARAMETERS, &mut workspace).expect("an energy"));
    })
}

fn settings(back: Option<BackForm>) -> Settings {
    let back = back.map(|form| ("robot".to_owned(), form));
    Settings { latents: Some(LATENTS), iterations: 100, prior: Prior::None, back }
}

fn trained(poses: &[f64], settings: &Settings) -> LatentModel {
    let columns = (0..OUTPUTS).map(|column| format!("c{column}")).collect();
    let spaces = [SpaceData { name: "robot", columns, values: poses }];
    LatentModel::train(&spaces, settings).expect("a model").0
}

fn training() -> Box<dyn FnMut()> {
    let (poses, settings) = (values(POSES, OUTPUTS, 0.1), settings(None));
    Box::new(move || {
        black_box(trained(&poses, &settings));
    })
}

fn inference() -> Box<dyn FnMut()> {
    let model = trained(&values(POSES, OUTPUTS, 0.1), &settings(None));
    let pose = values(1, OUTPUTS, 0.55);
    Box::new(move || {
        black_box(model.infer(0, &pose));
    })
}

fn back_constraint() -> Box<dyn FnMut()> {
    let model = trained(&values(POSES, OUTPUTS, 0.1), &settings(Some(BackForm::Kernel)));
    let (pose, mut standard, mut x) = (values(1, OUTPUTS, 0.55), [0.0; OUTPUTS], [0.0; LATENTS]);
    Box::new(move || {
        assert!(model.map_back(&pose, &mut standard, &mut x));
        black_box(x);
    })
}

/// Poses of each space of the shared model: functions of the same causes.
fn shared() -> [Vec<f64>; 3] {
    let pose = |row: usize, column: usize, space: usize| {
        let (u, v) = ((0.37 * row as f64).sin(), (0.23 * row as f64 + 1.0).cos());
        let angle = column as f64 + space as f64;
        (angle.cos() * u + angle.sin() * v).tanh() + 0.2 * u * v
    };
    [0, 1, 2].map(|space| {
        let columns = SHARED[space].1;
        (0..SHARED_POSES * columns).map(|i| pose(i / columns, i % columns, space)).collect()
    })
}

fn shared_space(space: usize, poses: &[Vec<f64>; 3]) -> SpaceData<'_> {
    let (name, columns) = SHARED[space];
    let columns = (0..columns).map(|column| format!("c{column}")).collect();
    SpaceData { name, columns, values: &poses[space] }
}

/// A model of the human and a robot, trained from the start.
fn shared_training() -> Box<dyn FnMut()> {
    let poses = shared();
    Box::new(move || {
        let spaces = [0, 2].map(|space| shared_space(space, &poses));
        black_box(LatentModel::train(&spaces, &Settings::default()).expect("a model"));
    })
}

/// The same robot, transferred to a model of the human and another robot.
fn transfer() -> Box<dyn FnMut()> {
    let poses = shared();
    let spaces = [0, 1].map(|space| shared_space(space, &poses));
    let settings = Settings::default();
    let (model, _) = LatentModel::train(&spaces, &settings).expect("a model");
    Box::new(move || {
        let mut model = model.clone();
        black_box(model.transfer(&shared_space(2, &poses), settings.iterations).expect("a transfer"));
    })
}

fn process() -> (GaussianProcess, Vec<f64>, Vec<f64>) {
    let (x, y) = (values(POINTS + 1, INPUTS, 0.4), values(POINTS + 1, 1, 0.1));
    let kernel = Kernel::matern52(INPUTS, 1.0);
    let process =
        GaussianProcess::new(kernel, 0.1, &x[..POINTS * INPUTS], INPUTS, &y[..POINTS], 1).expect("a process");
    (process, x, y)
}

/// Hyperparameters of the largest marginal likelihood.
fn fit() -> Box<dyn FnMut()> {
    let (process, ..) = process();
    Box::new(move || {
        black_box(process.clone().optimise(&Options::default()).expect("a fit"));
    })
}

/// A point added, and removed again.
fn point_added() -> Box<dyn FnMut()> {
    let (mut process, x, y) = process();
    Box::new(move || {
        process.push(&x[POINTS * INPUTS..], &y[POINTS..]).expect("a point");
        process.remove(POINTS);
    })
}

fn prediction() -> Box<dyn FnMut()> {
    let (process, x, _) = process();
    let (mut mean, mut scratch) = ([0.0], process.scratch());
    Box::new(move || {
        black_box(process.predict(&x[..INPUTS], &mut mean, &mut scratch));
    })
}

/// Returns a model that moves to the next state one time in ten, and a sequence.
pub(crate) fn markov() -> (Hmm, Vec<f64>) {
    let mut transitions = vec![0.0; STATES * STATES];
    for state in 0..STATES {
        transitions[state * STATES + state] = 0.9;
        transitions[state * STATES + (state + 1) % STATES] = 0.1;
    }
    let means: Vec<f64> = (0..STATES * COLUMNS).map(|i| (0.9 * i as f64).sin()).collect();
    let mut covariances = vec![0.0; STATES * COLUMNS * COLUMNS];
    for (i, value) in covariances.iter_mut().enumerate() {
        *value = if i / COLUMNS % COLUMNS == i % COLUMNS { 0.3 } else { 0.05 };
    }
    let start = [1.0 / STATES as f64; STATES];
    let model = Hmm::new(&start, &transitions, &means, &covariances, Shape::Full).expect("a model");
    (model, values(LENGTH, COLUMNS, 0.3))
}

fn likelihood() -> Box<dyn FnMut()> {
    let (model, sequence) = markov();
    Box::new(move || {
        black_box(model.log_likelihood(&sequence).expect("a likelihood"));
    })
}

fn viterbi() -> Box<dyn FnMut()> {
    let (model, sequence) = markov();
    Box::new(move || {
        black_box(model.viterbi(&sequence).expect("a path"));
    })
}

/// Cholesky factor and inverse of a matrix of 200 rows.
fn factor() -> Box<dyn FnMut()> {
    let entry = |i: usize, j: usize| (-0.01 * (i as f64 - j as f64).powi(2)).exp() + f64::from(i == j);
    let rows: Vec<Vec<f64>> = (0..POSES).map(|i| (i..POSES).map(|j| entry(i, j)).collect()).collect();
    let mut factor = Cholesky::with_capacity(POSES);
    let mut inverse = vec![0.0; factor.stride() * factor.stride()];
    Box::new(move || {
        factor.factorise(POSES, |i, out| out.copy_from_slice(&rows[i])).expect("positive definite");
        factor.inverse(&mut inverse);
        black_box(&inverse);
    })
}
