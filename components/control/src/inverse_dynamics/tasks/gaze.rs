//! An axis of a frame points at a point, by its acceleration.

use motorium_robots::{FrameId, Model, Reference};
use nalgebra::{Matrix6xX, Unit, Vector3};

use super::{AccelerationTask, Cost, Feedback};
use crate::inverse_dynamics::{InverseDynamics, MotionState};
use crate::tasks::least_turn;

/// Minimum distance from the frame origin to the target \[m\]; closer targets are ignored because the
/// direction is undefined.
const NEAREST: f64 = 1e-2;

/// Points an axis `d` of a frame at a point `p*` \[m, world axes\]. Rotation about the axis is free.
///
/// All quantities are in the axes of the frame. With the vector `r` to the point, `u = r / |r|`, `P = 1 - u
/// u'`, the velocity `w` of the point, and `v`, `o` the linear and the angular velocity of the frame,
///
/// ```text
/// e = the rotation vector that turns d onto u   rad
/// s = P o + [u]x (v - w) / |r|                  rate of the axis relative to the point; u' = u x s
/// A = P J_o + [u]x J_v / |r|                    3 x nv, of rank 2, on the accelerations
/// b = kp e - kd s - s'|(a = 0)                  kp e: no faster than the largest speed
/// W = weight                                    1/(rad/s2)
/// ```
///
/// (the [gaze task](crate::tasks::GazeTask) of velocities, differentiated again). The point moves at a
/// constant velocity.
#[derive(Clone, Debug)]
pub struct GazeAcceleration {
    frame: FrameId,
    axis: Unit<Vector3<f64>>,
    feedback: Feedback,
    weight: f64,
    max_speed: f64,
    target: Vector3<f64>,
    velocity: Vector3<f64>,
    error: Vector3<f64>,
    frame_jacobian: Matrix6xX<f64>,
    cost: Cost,
}

impl GazeAcceleration {
    /// Creates a task for an axis of `frame`, given in the frame's axes, with the world's origin as target
    /// and weight 1 \[1/(rad/s2)\].
    pub fn new(model: &Model, frame: FrameId, axis: Unit<Vector3<f64>>, feedback: Feedback) -> Self {
        Self {
            frame,
            axis,
            feedback,
            weight: 1.0,
            max_speed: f64::INFINITY,
            target: Vector3::zeros(),
            velocity: Vector3::zeros(),
            error: Vector3::zeros(),
            frame_jacobian: Matrix6xX::zeros(model.nv()),
            cost: Cost::dense(3, 0, model.nv()),
        }
    }

    /// The same task with a weight \[1/(rad/s2)\].
    #[must_use]
    pub fn weight(mut self, weight: f64) -> Self {
        self.weight = weight;
        self
    }

    /// Sets the largest angular speed at which the error is corrected \[rad/s\].
    #[must_use]
    pub fn max_speed(mut self, speed: f64) -> Self {
        self.max_speed = speed;
        self
    }

    /// Changes feedback and weight from the next update on.
    pub fn set(&mut self, feedback: Feedback, weight: f64) {
        (self.feedback, self.weight) = (feedback, weight);
    }

    /// Sets the point `p*` \[m, world axes\], at rest.
    pub fn set_target(&mut self, target: Vector3<f64>) {
        self.set_moving_target(target, Vector3::zeros());
    }

    /// Sets the point `p*` \[m\] and its velocity \[m/s\], in world axes.
    pub fn set_moving_target(&mut self, target: Vector3<f64>, velocity: Vector3<f64>) {
        (self.target, self.velocity) = (target, velocity);
    }

    /// `e` at the last update \[rad, axes of the frame\].
    pub fn error(&self) -> &Vector3<f64> {
        &self.error
    }
}

impl AccelerationTask for GazeAcceleration {
    fn update(&mut self, state: &MotionState<'_>, _: &InverseDynamics) {
        let MotionState { model, kinematics, .. } = *state;
        let pose = kinematics.pose(model, self.frame);
        let axes = pose.rotation.inverse();
        let seen = axes * (self.target - pose.translation.vector);
        let (u, distance) = match seen.norm() {
            near if near < NEAREST => (self.axis.into_inner(), NEAREST),
            distance => (seen / distance, distance),
        };
        self.error = least_turn(&self.axis, &u);
        let (moving, drift) =
            (kinematics.velocity(model, self.frame), kinematics.acceleration(model, self.frame));
        let (v, o, w) = (axes * moving.linear, axes * moving.angular, axes * self.velocity);
        let across = |x: &Vector3<f64>| x - u * u.dot(x);
        let relative = v - w;
        let rate = across(&o) + u.cross(&relative) / distance;
        // derivatives of components in the turning axes of the frame, at a = 0
        let direction_rate = u.cross(&rate);
        let distance_rate = -u.dot(&relative);
        let relative_rate = axes * drift.linear - o.cross(&relative);
        let drift = across(&(axes * drift.angular)) - direction_rate * u.dot(&o) - u * direction_rate.dot(&o)
            + (direction_rate.cross(&relative) + u.cross(&relative_rate)) / distance
            - u.cross(&relative) * (distance_rate / (distance * distance));
        let wanted = self.feedback.acceleration(&self.error, &-rate, self.max_speed);
        self.cost.desired_mut().copy_from(&(wanted - drift));
        self.cost.weights_mut().fill(self.weight);
        kinematics.jacobian(model, self.frame, Reference::Local, &mut self.frame_jacobian);
        for (mut row, frame) in
            self.cost.matrix_mut().column_iter_mut().zip(self.frame_jacobian.column_iter())
        {
            let (linear, angular) = (frame.fixed_rows::<3>(0), frame.fixed_rows::<3>(3));
            row.copy_from(&(across(&angular.into_owned()) + u.cross(&linear) / distance));
        }
    }

    fn cost(&self) -> &Cost {
        &self.cost
    }
}
