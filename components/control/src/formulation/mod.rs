//! Formulations: costs made of the equations of tasks.
//!
//! A [`Task`] states an error `e` of the robot, and how it changes with the joint velocity `v`:
//!
//! ```text
//! e'  = nu  - J v                    nu: rate of the target
//! e'' = nu' - J' v - J a             at the acceleration a
//! ```
//!
//! It does not know the unknowns of the controller. A formulation turns the equation into a least-squares
//! cost `1/2 |W (J x - b)|^2` on its unknowns `x`:
//!
//! | formulation | unknowns | desired value |
//! |---|---|---|
//! | [`VelocityTask`] | `v` | `b = gain e + nu` |
//! | [`AccelerationTask`] | `a` | `b = kp e + kd e' + nu' - J' v` |
//!
//! [`AccelerationTask`]: crate::inverse_dynamics::AccelerationTask
//!
//! Each task is both. Costs on contact forces, torques or bounds implement one of the two traits directly, so
//! their types say which controller they are for.

mod acceleration;
mod equation;
mod impedance;
mod response;
mod velocity;

pub use equation::Equation;
pub use response::{Feedback, Response};
pub use velocity::VelocityTask;

use crate::state::{MotionState, RobotState};

/// A motion of the robot with an error, whose equation holds for velocities and for accelerations.
///
/// A task keeps its [`Equation`], whose memory is allocated at construction. A tick evaluates it with
/// [`evaluate`](Self::evaluate), and for accelerations with [`differentiate`](Self::differentiate)
/// afterwards.
pub trait Task {
    /// Evaluates `e`, `J`, `nu` and the weights `W` at `state`.
    fn evaluate(&mut self, state: &RobotState<'_>);

    /// Evaluates `e'`, `nu'` and `J' v` at `state`, which was [evaluated](Self::evaluate) before.
    fn differentiate(&mut self, state: &MotionState<'_>);

    /// The equation as of the last evaluation.
    fn equation(&self) -> &Equation;

    /// The equation, to be written.
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
