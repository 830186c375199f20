//! The `actuator` and `actuators` tables of the physics kinds.

use std::collections::BTreeMap;

use motorium::declare::ConfigError;
use motorium::units::TimeSpan;
use motorium_robots::{ActuatorSettings, Envelope, Model, Thermal};
use schemars::JsonSchema;
use serde::Deserialize;

/// The stages between the effort that a drive is asked for and the one that it gives. The default is an ideal actuator.
///
/// ```toml
/// delay      = "2 ms"
/// envelope   = { stall_effort = 120.0, no_load_velocity = 3.0 }
/// lag        = "5 ms"
/// rate_limit = 2000.0
/// thermal    = { continuous_effort = 40.0, time_constant = "60 s" }
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ActuatorConfig {
    /// Time from a command until it acts. Default none.
    pub delay: TimeSpan,
    /// Torque-speed envelope. Default: the effort limit at every speed.
    pub envelope: Option<EnvelopeConfig>,
    /// Warming up of the winding. Default: the effort limit can be given for ever.
    pub thermal: Option<ThermalConfig>,
    /// Time constant of the effort, a first-order lag. Default none.
    pub lag: TimeSpan,
    /// Largest rate of the effort, N m/s or N/s. Default: no end.
    pub rate_limit: Option<f64>,
}

/// The efforts of a motor at a limited voltage: from `stall_effort` at standstill they fall to none at `no_load_velocity`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EnvelopeConfig {
    /// Effort at standstill, N m or N; the effort limit of the joint holds besides it.
    pub stall_effort: f64,
    /// Velocity at which no effort is left, rad/s or m/s.
    pub no_load_velocity: f64,
}

/// The warming up of a winding: as it gets hot the effort limit falls to the continuous effort.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ThermalConfig {
    /// Effort that can be given for ever, N m or N.
    pub continuous_effort: f64,
    /// Time constant of the winding.
    pub time_constant: TimeSpan,
}

impl ActuatorConfig {
    fn settings(&self) -> ActuatorSettings {
        let seconds = |time: TimeSpan| time.ns as f64 * 1e-9;
        ActuatorSettings {
            delay: seconds(self.delay),
            envelope: self.envelope.map(|EnvelopeConfig { stall_effort, no_load_velocity }| Envelope {
                stall_effort,
                no_load_velocity,
            }),
            thermal: self.thermal.map(|ThermalConfig { continuous_effort, time_constant }| Thermal {
                continuous_effort,
                time_constant: seconds(time_constant),
            }),
            lag: seconds(self.lag),
            rate_limit: self.rate_limit,
        }
    }
}

/// The actuators of the joints of a model: `of_all`, and in its place those of single joints. Empty where all are ideal.
pub(super) fn settings(
    of_all: Option<&ActuatorConfig>,
    of_joints: &BTreeMap<String, ActuatorConfig>,
    model: &Model,
) -> Result<Vec<Option<ActuatorSettings>>, ConfigError> {
    if of_all.is_none() && of_joints.is_empty() {
        return Ok(Vec::new());
    }
    let checked = |key: String, config: &ActuatorConfig| {
        let settings = config.settings();
        let refused = |error: motorium_robots::ActuatorError| {
            ConfigError::key(format!("{key}.{}", error.setting), error.to_string())
        };
        settings.check().map(|()| Some(settings)).map_err(refused)
    };
    let all = of_all.map_or(Ok(None), |config| checked("actuator".to_owned(), config))?;
    let mut settings = vec![all; model.joint_count()];
    for (name, config) in of_joints {
        let Some(joint) = model.joint_index(name) else {
            let message = format!("robot `{}` has no joint `{name}`", model.name());
            let names = model.joint_names().join(", ");
            return Err(
                ConfigError::key(format!("actuators.{name}"), message).advise(format!("it has: {names}"))
            );
        };
        settings[joint] = checked(format!("actuators.{name}"), config)?;
    }
    Ok(settings)
}
