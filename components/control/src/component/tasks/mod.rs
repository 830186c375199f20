//! The tasks of `control.qp`: one file and one variant of [`TaskConfig`] for each kind of task.
//!
//! A file holds the configuration of its kind, which implements [`TaskKind`], and the running task, which implements
//! [`HeldTask`]. The controller knows only these two traits.

mod admittance;
mod capture_point;
mod cartesian;
mod centre_of_mass;
mod constraint;
mod contact_wrench;
mod gaze;
mod held;
mod limit;
mod manipulability;
mod minimum;
mod momentum;
mod posture;
mod relative;
mod rigid_rotation;
mod rolling;
mod unicycle;

pub use admittance::AdmittanceConfig;
pub use capture_point::CapturePointConfig;
pub use cartesian::CartesianConfig;
pub use centre_of_mass::CentreOfMassConfig;
pub use constraint::ConstraintConfig;
pub use contact_wrench::ContactWrenchConfig;
pub use gaze::GazeConfig;
pub use limit::LimitConfig;
pub use manipulability::{ManipulabilityConfig, ManipulabilityRows};
pub use minimum::{MinimumConfig, MinimumOf};
pub use momentum::MomentumConfig;
pub use posture::PostureConfig;
pub use relative::RelativeConfig;
pub use rigid_rotation::RigidRotationConfig;
pub use rolling::RollingConfig;
pub use unicycle::UnicycleConfig;

use core::ops::RangeInclusive;

use motorium::prelude::*;
use motorium_robots::{EndEffectorError, FrameId, Model, Profile};
use nalgebra::{Unit, Vector3};
use schemars::JsonSchema;
use serde::Deserialize;

use super::checks;
use crate::{
    GoalRecord, RobotState,
    inverse_dynamics::{
        Contact,
        tasks::{AccelerationTask, Feedback},
    },
    limits::RowLimit,
    tasks::Task,
};

/// Range of every gain, 1/s.
const GAINS: RangeInclusive<f64> = 0.0..=1000.0;
/// Range of every weight.
const WEIGHTS: RangeInclusive<f64> = 0.0..=1000.0;

/// Defines [`TaskConfig`]: a key of the configuration, a variant and the type of its table for each kind of task.
macro_rules! task_kinds {
    ($( $(#[$doc:meta])* $key:literal => $variant:ident($config:ty), )*) => {
        /// One task of `control.qp`.
        #[derive(Debug, Clone, Deserialize, JsonSchema)]
        pub enum TaskConfig {
            $( $(#[$doc])* #[serde(rename = $key)] $variant($config), )*
        }

        impl TaskConfig {
            /// The key of the task and its table.
            pub(super) fn kind(&self) -> (&'static str, &dyn TaskKind) {
                match self {
                    $( Self::$variant(config) => ($key, config), )*
                }
            }
        }
    };
}

task_kinds! {
    /// A frame gives way to a measured wrench, like a mass on a spring and a damper.
    "admittance" => Admittance(AdmittanceConfig),
    /// The point at which the robot would have to step to come to rest follows a point; torques only.
    "capture_point" => CapturePoint(CapturePointConfig),
    /// A frame follows a pose target.
    "cartesian" => Cartesian(CartesianConfig),
    /// The centre of mass follows a point.
    "centre_of_mass" => CentreOfMass(CentreOfMassConfig),
    /// A task holds exactly, above all levels.
    "constraint" => Constraint(ConstraintConfig),
    /// Force and torque of a contact follow a target; torques only.
    "contact_wrench" => ContactWrench(ContactWrenchConfig),
    /// An axis of a frame points at a point.
    "gaze" => Gaze(GazeConfig),
    /// Limits that give way; velocities only.
    "limit" => Limit(LimitConfig),
    /// The joints move to where a frame is moved, or exerts forces, more easily; velocities only.
    "manipulability" => Manipulability(ManipulabilityConfig),
    /// Velocities, accelerations, efforts, torques or contact forces are small.
    "minimum" => Minimum(MinimumConfig),
    /// The momentum about the centre of mass comes to rest; torques only.
    "momentum" => Momentum(MomentumConfig),
    /// The joints keep a posture.
    "posture" => Posture(PostureConfig),
    /// A frame reaches a pose in another frame of the robot; velocities only.
    "relative" => Relative(RelativeConfig),
    /// A steered wheel rolls along the way of its base; velocities only.
    "rigid_rotation" => RigidRotation(RigidRotationConfig),
    /// A wheel rolls without slipping; velocities only.
    "rolling" => Rolling(RollingConfig),
    /// A frame drives forward and turns, and never sideways; velocities only.
    "unicycle" => Unicycle(UnicycleConfig),
}

/// The configuration of one kind of task.
pub(super) trait TaskKind {
    /// Name of the task, with which the names of its parameters begin.
    fn name(&self) -> &str;

    /// Its level: tasks of a higher number decide only what those of lower ones leave open.
    fn level(&self) -> u32;

    /// Name of the input of its target, if it has one.
    fn target(&self) -> Option<&str> {
        None
    }

    /// Name of the input of a measured wrench, if it has one.
    fn wrench(&self) -> Option<&str> {
        None
    }

    /// The formulations that the task has.
    fn formulations(&self) -> Formulations {
        Formulations::Both
    }

    /// True for a task that holds exactly, above all levels.
    fn is_constraint(&self) -> bool {
        false
    }

    /// Checks the configuration, and declares input and parameters.
    fn declare(&self, place: &TaskPlace<'_>, declare: &mut Declare) -> Result<(), ConfigError>;

    /// Builds the task, and opens input and parameters. All memory of the task is allocated here.
    fn configure(
        &self,
        place: &TaskPlace<'_>,
        setup: &mut Setup,
    ) -> Result<Box<dyn HeldTask>, ConfigureError>;
}

/// The formulations of the controller that a kind of task has a cost for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Formulations {
    /// Velocities and torques.
    Both,
    /// Velocities alone.
    Velocity,
    /// Torques alone.
    Torque,
}

/// Feedback at acceleration level of a task whose error is to decay at the rate `gain` \[1/s\].
fn feedback(gain: f64) -> Feedback {
    Feedback::critical(gain)
}

/// The robot a task is for, and the place of the task in the configuration.
pub(super) struct TaskPlace<'a> {
    pub(super) model: &'a Model,
    pub(super) profile: Option<&'a Profile>,
    /// Time between two steps, s; 0 while a graph is checked.
    pub(super) period: f64,
    /// True if the controller computes torques.
    pub(super) torque: bool,
    /// Acceleration of free fall, m/s2.
    pub(super) gravity: Vector3<f64>,
    /// Contacts of inverse dynamics; none where the controller computes velocities.
    pub(super) contacts: &'a [Contact],
    /// Path of the table of the task in the configuration, such as `tasks[0].cartesian`.
    pub(super) path: String,
}

impl<'a> TaskPlace<'a> {
    /// The place of a table within that of the task.
    fn within(&self, name: &str) -> TaskPlace<'a> {
        TaskPlace { path: self.key(name), ..*self }
    }

    /// The frame that the key `name` names.
    fn named_frame(&self, name: &str, link: &str) -> Result<FrameId, ConfigError> {
        if link.is_empty() {
            return Err(ConfigError::key(self.key(name), "it is missing").advise("name a link of the robot"));
        }
        self.model.frame(link).map_err(|error| ConfigError::key(self.key(name), error.to_string()))
    }

    /// The direction that the key `name` gives.
    fn axis(&self, name: &str, axis: [f64; 3]) -> Result<Unit<Vector3<f64>>, ConfigError> {
        Unit::try_new(Vector3::from(axis), 1e-9)
            .filter(|axis| axis.iter().all(|number| number.is_finite()))
            .ok_or_else(|| {
                ConfigError::key(self.key(name), format!("{axis:?} has no direction"))
                    .advise("give an axis, such as [0, 0, 1]")
            })
    }

    /// Path of the key `name` of the task.
    pub(super) fn key(&self, name: &str) -> String {
        format!("{}.{name}", self.path)
    }

    /// The frame that a task of this kind leads: the one named, or that of the robot's only end effector.
    fn frame(&self, kind: &str, named: Option<&str>) -> Result<FrameId, ConfigError> {
        self.model.end_effector(self.profile, named).map_err(|error| match error {
            EndEffectorError::UnknownFrame(unknown) => ConfigError::key(self.key("frame"), unknown.to_string()),
            error => ConfigError::new(error.to_string()).advise(format!(
                "name the link to control: tasks = [{{ {kind} = {{ frame = \"{}\" }} }}, {{ posture = {{}} }}]",
                error.example().unwrap_or_default()
            )),
        })
    }

    /// The value of the key `name`, if it is within `range`.
    fn in_range(&self, name: &str, value: f64, range: RangeInclusive<f64>) -> Result<f64, ConfigError> {
        checks::in_range(&self.key(name), value, range)
    }

    /// The largest speed of a correction: infinite if none is given.
    fn max_speed(&self, name: &str, speed: Option<f64>) -> Result<f64, ConfigError> {
        speed.map_or(Ok(f64::INFINITY), |speed| self.in_range(name, speed, 1e-6..=f64::MAX))
    }

    /// The largest error with which a goal counts as reached.
    fn tolerance(&self, name: &str, tolerance: f64) -> Result<f64, ConfigError> {
        self.in_range(name, tolerance, 0.0..=f64::MAX)
    }

    /// Levenberg-Marquardt damping, s m/rad^2: `usual`, or two steps times one metre where that is more, unless it is
    /// given.
    fn damping(&self, given: Option<f64>, usual: f64) -> Result<f64, ConfigError> {
        given.map_or(Ok(usual.max(2.0 * self.period)), |damping| {
            self.in_range("damping", damping, 0.0..=f64::MAX)
        })
    }
}

/// A task with its name and the place of its level.
pub(super) struct Held {
    pub(super) name: String,
    /// 0 for the highest.
    pub(super) level: usize,
    pub(super) task: Box<dyn HeldTask>,
}

/// A task of a running controller, with its input and its parameters.
pub(super) trait HeldTask {
    /// Begins at the measured state `start`: a task without a target takes its target from there.
    fn begin(&mut self, start: &RobotState<'_>);

    /// Forgets all targets, for a new episode; [`begin`](Self::begin) follows.
    fn reset(&mut self);

    /// Applies the current parameters and the newest target, once per step.
    fn prepare(&mut self, bounds: &TaskBounds);

    /// The cost of the task on velocities; `None` for a task of inverse dynamics alone.
    fn task(&mut self) -> Option<&mut dyn Task>;

    /// The cost of the task on accelerations or contact forces, where the controller computes torques and the task can.
    fn acceleration(&mut self) -> Option<&mut dyn AccelerationTask> {
        None
    }

    /// Limits that give way, and the cost of a velocity beyond them.
    fn limits(&mut self) -> Option<(&mut [Box<dyn RowLimit>], f64)> {
        None
    }

    /// True if it holds exactly, above all levels.
    fn is_constraint(&self) -> bool {
        false
    }

    /// Takes the velocity that was decided.
    fn solved(&mut self, _velocity: &[f64]) {}

    /// The number of rows of its cost.
    fn rows(&mut self) -> usize {
        if let Some(task) = self.acceleration() {
            return task.rows();
        }
        self.task().map_or(0, |task| task.rows())
    }

    /// Records the error of the measured robot after a step of `dt` seconds.
    fn record(&mut self, _measured: &RobotState<'_>, _dt: f64) {}

    /// The goals of the target, if it has any.
    fn goals(&self) -> Option<&GoalRecord> {
        None
    }

    /// The entry of the task under `tasks` in the result of the run.
    fn result(&self) -> Option<serde_json::Value> {
        None
    }
}

/// Bounds that a controller sets to its tasks.
#[derive(Clone, Copy, Debug)]
pub(super) struct TaskBounds {
    /// Time since the step before, s.
    pub(super) dt: f64,
    /// The largest gain: half the tick rate, 1/s.
    pub(super) max_gain: f64,
    /// Age from which a target counts as standing still, ns.
    pub(super) target_timeout_ns: u64,
}
