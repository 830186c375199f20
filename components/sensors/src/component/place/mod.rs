//! Sensors of the place and the motion of a point on a robot, as components: altimeter, satellite navigation,
//! magnetometer.

mod altimeter;
mod gps;
mod magnetometer;

use std::time::Duration;

use motorium::prelude::*;
use schemars::JsonSchema;

use super::draws::Draws;
use super::readings::Readings;
use super::robot::{Motion, Mount, Needs, TrueMotion};
use crate::channel::Timing;
use crate::randomise::{SensorDraw, SensorRanges};

pub use altimeter::{Altimeter, AltimeterConfig};
pub use gps::{Gps, GpsConfig, Origin};
pub use magnetometer::{Magnetometer, MagnetometerConfig};

/// Configuration shared by all sensors of a position.
#[derive(Clone, Copy, Debug)]
pub struct Common<'a> {
    mount: &'a Mount,
    timing: Timing,
    seed: Option<u64>,
    randomise: &'a SensorRanges,
}

/// A sensor of the motion of a point.
pub trait PlaceSensor: Sized + 'static {
    /// Name of the kind.
    const KIND: &'static str;
    /// One line on it.
    const SUMMARY: &'static str;
    /// Its output.
    const PORT: (&'static str, &'static str);
    /// Numbers of a reading.
    const WIDTH: usize;
    /// Its configuration.
    type Config: serde::de::DeserializeOwned + JsonSchema;
    /// The message it publishes.
    type Message: StateBuffer;

    /// Returns the shared configuration.
    fn common(config: &Self::Config) -> Common<'_>;
    /// The sensor of a seed, with the errors of an episode.
    ///
    /// # Errors
    /// A number out of range.
    fn new(config: &Self::Config, seed: u64, draw: &SensorDraw) -> Result<Self, ConfigError>;
    /// Fills in a reading.
    fn read(&mut self, at: &PlaceMotion, dt: f64, values: &mut [f64]);
    /// Writes a reading into a message.
    fn write(&self, values: &[f64], message: &mut Self::Message);
}

/// The motion of a point of a robot.
#[derive(Clone, Copy, Debug)]
pub struct PlaceMotion(Motion);

/// A component of a [`PlaceSensor`]: it samples the true motion at its own rate or on its trigger.
pub struct AtPlace<S: PlaceSensor> {
    motion: TrueMotion,
    output: Output<S::Message>,
    config: S::Config,
    sensor: S,
    readings: Readings,
    draws: Draws,
    period: Duration,
    values: Vec<f64>,
    since: Option<u64>,
}

impl<S: PlaceSensor> Component for AtPlace<S> {
    const KIND: &'static str = S::KIND;
    const SUMMARY: &'static str = S::SUMMARY;
    const RESETS: bool = true;
    type Config = S::Config;

    fn declare(config: &S::Config, declare: &mut Declare) -> Result<(), ConfigError> {
        let Common { mount, timing, randomise, .. } = S::common(config);
        Draws::declare(randomise, declare)?;
        S::new(config, 0, &randomise.draw(0, timing.latency))?;
        Readings::declare(&timing.late(randomise.longest(timing.latency)), declare)?;
        TrueMotion::declare(mount, Needs::Place, declare)?;
        declare.output::<S::Message>(S::PORT.0, S::PORT.1);
        Ok(())
    }

    fn configure(config: S::Config, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let Common { mount, timing, seed, randomise } = S::common(&config);
        let seed = seed.unwrap_or(setup.seed());
        let draws = Draws::open(randomise, timing.latency, seed, setup)?;
        let timing = timing.late(draws.now().latency);
        Ok(Self {
            motion: TrueMotion::open(mount, Needs::Place, setup)?,
            output: setup.output(S::PORT.0)?,
            readings: Readings::new(&timing, S::WIDTH, setup.period(), seed)?,
            sensor: S::new(&config, seed, &draws.now())?,
            draws,
            period: setup.period(),
            values: vec![0.0; S::WIDTH],
            since: None,
            config,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        self.draws.publish()?;
        if let Some(motion) = self.motion.newest()? {
            let time = motion.times.state;
            let dt = self.since.replace(time).map_or(0.0, |since| time.saturating_sub(since) as f64 * 1e-9);
            self.sensor.read(&PlaceMotion(motion), dt, &mut self.values);
            self.readings.push(tick.time_ns, motion.times.source, &self.values);
        }
        let Some((source, values)) = self.readings.due(tick.time_ns) else { return Ok(()) };
        let mut message = self.output.loan()?;
        self.sensor.write(values, &mut message);
        message.publish_from(source)
    }

    fn reset(&mut self, episode: &Episode) -> Result<(), StepError> {
        let Common { timing, seed, .. } = S::common(&self.config);
        let seed = seed.unwrap_or(episode.seed);
        let draw = self.draws.reset(episode.index, seed);
        let failed = |error: ConfigError| StepError::failed(error.to_string());
        self.sensor = S::new(&self.config, seed, &draw).map_err(failed)?;
        let timing = timing.late(draw.latency);
        self.readings = Readings::new(&timing, S::WIDTH, self.period, seed).map_err(failed)?;
        self.motion.reset();
        self.since = None;
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let mut result = self.readings.result();
        self.draws.report(&mut result);
        Some(result)
    }
}
