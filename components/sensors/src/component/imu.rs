//! `sensor.imu`: an inertial measurement unit as a component.

use std::time::Duration;

use motorium::prelude::*;
use motorium::state::Randomisation;
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

use super::draws::Draws;
use super::loads::Drawn;
use super::readings::{Readings, refused};
use super::robot::{Mount, Needs, TrueMotion};
use crate::channel::{Channel, ErrorModel, Timing};
use crate::imu::{ImuModel, SensorMotion};
use crate::randomise::{SensorDraw, SensorRanges};

/// Configuration of `sensor.imu`. The default is an ideal sensor at the root link.
///
/// ```toml
/// mount         = { frame = "base", position = [0.0, 0.0, 0.02] }
/// gyroscope     = { noise = 3e-3, bias = 2e-3, bias_walk = 1e-5, range = 35.0 }
/// accelerometer = { noise = 0.06, bias = 0.02, bias_walk = 1e-4, range = 157.0 }
/// latency       = "1 ms"
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ImuConfig {
    /// Place of the sensor on the robot. Default: the root link.
    pub mount: Mount,
    /// Errors of the angular velocity, rad/s.
    pub gyroscope: ErrorModel,
    /// Errors of the specific force, m/s^2.
    pub accelerometer: ErrorModel,
    /// Standard deviation of the orientation, about each axis, rad. Default 0.
    pub orientation_noise: f64,
    /// Time from sampling until the reading is available. Default 0.
    pub latency: TimeSpan,
    /// Share of the readings that are lost, 0 to 1. Default 0.
    pub drop_out: f64,
    /// Gravitational acceleration (m/s^2). Default: the value in the graph's `[world]`, else standard
    /// gravity.
    pub gravity: [f64; 3],
    /// Seed of the noise. Default: from the seed of the run and the name of the component.
    pub seed: Option<u64>,
    /// Ranges from which noise, bias and latency are sampled at the start of every episode. Default: no
    /// sampling.
    pub randomise: SensorRanges,
}

impl Default for ImuConfig {
    fn default() -> Self {
        Self {
            mount: Mount::default(),
            gyroscope: ErrorModel::default(),
            accelerometer: ErrorModel::default(),
            orientation_noise: 0.0,
            latency: TimeSpan { ns: 0 },
            drop_out: 0.0,
            gravity: [0.0, 0.0, -9.81],
            seed: None,
            randomise: SensorRanges::default(),
        }
    }
}

impl ImuConfig {
    fn timing(&self, latency: TimeSpan) -> Timing {
        Timing { latency, drop_out: self.drop_out }
    }

    fn models(&self, seed: u64, draw: &SensorDraw) -> Result<(ImuModel, Channel), ConfigError> {
        let seed = self.seed.unwrap_or(seed);
        if !self.gravity.iter().all(|number| number.is_finite()) {
            return Err(ConfigError::key("gravity", "expected finite numbers"));
        }
        let (gyroscope, accelerometer) = (draw.errors(&self.gyroscope), draw.errors(&self.accelerometer));
        let imu = ImuModel::new(&gyroscope, &accelerometer, Vector3::from(self.gravity), seed);
        let attitude = draw.errors(&ErrorModel { noise: self.orientation_noise, ..ErrorModel::default() });
        let attitude = Channel::new("", &attitude, 3, seed, 2)
            .map_err(|error| ConfigError::key("orientation_noise", error.to_string()))?;
        Ok((imu.map_err(refused)?, attitude))
    }
}

/// A component that publishes the readings of an inertial measurement unit on a robot.
///
/// It samples the true motion at its own rate or on its trigger. A reading is the mean since the last sample.
pub struct Imu {
    motion: TrueMotion,
    drawn: Drawn,
    sample: Output<ImuSample>,
    config: ImuConfig,
    model: ImuModel,
    attitude: Channel,
    readings: Readings,
    draws: Draws,
    period: Duration,
}

/// Numbers of a reading: specific force, angular velocity, orientation.
const WIDTH: usize = 10;

impl Component for Imu {
    const KIND: &'static str = "sensor.imu";
    const SUMMARY: &'static str = "inertial measurement unit: noise, bias random walk, range, latency";
    const READS_GRAVITY: bool = true;
    const RESETS: bool = true;
    type Config = ImuConfig;

    fn declare(config: &ImuConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        Draws::declare(&config.randomise, declare)?;
        config.models(0, &config.randomise.draw(0, config.latency))?;
        Readings::declare(&config.timing(config.randomise.longest(config.latency)), declare)?;
        TrueMotion::declare(&config.mount, Needs::Place, declare)?;
        Drawn::declare(declare);
        declare.output::<ImuSample>("imu", "specific force and angular velocity in the axes of the sensor");
        Ok(())
    }

    fn configure(config: ImuConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let seed = config.seed.unwrap_or(setup.seed());
        let draws = Draws::open(&config.randomise, config.latency, seed, setup)?;
        let (model, attitude) = config.models(seed, &draws.now())?;
        Ok(Self {
            motion: TrueMotion::open(&config.mount, Needs::Place, setup)?,
            drawn: Drawn::open(setup)?,
            sample: setup.output("imu")?,
            readings: Readings::new(&config.timing(draws.now().latency), WIDTH, setup.period(), seed)?,
            period: setup.period(),
            draws,
            model,
            attitude,
            config,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        self.draws.publish()?;
        if let Some(motion) = self.motion.newest()? {
            let rotation = motion.pose.rotation;
            if let Some(drawn) = self.drawn.newest(tick) {
                let factor = drawn.find(Randomisation::GRAVITY, 0).unwrap_or(1.0);
                self.model.set_gravity(Vector3::from(self.config.gravity) * factor);
            }
            let truth = SensorMotion { rotation, velocity: motion.linear };
            if let Some(reading) = self.model.sample(motion.times.state, &truth) {
                let mut tilt = [0.0; 3];
                self.attitude.measure(0.0, &mut tilt);
                let seen = motorium_robots::lie::so3::exp(&Vector3::from(tilt)) * rotation;
                let mut values = [0.0; WIDTH];
                values[..3].copy_from_slice(reading.specific_force.as_slice());
                values[3..6].copy_from_slice(reading.angular_velocity.as_slice());
                values[6..].copy_from_slice(seen.coords.as_slice());
                self.readings.push(tick.time_ns, motion.times.source, &values);
            }
        }
        let Some((source, values)) = self.readings.due(tick.time_ns) else { return Ok(()) };
        let mut sample = self.sample.loan()?;
        sample.specific_force.copy_from_slice(&values[..3]);
        sample.angular_velocity.copy_from_slice(&values[3..6]);
        sample.orientation.copy_from_slice(&values[6..]);
        sample.publish_from(source)
    }

    fn reset(&mut self, episode: &Episode) -> Result<(), StepError> {
        let seed = self.config.seed.unwrap_or(episode.seed);
        let failed = |error: ConfigError| StepError::failed(error.to_string());
        let draw = self.draws.reset(episode.index, seed);
        (self.model, self.attitude) = self.config.models(seed, &draw).map_err(failed)?;
        let timing = self.config.timing(draw.latency);
        self.readings = Readings::new(&timing, WIDTH, self.period, seed).map_err(failed)?;
        self.motion.reset();
        self.drawn.reset();
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let mut result = self.readings.result();
        let (gyroscope, accelerometer) = self.model.biases();
        result["gyroscope_bias"] = serde_json::json!(gyroscope.as_slice());
        result["accelerometer_bias"] = serde_json::json!(accelerometer.as_slice());
        self.draws.report(&mut result);
        Some(result)
    }
}
