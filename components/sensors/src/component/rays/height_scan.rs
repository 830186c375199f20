//! `sensor.height_scan`: heights of the surface on a grid around the sensor.

use motorium::prelude::*;
use motorium::state::{HeightScan, MAX_HEIGHTS};
use motorium_worlds::{Ray, RayHit, RayScene, World};
use nalgebra::{Isometry3, Point3, Vector3};

use super::super::readings::refused;
use super::super::robot::Mount;
use super::{RangeSensor, RaysConfig, Seen, warn_of_lengths};
use crate::channel::{Channel, ErrorModel};
use crate::randomise::SensorDraw;

sensor_config! {
    /// Configuration of `sensor.height_scan`. The default is an ideal scan of 17 x 11 points centred on the
    /// root link.
    ///
    /// ```toml
    /// size    = [1.6, 1.0]
    /// spacing = 0.1
    /// height  = { noise = 0.01, bias = 0.01 }
    /// latency = "20 ms"
    /// ```
    pub struct HeightScanConfig;

    /// Mount of the sensor on the robot. The grid is centred on the sensor. Default: the root link.
    mount: Mount = Mount::default();
    /// Ground and objects that the sensor sees, in a graph without a `[world]`.
    world: World = World::default();
    /// `true` if the robot that carries the sensor is part of the scanned surface. Default false.
    sees_robot: bool = false;
    /// Length of the grid along x and y of the sensor (m). Default 1.6 and 1.0.
    size: [f64; 2] = [1.6, 1.0];
    /// Distance between neighbouring points (m). Default 0.1.
    spacing: f64 = 0.1;
    /// Minimum reported height, relative to the sensor (m). Default -2.
    least: f64 = -2.0;
    /// Maximum reported height, relative to the sensor (m). The scan looks down from this height, so higher
    /// surfaces are invisible. Default 1.
    most: f64 = 1.0;
    /// Errors of a height, m.
    height: ErrorModel = ErrorModel::default();
}

impl RaysConfig for HeightScanConfig {
    fn seen(&self) -> Seen<'_> {
        Seen { mount: &self.mount, world: &self.world, sees_robot: self.sees_robot }
    }

    fn warn(&self, declare: &mut Declare) {
        warn_of_lengths(
            100.0,
            &[
                ("size", self.size[0].max(self.size[1])),
                ("spacing", self.spacing),
                ("least", self.least),
                ("most", self.most),
            ],
            ("height", &self.height),
            declare,
        );
    }
}

impl HeightScanConfig {
    /// Returns the number of points along x and y.
    fn points(&self) -> Result<[usize; 2], ConfigError> {
        if !(self.spacing.is_finite() && self.spacing > 0.0) {
            return Err(ConfigError::key(
                "spacing",
                format!("{} m is out of range, expected a length above 0", self.spacing),
            ));
        }
        if !self.size.iter().all(|size| (0.0..=1e6).contains(size)) {
            return Err(ConfigError::key("size", "expected lengths from 0 to 1e6 m"));
        }
        // a size that is a multiple of the spacing up to rounding has a point at its end
        let points = self.size.map(|size| (size / self.spacing + 1e-6).floor() as usize + 1);
        let count = points[0].saturating_mul(points[1]);
        if count > MAX_HEIGHTS {
            let message = format!(
                "a grid of {} x {} points, expected at most {MAX_HEIGHTS} points",
                points[0], points[1]
            );
            return Err(ConfigError::key("size", message).advise("reduce `size`, or increase `spacing`"));
        }
        Ok(points)
    }
}

/// `sensor.height_scan`: measures heights of the surface on a grid around the sensor.
pub struct HeightScanSensor {
    points: [usize; 2],
    spacing: f64,
    least: f64,
    most: f64,
    channel: Channel,
    rays: Vec<Ray>,
    hits: Vec<Option<RayHit>>,
}

impl RangeSensor for HeightScanSensor {
    const KIND: &'static str = "sensor.height_scan";
    const SUMMARY: &'static str = "heights of the surface on a grid around the sensor: noise, latency";
    type Config = HeightScanConfig;
    type Outputs = Output<HeightScan>;

    fn new(config: &HeightScanConfig, seed: u64, draw: &SensorDraw) -> Result<Self, ConfigError> {
        let points = config.points()?;
        let HeightScanConfig { spacing, least, most, .. } = *config;
        if !(least.is_finite() && most.is_finite() && least < most) {
            let message =
                format!("heights from {least} to {most} m are an empty range, expected `least` below `most`");
            return Err(ConfigError::key("least", message));
        }
        let count = points[0] * points[1];
        let channel =
            Channel::new("height", &draw.errors(&config.height), count, seed, 0).map_err(refused)?;
        let down = Ray { origin: Point3::origin(), direction: -Vector3::z_axis() };
        Ok(Self { points, spacing, least, most, channel, rays: vec![down; count], hits: vec![None; count] })
    }

    fn width(&self) -> usize {
        self.rays.len()
    }

    fn declare(&self, declare: &mut Declare) {
        declare.output::<HeightScan>("heights", "heights of the surface above the sensor");
    }

    fn open(&self, setup: &mut Setup) -> Result<Self::Outputs, ConfigureError> {
        Ok(setup.output("heights")?)
    }

    fn read(&mut self, pose: &Isometry3<f64>, scene: &mut RayScene, dt: f64, values: &mut [f64]) {
        let ahead = pose.rotation * Vector3::x();
        let (sin, cos) = ahead.y.atan2(ahead.x).sin_cos();
        let from = pose.translation.vector;
        let [rows, columns] = self.points;
        let middle = |count: usize| 0.5 * (count - 1) as f64;
        for (index, ray) in self.rays.iter_mut().enumerate() {
            let x = ((index / columns) as f64 - middle(rows)) * self.spacing;
            let y = ((index % columns) as f64 - middle(columns)) * self.spacing;
            ray.origin =
                Point3::new(from.x + x * cos - y * sin, from.y + x * sin + y * cos, from.z + self.most);
        }
        let depth = self.most - self.least;
        scene.cast_all(&self.rays, depth, &mut self.hits);
        for (value, hit) in values.iter_mut().zip(&self.hits) {
            *value = hit.map_or(self.least, |hit| self.most - hit.distance);
        }
        self.channel.measure(dt, values);
        values.iter_mut().for_each(|value| *value = value.clamp(self.least, self.most));
    }

    fn publish(&self, values: &[f64], source: u64, output: &mut Output<HeightScan>) -> Result<(), StepError> {
        let mut scan = output.loan()?;
        (scan.rows, scan.columns) = (self.points[0] as u32, self.points[1] as u32);
        (scan.spacing, scan.least, scan.most) = (self.spacing, self.least, self.most);
        scan.set_count(values.len());
        scan.fill_from(HeightScan::height, values.iter().map(|value| *value as f32));
        scan.publish_from(source)
    }
}
