//! Backward passes compared with finite differences in double precision.

use super::{Activation, BatchNorm, Convolution, Function, Gru, Layer, LayerNorm, Linear, Lstm};
use super::{Backward, Forward};
use crate::arithmetic::Real;

fn number(k: usize) -> f64 {
    let bits = (k as u32 + 1).wrapping_mul(2_654_435_761).rotate_left(13).wrapping_mul(747_796_405);
    f64::from(bits >> 8) / f64::from(1 << 23) - 1.0
}

fn cast<T: Real>(values: &[f64]) -> Vec<T> {
    values.iter().map(|value| T::from_f64(*value)).collect()
}

/// Returns the loss (a weighted sum of the outputs), and its gradients with respect to inputs and parameters.
fn gradients<T: Real>(layer: &impl Layer, parameters: &[f64], input: &[f64]) -> (f64, [Vec<f64>; 2]) {
    let rows = input.len() / layer.inputs();
    let (parameters, input): (Vec<T>, Vec<T>) = (cast(parameters), cast(input));
    let mut output = vec![T::default(); rows * layer.outputs()];
    let mut trace = vec![T::default(); rows * layer.trace()];
    layer.forward(Forward { parameters: &parameters, input: &input, output: &mut output, trace: &mut trace });
    let gradient: Vec<T> = (0..output.len()).map(|k| T::from_f64(number(k + 500))).collect();
    let loss = output.iter().zip(&gradient).map(|(y, g)| y.to_f64() * g.to_f64()).sum();
    // written gradients must not depend on the previous content
    let mut input_gradient = vec![T::from_f64(7.0); input.len()];
    let mut parameter_gradient = vec![T::default(); parameters.len()];
    layer.backward(Backward {
        parameters: &parameters,
        input: &input,
        output: &output,
        trace: &trace,
        gradient: &gradient,
        input_gradient: &mut input_gradient,
        parameter_gradient: &mut parameter_gradient,
    });
    let wide = |values: &[T]| values.iter().map(|value| value.to_f64()).collect();
    (loss, [wide(&input_gradient), wide(&parameter_gradient)])
}

/// Compares both gradients with central differences, and single with double precision.
fn check(name: &str, layer: &impl Layer, rows: usize) {
    let parameters: Vec<f64> = (0..layer.parameters()).map(|k| 0.8 * number(k)).collect();
    let input: Vec<f64> = (0..rows * layer.inputs()).map(|k| 1.5 * number(k + 9000)).collect();
    let (_, found) = gradients::<f64>(layer, &parameters, &input);
    let (_, single) = gradients::<f32>(layer, &parameters, &input);
    let step = 1e-5;
    for (which, found) in found.iter().enumerate() {
        for (k, found) in found.iter().enumerate() {
            let loss = |change: f64| {
                let (mut parameters, mut input) = (parameters.clone(), input.clone());
                if which == 0 {
                    input[k] += change
                } else {
                    parameters[k] += change
                }
                gradients::<f64>(layer, &parameters, &input).0
            };
            // fourth order
            let slope =
                (8.0 * (loss(step) - loss(-step)) - (loss(2.0 * step) - loss(-2.0 * step))) / (12.0 * step);
            let error = (slope - found).abs() / found.abs().max(1e-3);
            assert!(error < 1e-6, "{name}, {which}, {k}: {slope} {found}");
            let rounded = (single[which][k] - found).abs();
            assert!(
                rounded < 2e-5 * found.abs().max(1.0),
                "{name}, {which}, {k}: {} {found}",
                single[which][k]
            );
        }
    }
}

#[test]
fn backward_passes_match_finite_differences() {
    check("linear", &Linear { inputs: 5, outputs: 4 }, 3);
    for function in [
        Function::Relu,
        Function::Elu(0.7),
        Function::LeakyRelu(0.1),
        Function::Tanh,
        Function::Sigmoid,
        Function::Softplus,
        Function::Softsign,
    ] {
        check("activation", &Activation { width: 6, function }, 3);
    }
    check("layer norm", &LayerNorm { width: 6, epsilon: 1e-5 }, 3);
    check("batch norm", &BatchNorm { width: 4, epsilon: 1e-5 }, 7);
    let plain = Convolution { channels: 2, filters: 3, size: [5, 4], kernel: [3, 2], stride: 1, padding: 0 };
    check("convolution", &plain, 2);
    check("padded convolution", &Convolution { stride: 2, padding: 1, ..plain }, 2);
    check("GRU", &Gru { inputs: 3, hidden: 4, steps: 5 }, 2);
    check("LSTM", &Lstm { inputs: 3, hidden: 4, steps: 5 }, 2);
}

#[test]
fn parameter_gradients_add_up() {
    let layer = Linear { inputs: 2, outputs: 1 };
    let pass = |sums: &mut [f64]| {
        layer.backward(Backward {
            parameters: &[1.0, 2.0, 3.0],
            input: &[4.0, 5.0],
            output: &[0.0],
            trace: &[],
            gradient: &[1.0],
            input_gradient: &mut [0.0; 2],
            parameter_gradient: sums,
        });
    };
    let mut sums = [0.0; 3];
    pass(&mut sums);
    pass(&mut sums);
    assert_eq!(sums, [8.0, 10.0, 2.0]);
}

#[test]
fn training_and_inference_agree_bit_for_bit() {
    let layer = Linear { inputs: 21, outputs: 37 };
    let parameters: Vec<f32> = (0..layer.parameters()).map(|k| number(k) as f32).collect();
    let input: Vec<f32> = (0..3 * 21).map(|k| number(k + 77) as f32).collect();
    let mut trained = vec![0.0; 3 * 37];
    layer.forward(Forward { parameters: &parameters, input: &input, output: &mut trained, trace: &mut [] });
    let (weights, bias) = parameters.split_at(21 * 37);
    let packed = crate::inference::Packed::new((37, 21), |o, i| weights[21 * o + i], |o| bias[o]);
    let mut inferred = vec![0.0; 3 * 37];
    packed.apply(&input, &mut inferred);
    assert_eq!(trained, inferred);
}
