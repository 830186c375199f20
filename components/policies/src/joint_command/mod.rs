//! Joint commands of a policy: configuration, ports, gains, and the moved joints.

mod writer;

pub(crate) use writer::JointCommandWriter;

use motorium::declare::{ConfigError, Declare, RobotReference};
use motorium::state::{JointCommand, JointState};
use motorium::units::TimeSpan;
use motorium_robots::{Gains, Loaded, Model, PerJoint, Profile, ProfileError};
use nalgebra::{DVector, Vector3};
use schemars::JsonSchema;
use serde::Deserialize;

use crate::robot::required;

/// Gains, easing and feed-forward of joint commands.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct JointCommandConfig {
    /// Stiffness, N m/rad or N/m: one number for all joints, or one per joint. Default: the gains of the
    /// robot's profile.
    pub kp: Option<PerJoint>,
    /// Damping, N m s/rad or N s/m: one number for all joints, or one per joint. Default: the gains of the
    /// robot's profile.
    pub kd: Option<PerJoint>,
    /// Duration of the transition from the robot's current position to the movement, such as "1 s". Default 1
    /// s.
    pub ease: TimeSpan,
    /// Adds the effort that compensates gravity. A floating base is assumed to be upright and at rest.
    /// Default true.
    pub gravity_compensation: bool,
}

impl Default for JointCommandConfig {
    fn default() -> Self {
        Self { kp: None, kd: None, ease: TimeSpan { ns: 1_000_000_000 }, gravity_compensation: true }
    }
}

/// Returns the gravity of a graph without a configured one, in the world frame, m/s^2.
pub(crate) fn earth() -> [f64; 3] {
    [0.0, 0.0, -9.81]
}

/// Names of the ports for the state and the commands of a robot's joints.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct JointPorts {
    state: String,
    command: String,
}

impl JointPorts {
    /// Returns the ports of a component for a single robot.
    pub(crate) fn single() -> Self {
        Self { state: "joint_state".to_string(), command: "joint_command".to_string() }
    }

    /// Returns the ports of one of several robots.
    pub(crate) fn for_robot(name: &str) -> Self {
        Self { state: format!("state_{name}"), command: format!("command_{name}") }
    }

    /// Declares the ports.
    pub(crate) fn declare(&self, declare: &mut Declare) {
        declare.input::<JointState>(&self.state, "measured joint state of the robot");
        declare
            .output::<JointCommand>(&self.command, "setpoints, feed-forward efforts and gains of all joints");
    }
}

/// The robot model of a component, its gains and the joints that a policy moves.
#[derive(Debug)]
pub(crate) struct CommandedJoints {
    pub(crate) model: Model,
    gains: Gains,
    gravity: Vector3<f64>,
    joints: Vec<usize>,
    /// Joints without a drive.
    passive: Vec<usize>,
    /// Acceleration limits of the robot's profile, by joint of the robot; `None` if it has none.
    acceleration: Option<DVector<f64>>,
}

/// Error if the gains required by a command are unavailable.
#[derive(Debug, thiserror::Error)]
pub(crate) enum GainsError {
    /// The robot has no profile, or a profile without gains.
    #[error("robot `{robot}` has no profile with gains")]
    Missing {
        /// Name of the robot in the graph.
        robot: String,
    },
    /// The profile does not match the robot.
    #[error(transparent)]
    Profile(ProfileError),
}

/// Returns the gains of a robot's profile, in the order of its joints.
pub(crate) fn profile_gains(
    robot: &str,
    model: &Model,
    profile: Option<&Profile>,
) -> Result<Gains, GainsError> {
    let missing = || GainsError::Missing { robot: robot.to_owned() };
    profile.ok_or_else(missing)?.gains(model).map_err(|error| match error {
        ProfileError::NoGains => missing(),
        other => GainsError::Profile(other),
    })
}

/// Returns the gains configured in `joint_command`, or else the profile's.
fn configured_gains(
    config: &JointCommandConfig,
    robot: &str,
    model: &Model,
    profile: Option<&Profile>,
) -> Result<Gains, ConfigError> {
    let usual = match (&config.kp, &config.kd) {
        (Some(_), Some(_)) => None,
        _ => Some(profile_gains(robot, model, profile).map_err(|error| match error {
            GainsError::Missing { .. } => ConfigError::new(error.to_string()).advise(
                "give `joint_command.kp` and `joint_command.kd`, one number for all joints or one for each",
            ),
            GainsError::Profile(error) => ConfigError::new(error.to_string()),
        })?),
    };
    let arrange = |given: &Option<PerJoint>, key: &str, usual: Option<&DVector<f64>>| match (given, usual) {
        (Some(given), _) => {
            let values = given.resolve(model.joint_count()).map_err(|error| {
                let names = model.joint_names().join(", ");
                ConfigError::key(key, error.to_string()).advise(format!("in this order: {names}"))
            })?;
            match values.iter().find(|value| !(value.is_finite() && **value >= 0.0)) {
                Some(value) => Err(ConfigError::key(
                    key,
                    format!("a gain of {value}, expected a finite number of at least 0"),
                )),
                None => Ok(DVector::from_vec(values)),
            }
        }
        (None, Some(usual)) => Ok(usual.clone()),
        (None, None) => Ok(DVector::zeros(model.joint_count())),
    };
    Ok(Gains {
        kp: arrange(&config.kp, "joint_command.kp", usual.as_ref().map(|gains| &gains.kp))?,
        kd: arrange(&config.kd, "joint_command.kd", usual.as_ref().map(|gains| &gains.kd))?,
    })
}

impl CommandedJoints {
    /// Checks everything that can be checked before a run. `joints` are names; `key` is their key in the
    /// config. `gravity` is in the world frame, m/s^2.
    pub(crate) fn new<'a>(
        config: &JointCommandConfig,
        gravity: [f64; 3],
        robot: Option<&RobotReference>,
        joints: impl Iterator<Item = (&'a str, String)>,
    ) -> Result<Self, ConfigError> {
        let robot = required(robot, "joints")?;
        Self::with_gains(crate::robot::load(robot)?, &robot.name, gravity, joints, |model, profile| {
            configured_gains(config, &robot.name, model, profile)
        })
    }

    /// Like [`new`](Self::new) for a loaded robot, with the gains that `gains` returns for all its joints.
    pub(crate) fn with_gains<'a>(
        loaded: Loaded,
        robot: &str,
        gravity: [f64; 3],
        joints: impl Iterator<Item = (&'a str, String)>,
        gains: impl FnOnce(&Model, Option<&Profile>) -> Result<Gains, ConfigError>,
    ) -> Result<Self, ConfigError> {
        if let Some(number) = gravity.iter().find(|number| !(-1000.0..=1000.0).contains(*number)) {
            return Err(ConfigError::key("gravity", format!("{number}, expected -1000 to 1000 m/s2")));
        }
        let model = loaded.model;
        let mut found = Vec::new();
        for (name, key) in joints {
            let index = model.joint_index(name).ok_or_else(|| {
                let names = model.joint_names().join(", ");
                ConfigError::key(&key, format!("robot `{robot}` has no joint \"{name}\""))
                    .advise(format!("its joints are {names}"))
            })?;
            if found.contains(&index) {
                return Err(ConfigError::key(key, format!("joint \"{name}\" is named twice")));
            }
            found.push(index);
        }
        let gains = gains(&model, loaded.profile.as_ref())?;
        let passive = loaded.profile.iter().flat_map(|profile| &profile.passive);
        let passive = passive.filter_map(|name| model.joint_index(name)).collect();
        let acceleration = loaded.profile.as_ref().map(|profile| profile.acceleration_limit(&model));
        let acceleration =
            acceleration.transpose().map_err(|error| ConfigError::key("robot", error.to_string()))?;
        let acceleration = acceleration.filter(|limits| limits.iter().any(|limit| limit.is_finite()));
        let gravity = Vector3::from(gravity);
        Ok(Self { model, gains, gravity, joints: found, passive, acceleration })
    }

    /// Names of the moved joints, in the order of the policy.
    pub(crate) fn names(&self) -> Vec<String> {
        self.joints.iter().map(|joint| self.model.joint_names()[*joint].clone()).collect()
    }

    /// Declares the ports and parameters of the joint command writer of one robot.
    pub(crate) fn declare(declare: &mut Declare) {
        JointPorts::single().declare(declare);
        Self::declare_scales(declare);
    }

    /// Declares the parameters shared by all joint command writers of a component.
    pub(crate) fn declare_scales(declare: &mut Declare) {
        declare.float("kp_scale", 1.0, 0.0..=2.0, "", "factor of the stiffness of all joints");
        declare.float("kd_scale", 1.0, 0.0..=2.0, "", "factor of the damping of all joints");
    }
}
