//! Uncertainty of the inputs of the filter.

use schemars::JsonSchema;
use serde::Deserialize;

/// Noise of the inertial measurement unit and of the contacts as densities: standard deviations per square
/// root of hertz. Readings with the standard deviation `s` at a rate `f` have the density `s / sqrt(f)`,
/// which is also the standard deviation of their integral after one second.
///
/// ```toml
/// gyroscope     = 1e-4
/// accelerometer = 2e-3
/// slip          = 0.02
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FilterNoise {
    /// Noise density of the angular velocity (rad/s/sqrt(Hz)). Default 1e-4. If too small, the tilt follows
    /// gyroscope errors.
    #[schemars(range(min = 0.0))]
    pub gyroscope: f64,
    /// Noise density of the specific force (m/s2/sqrt(Hz)). Default 2e-3. If too small, the velocity follows
    /// the accelerometer and ignores the feet.
    #[schemars(range(min = 0.0))]
    pub accelerometer: f64,
    /// Noise density of the gyroscope's bias walk (rad/s2/sqrt(Hz)). Default 1e-5.
    #[schemars(range(min = 0.0))]
    pub gyroscope_bias_walk: f64,
    /// Noise density of the accelerometer's bias walk (m/s3/sqrt(Hz)). Default 1e-4.
    #[schemars(range(min = 0.0))]
    pub accelerometer_bias_walk: f64,
    /// Noise density of the velocity of a foot on the ground (m/s/sqrt(Hz)). Default 0.02. If too small, one
    /// slip shifts the estimate permanently.
    #[schemars(range(min = 0.0))]
    pub slip: f64,
    /// Standard deviation of a foot's position (m) in addition to the encoder noise, from flexible legs and
    /// soles. Default 1e-3.
    #[schemars(range(min = 0.0))]
    pub foot: f64,
}

impl Default for FilterNoise {
    fn default() -> Self {
        Self {
            gyroscope: 1e-4,
            accelerometer: 2e-3,
            gyroscope_bias_walk: 1e-5,
            accelerometer_bias_walk: 1e-4,
            slip: 0.02,
            foot: 1e-3,
        }
    }
}

/// Standard deviations of the initial state.
///
/// ```toml
/// tilt = 0.02
/// yaw  = 1e-3
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StartDeviations {
    /// Standard deviation of roll and pitch (rad). Default 0.02.
    #[schemars(range(min = 0.0))]
    pub tilt: f64,
    /// Standard deviation of yaw (rad). Default 1e-3.
    #[schemars(range(min = 0.0))]
    pub yaw: f64,
    /// Standard deviation of the velocity (m/s). Default 0.05.
    #[schemars(range(min = 0.0))]
    pub velocity: f64,
    /// Standard deviation of the position (m). Default 1e-3.
    #[schemars(range(min = 0.0))]
    pub position: f64,
    /// Standard deviation of the gyroscope bias (rad/s). Default 5e-3.
    #[schemars(range(min = 0.0))]
    pub gyroscope_bias: f64,
    /// Standard deviation of the accelerometer bias (m/s2). Default 0.05.
    #[schemars(range(min = 0.0))]
    pub accelerometer_bias: f64,
}

impl Default for StartDeviations {
    fn default() -> Self {
        Self {
            tilt: 0.02,
            yaw: 1e-3,
            velocity: 0.05,
            position: 1e-3,
            gyroscope_bias: 5e-3,
            accelerometer_bias: 0.05,
        }
    }
}
