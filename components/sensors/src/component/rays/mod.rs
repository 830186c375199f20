//! Components of ray-casting sensors: `sensor.ray`, `sensor.lidar`, `sensor.height_scan`,
//! `sensor.depth_camera`, `sensor.camera`.

mod camera;
mod depth_camera;
mod height_scan;
mod lidar;
mod looks;
mod ray;
mod view;

use motorium::component::RunClock;
use motorium::prelude::*;
use motorium_worlds::RayScene;
use nalgebra::Isometry3;
use schemars::JsonSchema;

use super::config::SensorConfig;
use super::delivery::Delivery;
use super::doubts::Plausible;
use crate::channel::ErrorModel;
use crate::randomise::SensorDraw;
use crate::rendering::Looks;

pub use camera::{Camera, CameraConfig, CameraOutputs, Intrinsics};
pub use depth_camera::{DepthCamera, DepthCameraConfig, DepthCameraOutputs};
pub use height_scan::{HeightScanConfig, HeightScanSensor};
pub use lidar::{Lidar, LidarConfig, LidarOutputs};
pub use ray::{RayConfig, RaySensor};
pub use view::Seen;
use view::{Look, View};

/// The configuration of a ray-casting sensor.
pub trait RaysConfig: SensorConfig {
    /// Returns the mount of the sensor and the world seen by the sensor.
    fn seen(&self) -> Seen<'_>;
    /// Warns of values that are probably in another unit. Default: no warnings.
    fn warn(&self, _: &mut Declare) {}
}

/// Warns of distances of a sensor above `most` \[m\], which are probably in millimetres. `errors` is the key
/// of its error model, and the model.
fn warn_of_lengths(most: f64, distances: &[(&str, f64)], errors: (&str, &ErrorModel), declare: &mut Declare) {
    /// Largest plausible error of a distance \[m\].
    const LARGEST_ERROR: f64 = 1.0;
    distances.iter().for_each(|(key, value)| Plausible::length(most).warn(key, &[*value], declare));
    Plausible::length(LARGEST_ERROR).warn_of_errors(errors.0, errors.1, declare);
}

/// A ray-casting sensor.
pub trait RangeSensor: Sized + 'static {
    /// Name of the kind.
    const KIND: &'static str;
    /// One-line summary of the kind.
    const SUMMARY: &'static str;
    /// `true` if the sensor sees colours and receives them by [`dress`](Self::dress). Default false.
    const SEES_COLOURS: bool = false;
    /// Configuration of the sensor.
    type Config: RaysConfig + serde::de::DeserializeOwned + JsonSchema;
    /// Output ports of the sensor.
    type Outputs;

    /// Creates the sensor with the errors `draw` of an episode. The seed determines the noise.
    ///
    /// # Errors
    /// A number is out of range.
    fn new(config: &Self::Config, seed: u64, draw: &SensorDraw) -> Result<Self, ConfigError>;
    /// Returns the number of values in a reading.
    fn width(&self) -> usize;
    /// Declares the output ports.
    fn declare(&self, declare: &mut Declare);
    /// Opens the output ports.
    ///
    /// # Errors
    /// A port cannot be opened.
    fn open(&self, setup: &mut Setup) -> Result<Self::Outputs, ConfigureError>;
    /// Receives the appearance of the scene before the first reading.
    fn dress(&mut self, _: &Looks) {}
    /// Computes a reading of the sensor at `pose`, `dt` \[s\] after the previous reading.
    fn read(&mut self, pose: &Isometry3<f64>, scene: &mut RayScene, dt: f64, values: &mut [f64]);
    /// Publishes a reading with its source time.
    ///
    /// # Errors
    /// A port rejects the reading.
    fn publish(&self, values: &[f64], source: u64, outputs: &mut Self::Outputs) -> Result<(), StepError>;
}

/// The component of a [`RangeSensor`]. The component samples the true state of robot and world at its own
/// rate or on its trigger.
pub struct AlongRays<S: RangeSensor> {
    view: View,
    outputs: S::Outputs,
    config: S::Config,
    sensor: S,
    delivery: Delivery,
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
        let common = config.common();
        let sensor = S::new(config, 0, &common.declare_draws(declare)?)?;
        common.declare_readings(sensor.width(), declare)?;
        View::declare(config.seen(), declare)?;
        config.warn(declare);
        sensor.declare(declare);
        Ok(())
    }

    fn configure(config: S::Config, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let opened = config.common().open(setup)?;
        let (seed, draw) = opened.start();
        let mut sensor = S::new(&config, seed, &draw)?;
        let view = View::open(config.seen(), S::SEES_COLOURS, setup)?;
        view.looks().into_iter().for_each(|looks| sensor.dress(looks));
        Ok(Self {
            view,
            outputs: sensor.open(setup)?,
            delivery: opened.deliver(sensor.width())?,
            values: vec![0.0; sensor.width()],
            since: None,
            clock: setup.clock(),
            sensor,
            config,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        self.delivery.publish_draws()?;
        if let Some(Look { pose, times: (time, source) }) = self.view.newest(tick, &self.clock)? {
            let dt = self.since.replace(time).map_or(0.0, |since| time.saturating_sub(since) as f64 * 1e-9);
            self.sensor.read(&pose, self.view.scenery.scene_mut(), dt, &mut self.values);
            self.delivery.push(tick.time_ns, source, &self.values);
        }
        let Some((source, values)) = self.delivery.due(tick.time_ns) else { return Ok(()) };
        self.sensor.publish(values, source, &mut self.outputs)
    }

    fn reset(&mut self, episode: &Episode) -> Result<(), StepError> {
        let (seed, draw) = self.delivery.reset(episode)?;
        self.sensor =
            S::new(&self.config, seed, &draw).map_err(|error| StepError::failed(error.to_string()))?;
        self.view.looks().into_iter().for_each(|looks| self.sensor.dress(looks));
        self.view.reset();
        self.since = None;
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        Some(self.delivery.result())
    }
}
