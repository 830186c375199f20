//! Convolutions of images compared with PyTorch, and their inference with training.

use motorium_models::inference::Unary;
use motorium_models::networks::differentiable::Convolution;
use motorium_models::networks::{ImageEncoder, ImageLayers, Perceptron};
use motorium_models::onnx::{ImageInput, Model, write_convolutions};
use nalgebra::DMatrix;
use rand_pcg::Pcg64;

use crate::golden;

/// The network of `golden/encoder.py`.
fn network() -> Perceptron {
    let mut random = Pcg64::new(1, 2);
    let first = Convolution { channels: 2, filters: 3, size: [5, 6], kernel: [3, 3], stride: 2, padding: 1 };
    let second = Convolution { channels: 3, filters: 4, size: [3, 3], kernel: [2, 2], stride: 1, padding: 0 };
    let image = ImageLayers { first: 0, layers: vec![first, second] };
    let encoder = ImageEncoder::random(63, &[image], &mut random);
    let mut network = Perceptron::random(&[encoder.outputs(), 4, 2], 1.0, &mut random).with_encoder(encoder);
    network.set(&numbers(network.parameters(), 900, 0.5));
    network
}

fn numbers(count: usize, first: usize, scale: f64) -> Vec<f32> {
    (first..first + count).map(|k| (scale * (1.7 * k as f64 + 0.3).sin()) as f32).collect()
}

fn wide(numbers: &[f32]) -> Vec<f64> {
    numbers.iter().map(|number| f64::from(*number)).collect()
}

#[test]
fn outputs_and_gradients_match_pytorch() {
    let (network, golden) = (network(), golden::read("encoder.json"));
    let expected = |name: &str| golden::numbers(&golden[name]);
    let trace = network.forward(DMatrix::from_vec(63, 3, numbers(3 * 63, 5, 1.0)));
    golden::assert_close(&wide(trace.output().as_slice()), &expected("outputs"), 2e-6, "outputs");
    let slopes = DMatrix::from_vec(2, 3, numbers(6, 40, 1.0));
    let found = network.gradients(&trace, slopes.clone());
    golden::assert_close(&wide(&found), &expected("parameters"), 2e-6, "parameters");
    let found = network.input_gradients(&trace, slopes);
    golden::assert_close(&wide(found.as_slice()), &expected("inputs"), 2e-6, "inputs");
}

#[test]
fn inference_matches_training() {
    let network = network();
    let (means, factors) = (numbers(63, 300, 0.2), numbers(63, 500, 0.4));
    let factors: Vec<f32> = factors.iter().map(|factor| 1.0 + factor).collect();
    let images = network.encoder().expect("an encoder").images();
    let input = ImageInput { means: means.clone(), factors: factors.clone(), images };
    let file = write_convolutions(&input, &network.rows(), Unary::Tanh, None, &[("task", "sight")]);
    let model = Model::read(&file).expect("a model");
    assert_eq!(model.metadata().next(), Some(("task", "sight")));
    let raw = numbers(3 * 63, 5, 1.0);
    let normal = raw.iter().enumerate().map(|(k, x)| (x - means[k % 63]) * factors[k % 63]).collect();
    let expected = network.forward(DMatrix::from_vec(63, 3, normal));
    let mut program = model.program(3).expect("supported operators");
    program.input_mut(0).copy_from_slice(&raw);
    program.run();
    golden::assert_close(&wide(program.output(0)), &wide(expected.output().as_slice()), 1e-6, "outputs");
    // the row of a table with the largest output
    let file = write_convolutions(&input, &network.rows(), Unary::Tanh, Some(&[7.0, -7.0]), &[]);
    let mut program = Model::read(&file).and_then(|model| model.program(3)).expect("supported operators");
    program.input_mut(0).copy_from_slice(&raw);
    program.run();
    let largest = expected.output().column_iter().map(|row| if row[1] > row[0] { -7.0 } else { 7.0 });
    assert_eq!(program.output(0), largest.collect::<Vec<f32>>());
}
