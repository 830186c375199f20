//! The samples of an update.

use super::network::Piece;

/// Steps of all worlds, ordered by step and world.
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
    /// Samples used by an update.
    pub(super) used: Vec<usize>,
    pub(super) worlds: usize,
    /// Consecutive steps of a world through which a gradient is propagated; 1 without recurrent units.
    pub(super) unroll: usize,
    pub(super) units: usize,
    /// Recurrent states of policy and value before each sequence of `unroll` steps, world after world.
    pub(super) states: [Vec<f32>; 2],
    pub(super) rewards: Vec<f32>,
    /// Value after the step: 0 if the episode terminated, the value of the final observation if it was
    /// truncated.
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

    /// Adds space for the mirror image of each sample, after all samples and in the same order.
    pub(super) fn with_images(mut self, is_mirrored: bool) -> Self {
        if is_mirrored {
            for numbers in [
                &mut self.observations,
                &mut self.actions,
                &mut self.log_probabilities,
                &mut self.advantages,
                &mut self.returns,
            ] {
                numbers.resize(2 * numbers.len(), 0.0);
            }
        }
        self
    }

    /// Completes the mirror images of all used samples. Their observations must already be present; `mirror`
    /// writes the image of a stored action.
    pub(super) fn add_images(&mut self, mirror: impl Fn(&[f32], &mut [f32])) {
        let samples = self.rewards.len();
        let width = self.actions.len() / self.returns.len();
        let (actions, images) = self.actions.split_at_mut(samples * width);
        for (action, image) in actions.chunks_exact(width).zip(images.chunks_exact_mut(width)) {
            mirror(action, image);
        }
        for numbers in [&mut self.log_probabilities, &mut self.advantages, &mut self.returns] {
            numbers.copy_within(..samples, samples);
        }
        let images: Vec<usize> = self.used.iter().map(|k| k + samples).collect();
        self.used.extend(images);
    }

    /// Returns the first samples of all sequences.
    pub(super) fn firsts(&self) -> Vec<usize> {
        self.used.iter().copied().filter(|k| (k / self.worlds).is_multiple_of(self.unroll)).collect()
    }

    /// Returns all samples of the sequences that start at `firsts`.
    pub(super) fn sequences(&self, firsts: &[usize]) -> Vec<usize> {
        firsts.iter().flat_map(|first| (0..self.unroll).map(move |step| first + step * self.worlds)).collect()
    }

    /// Splits whole sequences into pieces of episodes, with the states of the policy (0) or the value (1).
    /// Returns no pieces without recurrent units.
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

    /// Computes advantages and returns by generalised advantage estimation.
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

/// The normal distribution of actions around their means.
#[derive(Clone, Debug)]
pub(super) struct Spread {
    /// Standard deviation of each action; 0 for an action without effect, which is not explored.
    pub(super) deviations: Vec<f32>,
    /// Inverse of each deviation; 0 for an action without effect.
    inverse: Vec<f32>,
    /// Logarithm of the density at the means.
    peak: f32,
}

impl Spread {
    /// Creates a distribution from the logarithms of the standard deviations. Actions that are not `active`
    /// have no effect.
    pub(super) fn new(logarithms: &[f32], active: &[bool]) -> Self {
        const HALF_LN_TAU: f32 = 0.918_938_5;
        let each = |value: fn(f32) -> f32| {
            let actions = logarithms.iter().zip(active);
            actions.map(move |(deviation, active)| if *active { value(*deviation) } else { 0.0 }).collect()
        };
        let terms: Vec<f32> = each(|deviation| -deviation - HALF_LN_TAU);
        Self {
            deviations: each(f32::exp),
            inverse: each(|deviation| (-deviation).exp()),
            peak: terms.iter().sum(),
        }
    }

    /// Returns the logarithm of the density of an action.
    pub(super) fn log_density(&self, action: &[f32], mean: &[f32]) -> f32 {
        let scaled = action.iter().zip(mean).zip(&self.inverse).map(|((a, m), inverse)| (a - m) * inverse);
        self.peak - 0.5 * scaled.map(|scaled| scaled * scaled).sum::<f32>()
    }

    /// Writes the gradient of the log density, times a factor, with respect to the means. Adds the gradient
    /// with respect to the logarithms of the standard deviations.
    pub(super) fn slopes(
        &self,
        (action, mean): (&[f32], &[f32]),
        factor: f32,
        by_mean: &mut [f32],
        by_deviation: &mut [f32],
    ) {
        let actions = action.iter().zip(mean).zip(&self.inverse);
        for (((action, mean), inverse), (by_mean, by_deviation)) in
            actions.zip(by_mean.iter_mut().zip(by_deviation))
        {
            let scaled = (action - mean) * inverse;
            *by_mean = factor * scaled * inverse;
            *by_deviation += if *inverse > 0.0 { factor * (scaled * scaled - 1.0) } else { 0.0 };
        }
    }
}
