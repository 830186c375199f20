//! Components that sense the position and motion of a point on a robot: altimeter, satellite navigation,
//! magnetometer.

mod altimeter;
mod gps;
mod magnetometer;

use motorium::prelude::*;
use schemars::JsonSchema;

use super::config::SensorConfig;
use super::delivery::Delivery;
use super::robot::{Motion, Mount, Needs, TrueMotion};
use crate::randomise::SensorDraw;

pub use altimeter::{Altimeter, AltimeterConfig};
pub use gps::{Gps, GpsConfig, Origin};
pub use magnetometer::{Magnetometer, MagnetometerConfig};

/// A sensor whose readings depend on the motion of one point of a robot.
pub trait PlaceSensor: Sized + 'static {
    /// Name of the kind.
    const KIND: &'static str;
    /// One-line summary of the kind.
    const SUMMARY: &'static str;
    /// Name and description of the output port.
    const PORT: (&'static str, &'static str);
    /// Number of values in a reading.
    const WIDTH: usize;
    /// Configuration of the sensor.
    type Config: SensorConfig + serde::de::DeserializeOwned + JsonSchema;
    /// Type of the published message.
    type Message: StateBuffer;

    /// Returns the mount of the sensor.
    fn mount(config: &Self::Config) -> &Mount;
    /// Creates the sensor with the errors `draw` of an episode. The seed determines the noise.
    ///
    /// # Errors
    /// A number is out of range.
    fn new(config: &Self::Config, seed: u64, draw: &SensorDraw) -> Result<Self, ConfigError>;
    /// Warns of values that are probably in another unit. Default: no warnings.
    fn warn(_: &Self::Config, _: &mut Declare) {}
    /// Computes a reading.
    fn read(&mut self, at: &PlaceMotion, dt: f64, values: &mut [f64]);
    /// Writes a reading into a message.
    fn write(&self, values: &[f64], message: &mut Self::Message);
}

/// Motion of the mount point of a sensor.
#[derive(Clone, Copy, Debug)]
pub struct PlaceMotion(Motion);

/// The component of a [`PlaceSensor`]. The component samples the true motion at its own rate or on its
/// trigger.
pub struct AtPlace<S: PlaceSensor> {
    motion: TrueMotion,
    output: Output<S::Message>,
    config: S::Config,
    sensor: S,
    delivery: Delivery,
    values: Vec<f64>,
    since: Option<u64>,
}

impl<S: PlaceSensor> Component for AtPlace<S> {
    const KIND: &'static str = S::KIND;
    const SUMMARY: &'static str = S::SUMMARY;
    const RESETS: bool = true;
    type Config = S::Config;

    fn declare(config: &S::Config, declare: &mut Declare) -> Result<(), ConfigError> {
        let common = config.common();
        S::new(config, 0, &common.declare_draws(declare)?)?;
        common.declare_readings(S::WIDTH, declare)?;
        TrueMotion::declare(S::mount(config), Needs::Place, declare)?;
        S::warn(config, declare);
        declare.output::<S::Message>(S::PORT.0, S::PORT.1);
        Ok(())
    }

    fn configure(config: S::Config, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let opened = config.common().open(setup)?;
        let (seed, draw) = opened.start();
        Ok(Self {
            motion: TrueMotion::open(S::mount(&config), Needs::Place, setup)?,
            output: setup.output(S::PORT.0)?,
            delivery: opened.deliver(S::WIDTH)?,
            sensor: S::new(&config, seed, &draw)?,
            values: vec![0.0; S::WIDTH],
            since: None,
            config,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        self.delivery.publish_draws()?;
        if let Some(motion) = self.motion.newest()? {
            let time = motion.times.state;
            let dt = self.since.replace(time).map_or(0.0, |since| time.saturating_sub(since) as f64 * 1e-9);
            self.sensor.read(&PlaceMotion(motion), dt, &mut self.values);
            self.delivery.push(tick.time_ns, motion.times.source, &self.values);
        }
        let Some((source, values)) = self.delivery.due(tick.time_ns) else { return Ok(()) };
        let mut message = self.output.loan()?;
        self.sensor.write(values, &mut message);
        message.publish_from(source)
    }

    fn reset(&mut self, episode: &Episode) -> Result<(), StepError> {
        let (seed, draw) = self.delivery.reset(episode)?;
        self.sensor =
            S::new(&self.config, seed, &draw).map_err(|error| StepError::failed(error.to_string()))?;
        self.motion.reset();
        self.since = None;
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(self.delivery.result())
    }
}
