//! Returns and lengths of episodes during training.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use crate::environment::Step;

/// Number of episodes over which returns and lengths are averaged.
const RECENT: usize = 100;

/// Episodes of all worlds so far.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Episodes {
    /// Number of finished episodes.
    pub(crate) ended: u64,
    /// Return and length of the running episode of each world.
    running: Vec<(f64, u64)>,
    /// Return and length of the most recent episodes.
    recent: VecDeque<(f64, u64)>,
}

impl Episodes {
    pub(crate) fn new(worlds: usize) -> Self {
        Self { ended: 0, running: vec![(0.0, 0); worlds], recent: VecDeque::with_capacity(RECENT + 1) }
    }

    /// Returns the number of worlds.
    pub(crate) fn worlds(&self) -> usize {
        self.running.len()
    }

    /// Adds a step of a world.
    pub(crate) fn record(&mut self, world: usize, step: &Step) {
        let running = &mut self.running[world];
        running.0 += step.reward;
        running.1 += 1;
        if step.end.is_some() {
            self.ended += 1;
            self.recent.push_back(core::mem::take(running));
            if self.recent.len() > RECENT {
                self.recent.pop_front();
            }
        }
    }

    fn mean(&self, value: impl Fn(&(f64, u64)) -> f64) -> Option<f64> {
        let count = self.recent.len();
        (count > 0).then(|| self.recent.iter().map(value).sum::<f64>() / count as f64)
    }

    /// Returns the mean return of the most recent episodes.
    pub(crate) fn mean_return(&self) -> Option<f64> {
        self.mean(|(total, _)| *total)
    }

    /// Returns the mean length of the most recent episodes \[steps\].
    pub(crate) fn mean_length(&self) -> Option<f64> {
        self.mean(|(_, length)| *length as f64)
    }
}
