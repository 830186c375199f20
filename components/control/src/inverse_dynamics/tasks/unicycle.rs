//! A base drives like a unicycle, by its acceleration.

use motorium_robots::{FrameId, Model, Reference};
use nalgebra::Matrix6xX;

use super::{AccelerationTask, Cost};
use crate::inverse_dynamics::{InverseDynamics, MotionState};
use crate::tasks::UnicycleSettings;

/// Moves a frame forward and turns it as commanded, and never sideways.
///
/// In the axes of the frame, with its velocity `v`, `w` and its acceleration `v'`, `w'` without accelerations
/// of the joints,
///
/// ```text
/// s = (v_x, v_y, w_z)                         m/s, m/s, rad/s
/// A = rows x, y of J_v and z of J_w           J: Jacobian of the frame in its own axes, on the accelerations
/// b = rate ((forward, 0, yaw rate) - s) - ((v' - w x v)_x, (v' - w x v)_y, w'_z)
/// W = diag(f, s, y)                           1/(m/s2), 1/(m/s2), 1/(rad/s2)
/// ```
///
/// (the [unicycle task](crate::tasks::UnicycleTask) of velocities: an error of the velocity decays at
/// `rate`). Position drift is not corrected.
///
/// ```
/// use motorium_control::{inverse_dynamics::tasks::UnicycleAcceleration, tasks::UnicycleSettings};
/// use motorium_robots::load;
///
/// let robot = load("quadruped", std::path::Path::new("."))?.model;
/// let drive = UnicycleAcceleration::new(&robot, robot.frame("base")?, 10.0)
///     .with(UnicycleSettings { forward: 0.5, ..UnicycleSettings::default() });
/// assert_eq!(drive.settings().forward, 0.5);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct UnicycleAcceleration {
    frame: FrameId,
    rate: f64,
    settings: UnicycleSettings,
    jacobian: Matrix6xX<f64>,
    cost: Cost,
}

impl UnicycleAcceleration {
    /// Creates a task for `frame` of `model`, initially at rest, with default weights; velocity errors decay
    /// at `rate` \[1/s\].
    pub fn new(model: &Model, frame: FrameId, rate: f64) -> Self {
        let (jacobian, cost) = (Matrix6xX::zeros(model.nv()), Cost::dense(3, 0, model.nv()));
        Self { frame, rate, settings: UnicycleSettings::default(), jacobian, cost }
    }

    /// The same task with these speeds and weights.
    #[must_use]
    pub fn with(mut self, settings: UnicycleSettings) -> Self {
        self.settings = settings;
        self
    }

    /// Changes speeds and weights from the next update on.
    pub fn set_settings(&mut self, settings: UnicycleSettings) {
        self.settings = settings;
    }

    /// Speeds and weights.
    pub fn settings(&self) -> &UnicycleSettings {
        &self.settings
    }
}

impl AccelerationTask for UnicycleAcceleration {
    fn update(&mut self, state: &MotionState<'_>, _: &InverseDynamics) {
        let MotionState { model, kinematics, .. } = *state;
        let axes = kinematics.pose(model, self.frame).rotation.inverse();
        let moving = kinematics.velocity(model, self.frame);
        let drift = kinematics.acceleration(model, self.frame);
        let (v, w) = (axes * moving.linear, axes * moving.angular);
        let (linear, angular) = (axes * drift.linear - w.cross(&v), axes * drift.angular);
        let UnicycleSettings { forward, yaw_rate, forward_weight, sideways_weight, yaw_weight } =
            self.settings;
        self.cost.desired_mut().copy_from_slice(&[
            self.rate * (forward - v.x) - linear.x,
            self.rate * -v.y - linear.y,
            self.rate * (yaw_rate - w.z) - angular.z,
        ]);
        self.cost.weights_mut().copy_from_slice(&[forward_weight, sideways_weight, yaw_weight]);
        kinematics.jacobian(model, self.frame, Reference::Local, &mut self.jacobian);
        for (mut row, frame) in self.cost.matrix_mut().column_iter_mut().zip(self.jacobian.column_iter()) {
            (row[0], row[1], row[2]) = (frame[0], frame[1], frame[5]);
        }
    }

    fn cost(&self) -> &Cost {
        &self.cost
    }
}
