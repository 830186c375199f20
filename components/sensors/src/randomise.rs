//! Sensor parameters sampled for every episode.

use motorium::units::TimeSpan;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::channel::{ErrorModel, SettingError};
use crate::noise::Noise;

/// Ranges of sensor parameters. Values are sampled uniformly from the seed at the start of every episode.
///
/// ```toml
/// noise   = [0.5, 2.0]
/// bias    = [0.0, 3.0]
/// latency = ["0 ms", "4 ms"]
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SensorRanges {
    /// Range of a factor on noises and bias walks. Both bounds must be between 0 and 100. Default 1.
    pub noise: Option<[f64; 2]>,
    /// Range of a factor on the standard deviations of biases and scale errors. Both bounds must be between 0
    /// and 100. Default 1.
    pub bias: Option<[f64; 2]>,
    /// Range of the latency, which replaces the sensor's configured latency. Default: the configured latency.
    pub latency: Option<[TimeSpan; 2]>,
}

/// Parameters of a sensor in one episode.
///
/// ```
/// use motorium_sensors::randomise::SensorRanges;
///
/// let ranges = SensorRanges { noise: Some([0.5, 2.0]), ..SensorRanges::default() };
/// let draw = ranges.draw(7, Default::default());
/// assert!((0.5..=2.0).contains(&draw.noise) && draw.bias == 1.0);
/// assert_eq!(draw, ranges.draw(7, Default::default()), "the same for the same seed");
/// assert_ne!(draw, ranges.draw(8, Default::default()));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorDraw {
    /// Scale of noises and bias walks.
    pub noise: f64,
    /// Scale of the standard deviations of biases and scale errors.
    pub bias: f64,
    /// Delay of the readings.
    pub latency: TimeSpan,
}

/// Channel number, within a seed, of the draws.
const DRAWS: u64 = 1 << 21;

impl SensorRanges {
    /// Returns `true` if nothing is sampled.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Checks every range.
    ///
    /// # Errors
    /// [`SettingError`] describes the first invalid range.
    pub fn check(&self) -> Result<(), SettingError> {
        for (name, range) in [("noise", self.noise), ("bias", self.bias)] {
            let Some([low, high]) = range else { continue };
            let good = |factor: f64| (0.0..=100.0).contains(&factor);
            if let Some(value) = [low, high].into_iter().find(|factor| !good(*factor)) {
                return Err(SettingError::new(format!("randomise.{name}"), value, "a factor from 0 to 100"));
            }
            if low > high {
                let setting = format!("randomise.{name}");
                return Err(SettingError::new(setting, low, "the lower factor first"));
            }
        }
        match self.latency {
            Some([low, high]) if low > high => {
                let value = low.as_secs_f64();
                Err(SettingError::new("randomise.latency", value, "the shorter time first"))
            }
            _ => Ok(()),
        }
    }

    /// Returns the maximum latency that can be sampled. `own` is the sensor's configured latency.
    pub fn longest(&self, own: TimeSpan) -> TimeSpan {
        self.latency.map_or(own, |[_, longest]| longest)
    }

    /// Samples the parameters for a seed. `own` is the sensor's configured latency. Each parameter depends
    /// only on the seed and its range.
    pub fn draw(&self, seed: u64, own: TimeSpan) -> SensorDraw {
        let share = |number: u64| Noise::new(seed, DRAWS + number).uniform();
        let factor = |range: Option<[f64; 2]>, number: u64| {
            range.map_or(1.0, |[low, high]| (low + (high - low) * share(number)).clamp(low, high))
        };
        let latency = self.latency.map_or(own, |[low, high]| TimeSpan {
            ns: low.ns + ((high.ns - low.ns) as f64 * share(2)).round() as u64,
        });
        SensorDraw { noise: factor(self.noise, 0), bias: factor(self.bias, 1), latency }
    }
}

impl SensorDraw {
    /// Returns parameters that leave a sensor with this latency unchanged.
    pub fn none(latency: TimeSpan) -> Self {
        Self { noise: 1.0, bias: 1.0, latency }
    }

    /// Returns the error model of a quantity, scaled for the episode.
    pub fn errors(&self, errors: &ErrorModel) -> ErrorModel {
        ErrorModel {
            noise: self.noise * errors.noise,
            bias_walk: self.noise * errors.bias_walk,
            bias: self.bias * errors.bias,
            scale_error: self.bias * errors.scale_error,
            ..*errors
        }
    }
}
