//! Minimises accelerations.

use motorium_robots::Model;

use super::Cost;
use crate::MotionState;
use crate::inverse_dynamics::{AccelerationTask, InverseDynamics};

/// Minimises accelerations:
///
/// ```text
/// A = 1 on all accelerations,   b = 0,   W = weight diag(shares)       1/(rad/s2) or 1/(m/s2)
/// ```
///
/// PyRoboLearn has the same task. The task does not stop a moving robot; use a posture task without `kp` for
/// that purpose.
#[derive(Clone, Debug)]
pub struct AccelerationMinimum {
    weight: f64,
    shares: Vec<f64>,
    cost: Cost,
}

methods!(AccelerationMinimum: weight("1/(rad/s2) or 1/(m/s2)"), set_weight);

impl AccelerationMinimum {
    /// Creates a task for all accelerations of `model`, including a floating base, with weight 1e-2.
    pub fn new(model: &Model) -> Self {
        Self { weight: 1e-2, shares: vec![1.0; model.nv()], cost: Cost::identity(0, model.nv()) }
    }

    /// Sets the weight factor of one acceleration; zero leaves this acceleration free.
    ///
    /// # Panics
    /// If `acceleration` is out of range.
    pub fn set_share(&mut self, acceleration: usize, share: f64) {
        self.shares[acceleration] = share;
    }
}

impl AccelerationTask for AccelerationMinimum {
    fn update(&mut self, _: &MotionState<'_>, _: &InverseDynamics) {
        for (weight, share) in self.cost.weights_mut().iter_mut().zip(&self.shares) {
            *weight = self.weight * share;
        }
    }

    fn cost(&self) -> &Cost {
        &self.cost
    }
}
