//! Distance sensors: ray directions and errors of the readings.

use std::f64::consts::{PI, TAU};

use nalgebra::{Unit, Vector3};

use crate::channel::{Channel, ErrorModel, SettingError};
use crate::noise::Noise;

/// Channel number, within a seed, of the noise of lost returns.
const LOST: u64 = 1 << 21;

/// Settings of a [`RangeModel`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RangeSettings {
    /// Errors of a distance, m.
    pub distance: ErrorModel,
    /// Minimum measurable distance, m. Closer surfaces give no return.
    pub least: f64,
    /// Maximum measurable distance, m.
    pub most: f64,
    /// Fraction of the rays without a return, 0 to 1.
    pub lost: f64,
}

/// Errors of the distances that a sensor measures along its rays.
///
/// ```
/// use motorium_sensors::channel::ErrorModel;
/// use motorium_sensors::ranging::{RangeModel, RangeSettings};
///
/// let distance = ErrorModel { resolution: 0.01, ..ErrorModel::default() };
/// let settings = RangeSettings { distance, least: 0.1, most: 10.0, lost: 0.0 };
/// let mut model = RangeModel::new(&settings, 3, 0)?;
/// let mut readings = [2.504, 0.05, f64::INFINITY];
/// model.measure(0.1, &mut readings);
/// assert_eq!(readings, [2.5, 20.0, 20.0], "20: no return");
/// # Ok::<(), motorium_sensors::channel::SettingError>(())
/// ```
#[derive(Clone, Debug)]
pub struct RangeModel {
    settings: RangeSettings,
    channel: Channel,
    draws: Noise,
}

impl RangeModel {
    /// Creates the error model of a sensor with this number of rays. Biases, scale errors and noise are
    /// sampled from the seed.
    ///
    /// # Errors
    /// [`SettingError`] if a number is out of range.
    pub fn new(settings: &RangeSettings, rays: usize, seed: u64) -> Result<Self, SettingError> {
        let RangeSettings { distance, least, most, lost } = *settings;
        if !(0.0..=1e6).contains(&most) || most == 0.0 {
            return Err(SettingError::new("most", most, "a distance above 0, up to 1e6 m"));
        }
        if !(0.0..most).contains(&least) {
            return Err(SettingError::new("least", least, "a distance from 0 up, below `most`"));
        }
        if !(0.0..=1.0).contains(&lost) {
            return Err(SettingError::new("lost", lost, "a fraction from 0 to 1"));
        }
        let channel = Channel::new("distance", &distance, rays, seed, 0)?;
        Ok(Self { settings: *settings, channel, draws: Noise::new(seed, LOST) })
    }

    /// Returns the reading of a ray without a return \[m\]: twice the maximum distance.
    pub fn no_return(&self) -> f64 {
        2.0 * self.settings.most
    }

    /// Replaces the true distance of each ray \[m\] by a reading. The true distance is infinite without a
    /// hit. `dt` \[s\] is the time since the last reading.
    ///
    /// # Panics
    /// If the number of distances differs from the number of rays.
    pub fn measure(&mut self, dt: f64, distances: &mut [f64]) {
        self.channel.measure(dt, distances);
        let RangeSettings { least, most, lost, .. } = self.settings;
        for distance in distances {
            // one draw per ray, so that other draws do not change with the fraction
            let gone = lost > 0.0 && self.draws.uniform() < lost;
            if gone || !(least..=most).contains(distance) {
                *distance = 2.0 * most;
            }
        }
    }
}

/// Returns the unit vector with an azimuth, from x towards y, and an elevation above the xy plane \[rad\].
///
/// ```
/// use motorium_sensors::ranging::direction;
///
/// let left = direction(std::f64::consts::FRAC_PI_2, 0.0);
/// assert!((left.y - 1.0).abs() < 1e-12);
/// ```
pub fn direction(azimuth: f64, elevation: f64) -> Unit<Vector3<f64>> {
    let (across, up) = (elevation.cos(), elevation.sin());
    Unit::new_normalize(Vector3::new(across * azimuth.cos(), across * azimuth.sin(), up))
}

/// Returns the azimuths \[rad\] of `count` rays, from right to left. The azimuths cover a field of view
/// \[rad\] centred on x, with a ray at each end. For a full circle, the azimuths start opposite to x, and no
/// direction occurs twice.
///
/// ```
/// use motorium_sensors::ranging::azimuths;
///
/// assert_eq!(azimuths(1.0, 3).collect::<Vec<_>>(), [-0.5, 0.0, 0.5]);
/// let turn: Vec<f64> = azimuths(std::f64::consts::TAU, 4).map(f64::to_degrees).collect();
/// assert_eq!(turn, [-180.0, -90.0, 0.0, 90.0]);
/// ```
pub fn azimuths(field_of_view: f64, count: usize) -> impl Iterator<Item = f64> {
    let whole = field_of_view > TAU - 1e-6;
    let (start, step) = match count {
        _ if whole => (-PI, TAU / count as f64),
        1 => (0.0, 0.0),
        _ => (-0.5 * field_of_view, field_of_view / (count - 1) as f64),
    };
    (0..count).map(move |index| start + step * index as f64)
}
