//! `sensor.lidar`: distances along many rays.

use std::f64::consts::{FRAC_PI_2, TAU};

use motorium::prelude::*;
use motorium::state::{CloudPoint, MAX_RANGES, Ranges};
use motorium::transport::SliceOutput;
use motorium_worlds::{Ray, RayHit, RayScene, World};
use nalgebra::{Isometry3, Point3, Unit, Vector3};

use super::super::readings::refused;
use super::super::robot::Mount;
use super::{RangeSensor, RaysConfig, Seen, warn_of_lengths};
use crate::channel::ErrorModel;
use crate::randomise::SensorDraw;
use crate::ranging::{RangeModel, RangeSettings, azimuths, direction};

sensor_config! {
    /// Configuration of `sensor.lidar`. The default is an ideal sensor at the root link with one ring of 360
    /// rays around z.
    ///
    /// ```toml
    /// mount      = { frame = "base", position = [0.1, 0.0, 0.2] }
    /// rays       = 360
    /// elevations = [-0.26, -0.09, 0.09, 0.26]
    /// most       = 20.0
    /// distance   = { noise = 0.01, resolution = 0.001 }
    /// lost       = 0.002
    /// latency    = "50 ms"
    /// ```
    pub struct LidarConfig;

    /// Mount of the sensor on the robot. Azimuth is the angle about z, from x towards y. Default: the root
    /// link.
    mount: Mount = Mount::default();
    /// Ground and objects that the sensor sees, in a graph without a `[world]`.
    world: World = World::default();
    /// `true` if rays can hit the robot that carries the sensor. Default true.
    sees_robot: bool = true;
    /// Horizontal angle covered by the rays of a ring, centred on x (rad). Default: a full circle.
    field_of_view: f64 = TAU;
    /// Number of rays in a ring. Default 360.
    rays: usize = 360;
    /// Elevations of the rings above the xy plane of the sensor (rad). Default: one ring in the plane.
    elevations: Vec<f64> = vec![0.0];
    /// Minimum measurable distance (m). Default 0.1.
    least: f64 = 0.1;
    /// Maximum measurable distance (m). Default 30.
    most: f64 = 30.0;
    /// Errors of a distance, m.
    distance: ErrorModel = ErrorModel::default();
    /// Fraction of the rays without a return, 0 to 1. Default 0.
    lost: f64 = 0.0;
}

impl RaysConfig for LidarConfig {
    fn seen(&self) -> Seen<'_> {
        Seen { mount: &self.mount, world: &self.world, sees_robot: self.sees_robot }
    }

    fn warn(&self, declare: &mut Declare) {
        warn_of_lengths(1000.0, &[("most", self.most)], ("distance", &self.distance), declare);
    }
}

/// Rays from one point in fixed directions. A reading contains the distances, followed by the cosines of the
/// angles of incidence.
#[derive(Debug)]
pub(super) struct Fan {
    directions: Vec<Unit<Vector3<f64>>>,
    rays: Vec<Ray>,
    hits: Vec<Option<RayHit>>,
    settings: RangeSettings,
    model: RangeModel,
}

impl Fan {
    /// Creates rays with these azimuths and elevations \[rad\].
    pub(super) fn new(
        angles: impl Iterator<Item = (f64, f64)>,
        settings: &RangeSettings,
        seed: u64,
    ) -> Result<Self, ConfigError> {
        let directions: Vec<_> = angles.map(|(azimuth, elevation)| direction(azimuth, elevation)).collect();
        let count = directions.len();
        let rays = directions.iter().map(|&direction| Ray { origin: Point3::origin(), direction }).collect();
        let model = RangeModel::new(settings, count, seed).map_err(refused)?;
        Ok(Self { directions, rays, hits: vec![None; count], settings: *settings, model })
    }

    /// Returns the number of rays.
    pub(super) fn count(&self) -> usize {
        self.directions.len()
    }

    /// Returns the number of values in a reading with angles of incidence.
    fn width(&self) -> usize {
        2 * self.count()
    }

    /// Computes a reading; without incidence angles it contains distances only.
    pub(super) fn read(&mut self, pose: &Isometry3<f64>, scene: &mut RayScene, dt: f64, values: &mut [f64]) {
        let origin = Point3::from(pose.translation.vector);
        for (ray, direction) in self.rays.iter_mut().zip(&self.directions) {
            *ray = Ray { origin, direction: pose.rotation * direction };
        }
        // cast beyond the maximum distance, because errors may shorten a distance
        scene.cast_all(&self.rays, self.model.no_return(), &mut self.hits);
        let (distances, cosines) = values.split_at_mut(self.directions.len());
        for (distance, hit) in distances.iter_mut().zip(&self.hits) {
            *distance = hit.map_or(f64::INFINITY, |hit| hit.distance);
        }
        for ((cosine, hit), ray) in cosines.iter_mut().zip(&self.hits).zip(&self.rays) {
            *cosine = hit.map_or(0.0, |hit| -hit.normal.dot(&ray.direction));
        }
        self.model.measure(dt, distances);
    }

    /// Publishes the distances of a reading.
    pub(super) fn publish(
        &self,
        values: &[f64],
        source: u64,
        output: &mut Output<Ranges>,
    ) -> Result<(), StepError> {
        let mut ranges = output.loan()?;
        (ranges.least, ranges.most) = (self.settings.least, self.settings.most);
        ranges.set_count(self.count());
        ranges.fill_from(Ranges::range, values.iter().map(|value| *value as f32));
        ranges.publish_from(source)
    }

    /// Publishes the points of all returns, in the axes of the sensor.
    fn publish_points(
        &self,
        values: &[f64],
        source: u64,
        output: &mut SliceOutput<CloudPoint>,
    ) -> Result<(), StepError> {
        let (distances, cosines) = values.split_at(self.count());
        let returned = |distance: &f64| *distance <= self.settings.most;
        let mut points = output.loan(distances.iter().filter(|distance| returned(distance)).count())?;
        let seen = distances.iter().zip(cosines).zip(&self.directions);
        let seen = seen.filter(|((distance, _), _)| returned(distance));
        points.fill_from(seen.map(|((distance, cosine), direction)| {
            let place = direction.scale(*distance);
            CloudPoint { x: place.x as f32, y: place.y as f32, z: place.z as f32, intensity: *cosine as f32 }
        }));
        points.publish_from(source)
    }
}

/// `sensor.lidar`: measures distances along many rays.
pub struct Lidar(Fan);

/// Output ports of a lidar.
pub struct LidarOutputs {
    ranges: Output<Ranges>,
    points: SliceOutput<CloudPoint>,
}

/// Number of scans queued for a slow reader of points.
const SCANS: usize = 4;

impl RangeSensor for Lidar {
    const KIND: &'static str = "sensor.lidar";
    const SUMMARY: &'static str = "distances along rings of rays: noise, resolution, lost returns, latency";
    type Config = LidarConfig;
    type Outputs = LidarOutputs;

    fn new(config: &LidarConfig, seed: u64, draw: &SensorDraw) -> Result<Self, ConfigError> {
        let LidarConfig { distance, least, most, lost, field_of_view, rays, ref elevations, .. } = *config;
        if !(field_of_view > 0.0 && field_of_view <= TAU + 1e-6) {
            let message = format!(
                "{field_of_view} rad is out of range, expected an angle above 0, up to a full circle of {TAU:.6} rad"
            );
            let advice = format!("if it is in degrees, write {:.4}", field_of_view.to_radians());
            return Err(ConfigError::key("field_of_view", message).advise(advice));
        }
        if let Some(wrong) = elevations.iter().find(|angle| !(-FRAC_PI_2..=FRAC_PI_2).contains(*angle)) {
            let message = format!("{wrong} rad is out of range, expected angles from -pi/2 to pi/2 rad");
            let advice = format!("if they are in degrees, write {:.4} for it", wrong.to_radians());
            return Err(ConfigError::key("elevations", message).advise(advice));
        }
        let count = rays.saturating_mul(elevations.len());
        if !(1..=MAX_RANGES).contains(&count) {
            let message = format!("{count} rays in all rings together, expected 1 to {MAX_RANGES}");
            return Err(ConfigError::key("rays", message).advise("use several sensors for more"));
        }
        let angles = elevations
            .iter()
            .flat_map(|elevation| azimuths(field_of_view, rays).map(move |azimuth| (azimuth, *elevation)));
        Fan::new(angles, &RangeSettings { distance: draw.errors(&distance), least, most, lost }, seed)
            .map(Self)
    }

    fn width(&self) -> usize {
        self.0.width()
    }

    fn declare(&self, declare: &mut Declare) {
        declare.output::<Ranges>("ranges", "distances, ring by ring, each from right to left");
        let doc = "points with a return, in the axes of the sensor";
        declare.slice_output::<CloudPoint>("points", self.0.count(), SCANS, doc);
    }

    fn open(&self, setup: &mut Setup) -> Result<Self::Outputs, ConfigureError> {
        Ok(LidarOutputs { ranges: setup.output("ranges")?, points: setup.slice_output("points")? })
    }

    fn read(&mut self, pose: &Isometry3<f64>, scene: &mut RayScene, dt: f64, values: &mut [f64]) {
        self.0.read(pose, scene, dt, values);
    }

    fn publish(&self, values: &[f64], source: u64, outputs: &mut LidarOutputs) -> Result<(), StepError> {
        if outputs.points.is_wired() {
            self.0.publish_points(values, source, &mut outputs.points)?;
        }
        self.0.publish(values, source, &mut outputs.ranges)
    }
}
