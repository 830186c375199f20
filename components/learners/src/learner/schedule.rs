//! Values that change during training.

/// A value that changes linearly from `start` to `end` over a fraction of all steps, and then stays constant.
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
    /// Value before the first step.
    pub start: f64,
    /// Value after the fraction `share` of all steps.
    pub end: f64,
    /// Fraction of all steps over which the value changes, more than 0, at most 1.
    pub share: f64,
}

impl LinearSchedule {
    /// Returns the value after `steps` of `total` steps.
    pub fn value(&self, steps: u64, total: u64) -> f64 {
        let done = (steps as f64 / (self.share * total as f64)).min(1.0);
        self.start * (1.0 - done) + self.end * done
    }
}
