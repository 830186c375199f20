//! The joints keep a posture.

use motorium::prelude::*;
use motorium_robots::{Model, PerJoint, ProfileError};
use nalgebra::DVector;
use schemars::JsonSchema;
use serde::Deserialize;

use super::cartesian::SPRINGS;
use super::context::TaskContext;
use super::held::{HeldTask, TaskCost};
use super::kind::{ActsOn, BuiltTask, GAINS, TaskHead, TaskKind, TaskParameter, TaskTable, WEIGHTS};
use super::ramp::{Fades, Ramped, TaskBounds};
use super::{Cost, Equation, Feedback, Response, Task};
use crate::checks::per_joint;
use crate::{MotionState, RobotState};

with_defaults! {
    /// Gain and weight of a [`PostureTask`]. The default weight pulls an end effector off its target by less
    /// than a micrometre.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct PostureSettings;

    /// Rate at which the error decays \[1/s\]. Default 1.
    pub gain: f64 = 1.0;
    /// Cost of a joint velocity error \[1/(rad/s) or 1/(m/s)\], or of an acceleration error \[1/(rad/s2) or
    /// 1/(m/s2)\]. Default 1e-3.
    pub weight: f64 = 1e-3;
}

impl PostureSettings {
    fn response(&self) -> Response {
        Response::decay(self.gain)
    }
}

/// Moves joint positions `q` to a fixed or moving posture `q*` \[rad or m\]:
///
/// ```text
/// e = q* - q,   nu = q*',   J = S                 the velocities of the independent joints
/// W = weight diag(shares)
/// ```
///
/// A floating base is not affected. In a weighted sum the task determines the directions that other tasks
/// leave free. Conflicting tasks reach a compromise: at rest, a Cartesian task of weight `w` and gain `g`
/// keeps an error of about `(weight^2 gain) / (w^2 g)` times the posture error.
///
/// With an [impedance](Self::impedance) the joints accelerate like a robot without contacts under springs and
/// dampers: `M^-1 (K (q* - q) + D (q*' - q'))` instead of `kp (q* - q) + kd (q*' - q')`.
#[derive(Clone, Debug)]
pub struct PostureTask {
    settings: PostureSettings,
    target: DVector<f64>,
    shares: DVector<f64>,
    equation: Equation,
}

settings!(PostureTask, PostureSettings);
weight!(PostureTask);

impl PostureTask {
    /// Creates a task for all joints of `model`, with default settings.
    ///
    /// # Panics
    /// If the length of `target` differs from the number of independent joints.
    pub fn new(model: &Model, target: &[f64]) -> Self {
        let joints = model.joint_count();
        assert_eq!(target.len(), joints, "length of the posture");
        let settings = PostureSettings::default();
        let mut equation = Equation::identity(model.nv() - joints, joints);
        equation.response = settings.response();
        Self {
            settings,
            target: DVector::from_column_slice(target),
            shares: DVector::repeat(joints, 1.0),
            equation,
        }
    }

    /// Replaces the acceleration feedback by springs and dampers, with a stiffness \[N m/rad or N/m\] and a
    /// damping \[N m s/rad or N s/m\] for each independent joint.
    ///
    /// # Panics
    /// If the length of `stiffness` or `damping` differs from the number of independent joints.
    #[must_use]
    pub fn impedance(mut self, model: &Model, stiffness: &[f64], damping: &[f64]) -> Self {
        self.equation.set_impedance(model, stiffness, damping);
        self
    }

    /// Sets a resting target posture `q*` \[rad or m\].
    ///
    /// # Panics
    /// If the length of `target` differs from the number of independent joints.
    pub fn set_target(&mut self, target: &[f64]) {
        self.target.copy_from_slice(target);
        self.equation.rate.fill(0.0);
        self.equation.rate_derivative.fill(0.0);
    }

    /// Sets a moving target: the posture, its velocity and its acceleration.
    ///
    /// # Panics
    /// If any length differs from the number of independent joints.
    pub fn set_moving_target(&mut self, target: &[f64], velocity: &[f64], acceleration: &[f64]) {
        self.target.copy_from_slice(target);
        self.equation.rate.copy_from_slice(velocity);
        self.equation.rate_derivative.copy_from_slice(acceleration);
    }

    /// Sets the weight factor of one joint; zero leaves the joint free.
    ///
    /// # Panics
    /// If `joint` is out of range.
    pub fn set_share(&mut self, joint: usize, share: f64) {
        self.shares[joint] = share;
    }

    /// Returns the target posture `q*` \[rad or m\].
    pub fn target(&self) -> &[f64] {
        self.target.as_slice()
    }

    /// Returns the error `q* - q` at the last update \[rad or m\].
    pub fn error(&self) -> &[f64] {
        self.equation.error.as_slice()
    }
}

impl Task for PostureTask {
    fn evaluate(&mut self, state: &RobotState<'_>) {
        let q = state.model.joints_of_q(state.q);
        for (error, (target, q)) in self.equation.error.iter_mut().zip(self.target.iter().zip(q)) {
            *error = target - q;
        }
        for (weight, share) in self.equation.weights_mut().iter_mut().zip(&self.shares) {
            *weight = self.settings.weight * share;
        }
    }

    fn differentiate(&mut self, state: &MotionState<'_>) {
        let Equation { rate, error_rate, .. } = &mut self.equation;
        for (error_rate, (rate, v)) in
            error_rate.iter_mut().zip(rate.iter().zip(state.model.joints_of_v(state.v)))
        {
            *error_rate = rate - v;
        }
    }

    equation!();
}

task_config! {
    /// A posture task: the joints keep a posture.
    PostureConfig "posture" {
        /// Pose of the robot's profile. Default: the home pose, or the first measured pose if the robot has
        /// no profile.
        pose: Option<String> = None;
        /// Posture, rad or m: one number for all joints, or one per joint. Excludes `pose`.
        positions: Option<PerJoint> = None;
        /// Rate at which the error decays, 1/s, 0 to 1000; limited to half the tick rate. Default 1.
        gain: f64 = PostureSettings::default().gain => live(GAINS, "1/s", "rate at which the error decays");
        /// Springs and dampers that replace the gain. Default: not used.
        impedance: Option<JointImpedanceConfig> = None;
        /// Cost of a joint velocity error, 1/(rad/s) or 1/(m/s), 0 to 1000. Default 1e-3.
        weight: f64 = PostureSettings::default().weight => live(
            WEIGHTS, "1/(rad/s)", "cost of a joint velocity error"
        );
    }
}

/// Springs and dampers that pull the joints to their posture and replace `gain`. Requires `inverse_dynamics`.
///
/// ```toml
/// impedance = { stiffness = 100.0, damping = 10.0 }
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JointImpedanceConfig {
    /// Stiffness of the joints, N m/rad or N/m, 0 to 1e6: one number, or one per joint.
    pub stiffness: PerJoint,
    /// Damping of the joints, N m s/rad or N s/m, 0 to 1e6: one number, or one per joint.
    pub damping: PerJoint,
}

impl JointImpedanceConfig {
    /// Converts and checks the stiffness and damping of each joint.
    fn build(&self, context: &TaskContext<'_>) -> Result<[DVector<f64>; 2], ConfigError> {
        let of = |name: &str, given: &PerJoint| {
            let key = format!("impedance.{name}");
            let values = per_joint(&context.key(&key), given, context.model)?;
            for value in &values {
                context.in_range(&key, *value, SPRINGS)?;
            }
            Ok(values)
        };
        Ok([of("stiffness", &self.stiffness)?, of("damping", &self.damping)?])
    }
}

impl PostureConfig {
    /// Builds the task; also returns `true` if the posture comes from the first joint state.
    fn build(&self, context: &TaskContext<'_>) -> Result<(PostureTask, bool), ConfigError> {
        let TaskContext { model, profile, .. } = *context;
        let refused = |error: ProfileError| ConfigError::key(context.key("pose"), error.to_string());
        let (target, from_start) = match (&self.pose, &self.positions, profile) {
            (Some(_), Some(_), _) => {
                let message = "both `pose` and `positions` are given";
                return Err(ConfigError::key(context.key("positions"), message).advise("keep one of them"));
            }
            (Some(_), None, None) => {
                let message = format!("robot `{}` has no profile, so its poses have no names", model.name());
                return Err(ConfigError::key(context.key("pose"), message)
                    .advise("give `positions`, or put a profile next to the URDF"));
            }
            (Some(name), None, Some(profile)) => (profile.pose(model, name).map_err(refused)?, false),
            (None, Some(positions), _) => (per_joint(&context.key("positions"), positions, model)?, false),
            (None, None, Some(profile)) => (profile.home(model).map_err(refused)?, false),
            (None, None, None) => (DVector::zeros(model.joint_count()), true),
        };
        let mut task = PostureTask::new(model, target.as_slice());
        context.wheels.iter().for_each(|wheel| task.set_share(*wheel, 0.0));
        if let Some(impedance) = &self.impedance {
            context.check_impedance(self.gain, PostureSettings::default().gain)?;
            let [stiffness, damping] = impedance.build(context)?;
            task = task.impedance(model, stiffness.as_slice(), damping.as_slice());
        }
        Ok((task, from_start))
    }
}

impl TaskKind for PostureConfig {
    fn head(&self) -> TaskHead<'_> {
        self.table_head().acts_on(ActsOn::Joints)
    }

    /// The gain, unless there is an impedance, and the weight.
    fn parameters(&self) -> Vec<TaskParameter> {
        self.live().into_iter().skip(usize::from(self.impedance.is_some())).collect()
    }

    check_by_building!();

    fn configure(&self, context: &TaskContext<'_>, setup: &mut Setup) -> BuiltTask {
        let (task, from_start) = self.build(context)?;
        let (gain, weight) = match self.impedance {
            None => {
                let [gain, weight] = self.open(setup)?;
                (Some(gain), weight)
            }
            Some(_) => {
                let [weight] = self.open(setup)?;
                (None, weight)
            }
        };
        Ok(Box::new(HeldPosture { task, keeps_start: from_start, from_start, gain, weight }))
    }
}

/// A task that keeps the joints at a posture.
struct HeldPosture {
    task: PostureTask,
    /// `true` if the posture is defined by the first joint state.
    keeps_start: bool,
    /// `true` until the posture has been set from the first joint state.
    from_start: bool,
    /// `None` with springs.
    gain: Option<Ramped>,
    weight: Ramped,
}

impl HeldTask for HeldPosture {
    fn begin(&mut self, start: &RobotState<'_>) {
        if self.from_start {
            self.task.set_target(start.model.joints_of_q(start.q));
            self.from_start = false;
        }
    }

    fn reset(&mut self) {
        self.from_start = self.keeps_start;
    }

    fn weigh(&mut self, bounds: &TaskBounds, fades: &mut Fades) {
        let gain = self.gain.as_mut().map(|gain| gain.follow(bounds, fades).min(bounds.max_gain));
        let gain = gain.unwrap_or(self.task.settings().gain);
        let weight = self.weight.follow(bounds, fades);
        self.task.set_settings(PostureSettings { gain, weight });
    }

    fn cost(&mut self) -> TaskCost<'_> {
        TaskCost::Motion(&mut self.task)
    }
}
