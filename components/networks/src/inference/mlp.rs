//! Multilayer perceptrons built from their weights.

use super::{Operation, Packed, Port, Program, Unary};
use crate::arithmetic::Lanes;

/// Error of a layer whose weights and biases do not match its inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "layer {layer} has {weights} weights and {biases} biases, expected {biases} x {inputs} weights; help: weights are outputs x inputs, row by row"
)]
pub struct LayerSizeError {
    /// Index of the layer.
    pub layer: usize,
    /// Number of weights found.
    pub weights: usize,
    /// Number of biases found, one per output.
    pub biases: usize,
    /// Number of inputs of the layer.
    pub inputs: usize,
}

impl<T: Lanes> Program<T> {
    /// Creates a multilayer perceptron for up to `rows` rows of `inputs` numbers. Each layer consists of its
    /// weights (outputs x inputs, row by row) and its biases. `activation` is applied between layers, but not
    /// after the last.
    ///
    /// # Errors
    ///
    /// [`LayerSizeError`] if a layer does not match the previous layer.
    pub fn mlp(
        rows: usize,
        inputs: usize,
        layers: &[(Vec<T>, Vec<T>)],
        activation: Unary,
    ) -> Result<Self, LayerSizeError> {
        let mut program = Self::default();
        let mut buffer = program.buffer(rows * inputs);
        program.inputs.push(Port { name: "input".to_owned(), shape: vec![rows, inputs], buffer });
        let mut width = inputs;
        for (layer, (weights, bias)) in layers.iter().enumerate() {
            let outputs = bias.len();
            if outputs == 0 || outputs.checked_mul(width) != Some(weights.len()) {
                let (weights, biases) = (weights.len(), outputs);
                return Err(LayerSizeError { layer, weights, biases, inputs: width });
            }
            let packed = Packed::new((outputs, width), |o, i| weights[o * width + i], |o| bias[o]);
            buffer = program.push(Operation::Linear(buffer, packed), rows * outputs);
            if layer + 1 < layers.len() {
                buffer = program.push(Operation::Unary(buffer, activation), rows * outputs);
            }
            width = outputs;
        }
        program.outputs.push(Port { name: "output".to_owned(), shape: vec![rows, width], buffer });
        Ok(program)
    }
}
