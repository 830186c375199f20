//! Components of ray-casting sensors: `sensor.ray`, `sensor.lidar`, `sensor.height_scan`,
//! `sensor.depth_camera`, `sensor.camera`.

mod camera;
mod depth_camera;
mod height_scan;
mod lidar;
mod looks;
mod ray;
mod view;

use std::time::Duration;

use motorium::component::RunClock;
use motorium::prelude::*;
use motorium_robots::{RayScene, World};
use nalgebra::Isometry3;
use schemars::JsonSchema;

use super::draws::Draws;
use super::readings::Readings;
use super::robot::Mount;
use crate::channel::Timing;
use crate::randomise::{SensorDraw, SensorRanges};
use crate::rendering::Looks;

pub use camera::{Camera, CameraConfig, CameraOutputs, Intrinsics};
pub use depth_camera::{DepthCamera, DepthCameraConfig, DepthCameraOutputs};
pub use height_scan::{HeightScanConfig, HeightScanSensor};
pub use lidar::{Lidar, LidarConfig, LidarOutputs};
pub use ray::{RayConfig, RaySensor};
use view::{Look, Seen, View};

/// Configuration that every sensor of rays has.
#[derive(Clone, Copy, Debug)]
pub struct Common<'a> {
    mount: &'a Mount,
    world: &'a World,
    sees_robot: bool,
    timing: Timing,
    seed: Option<u64>,
    randomise: &'a SensorRanges,
}

impl<'a> Common<'a> {
    fn seen(&self) -> Seen<'a> {
        Seen { mount: self.mount, world: self.world, sees_robot: self.sees_robot }
    }
}

/// A ray-casting sensor.
pub trait RangeSensor: Sized + 'static {
    /// Name of the kind.
    const KIND: &'static str;
    /// One line on it.
    const SUMMARY: &'static str;
    /// `true` if the sensor sees colours and receives them by [`dress`](Self::dress). Default false.
    const SEES_COLOURS: bool = false;
    /// Its configuration.
    type Config: serde::de::DeserializeOwned + JsonSchema;
    /// Its outputs.
    type Outputs;

    /// Returns mount, visibility, latency and seed.
    fn common(config: &Self::Config) -> Common<'_>;
    /// The sensor of a seed, with the errors of an episode.
    ///
    /// # Errors
    /// A number out of range.
    fn new(config: &Self::Config, seed: u64, draw: &SensorDraw) -> Result<Self, ConfigError>;
    /// Numbers of a reading.
    fn width(&self) -> usize;
    /// Declares the outputs.
    fn declare(&self, declare: &mut Declare);
    /// Opens the outputs.
    ///
    /// # Errors
    /// A port cannot be opened.
    fn open(&self, setup: &mut Setup) -> Result<Self::Outputs, ConfigureError>;
    /// Receives the appearance of the scene before the first reading.
    fn dress(&mut self, _: &Looks) {}
    /// Fills in a reading: the sensor at `pose`, `dt` \[s\] after the last reading.
    fn read(&mut self, pose: &Isometry3<f64>, scene: &mut RayScene, dt: f64, values: &mut [f64]);
    /// Publishes a reading with its source time.
    ///
    /// # Errors
    /// A port refuses it.
    fn publish(&self, values: &[f64], source: u64, outputs: &mut Self::Outputs) -> Result<(), StepError>;
}

/// A component of a [`RangeSensor`]: it samples the true state of robot and world at its own rate or on its
/// trigger.
pub struct AlongRays<S: RangeSensor> {
    view: View,
    outputs: S::Outputs,
    config: S::Config,
    sensor: S,
    readings: Readings,
    draws: Draws,
    period: Duration,
    values: Vec<f64>,
    since: Option<u64>,
    clock: RunClock,
}

impl<S: RangeSensor> Component for AlongRays<S> {
    const KIND: &'static str = S::KIND;
    const SUMMARY: &'static str = S::SUMMARY;
    const READS_WORLD: bool = true;
    const RESETS: bool = true;
    type Config = S::Config;

    fn declare(config: &S::Config, declare: &mut Declare) -> Result<(), ConfigError> {
        let common = S::common(config);
        let Common { timing, randomise, .. } = common;
        Draws::declare(randomise, declare)?;
        let sensor = S::new(config, 0, &randomise.draw(0, timing.latency))?;
        let timing = timing.late(randomise.longest(timing.latency));
        Readings::declare_wide(&timing, sensor.width(), declare)?;
        View::declare(common.seen(), declare)?;
        sensor.declare(declare);
        Ok(())
    }

    fn configure(config: S::Config, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let common = S::common(&config);
        let seed = common.seed.unwrap_or(setup.seed());
        let draws = Draws::open(common.randomise, common.timing.latency, seed, setup)?;
        let mut sensor = S::new(&config, seed, &draws.now())?;
        let timing = common.timing.late(draws.now().latency);
        let view = View::open(common.seen(), S::SEES_COLOURS, setup)?;
        view.looks().into_iter().for_each(|looks| sensor.dress(looks));
        Ok(Self {
            view,
            outputs: sensor.open(setup)?,
            readings: Readings::new(&timing, sensor.width(), setup.period(), seed)?,
            draws,
            period: setup.period(),
            values: vec![0.0; sensor.width()],
            since: None,
            clock: setup.clock(),
            sensor,
            config,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        self.draws.publish()?;
        if let Some(Look { pose, times: (time, source) }) = self.view.newest(tick, &self.clock)? {
            let dt = self.since.replace(time).map_or(0.0, |since| time.saturating_sub(since) as f64 * 1e-9);
            self.sensor.read(&pose, &mut self.view.scene, dt, &mut self.values);
            self.readings.push(tick.time_ns, source, &self.values);
        }
        let Some((source, values)) = self.readings.due(tick.time_ns) else { return Ok(()) };
        self.sensor.publish(values, source, &mut self.outputs)
    }

    fn reset(&mut self, episode: &Episode) -> Result<(), StepError> {
        let Common { timing, seed, .. } = S::common(&self.config);
        let seed = seed.unwrap_or(episode.seed);
        let draw = self.draws.reset(episode.index, seed);
        let failed = |error: ConfigError| StepError::failed(error.to_string());
        self.sensor = S::new(&self.config, seed, &draw).map_err(failed)?;
        self.view.looks().into_iter().for_each(|looks| self.sensor.dress(looks));
        let timing = timing.late(draw.latency);
        self.readings = Readings::new(&timing, self.values.len(), self.period, seed).map_err(failed)?;
        self.view.reset();
        self.since = None;
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let mut result = self.readings.result();
        self.draws.report(&mut result);
        Some(result)
    }
}
