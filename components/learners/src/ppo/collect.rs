//! Steps of all worlds between two updates.

use motorium_physics::Engine;
use nalgebra::DMatrix;
use rand_distr::{Distribution as _, StandardNormal};

use super::Ppo;
use super::network::{Trace, single_steps};
use super::rollout::Spread;
use crate::environment::EnvironmentError;
use crate::random::{Counter, Purpose};

/// Bound of normalised rewards, as CleanRL's.
const REWARD_CLIP: f64 = 10.0;

impl<E: Engine + Send> Ppo<E> {
    /// Steps all worlds through a horizon, or each through an episode.
    pub(super) fn collect(&mut self) -> Result<(), EnvironmentError> {
        let (worlds, horizon) = (self.settings.worlds, self.settings.horizon);
        let (inputs, width) = (self.worlds.terms().inputs(), self.worlds.terms().actions());
        let discount = self.settings.discount;
        let units = self.settings.recurrent;
        self.worlds.set_level(self.worlds.terms().level(self.state.steps));
        let spread = Spread::new(&self.deviations, &self.active);
        let [mut values, mut means] = [Trace::default(), Trace::default()];
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
            // observations join the statistics before these normalise them, from the first step on, as in
            // Stable-Baselines3's `VecNormalize`
            let rows = self.worlds.observations().chunks_exact(inputs).zip(&live);
            rows.filter(|(_, live)| **live).for_each(|(row, _)| self.state.observations.update(row));
            self.state.observations.apply(self.worlds.observations(), observations);
            if units > 0 && step % self.rollout.unroll == 0 {
                let first = step / self.rollout.unroll * worlds * units;
                for (stored, states) in self.rollout.states.iter_mut().zip(&self.memories) {
                    stored[first..first + worlds * units].copy_from_slice(states);
                }
            }
            let input = (inputs, &*observations);
            self.value.run(&mut values, input, single_steps(&self.memories[1], units));
            self.rollout.values[samples.clone()].copy_from_slice(values.output().as_slice());
            self.policy.run(&mut means, input, single_steps(&self.memories[0], units));
            self.memories[0].copy_from_slice(means.states());
            self.memories[1].copy_from_slice(values.states());
            let actions = &mut self.rollout.actions[samples.start * width..samples.end * width];
            let rows = actions.chunks_exact_mut(width).zip(means.output().as_slice().chunks_exact(width));
            for (world, (action, mean)) in rows.enumerate() {
                let counter = Counter {
                    seed: self.state.seed,
                    world: world as u64,
                    episode: self.state.updates,
                    step: step as u64,
                };
                let mut random = counter.stream(Purpose::Action);
                for ((action, mean), deviation) in action.iter_mut().zip(mean).zip(&spread.deviations) {
                    let noise: f32 = StandardNormal.sample(&mut random);
                    *action = mean + deviation * noise;
                }
                self.rollout.log_probabilities[samples.start + world] = spread.log_density(action, mean);
            }
            self.worlds.step(actions)?;
            // values after the step: first of final observations, then of the next step
            last.fill(0.0);
            for world in 0..worlds {
                if let Some(observation) = self.worlds.final_observation(world) {
                    self.state.observations.apply(observation, last.column_mut(world).as_mut_slice());
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
            // returns join theirs before these normalise the rewards
            for ((result, live), discounted) in
                self.worlds.steps().iter().zip(&live).zip(&mut self.state.discounted)
            {
                if *live {
                    *discounted = *discounted * discount + result.reward;
                    self.state.returns.update(&[*discounted as f32]);
                }
            }
            let deviation = self.state.returns.deviation(0);
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
                self.rollout.rewards[k] = (result.reward / deviation).clamp(-REWARD_CLIP, REWARD_CLIP) as f32;
                // the value of the next observation follows below
                if let (Some(end), Some(finals)) = (result.end, &finals)
                    && !end.is_terminal()
                    && !self.variant.uses_episodes
                {
                    self.rollout.next_values[k] = finals.output()[world];
                }
                if result.end.is_some() {
                    self.state.discounted[world] = 0.0;
                    live[world] = !self.variant.uses_episodes;
                }
            }
        }
        let mut next = vec![0.0; worlds * inputs];
        self.state.observations.apply(self.worlds.observations(), &mut next);
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
        self.rollout.estimate(worlds, discount as f32, self.settings.lambda as f32);
        Ok(())
    }
}
