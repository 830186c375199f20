//! Positions on the earth: geodetic coordinates on the WGS 84 ellipsoid, and a tangent plane.

use nalgebra::{Matrix3, Vector3};

/// Semi-major axis of WGS 84 \[m\].
const MAJOR: f64 = 6_378_137.0;

/// Flattening of WGS 84.
const FLATTENING: f64 = 1.0 / 298.257_223_563;

/// First eccentricity, squared.
const ECCENTRICITY: f64 = FLATTENING * (2.0 - FLATTENING);

/// A position in geodetic coordinates on WGS 84.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geodetic {
    /// Latitude, degrees, north positive.
    pub latitude: f64,
    /// Longitude, degrees, east positive.
    pub longitude: f64,
    /// Height above the ellipsoid \[m\].
    pub altitude: f64,
}

impl Geodetic {
    /// Returns the position in earth-centred, earth-fixed axes \[m\]: x points to latitude and longitude 0, z
    /// to the north pole.
    ///
    /// ```
    /// use motorium_sensors::geodesy::Geodetic;
    ///
    /// let place = Geodetic { latitude: 0.0, longitude: 90.0, altitude: 100.0 }.earth_fixed();
    /// assert!((place.y - 6_378_237.0).abs() < 1e-6 && place.x.abs() < 1e-6);
    /// ```
    pub fn earth_fixed(&self) -> Vector3<f64> {
        let ((sin, cos), (sin_l, cos_l)) =
            (self.latitude.to_radians().sin_cos(), self.longitude.to_radians().sin_cos());
        let radius = MAJOR / (1.0 - ECCENTRICITY * sin * sin).sqrt();
        let across = (radius + self.altitude) * cos;
        Vector3::new(across * cos_l, across * sin_l, (radius * (1.0 - ECCENTRICITY) + self.altitude) * sin)
    }

    /// Returns the geodetic coordinates of a position in earth-centred, earth-fixed axes \[m\]. Bowring's
    /// method (*Survey Review* 23, 1976) is exact to micrometres from sea level to satellites after one
    /// iteration. The two iterations used here are exact up to rounding.
    pub fn of_earth_fixed(place: &Vector3<f64>) -> Self {
        let minor = MAJOR * (1.0 - FLATTENING);
        let second = ECCENTRICITY / (1.0 - ECCENTRICITY);
        let across = place.x.hypot(place.y);
        let mut reduced = (place.z * MAJOR).atan2(across * minor);
        let mut latitude = 0.0;
        for _ in 0..2 {
            let (sin, cos) = reduced.sin_cos();
            latitude =
                (place.z + second * minor * sin.powi(3)).atan2(across - ECCENTRICITY * MAJOR * cos.powi(3));
            reduced = ((1.0 - FLATTENING) * latitude.sin()).atan2(latitude.cos());
        }
        let (sin, cos) = latitude.sin_cos();
        let radius = MAJOR / (1.0 - ECCENTRICITY * sin * sin).sqrt();
        // Use the form of the height that avoids division by a small number.
        let altitude = across * cos + place.z * sin - radius * (1.0 - ECCENTRICITY * sin * sin);
        Self { latitude: latitude.to_degrees(), longitude: place.y.atan2(place.x).to_degrees(), altitude }
    }
}

/// A plane tangent to the earth: x points east, y north, z up.
///
/// ```
/// use motorium_sensors::geodesy::{Geodetic, TangentPlane};
/// use nalgebra::Vector3;
///
/// let lausanne = Geodetic { latitude: 46.52, longitude: 6.57, altitude: 400.0 };
/// let plane = TangentPlane::tangent_at(&lausanne);
/// let north = plane.geodetic(&Vector3::new(0.0, 100.0, 0.0));
/// assert!((north.latitude - 46.5209).abs() < 1e-5 && (north.longitude - 6.57).abs() < 1e-9);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TangentPlane {
    origin: Vector3<f64>,
    /// East, north and up as columns.
    axes: Matrix3<f64>,
}

impl TangentPlane {
    /// Creates the plane that touches the earth at this position, which is the origin of the plane.
    pub fn tangent_at(place: &Geodetic) -> Self {
        let ((sin, cos), (sin_l, cos_l)) =
            (place.latitude.to_radians().sin_cos(), place.longitude.to_radians().sin_cos());
        let east = Vector3::new(-sin_l, cos_l, 0.0);
        let north = Vector3::new(-sin * cos_l, -sin * sin_l, cos);
        let up = Vector3::new(cos * cos_l, cos * sin_l, sin);
        Self { origin: place.earth_fixed(), axes: Matrix3::from_columns(&[east, north, up]) }
    }

    /// Converts a position in the axes of the plane \[m\] to geodetic coordinates.
    pub fn geodetic(&self, place: &Vector3<f64>) -> Geodetic {
        Geodetic::of_earth_fixed(&(self.origin + self.axes * place))
    }

    /// Converts geodetic coordinates to a position in the axes of the plane \[m\].
    pub fn local(&self, place: &Geodetic) -> Vector3<f64> {
        self.axes.tr_mul(&(place.earth_fixed() - self.origin))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn geodetic_coordinates_survive_a_round_trip() {
        for latitude in [-90.0, -45.3, 0.0, 1e-7, 46.5, 89.9999, 90.0] {
            for longitude in [-179.0, -6.0, 0.0, 120.0] {
                for altitude in [-400.0, 0.0, 8848.0, 400e3] {
                    let place = Geodetic { latitude, longitude, altitude };
                    let found = Geodetic::of_earth_fixed(&place.earth_fixed());
                    assert!((found.earth_fixed() - place.earth_fixed()).norm() < 1e-7, "{place:?} {found:?}");
                    assert!((found.altitude - altitude).abs() < 1e-7, "{place:?} {found:?}");
                }
            }
        }
    }

    /// Published lengths of a degree on WGS 84: 111,319.49 m along the equator, 110,574.39 m for the first
    /// degree of latitude.
    #[test]
    fn degree_lengths_match_maps() {
        let equator = Geodetic { latitude: 0.0, longitude: 0.0, altitude: 0.0 };
        let plane = TangentPlane::tangent_at(&equator);
        let arc = |degrees: f64| plane.geodetic(&Vector3::new(degrees * 111_319.49, 0.0, 0.0)).longitude;
        assert!((arc(1e-3) / 1e-3 - 1.0).abs() < 1e-7);
        let north = Geodetic { latitude: 1e-3, ..equator };
        assert!((plane.local(&north).y / 110.574_276 - 1.0).abs() < 1e-6, "{}", plane.local(&north));
    }

    #[test]
    fn plane_deviates_from_the_ellipsoid_by_curvature() {
        let place = Geodetic { latitude: 46.52, longitude: 6.57, altitude: 0.0 };
        let plane = TangentPlane::tangent_at(&place);
        let far = plane.geodetic(&Vector3::new(0.0, 10e3, 0.0));
        assert!((far.altitude - 10e3_f64.powi(2) / (2.0 * 6.37e6)).abs() < 0.1, "{far:?}");
        assert!((plane.local(&far) - Vector3::new(0.0, 10e3, 0.0)).norm() < 1e-6);
    }
}
