//! Detection of a coloured object in images, and tracking of its motion in the world.

use std::f64::consts::TAU;

use nalgebra::{Unit, Vector3};

use crate::channel::SettingError;
use crate::pinhole::Pinhole;

/// A range of colours by hue, regardless of brightness. A pixel matches if the direction of its levels in
/// colour space is in this range.
///
/// Under white light the levels of a matt surface are its colour times a scalar. Light and shadow therefore
/// do not change the angle between the levels and the colour.
///
/// ```
/// use motorium_sensors::blob::Hue;
///
/// let red = Hue::new([0.9, 0.1, 0.1], 0.1, 20.0)?;
/// assert!(red.has([225, 25, 25]) && red.has([90, 10, 10]));
/// assert!(!red.has([225, 120, 25]) && !red.has([9, 1, 1]), "orange; too dark");
/// # Ok::<(), motorium_sensors::channel::SettingError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hue {
    direction: Vector3<f64>,
    /// Square of the cosine of the largest angle.
    square: f64,
    /// Minimum level of the brightest channel.
    least: f64,
}

impl Hue {
    /// Creates a hue from a colour: red, green and blue, 0 to 1. A pixel matches if the angle between its
    /// levels and `colour`, both as vectors, is at most `tolerance` \[rad\], and its brightest channel is at
    /// least `least`, 0 to 255.
    ///
    /// # Errors
    /// [`SettingError`] if the colour is black or a number is out of range.
    pub fn new(colour: [f64; 3], tolerance: f64, least: f64) -> Result<Self, SettingError> {
        if let Some(part) = colour.iter().find(|part| !(0.0..=1.0).contains(*part)) {
            return Err(SettingError::new("colour", *part, "numbers from 0 to 1"));
        }
        let Some(direction) = Vector3::from(colour).try_normalize(1e-6) else {
            return Err(SettingError::new("colour", 0.0, "a colour other than black"));
        };
        if !(tolerance > 0.0 && tolerance < 1.0) {
            return Err(SettingError::new("tolerance", tolerance, "an angle above 0 and below 1 rad"));
        }
        if !(0.0..=255.0).contains(&least) {
            return Err(SettingError::new("least_level", least, "a level from 0 to 255"));
        }
        Ok(Self { direction, square: tolerance.cos().powi(2), least })
    }

    /// Returns `true` if a pixel has this hue.
    pub fn has(&self, pixel: [u8; 3]) -> bool {
        let levels = Vector3::from(pixel.map(f64::from));
        let along = levels.dot(&self.direction);
        levels.max() >= self.least && along * along >= self.square * levels.norm_squared()
    }
}

/// The pixels of one hue in an image, treated as one object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blob {
    /// Number of pixels.
    pub pixels: u32,
    /// Direction of the object's centre in camera axes: the mean pixel direction weighted by solid angle. For
    /// a sphere, this is the exact direction of the centre.
    pub direction: Unit<Vector3<f64>>,
    /// Solid angle covered by the pixels \[sr\].
    pub solid_angle: f64,
    /// `true` if a pixel is at the edge of the image; the object may then extend beyond the image.
    pub on_edge: bool,
}

impl Blob {
    /// Finds the pixels of a hue in an RGB image; `None` if fewer than `least` pixels match. `stride` is the
    /// number of bytes per row. Rows beyond the end of `picture` count as empty.
    ///
    /// ```
    /// use motorium_sensors::{blob::{Blob, Hue}, pinhole::Pinhole};
    ///
    /// let red = Hue::new([1.0, 0.0, 0.0], 0.1, 20.0)?;
    /// let picture = [0, 0, 0, 200, 0, 0, 0, 0, 0];
    /// let blob = Blob::find(&red, &Pinhole::new(3, 1, 1.0), &picture, 9, 1).unwrap();
    /// assert_eq!((blob.pixels, blob.direction.x), (1, 1.0));
    /// assert!(Blob::find(&red, &Pinhole::new(3, 1, 1.0), &picture, 9, 2).is_none());
    /// # Ok::<(), motorium_sensors::channel::SettingError>(())
    /// ```
    pub fn find(hue: &Hue, camera: &Pinhole, picture: &[u8], stride: usize, least: u32) -> Option<Self> {
        let (width, height) = (camera.width as usize, camera.height as usize);
        let (mut pixels, mut sum, mut solid_angle, mut on_edge) = (0, Vector3::zeros(), 0.0, false);
        // solid angle of a pixel on the optical axis
        let unit = 1.0 / (camera.focal_length[0] * camera.focal_length[1]);
        for (row, line) in picture.chunks(stride.max(1)).enumerate().take(height) {
            for (column, pixel) in line.chunks_exact(3).enumerate().take(width) {
                if !hue.has([pixel[0], pixel[1], pixel[2]]) {
                    continue;
                }
                let ray = camera.ray([column as f64, row as f64]);
                let length = ray.norm();
                let angle = unit / length.powi(3);
                pixels += 1;
                solid_angle += angle;
                sum += ray * (angle / length);
                on_edge |= row == 0 || column == 0 || row + 1 == height || column + 1 == width;
            }
        }
        if pixels < least.max(1) {
            return None;
        }
        Some(Self { pixels, direction: Unit::new_normalize(sum), solid_angle, on_edge })
    }

    /// Returns the distance \[m\] to the centre of a sphere of `radius` \[m\] that covers the solid angle:
    /// `radius / sin a` with `solid_angle = 2 pi (1 - cos a)`.
    pub fn distance_of_sphere(&self, radius: f64) -> f64 {
        let cos = (1.0 - self.solid_angle / TAU).max(0.0);
        radius / (1.0 - cos * cos).sqrt()
    }
}

/// An alpha-beta filter: estimates the position and velocity of a point that moves at constant velocity. The
/// gains are fixed and give critical damping.
///
/// With the smoothing `s` and the error `r` of the predicted position, a measurement after a time `dt` adds
/// `(1 - s^2) r` to the position and `(1 - s)^2 r / dt` to the velocity.
///
/// ```
/// use motorium_sensors::blob::PointFilter;
/// use nalgebra::Vector3;
///
/// let mut filter = PointFilter::new(0.5);
/// for step in 0..40 {
///     let time = 0.03 * f64::from(step);
///     filter.correct((time * 1e9) as u64, &Vector3::new(0.2 * time, 1.0, 0.0), 1.0);
/// }
/// let (position, velocity) = filter.predict(2_000_000_000).unwrap();
/// assert!((velocity.x - 0.2).abs() < 1e-6 && (position.x - 0.4).abs() < 1e-6);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct PointFilter {
    smoothing: f64,
    state: Option<(u64, Vector3<f64>, Vector3<f64>)>,
}

impl PointFilter {
    /// Creates an empty filter. `smoothing` ranges from 0 (no filtering) to below 1.
    pub fn new(smoothing: f64) -> Self {
        Self { smoothing, state: None }
    }

    /// Updates the filter with a position \[m\] measured at a time \[ns\]. After a gap of more than `longest`
    /// \[s\] the filter restarts with zero velocity.
    pub fn correct(&mut self, time_ns: u64, measured: &Vector3<f64>, longest: f64) {
        let since = self.state.map(|(last, ..)| time_ns.saturating_sub(last) as f64 * 1e-9);
        let predicted = self.predict(time_ns).zip(since.filter(|dt| *dt > 0.0 && *dt <= longest));
        self.state = Some(match predicted {
            Some(((position, velocity), dt)) => {
                let (error, rest) = (measured - position, 1.0 - self.smoothing);
                let gain = 1.0 - self.smoothing * self.smoothing;
                (time_ns, position + error * gain, velocity + error * (rest * rest / dt))
            }
            None => (time_ns, *measured, Vector3::zeros()),
        });
    }

    /// Predicts position \[m\] and velocity \[m/s\] at a time \[ns\]; `None` before the first measurement.
    pub fn predict(&self, time_ns: u64) -> Option<(Vector3<f64>, Vector3<f64>)> {
        let (last, position, velocity) = self.state?;
        // the difference is small, although the times are large
        let dt = time_ns.wrapping_sub(last) as i64 as f64 * 1e-9;
        Some((position + velocity * dt, velocity))
    }

    /// Returns the time of the last measurement \[ns\].
    pub fn last_ns(&self) -> Option<u64> {
        self.state.map(|(last, ..)| last)
    }

    /// Resets the filter to its empty state.
    pub fn reset(&mut self) {
        self.state = None;
    }
}
