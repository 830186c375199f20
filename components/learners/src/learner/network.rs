//! The network of a trained policy.

use motorium_models::inference::Unary;
use motorium_models::networks::Perceptron;
use motorium_models::onnx::{self, GruLayer, ImageInput};

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

/// A trained policy without exploration: optional recurrent units or convolutions of images, layers with
/// `tanh` between them, and a [`Head`].
#[derive(Clone, Debug, PartialEq)]
pub struct TrainedNetwork {
    /// Memory of the network: gated recurrent units before the layers. `None` for a network without memory.
    pub memory: Option<GruLayer>,
    /// Normalisation of the observations and convolutions of the images among them, before the layers. `None`
    /// for a network without convolutions.
    pub images: Option<ImageInput>,
    /// Weights (outputs x inputs, row by row) and biases of each layer.
    pub layers: Vec<(Vec<f32>, Vec<f32>)>,
    /// Mapping of the outputs of the last layer to an action.
    pub head: Head,
}

impl TrainedNetwork {
    /// Creates the trained form of a network without memory.
    pub(crate) fn new(network: &Perceptron, head: Head) -> Self {
        let images = network.encoder().map(|encoder| ImageInput {
            means: vec![0.0; encoder.inputs()],
            factors: vec![1.0; encoder.inputs()],
            images: encoder.images(),
        });
        Self { memory: None, images, layers: network.rows(), head }
    }

    /// Adds the normalisation of observations, merged into the first layer unless there are convolutions.
    pub(crate) fn normalised(mut self, observations: &Normaliser) -> Self {
        if let Some(ImageInput { means, factors, .. }) = &mut self.images {
            *means = observations.mean().iter().map(|mean| *mean as f32).collect();
            *factors =
                observations.deviations().into_iter().map(|deviation| deviation.recip() as f32).collect();
            return self;
        }
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
        let write = |layers: &[(Vec<f32>, Vec<f32>)], table: Option<&[f32]>| {
            let activation = Unary::Tanh;
            match (&self.images, &self.memory, table) {
                (Some(images), ..) => onnx::write_convolutions(images, layers, activation, table, metadata),
                (_, Some(memory), None) => onnx::write_gru(memory, layers, activation, metadata),
                (_, Some(memory), Some(table)) => {
                    onnx::write_gru_choice(memory, layers, activation, table, metadata)
                }
                (_, None, None) => onnx::write_mlp(inputs, layers, activation, metadata),
                (_, None, Some(table)) => onnx::write_choice(inputs, layers, activation, table, metadata),
            }
        };
        match &self.head {
            Head::Linear => write(&self.layers, None),
            Head::Squashed { scale, offset } => {
                // the activation before an additional diagonal layer squashes the outputs
                let width = scale.len();
                let mut diagonal = vec![0.0; width * width];
                scale.iter().enumerate().for_each(|(k, scale)| diagonal[k * width + k] = *scale);
                let mut layers = self.layers.clone();
                layers.push((diagonal, offset.clone()));
                write(&layers, None)
            }
            Head::Choice { table } => write(&self.layers, Some(table)),
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
    use motorium_models::policy::{Policy, PolicyNetwork};
    use nalgebra::DMatrix;
    use rand_pcg::Pcg64;

    use super::super::{ConvolutionSettings, Encoding};
    use super::*;

    #[test]
    fn convolutions_are_part_of_the_file() {
        let text = r#"
            network = "policy.onnx"
            rate = 50.0
            observations = [
                { term = "joint_positions" },
                { term = "depth_image", camera = "front", pixels = [7, 5], range = [0.5, 2.5], history = 2 },
                { term = "joint_velocities" },
                { term = "grey_image", camera = "front", pixels = [4, 6] },
            ]
            action = { joints = ["hip", "knee"], default_pose = [0.0, 0.0] }
        "#;
        let policy = Policy::parse(text).expect("a policy");
        let inputs = policy.inputs().expect("a size");
        let convolutions = [
            ConvolutionSettings { channels: 3, kernel: 3, stride: 2, padding: 1 },
            ConvolutionSettings { channels: 4, kernel: 2, stride: 1, padding: 0 },
        ];
        let encoding = Encoding::new("ppo", &convolutions, &policy).expect("convolutions that fit");
        let mut random = Pcg64::new(1, 2);
        let network = encoding.network(&[inputs, 8, 2], 1.0, &mut random);
        let mut normaliser = encoding.normaliser(inputs);
        let rows: Vec<f32> =
            (0..20 * inputs).map(|k| (0.7 * k as f32).sin() + 0.01 * (k % inputs) as f32).collect();
        normaliser.update(&rows);
        let head = Head::Squashed { scale: vec![3.0, 1.0], offset: vec![1.0, 0.5] };
        let file = TrainedNetwork::new(&network, head).normalised(&normaliser).to_onnx(&[]);
        let program = onnx::Model::read(&file).and_then(|model| model.program(1)).expect("operators");
        let mut found = PolicyNetwork::new(&policy, program).expect("the network of the policy");
        for row in rows.chunks_exact(inputs) {
            let mut normal = vec![0.0; inputs];
            normaliser.apply(row, &mut normal);
            let trace = network.forward(DMatrix::from_vec(inputs, 1, normal));
            let [a, b] = [trace.output()[0], trace.output()[1]];
            found.observation_mut().copy_from_slice(row);
            let action = found.run();
            let errors = [action[0] - (1.0 + 3.0 * a.tanh()), action[1] - (0.5 + b.tanh())];
            assert!(errors.iter().all(|error| error.abs() < 1e-4), "{errors:?}");
        }
    }

    #[test]
    fn squashed_actions_are_part_of_the_file() {
        let network = TrainedNetwork {
            memory: None,
            images: None,
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
