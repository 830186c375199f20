//! Networks with their optimisers and targets.

use motorium_models::networks::differentiable::Function;
use motorium_models::networks::{Adam, Perceptron};
use nalgebra::DMatrix;

use crate::learner::{CheckpointError, CheckpointReader, CheckpointWriter, Encoding};
use crate::random::{Counter, Purpose};

/// Moves a target towards a network: `target + share (network - target)` for each parameter (Polyak
/// averaging).
pub(crate) fn track(target: &mut Perceptron, network: &Perceptron, share: f32) {
    let mut moved = target.to_vec();
    moved.iter_mut().zip(network.to_vec()).for_each(|(target, value)| *target += share * (value - *target));
    target.set(&moved);
}

/// Sums the parts of a gradient in order.
pub(crate) fn sum(parts: impl Iterator<Item = Vec<f32>>) -> Vec<f32> {
    let add = |mut sum: Vec<f32>, part: Vec<f32>| {
        sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
        sum
    };
    parts.reduce(add).unwrap_or_default()
}

/// A network and its optimiser.
#[derive(Clone, Debug)]
pub(crate) struct Trained {
    pub(crate) network: Perceptron,
    adam: Adam,
}

impl Trained {
    /// Creates a network with random weights, which depend only on the seed and the number of the network.
    pub(crate) fn new(encoding: &Encoding, sizes: &[usize], gain: f32, seed: u64, number: u64) -> Self {
        let mut random = Counter { seed, step: number, ..Counter::default() }.stream(Purpose::Weights);
        let network = encoding.network(sizes, gain, &mut random);
        let adam = Adam::new(&[network.parameters()]);
        Self { network, adam }
    }

    /// Performs a step of Adam.
    pub(crate) fn step(&mut self, gradient: &[f32], rate: f64) {
        let mut parameters = self.network.to_vec();
        self.adam.step([&mut parameters[..]], [gradient], rate as f32, 0.0);
        self.network.set(&parameters);
    }

    pub(crate) fn write(&self, name: &str, writer: &mut CheckpointWriter) -> Result<(), CheckpointError> {
        writer.numbers(name, self.network.to_vec());
        writer.optimiser(&format!("{name}.adam_steps"), &[name], &self.adam)
    }

    pub(crate) fn read(&mut self, name: &str, reader: &mut CheckpointReader) -> Result<(), CheckpointError> {
        reader.network(name, &mut self.network)?;
        self.adam = reader.optimiser(&format!("{name}.adam_steps"), &[(name, self.network.parameters())])?;
        Ok(())
    }
}

/// Returns the input of a critic: observations above actions, one sample per column.
pub(crate) fn stack(observations: &DMatrix<f32>, actions: &DMatrix<f32>) -> DMatrix<f32> {
    let (inputs, width) = (observations.nrows(), actions.nrows());
    let mut stacked = DMatrix::<f32>::zeros(inputs + width, observations.ncols());
    stacked.rows_mut(0, inputs).copy_from(observations);
    stacked.rows_mut(inputs, width).copy_from(actions);
    stacked
}

/// Critics `Q_i(o, a)` and their targets `Q'_i`.
#[derive(Clone, Debug)]
pub(crate) struct Critics {
    critics: Vec<Trained>,
    targets: Vec<Perceptron>,
}

/// Gradients of some samples of a batch.
#[derive(Clone, Debug, Default)]
pub(crate) struct CriticPart {
    /// Gradient of each critic.
    pub(crate) gradients: Vec<Vec<f32>>,
    /// Contribution to the mean squared error and to the mean value.
    pub(crate) loss: f64,
    pub(crate) value: f64,
}

impl Critics {
    /// Creates critics with random weights and ReLU between layers, because `tanh` saturates at values much
    /// larger than 1. The networks are numbered from 1.
    pub(crate) fn new(count: usize, encoding: &Encoding, sizes: &[usize], seed: u64) -> Self {
        let critic = |number: u64| {
            let Trained { network, adam } = Trained::new(encoding, sizes, 1.0, seed, number);
            Trained { network: network.with_function(Function::Relu), adam }
        };
        let critics: Vec<Trained> = (1..=count as u64).map(critic).collect();
        let targets = critics.iter().map(|critic| critic.network.clone()).collect();
        Self { critics, targets }
    }

    /// Returns the minimum over the target networks for each column.
    pub(crate) fn target_values(&self, input: &DMatrix<f32>) -> Vec<f32> {
        let mut smallest = vec![f32::INFINITY; input.ncols()];
        for target in &self.targets {
            let trace = target.forward(input.clone());
            smallest
                .iter_mut()
                .zip(trace.output().iter())
                .for_each(|(least, q)| *least = smaller(*least, *q));
        }
        smallest
    }

    /// Returns the gradients of `1/2 E[(Q_i - y)^2]` for some samples of a batch of `count`.
    pub(crate) fn part(&self, input: &DMatrix<f32>, targets: &[f32], count: usize) -> CriticPart {
        let share = 1.0 / count as f32;
        let mut part = CriticPart::default();
        let critics = self.critics.len() as f64;
        for critic in &self.critics {
            let trace = critic.network.forward(input.clone());
            let mut errors = trace.output().clone();
            errors.iter_mut().zip(targets).for_each(|(q, target)| *q -= target);
            part.loss += errors.iter().map(|e| f64::from(e * e * share)).sum::<f64>() / critics;
            part.value += trace.output().iter().map(|q| f64::from(q * share)).sum::<f64>() / critics;
            part.gradients.push(critic.network.gradients(&trace, errors * share));
        }
        part
    }

    /// Returns the minimum over the first critics for each column, and its gradient with respect to the
    /// action, the last `width` inputs.
    pub(crate) fn action_gradients(
        &self,
        input: &DMatrix<f32>,
        critics: usize,
        width: usize,
    ) -> (Vec<f32>, DMatrix<f32>) {
        let used = || self.critics.iter().take(critics);
        let traces: Vec<_> = used().map(|critic| critic.network.forward(input.clone())).collect();
        let columns = input.ncols();
        let mut smallest = vec![(f32::INFINITY, 0); columns];
        for (k, trace) in traces.iter().enumerate() {
            for (least, q) in smallest.iter_mut().zip(trace.output().iter()) {
                // NaN must reach the loss
                if *q < least.0 || q.is_nan() {
                    *least = (*q, k);
                }
            }
        }
        let mut gradient = DMatrix::<f32>::zeros(width, columns);
        for (k, (critic, trace)) in used().zip(&traces).enumerate() {
            let mut output = DMatrix::<f32>::zeros(1, columns);
            output.iter_mut().zip(&smallest).for_each(|(g, least)| *g = f32::from(least.1 == k));
            gradient += critic.network.last_input_gradients(trace, output, width);
        }
        (smallest.into_iter().map(|(q, _)| q).collect(), gradient)
    }

    /// Performs a step of Adam with the sum of the parts of a batch.
    pub(crate) fn step(&mut self, parts: &[CriticPart], rate: f64) {
        for (k, critic) in self.critics.iter_mut().enumerate() {
            critic.step(&sum(parts.iter().map(|part| part.gradients[k].clone())), rate);
        }
    }

    /// Moves the targets towards the critics.
    pub(crate) fn track(&mut self, share: f64) {
        for (target, critic) in self.targets.iter_mut().zip(&self.critics) {
            track(target, &critic.network, share as f32);
        }
    }

    /// Returns all parameters of critics and targets.
    pub(crate) fn parameters(&self) -> Vec<Vec<f32>> {
        let critics = self.critics.iter().map(|critic| critic.network.to_vec());
        critics.chain(self.targets.iter().map(Perceptron::to_vec)).collect()
    }

    pub(crate) fn write(&self, writer: &mut CheckpointWriter) -> Result<(), CheckpointError> {
        for (k, (critic, target)) in self.critics.iter().zip(&self.targets).enumerate() {
            critic.write(&format!("critic.{k}"), writer)?;
            writer.numbers(format!("critic.{k}.target"), target.to_vec());
        }
        Ok(())
    }

    pub(crate) fn read(&mut self, reader: &mut CheckpointReader) -> Result<(), CheckpointError> {
        for (k, (critic, target)) in self.critics.iter_mut().zip(&mut self.targets).enumerate() {
            critic.read(&format!("critic.{k}"), reader)?;
            reader.network(&format!("critic.{k}.target"), target)?;
        }
        Ok(())
    }
}

/// Returns the smaller of two values, or NaN if either is NaN.
fn smaller(a: f32, b: f32) -> f32 {
    if a < b || a.is_nan() { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_approach_a_network_geometrically() {
        let network = Trained::new(&Encoding::default(), &[2, 3, 1], 1.0, 1, 0).network;
        let start = Trained::new(&Encoding::default(), &[2, 3, 1], 1.0, 2, 0).network;
        let mut target = start.clone();
        for _ in 0..10 {
            track(&mut target, &network, 0.1);
        }
        let kept = 0.9_f32.powi(10);
        for ((found, value), first) in target.to_vec().iter().zip(network.to_vec()).zip(start.to_vec()) {
            let expected = value + kept * (first - value);
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
    }

    #[test]
    fn action_gradients_match_finite_differences() {
        let critics = Critics::new(2, &Encoding::default(), &[5, 8, 1], 3);
        let input = DMatrix::from_fn(5, 6, |i, k| (0.9 * (i + 5 * k) as f32).sin());
        let (_, found) = critics.action_gradients(&input, 2, 2);
        for column in 0..6 {
            for row in 0..2 {
                let value = |step: f32| {
                    let mut moved = input.clone();
                    moved[(3 + row, column)] += step;
                    f64::from(critics.action_gradients(&moved, 2, 2).0[column])
                };
                let slope = (value(1e-2) - value(-1e-2)) / 2e-2;
                let gradient = f64::from(found[(row, column)]);
                assert!((slope - gradient).abs() < 2e-3, "{row} {column}: {slope} {gradient}");
            }
        }
    }

    #[test]
    fn smaller_value_propagates_nan() {
        assert_eq!((smaller(1.0, 2.0), smaller(3.0, 2.0)), (1.0, 2.0));
        assert!(smaller(f32::NAN, 1.0).is_nan() && smaller(1.0, f32::NAN).is_nan());
    }
}
