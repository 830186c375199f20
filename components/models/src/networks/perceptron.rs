//! Multilayer perceptrons on batches.

use nalgebra::DMatrix;
use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;

use super::differentiable::Function;
use super::products::{Left, Product};

/// A multilayer perceptron with a [`Function`] between its layers, by default `tanh`.
///
/// A batch is a matrix with one sample per column. Sums over inputs, outputs and samples have a fixed order
/// and use fused multiply-adds. Results are therefore bitwise equal on every processor, and the output of a
/// sample does not depend on the other samples.
///
/// ```
/// use motorium_models::networks::{Adam, Perceptron};
/// use nalgebra::DMatrix;
/// use rand_pcg::Pcg64;
///
/// let mut network = Perceptron::random(&[2, 8, 1], 1.0, &mut Pcg64::new(1, 2));
/// let mut adam = Adam::new(&[network.parameters()]);
/// let (input, target) = (DMatrix::from_column_slice(2, 1, &[0.5, -1.0]), 0.7);
/// for _ in 0..200 {
///     let trace = network.forward(input.clone());
///     let gradient = network.gradients(&trace, trace.output().add_scalar(-target));
///     let mut parameters = network.to_vec();
///     adam.step([&mut parameters[..]], [&gradient[..]], 0.01, 0.0);
///     network.set(&parameters);
/// }
/// assert!((network.forward(input).output()[0] - target).abs() < 0.01);
/// ```
#[derive(Clone, Debug)]
pub struct Perceptron {
    layers: Vec<Dense>,
    function: Function,
}

/// A matrix and a bias.
#[derive(Clone, Debug)]
struct Dense {
    inputs: usize,
    /// Weights of the first input, then of the second.
    weights: Vec<f32>,
    /// The same weights, output by output.
    by_output: Vec<f32>,
    bias: Vec<f32>,
}

impl Dense {
    /// Creates a layer with weights (outputs x inputs) and zero bias.
    fn new(weights: &DMatrix<f32>) -> Self {
        let (outputs, inputs) = weights.shape();
        Self {
            inputs,
            weights: weights.as_slice().to_vec(),
            by_output: weights.transpose().as_slice().to_vec(),
            bias: vec![0.0; outputs],
        }
    }

    fn outputs(&self) -> usize {
        self.bias.len()
    }

    fn parameters(&self) -> usize {
        self.weights.len() + self.bias.len()
    }

    /// Replaces weights and bias.
    fn set(&mut self, parameters: &[f32]) {
        let (weights, bias) = parameters.split_at(self.weights.len());
        self.weights.copy_from_slice(weights);
        self.bias.copy_from_slice(bias);
        let outputs = self.outputs();
        for (output, row) in self.by_output.chunks_exact_mut(self.inputs).enumerate() {
            let column = weights.iter().skip(output).step_by(outputs);
            row.iter_mut().zip(column).for_each(|(weight, known)| *weight = *known);
        }
    }

    /// Writes the output.
    fn forward(&self, input: &DMatrix<f32>, output: &mut DMatrix<f32>) {
        resize(output, self.outputs(), input.ncols());
        Product {
            left: Left::Rows(input.as_slice()),
            right: &self.weights,
            start: Some(&self.bias),
            depth: self.inputs,
            out: output.as_mut_slice(),
            columns: self.outputs(),
        }
        .compute();
    }

    /// Writes the gradient with respect to weights and bias from the gradient with respect to the output.
    fn gradients(&self, input: &DMatrix<f32>, output: &DMatrix<f32>, gradients: &mut [f32]) {
        let (weights, bias) = gradients.split_at_mut(self.weights.len());
        Product {
            left: Left::Columns(input.as_slice()),
            right: output.as_slice(),
            start: None,
            depth: output.ncols(),
            out: weights,
            columns: self.outputs(),
        }
        .compute();
        bias.fill(0.0);
        for sample in output.as_slice().chunks_exact(self.outputs()) {
            bias.iter_mut().zip(sample).for_each(|(sum, gradient)| *sum += gradient);
        }
    }

    /// Writes the gradient with respect to the input from the gradient with respect to the output.
    fn backward(&self, output: &DMatrix<f32>, input: &mut DMatrix<f32>) {
        resize(input, self.inputs, output.ncols());
        Product {
            left: Left::Rows(output.as_slice()),
            right: &self.by_output,
            start: None,
            depth: self.outputs(),
            out: input.as_mut_slice(),
            columns: self.inputs,
        }
        .compute();
    }
}

/// Resizes a matrix; keeps its memory if the shape is unchanged.
fn resize(matrix: &mut DMatrix<f32>, rows: usize, columns: usize) {
    if matrix.shape() != (rows, columns) {
        *matrix = DMatrix::zeros(rows, columns);
    }
}

/// Trace of a forward pass, from which gradients are computed: the inputs of all layers, then the output.
/// Reuse a trace to avoid allocation in passes over batches of the same size.
#[derive(Clone, Debug, Default)]
pub struct PerceptronTrace {
    /// Inputs of all layers, then the output.
    values: Vec<DMatrix<f32>>,
    /// Gradients with respect to these values.
    gradients: Vec<DMatrix<f32>>,
}

impl PerceptronTrace {
    /// Returns a buffer for the network input: `samples` columns, each with the `inputs` numbers of a sample.
    /// The caller must overwrite the whole buffer.
    pub fn input_mut(&mut self, inputs: usize, samples: usize) -> &mut [f32] {
        self.values.resize_with(self.values.len().max(1), DMatrix::default);
        resize(&mut self.values[0], inputs, samples);
        self.values[0].as_mut_slice()
    }

    /// Returns the network output. Each column is a sample.
    pub fn output(&self) -> &DMatrix<f32> {
        &self.values[self.values.len() - 1]
    }
}

impl Perceptron {
    /// Creates a network with random weights; `sizes` contains the number of inputs, then the number of units
    /// of each layer. Weights are orthogonal, scaled by the square root of 2, or by `gain` in the last layer;
    /// biases are 0 (Saxe, McClelland, Ganguli 2014; these gains are common for policy gradients).
    ///
    /// # Panics
    ///
    /// If there are fewer than two sizes.
    pub fn random(sizes: &[usize], gain: f32, random: &mut Pcg64) -> Self {
        assert!(sizes.len() >= 2, "inputs and outputs");
        let last = sizes.len() - 2;
        let layer = |(index, pair): (usize, &[usize])| {
            let gain = if index == last { gain } else { core::f32::consts::SQRT_2 };
            Dense::new(&(orthogonal(pair[1], pair[0], random) * gain))
        };
        let layers = sizes.windows(2).enumerate().map(layer).collect();
        Self { layers, function: Function::Tanh }
    }

    /// Replaces the activation function between the layers.
    pub fn with_function(self, function: Function) -> Self {
        Self { function, ..self }
    }

    /// Returns the number of parameters.
    pub fn parameters(&self) -> usize {
        self.layers.iter().map(Dense::parameters).sum()
    }

    /// Returns all parameters: for each layer the weights, column by column, then the biases.
    pub fn to_vec(&self) -> Vec<f32> {
        let slices = self.layers.iter().flat_map(|layer| [&layer.weights[..], &layer.bias]);
        slices.collect::<Vec<_>>().concat()
    }

    /// Replaces all parameters, in the order of [`to_vec`](Self::to_vec).
    ///
    /// # Panics
    ///
    /// If the number of parameters differs.
    pub fn set(&mut self, parameters: &[f32]) {
        assert_eq!(parameters.len(), self.parameters(), "number of parameters");
        let mut rest = parameters;
        for layer in &mut self.layers {
            let (own, others) = rest.split_at(layer.parameters());
            layer.set(own);
            rest = others;
        }
    }

    /// Returns the weights (outputs x inputs, row by row) and biases of each layer, as expected by
    /// [`Program::mlp`](crate::inference::Program::mlp) and [`write_mlp`](crate::onnx::write_mlp).
    pub fn rows(&self) -> Vec<(Vec<f32>, Vec<f32>)> {
        self.layers.iter().map(|layer| (layer.by_output.clone(), layer.bias.clone())).collect()
    }

    /// Computes the output and returns it in a trace with the inputs of all layers.
    pub fn forward(&self, input: DMatrix<f32>) -> PerceptronTrace {
        let mut trace = PerceptronTrace { values: vec![input], gradients: vec![] };
        self.run(&mut trace);
        trace
    }

    /// Computes the output for the [input](PerceptronTrace::input_mut) of a trace.
    ///
    /// # Panics
    ///
    /// If the trace has no input, or the number of values per sample is wrong.
    pub fn run(&self, PerceptronTrace { values, .. }: &mut PerceptronTrace) {
        assert_eq!(values.first().map(DMatrix::nrows), Some(self.layers[0].inputs), "inputs");
        values.resize_with(self.layers.len() + 1, DMatrix::default);
        for (index, layer) in self.layers.iter().enumerate() {
            let (before, after) = values.split_at_mut(index + 1);
            layer.forward(&before[index], &mut after[0]);
            if index + 1 < self.layers.len() {
                self.function.apply(after[0].as_mut_slice());
            }
        }
    }

    /// Returns the gradient of a loss with respect to all parameters, summed over the batch. `output` is the
    /// gradient with respect to the outputs. Parameters are in the order of [`to_vec`](Self::to_vec).
    pub fn gradients(&self, trace: &PerceptronTrace, output: DMatrix<f32>) -> Vec<f32> {
        let mut parameters = vec![0.0; self.parameters()];
        self.propagate(&trace.values, &mut vec![output], Some(&mut parameters));
        parameters
    }

    /// Writes the [gradient](Self::gradients) of a loss with respect to all parameters. `output` receives the
    /// outputs of one sample after the other, and writes the gradient of the loss with respect to these
    /// outputs. Entries that `output` does not write are undefined.
    ///
    /// # Panics
    ///
    /// If the length of `parameters` is not the number of parameters.
    pub fn write_gradients(
        &self,
        trace: &mut PerceptronTrace,
        output: impl FnOnce(&[f32], &mut [f32]),
        parameters: &mut [f32],
    ) {
        assert_eq!(parameters.len(), self.parameters(), "number of parameters");
        let PerceptronTrace { values, gradients } = trace;
        let last = &values[self.layers.len()];
        gradients.resize_with(gradients.len().max(1), DMatrix::default);
        resize(&mut gradients[0], last.nrows(), last.ncols());
        output(last.as_slice(), gradients[0].as_mut_slice());
        self.propagate(values, gradients, Some(parameters));
    }

    /// Returns the gradient of a loss with respect to the inputs. Each column is a sample. `output` is the
    /// gradient with respect to the outputs.
    pub fn input_gradients(&self, trace: &PerceptronTrace, output: DMatrix<f32>) -> DMatrix<f32> {
        let mut gradients = vec![output];
        self.propagate(&trace.values, &mut gradients, None);
        gradients.swap_remove(self.layers.len())
    }

    /// Propagates the first gradient, with respect to the outputs, back through the layers; each following
    /// gradient is with respect to a layer's input, starting with the last layer. Writes the gradient with
    /// respect to all parameters or, without `parameters`, to the first input.
    fn propagate(
        &self,
        values: &[DMatrix<f32>],
        gradients: &mut Vec<DMatrix<f32>>,
        mut parameters: Option<&mut [f32]>,
    ) {
        gradients.resize_with(self.layers.len() + 1, DMatrix::default);
        for (back, (index, layer)) in self.layers.iter().enumerate().rev().enumerate() {
            let (known, next) = gradients.split_at_mut(back + 1);
            let gradient = &known[back];
            let is_whole = parameters.is_some();
            if let Some(rest) = parameters.take() {
                let (before, own) = rest.split_at_mut(rest.len() - layer.parameters());
                layer.gradients(&values[index], gradient, own);
                parameters = Some(before);
            }
            if index > 0 {
                layer.backward(gradient, &mut next[0]);
                self.function.scale_by_slopes(next[0].as_mut_slice(), values[index].as_slice());
            } else if !is_whole {
                layer.backward(gradient, &mut next[0]);
            }
        }
    }
}

/// Returns a uniformly distributed matrix with orthonormal rows or columns.
fn orthogonal(rows: usize, columns: usize, random: &mut Pcg64) -> DMatrix<f32> {
    let (long, short) = (rows.max(columns), rows.min(columns));
    let normal = DMatrix::<f64>::from_fn(long, short, |_, _| StandardNormal.sample(random));
    let (mut q, r) = normal.qr().unpack();
    for (mut column, diagonal) in q.column_iter_mut().zip(r.diagonal().iter()) {
        if *diagonal < 0.0 {
            column.neg_mut();
        }
    }
    let q = q.map(|entry| entry as f32);
    if rows >= columns { q } else { q.transpose() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng as _;

    #[test]
    fn gradients_match_finite_differences() {
        for function in [Function::Tanh, Function::Relu, Function::Softplus, Function::Softsign] {
            let network = Perceptron::random(&[3, 5, 4, 2], 1.0, &mut Pcg64::seed_from_u64(3));
            assert_gradients(network.with_function(function));
        }
    }

    fn assert_gradients(mut network: Perceptron) {
        let input = DMatrix::from_fn(3, 4, |i, k| (1.7 * (i + 3 * k) as f32).sin());
        let target = DMatrix::from_fn(2, 4, |i, k| 0.3 * (i as f32 - k as f32));
        let trace = network.forward(input.clone());
        let found = network.gradients(&trace, trace.output() - &target);
        let known = network.to_vec();
        for index in 0..known.len() {
            let mut loss = |step: f32| {
                let mut parameters = known.clone();
                parameters[index] += step;
                network.set(&parameters);
                let error = network.forward(input.clone()).output() - &target;
                0.5 * error.iter().map(|e| f64::from(*e).powi(2)).sum::<f64>()
            };
            let slope = (loss(1e-2) - loss(-1e-2)) / 2e-2;
            assert!((slope - f64::from(found[index])).abs() < 2e-3, "{index}: {slope} {}", found[index]);
        }
    }

    #[test]
    fn input_gradients_match_finite_differences() {
        let network = Perceptron::random(&[3, 5, 4, 2], 1.0, &mut Pcg64::seed_from_u64(5));
        let input = DMatrix::from_fn(3, 2, |i, k| (1.3 * (i + 3 * k) as f32).sin());
        let weights = DMatrix::from_fn(2, 2, |i, k| 0.5 + i as f32 - 0.7 * k as f32);
        let found = network.input_gradients(&network.forward(input.clone()), weights.clone());
        for index in 0..input.len() {
            let loss = |step: f32| {
                let mut moved = input.clone();
                moved[index] += step;
                let trace = network.forward(moved);
                trace.output().iter().zip(weights.iter()).map(|(y, w)| f64::from(y * w)).sum::<f64>()
            };
            let slope = (loss(1e-2) - loss(-1e-2)) / 2e-2;
            assert!((slope - f64::from(found[index])).abs() < 2e-3, "{index}: {slope} {}", found[index]);
        }
    }

    #[test]
    fn reused_traces_give_the_same_bits() {
        let network = Perceptron::random(&[3, 6, 17, 2], 1.0, &mut Pcg64::seed_from_u64(6));
        let mut used = PerceptronTrace::default();
        let mut gradient = vec![f32::NAN; network.parameters()];
        for samples in [9, 4, 4] {
            let input = DMatrix::from_fn(3, samples, |i, k| (0.7 * (samples + i + 3 * k) as f32).sin());
            used.input_mut(3, samples).copy_from_slice(input.as_slice());
            network.run(&mut used);
            let trace = network.forward(input);
            assert_eq!(used.output(), trace.output());
            network.write_gradients(&mut used, |output, by| by.copy_from_slice(output), &mut gradient);
            assert_eq!(gradient, network.gradients(&trace, trace.output().clone()));
        }
    }

    #[test]
    fn rows_are_the_layers_of_the_inference_program() {
        use crate::inference::{Program, Unary};
        let network = Perceptron::random(&[3, 6, 2], 1.0, &mut Pcg64::seed_from_u64(4));
        let mut program = Program::mlp(1, 3, &network.rows(), Unary::Tanh).expect("layers that fit");
        program.input_mut(0).copy_from_slice(&[0.3, -0.8, 1.1]);
        program.run();
        let expected = network.forward(DMatrix::from_column_slice(3, 1, &[0.3, -0.8, 1.1]));
        for (found, expected) in program.output(0).iter().zip(expected.output().iter()) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
    }

    #[test]
    fn initial_weights_are_orthogonal() {
        let wide = orthogonal(3, 7, &mut Pcg64::seed_from_u64(1));
        assert!((&wide * wide.transpose() - DMatrix::identity(3, 3)).amax() < 1e-6);
        let tall = orthogonal(7, 3, &mut Pcg64::seed_from_u64(1));
        assert!((tall.transpose() * &tall - DMatrix::identity(3, 3)).amax() < 1e-6);
    }
}
