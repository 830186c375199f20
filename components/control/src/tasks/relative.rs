//! A frame reaches a pose relative to another frame.

use motorium_robots::{FrameId, Model, Reference, lie::se3};
use nalgebra::{Isometry3, Matrix6xX, Vector6};

use super::{Cost, Rows, VelocityTask};
use crate::{RobotState, solver::Problem};

/// Gain and weights of a [`RelativeTask`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeSettings {
    /// Rate at which the error decays \[1/s\]. Default 10.
    pub gain: f64,
    /// Cost of a velocity error \[1/(m/s)\]. Default 1.
    pub position_weight: f64,
    /// Cost of an angular velocity error \[1/(rad/s)\]. Default 0.5.
    pub orientation_weight: f64,
}

impl Default for RelativeSettings {
    fn default() -> Self {
        Self { gain: 10.0, position_weight: 1.0, orientation_weight: 0.5 }
    }
}

/// Moves a frame `b` to a pose `t` relative to a frame `a` of the same robot, such as one hand relative to
/// the other.
///
/// With `T_ab` the pose of `b` in `a`, and `T_bt = T_ab^-1 T_at`,
///
/// ```text
/// e = log(T_bt)                                   linear (m), angular (rad), in the axes of b
/// A = Jlog(T_tb) (J_b - Ad(T_ba) J_a)             J: Jacobians of both frames in their own axes
/// b = gain e,   W = diag(p, p, p, o, o, o)
/// ```
///
/// so that `e' = -A v` (Pink's relative frame task). The motion of a floating base cancels.
///
/// ```
/// use motorium_control::{RobotState, tasks::{RelativeTask, VelocityTask}};
/// use motorium_robots::{Kinematics, load};
///
/// let humanoid = load("humanoid", std::path::Path::new("."))?.model;
/// let (left, right) = (humanoid.frame("left_palm")?, humanoid.frame("right_palm")?);
/// let (q, mut kinematics) = (humanoid.neutral(), Kinematics::new(&humanoid));
/// kinematics.update(&humanoid, &q);
/// let mut task = RelativeTask::new(&humanoid, left, right);
/// task.set_target(kinematics.pose(&humanoid, left).inv_mul(&kinematics.pose(&humanoid, right)));
/// task.update(&RobotState { model: &humanoid, kinematics: &kinematics, q: &q });
/// assert!(task.error().norm() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct RelativeTask {
    /// The frames `a` and `b`.
    frames: (FrameId, FrameId),
    settings: RelativeSettings,
    target: Isometry3<f64>,
    error: Vector6<f64>,
    other: Matrix6xX<f64>,
    cost: Cost,
}

impl RelativeTask {
    /// A task for the frame `b` relative to `a`, with the frame `a` as target and default settings.
    pub fn new(model: &Model, a: FrameId, b: FrameId) -> Self {
        Self {
            frames: (a, b),
            settings: RelativeSettings::default(),
            target: Isometry3::identity(),
            error: Vector6::zeros(),
            other: Matrix6xX::zeros(model.nv()),
            cost: Cost::dense(6, 0, model.nv()),
        }
    }

    /// The same task with these settings.
    #[must_use]
    pub fn with(mut self, settings: RelativeSettings) -> Self {
        self.settings = settings;
        self
    }

    /// Changes gain and weights from the next update on.
    pub fn set_settings(&mut self, settings: RelativeSettings) {
        self.settings = settings;
    }

    /// Gain and weights.
    pub fn settings(&self) -> &RelativeSettings {
        &self.settings
    }

    /// The frames `a` and `b`.
    pub fn frames(&self) -> (FrameId, FrameId) {
        self.frames
    }

    /// Pose of `b` in the frame `a` that is aimed at.
    pub fn target(&self) -> &Isometry3<f64> {
        &self.target
    }

    /// Sets the pose of `b` in the frame `a`.
    pub fn set_target(&mut self, target: Isometry3<f64>) {
        self.target = target;
    }

    /// `e` at the last update: linear \[m\], angular \[rad\], in the axes of `b`.
    pub fn error(&self) -> &Vector6<f64> {
        &self.error
    }

    /// The cost as of the last update.
    pub fn cost(&self) -> &Cost {
        &self.cost
    }
}

impl VelocityTask for RelativeTask {
    fn rows(&self) -> usize {
        6
    }

    fn update(&mut self, state: &RobotState<'_>) {
        let RobotState { model, kinematics, .. } = *state;
        let (a, b) = self.frames;
        let in_b = kinematics.pose(model, b).inv_mul(&kinematics.pose(model, a));
        let target = in_b * self.target;
        self.error = se3::log(&target);
        kinematics.jacobian(model, a, Reference::Local, &mut self.other);
        kinematics.jacobian(model, b, Reference::Local, self.cost.matrix_mut());
        let (derivative, carried) = (se3::log_jacobian(&target.inverse()), se3::adjoint(&in_b));
        for (mut column, other) in self.cost.matrix_mut().column_iter_mut().zip(self.other.column_iter()) {
            let relative = column.fixed_rows::<6>(0) - carried * other;
            column.copy_from(&(derivative * relative));
        }
        let RelativeSettings { gain, position_weight, orientation_weight } = self.settings;
        self.cost.desired_mut().copy_from(&(self.error * gain));
        self.cost.weights_mut().fixed_rows_mut::<3>(0).fill(position_weight);
        self.cost.weights_mut().fixed_rows_mut::<3>(3).fill(orientation_weight);
    }

    fn residual(&self, velocity: &[f64]) -> f64 {
        self.cost.residual(velocity)
    }

    fn add_to(&self, problem: &mut Problem) {
        self.cost.add_to(problem);
    }

    fn write_rows(&self, rows: &mut Rows) {
        self.cost.write_rows(rows);
    }
}
