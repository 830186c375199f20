//! The joints keep a posture, by their accelerations.

use motorium_robots::Model;
use nalgebra::DVector;

use super::{AccelerationTask, Cost, Feedback};
use crate::inverse_dynamics::{InverseDynamics, MotionState};

/// Joint positions `q` approach a posture `q*` \[rad or m\], which may move:
///
/// ```text
/// A = S                                           the accelerations of the independent joints
/// b = q*'' + kd (q*' - q') + kp (q* - q)
/// W = weight diag(shares)
/// ```
///
/// A floating base is left alone; [`CartesianAcceleration`](super::CartesianAcceleration) of its frame leads it.
#[derive(Clone, Debug)]
pub struct PostureAcceleration {
    feedback: Feedback,
    weight: f64,
    target: DVector<f64>,
    velocity: DVector<f64>,
    acceleration: DVector<f64>,
    shares: DVector<f64>,
    error: DVector<f64>,
    cost: Cost,
}

impl PostureAcceleration {
    /// A task for all joints of `model`, with weight 1 \[1/(rad/s2) or 1/(m/s2)\].
    ///
    /// # Panics
    /// If `target` has not one entry per independent joint.
    pub fn new(model: &Model, target: &[f64], feedback: Feedback) -> Self {
        let joints = model.joint_count();
        assert_eq!(target.len(), joints, "length of the posture");
        Self {
            feedback,
            weight: 1.0,
            target: DVector::from_column_slice(target),
            velocity: DVector::zeros(joints),
            acceleration: DVector::zeros(joints),
            shares: DVector::repeat(joints, 1.0),
            error: DVector::zeros(joints),
            cost: Cost::identity(model.nv() - joints, joints),
        }
    }

    /// The same task with a weight \[1/(rad/s2) or 1/(m/s2)\].
    #[must_use]
    pub fn weight(mut self, weight: f64) -> Self {
        self.weight = weight;
        self
    }

    /// Changes feedback and weight from the next update on.
    pub fn set(&mut self, feedback: Feedback, weight: f64) {
        (self.feedback, self.weight) = (feedback, weight);
    }

    /// Sets the posture, at rest.
    ///
    /// # Panics
    /// If `target` has not one entry per independent joint.
    pub fn set_target(&mut self, target: &[f64]) {
        self.target.copy_from_slice(target);
        self.velocity.fill(0.0);
        self.acceleration.fill(0.0);
    }

    /// Sets the posture, its velocity and its acceleration.
    ///
    /// # Panics
    /// If one of them has not one entry per independent joint.
    pub fn set_moving_target(&mut self, target: &[f64], velocity: &[f64], acceleration: &[f64]) {
        self.target.copy_from_slice(target);
        self.velocity.copy_from_slice(velocity);
        self.acceleration.copy_from_slice(acceleration);
    }

    /// Sets the factor of the weight of one joint; zero leaves it out.
    ///
    /// # Panics
    /// If there is no such joint.
    pub fn set_share(&mut self, joint: usize, share: f64) {
        self.shares[joint] = share;
    }

    /// `q* - q` at the last update.
    pub fn error(&self) -> &[f64] {
        self.error.as_slice()
    }
}

impl AccelerationTask for PostureAcceleration {
    fn update(&mut self, state: &MotionState<'_>, _: &InverseDynamics) {
        let (q, v) = (state.model.joints_of_q(state.q), state.model.joints_of_v(state.v));
        let Feedback { kp, kd } = self.feedback;
        for joint in 0..q.len() {
            self.error[joint] = self.target[joint] - q[joint];
            self.cost.desired_mut()[joint] =
                self.acceleration[joint] + kd * (self.velocity[joint] - v[joint]) + kp * self.error[joint];
            self.cost.weights_mut()[joint] = self.weight * self.shares[joint];
        }
    }

    fn cost(&self) -> &Cost {
        &self.cost
    }
}
