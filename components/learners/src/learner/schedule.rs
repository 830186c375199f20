//! Numbers that change during training.

/// A number that changes linearly from `start` to `end` over a share of all steps, and then stays.
///
/// ```
/// use motorium_learners::learner::LinearSchedule;
///
/// let exploration = LinearSchedule { start: 1.0, end: 0.1, share: 0.5 };
/// let values = [0, 25, 50, 100].map(|step| exploration.value(step, 100));
/// assert_eq!(values, [1.0, 0.55, 0.1, 0.1]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearSchedule {
    /// Number before the first step.
    pub start: f64,
    /// Number after the share of steps.
    pub end: f64,
    /// Share of all steps, above 0, at most 1.
    pub share: f64,
}

impl LinearSchedule {
    /// The number after some of all steps.
    pub fn value(&self, steps: u64, total: u64) -> f64 {
        let done = (steps as f64 / (self.share * total as f64)).min(1.0);
        self.start * (1.0 - done) + self.end * done
    }
}
