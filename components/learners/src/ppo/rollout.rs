//! Steps of all worlds between two updates.

use motorium_physics::Engine;
use nalgebra::DMatrix;
use rand_distr::{Distribution as _, StandardNormal};

use super::Ppo;
use super::network::{Piece, single_steps};
use crate::environment::EnvironmentError;
use crate::random::{Counter, Purpose};

/// Bound of normalised rewards, as CleanRL's.
const REWARD_CLIP: f64 = 10.0;

/// Steps of all worlds, step by step, world by world.
#[derive(Clone, Debug)]
pub(super) struct Rollout {
    /// Normalised observations.
    pub(super) observations: Vec<f32>,
    pub(super) actions: Vec<f32>,
    /// Logarithm of the probability density of each action.
    pub(super) log_probabilities: Vec<f32>,
    pub(super) values: Vec<f32>,
    pub(super) advantages: Vec<f32>,
    pub(super) returns: Vec<f32>,
    /// Samples that an update uses.
    pub(super) used: Vec<usize>,
    pub(super) worlds: usize,
    /// Consecutive steps of a world through which a gradient is propagated; 1 without a memory.
    pub(super) unroll: usize,
    units: usize,
    /// Recurrent states of policy and value before each sequence of `unroll` steps, world after world.
    pub(super) states: [Vec<f32>; 2],
    rewards: Vec<f32>,
    /// Value after the step: 0 where the episode terminated, of the final observation where it was truncated.
    next_values: Vec<f32>,
    ended: Vec<bool>,
}

impl Rollout {
    pub(super) fn new(horizon: usize, worlds: usize, inputs: usize, actions: usize) -> Self {
        let samples = horizon * worlds;
        let zeros = || vec![0.0; samples];
        Self {
            observations: vec![0.0; samples * inputs],
            actions: vec![0.0; samples * actions],
            log_probabilities: zeros(),
            values: zeros(),
            advantages: zeros(),
            returns: zeros(),
            used: Vec::with_capacity(samples),
            worlds,
            unroll: 1,
            units: 0,
            states: [vec![], vec![]],
            rewards: zeros(),
            next_values: zeros(),
            ended: vec![false; samples],
        }
    }

    /// Adds states of recurrent units before each sequence of `unroll` steps.
    pub(super) fn with_memory(self, unroll: usize, units: usize) -> Self {
        let states = vec![0.0; self.ended.len() / unroll * units];
        Self { unroll, units, states: [states.clone(), states], ..self }
    }

    /// First samples of all sequences.
    pub(super) fn firsts(&self) -> Vec<usize> {
        self.used.iter().copied().filter(|k| (k / self.worlds).is_multiple_of(self.unroll)).collect()
    }

    /// All samples of sequences, from their first samples.
    pub(super) fn sequences(&self, firsts: &[usize]) -> Vec<usize> {
        firsts.iter().flat_map(|first| (0..self.unroll).map(move |step| first + step * self.worlds)).collect()
    }

    /// Pieces of episodes in whole sequences, for the states of the policy (0) or of the value (1). Empty
    /// without a memory.
    pub(super) fn pieces(&self, samples: &[usize], network: usize) -> Vec<Piece<'_>> {
        let mut pieces = Vec::new();
        if self.units == 0 {
            return pieces;
        }
        for sequence in samples.chunks_exact(self.unroll) {
            let row = sequence[0] / self.worlds / self.unroll * self.worlds + sequence[0] % self.worlds;
            let mut state = Some(&self.states[network][row * self.units..][..self.units]);
            for piece in sequence.split_inclusive(|k| self.ended[*k]) {
                pieces.push(Piece { state: state.take(), steps: piece.len() });
            }
        }
        pieces
    }

    /// Sets rewards, values, values after each step, and ends.
    #[cfg(test)]
    pub(super) fn set_rewards(&mut self, rewards: &[f32], values: &[f32], next: &[f32], ended: &[bool]) {
        self.rewards.copy_from_slice(rewards);
        self.values.copy_from_slice(values);
        self.next_values.copy_from_slice(next);
        self.ended.copy_from_slice(ended);
    }

    /// Advantages and returns by the generalised advantage estimate.
    pub(super) fn estimate(&mut self, worlds: usize, discount: f32, lambda: f32) {
        let horizon = self.rewards.len() / worlds;
        for world in 0..worlds {
            let mut advantage = 0.0;
            for step in (0..horizon).rev() {
                let k = step * worlds + world;
                let difference = self.rewards[k] + discount * self.next_values[k] - self.values[k];
                let kept = if self.ended[k] { 0.0 } else { discount * lambda };
                advantage = difference + kept * advantage;
                self.advantages[k] = advantage;
                self.returns[k] = advantage + self.values[k];
            }
        }
    }
}

/// Logarithm of the density of an action, from its differences to the mean.
pub(super) fn log_density(away: impl Iterator<Item = (f32, f32, bool)>) -> f32 {
    const HALF_LN_TAU: f32 = 0.918_938_5;
    away.filter(|(.., active)| *active)
        .map(|(away, deviation, _)| {
            let scaled = away * (-deviation).exp();
            -0.5 * scaled * scaled - deviation - HALF_LN_TAU
        })
        .sum()
}

impl<E: Engine + Send> Ppo<E> {
    /// Steps all worlds through a horizon, or each through an episode.
    pub(super) fn collect(&mut self) -> Result<(), EnvironmentError> {
        let (worlds, horizon) = (self.settings.worlds, self.settings.horizon);
        let (inputs, width) = (self.worlds.terms().inputs(), self.worlds.terms().actions());
        let discount = self.settings.discount;
        let units = self.settings.recurrent;
        self.worlds.set_level(self.worlds.terms().level(self.state.steps));
        // the statistics that normalise stay the same for a whole horizon; raw observations join them
        // afterwards
        let normaliser = self.state.observations.clone();
        let mut raw = Vec::with_capacity(horizon * worlds * inputs);
        let mut last = DMatrix::zeros(inputs, worlds);
        // worlds whose steps count
        let mut live = vec![true; worlds];
        self.rollout.used.clear();
        for step in 0..horizon {
            if !live.contains(&true) {
                break;
            }
            let samples = step * worlds..(step + 1) * worlds;
            let observations = &mut self.rollout.observations[samples.start * inputs..samples.end * inputs];
            normaliser.apply(self.worlds.observations(), observations);
            let rows = self.worlds.observations().chunks_exact(inputs).zip(&live);
            raw.extend(rows.filter(|(_, live)| **live).flat_map(|(row, _)| row));
            let input = DMatrix::from_column_slice(inputs, worlds, observations);
            if units > 0 && step % self.rollout.unroll == 0 {
                let first = step / self.rollout.unroll * worlds * units;
                for (stored, states) in self.rollout.states.iter_mut().zip(&self.memories) {
                    stored[first..first + worlds * units].copy_from_slice(states);
                }
            }
            let values = self.value.forward(input.clone(), single_steps(&self.memories[1], units));
            self.rollout.values[samples.clone()].copy_from_slice(values.output().as_slice());
            let means = self.policy.forward(input, single_steps(&self.memories[0], units));
            self.memories[0].copy_from_slice(means.states());
            self.memories[1].copy_from_slice(values.states());
            let actions = &mut self.rollout.actions[samples.start * width..samples.end * width];
            for world in 0..worlds {
                let mean = means.output().column(world);
                let counter = Counter {
                    seed: self.state.seed,
                    world: world as u64,
                    episode: self.state.updates,
                    step: step as u64,
                };
                let mut random = counter.stream(Purpose::Action);
                let action = &mut actions[world * width..][..width];
                for (k, action) in action.iter_mut().enumerate() {
                    let noise: f32 = StandardNormal.sample(&mut random);
                    // an action without effect is not explored
                    let spread = if self.active[k] { self.deviations[k].exp() * noise } else { 0.0 };
                    *action = mean[k] + spread;
                }
                let away = action.iter().zip(mean.iter()).map(|(a, m)| a - m);
                let terms =
                    away.zip(&self.deviations).zip(&self.active).map(|((a, d), active)| (a, *d, *active));
                self.rollout.log_probabilities[samples.start + world] = log_density(terms);
            }
            self.worlds.step(actions)?;
            // values after the step: first of final observations, then of the next step
            last.fill(0.0);
            for world in 0..worlds {
                if let Some(observation) = self.worlds.final_observation(world) {
                    normaliser.apply(observation, last.column_mut(world).as_mut_slice());
                }
            }
            let is_any = self.worlds.steps().iter().any(|step| step.end.is_some());
            let finals =
                is_any.then(|| self.value.forward(last.clone(), single_steps(&self.memories[1], units)));
            for world in 0..worlds {
                if self.worlds.steps()[world].end.is_some() {
                    for states in &mut self.memories {
                        states[world * units..(world + 1) * units].fill(0.0);
                    }
                }
            }
            for (world, result) in self.worlds.steps().iter().enumerate() {
                let k = samples.start + world;
                self.rollout.ended[k] = result.end.is_some();
                self.rollout.next_values[k] = 0.0;
                if !live[world] {
                    continue;
                }
                self.rollout.used.push(k);
                self.state.steps += 1;
                self.state.episodes.record(world, result);
                let discounted = &mut self.state.discounted[world];
                *discounted = *discounted * discount + result.reward;
                self.state.returns.update(&[*discounted as f32]);
                let scaled = result.reward / self.state.returns.deviation(0);
                self.rollout.rewards[k] = scaled.clamp(-REWARD_CLIP, REWARD_CLIP) as f32;
                // the value of the next observation follows below
                if let (Some(end), Some(finals)) = (result.end, &finals)
                    && !end.is_terminal()
                    && !self.variant.uses_episodes
                {
                    self.rollout.next_values[k] = finals.output()[world];
                }
                if result.end.is_some() {
                    *discounted = 0.0;
                    live[world] = !self.variant.uses_episodes;
                }
            }
        }
        let mut next = vec![0.0; worlds * inputs];
        normaliser.apply(self.worlds.observations(), &mut next);
        let next = DMatrix::from_column_slice(inputs, worlds, &next);
        let next = self.value.forward(next, single_steps(&self.memories[1], units));
        for step in 0..horizon {
            for world in 0..worlds {
                let k = step * worlds + world;
                if !self.rollout.ended[k] {
                    let following = k + worlds;
                    self.rollout.next_values[k] = if step + 1 < horizon {
                        self.rollout.values[following]
                    } else {
                        next.output()[world]
                    };
                }
            }
        }
        if self.variant.uses_episodes {
            self.worlds.restart()?;
        }
        self.state.observations.update(&raw);
        self.rollout.estimate(worlds, discount as f32, self.settings.lambda as f32);
        Ok(())
    }
}
