//! Tasks of the robot: equations of their errors, which the formulations convert to costs.
//!
//! Most tasks are a [`Task`], which works for velocities and accelerations. Tasks that implement only
//! [`VelocityTask`] work for velocities.

#[macro_use]
mod kind;

/// Defines methods common to several tasks, for their fields `weight`, `gain` and `equation`.
macro_rules! methods {
    ($task:ident: $( $method:ident $(($($about:literal),+))? ),+) => {
        impl $task {
            $( method!($method $(($($about),+))?); )+
        }
    };
}

/// Defines one method of [`methods!`].
macro_rules! method {
    (weight($unit:literal)) => {
        #[doc = concat!("Sets the weight of the task \\[", $unit, "\\].")]
        #[must_use]
        pub fn weight(mut self, weight: f64) -> Self {
            self.weight = weight;
            self
        }
    };
    (set_weight) => {
        /// Changes the weight from the next update on.
        pub fn set_weight(&mut self, weight: f64) {
            self.weight = weight;
        }
    };
    (with($gain_unit:literal, $weight_unit:literal)) => {
        #[doc = concat!("Sets the gain \\[", $gain_unit, "\\] and the weight \\[", $weight_unit, "\\].")]
        #[must_use]
        pub fn with(mut self, gain: f64, weight: f64) -> Self {
            self.set(gain, weight);
            self
        }
    };
    (set) => {
        /// Changes the gain and weight from the next update on.
        pub fn set(&mut self, gain: f64, weight: f64) {
            (self.gain, self.weight) = (gain, weight);
        }
    };
    (rate($reduced:literal)) => {
        #[doc = concat!("Sets the rate \\[1/s\\] at which ", $reduced, " decays under acceleration control.")]
        #[must_use]
        pub fn rate(mut self, rate: f64) -> Self {
            self.equation.response = Response::velocity(rate);
            self
        }
    };
    (feedback($setter:literal)) => {
        /// Replaces the feedback used under acceleration control. A later call of
        #[doc = concat!("[`", $setter, "`](Self::", $setter, ") overwrites this feedback.")]
        #[must_use]
        pub fn feedback(mut self, feedback: Feedback) -> Self {
            self.equation.response.feedback = feedback;
            self
        }
    };
    (cost) => {
        /// Returns the cost of the last update.
        pub fn cost(&self) -> &Cost {
            self.equation.cost()
        }
    };
}

/// Defines the methods of a task with settings, which determine its response.
macro_rules! settings {
    ($task:ident, $settings:ident) => {
        impl $task {
            /// Sets the settings.
            #[must_use]
            pub fn with(mut self, settings: $settings) -> Self {
                self.set_settings(settings);
                self
            }

            /// Changes the settings from the next update on. Under acceleration control, this also replaces
            /// the task's feedback: the error then decays at the rate `gain` of the settings, critically
            /// damped.
            pub fn set_settings(&mut self, settings: $settings) {
                self.settings = settings;
                self.equation.response = settings.response();
            }

            /// Returns the settings.
            pub fn settings(&self) -> &$settings {
                &self.settings
            }
        }

        methods!($task: feedback("set_settings"), cost);
    };
}

/// Defines the builder method for the weight of a task with settings.
macro_rules! weight {
    ($task:ident) => {
        impl $task {
            /// Sets the weight.
            #[must_use]
            pub fn weight(mut self, weight: f64) -> Self {
                self.settings.weight = weight;
                self
            }
        }
    };
}

/// Defines the accessors that [`Task`] requires.
macro_rules! equation {
    () => {
        fn equation(&self) -> &Equation {
            &self.equation
        }

        fn equation_mut(&mut self) -> &mut Equation {
            &mut self.equation
        }
    };
}

mod admittance;
mod axes;
mod capture_point;
mod cartesian;
mod centre_of_mass;
mod contact;
mod contact_force;
mod contact_wrench;
mod context;
mod gaze;
mod held;
mod jacobian_view;
mod limit;
mod manipulability;
mod minimum;
mod minimum_acceleration;
mod minimum_effort;
mod minimum_torque;
mod minimum_velocity;
mod momentum;
mod pose_error;
mod posture;
mod ramp;
mod relative;
mod rigid_rotation;
mod rolling;
mod target;
mod unicycle;
mod velocities;

pub use admittance::{Admittance, AdmittanceSettings};
pub use axes::{AxesConfig, AxisShares, PoseAxes, SharesConfig};
pub use capture_point::CapturePoint;
pub use cartesian::{CartesianImpedance, CartesianImpedanceConfig, CartesianSettings, CartesianTask};
pub use centre_of_mass::{CentreOfMassSettings, CentreOfMassTask};
pub use contact::ContactTask;
pub use contact_force::{ContactForce, ForceRegularisation};
pub use contact_wrench::ContactWrench;
pub(crate) use context::TaskContext;
pub use gaze::{GazeSettings, GazeTask};
pub(crate) use held::{Held, TaskCost};
pub use jacobian_view::JacobianView;
pub(crate) use kind::{ActsOn, Formulations, TaskHead, TaskKind};
pub use manipulability::{ManipulabilityRows, ManipulabilityTask, Measure};
pub use minimum::MinimumOf;
pub use minimum_acceleration::AccelerationMinimum;
pub use minimum_effort::MinimumEffortTask;
pub use minimum_torque::TorqueMinimum;
pub use minimum_velocity::MinimumVelocityTask;
pub use momentum::MomentumTask;
pub use pose_error::PoseError;
pub use posture::{JointImpedanceConfig, PostureSettings, PostureTask};
pub(crate) use ramp::{Fades, TaskBounds};
pub use relative::{RelativeSettings, RelativeTask};
pub use rigid_rotation::RigidRotationTask;
pub use rolling::RollingTask;
pub use unicycle::{UnicycleSettings, UnicycleTask};

use motorium::declare::ConfigError;
use schemars::JsonSchema;
use serde::Deserialize;

pub use crate::cost::Cost;
pub use crate::formulation::{Equation, Feedback, Response, Task, VelocityTask};
pub use crate::levels::Rows;

/// Defines [`TaskConfig`] from a list with, for each kind of task, its key in the configuration, its variant,
/// and the file and type of its table.
macro_rules! task_kinds {
    (
        $( $(#[$doc:meta])* $key:literal => $variant:ident($file:ident::$config:ident), )*
        constraint,
        $( $(#[$other_doc:meta])* $other_key:literal => $other:ident($other_file:ident::$other_config:ident), )*
    ) => {
        $( pub use $file::$config; )*
        $( pub use $other_file::$other_config; )*

        /// One task of `control.qp`.
        #[derive(Debug, Clone, Deserialize, JsonSchema)]
        pub enum TaskConfig {
            $( $(#[$doc])* #[serde(rename = $key)] $variant($config), )*
            /// A constraint: a task that holds exactly, above all levels.
            #[serde(rename = "constraint")]
            Constraint(ConstraintConfig),
            $( $(#[$other_doc])* #[serde(rename = $other_key)] $other($other_config), )*
        }

        impl TaskConfig {
            /// Returns the key and table of the task, or the inner task if this is a constraint.
            fn table(&self) -> Result<(&'static str, &dyn TaskKind), &TaskConfig> {
                match self {
                    $( Self::$variant(config) => Ok(($key, config)), )*
                    $( Self::$other(config) => Ok(($other_key, config)), )*
                    Self::Constraint(constraint) => Err(&constraint.task),
                }
            }
        }
    };
}

task_kinds! {
    /// A frame yields to a measured wrench like a mass on a spring and a damper.
    "admittance" => Admittance(admittance::AdmittanceConfig),
    /// The capture point, where the robot would have to step to come to rest, follows a target. Requires
    /// `inverse_dynamics`.
    "capture_point" => CapturePoint(capture_point::CapturePointConfig),
    /// A frame follows a pose target.
    "cartesian" => Cartesian(cartesian::CartesianConfig),
    /// The centre of mass follows a target point.
    "centre_of_mass" => CentreOfMass(centre_of_mass::CentreOfMassConfig),
    constraint,
    /// Force and torque of a contact follow a target. Requires `inverse_dynamics`.
    "contact_wrench" => ContactWrench(contact_wrench::ContactWrenchConfig),
    /// An axis of a frame points at a target point.
    "gaze" => Gaze(gaze::GazeConfig),
    /// Soft limits. Not supported with `inverse_dynamics`.
    "limit" => Limit(limit::LimitConfig),
    /// The joints move towards configurations in which a frame moves, or exerts forces, more easily.
    "manipulability" => Manipulability(manipulability::ManipulabilityConfig),
    /// Velocities, accelerations, efforts, torques or contact forces are minimised.
    "minimum" => Minimum(minimum::MinimumConfig),
    /// The momentum about the centre of mass decays to zero. Requires `inverse_dynamics`.
    "momentum" => Momentum(momentum::MomentumConfig),
    /// The joints keep a posture.
    "posture" => Posture(posture::PostureConfig),
    /// A frame reaches a pose relative to another frame of the robot.
    "relative" => Relative(relative::RelativeConfig),
    /// A steered wheel turns into the direction of motion of its base.
    "rigid_rotation" => RigidRotation(rigid_rotation::RigidRotationConfig),
    /// A wheel rolls without slipping.
    "rolling" => Rolling(rolling::RollingConfig),
    /// A frame drives forward and turns, but never moves sideways.
    "unicycle" => Unicycle(unicycle::UnicycleConfig),
}

/// A task that is a constraint: it holds exactly, above all levels. Rows with zero weight stay free; nonzero
/// weights and the damping of the task are ignored.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ConstraintConfig {
    /// The task, a table with one key as in `tasks`; its `level` is ignored.
    pub task: Box<TaskConfig>,
}

/// A configured task: its table, and the path of the table in the configuration.
pub(crate) struct Configured<'a> {
    pub(crate) path: String,
    pub(crate) kind: &'a dyn TaskKind,
    /// `true` if the task holds exactly, above all levels.
    pub(crate) is_constraint: bool,
}

impl TaskConfig {
    /// Returns the table of the task with this index in the configuration.
    ///
    /// # Errors
    /// If the task cannot be a constraint.
    pub(crate) fn configured(&self, index: usize) -> Result<Configured<'_>, ConfigError> {
        let task = match self.table() {
            Ok((key, kind)) => {
                return Ok(Configured { path: format!("tasks[{index}].{key}"), kind, is_constraint: false });
            }
            Err(task) => task,
        };
        let path = format!("tasks[{index}].constraint.task");
        match task.table() {
            Ok((key, kind)) if !matches!(task, Self::Limit(_)) => {
                Ok(Configured { path: format!("{path}.{key}"), kind, is_constraint: true })
            }
            other => {
                let key = other.map_or("constraint", |(key, _)| key);
                Err(ConfigError::key(path, format!("`{key}` is not a task that can hold exactly"))
                    .advise("name a task, such as task = { cartesian = {} }"))
            }
        }
    }
}
