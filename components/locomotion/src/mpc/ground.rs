//! A planar model of the ground under the feet.

use nalgebra::{Matrix2, Matrix3, Rotation3, Vector2, Vector3};

/// Steepest slope of a fitted plane: the tangent of 35 degrees.
const STEEPEST: f64 = 0.7;

/// Minimum spread of the feet for the estimation of a slope \[m2\].
const LEAST_SPREAD: f64 = 1e-4;

/// Ground model used by the planner.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum GroundModel {
    /// Level, at the mean height of the stance feet.
    #[default]
    Level,
    /// A plane with this unit normal through the mean position of the stance feet.
    Normal(Vector3<f64>),
    /// A plane fitted to the last stance positions of the feet, smoothed with this time constant \[s\].
    Fitted {
        /// Time constant of the height and the slopes \[s\]; 0 disables smoothing.
        smoothing: f64,
    },
}

/// A plane `z = height + slope . (x, y)`, which cannot be vertical.
///
/// ```
/// use motorium_locomotion::mpc::GroundPlane;
/// use nalgebra::{Vector2, Vector3};
///
/// let mut ground = GroundPlane::default();
/// let feet = [[0.2, 0.1, 0.02], [0.2, -0.1, 0.02], [-0.2, 0.1, -0.02], [-0.2, -0.1, -0.02]];
/// let feet = feet.map(Vector3::from);
/// ground.fit(feet.iter().copied(), 1.0);
/// assert!((ground.height(&Vector2::new(1.0, 0.0)) - 0.1).abs() < 1e-12);
/// assert!((ground.normal() - Vector3::new(-0.1, 0.0, 1.0).normalize()).norm() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GroundPlane {
    height: f64,
    slope: Vector2<f64>,
}

impl GroundPlane {
    /// Creates the plane through `point` with this normal.
    pub fn through(point: &Vector3<f64>, normal: &Vector3<f64>) -> Self {
        let slope = -normal.xy() / normal.z.max(f64::MIN_POSITIVE);
        Self { height: point.z - slope.dot(&point.xy()), slope }
    }

    /// Returns the height at a horizontal position \[m\].
    pub fn height(&self, place: &Vector2<f64>) -> f64 {
        self.height + self.slope.dot(place)
    }

    /// Returns the slopes along x and y.
    pub fn slope(&self) -> &Vector2<f64> {
        &self.slope
    }

    /// Returns the unit normal, which points up.
    pub fn normal(&self) -> Vector3<f64> {
        Vector3::new(-self.slope.x, -self.slope.y, 1.0).normalize()
    }

    /// Returns the shortest rotation from the vertical to the normal.
    pub fn tilt(&self) -> Rotation3<f64> {
        let normal = self.normal();
        // about the horizontal axis across the slope
        let across = Vector3::new(-normal.y, normal.x, 0.0);
        let sine = across.norm();
        match sine > 0.0 {
            true => Rotation3::new(across * (sine.atan2(normal.z) / sine)),
            false => Rotation3::identity(),
        }
    }

    /// Returns two tangents and the normal of the plane, as columns.
    pub fn axes(&self) -> Matrix3<f64> {
        self.tilt().into_inner()
    }

    /// Moves the plane by the fraction `share` (0 to 1) towards the least-squares plane of the given
    /// positions. If the positions coincide or are collinear, slopes that they do not determine are kept.
    pub fn fit(&mut self, places: impl Iterator<Item = Vector3<f64>> + Clone, share: f64) {
        let (sum, count) =
            places.clone().fold((Vector3::zeros(), 0.0), |(sum, n), place| (sum + place, n + 1.0));
        if count == 0.0 {
            return;
        }
        let mean: Vector3<f64> = sum / count;
        let (mut spread, mut rise) = (Matrix2::zeros(), Vector2::zeros());
        for place in places {
            let from = place - mean;
            spread += from.xy() * from.xy().transpose() / count;
            rise += from.xy() * (from.z / count);
        }
        let wide = spread.symmetric_eigenvalues().min() > LEAST_SPREAD;
        let found = spread.try_inverse().filter(|_| wide).map(|inverse| inverse * rise);
        let mut slope = found.unwrap_or(self.slope);
        let steep = slope.norm();
        if steep > STEEPEST {
            slope *= STEEPEST / steep;
        }
        // smooth the height at the feet, not at the distant origin
        let height = self.height(&mean.xy());
        self.slope += (slope - self.slope) * share;
        let height = height + (mean.z - height) * share;
        self.height = height - self.slope.dot(&mean.xy());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle(centre: [f64; 2], ground: impl Fn(f64, f64) -> f64) -> [Vector3<f64>; 4] {
        [[0.2, 0.15], [0.2, -0.15], [-0.2, 0.15], [-0.2, -0.15]].map(|[x, y]| {
            let (x, y) = (centre[0] + x, centre[1] + y);
            Vector3::new(x, y, ground(x, y))
        })
    }

    #[test]
    fn four_feet_determine_the_slope() {
        let slope = |x: f64, y: f64| 0.3 + 0.2 * x - 0.1 * y;
        for centre in [[0.0, 0.0], [50.0, -20.0]] {
            let mut ground = GroundPlane::default();
            ground.fit(rectangle(centre, slope).into_iter(), 1.0);
            assert!((ground.slope() - Vector2::new(0.2, -0.1)).norm() < 1e-9);
            assert!((ground.height(&Vector2::new(1.0, 2.0)) - slope(1.0, 2.0)).abs() < 1e-9);
            let normal = ground.normal();
            assert!((ground.tilt() * Vector3::z() - normal).norm() < 1e-12);
            assert!((ground.axes().determinant() - 1.0).abs() < 1e-12);
            // the rotation axis is horizontal
            assert!(ground.tilt().scaled_axis().z.abs() < 1e-12);
            let same = GroundPlane::through(&rectangle(centre, slope)[0], &normal);
            assert!((same.slope() - ground.slope()).norm() < 1e-9);
        }
    }

    #[test]
    fn collinear_feet_change_the_height_but_not_the_slope() {
        let mut ground = GroundPlane::through(&Vector3::zeros(), &Vector3::new(-0.1, 0.0, 1.0));
        let line = [Vector3::new(0.2, 0.15, 0.5), Vector3::new(-0.2, -0.15, 0.5)];
        ground.fit(line.into_iter(), 1.0);
        assert!((ground.slope() - Vector2::new(0.1, 0.0)).norm() < 1e-12);
        assert!((ground.height(&Vector2::zeros()) - 0.5).abs() < 1e-12);
        ground.fit(core::iter::empty(), 1.0);
        assert!((ground.height(&Vector2::zeros()) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn fit_moves_by_a_fraction_and_rejects_a_wall() {
        let mut ground = GroundPlane::default();
        let feet = rectangle([10.0, 0.0], |x, _| 0.1 * (x - 10.0) + 0.2);
        ground.fit(feet.into_iter(), 0.5);
        assert!((ground.height(&Vector2::new(10.0, 0.0)) - 0.1).abs() < 1e-12);
        assert!((ground.slope().x - 0.05).abs() < 1e-12);
        for _ in 0..60 {
            ground.fit(rectangle([0.0, 0.0], |x, _| 5.0 * x).into_iter(), 0.5);
        }
        assert!((ground.slope().x - STEEPEST).abs() < 1e-9);
    }
}
