//! The `config` table of `policy.network`.

use motorium::units::TimeSpan;
use schemars::JsonSchema;
use serde::Deserialize;

/// Configuration of `policy.network`.
///
/// ```toml
/// policy  = "policies/quadruped-trot"
/// command = [0.5, 0.0, 0.0]
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NetworkPolicyConfig {
    /// Path of the policy's folder, which contains `policy.toml` and the network, relative to the graph file.
    #[schemars(extend("format" = "path"))]
    pub policy: String,
    /// Source of the linear velocity of the base. Default "base_state".
    #[serde(default)]
    pub base_velocity: BaseVelocitySource,
    /// Source of the angular velocity of the base and of the direction of gravity. Default "imu".
    #[serde(default)]
    pub attitude: AttitudeSource,
    /// Orientation of the inertial measurement unit in the frame of the base, as roll, pitch and yaw, rad.
    /// Default 0.
    #[serde(default)]
    pub imu_rpy: [f64; 3],
    /// Command if the input `command` is not wired: velocity forwards and to the left, m/s, and yaw rate,
    /// rad/s. Default 0.
    #[serde(default)]
    pub command: [f64; 3],
    /// Maximum age of a measurement, at least 1 ms. With an older measurement no action is published. Default
    /// "100 ms".
    #[serde(default = "hundred_ms")]
    pub state_timeout: TimeSpan,
    /// Age beyond which the input `command` counts as zero, at least 1 ms. Default "500 ms".
    #[serde(default = "half_second")]
    pub command_timeout: TimeSpan,
}

/// Source of the linear velocity of the base.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BaseVelocitySource {
    /// The input `base_state`.
    #[default]
    BaseState,
    /// The input `base_estimate`.
    BaseEstimate,
}

/// Source of the angular velocity of the base and of the direction of gravity.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum AttitudeSource {
    /// The input `imu`.
    #[default]
    Imu,
    /// The input `base_state`.
    BaseState,
    /// The input `base_estimate`.
    BaseEstimate,
}

fn hundred_ms() -> TimeSpan {
    TimeSpan { ns: 100_000_000 }
}

fn half_second() -> TimeSpan {
    TimeSpan { ns: 500_000_000 }
}
