//! Points an axis of a frame at a point.

use motorium::prelude::*;
use motorium_robots::{FrameId, Model, Reference};
use nalgebra::{Matrix6xX, Unit, Vector3};

use super::context::TaskContext;
use super::held::{Driven, Reach};
use super::jacobian_view::JacobianView;
use super::kind::{BuiltTask, GAINS, TaskKind, WEIGHTS};
use super::target::TargetInput;
use super::{Cost, Equation, Feedback, Response, Task};
use crate::{GoalError, GoalTolerance, MotionState, RobotState};

/// Minimum distance from the frame origin to the target \[m\]; closer targets are ignored because the
/// direction is undefined.
const NEAREST: f64 = 1e-2;

with_defaults! {
    /// Gain and weights of a [`GazeTask`].
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct GazeSettings;

    /// Rate at which the error decays \[1/s\]. Should be below a tenth of the tick rate. Default 10.
    pub gain: f64 = 10.0;
    /// Cost of an angular velocity error \[1/(rad/s)\], or of an acceleration error \[1/(rad/s2)\]. Default
    /// 1.
    pub weight: f64 = 1.0;
    /// Maximum angular speed at which the error is corrected \[rad/s\]. Default infinite.
    pub max_speed: f64 = f64::INFINITY;
    /// Levenberg-Marquardt damping per unit of correction speed \[s/rad\]. Prevents oscillation if the axis
    /// cannot reach the target direction, and vanishes once the axis points at the target. Default 5e-3.
    pub damping: f64 = 5e-3;
}

impl GazeSettings {
    fn response(&self) -> Response {
        let Self { gain, max_speed, damping, .. } = *self;
        Response { max_speeds: [max_speed, f64::INFINITY], damping, ..Response::decay(gain) }
    }
}

/// Points an axis `d` of a frame at a point `p*` \[m, world axes\], for example the axis of a camera at an
/// object, or of a welding torch at a seam. Rotation about the axis is free.
///
/// With `r` the point and `w` its velocity in the axes of the frame, `u = r / |r|`, `P = 1 - u u'`, and
/// `J_v`, `J_o` the linear and the angular rows of the frame's Jacobian in its own axes,
///
/// ```text
/// e  = the rotation vector that turns d onto u   rad, axes of the frame
/// nu = u x w / |r|                               so that nu - J v = u x u'
/// J  = P J_o + [u]x J_v / |r|                    3 x nv, of rank 2
/// W  = weight
/// ```
///
/// OpenSoT's gaze task has two rows and assumes a point at rest. Here, the point is assumed to move at
/// constant velocity.
///
/// ```
/// use motorium_control::{RobotState, tasks::{GazeTask, VelocityTask}};
/// use motorium_robots::{Kinematics, load};
/// use nalgebra::Vector3;
///
/// let panda = load("panda", std::path::Path::new("."))?;
/// let (model, home) = (&panda.model, panda.profile.unwrap().home(&panda.model)?);
/// let mut kinematics = Kinematics::new(model);
/// kinematics.update(model, home.as_slice());
///
/// // the hand points down: a point below it is looked at already
/// let mut gaze = GazeTask::new(model, model.frame("panda_hand_tcp")?, Vector3::z_axis());
/// let hand = kinematics.pose(model, gaze.frame()).translation.vector;
/// gaze.set_target(hand - Vector3::z());
/// gaze.update(&RobotState { model, kinematics: &kinematics, q: home.as_slice() });
/// assert!(gaze.angle() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct GazeTask {
    settings: GazeSettings,
    frame: FrameId,
    axis: Unit<Vector3<f64>>,
    target: Vector3<f64>,
    velocity: Vector3<f64>,
    /// Direction to the point in the axes of the frame, and the distance, at the last update.
    seen: (Vector3<f64>, f64),
    frame_jacobian: Matrix6xX<f64>,
    equation: Equation,
}

settings!(GazeTask, GazeSettings);
weight!(GazeTask);

impl GazeTask {
    /// Creates a task for an axis of `frame`, given in the frame's axes, with the world's origin as target.
    pub fn new(model: &Model, frame: FrameId, axis: Unit<Vector3<f64>>) -> Self {
        let settings = GazeSettings::default();
        let mut equation = Equation::dense(3, 0, model.nv());
        equation.response = settings.response();
        Self {
            settings,
            frame,
            axis,
            target: Vector3::zeros(),
            velocity: Vector3::zeros(),
            seen: (axis.into_inner(), NEAREST),
            frame_jacobian: Matrix6xX::zeros(model.nv()),
            equation,
        }
    }

    /// Sets a resting target point `p*` \[m, world axes\].
    pub fn set_target(&mut self, target: Vector3<f64>) {
        self.set_moving_target(target, Vector3::zeros());
    }

    /// Sets a moving target: the point `p*` \[m\] and its velocity \[m/s\], in world axes.
    pub fn set_moving_target(&mut self, target: Vector3<f64>, velocity: Vector3<f64>) {
        (self.target, self.velocity) = (target, velocity);
    }

    /// Returns the frame to which the axis belongs.
    pub fn frame(&self) -> FrameId {
        self.frame
    }

    /// Returns the axis, in the axes of the frame.
    pub fn axis(&self) -> &Unit<Vector3<f64>> {
        &self.axis
    }

    /// Returns the target point `p*` \[m, world axes\].
    pub fn target(&self) -> &Vector3<f64> {
        &self.target
    }

    /// Returns the error `e` at the last update \[rad, axes of the frame\].
    pub fn error(&self) -> Vector3<f64> {
        self.equation.error.fixed_rows::<3>(0).into()
    }

    /// Returns the angle between the axis and the direction to the point at the last update \[rad\], in `[0,
    /// pi]`.
    pub fn angle(&self) -> f64 {
        self.error().norm()
    }

    /// Returns `J` at the last update, 3 x nv, of rank 2.
    pub fn jacobian(&self) -> JacobianView<'_, 3> {
        self.equation.jacobian().fixed_rows::<3>(0)
    }

    /// Returns the desired value `b` at the last update \[rad/s or rad/s2\].
    pub fn desired(&self) -> Vector3<f64> {
        self.cost().desired().fixed_rows::<3>(0).into()
    }

    /// The direction to the point in the axes of the frame, and the distance.
    fn direction(&self, state: &RobotState<'_>) -> (Vector3<f64>, f64) {
        let pose = state.kinematics.pose(state.model, self.frame);
        let seen = pose.rotation.inverse() * (self.target - pose.translation.vector);
        let distance = seen.norm();
        if distance < NEAREST { (self.axis.into_inner(), NEAREST) } else { (seen / distance, distance) }
    }

    /// Returns the angle between the axis and the direction to the point in a state \[rad\].
    pub fn angle_at(&self, state: &RobotState<'_>) -> f64 {
        least_turn(&self.axis, &self.direction(state).0).norm()
    }
}

/// Returns the rotation vector of the smallest rotation from one unit vector to another \[rad\].
fn least_turn(from: &Vector3<f64>, to: &Vector3<f64>) -> Vector3<f64> {
    let normal = from.cross(to);
    let (sine, cosine) = (normal.norm(), from.dot(to));
    if sine > 1e-9 {
        return normal * (sine.atan2(cosine) / sine);
    }
    if cosine > 0.0 {
        return normal;
    }
    // opposite vectors: any perpendicular axis will do, but always the same one
    let across = from.cross(&Vector3::ith(from.iamin(), 1.0)).normalize();
    across * core::f64::consts::PI
}

/// Component of `x` perpendicular to the direction `u`.
fn across(u: &Vector3<f64>, x: Vector3<f64>) -> Vector3<f64> {
    x - u * u.dot(&x)
}

impl Task for GazeTask {
    fn evaluate(&mut self, state: &RobotState<'_>) {
        self.seen = self.direction(state);
        let (u, distance) = self.seen;
        let axes = state.kinematics.pose(state.model, self.frame).rotation.inverse();
        let equation = &mut self.equation;
        equation.error.copy_from(&least_turn(&self.axis, &u));
        equation.rate.copy_from(&(u.cross(&(axes * self.velocity)) / distance));
        equation.weights_mut().fill(self.settings.weight);
        state.kinematics.jacobian(state.model, self.frame, Reference::Local, &mut self.frame_jacobian);
        for (mut row, frame) in
            equation.jacobian_mut().column_iter_mut().zip(self.frame_jacobian.column_iter())
        {
            let (linear, angular) = (frame.fixed_rows::<3>(0), frame.fixed_rows::<3>(3));
            row.copy_from(&(across(&u, angular.into()) + u.cross(&linear) / distance));
        }
    }

    fn differentiate(&mut self, state: &MotionState<'_>) {
        let MotionState { model, kinematics, .. } = *state;
        let (u, distance) = self.seen;
        let axes = kinematics.pose(model, self.frame).rotation.inverse();
        let moving = kinematics.velocity(model, self.frame);
        let drift = kinematics.acceleration(model, self.frame);
        let (v, o, w) = (axes * moving.linear, axes * moving.angular, axes * self.velocity);
        let relative = v - w;
        // rate of the axis relative to the point
        let rate = across(&u, o) + u.cross(&relative) / distance;
        // derivatives of components in the turning axes of the frame, at a = 0
        let direction_rate = u.cross(&rate);
        let distance_rate = -u.dot(&relative);
        let relative_rate = axes * drift.linear - o.cross(&relative);
        let drift =
            across(&u, axes * drift.angular) - direction_rate * u.dot(&o) - u * direction_rate.dot(&o)
                + (direction_rate.cross(&relative) + u.cross(&relative_rate)) / distance
                - u.cross(&relative) * (distance_rate / (distance * distance));
        self.equation.error_rate.copy_from(&-rate);
        self.equation.drift.copy_from(&drift);
    }

    equation!();
}

/// Distance of the virtual target used when no target is set, m; large enough that frame motion does not
/// change the direction.
const FAR: f64 = 1e6;

task_config! {
    /// A gaze task: an axis of a frame points at a target point.
    GazeConfig "gaze" {
        /// Link whose axis points at the target. Default: the robot's only end effector.
        frame: Option<String> = None;
        /// Axis in the axes of the frame, of any nonzero length. Default [0, 0, 1].
        axis: [f64; 3] = [0.0, 0.0, 1.0];
        /// Name of the input port of the target; only its position and linear velocity are used. The input is
        /// optional: without a target, the axis keeps its direction. Default "gaze_target".
        target: String = "gaze_target".to_owned() => target(
            optional PoseTarget, "position and linear velocity of the point to look at, in the world frame"
        );
        /// Rate at which the error decays, 1/s, 0 to 1000; limited to half the tick rate. Default 10.
        gain: f64 = GazeSettings::default().gain => live(GAINS, "1/s", "rate at which the error decays");
        /// Cost of an angular velocity error, 1/(rad/s), 0 to 1000. Default 1.
        weight: f64 = GazeSettings::default().weight => live(
            WEIGHTS, "1/(rad/s)", "cost of an angular velocity error"
        );
        /// Maximum angular speed of the correction, rad/s. Default: no limit.
        max_speed: Option<f64> = None;
        /// Levenberg-Marquardt damping, s/rad; prevents oscillation if the axis cannot reach the target
        /// direction. Default: 5e-3, or two tick periods if that is larger.
        damping: Option<f64> = None;
        /// Maximum angle from a goal at which the goal counts as reached, rad. Default 0.02.
        tolerance: f64 = GoalTolerance::default().orientation => within(0.0..=f64::MAX);
    }
}

impl GazeConfig {
    fn build(&self, context: &TaskContext<'_>) -> Result<GazeTask, ConfigError> {
        let frame = context.frame("gaze", self.frame.as_deref())?;
        Ok(GazeTask::new(context.model, frame, context.axis("axis", self.axis)?).with(GazeSettings {
            gain: self.gain,
            weight: self.weight,
            max_speed: context.max_speed("max_speed", self.max_speed)?,
            damping: context.damping(self.damping, GazeSettings::default().damping)?,
        }))
    }
}

impl TaskKind for GazeConfig {
    check_by_building!();

    fn configure(&self, context: &TaskContext<'_>, setup: &mut Setup) -> BuiltTask {
        let tolerance = GoalTolerance { position: f64::INFINITY, orientation: self.tolerance };
        let target = TargetInput::new(setup.input(&self.target)?, tolerance);
        let task = Driven::motion(self.build(context)?, self.open(setup)?, |task, [gain, weight], bounds| {
            let gain = gain.min(bounds.max_gain);
            task.set_settings(GazeSettings { gain, weight, ..*task.settings() });
        });
        Ok(Box::new(task.reaching(Reach {
            target,
            start: |task, start| {
                let pose = start.kinematics.pose(start.model, task.frame());
                let ahead = pose.rotation * task.axis().into_inner();
                task.set_target(pose.translation.vector + ahead * FAR);
            },
            follow: |task, point, velocity| task.set_moving_target(point, velocity),
            error: |task, measured| GoalError { position: 0.0, orientation: Some(task.angle_at(measured)) },
        })))
    }
}
