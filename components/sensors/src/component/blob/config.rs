//! The `config` table of `estimator.blob`.

use motorium::prelude::*;
use schemars::JsonSchema;
use serde::Deserialize;

use super::super::readings::refused;
use crate::blob::Hue;
use crate::channel::SettingError;
use crate::component::robot::Mount;

/// Configuration of `estimator.blob`.
///
/// ```toml
/// camera = { frame = "panda_hand", position = [0.0, 0.0, 0.1], rpy = [0.0, -1.5708, 0.0] }
/// colour = [0.9, 0.1, 0.1]
/// radius = 0.03
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BlobConfig {
    /// Mount of the camera on the robot or in the `world`; the camera looks along its x axis. Default: the
    /// root link.
    #[serde(default)]
    pub camera: Mount,
    /// Colour of the object: red, green and blue, 0 to 1. The brightness of this colour is ignored.
    pub colour: [f64; 3],
    /// Maximum angle between the colour of a pixel and `colour` as vectors (rad). Default 0.15.
    #[serde(default = "tolerance")]
    pub tolerance: f64,
    /// Minimum level, 0 to 255, of the brightest channel of a matching pixel. Default 30.
    #[serde(default = "least_level")]
    pub least_level: f64,
    /// Minimum number of pixels of an object. Default 8.
    #[serde(default = "least_pixels")]
    pub least_pixels: u32,
    /// Radius of the object, assumed to be a sphere (m). The distance to the object is computed from this
    /// radius. Default: the object is assumed at `distance`.
    #[serde(default)]
    pub radius: Option<f64>,
    /// Assumed distance to the object if `radius` is not set (m). Default 1.
    #[serde(default = "distance")]
    pub distance: f64,
    /// Smoothing of position and velocity, from 0 (none) to below 1. Default 0.5.
    #[serde(default = "smoothing")]
    pub smoothing: f64,
    /// Time without a detection after which publication stops. Default 500 ms.
    #[serde(default = "lost_after")]
    pub lost_after: TimeSpan,
    /// Duration of the buffer of camera poses, which limits the age of an image. Default 200 ms.
    #[serde(default = "history")]
    pub history: TimeSpan,
    /// Time from the first detection until errors are scored. Default 1 s.
    #[serde(default = "settle")]
    pub settle: TimeSpan,
}

fn tolerance() -> f64 {
    0.15
}

fn least_level() -> f64 {
    30.0
}

fn least_pixels() -> u32 {
    8
}

fn distance() -> f64 {
    1.0
}

fn smoothing() -> f64 {
    0.5
}

fn lost_after() -> TimeSpan {
    TimeSpan { ns: 500_000_000 }
}

fn history() -> TimeSpan {
    TimeSpan { ns: 200_000_000 }
}

fn settle() -> TimeSpan {
    TimeSpan { ns: 1_000_000_000 }
}

impl BlobConfig {
    /// Returns the hue if all numbers are in range.
    pub(super) fn check(&self) -> Result<Hue, ConfigError> {
        let length = |setting: &str, value: f64| {
            let good = value > 0.0 && value <= 1e6;
            let error = || refused(SettingError::new(setting, value, "a length above 0, up to 1e6 m"));
            good.then_some(()).ok_or_else(error)
        };
        self.radius.map_or(Ok(()), |radius| length("radius", radius))?;
        length("distance", self.distance)?;
        if !(0.0..1.0).contains(&self.smoothing) {
            return Err(refused(SettingError::new(
                "smoothing",
                self.smoothing,
                "a number from 0 to below 1",
            )));
        }
        if self.history.ns > 10_000_000_000 {
            let message = format!("{} is too long, expected at most 10 s", self.history);
            return Err(ConfigError::key("history", message));
        }
        Hue::new(self.colour, self.tolerance, self.least_level).map_err(refused)
    }
}
