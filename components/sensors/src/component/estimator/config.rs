//! The `config` table of `estimator.base`.

use motorium::prelude::*;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::component::doubts::check_gravity;
use crate::component::robot::Mount;
use crate::estimation::{FilterNoise, StartDeviations};

/// Configuration of `estimator.base`.
///
/// ```toml
/// mount         = { frame = "base", position = [0.0, 0.0, 0.02] }
/// encoder_noise = 2e-4
/// noise         = { gyroscope = 1e-4, accelerometer = 2e-3, slip = 0.03 }
/// align         = "100 ms"
/// contact_delay = "10 ms"
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct BaseEstimatorConfig {
    /// Mount of the inertial measurement unit on the robot's root link. Default: the origin of the link.
    pub mount: Mount,
    /// Standard deviation of joint position readings (rad or m). Default 1e-3.
    #[schemars(range(min = 0.0))]
    pub encoder_noise: f64,
    /// Noise of the inertial measurement unit and of the contacts.
    pub noise: FilterNoise,
    /// Standard deviations of the initial state.
    pub start_deviations: StartDeviations,
    /// Initial pose of the base. Default: the profile's base pose in the home pose.
    pub start: Option<StartPose>,
    /// Duration of the initial alignment, during which the robot must stand still. Tilt and gyroscope bias
    /// are initialised with the mean of the readings during this time. Default 100 ms.
    pub align: TimeSpan,
    /// Minimum duration of a contact before the foot is used, because a foot may slip at touchdown. Default
    /// 10 ms.
    pub contact_delay: TimeSpan,
    /// Model of feet that have a radius: `true` for spheres that roll on level ground, `false` for points.
    /// Default true.
    pub rolling: bool,
    /// Gravitational acceleration (m/s^2). Default: the value in the graph's `[world]`, otherwise standard
    /// gravity.
    pub gravity: [f64; 3],
}

/// Initial pose of the base. Roll and pitch are measured during the initial alignment.
///
/// ```toml
/// position = [0.0, 0.0, 0.24]
/// yaw      = 0.0
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StartPose {
    /// Position of the base frame in the world (m).
    pub position: [f64; 3],
    /// Angle about the vertical axis (rad). Default 0.
    #[serde(default)]
    pub yaw: f64,
}

impl Default for BaseEstimatorConfig {
    fn default() -> Self {
        Self {
            mount: Mount::default(),
            encoder_noise: 1e-3,
            noise: FilterNoise::default(),
            start_deviations: StartDeviations::default(),
            start: None,
            align: TimeSpan { ns: 100_000_000 },
            contact_delay: TimeSpan { ns: 10_000_000 },
            rolling: true,
            gravity: [0.0, 0.0, -9.81],
        }
    }
}

impl BaseEstimatorConfig {
    /// Checks the numbers.
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        let FilterNoise {
            gyroscope,
            accelerometer,
            gyroscope_bias_walk,
            accelerometer_bias_walk,
            slip,
            foot,
        } = self.noise;
        let start = &self.start_deviations;
        let numbers = [
            ("encoder_noise", self.encoder_noise),
            ("noise.gyroscope", gyroscope),
            ("noise.accelerometer", accelerometer),
            ("noise.gyroscope_bias_walk", gyroscope_bias_walk),
            ("noise.accelerometer_bias_walk", accelerometer_bias_walk),
            ("noise.slip", slip),
            ("noise.foot", foot),
            ("start_deviations.tilt", start.tilt),
            ("start_deviations.yaw", start.yaw),
            ("start_deviations.velocity", start.velocity),
            ("start_deviations.position", start.position),
            ("start_deviations.gyroscope_bias", start.gyroscope_bias),
            ("start_deviations.accelerometer_bias", start.accelerometer_bias),
        ];
        if let Some((key, value)) = numbers.iter().find(|(_, value)| !(0.0..=1e6).contains(value)) {
            return Err(ConfigError::key(*key, format!("{value}, expected a number from 0 to 1e6")));
        }
        if self.encoder_noise == 0.0 && foot == 0.0 {
            return Err(ConfigError::key(
                "noise.foot",
                "`noise.foot` and `encoder_noise` are both 0, but measurements of feet need noise",
            )
            .advise("set `noise.foot` or `encoder_noise` to a standard deviation above 0"));
        }
        check_gravity(self.gravity)?;
        if self.gravity == [0.0; 3] {
            return Err(ConfigError::key("gravity", "expected numbers that are not all zero"));
        }
        let start = self.start.iter().flat_map(|start| start.position.iter().chain([&start.yaw]));
        if !start.into_iter().all(|number| number.is_finite()) {
            return Err(ConfigError::key("start", "expected finite numbers"));
        }
        if self.align.ns == 0 {
            return Err(ConfigError::key(
                "align",
                "the duration is 0, but the initial tilt is measured during it; expected a time above 0",
            ));
        }
        Ok(())
    }
}
