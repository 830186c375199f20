//! Mixtures of solutions, for tasks that fade.

use nalgebra::DVector;

use super::InverseDynamics;
use super::outcome::{InverseDynamicsSolution, Slack};

/// A sum of solutions by their shares.
#[derive(Debug)]
pub(super) struct Mixture {
    /// Accelerations, then forces.
    x: DVector<f64>,
    slack: Option<Slack>,
    iterations: u32,
    undecided: u32,
}

impl Mixture {
    pub(super) fn new(variables: usize) -> Self {
        Self { x: DVector::zeros(variables), slack: None, iterations: 0, undecided: 0 }
    }

    fn clear(&mut self) {
        self.x.fill(0.0);
        (self.slack, self.iterations, self.undecided) = (None, 0, 0);
    }
}

impl InverseDynamics {
    /// Adds the last [`solution`](Self::solution) to a mixture, weighted by `share`, [as for
    /// velocities](crate::DifferentialIk::mix). Accelerations and contact forces are mixed. Friction,
    /// unilateral contacts and torque limits are convex, so a mixture with nonnegative shares that sum to 1
    /// satisfies them.
    pub fn mix(&mut self, share: f64) {
        let Self { mixture, x, solution, .. } = self;
        mixture.x.axpy(share, x, 1.0);
        mixture.iterations += solution.iterations;
        mixture.undecided += solution.undecided;
        mixture.slack = match (mixture.slack, solution.slack) {
            (Some(one), Some(other)) => Some(one.worse(&other)),
            (one, other) => one.or(other),
        };
    }

    /// Makes the mixture the [`solution`](Self::solution), with its torques, and starts a new one. Iterations
    /// and undecided levels are summed over the solutions; the slack is the maximum.
    pub fn take_mixture(&mut self) -> &InverseDynamicsSolution {
        self.x.copy_from(&self.mixture.x);
        let Self { mixture, solution, .. } = self;
        (solution.slack, solution.iterations, solution.undecided) =
            (mixture.slack, mixture.iterations, mixture.undecided);
        mixture.clear();
        self.write();
        self.solution()
    }

    /// Begins a new mixture.
    pub fn drop_mixture(&mut self) {
        self.mixture.clear();
    }
}
