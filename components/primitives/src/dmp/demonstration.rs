//! A movement to learn from.

use nalgebra::DMatrix;

/// A demonstrated movement: evenly spaced samples of position, velocity and acceleration.
#[derive(Clone, Debug, PartialEq)]
pub struct Demonstration {
    duration: f64,
    positions: DMatrix<f64>,
    velocities: DMatrix<f64>,
    accelerations: DMatrix<f64>,
}

/// Error returned when a demonstration is invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DemonstrationError {
    /// There are too few samples to differentiate twice.
    #[error("found {found} samples, expected at least 4, because they are differentiated twice")]
    TooShort {
        /// Number of samples found.
        found: usize,
    },
    /// The samples have no dimensions.
    #[error("the samples have no dimension, expected at least one")]
    NoDimension,
    /// The duration is not a positive time.
    #[error("a duration of {found} s, expected a positive time")]
    Duration {
        /// Value found, s.
        found: f64,
    },
    /// The matrices differ in shape.
    #[error(
        "{name} have the shape {found:?} (samples, dimensions), expected {expected:?} as for the positions"
    )]
    Shape {
        /// Name of the derivative.
        name: &'static str,
        /// Shape of the derivative.
        found: (usize, usize),
        /// Shape of the positions.
        expected: (usize, usize),
    },
    /// A sample is not finite.
    #[error(
        "sample {sample}, dimension {dimension} is {value}, expected a finite number: cut the recording or fill the gap"
    )]
    NotFinite {
        /// Index of the sample.
        sample: usize,
        /// Index of the dimension.
        dimension: usize,
        /// Value found.
        value: f64,
    },
}

impl Demonstration {
    /// Creates a demonstration from positions (samples x dimensions) that are evenly spaced over `duration`
    /// seconds. The first sample is at time 0, the last at the end.
    ///
    /// Velocity and acceleration are second-order differences, central inside and one-sided at the ends,
    /// which preserves the initial velocity of the demonstration. Differences amplify noise: filter a
    /// measured recording first.
    ///
    /// # Errors
    /// [`DemonstrationError`] if there are fewer than 4 samples or no dimensions, the duration is not
    /// positive, or a sample is not finite.
    pub fn from_positions(duration: f64, positions: DMatrix<f64>) -> Result<Self, DemonstrationError> {
        check(duration, &positions)?;
        let (samples, dimensions) = positions.shape();
        let step = duration / (samples - 1) as f64;
        let (per_two_steps, per_square) = (0.5 / step, 1.0 / (step * step));
        let mut velocities = DMatrix::zeros(samples, dimensions);
        let mut accelerations = DMatrix::zeros(samples, dimensions);
        let columns = velocities.as_mut_slice().chunks_exact_mut(samples);
        let columns = columns.zip(accelerations.as_mut_slice().chunks_exact_mut(samples));
        for (y, (v, a)) in positions.as_slice().chunks_exact(samples).zip(columns) {
            for ((y, v), a) in y.windows(3).zip(&mut v[1..]).zip(&mut a[1..]) {
                *v = (y[2] - y[0]) * per_two_steps;
                *a = (y[2] - 2.0 * y[1] + y[0]) * per_square;
            }
            let one_sided = |a: f64, b: f64, c: f64, e: f64| (2.0 * a - 5.0 * b + 4.0 * c - e) * per_square;
            let last = samples - 1;
            v[0] = (-3.0 * y[0] + 4.0 * y[1] - y[2]) * per_two_steps;
            v[last] = (3.0 * y[last] - 4.0 * y[last - 1] + y[last - 2]) * per_two_steps;
            a[0] = one_sided(y[0], y[1], y[2], y[3]);
            a[last] = one_sided(y[last], y[last - 1], y[last - 2], y[last - 3]);
        }
        Ok(Self { duration, positions, velocities, accelerations })
    }

    /// Creates a demonstration from positions, velocities (per second) and accelerations (per second
    /// squared), each samples x dimensions.
    ///
    /// # Errors
    /// [`DemonstrationError`] in the same cases as [`Self::from_positions`], and if the matrices differ in
    /// shape.
    pub fn with_derivatives(
        duration: f64,
        positions: DMatrix<f64>,
        velocities: DMatrix<f64>,
        accelerations: DMatrix<f64>,
    ) -> Result<Self, DemonstrationError> {
        check(duration, &positions)?;
        for (name, matrix) in [("velocities", &velocities), ("accelerations", &accelerations)] {
            if matrix.shape() != positions.shape() {
                let (found, expected) = (matrix.shape(), positions.shape());
                return Err(DemonstrationError::Shape { name, found, expected });
            }
            check(duration, matrix)?;
        }
        Ok(Self { duration, positions, velocities, accelerations })
    }

    /// Returns the same movement with zero acceleration at both ends.
    ///
    /// End accelerations of a recording are mostly noise, which a fit would treat as part of the shape.
    #[must_use]
    pub fn unaccelerated_at_its_ends(mut self) -> Self {
        let last = self.samples() - 1;
        self.accelerations.row_mut(0).fill(0.0);
        self.accelerations.row_mut(last).fill(0.0);
        self
    }

    /// Returns the same movement with zero velocity and acceleration at both ends.
    #[must_use]
    pub fn at_rest_at_its_ends(self) -> Self {
        let mut demonstration = self.unaccelerated_at_its_ends();
        let last = demonstration.samples() - 1;
        demonstration.velocities.row_mut(0).fill(0.0);
        demonstration.velocities.row_mut(last).fill(0.0);
        demonstration
    }

    /// Returns the time from the first sample to the last, s.
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// Returns the number of samples.
    pub fn samples(&self) -> usize {
        self.positions.nrows()
    }

    /// Returns the number of dimensions.
    pub fn dimensions(&self) -> usize {
        self.positions.ncols()
    }

    /// Returns the positions, samples x dimensions.
    pub fn positions(&self) -> &DMatrix<f64> {
        &self.positions
    }

    /// Returns the velocities per second, samples x dimensions.
    pub fn velocities(&self) -> &DMatrix<f64> {
        &self.velocities
    }

    /// Returns the accelerations per second squared, samples x dimensions.
    pub fn accelerations(&self) -> &DMatrix<f64> {
        &self.accelerations
    }

    /// Returns the start of the movement in a dimension: the first position.
    pub fn start(&self, dimension: usize) -> f64 {
        self.positions[(0, dimension)]
    }

    /// Returns the goal of the movement in a dimension: the last position.
    pub fn goal(&self, dimension: usize) -> f64 {
        self.positions[(self.samples() - 1, dimension)]
    }
}

pub(super) fn check(duration: f64, samples: &DMatrix<f64>) -> Result<(), DemonstrationError> {
    if samples.nrows() < 4 {
        return Err(DemonstrationError::TooShort { found: samples.nrows() });
    }
    if samples.ncols() == 0 {
        return Err(DemonstrationError::NoDimension);
    }
    if !(duration.is_finite() && duration > 0.0) {
        return Err(DemonstrationError::Duration { found: duration });
    }
    if let Some(place) = samples.iter().position(|value| !value.is_finite()) {
        let (sample, dimension) = (place % samples.nrows(), place / samples.nrows());
        return Err(DemonstrationError::NotFinite { sample, dimension, value: samples.as_slice()[place] });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_exact_for_a_parabola_and_its_ends() {
        let positions = DMatrix::from_fn(11, 1, |k, _| {
            let t = 0.2 * k as f64;
            1.0 - 3.0 * t + 2.0 * t * t
        });
        let demonstration = Demonstration::from_positions(2.0, positions).unwrap();
        for k in 0..11 {
            let t = 0.2 * k as f64;
            assert!((demonstration.velocities()[(k, 0)] - (4.0 * t - 3.0)).abs() < 1e-12);
            assert!((demonstration.accelerations()[(k, 0)] - 4.0).abs() < 1e-11);
        }
    }

    #[test]
    fn gap_in_the_recording_is_rejected_with_its_position() {
        let mut positions = DMatrix::zeros(5, 2);
        positions[(3, 1)] = f64::NAN;
        let error = Demonstration::from_positions(1.0, positions).unwrap_err().to_string();
        assert!(error.starts_with("sample 3, dimension 1 is NaN"), "{error}");
    }

    #[test]
    fn three_samples_are_too_few() {
        let error = Demonstration::from_positions(1.0, DMatrix::zeros(3, 1)).unwrap_err();
        assert_eq!(error, DemonstrationError::TooShort { found: 3 });
    }
}
