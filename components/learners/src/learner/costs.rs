//! Time of a training run per phase.

use std::time::Instant;

/// Phase of a training run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Physics, observations, rewards and resets of all worlds.
    Environment,
    /// Computing actions and values in rollouts: passes through the networks.
    Policy,
    /// Computing statistics of observations and returns, advantages, and samples of the replay buffer.
    Statistics,
    /// Computing gradients of all losses.
    Gradient,
    /// Gradient clipping, Adam, and updates of target networks.
    Optimiser,
    /// Writing progress, checkpoints and policies.
    Files,
}

impl Phase {
    /// All phases.
    pub const ALL: [Self; 6] =
        [Self::Environment, Self::Policy, Self::Statistics, Self::Gradient, Self::Optimiser, Self::Files];

    /// Returns the lower-case name of the phase.
    pub fn name(self) -> &'static str {
        match self {
            Self::Environment => "environment",
            Self::Policy => "policy",
            Self::Statistics => "statistics",
            Self::Gradient => "gradient",
            Self::Optimiser => "optimiser",
            Self::Files => "files",
        }
    }
}

/// Time that the calling thread spent in each phase, including the time spent waiting for other threads.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Costs {
    seconds: [f64; Phase::ALL.len()],
}

impl Costs {
    /// Returns the time spent in a phase \[s\].
    pub fn seconds(&self, phase: Phase) -> f64 {
        self.seconds[phase as usize]
    }

    /// Returns the total time spent in all phases \[s\].
    pub fn total(&self) -> f64 {
        self.seconds.iter().sum()
    }

    /// Adds time \[s\] to a phase.
    pub fn add(&mut self, phase: Phase, seconds: f64) {
        self.seconds[phase as usize] += seconds;
    }
}

/// A stopwatch that assigns the time of a run to phases. The stopwatch reads the clock a few times per step
/// of all worlds and per gradient. The measured times do not affect results.
#[derive(Clone, Copy, Debug)]
pub struct Stopwatch {
    last: Instant,
    costs: Costs,
}

impl Stopwatch {
    /// Creates a stopwatch and starts the first lap.
    pub fn start() -> Self {
        Self { last: Instant::now(), costs: Costs::default() }
    }

    /// Starts the next lap. The time since the last lap is not assigned to any phase.
    pub fn skip(&mut self) {
        self.last = Instant::now();
    }

    /// Assigns the time of the current lap to a phase and starts the next lap.
    pub fn lap(&mut self, phase: Phase) {
        let now = Instant::now();
        self.costs.add(phase, (now - self.last).as_secs_f64());
        self.last = now;
    }

    /// Returns the accumulated time of all laps for each phase.
    pub fn costs(&self) -> Costs {
        self.costs
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn laps_add_up_to_at_most_the_elapsed_time() {
        let start = Instant::now();
        let mut watch = Stopwatch::start();
        for lap in 0..600 {
            watch.skip();
            watch.lap(Phase::ALL[lap % Phase::ALL.len()]);
        }
        let (costs, elapsed) = (watch.costs(), start.elapsed().as_secs_f64());
        assert!(costs.total() <= elapsed, "{costs:?} of {elapsed} s");
        assert!(Phase::ALL.iter().all(|phase| costs.seconds(*phase) > 0.0), "{costs:?}");
    }

    #[test]
    fn each_phase_has_its_own_time() {
        let mut costs = Costs::default();
        for (index, phase) in Phase::ALL.into_iter().enumerate() {
            costs.add(phase, 2.0_f64.powi(index as i32));
        }
        let found = Phase::ALL.map(|phase| costs.seconds(phase));
        assert_eq!((found, costs.total()), ([1.0, 2.0, 4.0, 8.0, 16.0, 32.0], 63.0));
    }
}
