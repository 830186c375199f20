//! Backward passes compared with finite differences, and convolutions with the layer in double precision.

use rand::SeedableRng as _;

use super::super::Perceptron;
use super::super::differentiable::Forward;
use super::*;

/// Two images of two and one channels, with numbers before, between and after them.
fn images() -> Vec<ImageLayers> {
    let layer = |channels, filters, size, kernel, stride, padding| Convolution {
        channels,
        filters,
        size,
        kernel: [kernel; 2],
        stride,
        padding,
    };
    vec![
        ImageLayers { first: 1, layers: vec![layer(2, 3, [4, 5], 3, 2, 1), layer(3, 2, [2, 3], 2, 1, 0)] },
        ImageLayers { first: 43, layers: vec![layer(1, 2, [5, 3], 2, 1, 1)] },
    ]
}

fn network(function: Function) -> Perceptron {
    let mut random = Pcg64::seed_from_u64(3);
    let encoder = ImageEncoder::random(60, &images(), &mut random).with_function(function);
    assert_eq!((encoder.inputs(), encoder.outputs()), (60, 2 * 2 + 2 * 6 * 4 + 1 + 2 + 2));
    Perceptron::random(&[encoder.outputs(), 4, 2], 1.0, &mut random).with_encoder(encoder)
}

fn input(samples: usize) -> DMatrix<f32> {
    DMatrix::from_fn(60, samples, |row, column| (0.9 * (row + 60 * column) as f32).sin())
}

/// Returns half of the squared outputs.
fn loss(network: &Perceptron, input: &DMatrix<f32>) -> f64 {
    0.5 * network.forward(input.clone()).output().iter().map(|y| f64::from(*y).powi(2)).sum::<f64>()
}

#[test]
fn gradients_of_images_match_finite_differences() {
    for function in [Function::Tanh, Function::Softplus, Function::Elu(1.0), Function::Relu] {
        let (mut network, input) = (network(function), input(3));
        let trace = network.forward(input.clone());
        let found = network.gradients(&trace, trace.output().clone());
        let known = network.to_vec();
        // a kink of ReLU within the step changes few of the slopes
        let (mut worst, mut over) = (0.0_f64, 0);
        for index in 0..known.len() {
            let mut moved = |step: f32| {
                let mut parameters = known.clone();
                parameters[index] += step;
                network.set(&parameters);
                loss(&network, &input)
            };
            let error = ((moved(3e-3) - moved(-3e-3)) / 6e-3 - f64::from(found[index])).abs();
            (worst, over) = (worst.max(error), over + usize::from(error > 2e-3));
        }
        let most = if function == Function::Relu { known.len() / 50 } else { 0 };
        assert!(over <= most, "{function:?}: {over} of {}, {worst}", known.len());
    }
}

#[test]
fn input_gradients_of_images_match_finite_differences() {
    let (network, input) = (network(Function::Tanh), input(2));
    let trace = network.forward(input.clone());
    let found = network.input_gradients(&trace, trace.output().clone());
    for index in 0..input.len() {
        let moved = |step: f32| {
            let mut moved = input.clone();
            moved[index] += step;
            loss(&network, &moved)
        };
        let slope = (moved(3e-3) - moved(-3e-3)) / 6e-3;
        assert!((slope - f64::from(found[index])).abs() < 2e-3, "{index}: {slope} {}", found[index]);
    }
    let last = network.last_input_gradients(&trace, trace.output().clone(), 2);
    assert_eq!(last, found.rows(58, 2));
}

#[test]
fn encoder_matches_the_layer_in_double_precision() {
    let image = ImageLayers { first: 0, layers: vec![images()[0].layers[0]] };
    let shape = image.layers[0];
    let encoder = ImageEncoder::random(40, &[image], &mut Pcg64::seed_from_u64(4));
    let ConvolutionLayer { weights, bias, .. } = encoder.images()[0].layers[0].clone();
    let parameters: Vec<f64> = weights.iter().chain(&bias).map(|weight| f64::from(*weight)).collect();
    let pixels = input(2).rows(0, 40).into_owned();
    let mut found = DMatrix::default();
    encoder.forward(&pixels, &mut Vec::new(), &mut found);
    let rows: Vec<f64> = pixels.iter().map(|pixel| f64::from(*pixel)).collect();
    let mut expected = vec![0.0; found.len()];
    shape.forward(Forward { parameters: &parameters, input: &rows, output: &mut expected, trace: &mut [] });
    for (found, expected) in found.iter().zip(expected) {
        assert!((f64::from(*found) - expected.max(0.0)).abs() < 1e-6, "{found} {expected}");
    }
}

#[test]
fn samples_and_reused_traces_have_equal_bits() {
    let network = network(Function::Relu);
    let batch = input(3);
    let whole = network.forward(batch.clone());
    let mut trace = network.forward(input(1));
    for (sample, column) in batch.column_iter().enumerate() {
        trace.input_mut(60, 1).copy_from_slice(column.as_slice());
        network.run(&mut trace);
        assert_eq!(trace.output().column(0), whole.output().column(sample), "sample {sample}");
    }
    let mut parameters = vec![7.0; network.parameters()];
    let expected = network.gradients(&trace, trace.output().clone());
    for _ in 0..2 {
        network.write_gradients(&mut trace, |output, out| out.copy_from_slice(output), &mut parameters);
        assert_eq!(parameters, expected);
    }
}
