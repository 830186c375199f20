//! Networks of on-policy methods: a perceptron, with or without gated recurrent units or convolutions before
//! it.

use motorium_models::networks::differentiable::{Backward, Forward, Gru, Layer as _};
use motorium_models::networks::{Perceptron, PerceptronTrace};
use motorium_models::onnx::GruLayer;
use nalgebra::DMatrix;
use rand::RngExt as _;
use rand_pcg::Pcg64;

use crate::learner::{Encoding, Head, TrainedNetwork, layer_sizes};

/// A perceptron, optionally with gated recurrent units between its inputs and its layers.
#[derive(Clone, Debug)]
pub(super) struct Network {
    memory: Option<Memory>,
    layers: Perceptron,
}

/// A layer of gated recurrent units, with parameters in the order of [`Gru`].
#[derive(Clone, Debug)]
struct Memory {
    inputs: usize,
    units: usize,
    parameters: Vec<f32>,
}

/// Consecutive steps of one episode.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piece<'a> {
    /// State before the first step; `None` at the start of an episode, where it is 0.
    pub(super) state: Option<&'a [f32]>,
    pub(super) steps: usize,
}

/// A forward pass, kept for the backward pass. Its memory can be reused.
#[derive(Clone, Debug, Default)]
pub(super) struct Trace {
    pieces: Vec<PieceTrace>,
    /// States after each step, one column after the other.
    states: Vec<f32>,
    layers: PerceptronTrace,
}

#[derive(Clone, Debug)]
struct PieceTrace {
    steps: usize,
    input: Vec<f32>,
    gates: Vec<f32>,
}

impl Trace {
    /// Returns the outputs, one column per step.
    pub(super) fn output(&self) -> &DMatrix<f32> {
        self.layers.output()
    }

    /// Returns the states after each step; empty without recurrent units.
    pub(super) fn states(&self) -> &[f32] {
        &self.states
    }
}

impl Memory {
    /// Creates uniformly distributed weights within `1 / sqrt(units)`, as in PyTorch's `GRU`.
    fn random(inputs: usize, units: usize, random: &mut Pcg64) -> Self {
        let bound = 1.0 / (units as f32).sqrt();
        let layer = Gru { inputs, hidden: units, steps: 1 };
        let parameters = (0..layer.parameters()).map(|_| random.random_range(-bound..bound)).collect();
        Self { inputs, units, parameters }
    }

    fn layer(&self, steps: usize) -> Gru {
        Gru { inputs: self.inputs, hidden: self.units, steps }
    }

    /// Runs over a piece with contiguous inputs and writes the states after each step.
    fn forward(&self, piece: Piece<'_>, inputs: &[f32], states: &mut [f32]) -> PieceTrace {
        let layer = self.layer(piece.steps);
        let mut input = vec![0.0; self.units];
        if let Some(state) = piece.state {
            input.copy_from_slice(state);
        }
        input.extend_from_slice(inputs);
        let mut gates = vec![0.0; layer.trace()];
        layer.forward(Forward {
            parameters: &self.parameters,
            input: &input,
            output: states,
            trace: &mut gates,
        });
        PieceTrace { steps: piece.steps, input, gates }
    }
}

impl Network {
    /// Creates a network with random weights. With 0 `units` it is a perceptron with the convolutions of
    /// `encoding`. The last layer has `gain`.
    pub(super) fn random(
        encoding: &Encoding,
        (inputs, units, outputs): (usize, usize, usize),
        hidden: &[usize],
        gain: f32,
        random: &mut Pcg64,
    ) -> Self {
        let memory = (units > 0).then(|| Memory::random(inputs, units, random));
        let width = if units > 0 { units } else { inputs };
        Self { memory, layers: encoding.network(&layer_sizes(width, hidden, outputs), gain, random) }
    }

    /// Returns the number of parameters.
    pub(super) fn parameters(&self) -> usize {
        self.memory.as_ref().map_or(0, |memory| memory.parameters.len()) + self.layers.parameters()
    }

    /// Returns all parameters: first the recurrent units, then the layers.
    pub(super) fn to_vec(&self) -> Vec<f32> {
        let mut parameters = self.memory.as_ref().map_or_else(Vec::new, |memory| memory.parameters.clone());
        parameters.extend(self.layers.to_vec());
        parameters
    }

    /// Replaces all parameters, in the order of [`to_vec`](Self::to_vec).
    pub(super) fn set(&mut self, parameters: &[f32]) {
        let mut rest = parameters;
        if let Some(memory) = &mut self.memory {
            let (own, others) = rest.split_at(memory.parameters.len());
            memory.parameters.copy_from_slice(own);
            rest = others;
        }
        self.layers.set(rest);
    }

    /// Returns the trained network, whose outputs are the action.
    pub(super) fn trained(&self) -> TrainedNetwork {
        let memory = self.memory.as_ref().map(|Memory { inputs, units, parameters }| {
            let (input_weights, rest) = parameters.split_at(3 * units * inputs);
            let (state_weights, bias) = rest.split_at(3 * units * units);
            GruLayer {
                inputs: *inputs,
                hidden: *units,
                input_weights: input_weights.to_vec(),
                state_weights: state_weights.to_vec(),
                bias: bias.to_vec(),
            }
        });
        TrainedNetwork { memory, ..TrainedNetwork::new(&self.layers, Head::Linear) }
    }

    /// Computes the outputs of steps, one per column. With recurrent units, the columns are the pieces, one
    /// after the other.
    pub(super) fn forward<'a>(
        &self,
        input: DMatrix<f32>,
        pieces: impl IntoIterator<Item = Piece<'a>>,
    ) -> Trace {
        let Some(memory) = &self.memory else {
            return Trace { pieces: vec![], states: vec![], layers: self.layers.forward(input) };
        };
        let mut states = vec![0.0; memory.units * input.ncols()];
        let (mut inputs, mut outputs) = (input.as_slice(), &mut states[..]);
        let mut traces = Vec::new();
        for piece in pieces {
            let (own, rest) = inputs.split_at(piece.steps * memory.inputs);
            let (after, behind) = outputs.split_at_mut(piece.steps * memory.units);
            traces.push(memory.forward(piece, own, after));
            (inputs, outputs) = (rest, behind);
        }
        let layers = self.layers.forward(DMatrix::from_column_slice(memory.units, input.ncols(), &states));
        Trace { pieces: traces, states, layers }
    }

    /// Runs [`forward`](Self::forward) into a trace, with inputs one sample after the other. Without
    /// recurrent units it does not allocate if the number of samples is unchanged.
    pub(super) fn run<'a>(
        &self,
        trace: &mut Trace,
        (inputs, input): (usize, &[f32]),
        pieces: impl IntoIterator<Item = Piece<'a>>,
    ) {
        let samples = input.len() / inputs;
        if self.memory.is_some() {
            *trace = self.forward(DMatrix::from_column_slice(inputs, samples, input), pieces);
        } else {
            trace.layers.input_mut(inputs, samples).copy_from_slice(input);
            self.layers.run(&mut trace.layers);
        }
    }

    /// Writes the [gradient](Self::gradients) with respect to all parameters. From the outputs, `output`
    /// writes the gradient with respect to the outputs, one sample after the other.
    pub(super) fn write_gradients(
        &self,
        trace: &mut Trace,
        output: impl FnOnce(&[f32], &mut [f32]),
        parameters: &mut Vec<f32>,
    ) {
        parameters.resize(self.parameters(), 0.0);
        if self.memory.is_some() {
            let outputs = trace.output();
            let mut gradient = DMatrix::zeros(outputs.nrows(), outputs.ncols());
            output(outputs.as_slice(), gradient.as_mut_slice());
            parameters.copy_from_slice(&self.gradients(trace, gradient));
        } else {
            self.layers.write_gradients(&mut trace.layers, output, parameters);
        }
    }

    /// Returns the gradient of a loss with respect to all parameters from its gradient with respect to the
    /// outputs, by back-propagation through the steps of each piece, in order.
    pub(super) fn gradients(&self, trace: &Trace, output: DMatrix<f32>) -> Vec<f32> {
        let Some(memory) = &self.memory else { return self.layers.gradients(&trace.layers, output) };
        let by_states = self.layers.input_gradients(&trace.layers, output.clone());
        let mut gradient = vec![0.0; memory.parameters.len()];
        let (mut states, mut by_states) = (trace.states(), by_states.as_slice());
        for piece in &trace.pieces {
            let layer = memory.layer(piece.steps);
            let (after, rest) = states.split_at(layer.outputs());
            let (by_after, behind) = by_states.split_at(layer.outputs());
            let mut by_input = vec![0.0; piece.input.len()];
            layer.backward(Backward {
                parameters: &memory.parameters,
                input: &piece.input,
                output: after,
                trace: &piece.gates,
                gradient: by_after,
                input_gradient: &mut by_input,
                parameter_gradient: &mut gradient,
            });
            (states, by_states) = (rest, behind);
        }
        gradient.extend(self.layers.gradients(&trace.layers, output));
        gradient
    }
}

/// Returns one step per world, starting from its state.
pub(super) fn single_steps(states: &[f32], units: usize) -> impl Iterator<Item = Piece<'_>> {
    states.chunks_exact(units.max(1)).map(|state| Piece { state: Some(state), steps: 1 })
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng as _;

    use super::*;

    #[test]
    fn gradients_of_masked_sequences_match_finite_differences() {
        let mut network =
            Network::random(&Encoding::default(), (2, 3, 1), &[4], 1.0, &mut Pcg64::seed_from_u64(1));
        let start = [0.3, -0.5, 0.1];
        // an episode ends after two steps: the second piece starts at 0
        let pieces = [Piece { state: Some(&start), steps: 2 }, Piece { state: None, steps: 3 }];
        let input = DMatrix::from_fn(2, 5, |i, k| (1.3 * (i + 2 * k) as f32).sin());
        let trace = network.forward(input.clone(), pieces);
        let found = network.gradients(&trace, trace.output().clone());
        let known = network.to_vec();
        assert_eq!((found.len(), known.len()), (network.parameters(), 3 * 3 * (2 + 3 + 2) + 4 * 4 + 5));
        for index in 0..known.len() {
            let mut loss = |step: f32| {
                let mut parameters = known.clone();
                parameters[index] += step;
                network.set(&parameters);
                let trace = network.forward(input.clone(), pieces);
                trace.output().iter().map(|y| 0.5 * f64::from(*y).powi(2)).sum::<f64>()
            };
            let slope = (loss(1e-2) - loss(-1e-2)) / 2e-2;
            assert!((slope - f64::from(found[index])).abs() < 2e-3, "{index}: {slope} {}", found[index]);
        }
    }

    #[test]
    fn pieces_match_single_steps_with_resets_at_episode_ends() {
        let network =
            Network::random(&Encoding::default(), (2, 3, 1), &[4], 1.0, &mut Pcg64::seed_from_u64(2));
        let input = DMatrix::from_fn(2, 5, |i, k| (1.7 * (i + 2 * k) as f32).cos());
        let whole = network
            .forward(input.clone(), [Piece { state: None, steps: 2 }, Piece { state: None, steps: 3 }]);
        let mut state = vec![0.0; 3];
        for (k, column) in input.column_iter().enumerate() {
            if k == 2 {
                state.fill(0.0);
            }
            let step =
                network.forward(DMatrix::from_column_slice(2, 1, column.as_slice()), single_steps(&state, 3));
            assert_eq!(step.output()[0], whole.output()[k], "step {k}");
            state = step.states().to_vec();
        }
    }
}
