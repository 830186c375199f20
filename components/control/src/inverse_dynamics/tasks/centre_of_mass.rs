//! The centre of mass follows a point, by its acceleration.

use motorium_robots::Model;
use nalgebra::Vector3;

use super::{AccelerationTask, Cost, Feedback};
use crate::inverse_dynamics::{InverseDynamics, MotionState};

/// The centre of mass `c` of the robot follows a point `c*` \[m, world axes\]:
///
/// ```text
/// e = c* - c(q)
/// A = J_com                                       3 x nv, on the accelerations
/// b = c*'' + kd (c*' - c') + kp e - J_com' v
/// W = weight diag(shares)
/// ```
///
/// (OpenSoT's and TSID's task). Links fixed to the world do not count.
#[derive(Clone, Debug)]
pub struct CentreOfMassAcceleration {
    feedback: Feedback,
    weight: f64,
    shares: [f64; 3],
    max_speed: f64,
    target: Vector3<f64>,
    velocity: Vector3<f64>,
    acceleration: Vector3<f64>,
    error: Vector3<f64>,
    cost: Cost,
}

impl CentreOfMassAcceleration {
    /// A task for `model`, with the world's origin as target and weight 1 \[1/(m/s2)\].
    pub fn new(model: &Model, feedback: Feedback) -> Self {
        Self {
            feedback,
            weight: 1.0,
            shares: [1.0; 3],
            max_speed: f64::INFINITY,
            target: Vector3::zeros(),
            velocity: Vector3::zeros(),
            acceleration: Vector3::zeros(),
            error: Vector3::zeros(),
            cost: Cost::dense(3, 0, model.nv()),
        }
    }

    /// The same task with a weight \[1/(m/s2)\].
    #[must_use]
    pub fn weight(mut self, weight: f64) -> Self {
        self.weight = weight;
        self
    }

    /// Sets the factors of the weight along x, y and z of the world; 0 leaves an axis free.
    #[must_use]
    pub fn shares(mut self, shares: [f64; 3]) -> Self {
        self.shares = shares;
        self
    }

    /// Sets the largest speed at which an error is corrected \[m/s\].
    #[must_use]
    pub fn max_speed(mut self, speed: f64) -> Self {
        self.max_speed = speed;
        self
    }

    /// Changes feedback and weight from the next update on.
    pub fn set(&mut self, feedback: Feedback, weight: f64) {
        (self.feedback, self.weight) = (feedback, weight);
    }

    /// Sets the target `c*` \[m, world axes\], at rest.
    pub fn set_target(&mut self, target: Vector3<f64>) {
        self.set_moving_target(target, Vector3::zeros(), Vector3::zeros());
    }

    /// Sets the target, its velocity and its acceleration \[m, m/s, m/s2, world axes\].
    pub fn set_moving_target(
        &mut self,
        target: Vector3<f64>,
        velocity: Vector3<f64>,
        acceleration: Vector3<f64>,
    ) {
        (self.target, self.velocity, self.acceleration) = (target, velocity, acceleration);
    }

    /// The target \[m, world axes\].
    pub fn target(&self) -> &Vector3<f64> {
        &self.target
    }

    /// `e` at the last update \[m, world axes\].
    pub fn error(&self) -> &Vector3<f64> {
        &self.error
    }
}

impl AccelerationTask for CentreOfMassAcceleration {
    fn update(&mut self, state: &MotionState<'_>, _: &InverseDynamics) {
        let moving = state.kinematics.centre_of_mass(state.model);
        self.error = self.target - moving.position;
        let rate = self.velocity - moving.velocity;
        let wanted = self.feedback.acceleration(&self.error, &rate, self.max_speed) + self.acceleration;
        self.cost.desired_mut().copy_from(&(wanted - moving.acceleration));
        for (weight, share) in self.cost.weights_mut().iter_mut().zip(self.shares) {
            *weight = self.weight * share;
        }
        state.kinematics.com_jacobian(state.model, self.cost.matrix_mut());
    }

    fn cost(&self) -> &Cost {
        &self.cost
    }
}
