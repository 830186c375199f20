//! The sampled spring of the movements, which maps a path to forces and forces to a path. The two maps are
//! exact inverses.

use serde::{Deserialize, Serialize};

/// A discretised spring: the transformation system `y'' = K (g - y) - D y' + f` in normalised time, in which
/// the duration is 1.
///
/// With `T` samples and the step `h = 1 / (T - 1)`, semi-implicit Euler
///
/// ```text
/// a_k = K (g - y_k) - D v_k + f_k,    v_{k+1} = v_k + h a_k,    y_{k+1} = y_k + h v_{k+1}
/// ```
///
/// is inverted exactly except for rounding: `v_{k+1} = (y_{k+1} - y_k) / h`, `a_k = (v_{k+1} - v_k) / h`. A
/// path of `T` samples and its initial velocity `v_0` (in units per duration) determine `T - 1` forces, and
/// the forces determine the path. The path is linear in start, velocity, goal and forces: `y = y_free + G f`,
/// with `G` lower triangular and Toeplitz. [`respond`](Self::respond) multiplies by `G` and
/// [`force_of`](Self::force_of) by its inverse.
///
/// Source: the transformation system of Ijspeert et al., Neural Computation 25, 2013, with `K = D^2 / 4`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SampledSpring {
    stiffness: f64,
    damping: f64,
    samples: usize,
    /// Missing in files of earlier versions.
    #[serde(default = "Interpolation::of_old_files")]
    interpolation: Interpolation,
}

/// Curve through the samples of a recording, on which a path is resampled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Interpolation {
    /// Natural cubic spline, the default. The second derivative, and with it the force, is continuous.
    #[default]
    Spline,
    /// Straight lines between samples. Every sample is a kink, which causes a spike of force.
    Linear,
}

impl Interpolation {
    /// Returns the interpolation of library files that do not specify one.
    pub(crate) fn of_old_files() -> Self {
        Self::Linear
    }
}

/// Default damping `D = 25`, with the stiffness `K = 156.25`.
pub const DAMPING: f64 = 25.0;

/// Error returned when the damping of a spring is not positive, or its steps are too long to be stable.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "found {samples} samples with a damping of {damping}, expected a positive damping and more than {least} samples for stable steps"
)]
pub struct SpringError {
    samples: usize,
    damping: f64,
    least: usize,
}

impl SampledSpring {
    /// Creates a critically damped spring, `K = D^2 / 4`, for paths of `samples` samples.
    ///
    /// # Errors
    /// [`SpringError`] if the damping is not a positive number, or the step `h` times `D` is not less than 1.
    pub fn new(samples: usize, damping: f64) -> Result<Self, SpringError> {
        let least = if damping.is_finite() { damping.abs().ceil() as usize + 1 } else { 0 };
        if !(damping.is_finite() && damping > 0.0) || samples <= least {
            return Err(SpringError { samples, damping, least });
        }
        let interpolation = Interpolation::default();
        Ok(Self { stiffness: 0.25 * damping * damping, damping, samples, interpolation })
    }

    /// Returns the spring with `interpolation` as the curve on which recordings are resampled.
    #[must_use]
    pub fn with_interpolation(self, interpolation: Interpolation) -> Self {
        Self { interpolation, ..self }
    }

    /// Returns the interpolation curve for resampling recordings.
    pub fn interpolation(&self) -> Interpolation {
        self.interpolation
    }

    /// Returns the number of samples `T` of a path.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// Returns the number of forces of a path, `T - 1`.
    pub fn forces(&self) -> usize {
        self.samples - 1
    }

    /// Returns the damping `D`.
    pub fn damping(&self) -> f64 {
        self.damping
    }

    /// Returns the step `h` in normalised time.
    pub fn step(&self) -> f64 {
        1.0 / (self.samples - 1) as f64
    }

    /// Computes the forces with which the spring follows `path` (`T` samples), for an initial `velocity` (per
    /// duration) and a `goal`.
    pub fn forces_of(&self, path: &[f64], velocity: f64, goal: f64, forces: &mut [f64]) {
        let h = self.step();
        let mut v = velocity;
        for (force, pair) in forces.iter_mut().zip(path.windows(2)) {
            let next = (pair[1] - pair[0]) / h;
            *force = (next - v) / h - self.stiffness * (goal - pair[0]) + self.damping * v;
            v = next;
        }
    }

    /// Computes the path (`T` samples) under `forces` (`T - 1`), for this start, initial velocity (per
    /// duration) and goal.
    pub fn path_of(&self, forces: &[f64], [start, velocity, goal]: [f64; 3], path: &mut [f64]) {
        let h = self.step();
        let (mut y, mut v) = (start, velocity);
        path[0] = y;
        for (sample, force) in path[1..].iter_mut().zip(forces) {
            v += h * (self.stiffness * (goal - y) - self.damping * v + force);
            y += h * v;
            *sample = y;
        }
    }

    /// Returns position and velocity one step later.
    pub(super) fn advance(&self, [y, v]: [f64; 2], goal: f64, force: f64) -> [f64; 2] {
        let h = self.step();
        let v = v + h * (self.stiffness * (goal - y) - self.damping * v + force);
        [y + h * v, v]
    }

    /// Maps forces `f` to `G f` in place: the response of samples 1 to `T - 1` to forces alone, from rest at
    /// a goal of 0.
    pub fn respond(&self, forces: &mut [f64]) {
        let h = self.step();
        let (mut y, mut v) = (0.0, 0.0);
        for entry in forces {
            v += h * (*entry - self.stiffness * y - self.damping * v);
            y += h * v;
            *entry = y;
        }
    }

    /// Maps a response `y` to the forces `G^-1 y` in place.
    pub fn force_of(&self, response: &mut [f64]) {
        let h = self.step();
        let (mut y, mut v) = (0.0, 0.0);
        for entry in response {
            let next_y = *entry;
            let next = (next_y - y) / h;
            *entry = (next - v) / h + self.stiffness * y + self.damping * v;
            (y, v) = (next_y, next);
        }
    }

    /// Maps values `x` to `G^T x` in place, so that `u . (G f) = (G^T u) . f`.
    pub fn respond_transposed(&self, values: &mut [f64]) {
        // G is Toeplitz and lower triangular: its transpose is itself with time reversed.
        values.reverse();
        self.respond(values);
        values.reverse();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn path_survives_conversion_to_forces() {
        let spring = SampledSpring::new(200, DAMPING).unwrap();
        let path: Vec<f64> = (0..200).map(|k| (0.05 * f64::from(k)).sin() + 0.3).collect();
        let (mut forces, mut back) = (vec![0.0; 199], vec![0.0; 200]);
        spring.forces_of(&path, 1.7, 2.0, &mut forces);
        spring.path_of(&forces, [path[0], 1.7, 2.0], &mut back);
        assert!(path.iter().zip(&back).all(|(a, b)| (a - b).abs() < 1e-12));
    }

    #[test]
    fn response_inverse_and_transpose_agree() {
        let spring = SampledSpring::new(64, DAMPING).unwrap();
        let f: Vec<f64> = (0..63).map(|k| (0.3 * f64::from(k)).cos()).collect();
        let u: Vec<f64> = (0..63).map(|k| (0.17 * f64::from(k)).sin()).collect();
        let (mut response, mut back, mut transposed) = (f.clone(), f.clone(), u.clone());
        spring.respond(&mut response);
        let mut path = vec![0.0; 64];
        spring.path_of(&f, [0.0; 3], &mut path);
        assert!(response.iter().zip(&path[1..]).all(|(a, b)| (a - b).abs() < 1e-15));
        back.copy_from_slice(&response);
        spring.force_of(&mut back);
        assert!(f.iter().zip(&back).all(|(a, b)| (a - b).abs() < 1e-9));
        spring.respond_transposed(&mut transposed);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        assert!((dot(&u, &response) - dot(&transposed, &f)).abs() < 1e-14);
    }

    #[test]
    fn unstable_steps_are_rejected() {
        let error = SampledSpring::new(20, 25.0).unwrap_err().to_string();
        assert!(error.contains("20 samples") && error.contains("more than 26"), "{error}");
        assert!(SampledSpring::new(200, f64::NAN).is_err());
    }
}
