//! Formulations: costs derived from the equations of tasks.
//!
//! A [`Task`] defines an error `e` of the robot, and how it changes with the joint velocity `v`:
//!
//! ```text
//! e'  = nu  - J v                    nu: rate of the target
//! e'' = nu' - J' v - J a             at the acceleration a
//! ```
//!
//! A task is independent of the controller's unknowns. A formulation turns the task's equation into a
//! least-squares cost `1/2 |W (J x - b)|^2` on the unknowns `x`:
//!
//! | formulation | unknowns | desired value |
//! |---|---|---|
//! | [`VelocityTask`] | `v` | `b = gain e + nu` |
//! | [`AccelerationTask`] | `a` | `b = kp e + kd e' + nu' - J' v` |
//!
//! [`AccelerationTask`]: crate::inverse_dynamics::AccelerationTask
//!
//! Every task implements both [`VelocityTask`] and [`AccelerationTask`]. Costs on contact forces, torques or
//! bounds directly implement one of these traits, so their types determine which controller accepts them.

mod acceleration;
mod equation;
mod impedance;
mod response;
mod velocity;

pub use equation::Equation;
pub use response::{Feedback, Response};
pub use velocity::VelocityTask;

use crate::state::{MotionState, RobotState};

/// A motion objective with an error. The same equation serves control of velocities and of accelerations.
///
/// A task owns its [`Equation`], whose memory is allocated at construction. Each tick calls
/// [`evaluate`](Self::evaluate) and then, for accelerations, [`differentiate`](Self::differentiate).
pub trait Task {
    /// Evaluates `e`, `J`, `nu` and the weights `W` at `state`.
    fn evaluate(&mut self, state: &RobotState<'_>);

    /// Evaluates `e'`, `nu'` and `J' v` at `state`, for which [`evaluate`](Self::evaluate) must already have
    /// been called.
    fn differentiate(&mut self, state: &MotionState<'_>);

    /// Returns the equation of the last evaluation.
    fn equation(&self) -> &Equation;

    /// Returns the equation for writing.
    fn equation_mut(&mut self) -> &mut Equation;
}

impl<T: Task + ?Sized> Task for &mut T {
    fn evaluate(&mut self, state: &RobotState<'_>) {
        (**self).evaluate(state);
    }

    fn differentiate(&mut self, state: &MotionState<'_>) {
        (**self).differentiate(state);
    }

    fn equation(&self) -> &Equation {
        (**self).equation()
    }

    fn equation_mut(&mut self) -> &mut Equation {
        (**self).equation_mut()
    }
}
