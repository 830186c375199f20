//! The tasks of `control.qp`: one file and one line of [`task_kinds!`] for each kind of task.
//!
//! A file holds the configuration of its kind, which implements [`TaskKind`], and the running task, which
//! implements [`HeldTask`]. The controller knows only these two traits.

mod admittance;
mod axes;
mod capture_point;
mod cartesian;
mod centre_of_mass;
mod constraint;
mod contact_wrench;
mod gaze;
mod held;
mod impedance;
mod limit;
mod manipulability;
mod minimum;
mod momentum;
mod place;
mod posture;
mod ramp;
mod relative;
mod rigid_rotation;
mod rolling;
mod unicycle;

pub use axes::{AxesConfig, SharesConfig};
pub(super) use held::{Held, HeldTask};
pub use impedance::{CartesianImpedanceConfig, JointImpedanceConfig};
pub use manipulability::ManipulabilityRows;
pub use minimum::MinimumOf;
pub(super) use place::TaskPlace;
use ramp::Ramped;
pub(super) use ramp::{Fades, TaskBounds};

use core::ops::RangeInclusive;

use motorium::prelude::*;
use motorium_robots::World;
use schemars::JsonSchema;
use serde::Deserialize;

/// Range of every gain, 1/s.
const GAINS: RangeInclusive<f64> = 0.0..=1000.0;
/// Range of every weight.
const WEIGHTS: RangeInclusive<f64> = 0.0..=1000.0;
/// Decay rate of velocity errors for tasks without positions in a torque controller, 1/s.
const RATE: f64 = 20.0;

/// Defines [`TaskConfig`]: for each kind of task its key in the configuration, its variant, and the file and
/// the type of its table.
macro_rules! task_kinds {
    ($( $(#[$doc:meta])* $key:literal => $variant:ident($file:ident::$config:ident), )*) => {
        $( pub use $file::$config; )*

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
    /// A frame yields to a measured wrench like a mass on a spring and a damper.
    "admittance" => Admittance(admittance::AdmittanceConfig),
    /// The point where the robot would have to step to come to rest follows a point; torques only.
    "capture_point" => CapturePoint(capture_point::CapturePointConfig),
    /// A frame follows a pose target.
    "cartesian" => Cartesian(cartesian::CartesianConfig),
    /// The centre of mass follows a point.
    "centre_of_mass" => CentreOfMass(centre_of_mass::CentreOfMassConfig),
    /// A task holds exactly, above all levels.
    "constraint" => Constraint(constraint::ConstraintConfig),
    /// Force and torque of a contact follow a target; torques only.
    "contact_wrench" => ContactWrench(contact_wrench::ContactWrenchConfig),
    /// An axis of a frame points at a point.
    "gaze" => Gaze(gaze::GazeConfig),
    /// Soft limits; velocities only.
    "limit" => Limit(limit::LimitConfig),
    /// The joints move to where a frame is moved, or exerts forces, more easily.
    "manipulability" => Manipulability(manipulability::ManipulabilityConfig),
    /// Velocities, accelerations, efforts, torques or contact forces are small.
    "minimum" => Minimum(minimum::MinimumConfig),
    /// The momentum about the centre of mass decays to zero; torques only.
    "momentum" => Momentum(momentum::MomentumConfig),
    /// The joints keep a posture.
    "posture" => Posture(posture::PostureConfig),
    /// A frame reaches a pose in another frame of the robot.
    "relative" => Relative(relative::RelativeConfig),
    /// A steered wheel turns into the direction of motion of its base.
    "rigid_rotation" => RigidRotation(rigid_rotation::RigidRotationConfig),
    /// A wheel rolls without slipping.
    "rolling" => Rolling(rolling::RollingConfig),
    /// A frame drives forward and turns, and never sideways.
    "unicycle" => Unicycle(unicycle::UnicycleConfig),
}

/// The configuration of one kind of task.
pub(super) trait TaskKind {
    /// Name, level, inputs and supported formulations.
    fn head(&self) -> TaskHead<'_>;

    /// Parameters, each of which can be changed at run time as `NAME_PARAMETER`.
    fn parameters(&self) -> Vec<TaskParameter>;

    /// Returns `true` for a task that holds exactly, above all levels.
    fn is_constraint(&self) -> bool {
        false
    }

    /// Returns `true` if the task has limits that involve a moving object of the world.
    fn has_moving_objects(&self, _world: &World) -> bool {
        false
    }

    /// Checks the configuration, and declares inputs.
    fn declare(&self, place: &TaskPlace<'_>, declare: &mut Declare) -> Result<(), ConfigError>;

    /// Builds the task, and opens inputs and parameters. All memory of the task is allocated here.
    fn configure(
        &self,
        place: &TaskPlace<'_>,
        setup: &mut Setup,
    ) -> Result<Box<dyn HeldTask>, ConfigureError>;

    /// Opens all of its parameters, in the order of [`parameters`](Self::parameters).
    fn open<const N: usize>(&self, setup: &Setup) -> Result<[Ramped; N], ConfigureError>
    where
        Self: Sized,
    {
        let name = self.head().name;
        let parameters = self.parameters();
        let opened = parameters.iter().map(|parameter| {
            let is_weight = parameter.is_weight();
            setup.parameter(&parameter.key(name)).map(|parameter| Ramped::new(parameter, is_weight))
        });
        let opened = opened.collect::<Result<Vec<_>, _>>()?;
        let count = opened.len();
        opened
            .try_into()
            .map_err(|_| ConfigureError::failed(format!("a task that reads {N} of its {count} parameters")))
    }
}

/// Name, priority and inputs of a task.
pub(super) struct TaskHead<'a> {
    /// Name of the task, used as a prefix of its parameter names.
    pub(super) name: &'a str,
    /// Priority level; lower numbers have strict priority.
    pub(super) level: u32,
    /// Name of the input of its target, if it has one.
    pub(super) target: Option<&'a str>,
    /// Name of the input of a measured wrench, if it has one.
    pub(super) wrench: Option<&'a str>,
    /// Formulations of the controller that the task supports.
    pub(super) formulations: Formulations,
    /// Unknowns of the controller that the task involves.
    pub(super) acts_on: ActsOn,
}

impl<'a> TaskHead<'a> {
    /// A task without inputs, for velocities and torques.
    fn new(name: &'a str, level: u32) -> Self {
        let (formulations, acts_on) = (Formulations::Both, ActsOn::Body);
        Self { name, level, target: None, wrench: None, formulations, acts_on }
    }

    fn target(self, target: &'a str) -> Self {
        Self { target: Some(target), ..self }
    }

    fn wrench(self, wrench: &'a str) -> Self {
        Self { wrench: Some(wrench), ..self }
    }

    fn only(self, formulations: Formulations) -> Self {
        Self { formulations, ..self }
    }

    fn acts_on(self, acts_on: ActsOn) -> Self {
        Self { acts_on, ..self }
    }
}

/// A parameter of a task.
pub(super) struct TaskParameter {
    name: &'static str,
    default: f64,
    range: RangeInclusive<f64>,
    unit: &'static str,
    doc: &'static str,
}

impl TaskParameter {
    fn new(
        name: &'static str,
        default: f64,
        range: RangeInclusive<f64>,
        unit: &'static str,
        doc: &'static str,
    ) -> Self {
        Self { name, default, range, unit, doc }
    }

    /// The rate at which the error of a task decays.
    fn gain(default: f64) -> Self {
        Self::new("gain", default, GAINS, "1/s", "rate at which the error decays")
    }

    /// True of a weight, which switches something off at 0.
    fn is_weight(&self) -> bool {
        self.name.ends_with("weight")
    }

    fn key(&self, task: &str) -> String {
        format!("{task}_{}", self.name)
    }

    /// Declares the input for the task of this name.
    pub(super) fn declare(self, task: &str, declare: &mut Declare) {
        declare.float(&self.key(task), self.default, self.range, self.unit, self.doc);
    }
}

/// The formulations of the controller that a kind of task has a cost for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Formulations {
    /// Velocities and torques.
    Both,
    /// Velocities only, and advice for torques.
    Velocity(&'static str),
    /// Torques alone.
    Torque,
}

/// The unknowns of the controller that a kind of task has a part in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ActsOn {
    /// Motions of a body, which joints and contact forces both cause.
    Body,
    /// Joint motion only; contact forces have no effect.
    Joints,
    /// Contact forces and torques.
    Forces,
}
