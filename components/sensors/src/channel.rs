//! Errors of a measured quantity: noise, bias and its random walk, scale, resolution, range.

use motorium::units::TimeSpan;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::noise::Noise;

/// Error model of a sensor of one quantity. Values are in the unit of the quantity, and each value applies to
/// all axes. The default is an ideal sensor.
///
/// ```text
/// y = clamp(resolution * round(((1 + s) x + b(t) + n) / resolution), -range, range)
/// ```
///
/// Here `n` is standard normal noise times `noise`, sampled for each reading. The scale error `s` and the
/// bias `b(0)` are sampled once, with the standard deviations `scale_error` and `bias`. The bias then follows
/// a random walk, `db = bias_walk sqrt(dt) n`, with standard normal `n`.
///
/// ```toml
/// noise     = 0.02
/// bias      = 0.05
/// bias_walk = 1e-4
/// range     = 157.0
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ErrorModel {
    /// Standard deviation of the noise of each reading. Equals a data sheet's noise density multiplied by the
    /// square root of the rate. Default 0.
    #[schemars(range(min = 0.0))]
    pub noise: f64,
    /// Standard deviation of the bias at the start. Default 0.
    #[schemars(range(min = 0.0))]
    pub bias: f64,
    /// Standard deviation of the change of the bias in one second. Default 0.
    #[schemars(range(min = 0.0))]
    pub bias_walk: f64,
    /// Standard deviation of the scale error, as a fraction of the reading. Default 0.
    #[schemars(range(min = 0.0))]
    pub scale_error: f64,
    /// Increment to which readings are rounded. Default 0: no rounding.
    #[schemars(range(min = 0.0))]
    pub resolution: f64,
    /// Maximum magnitude of a reading. A larger value saturates at this magnitude. Default: unlimited.
    #[schemars(range(min = 0.0))]
    pub range: Option<f64>,
}

/// The value of a sensor setting is out of range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{setting} = {value}: expected {expected}")]
pub struct SettingError {
    /// Name of the setting.
    pub setting: String,
    /// The value found.
    pub value: f64,
    /// Valid values, as a phrase.
    pub expected: &'static str,
}

impl SettingError {
    /// Creates an error about the value of a setting.
    pub fn new(setting: impl Into<String>, value: f64, expected: &'static str) -> Self {
        Self { setting: setting.into(), value, expected }
    }
}

/// Timing of readings, common to all sensors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Timing {
    /// Delay from sampling until the reading is available.
    pub latency: TimeSpan,
    /// Fraction of the readings that are dropped, 0 to 1.
    pub drop_out: f64,
}

impl Timing {
    /// Returns the same timing with another latency.
    pub(crate) fn late(self, latency: TimeSpan) -> Self {
        Self { latency, ..self }
    }

    /// Checks that `drop_out` is from 0 to 1.
    ///
    /// # Errors
    /// [`SettingError`] if `drop_out` is out of range.
    pub fn check(&self) -> Result<(), SettingError> {
        if (0.0..=1.0).contains(&self.drop_out) {
            Ok(())
        } else {
            Err(SettingError::new("drop_out", self.drop_out, "a fraction from 0 to 1"))
        }
    }
}

/// A sensor of one quantity with one or more axes: adds sampled errors and noise to true values.
///
/// ```
/// use motorium_sensors::channel::{Channel, ErrorModel};
///
/// let errors = ErrorModel { resolution: 0.5, range: Some(2.0), ..ErrorModel::default() };
/// let mut channel = Channel::new("force", &errors, 2, 0, 0)?;
/// let mut reading = [0.8, -7.0];
/// channel.measure(1e-3, &mut reading);
/// assert_eq!(reading, [1.0, -2.0]);
/// # Ok::<(), motorium_sensors::channel::SettingError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Channel {
    /// One model for all axes, or one for each axis.
    errors: Vec<ErrorModel>,
    noise: Noise,
    walk: Noise,
    bias: Vec<f64>,
    scale: Vec<f64>,
}

impl Channel {
    /// Creates a sensor with `axes` axes and the same errors on all axes. `name` is the name of the setting
    /// in error messages. `seed` and `number` select the noise, which is independent for each channel of a
    /// seed.
    ///
    /// # Errors
    /// [`SettingError`] if a number is negative or not finite.
    pub fn new(
        name: &str,
        errors: &ErrorModel,
        axes: usize,
        seed: u64,
        number: u64,
    ) -> Result<Self, SettingError> {
        let first = 16 * number;
        Self::from_parts(name, vec![*errors], axes, seed, [first, first + 1, first + 2, first + 3])
    }

    /// Creates a sensor with separate errors for each axis. `streams` lists the numbers of the seed's noise
    /// streams: one stream each for bias, scale error, noise of the readings and bias walk, in this order.
    ///
    /// # Errors
    /// [`SettingError`] if a number is negative or not finite.
    pub fn each(
        name: &str,
        errors: Vec<ErrorModel>,
        seed: u64,
        streams: [u64; 4],
    ) -> Result<Self, SettingError> {
        let axes = errors.len();
        Self::from_parts(name, errors, axes, seed, streams)
    }

    fn from_parts(
        name: &str,
        errors: Vec<ErrorModel>,
        axes: usize,
        seed: u64,
        [bias, scale, noise, walk]: [u64; 4],
    ) -> Result<Self, SettingError> {
        for model in &errors {
            let ErrorModel { noise, bias, bias_walk, scale_error, resolution, range } = *model;
            for (setting, value) in [
                ("noise", noise),
                ("bias", bias),
                ("bias_walk", bias_walk),
                ("scale_error", scale_error),
                ("resolution", resolution),
                ("range", range.unwrap_or(0.0)),
            ] {
                if !(0.0..=1e12).contains(&value) {
                    let setting =
                        if name.is_empty() { setting.to_owned() } else { format!("{name}.{setting}") };
                    return Err(SettingError::new(setting, value, "a number from 0 to 1e12"));
                }
            }
        }
        let of_axis = || errors.iter().cycle().take(axes);
        let mut draws = Noise::new(seed, bias);
        let bias = of_axis().map(|model| model.bias * draws.normal()).collect();
        let mut draws = Noise::new(seed, scale);
        let scale = of_axis().map(|model| 1.0 + model.scale_error * draws.normal()).collect();
        Ok(Self { noise: Noise::new(seed, noise), walk: Noise::new(seed, walk), bias, scale, errors })
    }

    /// Replaces the true value of each axis by a reading. `dt` \[s\] is the time since the last reading.
    ///
    /// # Panics
    /// If the number of values differs from the number of axes.
    pub fn measure(&mut self, dt: f64, values: &mut [f64]) {
        assert_eq!(values.len(), self.bias.len(), "axes of the channel");
        let errors = std::mem::take(&mut self.errors);
        match errors.as_slice() {
            [one] => self.measure_by(std::iter::repeat(one), dt, values),
            each => self.measure_by(each.iter(), dt, values),
        }
        self.errors = errors;
    }

    fn measure_by<'a>(&mut self, errors: impl Iterator<Item = &'a ErrorModel>, dt: f64, values: &mut [f64]) {
        let Self { noise, walk, bias, scale, .. } = self;
        for (((value, bias), scale), errors) in values.iter_mut().zip(bias).zip(scale).zip(errors) {
            if errors.bias_walk > 0.0 {
                *bias += errors.bias_walk * dt.max(0.0).sqrt() * walk.normal();
            }
            *value = *scale * *value + *bias;
            if errors.noise > 0.0 {
                *value += errors.noise * noise.normal();
            }
            if errors.resolution > 0.0 {
                *value = (*value / errors.resolution).round() * errors.resolution;
            }
            if let Some(range) = errors.range {
                *value = value.clamp(-range, range);
            }
        }
    }

    /// Returns the current bias of each axis.
    pub fn bias(&self) -> &[f64] {
        &self.bias
    }
}
