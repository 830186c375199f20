//! The mean of a probabilistic primitive while it runs.

use nalgebra::DVector;

use super::model::{ProMp, ProMpError};
use crate::ValueError;
use crate::dmp::Quintic;

/// Follows the mean of a primitive in time. Only [`new`](Self::new) and [`exchange`](Self::exchange) allocate.
///
/// From where it is started, it goes over to the mean by a correction that dies out: the difference in position and
/// velocity at the start fades over the first part of the movement on a quintic, so that there is no jump. To be exactly
/// elsewhere later, condition the primitive.
#[derive(Clone, Debug)]
pub struct ProMpRunner {
    promp: ProMp,
    duration: f64,
    elapsed: f64,
    correction: Vec<Quintic>,
    values: Vec<f64>,
    slopes: Vec<f64>,
    position: Vec<f64>,
    velocity: Vec<f64>,
}

/// The part of the movement over which the difference at the start fades.
const FADE: f64 = 0.3;

impl ProMpRunner {
    /// At the mean of its start.
    pub fn new(promp: ProMp) -> Self {
        let (dimensions, count) = (promp.dimensions(), promp.basis().count());
        let mut runner = Self {
            duration: promp.duration(),
            promp,
            elapsed: 0.0,
            correction: vec![Quintic::at_rest(0.0); dimensions],
            values: vec![0.0; count],
            slopes: vec![0.0; count],
            position: vec![0.0; dimensions],
            velocity: vec![0.0; dimensions],
        };
        runner.observe();
        runner
    }

    /// The primitive it runs.
    pub fn promp(&self) -> &ProMp {
        &self.promp
    }

    /// Takes another primitive of the same dimensions, from the next start on. Allocates nothing when the bases are of one
    /// size.
    ///
    /// # Errors
    /// Another number of dimensions.
    pub fn exchange(&mut self, promp: ProMp) -> Result<(), ProMpError> {
        if promp.dimensions() != self.position.len() {
            return Err(ProMpError::Different);
        }
        self.values.resize(promp.basis().count(), 0.0);
        self.slopes.resize(promp.basis().count(), 0.0);
        self.promp = promp;
        Ok(())
    }

    /// Starts from a position with a velocity (per second), to be over after `duration` seconds.
    ///
    /// # Errors
    /// Wrong lengths, numbers that are not finite, a duration that is no positive time.
    pub fn start(&mut self, position: &[f64], velocity: &[f64], duration: f64) -> Result<(), ProMpError> {
        let expected = self.position.len();
        for (name, values) in [("the position", position), ("the velocity", velocity)] {
            if values.len() != expected {
                return Err(ProMpError::Value(ValueError::Size { name, found: values.len(), expected }));
            }
            if let Some(&value) = values.iter().find(|value| !value.is_finite()) {
                return Err(ProMpError::Value(ValueError::NotFinite { name, value }));
            }
        }
        if !(duration > 0.0 && duration.is_finite()) {
            let expected = "a positive time";
            return Err(ProMpError::Value(ValueError::OutOfRange {
                name: "duration",
                value: duration,
                expected,
            }));
        }
        (self.duration, self.elapsed) = (duration, 0.0);
        self.correction.fill(Quintic::at_rest(0.0));
        self.observe();
        for (d, correction) in self.correction.iter_mut().enumerate() {
            let value = position[d] - self.position[d];
            let rate = (velocity[d] - self.velocity[d]) * duration;
            let from = crate::dmp::Jet { value, rate, acceleration: 0.0 };
            *correction = Quintic::new(0.0, FADE, from, 0.0);
        }
        self.observe();
        Ok(())
    }

    /// Advances by `dt` seconds; past the end it stays at the end.
    pub fn step(&mut self, dt: f64) {
        if dt > 0.0 {
            self.elapsed += dt;
            self.observe();
        }
    }

    /// Position in every dimension.
    pub fn position(&self) -> &[f64] {
        &self.position
    }

    /// Velocity in every dimension, per second.
    pub fn velocity(&self) -> &[f64] {
        &self.velocity
    }

    /// Elapsed time over duration.
    pub fn progress(&self) -> f64 {
        self.elapsed / self.duration
    }

    /// True after the duration of the movement.
    pub fn is_over(&self) -> bool {
        // sums of periods are rounded
        self.progress() >= 1.0 - 1e-9
    }

    fn observe(&mut self) {
        let progress = self.progress();
        let phase = progress.min(1.0);
        self.promp.basis.evaluate(phase, &mut self.values, &mut self.slopes);
        let count = self.values.len();
        let weights: &DVector<f64> = &self.promp.mean;
        for (d, weights) in weights.as_slice().chunks_exact(count).enumerate() {
            let inner = |functions: &[f64]| weights.iter().zip(functions).map(|(w, f)| w * f).sum::<f64>();
            let correction = self.correction[d].sample(progress);
            let rate = if progress < 1.0 { inner(&self.slopes) } else { 0.0 };
            self.position[d] = inner(&self.values) + correction.value;
            self.velocity[d] = (rate + correction.rate) / self.duration;
        }
    }
}
