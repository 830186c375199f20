//! Makes a frame reach a pose relative to another frame.

use motorium::prelude::*;
use motorium_robots::{FrameId, Model, Reference, lie::se3};
use nalgebra::{Isometry3, Matrix6xX, Vector6};

use super::axes::stacked;
use super::cartesian::differentiate_error;
use super::context::TaskContext;
use super::held::{HeldTask, TaskCost};
use super::kind::{ActsOn, BuiltTask, GAINS, TaskHead, TaskKind, TaskTable, WEIGHTS};
use super::ramp::{Fades, Ramped, TaskBounds};
use super::{Cost, Equation, Feedback, PoseError, Response, Task};
use crate::checks::pose_of;
use crate::{MotionState, RobotState};

with_defaults! {
    /// Gain and weights of a [`RelativeTask`].
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct RelativeSettings;

    /// Form of the error. Default: logarithm.
    pub error: PoseError = PoseError::Logarithm;
    /// Rate at which the error decays \[1/s\]. Default 10.
    pub gain: f64 = 10.0;
    /// Cost of a velocity error \[1/(m/s)\], or of an acceleration error \[1/(m/s2)\]. Default 1.
    pub position_weight: f64 = 1.0;
    /// Cost of an angular velocity error \[1/(rad/s)\], or of an acceleration error \[1/(rad/s2)\]. Default
    /// 0.5.
    pub orientation_weight: f64 = 0.5;
}

impl RelativeSettings {
    /// Returns the defaults with a [geometric](PoseError::Geometric) error.
    pub fn geometric() -> Self {
        Self { error: PoseError::Geometric, ..Self::default() }
    }

    fn response(&self) -> Response {
        Response::decay(self.gain)
    }
}

/// Moves a frame `b` to a pose `t` relative to a frame `a` of the same robot, such as one hand relative to
/// the other. The target is at rest in `a`; the motion of a floating base has no effect.
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
/// Pink's relative frame task is the same. A [geometric](PoseError::Geometric) error is in the axes of `a`.
/// With the vector `d` from `a` to `b`, the velocities `v`, `w` of both frames, and their accelerations `v'`,
/// `w'` for zero joint accelerations,
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
    /// Creates a task for the frame `b` relative to `a`, with the frame `a` as target and default settings.
    pub fn new(model: &Model, a: FrameId, b: FrameId) -> Self {
        let settings = RelativeSettings::default();
        let mut equation = Equation::dense(6, 0, model.nv());
        equation.response = settings.response();
        let (target, other) = (Isometry3::identity(), Matrix6xX::zeros(model.nv()));
        Self { frames: [a, b], settings, target, other, equation }
    }

    /// Returns the frames `a` and `b`.
    pub fn frames(&self) -> [FrameId; 2] {
        self.frames
    }

    /// Returns the target pose of `b` in the frame `a`.
    pub fn target(&self) -> &Isometry3<f64> {
        &self.target
    }

    /// Sets the target pose of `b` in the frame `a`.
    pub fn set_target(&mut self, target: Isometry3<f64>) {
        self.target = target;
    }

    /// Returns the error `e` at the last update: linear \[m\], then angular \[rad\]. The error is in the axes
    /// of `b`, or in the axes of `a` for a geometric error.
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

task_config! {
    /// A relative task: a frame reaches a pose relative to another frame of the same robot.
    RelativeConfig "relative" {
        /// Link whose frame moves. Default: the robot's only end effector.
        frame: Option<String> = None;
        /// Link whose frame is the reference frame of the target.
        other: String = String::new();
        /// Name of the input port of the target: the pose of `frame` in `other`; its velocity is ignored.
        /// Without a target the initial pose is kept. Default "relative_target".
        target: String = "relative_target".to_owned() => target(
            optional PoseTarget, "pose of the frame in the other frame"
        );
        /// Rate at which the error decays, 1/s, 0 to 1000; limited to half the tick rate. Default 10.
        gain: f64 = RelativeSettings::default().gain => live(GAINS, "1/s", "rate at which the error decays");
        /// Cost of a velocity error, 1/(m/s), 0 to 1000. Default 1.
        position_weight: f64 = RelativeSettings::default().position_weight => live(
            WEIGHTS, "1/(m/s)", "cost of a velocity error"
        );
        /// Cost of an angular velocity error, 1/(rad/s), 0 to 1000. Default 0.5.
        orientation_weight: f64 = RelativeSettings::default().orientation_weight => live(
            WEIGHTS, "1/(rad/s)", "cost of an angular velocity error"
        );
    }
}

impl RelativeConfig {
    fn build(&self, context: &TaskContext<'_>) -> Result<RelativeTask, ConfigError> {
        let frame = context.frame("relative", self.frame.as_deref())?;
        let other = context.named_frame("other", &self.other)?;
        if frame == other {
            let message = format!("`{}` relative to itself", self.other);
            return Err(ConfigError::key(context.key("other"), message).advise("name another link"));
        }
        let settings = RelativeSettings { error: context.pose_error(), ..RelativeSettings::default() };
        Ok(RelativeTask::new(context.model, other, frame).with(settings))
    }
}

impl TaskKind for RelativeConfig {
    fn head(&self) -> TaskHead<'_> {
        self.table_head().acts_on(ActsOn::Joints)
    }

    check_by_building!();

    fn configure(&self, context: &TaskContext<'_>, setup: &mut Setup) -> BuiltTask {
        Ok(Box::new(HeldRelative {
            task: self.build(context)?,
            input: setup.input(&self.target)?,
            parameters: self.open(setup)?,
            is_set: false,
            refused: 0,
            counts: [self.position_weight, self.orientation_weight].map(|weight| weight > 0.0),
            error: None,
        }))
    }
}

/// A running relative task, which follows poses relative to another frame.
struct HeldRelative {
    task: RelativeTask,
    input: Input<PoseTarget>,
    /// Gain, and weights of position and orientation.
    parameters: [Ramped; 3],
    /// `true` after the first valid target.
    is_set: bool,
    /// Number of invalid target poses: the orientation is not a unit quaternion, or a number is not finite.
    refused: u64,
    /// `true` for the position, and for the orientation, if they are controlled.
    counts: [bool; 2],
    /// Error of the measured robot at the last step: position \[m\], orientation \[rad\].
    error: Option<[f64; 2]>,
}

impl HeldRelative {
    /// Returns the pose of the frame in the other frame.
    fn pose(&self, state: &RobotState<'_>) -> Isometry3<f64> {
        let [a, b] = self.task.frames().map(|frame| state.kinematics.pose(state.model, frame));
        a.inv_mul(&b)
    }
}

impl HeldTask for HeldRelative {
    fn begin(&mut self, start: &RobotState<'_>) {
        if !self.is_set {
            self.task.set_target(self.pose(start));
        }
    }

    fn reset(&mut self) {
        (self.is_set, self.refused, self.error) = (false, 0, None);
    }

    fn weigh(&mut self, bounds: &TaskBounds, fades: &mut Fades) {
        let [gain, position_weight, orientation_weight] =
            self.parameters.each_mut().map(|parameter| parameter.follow(bounds, fades));
        let gain = gain.min(bounds.max_gain);
        let settings = *self.task.settings();
        self.task.set_settings(RelativeSettings { gain, position_weight, orientation_weight, ..settings });
    }

    fn prepare(&mut self, _: &TaskBounds) {
        let Some(target) = self.input.latest() else { return };
        match pose_of(target.position, target.orientation) {
            Some(target) => {
                self.task.set_target(target);
                self.is_set = true;
            }
            None => self.refused += 1,
        }
    }

    fn cost(&mut self) -> TaskCost<'_> {
        TaskCost::Motion(&mut self.task)
    }

    fn record(&mut self, measured: &RobotState<'_>, _: f64) {
        let off = self.pose(measured).inv_mul(self.task.target());
        self.error = Some([off.translation.vector.norm(), off.rotation.angle()]);
    }

    fn result(&self) -> Option<serde_json::Value> {
        let error = |part: usize| self.error.filter(|_| self.counts[part]).map(|error| error[part]);
        Some(serde_json::json!({
            "last_position_error_m": error(0),
            "last_orientation_error_rad": error(1),
            "targets_refused": self.refused,
        }))
    }
}
