//! `sensor.depth_camera`: depth and grey images.

use motorium::prelude::*;
use motorium::state::ImageInfo;
use motorium::transport::SliceOutput;
use motorium_worlds::{Ray, RayHit, RayScene, World};
use nalgebra::{Isometry3, Point3, Unit, Vector3};

use super::super::readings::refused;
use super::super::robot::Mount;
use super::{RangeSensor, RaysConfig, Seen, warn_of_lengths};
use crate::channel::ErrorModel;
use crate::pinhole::Pinhole;
use crate::randomise::SensorDraw;
use crate::ranging::{RangeModel, RangeSettings};

sensor_config! {
    /// Configuration of `sensor.depth_camera`. The default is an ideal camera of 160 x 120 pixels at the
    /// origin of the root link that looks along the link's x axis.
    ///
    /// ```toml
    /// mount         = { frame = "panda_hand", position = [0.05, 0.0, 0.0], rpy = [0.0, -1.5708, 0.0] }
    /// field_of_view = 1.2
    /// most          = 2.0
    /// depth         = { noise = 0.002, resolution = 0.001 }
    /// latency       = "33 ms"
    /// ```
    pub struct DepthCameraConfig;

    /// Mount of the camera on the robot. The camera looks along its x axis; its y axis points to the left of
    /// the image, and its z axis to the top. Default: the root link.
    mount: Mount = Mount::default();
    /// Ground and objects that the sensor sees, in a graph without a `[world]`.
    world: World = World::default();
    /// `true` if the robot that carries the camera appears in the image. Default true.
    sees_robot: bool = true;
    /// Width of the image (pixels). Default 160.
    width: u32 = 160;
    /// Height of the image (pixels). Default 120.
    height: u32 = 120;
    /// Angle between the left and the right edge of the image (rad). Default 1.0472, which is 60 degrees.
    field_of_view: f64 = std::f64::consts::FRAC_PI_3;
    /// Minimum measurable depth (m). Default 0.05.
    least: f64 = 0.05;
    /// Maximum measurable depth (m). Default 5.
    most: f64 = 5.0;
    /// Errors of the depth of each pixel, m.
    depth: ErrorModel = ErrorModel::default();
    /// Fraction of the pixels without a depth, 0 to 1. Default 0.
    lost: f64 = 0.0;
}

impl RaysConfig for DepthCameraConfig {
    fn seen(&self) -> Seen<'_> {
        Seen { mount: &self.mount, world: &self.world, sees_robot: self.sees_robot }
    }

    fn warn(&self, declare: &mut Declare) {
        warn_of_lengths(100.0, &[("most", self.most)], ("depth", &self.depth), declare);
    }
}

/// Maximum number of pixels of an image.
pub(super) const MOST_PIXELS: u64 = 1 << 20;

/// Queue capacity for images, sufficient for a slow reader such as a recorder at 10 Hz.
pub(super) const PICTURES: usize = 6;

/// Bytes per pixel of a depth image.
const DEPTH_BYTES: usize = size_of::<f32>();

/// Grey level (of 255) of a surface seen edge-on, and its increase for a surface seen from the front.
const SHADE: (f64, f64) = (40.0, 215.0);

/// `sensor.depth_camera`: captures depth and grey images. A reading contains the depths of all pixels,
/// followed by the cosines of the angles of incidence.
#[derive(Clone, Debug)]
pub struct DepthCamera {
    pinhole: Pinhole,
    directions: Vec<Unit<Vector3<f64>>>,
    rays: Vec<Ray>,
    hits: Vec<Option<RayHit>>,
    model: RangeModel,
    most: f64,
}

/// Output ports of a depth camera.
pub struct DepthCameraOutputs {
    depth: SliceOutput<u8>,
    grey: SliceOutput<u8>,
    info: Output<ImageInfo>,
}

impl DepthCamera {
    /// Converts a depth in a reading to the published depth \[m\], which is 0 if the reading has no depth.
    pub fn depth(&self, reading: f64) -> f32 {
        if reading <= self.most { reading as f32 } else { 0.0 }
    }

    /// Converts a cosine in a reading to the published grey level, which is 0 without a surface.
    pub fn grey(cosine: f64) -> u8 {
        if cosine < 0.0 { 0 } else { (SHADE.0 + SHADE.1 * cosine) as u8 }
    }

    /// Returns the format of the depth images.
    fn info(&self) -> ImageInfo {
        let Pinhole { width, height, focal_length, principal_point } = self.pinhole;
        ImageInfo {
            width,
            height,
            stride: width * DEPTH_BYTES as u32,
            encoding: ImageInfo::DEPTH_32,
            focal_length,
            principal_point,
        }
    }
}

impl RangeSensor for DepthCamera {
    const KIND: &'static str = "sensor.depth_camera";
    const SUMMARY: &'static str = "ray-traced depth and grey images: noise, lost pixels, latency";
    type Config = DepthCameraConfig;
    type Outputs = DepthCameraOutputs;

    fn new(config: &DepthCameraConfig, seed: u64, draw: &SensorDraw) -> Result<Self, ConfigError> {
        let DepthCameraConfig { width, height, field_of_view, least, most, depth, lost, .. } = *config;
        let pixels = u64::from(width) * u64::from(height);
        if !(1..=MOST_PIXELS).contains(&pixels) {
            let message =
                format!("an image of {width} x {height} pixels, expected 1 to {MOST_PIXELS} pixels in total");
            return Err(ConfigError::key("width", message));
        }
        if !(field_of_view > 0.0 && field_of_view < 3.0) {
            let message =
                format!("{field_of_view} rad is out of range, expected an angle above 0 and below 3 rad");
            return Err(ConfigError::key("field_of_view", message));
        }
        let pinhole = Pinhole::new(width, height, field_of_view);
        let directions: Vec<_> = pinhole.directions().collect();
        let count = directions.len();
        let settings = RangeSettings { distance: draw.errors(&depth), least, most, lost };
        let model = RangeModel::new(&settings, count, seed).map_err(|error| {
            let setting = error.setting.replacen("distance", "depth", 1);
            refused(crate::channel::SettingError { setting, ..error })
        })?;
        let rays = directions.iter().map(|&direction| Ray { origin: Point3::origin(), direction }).collect();
        Ok(Self { pinhole, directions, rays, hits: vec![None; count], model, most })
    }

    fn width(&self) -> usize {
        2 * self.directions.len()
    }

    fn declare(&self, declare: &mut Declare) {
        let pixels = self.directions.len();
        let doc = "depth along the optical axis, one `f32` per pixel, m; 0 without a depth";
        declare.slice_output::<u8>("depth", pixels * DEPTH_BYTES, PICTURES, doc);
        declare.slice_output::<u8>(
            "grey",
            pixels,
            PICTURES,
            "brightness under a lamp at the camera, one byte per pixel",
        );
        declare.output::<ImageInfo>("info", "format of the depth images");
    }

    fn open(&self, setup: &mut Setup) -> Result<Self::Outputs, ConfigureError> {
        Ok(DepthCameraOutputs {
            depth: setup.slice_output("depth")?,
            grey: setup.slice_output("grey")?,
            info: setup.output("info")?,
        })
    }

    fn read(&mut self, pose: &Isometry3<f64>, scene: &mut RayScene, dt: f64, values: &mut [f64]) {
        let origin = Point3::from(pose.translation.vector);
        let turn = pose.rotation.to_rotation_matrix();
        let mut steepest = 1.0_f64;
        for (ray, direction) in self.rays.iter_mut().zip(&self.directions) {
            *ray = Ray { origin, direction: turn * direction };
            steepest = steepest.min(direction.x);
        }
        scene.cast_all(&self.rays, self.model.no_return() / steepest, &mut self.hits);
        let (depths, cosines) = values.split_at_mut(self.directions.len());
        let seen = self.hits.iter().zip(&self.directions).zip(&self.rays);
        for (((hit, direction), ray), (depth, cosine)) in seen.zip(depths.iter_mut().zip(cosines)) {
            (*depth, *cosine) = match hit {
                Some(hit) => (hit.distance * direction.x, -hit.normal.dot(&ray.direction)),
                None => (f64::INFINITY, -1.0),
            };
        }
        self.model.measure(dt, depths);
    }

    fn publish(
        &self,
        values: &[f64],
        source: u64,
        outputs: &mut DepthCameraOutputs,
    ) -> Result<(), StepError> {
        let (depths, cosines) = values.split_at(self.directions.len());
        if outputs.grey.is_wired() {
            let mut grey = outputs.grey.loan(cosines.len())?;
            for (pixel, cosine) in grey.iter_mut().zip(cosines) {
                *pixel = Self::grey(*cosine);
            }
            grey.publish_from(source)?;
        }
        if outputs.info.is_wired() {
            let mut info = outputs.info.loan()?;
            *info = self.info();
            info.publish_from(source)?;
        }
        let mut picture = outputs.depth.loan(depths.len() * DEPTH_BYTES)?;
        for (pixel, depth) in picture.chunks_exact_mut(DEPTH_BYTES).zip(depths) {
            pixel.copy_from_slice(&self.depth(*depth).to_ne_bytes());
        }
        picture.publish_from(source)
    }
}
