//! Multilayer perceptrons on batches.

use nalgebra::DMatrix;
use rand_pcg::Pcg64;

use super::dense::{Dense, orthogonal, resize};
use super::differentiable::Function;
use super::encoder::{FilterGradients, FilterTrace, ImageEncoder};

/// A multilayer perceptron with a [`Function`] between its layers, by default `tanh`. Images among its inputs
/// can pass through the convolutions of an [`ImageEncoder`] before the first layer.
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
    encoder: Option<ImageEncoder>,
    layers: Vec<Dense>,
    function: Function,
}

/// Trace of a forward pass, from which gradients are computed: the inputs of all layers, then the output.
/// Reuse a trace to avoid allocation in passes over batches of the same size.
#[derive(Clone, Debug, Default)]
pub struct PerceptronTrace {
    /// Inputs of the encoder and of all layers, then the output.
    values: Vec<DMatrix<f32>>,
    /// Gradients with respect to the output, then to the inputs of the layers from the last to the first.
    gradients: Vec<DMatrix<f32>>,
    /// Values of the convolutions.
    filters: Vec<FilterTrace>,
    /// Gradients with respect to the values of the convolutions.
    filter_gradients: Vec<FilterGradients>,
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
        Self { encoder: None, layers, function: Function::Tanh }
    }

    /// Adds convolutions before the first layer.
    ///
    /// # Panics
    ///
    /// If the number of outputs of the encoder is not the number of inputs of the first layer.
    #[must_use]
    pub fn with_encoder(self, encoder: ImageEncoder) -> Self {
        assert_eq!(encoder.outputs(), self.layers[0].inputs, "outputs of the encoder");
        Self { encoder: Some(encoder), ..self }
    }

    /// Returns the convolutions before the first layer.
    pub fn encoder(&self) -> Option<&ImageEncoder> {
        self.encoder.as_ref()
    }

    /// Returns the number of inputs.
    pub fn inputs(&self) -> usize {
        self.encoder.as_ref().map_or(self.layers[0].inputs, ImageEncoder::inputs)
    }

    /// Replaces the activation function between the layers.
    pub fn with_function(self, function: Function) -> Self {
        Self { function, ..self }
    }

    /// Returns the number of parameters.
    pub fn parameters(&self) -> usize {
        let convolutions = self.encoder.as_ref().map_or(0, ImageEncoder::parameters);
        convolutions + self.layers.iter().map(Dense::parameters).sum::<usize>()
    }

    /// Returns all parameters: for each convolution, then for each layer, the weights, column by column, then
    /// the biases.
    pub fn to_vec(&self) -> Vec<f32> {
        let convolutions = self.encoder.iter().flat_map(ImageEncoder::slices);
        let layers = self.layers.iter().flat_map(|layer| [&layer.weights[..], &layer.bias]);
        convolutions.chain(layers).collect::<Vec<_>>().concat()
    }

    /// Replaces all parameters, in the order of [`to_vec`](Self::to_vec).
    ///
    /// # Panics
    ///
    /// If the number of parameters differs.
    pub fn set(&mut self, parameters: &[f32]) {
        assert_eq!(parameters.len(), self.parameters(), "number of parameters");
        let mut rest = parameters;
        if let Some(encoder) = &mut self.encoder {
            let (own, others) = rest.split_at(encoder.parameters());
            encoder.set(own);
            rest = others;
        }
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
        let mut trace = PerceptronTrace { values: vec![input], ..PerceptronTrace::default() };
        self.run(&mut trace);
        trace
    }

    /// Computes the output for the [input](PerceptronTrace::input_mut) of a trace.
    ///
    /// # Panics
    ///
    /// If the trace has no input, or the number of values per sample is wrong.
    pub fn run(&self, PerceptronTrace { values, filters, .. }: &mut PerceptronTrace) {
        assert_eq!(values.first().map(DMatrix::nrows), Some(self.inputs()), "inputs");
        let first = self.first();
        values.resize_with(first + self.layers.len() + 1, DMatrix::default);
        if let Some(encoder) = &self.encoder {
            let (input, encoded) = values.split_at_mut(1);
            encoder.forward(&input[0], filters, &mut encoded[0]);
        }
        for (index, layer) in self.layers.iter().enumerate() {
            let (before, after) = values.split_at_mut(first + index + 1);
            layer.forward(&before[first + index], &mut after[0]);
            if index + 1 < self.layers.len() {
                self.function.apply(after[0].as_mut_slice());
            }
        }
    }

    /// Returns the index of the first layer's input among the values of a trace.
    fn first(&self) -> usize {
        usize::from(self.encoder.is_some())
    }

    /// Returns the gradient of a loss with respect to all parameters, summed over the batch. `output` is the
    /// gradient with respect to the outputs. Parameters are in the order of [`to_vec`](Self::to_vec).
    pub fn gradients(&self, trace: &PerceptronTrace, output: DMatrix<f32>) -> Vec<f32> {
        let (mut gradients, mut parameters) = (vec![output], vec![0.0; self.parameters()]);
        self.write_parameters(trace, &mut gradients, &mut Vec::new(), &mut parameters);
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
        let mut gradients = core::mem::take(&mut trace.gradients);
        let last = trace.output();
        gradients.resize_with(gradients.len().max(1), DMatrix::default);
        resize(&mut gradients[0], last.nrows(), last.ncols());
        output(last.as_slice(), gradients[0].as_mut_slice());
        let mut filter_gradients = core::mem::take(&mut trace.filter_gradients);
        self.write_parameters(trace, &mut gradients, &mut filter_gradients, parameters);
        (trace.gradients, trace.filter_gradients) = (gradients, filter_gradients);
    }

    /// Writes the gradient with respect to all parameters. The first gradient is with respect to the outputs.
    fn write_parameters(
        &self,
        trace: &PerceptronTrace,
        gradients: &mut Vec<DMatrix<f32>>,
        filter_gradients: &mut Vec<FilterGradients>,
        parameters: &mut [f32],
    ) {
        let values = &trace.values[self.first()..];
        let Some(encoder) = &self.encoder else {
            self.propagate(values, gradients, Some(parameters), false);
            return;
        };
        let (own, others) = parameters.split_at_mut(encoder.parameters());
        self.propagate(values, gradients, Some(others), true);
        let encoded = &gradients[self.layers.len()];
        encoder.backward((&trace.filters, encoded), filter_gradients, Some(own), None);
    }

    /// Returns the gradient of a loss with respect to the inputs. Each column is a sample. `output` is the
    /// gradient with respect to the outputs.
    pub fn input_gradients(&self, trace: &PerceptronTrace, output: DMatrix<f32>) -> DMatrix<f32> {
        let encoded = self.encoded_gradients(trace, output);
        let Some(encoder) = &self.encoder else { return encoded };
        let mut input = DMatrix::default();
        encoder.backward((&trace.filters, &encoded), &mut Vec::new(), None, Some(&mut input));
        input
    }

    /// Returns the gradient of a loss with respect to the last `count` inputs, one sample per column.
    /// `output` is the gradient with respect to the outputs.
    ///
    /// # Panics
    ///
    /// If one of these inputs is a pixel of an encoded image, or there are fewer inputs.
    pub fn last_input_gradients(
        &self,
        trace: &PerceptronTrace,
        output: DMatrix<f32>,
        count: usize,
    ) -> DMatrix<f32> {
        let most = self.encoder.as_ref().map_or(self.inputs(), ImageEncoder::trailing);
        assert!(count <= most, "{count} inputs, {most} after the last image");
        // the encoder keeps the order of these inputs
        let encoded = self.encoded_gradients(trace, output);
        encoded.rows(encoded.nrows() - count, count).into_owned()
    }

    /// Returns the gradient with respect to the inputs of the first layer.
    fn encoded_gradients(&self, trace: &PerceptronTrace, output: DMatrix<f32>) -> DMatrix<f32> {
        let mut gradients = vec![output];
        self.propagate(&trace.values[self.first()..], &mut gradients, None, true);
        gradients.swap_remove(self.layers.len())
    }

    /// Propagates the first gradient, with respect to the outputs, back through the layers; each following
    /// gradient is with respect to a layer's input, starting with the last layer. Writes the gradient with
    /// respect to the parameters of the layers, and to the input of the first layer if `to_input`.
    fn propagate(
        &self,
        values: &[DMatrix<f32>],
        gradients: &mut Vec<DMatrix<f32>>,
        mut parameters: Option<&mut [f32]>,
        to_input: bool,
    ) {
        gradients.resize_with(self.layers.len() + 1, DMatrix::default);
        for (back, (index, layer)) in self.layers.iter().enumerate().rev().enumerate() {
            let (known, next) = gradients.split_at_mut(back + 1);
            let gradient = &known[back];
            if let Some(rest) = parameters.take() {
                let (before, own) = rest.split_at_mut(rest.len() - layer.parameters());
                layer.gradients(&values[index], gradient, own);
                parameters = Some(before);
            }
            if index > 0 {
                layer.backward(gradient, &mut next[0]);
                self.function.scale_by_slopes(next[0].as_mut_slice(), values[index].as_slice());
            } else if to_input {
                layer.backward(gradient, &mut next[0]);
            }
        }
    }
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
