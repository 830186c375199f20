//! Minimises velocities.

use motorium_robots::Model;

use super::velocities::{RATE, differentiate_velocities};
use super::{Cost, Equation, Response, Task};
use crate::{MotionState, RobotState};

/// Minimises velocities, or their distance from target velocities:
///
/// ```text
/// J = 1 on all velocities,   nu = v*,   W = weight diag(shares)     1/(rad/s) or 1/(m/s)
/// ```
///
/// OpenSoT and PyRoboLearn call this task minimum velocity if `v*` is zero, and minimum acceleration if `v*`
/// is the velocity of the previous tick. Weight factors let some joints, or a floating base, move more than
/// others. Under acceleration control, the task damps the joints: velocity errors decay at the
/// [`rate`](Self::rate), and a floating base is left to other tasks.
///
/// ```
/// use motorium_control::tasks::MinimumVelocityTask;
/// use motorium_robots::load;
///
/// let panda = load("panda", std::path::Path::new("."))?.model;
/// // the motion of the joints that other tasks leave open dies away within a tenth of a second
/// let damping = MinimumVelocityTask::new(&panda).rate(10.0);
/// # let _ = damping;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct MinimumVelocityTask {
    weight: f64,
    shares: Vec<f64>,
    equation: Equation,
}

methods!(
    MinimumVelocityTask: weight("1/(rad/s) or 1/(m/s)"),
    rate("an error of a joint velocity"),
    set_weight,
    cost
);

impl MinimumVelocityTask {
    /// Creates a task for all velocities of `model`, including a floating base, with weight 1e-2.
    pub fn new(model: &Model) -> Self {
        let mut equation = Equation::identity(0, model.nv());
        equation.response = Response::velocity(RATE);
        Self { weight: 1e-2, shares: vec![1.0; model.nv()], equation }
    }

    /// Sets the target `v*` \[rad/s or m/s\], one entry per velocity.
    ///
    /// # Panics
    /// If the length differs from the number of velocities.
    pub fn set_target(&mut self, velocity: &[f64]) {
        self.equation.rate.copy_from_slice(velocity);
    }

    /// Sets the target `v*` to zero.
    pub fn set_rest(&mut self) {
        self.equation.rate.fill(0.0);
    }

    /// Sets the weight factor of one velocity; zero leaves this velocity free.
    ///
    /// # Panics
    /// If `velocity` is out of range.
    pub fn set_share(&mut self, velocity: usize, share: f64) {
        self.shares[velocity] = share;
    }
}

impl Task for MinimumVelocityTask {
    fn evaluate(&mut self, _: &RobotState<'_>) {
        for (weight, share) in self.equation.weights_mut().iter_mut().zip(&self.shares) {
            *weight = self.weight * share;
        }
    }

    fn differentiate(&mut self, state: &MotionState<'_>) {
        differentiate_velocities(&mut self.equation, state);
    }

    equation!();
}
