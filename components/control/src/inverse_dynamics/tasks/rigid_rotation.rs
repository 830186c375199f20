//! A steered wheel points along the way of its base, by its acceleration.

use motorium_robots::{FrameId, Model, Reference};
use nalgebra::{Matrix6xX, Unit, Vector3};

use super::{AccelerationTask, Cost, Feedback};
use crate::inverse_dynamics::{InverseDynamics, MotionState};
use crate::tasks::steering_error;

/// A steered wheel turns until it rolls along the velocity that its centre has where the base moves as one rigid body.
///
/// With the angle `e` of the [task of velocities](crate::tasks::RigidRotationTask), the normal `n` of the ground, the yaw rate `W` of
/// the base, and the angular velocity `w` of the wheel and its angular acceleration `w'` without accelerations of the joints,
///
/// ```text
/// A = n' J_w                                      1 x nv, on the accelerations
/// b = kp e + kd (W - n' w) - n' w'                rad/s2; the base keeps its velocity
/// W = weight                                      1/(rad/s2)
/// ```
///
/// A wheel that is to stand, or that lies flat, is asked for nothing.
///
/// ```
/// use motorium_control::inverse_dynamics::tasks::{Feedback, RigidRotationAcceleration};
/// use motorium_robots::load;
/// use nalgebra::Vector3;
///
/// let panda = load("panda", std::path::Path::new("."))?.model;
/// let (wheel, base) = (panda.frame("panda_hand")?, panda.frame("panda_link0")?);
/// let mut steering =
///     RigidRotationAcceleration::new(&panda, wheel, base, Vector3::y_axis(), Feedback::critical(10.0));
/// steering.set_twist(0.5, 0.0, 0.0); // the base drives along its x
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct RigidRotationAcceleration {
    wheel: FrameId,
    base: FrameId,
    axis: Unit<Vector3<f64>>,
    normal: Unit<Vector3<f64>>,
    feedback: Feedback,
    weight: f64,
    /// Velocity of the base in its own axes: along x, along y, about z.
    twist: [f64; 3],
    error: f64,
    jacobian: Matrix6xX<f64>,
    cost: Cost,
}

impl RigidRotationAcceleration {
    /// A task for the wheel whose centre is the origin of the frame `wheel`, with its axis in the axes of that frame, on a base with
    /// the frame `base` at rest on level ground; with weight 1.
    pub fn new(
        model: &Model,
        wheel: FrameId,
        base: FrameId,
        axis: Unit<Vector3<f64>>,
        feedback: Feedback,
    ) -> Self {
        Self {
            wheel,
            base,
            axis,
            normal: Vector3::z_axis(),
            feedback,
            weight: 1.0,
            twist: [0.0; 3],
            error: 0.0,
            jacobian: Matrix6xX::zeros(model.nv()),
            cost: Cost::dense(1, 0, model.nv()),
        }
    }

    /// The same task on ground with another normal, world axes.
    #[must_use]
    pub fn on(mut self, normal: Unit<Vector3<f64>>) -> Self {
        self.normal = normal;
        self
    }

    /// Changes feedback and weight \[1/(rad/s2)\] from the next update on.
    pub fn set(&mut self, feedback: Feedback, weight: f64) {
        (self.feedback, self.weight) = (feedback, weight);
    }

    /// Sets the velocity of the base in its own axes: along x and y \[m/s\], and about z \[rad/s\].
    pub fn set_twist(&mut self, x: f64, y: f64, yaw: f64) {
        self.twist = [x, y, yaw];
    }

    /// `e` at the last update \[rad\], from -pi/2 to pi/2; 0 for a wheel that is asked for nothing.
    pub fn error(&self) -> f64 {
        self.error
    }
}

impl AccelerationTask for RigidRotationAcceleration {
    fn update(&mut self, state: &MotionState<'_>, _: &InverseDynamics) {
        let MotionState { model, kinematics, .. } = *state;
        let [wheel, base] = [self.wheel, self.base].map(|frame| kinematics.pose(model, frame));
        let error = steering_error(&wheel, &base, &self.axis, &self.normal, self.twist);
        self.error = error.unwrap_or(0.0);
        let normal = self.normal.into_inner();
        let rate = normal.dot(&kinematics.velocity(model, self.wheel).angular);
        let drift = normal.dot(&kinematics.acceleration(model, self.wheel).angular);
        let Feedback { kp, kd } = self.feedback;
        self.cost.desired_mut()[0] = kp * self.error + kd * (self.twist[2] - rate) - drift;
        self.cost.weights_mut()[0] = if error.is_some() { self.weight } else { 0.0 };
        kinematics.jacobian(model, self.wheel, Reference::LocalWorldAligned, &mut self.jacobian);
        for (mut row, frame) in self.cost.matrix_mut().column_iter_mut().zip(self.jacobian.column_iter()) {
            row[0] = normal.dot(&frame.fixed_rows::<3>(3));
        }
    }

    fn cost(&self) -> &Cost {
        &self.cost
    }
}
