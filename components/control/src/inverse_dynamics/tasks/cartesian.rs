//! A frame follows a pose, by its acceleration.

use motorium_robots::{FrameId, Model, Reference, Twist};
use nalgebra::{Isometry3, Vector3};

use super::{AccelerationTask, Cost, Feedback};
use crate::inverse_dynamics::{InverseDynamics, MotionState};

/// Weights and largest speeds of a [`CartesianAcceleration`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CartesianWeights {
    /// Cost of an acceleration error \[1/(m/s2)\]; 0 leaves the position free. Default 1.
    pub position: f64,
    /// Cost of an angular acceleration error \[1/(rad/s2)\]; 0 leaves the orientation free. Default 0.5.
    pub orientation: f64,
    /// Largest speed at which an error is corrected \[m/s\]. Default infinite.
    pub max_linear_speed: f64,
    /// Largest angular speed at which an error is corrected \[rad/s\]. Default infinite.
    pub max_angular_speed: f64,
}

impl Default for CartesianWeights {
    fn default() -> Self {
        let (max_linear_speed, max_angular_speed) = (f64::INFINITY, f64::INFINITY);
        Self { position: 1.0, orientation: 0.5, max_linear_speed, max_angular_speed }
    }
}

/// A frame of the robot follows a target pose: its position, its orientation, or both.
///
/// All in the axes of the world, at the origin of the frame. With `R` the orientation of the frame, `R*` that of the target,
///
/// ```text
/// e = (p* - p, log(R* R'))                        m, rad
/// A = J                                           Jacobian of the frame, world axes, 6 x nv, on the accelerations
/// b = nu*' + kd (nu* - nu) + kp e - J' v          J' v: classical drift, the acceleration of the frame at a = 0
/// W = diag(p, p, p, o, o, o)
/// ```
///
/// (OpenSoT's and TSID's task). For the error near zero the closed loop is `e'' = -kd e' - kp e`. `kp e` is cut where it would
/// correct the error faster than the largest speeds.
#[derive(Clone, Debug)]
pub struct CartesianAcceleration {
    frame: FrameId,
    feedback: Feedback,
    weights: CartesianWeights,
    target: Isometry3<f64>,
    velocity: Twist,
    acceleration: Twist,
    error: (Vector3<f64>, Vector3<f64>),
    cost: Cost,
}

impl CartesianAcceleration {
    /// A task for `frame` of `model`, with the world's origin as target and default weights.
    pub fn new(model: &Model, frame: FrameId, feedback: Feedback) -> Self {
        Self {
            frame,
            feedback,
            weights: CartesianWeights::default(),
            target: Isometry3::identity(),
            velocity: Twist::zero(),
            acceleration: Twist::zero(),
            error: (Vector3::zeros(), Vector3::zeros()),
            cost: Cost::dense(6, 0, model.nv()),
        }
    }

    /// The same task with these weights.
    #[must_use]
    pub fn with(mut self, weights: CartesianWeights) -> Self {
        self.weights = weights;
        self
    }

    /// Changes feedback and weights from the next update on.
    pub fn set(&mut self, feedback: Feedback, weights: CartesianWeights) {
        (self.feedback, self.weights) = (feedback, weights);
    }

    /// Sets the target pose in the world, at rest.
    pub fn set_target(&mut self, target: Isometry3<f64>) {
        self.set_moving_target(target, Twist::zero(), Twist::zero());
    }

    /// Sets the target pose, its velocity and its classical acceleration, of the origin of the target, in world axes.
    pub fn set_moving_target(&mut self, target: Isometry3<f64>, velocity: Twist, acceleration: Twist) {
        (self.target, self.velocity, self.acceleration) = (target, velocity, acceleration);
    }

    /// The target pose.
    pub fn target(&self) -> &Isometry3<f64> {
        &self.target
    }

    /// The frame.
    pub fn frame(&self) -> FrameId {
        self.frame
    }

    /// Weights and largest speeds.
    pub fn weights(&self) -> &CartesianWeights {
        &self.weights
    }

    /// `e` at the last update: position \[m\] and orientation \[rad\], world axes.
    pub fn error(&self) -> (&Vector3<f64>, &Vector3<f64>) {
        (&self.error.0, &self.error.1)
    }
}

impl AccelerationTask for CartesianAcceleration {
    fn update(&mut self, state: &MotionState<'_>, _: &InverseDynamics) {
        let MotionState { model, kinematics, .. } = *state;
        let pose = kinematics.pose(model, self.frame);
        let moving = kinematics.velocity(model, self.frame);
        let drift = kinematics.acceleration(model, self.frame);
        let position = self.target.translation.vector - pose.translation.vector;
        let turn = (self.target.rotation * pose.rotation.inverse()).scaled_axis();
        self.error = (position, turn);
        let weights = &self.weights;
        let linear = self.feedback.acceleration(
            &position,
            &(self.velocity.linear - moving.linear),
            weights.max_linear_speed,
        ) + self.acceleration.linear
            - drift.linear;
        let angular = self.feedback.acceleration(
            &turn,
            &(self.velocity.angular - moving.angular),
            weights.max_angular_speed,
        ) + self.acceleration.angular
            - drift.angular;
        let desired = self.cost.desired_mut();
        desired.fixed_rows_mut::<3>(0).copy_from(&linear);
        desired.fixed_rows_mut::<3>(3).copy_from(&angular);
        let (position, orientation) = (weights.position, weights.orientation);
        self.cost.weights_mut().fixed_rows_mut::<3>(0).fill(position);
        self.cost.weights_mut().fixed_rows_mut::<3>(3).fill(orientation);
        kinematics.jacobian(model, self.frame, Reference::LocalWorldAligned, self.cost.matrix_mut());
    }

    fn cost(&self) -> &Cost {
        &self.cost
    }
}
