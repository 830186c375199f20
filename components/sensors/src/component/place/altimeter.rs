//! `sensor.altimeter`: the height of a point of a robot.

use motorium::prelude::*;
use motorium::state::Altitude;

use super::super::doubts::Plausible;
use super::super::readings::refused;
use super::{Mount, PlaceMotion, PlaceSensor};
use crate::channel::{Channel, ErrorModel};
use crate::randomise::SensorDraw;

sensor_config! {
    /// Configuration of `sensor.altimeter`. The default is an ideal sensor.
    ///
    /// ```toml
    /// height  = { noise = 0.1, bias_walk = 0.01, resolution = 0.01 }
    /// latency = "20 ms"
    /// ```
    pub struct AltimeterConfig;

    /// Mount of the sensor on the robot. Default: the root link.
    mount: Mount = Mount::default();
    /// Height in the world at which the reading is 0 (m). Default 0.
    reference: f64 = 0.0;
    /// Errors of the height, m.
    height: ErrorModel = ErrorModel::default();
    /// Errors of the rate of the height, m/s.
    rate: ErrorModel = ErrorModel::default();
}

/// `sensor.altimeter`: measures the height of a point of a robot.
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

    fn mount(config: &AltimeterConfig) -> &Mount {
        &config.mount
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

    fn warn(config: &AltimeterConfig, declare: &mut Declare) {
        Plausible::length(10_000.0).warn("reference", &[config.reference], declare);
        Plausible::length(100.0).warn_of_errors("height", &config.height, declare);
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
