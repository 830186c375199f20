//! Tasks of inverse dynamics, each as a least-squares cost on accelerations or contact forces.
//!
//! Every [`Task`] is one. The tasks of this module are for inverse dynamics alone.

mod acceleration;
mod capture_point;
mod cartesian;
mod force;
mod impedance;
mod relative;
mod torque;
mod wrench;

pub use acceleration::AccelerationMinimum;
pub use capture_point::CapturePoint;
pub use cartesian::{CartesianAcceleration, CartesianWeights};
pub use force::{ContactForce, ForceRegularisation};
pub use impedance::CartesianImpedance;
pub use relative::RelativeAcceleration;
pub use torque::TorqueMinimum;
pub use wrench::ContactWrench;

use super::InverseDynamics;
pub use crate::cost::Cost;
pub use crate::formulation::Feedback;
use crate::formulation::Task;
use crate::state::MotionState;

/// A cost on the unknowns `x = (a, f)` of [`InverseDynamics`]: `1/2 |W (A x - b)|^2`.
///
/// Every [`Task`] is one, on the accelerations:
///
/// ```text
/// A = J,   b = kp e + kd e' + nu' - J' v          kp e: no faster than the largest speeds
/// ```
pub trait AccelerationTask {
    /// Evaluates error, `A` and `b` at this state, at which `dynamics` has begun its tick.
    fn update(&mut self, state: &MotionState<'_>, dynamics: &InverseDynamics);

    /// The cost as of the last update.
    fn cost(&self) -> &Cost;

    /// Number of rows of `A`.
    fn rows(&self) -> usize {
        self.cost().rows()
    }
}

impl<T: Task + ?Sized> AccelerationTask for T {
    fn update(&mut self, state: &MotionState<'_>, dynamics: &InverseDynamics) {
        self.evaluate(&state.robot());
        self.differentiate(state);
        self.equation_mut().request_acceleration(dynamics.mass());
    }

    fn cost(&self) -> &Cost {
        self.equation().cost()
    }
}
