//! `sensor.ray`: the distance along one ray.

use motorium::prelude::*;
use motorium::state::Ranges;
use motorium_worlds::{RayScene, World};
use nalgebra::Isometry3;

use super::super::robot::Mount;
use super::lidar::Fan;
use super::{RangeSensor, RaysConfig, Seen, warn_of_lengths};
use crate::channel::ErrorModel;
use crate::randomise::SensorDraw;
use crate::ranging::RangeSettings;

sensor_config! {
    /// Configuration of `sensor.ray`. The default is an ideal sensor at the origin of the root link that
    /// looks along the link's x axis.
    ///
    /// ```toml
    /// mount    = { frame = "panda_hand", rpy = [0.0, 1.5708, 0.0] }
    /// most     = 4.0
    /// distance = { noise = 0.002, resolution = 0.001 }
    /// ```
    pub struct RayConfig;

    /// Mount of the sensor on the robot. The ray points along the sensor's x axis. Default: the root link.
    mount: Mount = Mount::default();
    /// Ground and objects that the sensor sees, in a graph without a `[world]`.
    world: World = World::default();
    /// `true` if the ray can hit the robot that carries the sensor. Default true.
    sees_robot: bool = true;
    /// Minimum measurable distance (m). Default 0.
    least: f64 = 0.0;
    /// Maximum measurable distance (m). Default 10.
    most: f64 = 10.0;
    /// Errors of the distance, m.
    distance: ErrorModel = ErrorModel::default();
    /// Fraction of the readings without a return, 0 to 1. Default 0.
    lost: f64 = 0.0;
}

impl RaysConfig for RayConfig {
    fn seen(&self) -> Seen<'_> {
        Seen { mount: &self.mount, world: &self.world, sees_robot: self.sees_robot }
    }

    fn warn(&self, declare: &mut Declare) {
        warn_of_lengths(1000.0, &[("most", self.most)], ("distance", &self.distance), declare);
    }
}

/// `sensor.ray`: measures the distance along one ray.
pub struct RaySensor(Fan);

impl RangeSensor for RaySensor {
    const KIND: &'static str = "sensor.ray";
    const SUMMARY: &'static str = "distance along one ray: noise, resolution, lost returns, latency";
    type Config = RayConfig;
    type Outputs = Output<Ranges>;

    fn new(config: &RayConfig, seed: u64, draw: &SensorDraw) -> Result<Self, ConfigError> {
        let RayConfig { distance, least, most, lost, .. } = *config;
        Fan::new(
            std::iter::once((0.0, 0.0)),
            &RangeSettings { distance: draw.errors(&distance), least, most, lost },
            seed,
        )
        .map(Self)
    }

    fn width(&self) -> usize {
        self.0.count()
    }

    fn declare(&self, declare: &mut Declare) {
        declare.output::<Ranges>("range", "distance along the ray, one number");
    }

    fn open(&self, setup: &mut Setup) -> Result<Self::Outputs, ConfigureError> {
        Ok(setup.output("range")?)
    }

    fn read(&mut self, pose: &Isometry3<f64>, scene: &mut RayScene, dt: f64, values: &mut [f64]) {
        self.0.read(pose, scene, dt, values);
    }

    fn publish(&self, values: &[f64], source: u64, output: &mut Output<Ranges>) -> Result<(), StepError> {
        self.0.publish(values, source, output)
    }
}
