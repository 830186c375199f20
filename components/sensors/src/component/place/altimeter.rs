//! `sensor.altimeter`: the height of a point of a robot.

use motorium::prelude::*;
use motorium::state::Altitude;
use schemars::JsonSchema;
use serde::Deserialize;

use super::super::readings::refused;
use super::{Common, Mount, PlaceMotion, PlaceSensor, Timing};
use crate::channel::{Channel, ErrorModel};
use crate::randomise::{SensorDraw, SensorRanges};

/// Configuration of `sensor.altimeter`. The default is an ideal sensor.
///
/// ```toml
/// height  = { noise = 0.1, bias_walk = 0.01, resolution = 0.01 }
/// latency = "20 ms"
/// ```
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AltimeterConfig {
    /// Place of the sensor on the robot. Default: the root link.
    pub mount: Mount,
    /// Height in the world that reads 0 (m). Default 0.
    pub reference: f64,
    /// Errors of the height, m.
    pub height: ErrorModel,
    /// Errors of its rate, m/s.
    pub rate: ErrorModel,
    /// Time from sampling until the reading is available. Default 0.
    pub latency: TimeSpan,
    /// Share of the readings that are lost, 0 to 1. Default 0.
    pub drop_out: f64,
    /// Seed of the noise. Default: from the seed of the run and the name of the component.
    pub seed: Option<u64>,
    /// Ranges from which noise, bias and latency are sampled at the start of every episode. Default: no
    /// sampling.
    pub randomise: SensorRanges,
}

/// `sensor.altimeter`: the height of a point of a robot.
pub struct Altimeter {
    reference: f64,
    height: Channel,
    rate: Channel,
}

impl PlaceSensor for Altimeter {
    const KIND: &'static str = "sensor.altimeter";
    const SUMMARY: &'static str = "height and its rate: noise, bias random walk, latency";
    const PORT: (&'static str, &'static str) = ("altitude", "height above the reference, and its rate");
    const WIDTH: usize = 2;
    type Config = AltimeterConfig;
    type Message = Altitude;

    fn common(config: &AltimeterConfig) -> Common<'_> {
        let timing = Timing { latency: config.latency, drop_out: config.drop_out };
        Common { mount: &config.mount, timing, seed: config.seed, randomise: &config.randomise }
    }

    fn new(config: &AltimeterConfig, seed: u64, draw: &SensorDraw) -> Result<Self, ConfigError> {
        if !config.reference.is_finite() {
            return Err(ConfigError::key("reference", "expected a finite number"));
        }
        Ok(Self {
            reference: config.reference,
            height: Channel::new("height", &draw.errors(&config.height), 1, seed, 0).map_err(refused)?,
            rate: Channel::new("rate", &draw.errors(&config.rate), 1, seed, 1).map_err(refused)?,
        })
    }

    fn read(&mut self, at: &PlaceMotion, dt: f64, values: &mut [f64]) {
        values[0] = at.0.pose.translation.z - self.reference;
        values[1] = at.0.linear.z;
        let (height, rate) = values.split_at_mut(1);
        self.height.measure(dt, height);
        self.rate.measure(dt, rate);
    }

    fn write(&self, values: &[f64], message: &mut Altitude) {
        (message.height, message.rate) = (values[0], values[1]);
    }
}
