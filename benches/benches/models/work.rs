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
const POSES: usize = 200;
const OUTPUTS: usize = 14;
const LATENTS: usize = 2;
/// Points and inputs of the Gaussian process.
const POINTS: usize = 200;
const INPUTS: usize = 6;
/// Units of the network: a policy with 54,000 weights.
const LAYERS: [usize; 5] = [48, 256, 128, 64, 12];
/// States, columns and length of the hidden Markov model and its sequence.
const STATES: usize = 8;
const COLUMNS: usize = 3;
const LENGTH: usize = 500;

/// Every measured call. The peers make the same ones on equal data, apart from the weights of the network.
pub(crate) fn all() -> Vec<Work> {
    let work = |name, run| Work { name, run };
    vec![
        work("mlp_inference", network()),
        work("gplvm_gradient", gradient()),
        work("gplvm_100_iterations", training()),
        work("gplvm_latent_of_pose", inference()),
        work("gplvm_back_constraint", back_constraint()),
        work("gp_fit", fit()),
        work("gp_point_added", point_added()),
        work("gp_prediction", prediction()),
        work("hmm_log_likelihood", likelihood()),
        work("hmm_viterbi", viterbi()),
        work("cholesky_and_inverse", factor()),
    ]
}

/// Rows of smooth, aperiodic values.
fn values(rows: usize, columns: usize, phase: f64) -> Vec<f64> {
    let value = |i: usize| {
        let (row, column) = (i / columns, i % columns);
        (0.37 * row as f64 + 1.3 * column as f64 + phase).sin() + 0.1 * (5.1 * i as f64).cos()
    };
    (0..rows * columns).map(value).collect()
}

fn network() -> Box<dyn FnMut()> {
    let layer = |pair: &[usize]| {
        let [inputs, outputs] = [pair[0], pair[1]];
        let scale = 1.0 / (inputs as f64).sqrt();
        let weights = values(outputs, inputs, 0.2).iter().map(|value| (scale * value) as f32).collect();
        (weights, vec![0.1_f32; outputs])
    };
    let layers: Vec<(Vec<f32>, Vec<f32>)> = LAYERS.windows(2).map(layer).collect();
    let bytes = onnx::write_mlp(LAYERS[0], &layers, Unary::Elu(1.0), &[]);
    let mut program = Model::read(&bytes).and_then(|model| model.program(1)).expect("a network");
    Box::new(move || {
        for (number, input) in program.input_mut(0).iter_mut().enumerate() {
            *input = black_box(0.1 * number as f32 - 2.0);
        }
        program.run();
        black_box(program.output(0));
    })
}

/// Energy and gradient of a latent model.
fn gradient() -> Box<dyn FnMut()> {
    let (x, y) = (values(POSES, LATENTS, 0.4), values(POSES, OUTPUTS, 0.1));
    let (parameters, mut workspace) = ([0.1, 0.2, -0.3, -4.0], Workspace::default());
    Box::new(move || {
        black_box(LatentModel::energy(&x, &y, &parameters, &mut workspace).expect("an energy"));
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

/// A model that moves to the next state one time in ten, and a sequence.
fn markov() -> (Hmm, Vec<f64>) {
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
