//! The linear Kalman filter.

use nalgebra::{SMatrix, SVector};

/// The covariance of the innovation is not positive definite.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the covariance of the innovation is not positive definite, probably from a noise-free measurement of an exactly known state"
)]
pub struct SingularInnovation;

/// A linear Kalman filter with `N` states.
///
/// ```text
/// predict:  x = F x + u         P = F P F' + Q
/// update:   K = P H' S^-1       S = H P H' + R     x = x + K (z - H x)   P = (1 - K H) P (1 - K H)' + K R K'
/// ```
///
/// Source: Kalman 1960. The covariance update uses Joseph's form, which stays symmetric and positive by
/// construction. Measurements of different dimensions may be mixed. Nothing allocates.
///
/// ```
/// use motorium_sensors::estimation::KalmanFilter;
/// use nalgebra::{matrix, vector};
///
/// // Position and velocity from measured positions, 10 ms apart.
/// let mut filter = KalmanFilter::new(vector![0.0, 0.0], matrix![1.0, 0.0; 0.0, 1.0]);
/// let (f, q) = (matrix![1.0, 0.01; 0.0, 1.0], matrix![0.0, 0.0; 0.0, 1e-6]);
/// for k in 1..500 {
///     filter.predict(&f, &vector![0.0, 0.0], &q);
///     filter.update(&matrix![1.0, 0.0], &matrix![1e-4], &vector![0.01 * f64::from(k)])?;
/// }
/// assert!((filter.state[1] - 1.0).abs() < 1e-2, "1 m/s");
/// # Ok::<(), motorium_sensors::estimation::SingularInnovation>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct KalmanFilter<const N: usize> {
    /// State estimate `x`.
    pub state: SVector<f64, N>,
    /// Covariance `P` of the estimation error.
    pub covariance: SMatrix<f64, N, N>,
}

impl<const N: usize> KalmanFilter<N> {
    /// Creates a filter with an initial state estimate and its covariance.
    pub fn new(state: SVector<f64, N>, covariance: SMatrix<f64, N, N>) -> Self {
        Self { state, covariance }
    }

    /// Predicts the next state, with the transition matrix `f`, the known input `u` and the process noise
    /// covariance `q`.
    pub fn predict(&mut self, f: &SMatrix<f64, N, N>, u: &SVector<f64, N>, q: &SMatrix<f64, N, N>) {
        self.state = f * self.state + u;
        self.covariance = f * self.covariance * f.transpose() + q;
    }

    /// Corrects the state with a measurement `z = H x` whose noise has the covariance `r`. Returns the
    /// normalised innovation squared `y' S^-1 y`, for the innovation `y` with the covariance `S`. Its mean is
    /// the size `M` of the measurement if the noise covariances are correct.
    ///
    /// # Errors
    /// [`SingularInnovation`] if the covariance of the innovation is not positive definite. The filter is
    /// then unchanged.
    pub fn update<const M: usize>(
        &mut self,
        h: &SMatrix<f64, M, N>,
        r: &SMatrix<f64, M, M>,
        z: &SVector<f64, M>,
    ) -> Result<f64, SingularInnovation> {
        let innovation = z - h * self.state;
        let cross = self.covariance * h.transpose();
        let factor = (h * cross + r).cholesky().ok_or(SingularInnovation)?;
        let gain = factor.solve(&cross.transpose()).transpose();
        self.state += gain * innovation;
        let rest = SMatrix::<f64, N, N>::identity() - gain * h;
        self.covariance = rest * self.covariance * rest.transpose() + gain * r * gain.transpose();
        Ok(innovation.dot(&factor.solve(&innovation)))
    }
}

#[cfg(test)]
mod tests {
    use motorium_algebra::riccati;
    use nalgebra::{DMatrix, matrix, vector};

    use super::*;
    use crate::noise::Noise;

    #[test]
    fn measurements_of_a_constant_are_averaged_by_weight() {
        let mut filter = KalmanFilter::new(vector![0.0], matrix![1e12]);
        for (z, variance) in [(1.0, 1.0), (4.0, 2.0), (-2.0, 0.5)] {
            filter.update(&matrix![1.0], &matrix![variance], &vector![z]).unwrap();
        }
        let weights = 1.0 + 0.5 + 2.0;
        assert!((filter.state[0] - (1.0 + 2.0 - 4.0) / weights).abs() < 1e-9);
        assert!((filter.covariance[(0, 0)] - 1.0 / weights).abs() < 1e-9);
    }

    #[test]
    fn converges_to_the_dual_riccati_solution() {
        let (f, h) = (matrix![1.0, 0.1; 0.0, 1.0], matrix![1.0, 0.0]);
        let (q, r) = (matrix![1e-4, 0.0; 0.0, 1e-2], matrix![0.04]);
        let mut filter = KalmanFilter::new(vector![0.0, 0.0], matrix![1.0, 0.0; 0.0, 1.0]);
        for _ in 0..2000 {
            filter.update(&h, &r, &vector![0.0]).unwrap();
            filter.predict(&f, &vector![0.0, 0.0], &q);
        }
        let dynamic =
            |rows: usize, columns: usize, numbers: &[f64]| DMatrix::from_column_slice(rows, columns, numbers);
        let expected = riccati::solve(
            &dynamic(2, 2, f.transpose().as_slice()),
            &dynamic(2, 1, h.as_slice()),
            &dynamic(2, 2, q.as_slice()),
            &dynamic(1, 1, r.as_slice()),
        );
        let expected = expected.unwrap();
        for (found, expected) in filter.covariance.iter().zip(expected.iter()) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
    }

    /// Bounds are five standard deviations of the mean; the innovations of a consistent filter are
    /// independent.
    #[test]
    fn innovations_are_consistent_with_their_covariance() {
        let (f, h) = (matrix![1.0, 0.1; 0.0, 1.0], matrix![1.0, 0.0]);
        let (q, r) = (matrix![1e-4, 0.0; 0.0, 1e-2], matrix![0.04]);
        let mut filter = KalmanFilter::new(vector![0.0, 0.0], matrix![1e-9, 0.0; 0.0, 1e-9]);
        let (mut truth, mut noise, steps) = (vector![0.0, 0.0], Noise::new(5, 0), 20_000);
        let mut sum = 0.0;
        for _ in 0..steps {
            truth = f * truth;
            let mut draws = [0.0; 3];
            noise.add(&[1e-2, 0.1, 0.2], &mut draws);
            truth += vector![draws[0], draws[1]];
            filter.predict(&f, &vector![0.0, 0.0], &q);
            sum += filter.update(&h, &r, &(h * truth + vector![draws[2]])).unwrap();
        }
        let mean = sum / f64::from(steps);
        assert!((mean - 1.0).abs() < 5.0 * (2.0 / f64::from(steps)).sqrt(), "{mean}");
    }

    #[test]
    fn singular_innovation_is_rejected_without_effect() {
        let mut filter = KalmanFilter::new(vector![1.0], matrix![0.0]);
        let before = filter.clone();
        assert_eq!(filter.update(&matrix![1.0], &matrix![0.0], &vector![2.0]), Err(SingularInnovation));
        assert_eq!(filter, before);
    }
}
