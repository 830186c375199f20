//! The samples of an update.

use super::network::Piece;

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
    pub(super) units: usize,
    /// Recurrent states of policy and value before each sequence of `unroll` steps, world after world.
    pub(super) states: [Vec<f32>; 2],
    pub(super) rewards: Vec<f32>,
    /// Value after the step: 0 where the episode terminated, of the final observation where it was truncated.
    pub(super) next_values: Vec<f32>,
    pub(super) ended: Vec<bool>,
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
