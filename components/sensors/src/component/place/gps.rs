//! `sensor.gps`: a receiver of satellite navigation.

use motorium::prelude::*;
use motorium::state::GeoFix;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

use super::super::doubts::Plausible;
use super::super::readings::refused;
use super::super::robot::warn_of_angles;
use super::{Mount, PlaceMotion, PlaceSensor};
use crate::channel::{Channel, ErrorModel};
use crate::geodesy::{Geodetic, TangentPlane};
use crate::randomise::{SensorDraw, SensorRanges};

/// Configuration of `sensor.gps`. The world's z axis points up, and the world's x axis points east unless
/// `heading` is set.
///
/// ```toml
/// origin     = { latitude = 46.52, longitude = 6.57, altitude = 400.0 }
/// horizontal = { noise = 0.5, bias = 1.0 }
/// vertical   = { noise = 1.0, bias = 2.0 }
/// latency    = "100 ms"
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GpsConfig {
    /// Geodetic position of the world's origin.
    pub origin: Origin,
    /// Angle from east to the world's x axis, counter-clockwise seen from above (rad). Default 0.
    #[serde(default)]
    pub heading: f64,
    /// Mount of the antenna on the robot. Default: the root link.
    #[serde(default)]
    pub mount: Mount,
    /// Errors of the position to the east and to the north, m.
    #[serde(default)]
    pub horizontal: ErrorModel,
    /// Errors of the height, m.
    #[serde(default)]
    pub vertical: ErrorModel,
    /// Errors of the velocity, m/s.
    #[serde(default)]
    pub velocity: ErrorModel,
    /// Delay from sampling until the fix is available. Default 0.
    #[serde(default)]
    pub latency: TimeSpan,
    /// Fraction of the fixes that are dropped, 0 to 1. Default 0.
    #[serde(default)]
    pub drop_out: f64,
    /// Seed of the noise. Default: from the seed of the run and the name of the component.
    #[serde(default)]
    pub seed: Option<u64>,
    /// Ranges from which noise, bias and latency are sampled at the start of every episode. Default: no
    /// sampling.
    #[serde(default)]
    pub randomise: SensorRanges,
}

sensor_config!(impl GpsConfig);

/// A geodetic position on WGS 84.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// Latitude (degrees, north positive).
    pub latitude: f64,
    /// Longitude (degrees, east positive).
    pub longitude: f64,
    /// Height above the WGS 84 ellipsoid (m). Default 0.
    #[serde(default)]
    pub altitude: f64,
}

/// `sensor.gps`: a satellite navigation receiver.
pub struct Gps {
    plane: TangentPlane,
    heading: nalgebra::UnitQuaternion<f64>,
    horizontal: Channel,
    vertical: Channel,
    velocity: Channel,
    deviations: [f64; 6],
}

impl PlaceSensor for Gps {
    const KIND: &'static str = "sensor.gps";
    const SUMMARY: &'static str =
        "satellite navigation: latitude, longitude, altitude, velocity, with errors";
    const PORT: (&'static str, &'static str) = ("fix", "position on the earth and velocity");
    const WIDTH: usize = 6;
    type Config = GpsConfig;
    type Message = GeoFix;

    fn mount(config: &GpsConfig) -> &Mount {
        &config.mount
    }

    fn new(config: &GpsConfig, seed: u64, draw: &SensorDraw) -> Result<Self, ConfigError> {
        let Origin { latitude, longitude, altitude } = config.origin;
        if !(-90.0..=90.0).contains(&latitude) {
            return Err(ConfigError::key(
                "origin.latitude",
                format!("{latitude}: expected -90 to 90 degrees"),
            ));
        }
        if !(-360.0..=360.0).contains(&longitude) || !altitude.is_finite() || !config.heading.is_finite() {
            return Err(ConfigError::key(
                "origin",
                "expected a longitude from -360 to 360 degrees and finite numbers",
            ));
        }
        let errors = |errors: &ErrorModel| draw.errors(errors);
        let [horizontal, vertical, velocity] =
            [errors(&config.horizontal), errors(&config.vertical), errors(&config.velocity)];
        let [across, up, speed] =
            [horizontal, vertical, velocity].map(|errors| errors.noise.hypot(errors.bias));
        Ok(Self {
            plane: TangentPlane::tangent_at(&Geodetic { latitude, longitude, altitude }),
            heading: nalgebra::UnitQuaternion::from_axis_angle(&Vector3::z_axis(), config.heading),
            horizontal: Channel::new("horizontal", &horizontal, 2, seed, 0).map_err(refused)?,
            vertical: Channel::new("vertical", &vertical, 1, seed, 1).map_err(refused)?,
            velocity: Channel::new("velocity", &velocity, 3, seed, 2).map_err(refused)?,
            deviations: [across, across, up, speed, speed, speed],
        })
    }

    fn warn(config: &GpsConfig, declare: &mut Declare) {
        Plausible::length(100_000.0).warn("origin.altitude", &[config.origin.altitude], declare);
        warn_of_angles("heading", &[config.heading], declare);
        Plausible::length(100.0).warn_of_errors("horizontal", &config.horizontal, declare);
        Plausible::length(100.0).warn_of_errors("vertical", &config.vertical, declare);
    }

    fn read(&mut self, at: &PlaceMotion, dt: f64, values: &mut [f64]) {
        let place = self.heading * at.0.pose.translation.vector;
        values[..3].copy_from_slice(place.as_slice());
        values[3..].copy_from_slice((self.heading * at.0.linear).as_slice());
        self.horizontal.measure(dt, &mut values[..2]);
        self.vertical.measure(dt, &mut values[2..3]);
        self.velocity.measure(dt, &mut values[3..]);
    }

    fn write(&self, values: &[f64], message: &mut GeoFix) {
        let place = self.plane.geodetic(&Vector3::new(values[0], values[1], values[2]));
        (message.latitude, message.longitude, message.altitude) =
            (place.latitude, place.longitude, place.altitude);
        message.velocity.copy_from_slice(&values[3..]);
        message.position_deviation.copy_from_slice(&self.deviations[..3]);
        message.velocity_deviation.copy_from_slice(&self.deviations[3..]);
    }
}
