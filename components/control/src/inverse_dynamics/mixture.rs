//! Mixtures of solutions, for tasks that fade.

use nalgebra::DVector;

use super::outcome::Slack;

/// A sum of solutions by their shares.
#[derive(Debug)]
pub(super) struct Mixture {
    /// Accelerations, then forces.
    pub(super) x: DVector<f64>,
    pub(super) slack: Option<Slack>,
    pub(super) iterations: u32,
    pub(super) undecided: u32,
}

impl Mixture {
    pub(super) fn new(variables: usize) -> Self {
        Self { x: DVector::zeros(variables), slack: None, iterations: 0, undecided: 0 }
    }

    pub(super) fn clear(&mut self) {
        self.x.fill(0.0);
        (self.slack, self.iterations, self.undecided) = (None, 0, 0);
    }
}
