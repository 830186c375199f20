//! Makes the centre of mass follow a point.

use motorium::prelude::*;
use motorium_robots::Model;
use nalgebra::Vector3;

use super::context::TaskContext;
use super::held::{Driven, Reach};
use super::jacobian_view::JacobianView;
use super::kind::{BuiltTask, GAINS, TaskKind, WEIGHTS};
use super::target::TargetInput;
use super::{Cost, Equation, Feedback, Response, Task};
use crate::{GoalError, GoalTolerance, MotionState, RobotState};

with_defaults! {
    /// Gain and weights of a [`CentreOfMassTask`].
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct CentreOfMassSettings;

    /// Rate at which the error decays \[1/s\]. Should be below a tenth of the tick rate. Default 10.
    pub gain: f64 = 10.0;
    /// Cost of a velocity error \[1/(m/s)\], or of an acceleration error \[1/(m/s2)\]. Default 1.
    pub weight: f64 = 1.0;
    /// Factors of the weight along x, y and z of the world; 0 leaves an axis free. Default 1 for all axes.
    pub shares: [f64; 3] = [1.0; 3];
    /// Maximum speed at which the error is corrected \[m/s\]. Default infinite.
    pub max_speed: f64 = f64::INFINITY;
    /// Levenberg-Marquardt damping per unit of correction speed \[s m/rad^2\]. Prevents oscillation if the
    /// target is out of reach, and vanishes at the target. Should exceed half the tick period times the reach
    /// of the robot. Default 5e-3.
    pub damping: f64 = 5e-3;
}

impl CentreOfMassSettings {
    fn response(&self) -> Response {
        let Self { gain, max_speed, damping, .. } = *self;
        Response { max_speeds: [max_speed, f64::INFINITY], damping, ..Response::decay(gain) }
    }
}

/// Makes the centre of mass `c` of the robot follow a point `c*` \[m, world axes\]:
///
/// ```text
/// e = c* - c(q),   nu = c*',   J = J_com          Jacobian of the centre of mass, 3 x nv
/// W = weight diag(shares)
/// ```
///
/// OpenSoT, Pink and TSID have the same task. Links fixed to the world are ignored.
///
/// ```
/// use motorium_control::{RobotState, tasks::{CentreOfMassTask, VelocityTask}};
/// use motorium_robots::{Kinematics, load};
/// use nalgebra::Vector3;
///
/// let panda = load("panda", std::path::Path::new("."))?;
/// let (model, q) = (&panda.model, panda.profile.unwrap().home(&panda.model)?);
/// let mut kinematics = Kinematics::new(model);
/// kinematics.update(model, q.as_slice());
///
/// let mut task = CentreOfMassTask::new(model);
/// task.set_target(kinematics.centre_of_mass(model).position + Vector3::new(0.0, 0.05, 0.0));
/// task.update(&RobotState { model, kinematics: &kinematics, q: q.as_slice() });
/// assert!((task.error().y - 0.05).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct CentreOfMassTask {
    settings: CentreOfMassSettings,
    target: Vector3<f64>,
    equation: Equation,
}

settings!(CentreOfMassTask, CentreOfMassSettings);
weight!(CentreOfMassTask);

impl CentreOfMassTask {
    /// Creates a task for `model`, with the world's origin as target and default settings.
    pub fn new(model: &Model) -> Self {
        let settings = CentreOfMassSettings::default();
        let mut equation = Equation::dense(3, 0, model.nv());
        equation.response = settings.response();
        Self { settings, target: Vector3::zeros(), equation }
    }

    /// Sets a resting target `c*` \[m, world axes\].
    pub fn set_target(&mut self, target: Vector3<f64>) {
        self.set_moving_target(target, Vector3::zeros(), Vector3::zeros());
    }

    /// Sets a moving target: its position `c*` \[m\], velocity \[m/s\] and acceleration \[m/s2\], in world
    /// axes.
    pub fn set_moving_target(
        &mut self,
        target: Vector3<f64>,
        velocity: Vector3<f64>,
        acceleration: Vector3<f64>,
    ) {
        self.target = target;
        self.equation.rate.copy_from(&velocity);
        self.equation.rate_derivative.copy_from(&acceleration);
    }

    /// Returns the target `c*` \[m, world axes\].
    pub fn target(&self) -> &Vector3<f64> {
        &self.target
    }

    /// Returns the error `e` at the last update \[m, world axes\].
    pub fn error(&self) -> Vector3<f64> {
        self.equation.error.fixed_rows::<3>(0).into()
    }

    /// Returns `J` at the last update, 3 x nv.
    pub fn jacobian(&self) -> JacobianView<'_, 3> {
        self.equation.jacobian().fixed_rows::<3>(0)
    }

    /// Returns the desired value `b` at the last update \[m/s or m/s2\].
    pub fn desired(&self) -> Vector3<f64> {
        self.cost().desired().fixed_rows::<3>(0).into()
    }
}

impl Task for CentreOfMassTask {
    fn evaluate(&mut self, state: &RobotState<'_>) {
        let CentreOfMassSettings { weight, shares, .. } = self.settings;
        let position = state.kinematics.centre_of_mass(state.model).position;
        self.equation.error.copy_from(&(self.target - position));
        state.kinematics.com_jacobian(state.model, self.equation.jacobian_mut());
        for (out, share) in self.equation.weights_mut().iter_mut().zip(shares) {
            *out = weight * share;
        }
    }

    fn differentiate(&mut self, state: &MotionState<'_>) {
        let moving = state.kinematics.centre_of_mass(state.model);
        let Equation { rate, error_rate, drift, .. } = &mut self.equation;
        error_rate.copy_from(rate);
        *error_rate -= moving.velocity;
        drift.copy_from(&moving.acceleration);
    }

    equation!();
}

task_config! {
    /// A centre-of-mass task: the centre of mass of the robot follows a target point.
    CentreOfMassConfig "centre_of_mass" {
        /// Name of the input port of the target; only its position and linear velocity are used. The input is
        /// optional: without a target, the centre of mass keeps its initial position. Default
        /// "centre_of_mass_target".
        target: String = "centre_of_mass_target".to_owned() => target(
            optional PoseTarget, "position and linear velocity of the centre of mass, in the world frame"
        );
        /// Rate at which the error decays, 1/s, 0 to 1000; limited to half the tick rate. Default 10.
        gain: f64 = CentreOfMassSettings::default().gain => live(GAINS, "1/s", "rate at which the error decays");
        /// Cost of a velocity error, 1/(m/s), 0 to 1000. Default 1.
        weight: f64 = CentreOfMassSettings::default().weight => live(
            WEIGHTS, "1/(m/s)", "cost of a velocity error"
        );
        /// Factors of the weight along x, y and z of the world, 0 to 1; 0 leaves an axis free. Default [1, 1,
        /// 1].
        shares: [f64; 3] = CentreOfMassSettings::default().shares;
        /// Maximum speed of the correction, m/s. Default: no limit.
        max_speed: Option<f64> = None;
        /// Levenberg-Marquardt damping, s m/rad^2; prevents oscillation if the target is out of reach.
        /// Default: 5e-3, or two tick periods times one metre if that is larger.
        damping: Option<f64> = None;
        /// Maximum distance from a goal, along the controlled axes, at which the goal counts as reached, m.
        /// Default 5e-3.
        tolerance: f64 = GoalTolerance::default().position => within(0.0..=f64::MAX);
    }
}

impl CentreOfMassConfig {
    fn build(&self, context: &TaskContext<'_>) -> Result<CentreOfMassTask, ConfigError> {
        let mass: f64 = context.model.bodies().iter().map(|body| body.inertia.mass).sum();
        if mass.is_nan() || mass <= 0.0 {
            let message =
                format!("robot `{}` has no mass and therefore no centre of mass", context.model.name());
            return Err(ConfigError::key(&context.path, message));
        }
        for share in self.shares {
            context.in_range("shares", share, 0.0..=1.0)?;
        }
        Ok(CentreOfMassTask::new(context.model).with(CentreOfMassSettings {
            gain: self.gain,
            weight: self.weight,
            shares: self.shares,
            max_speed: context.max_speed("max_speed", self.max_speed)?,
            damping: context.damping(self.damping, CentreOfMassSettings::default().damping)?,
        }))
    }
}

impl TaskKind for CentreOfMassConfig {
    check_by_building!();

    fn configure(&self, context: &TaskContext<'_>, setup: &mut Setup) -> BuiltTask {
        let tolerance = GoalTolerance { position: self.tolerance, orientation: f64::INFINITY };
        let target = TargetInput::new(setup.input(&self.target)?, tolerance);
        let task = Driven::motion(self.build(context)?, self.open(setup)?, |task, [gain, weight], bounds| {
            let gain = gain.min(bounds.max_gain);
            task.set_settings(CentreOfMassSettings { gain, weight, ..*task.settings() });
        });
        Ok(Box::new(task.reaching(Reach {
            target,
            start: |task, start| task.set_target(start.kinematics.centre_of_mass(start.model).position),
            follow: |task, point, velocity| task.set_moving_target(point, velocity, Vector3::zeros()),
            error: |task, measured| {
                let mut error = task.target() - measured.kinematics.centre_of_mass(measured.model).position;
                // free axes are ignored
                for (error, share) in error.iter_mut().zip(task.settings().shares) {
                    *error = if share == 0.0 { 0.0 } else { *error };
                }
                GoalError { position: error.norm(), orientation: None }
            },
        })))
    }
}
