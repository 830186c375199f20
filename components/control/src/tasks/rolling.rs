//! Makes a wheel roll without slipping.

use motorium::prelude::*;
use motorium_robots::{FrameId, Model, Reference};
use nalgebra::{Matrix6xX, Unit, Vector3};

use super::context::TaskContext;
use super::held::Driven;
use super::kind::{ActsOn, BuiltTask, TaskHead, TaskKind, TaskTable, WEIGHTS};
use super::velocities::RATE;
use super::{Cost, Equation, Response, Task};
use crate::{MotionState, RobotState};

/// Sine of the angle between wheel axis and ground normal below which the wheel is treated as flat.
const FLAT: f64 = 1e-6;

/// Keeps the contact point of a wheel at rest, so that the wheel rolls without slipping or sliding.
///
/// In world axes, with the axis `d` of the wheel, the normal `n` of the ground, the vector `c` from the
/// wheel's centre to the contact point, the velocity `v`, `w` of the wheel and its acceleration `v'`, `w'`
/// for zero joint accelerations,
///
/// ```text
/// u    = (n - d d' n) / |n - d d' n|,   c = -radius u
/// J    = J_v - [c]x J_w                           velocity v + w x c of the point at the contact, 3 x nv
/// nu   = 0
/// J' v = v' + w' x c + w x c'
/// c'   = -radius (1 - u u') (-(w x d) d' n - d (w x d)' n) / |n - d d' n|
/// W    = weight                                   1/(m/s) or 1/(m/s2)
/// ```
///
/// OpenSoT has the same task, pure rolling. Under acceleration control, slip decays at the
/// [`rate`](Self::rate). On the first of several levels, the task couples a base to the rotation of its
/// wheels. The task is inactive for a flat wheel, which has no contact point.
#[derive(Clone, Debug)]
pub struct RollingTask {
    frame: FrameId,
    axis: Unit<Vector3<f64>>,
    radius: f64,
    normal: Unit<Vector3<f64>>,
    weight: f64,
    contact: Option<RollingContact>,
    frame_jacobian: Matrix6xX<f64>,
    equation: Equation,
}

/// Contact of a wheel that is not flat, in world axes.
#[derive(Clone, Copy, Debug)]
struct RollingContact {
    axis: Vector3<f64>,
    /// Direction from the ground to the centre of the wheel, and the length of the normal's component
    /// perpendicular to the axis.
    up: Vector3<f64>,
    length: f64,
    /// Vector from the centre of the wheel to the contact \[m\].
    arm: Vector3<f64>,
}

methods!(RollingTask: weight("1/(m/s) or 1/(m/s2)"), rate("the slip"), set_weight, cost);

impl RollingTask {
    /// Creates a task for a wheel on level ground, with weight 1 and a rate of 20/s. The centre of the wheel
    /// is the origin of `frame`, `axis` is in the axes of that frame, and `radius` is in m.
    pub fn new(model: &Model, frame: FrameId, axis: Unit<Vector3<f64>>, radius: f64) -> Self {
        let mut equation = Equation::dense(3, 0, model.nv());
        equation.response = Response::velocity(RATE);
        let (normal, frame_jacobian) = (Vector3::z_axis(), Matrix6xX::zeros(model.nv()));
        Self { frame, axis, radius, normal, weight: 1.0, contact: None, frame_jacobian, equation }
    }

    /// Sets the ground normal in world axes.
    #[must_use]
    pub fn on(mut self, normal: Unit<Vector3<f64>>) -> Self {
        self.normal = normal;
        self
    }

    /// Returns the vector `c` from the wheel's centre to the contact point at the last update \[m, world
    /// axes\]; zero for a flat wheel.
    pub fn contact(&self) -> Vector3<f64> {
        self.contact.map_or(Vector3::zeros(), |contact| contact.arm)
    }

    /// Returns the contact in a state; `None` for a flat wheel.
    fn contact_in(&self, state: &RobotState<'_>) -> Option<RollingContact> {
        let axis = state.kinematics.pose(state.model, self.frame).rotation * self.axis.into_inner();
        let across = self.normal.into_inner() - axis * axis.dot(&self.normal);
        let (up, length) = Unit::try_new_and_get(across, FLAT)?;
        let up = up.into_inner();
        Some(RollingContact { axis, up, length, arm: -up * self.radius })
    }
}

impl Task for RollingTask {
    fn evaluate(&mut self, state: &RobotState<'_>) {
        self.contact = self.contact_in(state);
        let (arm, weight) = (self.contact(), if self.contact.is_some() { self.weight } else { 0.0 });
        self.equation.weights_mut().fill(weight);
        let (model, reference) = (state.model, Reference::LocalWorldAligned);
        state.kinematics.jacobian(model, self.frame, reference, &mut self.frame_jacobian);
        for (mut row, frame) in
            self.equation.jacobian_mut().column_iter_mut().zip(self.frame_jacobian.column_iter())
        {
            let (linear, angular) = (frame.fixed_rows::<3>(0), frame.fixed_rows::<3>(3));
            row.copy_from(&(linear + angular.cross(&arm)));
        }
    }

    fn differentiate(&mut self, state: &MotionState<'_>) {
        let Some(RollingContact { axis, up, length, arm }) = self.contact else { return };
        let moving = state.kinematics.velocity(state.model, self.frame);
        let drift = state.kinematics.acceleration(state.model, self.frame);
        let turning = moving.angular.cross(&axis);
        let across = -turning * axis.dot(&self.normal) - axis * turning.dot(&self.normal);
        let arm_rate = -(across - up * up.dot(&across)) * (self.radius / length);
        let slip = moving.linear + moving.angular.cross(&arm);
        let drift = drift.linear + drift.angular.cross(&arm) + moving.angular.cross(&arm_rate);
        self.equation.error_rate.copy_from(&-slip);
        self.equation.drift.copy_from(&drift);
    }

    equation!();
}

task_config! {
    /// A rolling task: the contact point of a wheel does not move on the ground.
    RollingConfig "rolling" {
        /// Link of the wheel. The origin of its frame must be at the centre of the wheel.
        frame: String = String::new();
        /// Axis of the wheel, in the axes of its frame. Default [0, 1, 0].
        axis: [f64; 3] = [0.0, 1.0, 0.0];
        /// Radius of the wheel, m, more than 0.
        radius: f64 = 0.0 => within(1e-6..=1e3);
        /// Normal of the ground, in world axes. Default [0, 0, 1].
        normal: [f64; 3] = [0.0, 0.0, 1.0];
        /// Cost of a velocity of the contact point, 1/(m/s), 0 to 1000. Default 1.
        weight: f64 = 1.0 => live(WEIGHTS, "1/(m/s)", "cost of a velocity of the contact point");
        /// With `inverse_dynamics`: decay rate of velocity errors of the contact point, 1/s, 0 to 1000;
        /// limited to half the tick rate. Default 20.
        rate: Option<f64> = None;
    }
}

impl RollingConfig {
    fn build(&self, context: &TaskContext<'_>) -> Result<RollingTask, ConfigError> {
        let frame = context.named_frame("frame", &self.frame)?;
        let (axis, normal) = (context.axis("axis", self.axis)?, context.axis("normal", self.normal)?);
        let rate = context.rate(self.rate)?;
        Ok(RollingTask::new(context.model, frame, axis, self.radius).on(normal).rate(rate))
    }
}

impl TaskKind for RollingConfig {
    fn head(&self) -> TaskHead<'_> {
        self.table_head().acts_on(ActsOn::Joints)
    }

    check_by_building!();

    fn configure(&self, context: &TaskContext<'_>, setup: &mut Setup) -> BuiltTask {
        let (task, parameters) = (self.build(context)?, self.open(setup)?);
        Ok(Box::new(Driven::motion(task, parameters, |task, [weight], _| task.set_weight(weight))))
    }
}
