//! The numbers that describe a robot's joint sensors.

use motorium::units::TimeSpan;
use motorium_robots::{PerJoint, PerJointError};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The source of a velocity reading.
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

/// The joint sensors of a robot: settings of [`EncoderModel`](super::EncoderModel) and configuration of
/// `sensor.joint_encoder`. The default is an ideal sensor. Units are those of the joint: rad or, where it slides, m.
///
/// ```toml
/// resolution     = 1e-5
/// position_noise = 2e-5
/// velocity       = { kind = "differentiated", cutoff_hz = 100.0 }
/// latency        = "500 us"
/// ```
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct EncoderSettings {
    /// Step of the position reading, rad (or m); 0 for a continuous one, the default. A count of `n` bits is `2 pi /
    /// 2^n`.
    pub resolution: PerJoint,
    /// Standard deviation of the position before it is quantised, rad (or m). Default 0.
    pub position_noise: PerJoint,
    /// Standard deviation of a measured velocity, rad/s (or m/s). Default 0.
    pub velocity_noise: PerJoint,
    /// Standard deviation of the effort, N m (or N). Default 0.
    pub effort_noise: PerJoint,
    /// Source of the velocity. Default measured.
    pub velocity: VelocitySource,
    /// Time from sampling until the reading is available, such as "500 us". Default none.
    pub latency: TimeSpan,
    /// Seed of the noise. Default: from the seed of the run and the name of the component.
    pub seed: Option<u64>,
}

impl Default for EncoderSettings {
    fn default() -> Self {
        Self {
            resolution: PerJoint::default(),
            position_noise: PerJoint::default(),
            velocity_noise: PerJoint::default(),
            effort_noise: PerJoint::default(),
            velocity: VelocitySource::default(),
            latency: TimeSpan { ns: 0 },
            seed: None,
        }
    }
}

/// Settings that describe no sensor.
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
    /// A number out of range.
    #[error("{name} = {value}: expected {expected}")]
    OutOfRange {
        /// The setting.
        name: &'static str,
        /// The number found.
        value: f64,
        /// The numbers expected.
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

impl SettingsError {
    /// The setting at fault.
    pub fn setting(&self) -> &'static str {
        match self {
            Self::Count { name, .. } | Self::OutOfRange { name, .. } => name,
            Self::NeedlessVelocityNoise => "velocity_noise",
            Self::Latency { .. } => "latency",
        }
    }
}

/// Largest noise or resolution, in the unit of the setting: no sensor of a robot reads that far off.
const LARGEST: f64 = 1e6;

/// One number for each of `joints` joints, all from 0 to [`LARGEST`].
pub(super) fn resolve(
    name: &'static str,
    numbers: &PerJoint,
    joints: usize,
) -> Result<Vec<f64>, SettingsError> {
    let resolved = numbers
        .resolve(joints)
        .map_err(|PerJointError { found, expected }| SettingsError::Count { name, found, expected })?;
    match numbers.values().iter().find(|value| !(0.0..=LARGEST).contains(*value)) {
        Some(&value) => Err(SettingsError::OutOfRange { name, value, expected: "a number from 0 to 1e6" }),
        None => Ok(resolved),
    }
}
