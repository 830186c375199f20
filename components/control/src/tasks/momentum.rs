//! The centroidal momentum follows a target, by the velocities.

use motorium_robots::{Dynamics, Model, Momentum};
use nalgebra::Vector3;

use super::{Cost, Rows, Task};
use crate::{RobotState, solver::Problem};

/// The momentum of the whole robot about its centre of mass is a target, in world axes: linear \[kg m/s\] and
/// angular \[kg m2/s\].
///
/// ```text
/// A = A_G(q)                                      centroidal momentum matrix, 6 x nv
/// b = h*
/// W = diag(l, l, l, g, g, g)                      cost of a momentum, 1/(kg m/s) and 1/(kg m2/s)
/// ```
///
/// (OpenSoT's tasks of linear and angular momentum in one.) A weight of zero leaves a part free. Orin,
/// Goswami and Lee, *Centroidal dynamics of a humanoid robot*, 2013.
#[derive(Clone, Debug)]
pub struct MomentumTask {
    target: Momentum,
    linear_weight: f64,
    angular_weight: f64,
    dynamics: Dynamics,
    cost: Cost,
}

impl MomentumTask {
    /// Creates a task that drives the angular momentum of `model` to zero, with weight 1.
    pub fn angular(model: &Model) -> Self {
        Self {
            target: Momentum { linear: Vector3::zeros(), angular: Vector3::zeros() },
            linear_weight: 0.0,
            angular_weight: 1.0,
            dynamics: Dynamics::new(model),
            cost: Cost::dense(6, 0, model.nv()),
        }
    }

    /// The same task with a weight of the linear and the angular part.
    #[must_use]
    pub fn weights(mut self, linear: f64, angular: f64) -> Self {
        (self.linear_weight, self.angular_weight) = (linear, angular);
        self
    }

    /// Sets the target `h*`.
    pub fn set_target(&mut self, target: Momentum) {
        self.target = target;
    }

    /// The cost as of the last update.
    pub fn cost(&self) -> &Cost {
        &self.cost
    }
}

impl Task for MomentumTask {
    fn rows(&self) -> usize {
        6
    }

    fn update(&mut self, state: &RobotState<'_>) {
        self.dynamics.centroidal_map(state.model, state.q, self.cost.matrix_mut());
        self.cost.desired_mut().fixed_rows_mut::<3>(0).copy_from(&self.target.linear);
        self.cost.desired_mut().fixed_rows_mut::<3>(3).copy_from(&self.target.angular);
        self.cost.weights_mut().fixed_rows_mut::<3>(0).fill(self.linear_weight);
        self.cost.weights_mut().fixed_rows_mut::<3>(3).fill(self.angular_weight);
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
