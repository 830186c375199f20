//! Velocities are small.

use motorium_robots::Model;

use super::{Cost, Rows, Task};
use crate::{RobotState, solver::Problem};

/// Velocities are small, or near given ones:
///
/// ```text
/// A = 1 on all velocities,   b = v*,   W = weight diag(shares)      1/(rad/s) or 1/(m/s)
/// ```
///
/// (OpenSoT's and PyRoboLearn's tasks of minimum velocity, `v* = 0`, and of minimum acceleration, `v*` the
/// velocity of the tick before.) Shares let some joints, or a floating base, move more than others.
#[derive(Clone, Debug)]
pub struct MinimumVelocityTask {
    weight: f64,
    shares: Vec<f64>,
    cost: Cost,
}

impl MinimumVelocityTask {
    /// A task for all velocities of `model`, a floating base included, with weight 1e-2.
    pub fn new(model: &Model) -> Self {
        Self { weight: 1e-2, shares: vec![1.0; model.nv()], cost: Cost::identity(0, model.nv()) }
    }

    /// The same task with a weight \[1/(rad/s) or 1/(m/s)\].
    #[must_use]
    pub fn weight(mut self, weight: f64) -> Self {
        self.weight = weight;
        self
    }

    /// Changes the weight from the next update on.
    pub fn set_weight(&mut self, weight: f64) {
        self.weight = weight;
    }

    /// Sets `v*`, one entry per velocity.
    ///
    /// # Panics
    /// If the length differs.
    pub fn set_target(&mut self, velocity: &[f64]) {
        self.cost.desired_mut().copy_from_slice(velocity);
    }

    /// Sets `v*` to zero.
    pub fn set_rest(&mut self) {
        self.cost.desired_mut().fill(0.0);
    }

    /// Sets the weight factor of one velocity; zero leaves it free.
    ///
    /// # Panics
    /// If the velocity does not exist.
    pub fn set_share(&mut self, velocity: usize, share: f64) {
        self.shares[velocity] = share;
    }

    /// The cost as of the last update.
    pub fn cost(&self) -> &Cost {
        &self.cost
    }
}

impl Task for MinimumVelocityTask {
    fn rows(&self) -> usize {
        self.cost.rows()
    }

    fn update(&mut self, _: &RobotState<'_>) {
        for (weight, share) in self.cost.weights_mut().iter_mut().zip(&self.shares) {
            *weight = self.weight * share;
        }
    }

    fn residual(&self, velocity: &[f64]) -> f64 {
        self.cost.residual(velocity)
    }

    fn add_to(&self, problem: &mut Problem) {
        self.cost.add_to(problem);
    }

    fn write_rows(&self, rows: &mut Rows) {
        self.cost.write_rows(rows);
    }
}
