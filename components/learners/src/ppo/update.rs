//! Gradients of the loss, and steps of the optimiser.

use motorium_physics::Engine;
use rand::seq::SliceRandom as _;

use super::Ppo;
use super::distribution::{Distribution, Slopes};
use super::network::Network;
use super::part::{Losses, Part, Passes};
use crate::learner::{CHUNK, LearnerError, Phase, check_finite, for_chunks};
use crate::random::{Counter, Purpose};

/// Number of gradient entries that a thread sums at a time.
const RANGE: usize = 8192;

impl<E: Engine + Send> Ppo<E> {
    /// Updates the networks from the steps of the rollout.
    pub(super) fn update(&mut self) -> Result<Losses, LearnerError> {
        let mut order = self.rollout.firsts();
        let used = self.rollout.used.len();
        let samples = if self.settings.mirror { used / 2 } else { used };
        let (epochs, minibatch) = (self.settings.epochs, self.settings.minibatch.min(used));
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

    /// Performs one optimiser step on a minibatch.
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
        let (mut parts, mut passes) = core::mem::take(&mut self.memory);
        passes.resize_with(self.worlds.threads(), Passes::default);
        parts.resize_with(parts.len().max(chunks.len()), Part::default);
        let shared = Shared {
            policy: &self.policy,
            value: &self.value,
            distribution: self.distribution(),
            deviations: self.deviations.len(),
            rollout: &self.rollout,
            clip: self.settings.clip as f32,
            weight: self.settings.value as f32,
            entropy: self.settings.entropy as f32,
        };
        let run = |work: &(dyn Fn(usize) + Sync)| self.worlds.on_threads(work);
        for_chunks(run, &mut passes, &chunks, &mut parts, |chunk, part, passes| {
            shared.part(chunk, (batch.len(), normal), (part, passes));
        });
        let Some((sum, others)) = parts[..chunks.len()].split_first_mut() else {
            return Ok(Losses::default());
        };
        let run = |work: &(dyn Fn(usize) + Sync)| self.worlds.on_threads(work);
        add_parts(run, passes.len(), sum, others);
        self.watch.lap(Phase::Gradient);
        let entropy = |(deviation, active): (&f32, &bool)| {
            if *active { f64::from(*deviation) + 0.5 * (1.0 + core::f64::consts::TAU.ln()) } else { 0.0 }
        };
        // the entropy of choices is the mean over the samples
        sum.losses.entropy += self.deviations.iter().zip(&self.active).map(entropy).sum::<f64>();
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
        let norm =
            [&sum.policy, &sum.value, &sum.deviations].map(|part| squares(part)).iter().sum::<f64>().sqrt();
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
        let losses = sum.losses;
        self.memory = (parts, passes);
        self.watch.lap(Phase::Optimiser);
        Ok(losses)
    }
}

/// Adds the parts of a gradient to the first part, in order.
fn add_parts(run: impl FnOnce(&(dyn Fn(usize) + Sync)), threads: usize, sum: &mut Part, others: &[Part]) {
    let add = |sum: &mut [f32], part: &[f32]| sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
    for part in others {
        add(&mut sum.deviations, &part.deviations);
        sum.losses.policy += part.losses.policy;
        sum.losses.value += part.losses.value;
        sum.losses.divergence += part.losses.divergence;
        sum.losses.entropy += part.losses.entropy;
    }
    // each thread adds all parts of some entries
    let firsts = |gradient: &[f32]| (0..gradient.len()).step_by(RANGE);
    let of_policy = firsts(&sum.policy).map(|first| (true, first));
    let ranges: Vec<_> = of_policy.chain(firsts(&sum.value).map(|first| (false, first))).collect();
    let mut sums: Vec<_> = sum.policy.chunks_mut(RANGE).chain(sum.value.chunks_mut(RANGE)).collect();
    for_chunks(run, &mut vec![(); threads], &ranges, &mut sums, |(is_policy, first), sum, ()| {
        for part in others {
            add(sum, &(if *is_policy { &part.policy } else { &part.value })[*first..]);
        }
    });
}

/// Returns the sum of squares, computed in eight sums that vectorise.
fn squares(numbers: &[f32]) -> f64 {
    let mut sums = [0.0; 8];
    let (chunks, rest) = numbers.as_chunks::<8>();
    for chunk in chunks {
        sums.iter_mut().zip(chunk).for_each(|(sum, x)| *sum += f64::from(*x) * f64::from(*x));
    }
    sums.iter().sum::<f64>() + rest.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>()
}

/// Inputs of the gradient of a chunk.
struct Shared<'a> {
    policy: &'a Network,
    value: &'a Network,
    distribution: Distribution,
    /// Number of deviations.
    deviations: usize,
    rollout: &'a super::Rollout,
    clip: f32,
    weight: f32,
    /// Weight of the entropy.
    entropy: f32,
}

impl Shared<'_> {
    /// Writes the gradient and losses of a chunk of a minibatch with `count` samples, given the mean and
    /// standard deviation of its advantages.
    fn part(
        &self,
        chunk: &[usize],
        (count, (center, deviation)): (usize, (f32, f32)),
        (part, passes): (&mut Part, &mut Passes),
    ) {
        let rollout = self.rollout;
        let inputs = rollout.observations.len() / rollout.returns.len();
        let width = rollout.actions.len() / rollout.returns.len();
        let share = 1.0 / count as f32;
        let Part { policy, value, deviations, losses } = part;
        let Passes { input, policy: policy_trace, value: value_trace } = passes;
        *losses = Losses::default();
        deviations.clear();
        deviations.resize(self.deviations, 0.0);
        input.clear();
        chunk.iter().for_each(|k| input.extend_from_slice(&rollout.observations[k * inputs..][..inputs]));
        self.policy.run(policy_trace, (inputs, input), rollout.pieces(chunk, 0));
        self.value.run(value_trace, (inputs, input), rollout.pieces(chunk, 1));
        let by_outputs = |outputs: &[f32], by_outputs: &mut [f32]| {
            let count = outputs.len() / chunk.len();
            let rows = outputs.chunks_exact(count).zip(by_outputs.chunks_exact_mut(count));
            for (k, (output, by_output)) in chunk.iter().zip(rows) {
                let action = &rollout.actions[k * width..][..width];
                let change = self.distribution.log_density(action, output) - rollout.log_probabilities[*k];
                let ratio = change.exp();
                let advantage = (rollout.advantages[*k] - center) / deviation;
                let clipped = ratio.clamp(1.0 - self.clip, 1.0 + self.clip);
                let loss = (-advantage * ratio).max(-advantage * clipped);
                // beyond the clip range, only changes that increase the loss have a gradient
                let slope =
                    if -advantage * ratio >= -advantage * clipped { -advantage * ratio * share } else { 0.0 };
                let slopes = Slopes { by_output: &mut *by_output, by_deviation: &mut *deviations };
                self.distribution.slopes((action, output), slope, slopes);
                let entropy = self.distribution.add_entropy(output, -self.entropy * share, by_output);
                losses.entropy += f64::from(entropy * share);
                losses.policy += f64::from(loss * share);
                losses.divergence += f64::from((ratio - 1.0 - change) * share);
            }
        };
        self.policy.write_gradients(policy_trace, by_outputs, policy);
        let by_values = |values: &[f32], by_values: &mut [f32]| {
            for ((k, found), by_value) in chunk.iter().zip(values).zip(by_values) {
                let error = found - rollout.returns[*k];
                *by_value = self.weight * error * share;
                losses.value += f64::from(error * error * share);
            }
        };
        self.value.write_gradients(value_trace, by_values, value);
    }
}
