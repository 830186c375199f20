//! Makes a base drive like a unicycle.

use motorium::prelude::*;
use motorium::state::TwistTarget;
use motorium_robots::{FrameId, Model, Reference};
use nalgebra::Matrix6xX;

use super::context::TaskContext;
use super::held::Driven;
use super::kind::{BuiltTask, TaskKind, WEIGHTS};
use super::velocities::RATE;
use super::{Cost, Equation, Response, Task};
use crate::{MotionState, RobotState};

with_defaults! {
    /// Target speeds and weights of a [`UnicycleTask`].
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct UnicycleSettings;

    /// Target speed along the x axis of the frame \[m/s\]. Default 0.
    pub forward: f64 = 0.0;
    /// Target angular velocity about the z axis of the frame \[rad/s\]. Default 0.
    pub yaw_rate: f64 = 0.0;
    /// Cost of an error of the forward speed \[1/(m/s)\]; 0 leaves the speed to other tasks. Default 1.
    pub forward_weight: f64 = 1.0;
    /// Cost of sideways motion \[1/(m/s)\]. Default 1.
    pub sideways_weight: f64 = 1.0;
    /// Cost of an error of the yaw rate \[1/(rad/s)\]; 0 leaves the yaw rate to other tasks. Default 1.
    pub yaw_weight: f64 = 1.0;
}

/// Moves a frame forward and turns it as commanded, without sideways motion:
///
/// ```text
/// J  = rows x, y of J_v and z of J_w              Jacobian of the frame in its own axes, 3 x nv
/// nu = (forward, 0, yaw rate)                     m/s, m/s, rad/s
/// W  = diag(f, s, y)
/// ```
///
/// Position drift is not corrected. Under acceleration control, velocity errors decay at the
/// [`rate`](Self::rate). OpenSoT's task includes the wheel, which is a separate
/// [`RollingTask`](super::RollingTask) here. With zero forward and yaw weights only sideways motion is
/// excluded: a base moved by other tasks behaves as if on an axle.
///
/// ```
/// use motorium_control::{RobotState, tasks::{UnicycleSettings, UnicycleTask, VelocityTask}};
/// use motorium_robots::{Kinematics, load};
///
/// let robot = load("quadruped", std::path::Path::new("."))?.model;
/// let (q, mut kinematics) = (robot.neutral(), Kinematics::new(&robot));
/// kinematics.update(&robot, &q);
/// let mut drive = UnicycleTask::new(&robot, robot.frame("base")?)
///     .with(UnicycleSettings { forward: 0.5, yaw_rate: 0.2, ..UnicycleSettings::default() });
/// drive.update(&RobotState { model: &robot, kinematics: &kinematics, q: &q });
/// let mut v = vec![0.0; robot.nv()];
/// (v[0], v[5]) = (0.5, 0.2);
/// assert!(drive.residual(&v) < 1e-12);
/// v[1] = 0.1; // sideways
/// assert!((drive.residual(&v) - 0.1).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct UnicycleTask {
    frame: FrameId,
    settings: UnicycleSettings,
    frame_jacobian: Matrix6xX<f64>,
    equation: Equation,
}

methods!(UnicycleTask: rate("a velocity error"), cost);

impl UnicycleTask {
    /// Creates a task for `frame` of `model`, initially at rest, with default weights and a rate of 20/s.
    pub fn new(model: &Model, frame: FrameId) -> Self {
        let mut equation = Equation::dense(3, 0, model.nv());
        equation.response = Response::velocity(RATE);
        let frame_jacobian = Matrix6xX::zeros(model.nv());
        Self { frame, settings: UnicycleSettings::default(), frame_jacobian, equation }
    }

    /// Sets the target speeds and weights.
    #[must_use]
    pub fn with(mut self, settings: UnicycleSettings) -> Self {
        self.settings = settings;
        self
    }

    /// Changes the target speeds and weights from the next update on.
    pub fn set_settings(&mut self, settings: UnicycleSettings) {
        self.settings = settings;
    }

    /// Returns the target speeds and weights.
    pub fn settings(&self) -> &UnicycleSettings {
        &self.settings
    }
}

impl Task for UnicycleTask {
    fn evaluate(&mut self, state: &RobotState<'_>) {
        let UnicycleSettings { forward, yaw_rate, forward_weight, sideways_weight, yaw_weight } =
            self.settings;
        let equation = &mut self.equation;
        equation.rate.copy_from_slice(&[forward, 0.0, yaw_rate]);
        equation.weights_mut().copy_from_slice(&[forward_weight, sideways_weight, yaw_weight]);
        state.kinematics.jacobian(state.model, self.frame, Reference::Local, &mut self.frame_jacobian);
        for (mut row, frame) in
            equation.jacobian_mut().column_iter_mut().zip(self.frame_jacobian.column_iter())
        {
            (row[0], row[1], row[2]) = (frame[0], frame[1], frame[5]);
        }
    }

    fn differentiate(&mut self, state: &MotionState<'_>) {
        let MotionState { model, kinematics, .. } = *state;
        let axes = kinematics.pose(model, self.frame).rotation.inverse();
        let moving = kinematics.velocity(model, self.frame);
        let drift = kinematics.acceleration(model, self.frame);
        let (v, w) = (axes * moving.linear, axes * moving.angular);
        let (linear, angular) = (axes * drift.linear - w.cross(&v), axes * drift.angular);
        let Equation { rate, error_rate, drift, .. } = &mut self.equation;
        error_rate.copy_from_slice(&[rate[0] - v.x, rate[1] - v.y, rate[2] - w.z]);
        drift.copy_from_slice(&[linear.x, linear.y, angular.z]);
    }

    equation!();
}

task_config! {
    /// A unicycle task: a frame moves forward and turns as commanded, without sideways motion.
    UnicycleConfig "unicycle" {
        /// Link whose frame drives along its x axis and turns about its z axis.
        frame: String = String::new();
        /// Name of the input port of the target. Only `linear` x and `angular` z are used, in the axes of the
        /// frame. Without a target, or with a stale one (`target_timeout`), the frame stands still. Default
        /// "unicycle_target".
        target: String = "unicycle_target".to_owned() => target(
            optional TwistTarget, "forward speed (linear x) and yaw rate (angular z), in the axes of the frame"
        );
        /// Cost of an error of the forward speed, 1/(m/s), 0 to 1000. Default 1.
        forward_weight: f64 = 1.0 => live(WEIGHTS, "1/(m/s)", "cost of an error of the forward speed");
        /// Cost of sideways motion, 1/(m/s), 0 to 1000. Default 1.
        sideways_weight: f64 = 1.0 => live(WEIGHTS, "1/(m/s)", "cost of sideways motion");
        /// Cost of an error of the yaw rate, 1/(rad/s), 0 to 1000. Default 1.
        yaw_weight: f64 = 1.0 => live(WEIGHTS, "1/(rad/s)", "cost of an error of the yaw rate");
        /// With `inverse_dynamics`: decay rate of velocity errors, 1/s, 0 to 1000; limited to half the tick
        /// rate. Default 20.
        rate: Option<f64> = None;
    }
}

impl UnicycleConfig {
    fn build(&self, context: &TaskContext<'_>) -> Result<UnicycleTask, ConfigError> {
        let rate = context.rate(self.rate)?;
        Ok(UnicycleTask::new(context.model, context.named_frame("frame", &self.frame)?).rate(rate))
    }
}

impl TaskKind for UnicycleConfig {
    check_by_building!();

    fn configure(&self, context: &TaskContext<'_>, setup: &mut Setup) -> BuiltTask {
        let mut input = setup.input::<TwistTarget>(&self.target)?;
        let task =
            Driven::motion(self.build(context)?, self.open(setup)?, |task, [forward, sideways, yaw], _| {
                task.set_settings(UnicycleSettings {
                    forward_weight: forward,
                    sideways_weight: sideways,
                    yaw_weight: yaw,
                    ..*task.settings()
                });
            });
        Ok(Box::new(task.following(move |task, bounds| {
            let fresh = input.latest().filter(|target| target.age_ns() <= bounds.target_timeout_ns);
            let (forward, yaw_rate) =
                fresh.map_or((0.0, 0.0), |target| (target.linear[0], target.angular[2]));
            task.set_settings(UnicycleSettings { forward, yaw_rate, ..*task.settings() });
        })))
    }
}
