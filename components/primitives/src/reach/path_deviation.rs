//! Deviation of a motion from a path.

use nalgebra::Vector3;

/// Root mean square and maximum deviation of points from a path, accumulated point by point without
/// allocation.
///
/// ```
/// use motorium_primitives::reach::PathDeviation;
/// use nalgebra::Vector3;
///
/// let path = [Vector3::zeros(), Vector3::x(), 2.0 * Vector3::x()];
/// let mut deviation = PathDeviation::default();
/// // half way in time, but only at 0.8, and 0.1 beside the path
/// deviation.observe(&path, 0.5, Vector3::new(0.8, 0.1, 0.0));
/// assert!((deviation.rms().unwrap() - 0.1).abs() < 1e-12);
/// assert!((deviation.timed_rms().unwrap() - 0.05_f64.sqrt()).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathDeviation {
    samples: u64,
    timed_squares: f64,
    near_squares: f64,
    largest: f64,
}

impl PathDeviation {
    /// Adds a point (m) passed at `progress`, 0 to 1, along a path of at least two points (m) that are evenly
    /// spaced in time. A shorter path is ignored.
    pub fn observe(&mut self, path: &[Vector3<f64>], progress: f64, point: Vector3<f64>) {
        if path.len() < 2 {
            return;
        }
        let at = progress.clamp(0.0, 1.0) * (path.len() - 1) as f64;
        let before = (at as usize).min(path.len() - 2);
        let expected = path[before].lerp(&path[before + 1], at - before as f64);
        let near =
            path.windows(2).map(|pair| squared_distance(point, pair[0], pair[1])).fold(f64::MAX, f64::min);
        self.samples += 1;
        self.timed_squares += (point - expected).norm_squared();
        self.near_squares += near;
        self.largest = self.largest.max(near.sqrt());
    }

    /// Returns the root mean square distance from the nearest point of the path, m; `None` before the first
    /// point.
    pub fn rms(&self) -> Option<f64> {
        self.mean(self.near_squares)
    }

    /// Returns the root mean square distance from the point of the path at the same progress, m; `None`
    /// before the first point.
    pub fn timed_rms(&self) -> Option<f64> {
        self.mean(self.timed_squares)
    }

    /// Returns the largest distance from the nearest point of the path, m; `None` before the first point.
    pub fn largest(&self) -> Option<f64> {
        (self.samples > 0).then_some(self.largest)
    }

    fn mean(&self, squares: f64) -> Option<f64> {
        (self.samples > 0).then(|| (squares / self.samples as f64).sqrt())
    }
}

/// Squared distance of a point from the segment between two others.
fn squared_distance(point: Vector3<f64>, from: Vector3<f64>, to: Vector3<f64>) -> f64 {
    let (along, off) = (to - from, point - from);
    let length = along.norm_squared();
    let share = if length > 0.0 { (off.dot(&along) / length).clamp(0.0, 1.0) } else { 0.0 };
    (off - share * along).norm_squared()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn segment_distance_is_correct_beyond_its_ends() {
        let (from, to) = (Vector3::zeros(), Vector3::new(2.0, 0.0, 0.0));
        for (point, expected) in
            [([1.0, 3.0, 0.0], 9.0), ([-1.0, 0.0, 0.0], 1.0), ([3.0, 0.0, 2.0], 5.0), ([0.5, 0.0, 0.0], 0.0)]
        {
            assert!((squared_distance(Vector3::from(point), from, to) - expected).abs() < 1e-12);
        }
        assert!((squared_distance(Vector3::x(), from, from) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn deviation_averages_points_and_keeps_the_largest() {
        let path = [Vector3::zeros(), Vector3::x()];
        let mut deviation = PathDeviation::default();
        assert_eq!((deviation.rms(), deviation.timed_rms(), deviation.largest()), (None, None, None));
        deviation.observe(&path[..1], 0.5, Vector3::y());
        assert_eq!(deviation.rms(), None);
        deviation.observe(&path, 0.25, Vector3::new(0.25, 0.3, 0.0));
        deviation.observe(&path, 2.0, Vector3::new(0.6, 0.0, 0.4));
        assert!((deviation.rms().unwrap() - (0.25_f64 / 2.0).sqrt()).abs() < 1e-12);
        assert!((deviation.timed_rms().unwrap() - ((0.09 + 0.32) / 2.0_f64).sqrt()).abs() < 1e-12);
        assert!((deviation.largest().unwrap() - 0.4).abs() < 1e-12);
    }
}
