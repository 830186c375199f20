//! Settings of a robot's joint sensors.

use motorium::units::TimeSpan;
use motorium_robots::{PerJoint, PerJointError};
use schemars::JsonSchema;
use serde::Deserialize;

use crate::channel::ErrorModel;
use crate::randomise::SensorRanges;

/// Errors of one quantity for all joints, with the keys of an [`ErrorModel`]. Each value is either one number
/// for all joints or a list of one number per joint. Units depend on the joint: rad and N m for revolute
/// joints, m and N for prismatic joints.
///
/// ```toml
/// noise      = 2e-5
/// bias       = [1e-3, 1e-3, 0.0]
/// resolution = 1e-5
/// range      = 3.1
/// ```
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct JointErrors {
    /// Standard deviation of the noise of each reading, before rounding to the resolution. Default 0.
    pub noise: PerJoint,
    /// Standard deviation of the initial bias. The bias of a joint position is the offset of the joint's
    /// zero. Default 0.
    pub bias: PerJoint,
    /// Standard deviation of the change of the bias in one second. Default 0.
    pub bias_walk: PerJoint,
    /// Standard deviation of the scale error, as a fraction of the reading. Default 0.
    pub scale_error: PerJoint,
    /// Increment to which readings are rounded. Default 0: no rounding. An encoder with `n` bits per
    /// revolution has the resolution `2 pi / 2^n`.
    pub resolution: PerJoint,
    /// Maximum magnitude of a reading. A larger value saturates at this magnitude. Default: unlimited.
    pub range: Option<PerJoint>,
}

/// Computes velocity from the difference of successive position readings, filtered by a first-order low-pass,
/// as in most drives. The velocity inherits the noise and resolution of the position and is 0 at the first
/// sample.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Differentiation {
    /// Cut-off frequency of the low-pass, Hz.
    pub cutoff_hz: f64,
}

/// Settings of a robot's joint sensors, for [`EncoderModel`](super::EncoderModel) and as the configuration of
/// `sensor.joint_encoder`. The default is an ideal sensor.
///
/// ```toml
/// position      = { resolution = 1e-5, noise = 2e-5, bias = 1e-3 }
/// effort        = { noise = 0.1, range = 87.0 }
/// differentiate = { cutoff_hz = 100.0 }
/// latency       = "500 us"
/// drop_out      = 0.001
/// ```
#[derive(Clone, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct EncoderSettings {
    /// Errors of the position, rad (or m).
    pub position: JointErrors,
    /// Errors of a measured velocity, rad/s (or m/s). Not allowed with `differentiate`, because a
    /// differentiated velocity inherits the position errors.
    pub velocity: JointErrors,
    /// Errors of the effort, N m (or N).
    pub effort: JointErrors,
    /// Computes velocities from position readings. Default: a separate sensor measures the velocity.
    pub differentiate: Option<Differentiation>,
    /// Delay from sampling until the reading is available, such as "500 us". Default 0.
    pub latency: TimeSpan,
    /// Fraction of the readings that are dropped, 0 to 1. Default 0.
    pub drop_out: f64,
    /// Seed of the noise. Default: from the seed of the run and the name of the component.
    pub seed: Option<u64>,
    /// Ranges from which noise, bias and latency are sampled at the start of every episode. Default: no
    /// sampling.
    pub randomise: SensorRanges,
}

/// The joint sensor settings are not valid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SettingsError {
    /// A list's length differs from the number of joints.
    #[error(
        "{name} lists {found} numbers, but the robot has {expected} joints; list one number per joint, or set a single number"
    )]
    Count {
        /// Name of the setting.
        name: String,
        /// Length of the list.
        found: usize,
        /// Number of joints of the robot.
        expected: usize,
    },
    /// A number is out of range.
    #[error("{name} = {value}: expected {expected}")]
    OutOfRange {
        /// Name of the setting.
        name: String,
        /// The value found.
        value: f64,
        /// Valid values, as a phrase.
        expected: &'static str,
    },
    /// Velocity errors are set for a differentiated velocity.
    #[error(
        "`velocity` errors are set, but the velocity is differentiated from the position and inherits its errors; remove `velocity` or `differentiate`"
    )]
    NeedlessVelocityErrors,
    /// The latency would require too much memory.
    #[error(
        "a latency of {latency_ns} ns spans {frames} readings at the shortest period of {period_ns} ns, expected at most {limit}; is it meant to be ms?"
    )]
    Latency {
        /// The latency, ns.
        latency_ns: u64,
        /// Number of readings in flight.
        frames: u64,
        /// Minimum period between samples, ns.
        period_ns: u64,
        /// Maximum number of readings in flight.
        limit: u64,
    },
}

impl SettingsError {
    /// Returns the name of the invalid setting.
    pub fn setting(&self) -> &str {
        match self {
            Self::Count { name, .. } | Self::OutOfRange { name, .. } => name,
            Self::NeedlessVelocityErrors => "velocity",
            Self::Latency { .. } => "latency",
        }
    }

    pub(super) fn out_of_range(name: impl Into<String>, value: f64, expected: &'static str) -> Self {
        Self::OutOfRange { name: name.into(), value, expected }
    }
}

/// Largest plausible magnitude of an error.
const LARGEST: f64 = 1e6;

impl JointErrors {
    /// Returns the errors of each of `joints` joints for the quantity `name`.
    ///
    /// # Errors
    /// A list has another length, or a number is not from 0 to 1e6.
    pub(super) fn resolve(&self, name: &str, joints: usize) -> Result<Vec<ErrorModel>, SettingsError> {
        let each = |key: &str, numbers: &PerJoint| {
            let name = format!("{name}.{key}");
            if let Some(&value) = numbers.values().iter().find(|value| !(0.0..=LARGEST).contains(*value)) {
                return Err(SettingsError::OutOfRange { name, value, expected: "a number from 0 to 1e6" });
            }
            numbers.resolve(joints).map_err(|PerJointError { found, expected }| SettingsError::Count {
                name,
                found,
                expected,
            })
        };
        let [noise, bias, bias_walk, scale_error, resolution] = [
            each("noise", &self.noise)?,
            each("bias", &self.bias)?,
            each("bias_walk", &self.bias_walk)?,
            each("scale_error", &self.scale_error)?,
            each("resolution", &self.resolution)?,
        ];
        let range = self.range.as_ref().map(|range| each("range", range)).transpose()?;
        let errors = |joint: usize| ErrorModel {
            noise: noise[joint],
            bias: bias[joint],
            bias_walk: bias_walk[joint],
            scale_error: scale_error[joint],
            resolution: resolution[joint],
            range: range.as_ref().map(|range| range[joint]),
        };
        Ok((0..joints).map(errors).collect())
    }
}
