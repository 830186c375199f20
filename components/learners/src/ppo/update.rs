//! Gradients and the optimiser.

use motorium_physics::Engine;
use nalgebra::DMatrix;
use rand::seq::SliceRandom as _;

use super::Ppo;
use super::network::Network;
use super::rollout::Spread;
use crate::learner::{CHUNK, LearnerError, check_finite, map_chunks};
use crate::random::{Counter, Purpose};

/// Averages over an update.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Losses {
    pub(super) policy: f64,
    pub(super) value: f64,
    pub(super) entropy: f64,
    pub(super) divergence: f64,
    pub(super) rate: f64,
}

/// Gradient and losses of a chunk, summed over its samples.
#[derive(Clone, Debug, Default)]
struct Part {
    policy: Vec<f32>,
    value: Vec<f32>,
    deviations: Vec<f32>,
    losses: Losses,
}

impl<E: Engine + Send> Ppo<E> {
    /// Updates the networks by the steps of the rollout.
    pub(super) fn update(&mut self) -> Result<Losses, LearnerError> {
        let mut order = self.rollout.firsts();
        let samples = self.rollout.used.len();
        let (epochs, minibatch) = (self.settings.epochs, self.settings.minibatch.min(samples));
        let sequences = (minibatch / self.rollout.unroll).max(1);
        if self.settings.anneal && self.settings.target_kl.is_none() {
            let done = (self.state.steps - samples as u64) as f64 / self.settings.steps as f64;
            self.state.rate = self.settings.rate * (1.0 - done).max(0.0);
        }
        let mut total = Losses { rate: self.state.rate, ..Losses::default() };
        let mut batches = 0.0;
        for epoch in 0..epochs {
            let counter =
                Counter { seed: self.state.seed, world: 0, episode: self.state.updates, step: epoch as u64 };
            order.shuffle(&mut counter.stream(Purpose::Shuffle));
            for firsts in order.chunks(sequences) {
                let batch = self.rollout.sequences(firsts);
                if batch.len() < 2 {
                    continue;
                }
                let losses = self.minibatch(&batch)?;
                total.policy += losses.policy;
                total.value += losses.value;
                total.entropy += losses.entropy;
                total.divergence += losses.divergence;
                batches += 1.0;
            }
        }
        for value in [&mut total.policy, &mut total.value, &mut total.entropy, &mut total.divergence] {
            *value /= f64::max(batches, 1.0);
        }
        if let Some(target) = self.settings.target_kl {
            if total.divergence > 2.0 * target {
                self.state.rate = (self.state.rate / 1.5).max(1e-5);
            } else if total.divergence < 0.5 * target {
                self.state.rate = (self.state.rate * 1.5).min(1e-2);
            }
        }
        Ok(total)
    }

    /// One step of the optimiser on some samples.
    fn minibatch(&mut self, batch: &[usize]) -> Result<Losses, LearnerError> {
        let count = batch.len() as f64;
        let advantages = || batch.iter().map(|k| f64::from(self.rollout.advantages[*k]));
        let mean = advantages().sum::<f64>() / count;
        let deviation = (advantages().map(|a| (a - mean).powi(2)).sum::<f64>() / (count - 1.0)).sqrt();
        let normal =
            if self.variant.is_normalised { (mean as f32, (deviation + 1e-8) as f32) } else { (0.0, 1.0) };
        // whole sequences
        let chunk = (CHUNK / self.rollout.unroll).max(1) * self.rollout.unroll;
        let chunks: Vec<&[usize]> = batch.chunks(chunk).collect();
        let shared = self.shared();
        let parts = map_chunks(self.threads, &chunks, |chunk| shared.part(chunk, batch.len(), normal));
        let mut parts = parts.into_iter();
        let Some(mut sum) = parts.next() else { return Ok(Losses::default()) };
        for part in parts {
            for (sum, part) in [
                (&mut sum.policy, &part.policy),
                (&mut sum.value, &part.value),
                (&mut sum.deviations, &part.deviations),
            ] {
                sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
            }
            sum.losses.policy += part.losses.policy;
            sum.losses.value += part.losses.value;
            sum.losses.divergence += part.losses.divergence;
        }
        let entropy = |(deviation, active): (&f32, &bool)| {
            if *active { f64::from(*deviation) + 0.5 * (1.0 + core::f64::consts::TAU.ln()) } else { 0.0 }
        };
        sum.losses.entropy = self.deviations.iter().zip(&self.active).map(entropy).sum();
        for (gradient, active) in sum.deviations.iter_mut().zip(&self.active) {
            if *active {
                *gradient -= self.settings.entropy as f32;
            }
        }
        for (term, value) in [
            ("loss of the policy", sum.losses.policy),
            ("loss of the value", sum.losses.value),
            ("entropy", sum.losses.entropy),
        ] {
            check_finite(self.state.updates, term, value)?;
        }
        let all = || sum.policy.iter().chain(&sum.value).chain(&sum.deviations);
        let norm = all().map(|g| f64::from(*g).powi(2)).sum::<f64>().sqrt();
        check_finite(self.state.updates, "norm of the gradient", norm)?;
        let factor = (self.settings.gradient / (norm + 1e-6)).min(1.0) as f32;
        for gradient in [&mut sum.policy, &mut sum.value, &mut sum.deviations] {
            gradient.iter_mut().for_each(|g| *g *= factor);
        }
        let (mut policy, mut value) = (self.policy.to_vec(), self.value.to_vec());
        self.adam.step(
            [&mut policy[..], &mut value[..], &mut self.deviations[..]],
            [&sum.policy[..], &sum.value[..], &sum.deviations[..]],
            self.state.rate as f32,
            0.0,
        );
        self.policy.set(&policy);
        self.value.set(&value);
        Ok(sum.losses)
    }

    fn shared(&self) -> Shared<'_> {
        Shared {
            policy: &self.policy,
            value: &self.value,
            spread: Spread::new(&self.deviations, &self.active),
            rollout: &self.rollout,
            clip: self.settings.clip as f32,
            weight: self.settings.value as f32,
        }
    }
}

/// All that the gradient of a chunk depends on.
struct Shared<'a> {
    policy: &'a Network,
    value: &'a Network,
    spread: Spread,
    rollout: &'a super::Rollout,
    clip: f32,
    weight: f32,
}

impl Shared<'_> {
    /// Gradient and losses of some samples of a minibatch of `count`, with the mean and deviation of its
    /// advantages.
    fn part(&self, chunk: &[usize], count: usize, (center, deviation): (f32, f32)) -> Part {
        let (size, samples) = (chunk.len(), self.rollout.returns.len());
        let inputs = self.rollout.observations.len() / samples;
        let width = self.spread.deviations.len();
        let share = 1.0 / count as f32;
        let mut input = DMatrix::zeros(inputs, size);
        for (mut column, k) in input.column_iter_mut().zip(chunk) {
            column.copy_from_slice(&self.rollout.observations[k * inputs..][..inputs]);
        }
        let value = self.value.forward(input.clone(), self.rollout.pieces(chunk, 1));
        let policy = self.policy.forward(input, self.rollout.pieces(chunk, 0));
        let mut by_mean = DMatrix::zeros(width, size);
        let mut by_value = DMatrix::zeros(1, size);
        let mut part = Part { deviations: vec![0.0; width], ..Part::default() };
        for (column, k) in chunk.iter().enumerate() {
            let action = &self.rollout.actions[k * width..][..width];
            let mean = &policy.output().as_slice()[column * width..][..width];
            let change = self.spread.log_density(action, mean) - self.rollout.log_probabilities[*k];
            let ratio = change.exp();
            let advantage = (self.rollout.advantages[*k] - center) / deviation;
            let clipped = ratio.clamp(1.0 - self.clip, 1.0 + self.clip);
            let loss = (-advantage * ratio).max(-advantage * clipped);
            // beyond the clip only changes that make the loss larger have a slope
            let slope =
                if -advantage * ratio >= -advantage * clipped { -advantage * ratio * share } else { 0.0 };
            let by_mean = &mut by_mean.as_mut_slice()[column * width..][..width];
            self.spread.slopes((action, mean), slope, by_mean, &mut part.deviations);
            let error = value.output()[column] - self.rollout.returns[*k];
            by_value[column] = self.weight * error * share;
            part.losses.policy += f64::from(loss * share);
            part.losses.value += f64::from(error * error * share);
            part.losses.divergence += f64::from((ratio - 1.0 - change) * share);
        }
        part.policy = self.policy.gradients(&policy, by_mean);
        part.value = self.value.gradients(&value, by_value);
        part
    }
}
