//! `sensor.camera`: colour images.

use motorium::prelude::*;
use motorium::state::ImageInfo;
use motorium::transport::SliceOutput;
use motorium_robots::Colour;
use motorium_worlds::{RayScene, World};
use nalgebra::Isometry3;
use schemars::JsonSchema;
use serde::Deserialize;

use super::super::readings::refused;
use super::super::robot::Mount;
use super::depth_camera::{MOST_PIXELS, PICTURES};
use super::{Looks, RangeSensor, RaysConfig, Seen};
use crate::pinhole::Pinhole;
use crate::randomise::SensorDraw;
use crate::rendering::{PixelNoise, PixelSensor, Renderer};

sensor_config! {
    /// Configuration of `sensor.camera`. The default is an ideal camera of 160 x 120 pixels at the origin of
    /// the root link that looks along the link's x axis.
    ///
    /// ```toml
    /// mount         = { frame = "panda_hand", position = [0.05, 0.0, 0.0], rpy = [0.0, -1.5708, 0.0] }
    /// field_of_view = 1.2
    /// noise         = { full_well = 10000.0, read_noise = 1.0 }
    /// latency       = "33 ms"
    /// ```
    pub struct CameraConfig;

    /// Mount of the camera on the robot or in the `world`. The camera looks along its x axis; its y axis
    /// points to the left of the image, and its z axis to the top. Default: the root link.
    mount: Mount = Mount::default();
    /// Ground and objects that the sensor sees, in a graph without a `[world]`.
    world: World = World::default();
    /// `true` if the robot appears in the image. Default true.
    sees_robot: bool = true;
    /// Width of the image (pixels). Default 160.
    width: u32 = 160;
    /// Height of the image (pixels). Default 120.
    height: u32 = 120;
    /// Angle between the left and the right edge of the image (rad). Default 1.0472, which is 60 degrees.
    field_of_view: Option<f64> = None;
    /// Angle between the top and the bottom edge of the image (rad), instead of `field_of_view`.
    vertical_field_of_view: Option<f64> = None;
    /// Focal lengths and principal point, instead of a field of view.
    intrinsics: Option<Intrinsics> = None;
    /// Maximum visible distance (m). Default 100.
    most: f64 = 100.0;
    /// Errors of the pixels.
    noise: PixelNoise = PixelNoise::default();
}

impl RaysConfig for CameraConfig {
    fn seen(&self) -> Seen<'_> {
        Seen { mount: &self.mount, world: &self.world, sees_robot: self.sees_robot }
    }
}

/// Focal lengths and principal point of a camera from a calibration.
///
/// ```toml
/// fx = 138.6
/// fy = 138.6
/// cx = 79.5
/// cy = 59.5
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Intrinsics {
    /// Focal length in pixels along a row.
    pub fx: f64,
    /// Focal length in pixels along a column.
    pub fy: f64,
    /// Column of the principal point (pixels); 0 is the middle of the left column.
    pub cx: f64,
    /// Row of the principal point (pixels); 0 is the middle of the top row.
    pub cy: f64,
}

impl CameraConfig {
    fn pinhole(&self) -> Result<Pinhole, ConfigError> {
        let Self { width, height, field_of_view, vertical_field_of_view, intrinsics, .. } = *self;
        let pixels = u64::from(width) * u64::from(height);
        if !(1..=MOST_PIXELS).contains(&pixels) {
            let message =
                format!("an image of {width} x {height} pixels, expected 1 to {MOST_PIXELS} pixels in total");
            return Err(ConfigError::key("width", message));
        }
        for (key, angle) in
            [("field_of_view", field_of_view), ("vertical_field_of_view", vertical_field_of_view)]
        {
            if let Some(angle) = angle.filter(|angle| !(*angle > 0.0 && *angle < 3.0)) {
                let message =
                    format!("{angle} rad is out of range, expected an angle above 0 and below 3 rad");
                return Err(ConfigError::key(key, message));
            }
        }
        match (field_of_view, vertical_field_of_view, intrinsics) {
            (None, None, None) => Ok(Pinhole::new(width, height, std::f64::consts::FRAC_PI_3)),
            (Some(angle), None, None) => Ok(Pinhole::new(width, height, angle)),
            (None, Some(angle), None) => Ok(Pinhole::upright(width, height, angle)),
            (None, None, Some(Intrinsics { fx, fy, cx, cy })) => {
                let lengths = [("intrinsics.fx", fx), ("intrinsics.fy", fy)];
                if let Some((key, length)) =
                    lengths.into_iter().find(|(_, length)| !(1e-3..=1e6).contains(length))
                {
                    return Err(ConfigError::key(key, format!("{length}: expected 0.001 to 1e6 pixels")));
                }
                let places = [("intrinsics.cx", cx), ("intrinsics.cy", cy)];
                if let Some((key, place)) =
                    places.into_iter().find(|(_, place)| !(-1e6..=1e6).contains(place))
                {
                    return Err(ConfigError::key(key, format!("{place}: expected -1e6 to 1e6 pixels")));
                }
                Ok(Pinhole { width, height, focal_length: [fx, fy], principal_point: [cx, cy] })
            }
            _ => Err(ConfigError::key(
                "field_of_view",
                "more than one of `field_of_view`, `vertical_field_of_view` and `intrinsics` is set",
            )
            .advise("keep one of them")),
        }
    }
}

/// `sensor.camera`: captures colour images. A reading stores the levels of each pixel as one number, red +
/// 256 green + 65536 blue.
pub struct Camera {
    renderer: Renderer,
    sensor: PixelSensor,
    looks: Option<Looks>,
    picture: Vec<Colour>,
}

/// Output ports of a camera.
pub struct CameraOutputs {
    image: SliceOutput<u8>,
    info: Output<ImageInfo>,
}

/// Bytes per pixel.
const PIXEL_BYTES: usize = 3;

impl RangeSensor for Camera {
    const KIND: &'static str = "sensor.camera";
    const SUMMARY: &'static str = "ray-traced colour images: light, shadows, shot noise, latency";
    const SEES_COLOURS: bool = true;
    type Config = CameraConfig;
    type Outputs = CameraOutputs;

    fn new(config: &CameraConfig, seed: u64, draw: &SensorDraw) -> Result<Self, ConfigError> {
        if !(config.most > 0.0 && config.most <= 1e6) {
            let message =
                format!("{} m is out of range, expected a distance above 0, up to 1e6 m", config.most);
            return Err(ConfigError::key("most", message));
        }
        let renderer = Renderer::new(config.pinhole()?, config.most);
        if config.randomise.bias.is_some() {
            return Err(ConfigError::key("randomise.bias", "pixels have no bias")
                .advise("randomise `noise` or `latency`"));
        }
        let sensor = PixelSensor::new(&config.noise, seed)
            .and_then(|_| PixelSensor::new(&config.noise.scaled(draw.noise), seed))
            .map_err(|error| {
                let setting = format!("noise.{}", error.setting);
                refused(crate::channel::SettingError { setting, ..error })
            })?;
        let picture = vec![[0.0; 3]; renderer.pixels()];
        Ok(Self { renderer, sensor, looks: None, picture })
    }

    fn width(&self) -> usize {
        self.picture.len()
    }

    fn declare(&self, declare: &mut Declare) {
        let doc = "image: red, green and blue, one byte each, row by row from the top left corner";
        declare.slice_output::<u8>("image", self.picture.len() * PIXEL_BYTES, PICTURES, doc);
        declare.output::<ImageInfo>("info", "format of the images");
    }

    fn open(&self, setup: &mut Setup) -> Result<Self::Outputs, ConfigureError> {
        Ok(CameraOutputs { image: setup.slice_output("image")?, info: setup.output("info")? })
    }

    fn dress(&mut self, looks: &Looks) {
        self.looks = Some(looks.clone());
    }

    fn read(&mut self, pose: &Isometry3<f64>, scene: &mut RayScene, _: f64, values: &mut [f64]) {
        let Self { renderer, sensor, looks, picture } = self;
        let Some(looks) = looks else { return };
        renderer.render(pose, scene, looks, picture);
        for (value, colour) in values.iter_mut().zip(picture.iter()) {
            let [red, green, blue] = sensor.expose(colour);
            *value = f64::from(u32::from_le_bytes([red, green, blue, 0]));
        }
    }

    fn publish(&self, values: &[f64], source: u64, outputs: &mut CameraOutputs) -> Result<(), StepError> {
        // sent before the image, whose layout it describes
        if outputs.info.is_wired() {
            let Pinhole { width, height, focal_length, principal_point } = *self.renderer.pinhole();
            let mut info = outputs.info.loan()?;
            *info = ImageInfo {
                width,
                height,
                stride: width * PIXEL_BYTES as u32,
                encoding: ImageInfo::RGB_8,
                focal_length,
                principal_point,
            };
            info.publish_from(source)?;
        }
        let mut image = outputs.image.loan(values.len() * PIXEL_BYTES)?;
        for (pixel, value) in image.chunks_exact_mut(PIXEL_BYTES).zip(values) {
            pixel.copy_from_slice(&(*value as u32).to_le_bytes()[..PIXEL_BYTES]);
        }
        image.publish_from(source)
    }
}
