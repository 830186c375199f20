//! The `actuator` and `actuators` tables in the configuration of components that simulate drives.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::Deserialize;

use super::{
    Activation, ActuatorSettings, Drivetrain, Envelope, InputOrder, NetworkSettings, NetworkWeights, Thermal,
};
use crate::Model;

/// Maximum size of an actuator network file, bytes. Networks have a few thousand weights.
const LONGEST_NETWORK: u64 = 256 * 1024 * 1024;

/// Model of an actuator: the stages between the commanded effort and the effort on the joint. The default is
/// an ideal actuator, which delivers each commanded effort immediately.
///
/// `T` is the type that the caller uses for times.
///
/// ```toml
/// delay      = "2 ms"
/// envelope   = { stall_effort = 120.0, no_load_velocity = 3.0 }
/// lag        = "5 ms"
/// rate_limit = 2000.0
/// thermal    = { continuous_effort = 40.0, time_constant = "60 s" }
/// drivetrain = { motor_inertia = 0.4, stiffness = 3000.0, damping = 5.0, backlash = 0.002 }
/// network    = { file = "anydrive.safetensors" }
/// ```
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, bound(deserialize = "T: Deserialize<'de> + Default"))]
#[schemars(rename = "ActuatorConfig")]
pub struct ActuatorTable<T: Default> {
    /// Delay of commands. Default 0.
    #[serde(default)]
    pub delay: T,
    /// Torque-speed envelope. Default: the effort limit at every speed.
    pub envelope: Option<EnvelopeTable>,
    /// Heating of the winding. Default: the effort limit can be sustained indefinitely.
    pub thermal: Option<ThermalTable<T>>,
    /// Time constant of the first-order lag of the effort. Default 0.
    #[serde(default)]
    pub lag: T,
    /// Maximum rate of change of the effort, N m/s or N/s. Default: unlimited.
    pub rate_limit: Option<f64>,
    /// Series elasticity and backlash between motor and joint. Default: a rigid drivetrain.
    pub drivetrain: Option<DrivetrainTable>,
    /// A learned network that replaces the drive's law. Default: no network.
    pub network: Option<NetworkTable<T>>,
}

/// Torque-speed envelope of a motor at a limited voltage: the available effort falls from `stall_effort` at
/// standstill to zero at `no_load_velocity`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "EnvelopeConfig")]
pub struct EnvelopeTable {
    /// Stall effort, N m or N. The effort is also limited to the effort limit of the joint.
    pub stall_effort: f64,
    /// Velocity at which the available effort is zero, rad/s or m/s.
    pub no_load_velocity: f64,
}

/// Heating of a motor's winding. As the winding warms up, the effort limit falls to the continuous effort.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, bound(deserialize = "T: Deserialize<'de>"))]
#[schemars(rename = "ThermalConfig")]
pub struct ThermalTable<T> {
    /// Continuous effort, N m or N.
    pub continuous_effort: f64,
    /// Time constant of the winding.
    pub time_constant: T,
}

/// Compliant drivetrain: a motor with its own inertia, and the spring, damper and gap between motor and
/// joint. All values are converted to the joint side of the gear. The drive controls the motor's position and
/// velocity.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(rename = "DrivetrainConfig")]
pub struct DrivetrainTable {
    /// Inertia of the motor reflected to the joint, kg m2 or kg.
    pub motor_inertia: f64,
    /// Stiffness of the spring, N m/rad or N/m.
    pub stiffness: f64,
    /// Damping parallel to the spring, N m s/rad or N s/m. Default 0.
    #[serde(default)]
    pub damping: f64,
    /// Width of the gap in the gear, rad or m. Default 0: a series-elastic actuator.
    #[serde(default)]
    pub backlash: f64,
}

/// A multilayer perceptron in a safetensors file that computes the effort from current and past position
/// errors and velocities.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, bound(deserialize = "T: Deserialize<'de>"))]
#[schemars(rename = "NetworkConfig")]
pub struct NetworkTable<T> {
    /// Path of the file, relative to the graph's folder. The tensors in the file must be named as in a
    /// `torch.nn.Sequential`: `0.weight`, `0.bias`, `2.weight` and so on.
    #[schemars(extend("format" = "path"))]
    pub file: String,
    /// Activation function between the layers. Default `softsign`.
    #[serde(default)]
    pub activation: Activation,
    /// Ages of the input measurements, in the order of the inputs. Default `["0 ms", "10 ms", "20 ms"]`.
    #[serde(default)]
    pub times: Option<Vec<T>>,
    /// Order of the inputs. Default: all position errors before all velocities.
    #[serde(default)]
    pub input_order: InputOrder,
    /// Factor that multiplies position errors at the input. Default 1.
    #[serde(default = "one")]
    pub position_scale: f64,
    /// Factor that multiplies velocities at the input. Default 1.
    #[serde(default = "one")]
    pub velocity_scale: f64,
    /// Effort that corresponds to a network output of 1, N m or N. Default 1.
    #[serde(default = "one")]
    pub effort_scale: f64,
}

fn one() -> f64 {
    1.0
}

/// Measurement ages of Hwangbo et al. \[s\].
const TIMES: [f64; 3] = [0.0, 0.01, 0.02];
/// Maximum number of measurement times of a network.
const MOST_TIMES: usize = 64;

/// Error of an invalid key in the tables `actuator` and `actuators`.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{key}: {message}")]
pub struct ActuatorTableError {
    /// Dotted path of the key.
    pub key: String,
    /// Actual and valid values.
    pub message: String,
    /// Suggested action.
    pub advice: Option<String>,
}

impl ActuatorTableError {
    fn new(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self { key: key.into(), message: message.into(), advice: None }
    }

    fn advise(self, advice: impl Into<String>) -> Self {
        Self { advice: Some(advice.into()), ..self }
    }
}

impl<T: Copy + Default> ActuatorTable<T> {
    /// Converts the table at the dotted path `key` to settings. Relative paths of network files refer to
    /// `folder`, and `seconds` converts times of type `T` to seconds.
    ///
    /// # Errors
    ///
    /// [`ActuatorTableError`] for the first key that is not valid.
    pub fn settings(
        &self,
        key: &str,
        folder: &Path,
        seconds: fn(T) -> f64,
    ) -> Result<ActuatorSettings, ActuatorTableError> {
        let envelope =
            |EnvelopeTable { stall_effort, no_load_velocity }| Envelope { stall_effort, no_load_velocity };
        let thermal = |ThermalTable { continuous_effort, time_constant }| Thermal {
            continuous_effort,
            time_constant: seconds(time_constant),
        };
        let drivetrain = |DrivetrainTable { motor_inertia, stiffness, damping, backlash }| Drivetrain {
            motor_inertia,
            stiffness,
            damping,
            backlash,
        };
        let network =
            self.network.as_ref().map(|network| network.settings(key, folder, seconds)).transpose()?;
        let settings = ActuatorSettings {
            delay: seconds(self.delay),
            envelope: self.envelope.map(envelope),
            thermal: self.thermal.map(thermal),
            lag: seconds(self.lag),
            rate_limit: self.rate_limit,
            drivetrain: self.drivetrain.map(drivetrain),
            network: network.map(Arc::new),
        };
        let refused = |error: super::ActuatorError| {
            ActuatorTableError::new(format!("{key}.{}", error.setting), error.to_string())
        };
        settings.check().map(|()| settings).map_err(refused)
    }

    /// Returns the actuator settings of all joints of a model: the table `of_all`, unless a joint has its own
    /// table. The list is empty if all actuators are ideal.
    ///
    /// # Errors
    ///
    /// [`ActuatorTableError`] for the first key that is not valid, or for an unknown joint.
    pub fn of_joints(
        (of_all, of_joints): (Option<&Self>, &BTreeMap<String, Self>),
        model: &Model,
        folder: &Path,
        seconds: fn(T) -> f64,
    ) -> Result<Vec<Option<ActuatorSettings>>, ActuatorTableError> {
        if of_all.is_none() && of_joints.is_empty() {
            return Ok(Vec::new());
        }
        let all = of_all.map(|table| table.settings("actuator", folder, seconds)).transpose()?;
        let mut settings = vec![all; model.joint_count()];
        for (name, table) in of_joints {
            let key = format!("actuators.{name}");
            let Some(joint) = model.joint_index(name) else {
                let message = format!("robot `{}` has no joint `{name}`", model.name());
                let advice = format!("use one of its joints: {}", model.joint_names().join(", "));
                return Err(ActuatorTableError::new(key, message).advise(advice));
            };
            settings[joint] = Some(table.settings(&key, folder, seconds)?);
        }
        Ok(settings)
    }
}

impl<T: Copy> NetworkTable<T> {
    fn settings(
        &self,
        key: &str,
        folder: &Path,
        seconds: fn(T) -> f64,
    ) -> Result<NetworkSettings, ActuatorTableError> {
        let key = |name: &str| format!("{key}.network.{name}");
        let written = self.times.as_ref().map(|times| times.iter().map(|time| seconds(*time)).collect());
        let times: Vec<f64> = written.unwrap_or_else(|| TIMES.to_vec());
        let ages = |time: &f64| (0.0..=10.0).contains(time);
        if times.is_empty() || times.len() > MOST_TIMES || !times.iter().all(ages) {
            let message =
                format!("{} times, expected 1 to {MOST_TIMES} times, each from 0 to 10 s", times.len());
            return Err(ActuatorTableError::new(key("times"), message));
        }
        for (name, scale) in [
            ("position_scale", self.position_scale),
            ("velocity_scale", self.velocity_scale),
            ("effort_scale", self.effort_scale),
        ] {
            if !scale.is_finite() {
                return Err(ActuatorTableError::new(key(name), format!("{scale}, expected a finite number")));
            }
        }
        let path = folder.join(&self.file);
        let bytes = crate::file::read_bounded(&path, LONGEST_NETWORK).map_err(|error| {
            ActuatorTableError::new(key("file"), format!("{}: {error}", path.display()))
                .advise("relative paths start at the folder of the graph")
        })?;
        let weights = NetworkWeights::read(&bytes, 2 * times.len(), self.activation).map_err(|error| {
            let message = format!("{}: {error}", path.display());
            ActuatorTableError::new(key("file"), message)
                .advise("save it with `safetensors.torch.save_file(net.state_dict(), ...)`, and list one of `times` for each pair of inputs (position error and velocity)")
        })?;
        Ok(NetworkSettings {
            weights,
            times,
            input_order: self.input_order,
            position_scale: self.position_scale,
            velocity_scale: self.velocity_scale,
            effort_scale: self.effort_scale,
        })
    }
}
