//! Steers a wheel into the direction of motion of its base.

use motorium::prelude::*;
use motorium::state::TwistTarget;
use motorium_robots::{FrameId, Model, Reference};
use nalgebra::{Matrix6xX, Unit, Vector3};

use super::context::TaskContext;
use super::held::Driven;
use super::kind::{ActsOn, BuiltTask, GAINS, TaskHead, TaskKind, TaskTable, WEIGHTS};
use super::{Cost, Equation, Feedback, Response, Task};
use crate::{MotionState, RobotState};

/// Speed of a wheel below which its direction is undefined \[m/s\].
const STANDING: f64 = 1e-6;

/// Steers a wheel until it rolls along the velocity of its centre, given the rigid motion of the base. All
/// steered wheels of a base then roll about the same instantaneous centre of rotation.
///
/// With the axis `d` of the wheel, the normal `n` of the ground, the centre `p` of the wheel and `o` of the
/// base, all in world axes, and the twist `(V, W)` of the base,
///
/// ```text
/// f = d x n / |d x n|                             direction in which the wheel rolls
/// u = V + W n x (p - o)                           velocity of its centre
/// e = angle from f to u about n                   rad; to -u where that is nearer: the wheel rolls backwards
/// J = n' J_w                                      angular velocity of the wheel about the normal, 1 x nv
/// nu = W                                          the base keeps its velocity
/// ```
///
/// This is OpenSoT's task, with the rotation of the base as feed-forward. The task is inactive while the base
/// stands still or the wheel lies flat.
#[derive(Clone, Debug)]
pub struct RigidRotationTask {
    wheel: FrameId,
    base: FrameId,
    axis: Unit<Vector3<f64>>,
    normal: Unit<Vector3<f64>>,
    /// Velocity of the base in its own axes: along x, along y, about z.
    twist: [f64; 3],
    weight: f64,
    frame_jacobian: Matrix6xX<f64>,
    equation: Equation,
}

methods!(RigidRotationTask: with("1/s", "1/(rad/s) or 1/(rad/s2)"), feedback("set"), cost);

impl RigidRotationTask {
    /// Creates a task for the wheel whose centre is the origin of the frame `wheel`. `axis` is the wheel's
    /// axis in the axes of that frame. The base has the frame `base` and is initially at rest on level
    /// ground. The gain is 10 and the weight 1.
    pub fn new(model: &Model, wheel: FrameId, base: FrameId, axis: Unit<Vector3<f64>>) -> Self {
        let mut equation = Equation::dense(1, 0, model.nv());
        equation.response = Response::decay(10.0);
        let (normal, frame_jacobian) = (Vector3::z_axis(), Matrix6xX::zeros(model.nv()));
        Self { wheel, base, axis, normal, twist: [0.0; 3], weight: 1.0, frame_jacobian, equation }
    }

    /// Changes the gain and weight from the next update on. Under acceleration control, this also replaces
    /// the task's feedback: the error then decays at the rate `gain`, critically damped.
    pub fn set(&mut self, gain: f64, weight: f64) {
        (self.equation.response, self.weight) = (Response::decay(gain), weight);
    }

    /// Sets the ground normal in world axes.
    #[must_use]
    pub fn on(mut self, normal: Unit<Vector3<f64>>) -> Self {
        self.normal = normal;
        self
    }

    /// Sets the velocity of the base in its own axes: along x and y \[m/s\], and about z \[rad/s\].
    pub fn set_twist(&mut self, x: f64, y: f64, yaw: f64) {
        self.twist = [x, y, yaw];
    }

    /// Returns the error `e` at the last update \[rad\], from -pi/2 to pi/2; 0 while the task is inactive.
    pub fn error(&self) -> f64 {
        self.equation.error[0]
    }

    /// Returns the angle about the normal from the rolling direction of the wheel to the velocity of its
    /// centre, or to the opposite if that is closer \[rad\]. `None` for a standing or flat wheel.
    fn angle(&self, state: &RobotState<'_>) -> Option<f64> {
        let [wheel, base] = [self.wheel, self.base].map(|frame| state.kinematics.pose(state.model, frame));
        let (normal, [x, y, yaw]) = (self.normal.into_inner(), self.twist);
        let flat = |vector: Vector3<f64>| vector - normal * normal.dot(&vector);
        let arm = flat(wheel.translation.vector - base.translation.vector);
        let carried = flat(base.rotation * Vector3::new(x, y, 0.0)) + normal.cross(&arm) * yaw;
        let forward = (wheel.rotation * self.axis.into_inner()).cross(&normal);
        if carried.norm() <= STANDING || forward.norm() <= STANDING {
            return None;
        }
        let carried = if forward.dot(&carried) < 0.0 { -carried } else { carried };
        Some(normal.dot(&forward.cross(&carried)).atan2(forward.dot(&carried)))
    }
}

impl Task for RigidRotationTask {
    fn evaluate(&mut self, state: &RobotState<'_>) {
        let angle = self.angle(state);
        let normal = self.normal.into_inner();
        let equation = &mut self.equation;
        equation.error[0] = angle.unwrap_or(0.0);
        equation.rate[0] = self.twist[2];
        equation.weights_mut()[0] = if angle.is_some() { self.weight } else { 0.0 };
        let (model, reference) = (state.model, Reference::LocalWorldAligned);
        state.kinematics.jacobian(model, self.wheel, reference, &mut self.frame_jacobian);
        for (mut row, frame) in
            equation.jacobian_mut().column_iter_mut().zip(self.frame_jacobian.column_iter())
        {
            row[0] = normal.dot(&frame.fixed_rows::<3>(3));
        }
    }

    fn differentiate(&mut self, state: &MotionState<'_>) {
        let moving = state.kinematics.velocity(state.model, self.wheel);
        let drift = state.kinematics.acceleration(state.model, self.wheel);
        self.equation.error_rate[0] = self.twist[2] - self.normal.dot(&moving.angular);
        self.equation.drift[0] = self.normal.dot(&drift.angular);
    }

    equation!();
}

task_config! {
    /// A rigid-rotation task: steers a wheel into the direction in which the base moves the wheel.
    RigidRotationConfig "rigid_rotation" {
        /// Link of the wheel. The origin of its frame must be at the centre of the wheel.
        frame: String = String::new();
        /// Link of the base, in whose axes the target is given.
        base: String = String::new();
        /// Axis of the wheel, in the axes of its frame. Default [0, 1, 0].
        axis: [f64; 3] = [0.0, 1.0, 0.0];
        /// Normal of the ground, in world axes. Default [0, 0, 1].
        normal: [f64; 3] = [0.0, 0.0, 1.0];
        /// Name of the input port for the velocity of the base: `linear` x and y and `angular` z, in the axes
        /// of `base`. Without a target, or with a stale one (`target_timeout`), the task is inactive. Default
        /// "base_target".
        target: String = "base_target".to_owned() => target(
            optional TwistTarget, "velocity of the base: linear x and y, angular z, in its own axes"
        );
        /// Rate at which the error decays, 1/s, 0 to 1000; limited to half the tick rate. Default 10.
        gain: f64 = 10.0 => live(GAINS, "1/s", "rate at which the error decays");
        /// Cost of an angular velocity error, 1/(rad/s), 0 to 1000. Default 1.
        weight: f64 = 1.0 => live(WEIGHTS, "1/(rad/s)", "cost of an angular velocity error");
    }
}

impl RigidRotationConfig {
    fn build(&self, context: &TaskContext<'_>) -> Result<RigidRotationTask, ConfigError> {
        let (wheel, base) =
            (context.named_frame("frame", &self.frame)?, context.named_frame("base", &self.base)?);
        let (axis, normal) = (context.axis("axis", self.axis)?, context.axis("normal", self.normal)?);
        Ok(RigidRotationTask::new(context.model, wheel, base, axis).on(normal))
    }
}

impl TaskKind for RigidRotationConfig {
    fn head(&self) -> TaskHead<'_> {
        self.table_head().acts_on(ActsOn::Joints)
    }

    check_by_building!();

    fn configure(&self, context: &TaskContext<'_>, setup: &mut Setup) -> BuiltTask {
        let mut input = setup.input::<TwistTarget>(&self.target)?;
        let task = Driven::motion(self.build(context)?, self.open(setup)?, |task, [gain, weight], bounds| {
            task.set(gain.min(bounds.max_gain), weight);
        });
        let task = task.with_result(|task| Some(serde_json::json!({ "last_error_rad": task.error() })));
        Ok(Box::new(task.following(move |task, bounds| {
            let fresh = input.latest().filter(|target| target.age_ns() <= bounds.target_timeout_ns);
            let [x, y, yaw] =
                fresh.map_or([0.0; 3], |target| [target.linear[0], target.linear[1], target.angular[2]]);
            task.set_twist(x, y, yaw);
        })))
    }
}
