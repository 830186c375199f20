//! Collection of steps between two updates.

use motorium_physics::Engine;
use nalgebra::DMatrix;

use super::Ppo;
use super::distribution::Distribution;
use super::network::{Network, Piece, single_steps};
use super::part::Passes;
use super::rollout::Rollout;
use crate::environment::EnvironmentError;
use crate::learner::{Phase, for_chunks};
use crate::random::{Counter, Purpose};

/// Limit of normalised rewards, as in CleanRL.
const REWARD_CLIP: f64 = 10.0;

/// Number of worlds whose actions a thread samples together: the number of rows that the matrix product
/// computes simultaneously.
const TILE: usize = 8;

/// Results of a step for some worlds, one world after the other.
struct Tile<'a> {
    values: &'a mut [f32],
    actions: &'a mut [f32],
    log_probabilities: &'a mut [f32],
    /// Recurrent states of policy and value.
    states: [&'a mut [f32]; 2],
}

/// The networks, and the distribution of actions around the policy's outputs.
struct Actor<'a> {
    policy: &'a Network,
    value: &'a Network,
    distribution: &'a Distribution,
    /// Seed, update and step of the samples.
    counter: Counter,
}

impl Actor<'_> {
    /// Computes values and samples actions for the observations of worlds from `first`.
    fn act(&self, first: usize, (inputs, input): (usize, &[f32]), tile: &mut Tile<'_>, passes: &mut Passes) {
        let Tile { values, actions, log_probabilities, states } = tile;
        let Passes { policy: means, value, .. } = passes;
        let (width, units) = (actions.len() / values.len(), states[0].len() / values.len());
        self.value.run(value, (inputs, input), single_steps(states[1], units));
        self.policy.run(means, (inputs, input), single_steps(states[0], units));
        values.copy_from_slice(value.output().as_slice());
        states[0].copy_from_slice(means.states());
        states[1].copy_from_slice(value.states());
        let outputs = means.output();
        let rows = actions.chunks_exact_mut(width).zip(outputs.as_slice().chunks_exact(outputs.nrows()));
        for (world, ((action, output), log_probability)) in (first..).zip(rows.zip(&mut **log_probabilities))
        {
            let counter = Counter { world: world as u64, ..self.counter };
            let mut random = counter.stream(Purpose::Action);
            *log_probability = self.distribution.sample(output, &mut random, action);
        }
    }
}

impl<E: Engine + Send> Ppo<E> {
    /// Steps all worlds through a horizon, or through one episode each.
    pub(super) fn collect(&mut self) -> Result<(), EnvironmentError> {
        let (worlds, horizon) = (self.settings.worlds, self.settings.horizon);
        let inputs = self.worlds.terms().inputs();
        let width = self.choices.as_ref().map_or(self.worlds.terms().actions(), |_| 1);
        let mut commands = Vec::new();
        let discount = self.settings.discount;
        let units = self.settings.recurrent;
        self.worlds.set_level(self.worlds.terms().level(self.state.steps));
        let distribution = self.distribution();
        let mut passes = Vec::new();
        passes.resize_with(self.worlds.threads(), Passes::default);
        let firsts: Vec<usize> = (0..worlds).step_by(TILE).collect();
        let mut images = vec![0.0; if self.mirror.is_some() { worlds * inputs } else { 0 }];
        // worlds whose steps are used
        let mut live = vec![true; worlds];
        self.rollout.used.clear();
        for step in 0..horizon {
            if !live.contains(&true) {
                break;
            }
            let samples = step * worlds..(step + 1) * worlds;
            let observations = &mut self.rollout.observations[samples.start * inputs..samples.end * inputs];
            // as in Stable-Baselines3's `VecNormalize`, the statistics include an observation before it is
            // normalised
            let raw = self.worlds.observations();
            for (row, _) in raw.chunks_exact(inputs).zip(&live).filter(|(_, live)| **live) {
                self.state.observations.update(row);
                if let Some(mirror) = &self.mirror {
                    mirror.observation(row, &mut images[..inputs]);
                    self.state.observations.update(&images[..inputs]);
                }
            }
            self.state.observations.apply(raw, observations);
            if let Some(mirror) = &self.mirror {
                let rows = raw.chunks_exact(inputs).zip(images.chunks_exact_mut(inputs));
                rows.for_each(|(row, image)| mirror.observation(row, image));
                let first = (horizon * worlds + samples.start) * inputs;
                let normalised = &mut self.rollout.observations[first..][..worlds * inputs];
                self.state.observations.apply(&images, normalised);
            }
            if units > 0 && step % self.rollout.unroll == 0 {
                let first = step / self.rollout.unroll * worlds * units;
                for (stored, states) in self.rollout.states.iter_mut().zip(&self.memories) {
                    stored[first..first + worlds * units].copy_from_slice(states);
                }
            }
            let counter =
                Counter { seed: self.state.seed, world: 0, episode: self.state.updates, step: step as u64 };
            let actor =
                Actor { policy: &self.policy, value: &self.value, distribution: &distribution, counter };
            let Rollout { observations, values, actions, log_probabilities, .. } = &mut self.rollout;
            let actions = &mut actions[samples.start * width..samples.end * width];
            let mut states = self.memories.each_mut().map(|states| states.chunks_mut((TILE * units).max(1)));
            let mut tiles: Vec<Tile<'_>> = values[samples.clone()]
                .chunks_mut(TILE)
                .zip(actions.chunks_mut(TILE * width))
                .zip(log_probabilities[samples.clone()].chunks_mut(TILE))
                .map(|((values, actions), log_probabilities)| {
                    let states = states.each_mut().map(|states| states.next().unwrap_or_default());
                    Tile { values, actions, log_probabilities, states }
                })
                .collect();
            self.watch.lap(Phase::Statistics);
            let run = |work: &(dyn Fn(usize) + Sync)| self.worlds.on_threads(work);
            for_chunks(run, &mut passes, &firsts, &mut tiles, |first, tile, passes| {
                let rows = (samples.start + first) * inputs..;
                let input = &observations[rows][..tile.values.len() * inputs];
                actor.act(*first, (inputs, input), tile, passes);
            });
            self.watch.lap(Phase::Policy);
            match &self.choices {
                None => self.worlds.step(actions)?,
                Some(choices) => {
                    commands.clear();
                    let rows = actions.iter().map(|choice| choices.row(*choice as usize));
                    commands.extend(rows.flatten().copied());
                    self.worlds.step(&commands)?
                }
            };
            self.watch.lap(Phase::Environment);
            self.rollout.next_values[samples.clone()].fill(0.0);
            // value after a truncated episode; the values of the next step follow below
            let is_truncated = |world: &usize| {
                self.worlds.steps()[*world].end.is_some_and(|end| !end.is_terminal())
                    && !self.variant.uses_episodes
            };
            let truncated: Vec<usize> = (0..worlds).filter(is_truncated).collect();
            if !truncated.is_empty() {
                let mut last = DMatrix::zeros(inputs, truncated.len());
                for (column, world) in truncated.iter().enumerate() {
                    if let Some(observation) = self.worlds.final_observation(*world) {
                        self.state.observations.apply(observation, last.column_mut(column).as_mut_slice());
                    }
                }
                let states = truncated.iter().map(|world| &self.memories[1][world * units..][..units]);
                let pieces = states.map(|state| Piece { state: Some(state), steps: 1 });
                let finals = self.value.forward(last, pieces);
                for (world, value) in truncated.iter().zip(finals.output().iter()) {
                    self.rollout.next_values[samples.start + world] = *value;
                }
            }
            self.watch.lap(Phase::Policy);
            for world in 0..worlds {
                if self.worlds.steps()[world].end.is_some() {
                    for states in &mut self.memories {
                        states[world * units..(world + 1) * units].fill(0.0);
                    }
                }
            }
            // the statistics include the returns before the rewards are normalised
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
                if !live[world] {
                    continue;
                }
                self.rollout.used.push(k);
                self.state.steps += 1;
                self.state.episodes.record(world, result);
                self.rollout.rewards[k] = (result.reward / deviation).clamp(-REWARD_CLIP, REWARD_CLIP) as f32;
                if result.end.is_some() {
                    self.state.discounted[world] = 0.0;
                    live[world] = !self.variant.uses_episodes;
                }
            }
        }
        self.watch.lap(Phase::Statistics);
        let mut next = vec![0.0; worlds * inputs];
        self.state.observations.apply(self.worlds.observations(), &mut next);
        let next = DMatrix::from_column_slice(inputs, worlds, &next);
        let next = self.value.forward(next, single_steps(&self.memories[1], units));
        self.watch.lap(Phase::Policy);
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
            self.watch.lap(Phase::Statistics);
            self.worlds.restart()?;
            self.watch.lap(Phase::Environment);
        }
        self.rollout.estimate(worlds, discount as f32, self.settings.lambda as f32);
        if let Some(mirror) = &self.mirror {
            match &self.mirrored_choices[..] {
                [] => self.rollout.add_images(|action, image| mirror.action(action, image)),
                images => self.rollout.add_images(|choice, image| {
                    image[0] = images[choice[0] as usize] as f32;
                }),
            }
        }
        self.watch.lap(Phase::Statistics);
        Ok(())
    }
}
