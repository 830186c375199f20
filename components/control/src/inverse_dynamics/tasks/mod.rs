//! Tasks of inverse dynamics, each as a least-squares cost on accelerations or contact forces.

mod acceleration;
mod capture_point;
mod cartesian;
mod centre_of_mass;
mod force;
mod gaze;
mod impedance;
mod joint_velocity;
mod momentum;
mod posture;
mod relative;
mod rigid_rotation;
mod rolling;
mod torque;
mod unicycle;
mod wrench;

pub use acceleration::AccelerationMinimum;
pub use capture_point::CapturePoint;
pub use cartesian::{CartesianAcceleration, CartesianWeights};
pub use centre_of_mass::CentreOfMassAcceleration;
pub use force::{ContactForce, ForceRegularisation};
pub use gaze::GazeAcceleration;
pub use impedance::CartesianImpedance;
pub use joint_velocity::{JointVelocities, JointVelocityAcceleration};
pub use momentum::MomentumRate;
pub use posture::PostureAcceleration;
pub use relative::RelativeAcceleration;
pub use rigid_rotation::RigidRotationAcceleration;
pub use rolling::RollingAcceleration;
pub use torque::TorqueMinimum;
pub use unicycle::UnicycleAcceleration;
pub use wrench::ContactWrench;

use nalgebra::Vector3;

use super::{InverseDynamics, MotionState};
pub use crate::cost::Cost;

/// A cost on the unknowns `x = (a, f)` of [`InverseDynamics`]: `1/2 |W (A x - b)|^2`.
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

/// Feedback of a task: the acceleration `kp e + kd e'` for an error `e`.
///
/// ```
/// use motorium_control::inverse_dynamics::tasks::Feedback;
///
/// // both eigenvalues of the error at -10 / s: kd = 2 sqrt(kp)
/// assert_eq!(Feedback::critical(10.0), Feedback { kp: 100.0, kd: 20.0 });
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feedback {
    /// Gain of the position error \[1/s^2\].
    pub kp: f64,
    /// Gain of the velocity error \[1/s\].
    pub kd: f64,
}

impl Feedback {
    /// Critically damped, both eigenvalues of the error at `-rate` \[1/s\].
    pub fn critical(rate: f64) -> Self {
        Self { kp: rate * rate, kd: 2.0 * rate }
    }

    /// Acceleration for a vector error `e` and its rate `e'`, with the correction speed limited to
    /// `max_speed`: `kd (clip(kp / kd e) + e')`.
    pub fn acceleration(&self, error: &Vector3<f64>, rate: &Vector3<f64>, max_speed: f64) -> Vector3<f64> {
        let mut proportional = error * self.kp;
        let most = self.kd * max_speed;
        let length = proportional.norm();
        if length > most {
            proportional *= most / length;
        }
        proportional + rate * self.kd
    }
}
