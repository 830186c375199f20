//! `sensor.ray`: the distance along one ray.

use motorium::prelude::*;
use motorium::state::Ranges;
use motorium_robots::{RayScene, World};
use nalgebra::Isometry3;
use schemars::JsonSchema;
use serde::Deserialize;

use super::lidar::Fan;
use super::{Common, Mount, RangeSensor, Timing};
use crate::channel::ErrorModel;
use crate::randomise::{SensorDraw, SensorRanges};
use crate::ranging::RangeSettings;

/// Configuration of `sensor.ray`. The default is an ideal sensor at the root link that looks along its x.
///
/// ```toml
/// mount    = { frame = "panda_hand", rpy = [0.0, 1.5708, 0.0] }
/// most     = 4.0
/// distance = { noise = 0.002, resolution = 0.001 }
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RayConfig {
    /// Mount of the sensor on the robot; the ray points along x. Default: the root link.
    pub mount: Mount,
    /// Ground and objects, in a graph without a `[world]`.
    pub world: World,
    /// `true` if the ray can hit the carrying robot. Default true.
    pub sees_robot: bool,
    /// The least distance that is measured (m). Default 0.
    pub least: f64,
    /// The greatest distance that is measured (m). Default 10.
    pub most: f64,
    /// Errors of the distance, m.
    pub distance: ErrorModel,
    /// Share of the readings without a return, 0 to 1. Default 0.
    pub lost: f64,
    /// Time from sampling until the reading is available. Default 0.
    pub latency: TimeSpan,
    /// Fraction of the readings that are dropped, 0 to 1. Default 0.
    pub drop_out: f64,
    /// Seed of the noise. Default: from the seed of the run and the name of the component.
    pub seed: Option<u64>,
    /// Ranges from which noise, bias and latency are sampled at the start of every episode. Default: no
    /// sampling.
    pub randomise: SensorRanges,
}

impl Default for RayConfig {
    fn default() -> Self {
        Self {
            mount: Mount::default(),
            world: World::default(),
            sees_robot: true,
            least: 0.0,
            most: 10.0,
            distance: ErrorModel::default(),
            lost: 0.0,
            latency: TimeSpan { ns: 0 },
            drop_out: 0.0,
            seed: None,
            randomise: SensorRanges::default(),
        }
    }
}

/// `sensor.ray`: the distance along one ray.
pub struct RaySensor(Fan);

impl RangeSensor for RaySensor {
    const KIND: &'static str = "sensor.ray";
    const SUMMARY: &'static str = "distance along one ray: noise, resolution, lost returns, latency";
    type Config = RayConfig;
    type Outputs = Output<Ranges>;

    fn common(config: &RayConfig) -> Common<'_> {
        Common {
            mount: &config.mount,
            world: &config.world,
            sees_robot: config.sees_robot,
            timing: Timing { latency: config.latency, drop_out: config.drop_out },
            seed: config.seed,
            randomise: &config.randomise,
        }
    }

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
