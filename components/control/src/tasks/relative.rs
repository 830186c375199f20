//! A frame reaches a pose relative to another frame.

use motorium_robots::{FrameId, Model, Reference, lie::se3};
use nalgebra::{Isometry3, Matrix6xX, Vector6};

use super::cartesian::{differentiate_error, stacked};
use super::{Cost, Equation, Feedback, PoseError, Response, Task};
use crate::{MotionState, RobotState};

/// Gain and weights of a [`RelativeTask`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeSettings {
    /// Form of the error. Default logarithm.
    pub error: PoseError,
    /// Rate at which the error decays \[1/s\]. Default 10.
    pub gain: f64,
    /// Cost of a velocity error \[1/(m/s)\], or of an acceleration error \[1/(m/s2)\]. Default 1.
    pub position_weight: f64,
    /// Cost of an angular velocity error \[1/(rad/s)\], or of an acceleration error \[1/(rad/s2)\]. Default
    /// 0.5.
    pub orientation_weight: f64,
}

impl Default for RelativeSettings {
    fn default() -> Self {
        Self { error: PoseError::Logarithm, gain: 10.0, position_weight: 1.0, orientation_weight: 0.5 }
    }
}

impl RelativeSettings {
    /// The defaults, with a [geometric](PoseError::Geometric) error.
    pub fn geometric() -> Self {
        Self { error: PoseError::Geometric, ..Self::default() }
    }

    fn response(&self) -> Response {
        Response::decay(self.gain)
    }
}

/// Moves a frame `b` to a pose `t` relative to a frame `a` of the same robot, such as one hand relative to
/// the other. The target rests in `a`, and the motion of a floating base cancels.
///
/// With `T_ab` the pose of `b` in `a`, and `T_bt = T_ab^-1 T_at`, a [logarithmic](PoseError::Logarithm) error
/// is in the axes of `b`:
///
/// ```text
/// e = log(T_bt)                                   m, rad
/// J = Jlog(T_tb) (J_b - Ad(T_ba) J_a)             J_a, J_b: Jacobians of both frames in their own axes
/// W = diag(p, p, p, o, o, o)
/// ```
///
/// (Pink's relative frame task). A [geometric](PoseError::Geometric) error is in the axes of `a`. With the
/// vector `d` from `a` to `b`, the velocities `v`, `w` of both frames, and their accelerations `v'`, `w'`
/// without accelerations of the joints,
///
/// ```text
/// e    = (p* - R_a' d, log(R* R_ab'))
/// J v  = R_a' (v_b - v_a - w_a x d, w_b - w_a)    velocity of b as seen from a
/// J' v = R_a' (v_b' - v_a' - w_a' x d - w_a x (w_a x d) - 2 w_a x (v_b - v_a - w_a x d),
///              w_b' - w_a' - w_a x w_b)
/// ```
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
    frames: [FrameId; 2],
    settings: RelativeSettings,
    target: Isometry3<f64>,
    other: Matrix6xX<f64>,
    equation: Equation,
}

settings!(RelativeTask, RelativeSettings);

impl RelativeTask {
    /// A task for the frame `b` relative to `a`, with the frame `a` as target and default settings.
    pub fn new(model: &Model, a: FrameId, b: FrameId) -> Self {
        let settings = RelativeSettings::default();
        let mut equation = Equation::dense(6, 0, model.nv());
        equation.response = settings.response();
        let (target, other) = (Isometry3::identity(), Matrix6xX::zeros(model.nv()));
        Self { frames: [a, b], settings, target, other, equation }
    }

    /// The frames `a` and `b`.
    pub fn frames(&self) -> [FrameId; 2] {
        self.frames
    }

    /// Target pose of `b` in the frame `a`.
    pub fn target(&self) -> &Isometry3<f64> {
        &self.target
    }

    /// Sets the pose of `b` in the frame `a`.
    pub fn set_target(&mut self, target: Isometry3<f64>) {
        self.target = target;
    }

    /// `e` at the last update: linear \[m\], angular \[rad\], in the axes of `b`, or of `a` if geometric.
    pub fn error(&self) -> Vector6<f64> {
        self.equation.error.fixed_rows::<6>(0).into()
    }

    fn evaluate_logarithm(&mut self, state: &RobotState<'_>, [pose_a, pose_b]: [Isometry3<f64>; 2]) {
        let RobotState { model, kinematics, .. } = *state;
        let in_b = pose_b.inv_mul(&pose_a);
        let target = in_b * self.target;
        self.equation.error.copy_from(&se3::log(&target));
        let jacobian = self.equation.jacobian_mut();
        kinematics.jacobian(model, self.frames[0], Reference::Local, &mut self.other);
        kinematics.jacobian(model, self.frames[1], Reference::Local, jacobian);
        let (derivative, carried) = (se3::log_jacobian(&target.inverse()), se3::adjoint(&in_b));
        for (mut column, other) in jacobian.column_iter_mut().zip(self.other.column_iter()) {
            let relative = column.fixed_rows::<6>(0) - carried * other;
            column.copy_from(&(derivative * relative));
        }
    }

    fn evaluate_geometric(&mut self, state: &RobotState<'_>, [pose_a, pose_b]: [Isometry3<f64>; 2]) {
        let RobotState { model, kinematics, .. } = *state;
        let (axes, d) = (pose_a.rotation.inverse(), pose_b.translation.vector - pose_a.translation.vector);
        let turn = self.target.rotation * (axes * pose_b.rotation).inverse();
        let position = self.target.translation.vector - axes * d;
        self.equation.error.copy_from(&stacked((position, turn.scaled_axis())));
        let (jacobian, reference) = (self.equation.jacobian_mut(), Reference::LocalWorldAligned);
        kinematics.jacobian(model, self.frames[0], reference, &mut self.other);
        kinematics.jacobian(model, self.frames[1], reference, jacobian);
        for (mut column, other) in jacobian.column_iter_mut().zip(self.other.column_iter()) {
            let (own_linear, own_angular) = (column.fixed_rows::<3>(0), column.fixed_rows::<3>(3));
            let (linear, angular) = (other.fixed_rows::<3>(0), other.fixed_rows::<3>(3));
            let (linear, angular) = (own_linear - linear + d.cross(&angular), own_angular - angular);
            column.fixed_rows_mut::<3>(0).copy_from(&(axes * linear));
            column.fixed_rows_mut::<3>(3).copy_from(&(axes * angular));
        }
    }
}

impl Task for RelativeTask {
    fn evaluate(&mut self, state: &RobotState<'_>) {
        let RelativeSettings { error, position_weight, orientation_weight, .. } = self.settings;
        let poses = self.frames.map(|frame| state.kinematics.pose(state.model, frame));
        match error {
            PoseError::Logarithm => self.evaluate_logarithm(state, poses),
            PoseError::Geometric => self.evaluate_geometric(state, poses),
        }
        self.equation.weights_mut().fixed_rows_mut::<3>(0).fill(position_weight);
        self.equation.weights_mut().fixed_rows_mut::<3>(3).fill(orientation_weight);
    }

    fn differentiate(&mut self, state: &MotionState<'_>) {
        let MotionState { model, kinematics, .. } = *state;
        let poses = self.frames.map(|frame| kinematics.pose(model, frame));
        let moving = self.frames.map(|frame| kinematics.velocity(model, frame));
        let drift = self.frames.map(|frame| kinematics.acceleration(model, frame));
        let equation = &mut self.equation;
        if self.settings.error == PoseError::Logarithm {
            let error = |[a, b]: [Isometry3<f64>; 2]| se3::log(&(b.inv_mul(&a) * self.target));
            let (rate, second) = differentiate_error(error, poses, moving, drift);
            equation.error_rate.copy_from(&rate);
            equation.rate_derivative.copy_from(&second);
            return;
        }
        let ([pose_a, pose_b], [at_a, at_b], [drift_a, drift_b]) = (poses, moving, drift);
        let axes = pose_a.rotation.inverse();
        let (d, w) = (pose_b.translation.vector - pose_a.translation.vector, at_a.angular);
        let seen = at_b.linear - at_a.linear - w.cross(&d);
        let linear = drift_b.linear
            - drift_a.linear
            - drift_a.angular.cross(&d)
            - w.cross(&w.cross(&d))
            - w.cross(&seen) * 2.0;
        let angular = drift_b.angular - drift_a.angular - w.cross(&at_b.angular);
        equation.error_rate.copy_from(&-stacked((axes * seen, axes * (at_b.angular - w))));
        equation.rate_derivative.fill(0.0);
        equation.drift.copy_from(&stacked((axes * linear, axes * angular)));
    }

    equation!();
}
