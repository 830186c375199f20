//! Errors of a measured quantity: noise, bias and its random walk, scale, resolution, range.

use motorium::units::TimeSpan;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::noise::Noise;

/// Errors of a sensor of one quantity, the same for each axis, in the unit of the quantity. The default is an
/// ideal sensor.
///
/// ```text
/// y = clamp(resolution * round(((1 + s) x + b(t) + n) / resolution), -range, range)
/// ```
///
/// with noise `n` of deviation `noise` in each reading; a scale error `s` and a bias `b(0)` that are sampled
/// once, with the deviations `scale_error` and `bias`; and a random walk of the bias,
/// `db = bias_walk sqrt(dt) n`.
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
    /// Standard deviation of each reading. Equals a data sheet's noise density multiplied by the square root
    /// of the rate. Default 0.
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
    /// Step of the readings; 0 for continuous ones, the default.
    #[schemars(range(min = 0.0))]
    pub resolution: f64,
    /// Largest magnitude of a reading. Default: unlimited.
    #[schemars(range(min = 0.0))]
    pub range: Option<f64>,
}

/// A sensor setting is invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{setting} = {value}: expected {expected}")]
pub struct SettingError {
    /// The setting.
    pub setting: String,
    /// The value found.
    pub value: f64,
    /// The valid values.
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
    /// Time from sampling until the reading is available.
    pub latency: TimeSpan,
    /// Fraction of the readings that are lost, 0 to 1.
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
    /// [`SettingError`].
    pub fn check(&self) -> Result<(), SettingError> {
        if (0.0..=1.0).contains(&self.drop_out) {
            Ok(())
        } else {
            Err(SettingError::new("drop_out", self.drop_out, "a share from 0 to 1"))
        }
    }
}

/// A sensor of one quantity with several axes: its sampled errors and its noise.
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
    /// Creates a sensor with `axes` axes. `name` is the name of the setting in errors. `seed` and `number`
    /// select the noise, which is independent for each channel of a seed.
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

    /// Creates a sensor whose axes have separate errors. `streams` are the numbers of the seed's noise
    /// streams from which bias, scale, readings and walk are sampled.
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

    /// Converts the true values, one per axis, to a reading. `dt` \[s\] is the time since the last reading.
    ///
    /// # Panics
    /// If the number of axes differs.
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
