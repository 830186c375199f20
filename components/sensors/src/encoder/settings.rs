//! Settings of a robot's joint sensors.

use motorium::units::TimeSpan;
use motorium_robots::{PerJoint, PerJointError};
use schemars::JsonSchema;
use serde::Deserialize;

use crate::channel::ErrorModel;
use crate::randomise::SensorRanges;

/// Errors of one quantity for all joints, with the keys of an [`ErrorModel`]. Each value is a single number
/// for all joints or a list with one number per joint. Units depend on the joint: rad and N m for revolute
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
    /// Standard deviation of each reading, before it is quantised. Default 0.
    pub noise: PerJoint,
    /// Standard deviation of the bias at the start: of a position, the error of its zero. Default 0.
    pub bias: PerJoint,
    /// Standard deviation of the change of the bias in one second. Default 0.
    pub bias_walk: PerJoint,
    /// Standard deviation of the scale error, as a fraction of the reading. Default 0.
    pub scale_error: PerJoint,
    /// Step of the readings; 0 for continuous ones, the default. A count of `n` bits per turn is
    /// `2 pi / 2^n`.
    pub resolution: PerJoint,
    /// Largest magnitude of a reading. Default: unlimited.
    pub range: Option<PerJoint>,
}

/// Velocity as the difference of successive position readings over time, filtered by a first-order low-pass,
/// as in most drives. It contains the noise and resolution of the position and is 0 at the first sample.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Differentiation {
    /// Cut-off frequency of the low-pass, Hz.
    pub cutoff_hz: f64,
}

/// The joint sensors of a robot: settings of [`EncoderModel`](super::EncoderModel) and configuration of
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
    /// Errors of a measured velocity, rad/s (or m/s). Not allowed with `differentiate`, where the velocity
    /// contains the position errors.
    pub velocity: JointErrors,
    /// Errors of the effort, N m (or N).
    pub effort: JointErrors,
    /// Differentiates the position readings. Default: the velocity is measured by a separate sensor.
    pub differentiate: Option<Differentiation>,
    /// Time from sampling until the reading is available, such as "500 us". Default 0.
    pub latency: TimeSpan,
    /// Fraction of the readings that are lost, 0 to 1. Default 0.
    pub drop_out: f64,
    /// Seed of the noise. Default: from the seed of the run and the name of the component.
    pub seed: Option<u64>,
    /// Ranges from which noise, bias and latency are sampled at the start of every episode. Default: no
    /// sampling.
    pub randomise: SensorRanges,
}

/// An error of the joint sensor settings.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SettingsError {
    /// A list's length differs from the number of joints.
    #[error(
        "{name} lists {found} numbers, the robot has {expected} joints: list one per joint, or give a single number"
    )]
    Count {
        /// The setting.
        name: String,
        /// Length of the list.
        found: usize,
        /// Number of joints of the robot.
        expected: usize,
    },
    /// A number is out of range.
    #[error("{name} = {value}: expected {expected}")]
    OutOfRange {
        /// The setting.
        name: String,
        /// The value found.
        value: f64,
        /// The valid values.
        expected: &'static str,
    },
    /// Velocity errors were given for a differentiated velocity.
    #[error(
        "velocity has its own errors, but it is differentiated from the position and inherits its errors: remove `velocity`, or `differentiate`"
    )]
    NeedlessVelocityErrors,
    /// The latency would require too much memory.
    #[error(
        "a latency of {latency_ns} ns spans {frames} readings at the shortest period of {period_ns} ns, expected at most {limit}: is it meant to be ms?"
    )]
    Latency {
        /// The latency, ns.
        latency_ns: u64,
        /// Readings in flight.
        frames: u64,
        /// The shortest period, ns.
        period_ns: u64,
        /// Maximum number of readings in flight.
        limit: u64,
    },
}

impl SettingsError {
    /// Name of the invalid setting.
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
