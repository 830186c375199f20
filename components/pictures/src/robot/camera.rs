//! Camera: a parallel projection that fits the scene into the picture.

use std::str::FromStr;

use nalgebra::{Point3, Vector3};

/// Text of the [`View`] from the right, a little in front and above.
pub const OBLIQUE: &str = "-50,20";

/// Direction towards the camera, seen from the robot.
///
/// A view is parsed from `front`, `back`, `left`, `right` or `top`, or from azimuth and elevation in degrees,
/// such as [`OBLIQUE`].
///
/// ```
/// use motorium_pictures::robot::View;
///
/// assert_eq!("left".parse::<View>(), "90,0".parse());
/// assert!("above".parse::<View>().is_err());
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// Angle about z, from the x axis towards y \[rad\].
    azimuth: f64,
    /// Angle above the horizon \[rad\].
    elevation: f64,
}

/// The text of a view is neither a name nor two angles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "expected front, back, left, right, top or AZIMUTH,ELEVATION in degrees such as -50,20 (elevation from -90 to 90)"
)]
pub struct ParseViewError;

impl FromStr for View {
    type Err = ParseViewError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let (azimuth, elevation): (f64, f64) = match text {
            "front" => (0.0, 0.0),
            "back" => (180.0, 0.0),
            "left" => (90.0, 0.0),
            "right" => (-90.0, 0.0),
            "top" => (-90.0, 90.0),
            _ => {
                let (azimuth, elevation) = text.split_once(',').ok_or(ParseViewError)?;
                let number = |text: &str| text.trim().parse().map_err(|_| ParseViewError);
                (number(azimuth)?, number(elevation)?)
            }
        };
        if !azimuth.is_finite() || !(-90.0..=90.0).contains(&elevation) {
            return Err(ParseViewError);
        }
        Ok(Self { azimuth: azimuth.to_radians(), elevation: elevation.to_radians() })
    }
}

/// A parallel projection.
#[derive(Debug, Clone)]
pub(super) struct Camera {
    /// Direction towards the camera.
    pub(super) eye: Vector3<f64>,
    right: Vector3<f64>,
    up: Vector3<f64>,
    scale: f64,
    offset: (f64, f64),
    pub(super) width: f64,
    pub(super) height: f64,
}

impl Camera {
    /// Creates a projection that fits points.
    pub(super) fn around(
        view: View,
        (width, height): (f64, f64),
        points: impl Iterator<Item = Point3<f64>>,
    ) -> Self {
        let (sa, ca) = view.azimuth.sin_cos();
        let (se, ce) = view.elevation.sin_cos();
        let mut camera = Self {
            eye: Vector3::new(ce * ca, ce * sa, se),
            right: Vector3::new(-sa, ca, 0.0),
            up: Vector3::new(-se * ca, -se * sa, ce),
            scale: 1.0,
            offset: (0.0, 0.0),
            width,
            height,
        };
        let points: Vec<_> = points.map(|point| camera.project(&point)).collect();
        let span = |pick: fn(&(f64, f64)) -> f64| {
            let low = points.iter().map(pick).fold(f64::INFINITY, f64::min);
            let high = points.iter().map(pick).fold(f64::NEG_INFINITY, f64::max);
            if low <= high { (low, high) } else { (-0.5, 0.5) }
        };
        let ((left, right), (top, bottom)) = (span(|point| point.0), span(|point| point.1));
        // A margin of one eighth; points without extent get a scale of at most one metre per ten centimetres.
        let fit = |room: f64, extent: f64| 0.82 * room / extent.max(1e-3);
        camera.scale = fit(width, right - left).min(fit(height, bottom - top));
        camera.offset = (
            width / 2.0 - camera.scale * (left + right) / 2.0,
            height / 2.0 - camera.scale * (top + bottom) / 2.0,
        );
        camera
    }

    /// Returns the picture coordinates of a world point: right, and down.
    pub(super) fn project(&self, point: &Point3<f64>) -> (f64, f64) {
        (
            self.offset.0 + self.scale * self.right.dot(&point.coords),
            self.offset.1 - self.scale * self.up.dot(&point.coords),
        )
    }

    /// Returns the width and height of the picture in pixels.
    pub(super) fn dots(&self) -> [usize; 2] {
        [self.width, self.height].map(|side| side.round() as usize)
    }

    /// Returns the point of the world at these coordinates of the picture, in the plane through the origin.
    pub(super) fn point(&self, x: f64, y: f64) -> Point3<f64> {
        let (right, up) = ((x - self.offset.0) / self.scale, (self.offset.1 - y) / self.scale);
        Point3::from(self.right * right + self.up * up)
    }

    /// Returns this projection, moved with the objects it shows.
    pub(super) fn moved(&self, by: &Vector3<f64>) -> Self {
        let offset =
            (self.offset.0 - self.scale * self.right.dot(by), self.offset.1 + self.scale * self.up.dot(by));
        Self { offset, ..self.clone() }
    }

    /// Returns the length in the world, m, of this many units in the picture.
    pub(super) fn metres(&self, units: f64) -> f64 {
        units / self.scale
    }
}

#[cfg(test)]
mod tests {
    use super::View;

    #[test]
    fn views_have_names_or_angles() {
        assert_eq!("left".parse::<View>(), "90,0".parse());
        assert_eq!("-50, 20".parse::<View>().unwrap().elevation, 20.0_f64.to_radians());
        for text in ["above", "10", "0,91", "nan,0", ""] {
            assert!(text.parse::<View>().unwrap_err().to_string().contains("AZIMUTH,ELEVATION"), "{text}");
        }
    }
}
