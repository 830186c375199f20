//! Execution of the mean of a distribution over movements.

use crate::ValueError;
use crate::dmp::{Jet, Quintic};

/// A movement with a known mean as a function of the phase (0 at the start, 1 at the end):
/// [`ProMp`](crate::promp::ProMp), [`KernelisedMovement`](crate::kmp::KernelisedMovement),
/// [`PolynomialMovement`](crate::regression::PolynomialMovement).
pub trait MeanMovement: std::fmt::Debug {
    /// Returns the number of dimensions.
    fn dimensions(&self) -> usize;

    /// Returns the duration of the movement, s.
    fn duration(&self) -> f64;

    /// Writes the mean position and its derivative with respect to the phase, at a phase from 0 to 1, one
    /// entry per dimension. Does not allocate.
    fn mean_into(&mut self, phase: f64, position: &mut [f64], slope: &mut [f64]);
}

impl<M: MeanMovement + ?Sized> MeanMovement for Box<M> {
    fn dimensions(&self) -> usize {
        (**self).dimensions()
    }

    fn duration(&self) -> f64 {
        (**self).duration()
    }

    fn mean_into(&mut self, phase: f64, position: &mut [f64], slope: &mut [f64]) {
        (**self).mean_into(phase, position, slope);
    }
}

/// A follower that executes the mean of a movement over time. Only [`new`](Self::new) allocates.
///
/// The initial difference in position and velocity decays along a quintic polynomial over the first part of
/// the movement, so the transition to the mean is smooth. To pass a given position later, condition the
/// movement.
///
/// ```
/// use motorium_primitives::mean::MeanRunner;
/// use motorium_primitives::regression::PolynomialMovement;
/// use nalgebra::DMatrix;
///
/// // 0 to 1 in 2 s along a cubic
/// let shown = DMatrix::from_fn(101, 1, |k, _| {
///     let p = k as f64 / 100.0;
///     p * p * (3.0 - 2.0 * p)
/// });
/// let mut runner = MeanRunner::new(PolynomialMovement::fit(&[shown], 2.0, 3, 0.0)?);
/// runner.start(&[0.0], &[0.0], 2.0)?;
/// (0..1000).for_each(|_| runner.step(1e-3));
/// assert!((runner.position()[0] - 0.5).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct MeanRunner<M> {
    movement: M,
    duration: f64,
    elapsed: f64,
    correction: Vec<Quintic>,
    slope: Vec<f64>,
    position: Vec<f64>,
    velocity: Vec<f64>,
}

/// Fraction of the movement over which the initial difference decays.
const FADE: f64 = 0.3;

impl<M: MeanMovement> MeanRunner<M> {
    /// Creates a follower at the start of the mean.
    pub fn new(movement: M) -> Self {
        let dimensions = movement.dimensions();
        let mut runner = Self {
            duration: movement.duration(),
            movement,
            elapsed: 0.0,
            correction: vec![Quintic::at_rest(0.0); dimensions],
            slope: vec![0.0; dimensions],
            position: vec![0.0; dimensions],
            velocity: vec![0.0; dimensions],
        };
        runner.observe();
        runner
    }

    /// Returns the movement that is followed.
    pub fn movement(&self) -> &M {
        &self.movement
    }

    /// Mutable access to the movement. It may be replaced by one with the same number of dimensions for the
    /// next start.
    pub(crate) fn movement_mut(&mut self) -> &mut M {
        &mut self.movement
    }

    /// Starts at a position with a velocity (per second). The movement lasts `duration` seconds.
    ///
    /// # Errors
    /// [`ValueError`] if a length is wrong, a number is not finite, or the duration is not positive.
    pub fn start(&mut self, position: &[f64], velocity: &[f64], duration: f64) -> Result<(), ValueError> {
        let expected = self.position.len();
        for (name, values) in [("the position", position), ("the velocity", velocity)] {
            if values.len() != expected {
                return Err(ValueError::Size { name, found: values.len(), expected });
            }
            if let Some(&value) = values.iter().find(|value| !value.is_finite()) {
                return Err(ValueError::NotFinite { name, value });
            }
        }
        if !(duration > 0.0 && duration.is_finite()) {
            let expected = "a positive time";
            return Err(ValueError::OutOfRange { name: "duration", value: duration, expected });
        }
        (self.duration, self.elapsed) = (duration, 0.0);
        self.correction.fill(Quintic::at_rest(0.0));
        self.observe();
        for (d, correction) in self.correction.iter_mut().enumerate() {
            let value = position[d] - self.position[d];
            let rate = (velocity[d] - self.velocity[d]) * duration;
            *correction = Quintic::new(0.0, FADE, Jet { value, rate, acceleration: 0.0 }, 0.0);
        }
        self.observe();
        Ok(())
    }

    /// Advances by `dt` seconds. After the end the state is constant.
    pub fn step(&mut self, dt: f64) {
        if dt > 0.0 {
            self.elapsed += dt;
            self.observe();
        }
    }

    /// Returns the position in every dimension.
    pub fn position(&self) -> &[f64] {
        &self.position
    }

    /// Returns the velocity in every dimension, per second.
    pub fn velocity(&self) -> &[f64] {
        &self.velocity
    }

    /// Returns the elapsed time divided by the duration.
    pub fn progress(&self) -> f64 {
        self.elapsed / self.duration
    }

    /// Returns `true` if the duration of the movement has elapsed.
    pub fn is_over(&self) -> bool {
        // sums of time steps are rounded
        self.progress() >= 1.0 - 1e-9
    }

    fn observe(&mut self) {
        let progress = self.progress();
        self.movement.mean_into(progress.min(1.0), &mut self.position, &mut self.slope);
        for (d, correction) in self.correction.iter().enumerate() {
            let correction = correction.sample(progress);
            let rate = if progress < 1.0 { self.slope[d] } else { 0.0 };
            self.position[d] += correction.value;
            self.velocity[d] = (rate + correction.rate) / self.duration;
        }
    }
}
