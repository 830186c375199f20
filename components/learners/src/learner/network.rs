//! The network of a trained policy.

use motorium_models::inference::Unary;
use motorium_models::onnx::{self, GruLayer};

use super::Normaliser;

/// Final mapping of a policy's network from the outputs of its layers to an action.
#[derive(Clone, Debug, PartialEq)]
pub enum Head {
    /// The outputs of the layers are the action.
    Linear,
    /// The action is `offset + scale tanh(output)`.
    Squashed {
        /// Half of the range of each element of the action.
        scale: Vec<f32>,
        /// Middle of the range of each element of the action.
        offset: Vec<f32>,
    },
    /// The action is the row of `table` that corresponds to the largest output.
    Choice {
        /// Actions, one row per output.
        table: Vec<f32>,
    },
}

/// A trained policy without exploration: optional recurrent units, layers with `tanh` between them, and a
/// [`Head`].
#[derive(Clone, Debug, PartialEq)]
pub struct TrainedNetwork {
    /// Memory of the network: gated recurrent units before the layers. `None` for a network without memory.
    pub memory: Option<GruLayer>,
    /// Weights (outputs x inputs, row by row) and biases of each layer.
    pub layers: Vec<(Vec<f32>, Vec<f32>)>,
    /// Mapping of the outputs of the last layer to an action.
    pub head: Head,
}

impl TrainedNetwork {
    /// Merges the normalisation of observations into the first layer.
    pub(crate) fn normalised(mut self, observations: &Normaliser) -> Self {
        match &mut self.memory {
            Some(GruLayer { hidden, input_weights, bias, .. }) => {
                observations.fold(input_weights, &mut bias[..3 * *hidden]);
            }
            None => {
                let (weights, bias) = &mut self.layers[0];
                observations.fold(weights, bias);
            }
        }
        self
    }

    /// Returns the bytes of an ONNX file with this network, which the component `policy.network` can run.
    ///
    /// # Panics
    ///
    /// If there is no layer.
    pub fn to_onnx(&self, metadata: &[(&str, &str)]) -> Vec<u8> {
        let inputs = self.layers[0].0.len() / self.layers[0].1.len();
        let write = |layers: &[(Vec<f32>, Vec<f32>)]| match &self.memory {
            Some(memory) => onnx::write_gru(memory, layers, Unary::Tanh, metadata),
            None => onnx::write_mlp(inputs, layers, Unary::Tanh, metadata),
        };
        match &self.head {
            Head::Linear => write(&self.layers),
            Head::Squashed { scale, offset } => {
                // the activation before an additional diagonal layer squashes the outputs
                let width = scale.len();
                let mut diagonal = vec![0.0; width * width];
                scale.iter().enumerate().for_each(|(k, scale)| diagonal[k * width + k] = *scale);
                let mut layers = self.layers.clone();
                layers.push((diagonal, offset.clone()));
                write(&layers)
            }
            Head::Choice { table } => match &self.memory {
                Some(memory) => onnx::write_gru_choice(memory, &self.layers, Unary::Tanh, table, metadata),
                None => onnx::write_choice(inputs, &self.layers, Unary::Tanh, table, metadata),
            },
        }
    }
}

/// Returns the logarithm of the sum of exponentials, without overflow.
pub(crate) fn log_sum(logits: &[f32]) -> f32 {
    let largest = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    if !largest.is_finite() {
        // a network that has diverged must reach the loss
        return f32::NAN;
    }
    largest + logits.iter().map(|logit| (logit - largest).exp()).sum::<f32>().ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squashed_actions_are_part_of_the_file() {
        let network = TrainedNetwork {
            memory: None,
            layers: vec![(vec![2.0, 0.0, -1.0, 0.5], vec![0.1, -0.2])],
            head: Head::Squashed { scale: vec![3.0, 0.0], offset: vec![1.0, 0.5] },
        };
        let model = onnx::Model::read(&network.to_onnx(&[])).expect("a file");
        let mut program = model.program(1).expect("operators");
        program.input_mut(0).copy_from_slice(&[0.3, -0.7]);
        program.run();
        let expected = 1.0 + 3.0 * 0.7_f32.tanh();
        assert!((program.output(0)[0] - expected).abs() < 1e-6, "{:?}", program.output(0));
        assert_eq!(program.output(0)[1], 0.5);
    }
}
