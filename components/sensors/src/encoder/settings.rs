//! The numbers that describe a robot's joint sensors.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// One number for all joints, or one for each in the order of the model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum PerJoint {
    /// The same for all.
    Same(f64),
    /// One for each joint.
    Each(Vec<f64>),
}

/// Where a velocity reading comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", tag = "kind", deny_unknown_fields)]
pub enum VelocitySource {
    /// A sensor of its own: the true velocity with `velocity_noise`. The default.
    #[default]
    Measured,
    /// The difference of successive position readings over the time between them, through a first-order low-pass: what
    /// most drives do. Noise and resolution of the position show in it; it is 0 at the first sample.
    Differentiated {
        /// Cut-off frequency of the low-pass, Hz.
        cutoff_hz: f64,
    },
}

/// A robot's joint sensors; the default is ideal. Units are those of the joint: rad or, where it slides, m.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct EncoderSettings {
    /// Step of the position reading, rad (or m); 0 for a continuous one. A count of `n` bits is `2 pi / 2^n`.
    pub resolution: PerJoint,
    /// Standard deviation of the position before it is quantised, rad (or m).
    pub position_noise: PerJoint,
    /// Standard deviation of a measured velocity, rad/s (or m/s).
    pub velocity_noise: PerJoint,
    /// Standard deviation of the effort, N m (or N).
    pub effort_noise: PerJoint,
    /// Where the velocity comes from.
    pub velocity: VelocitySource,
    /// Time from sampling until the reading is available, ns.
    pub latency_ns: u64,
    /// Seed of the noise.
    pub seed: u64,
}

/// Why settings describe no sensor.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SettingsError {
    /// A list of another length than the robot has joints.
    #[error(
        "{name} lists {found} numbers, the robot has {expected} joints: list one for each, or give one for all"
    )]
    Count {
        /// The setting.
        name: &'static str,
        /// Length of the list.
        found: usize,
        /// Joints of the robot.
        expected: usize,
    },
    /// A number that cannot be.
    #[error("{name} = {value}: expected {expected}")]
    OutOfRange {
        /// The setting.
        name: &'static str,
        /// What was found.
        value: f64,
        /// What would do.
        expected: &'static str,
    },
    /// Noise on a velocity that is not measured.
    #[error(
        "velocity_noise is set, but the velocity is differentiated from the position and takes its noise from there: remove it, or choose velocity.kind = \"measured\""
    )]
    NeedlessVelocityNoise,
    /// A latency that would take too much memory.
    #[error(
        "a latency of {latency_ns} ns holds {frames} readings at the shortest period of {period_ns} ns, at most {limit} are possible: is it meant to be ms?"
    )]
    Latency {
        /// The latency, ns.
        latency_ns: u64,
        /// Readings under way.
        frames: u64,
        /// The shortest period, ns.
        period_ns: u64,
        /// Readings that may be under way.
        limit: u64,
    },
}

impl Default for PerJoint {
    /// 0 for all.
    fn default() -> Self {
        Self::Same(0.0)
    }
}

impl PerJoint {
    /// One number for each of `joints` joints, all finite and at least 0.
    pub(super) fn resolve(&self, name: &'static str, joints: usize) -> Result<Vec<f64>, SettingsError> {
        let values = match self {
            Self::Same(value) => vec![*value; joints],
            Self::Each(values) if values.len() == joints => values.clone(),
            Self::Each(values) => {
                return Err(SettingsError::Count { name, found: values.len(), expected: joints });
            }
        };
        // a robot without joints still gets its settings checked
        let single = match self {
            Self::Same(value) => Some(value),
            Self::Each(_) => None,
        };
        match values.iter().chain(single).find(|value| !(value.is_finite() && **value >= 0.0)) {
            Some(&value) => {
                Err(SettingsError::OutOfRange { name, value, expected: "a finite number of at least 0" })
            }
            None => Ok(values),
        }
    }

    /// Whether it is 0 for every joint.
    pub(super) fn is_zero(&self) -> bool {
        match self {
            Self::Same(value) => *value == 0.0,
            Self::Each(values) => values.iter().all(|value| *value == 0.0),
        }
    }
}
