//! Tasks of inverse dynamics, each as a least-squares cost on accelerations or contact forces.
//!
//! Every [`Task`](crate::formulation::Task) is one. The tasks of this module are for inverse dynamics alone.

mod acceleration;
mod capture_point;
mod force;
mod torque;
mod wrench;

pub use acceleration::AccelerationMinimum;
pub use capture_point::CapturePoint;
pub use force::{ContactForce, ForceRegularisation};
pub use torque::TorqueMinimum;
pub use wrench::ContactWrench;

pub use super::control::AccelerationTask;
pub use crate::cost::Cost;
pub use crate::formulation::Feedback;
