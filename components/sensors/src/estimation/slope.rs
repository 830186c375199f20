//! Velocity from positions.

/// An estimated velocity and its delay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slope {
    /// Velocity, in the unit of the position per second.
    pub velocity: f64,
    /// Delay of the velocity \[s\]. A signal of constant acceleration had this velocity at `delay` before the
    /// last sample.
    pub delay: f64,
    /// Standard deviation of the velocity per standard deviation of the positions, for independent errors
    /// \[1/s\].
    pub noise_gain: f64,
}

/// Estimates the velocity of a signal as the slope of a least-squares line through its last `n` samples.
///
/// ```text
/// velocity = sum (t_k - t_mean) (x_k - x_mean) / sum (t_k - t_mean)^2        delay = t_last - t_mean
/// ```
///
/// Two samples give the backward difference, which is delayed by `dt / 2`. More samples reduce the noise to
/// `sqrt(12 / (n (n^2 - 1))) / dt` times the position noise, but increase the delay to `(n - 1) dt / 2`. Time
/// stamps may be uneven. The reported delay is exact for a quadratic signal if the time stamps are even or if
/// there are two samples.
///
/// ```
/// use motorium_sensors::estimation::SlopeEstimator;
///
/// let mut estimator = SlopeEstimator::new(5);
/// for k in 0..5_u32 {
///     let t = 1e-3 * f64::from(k);
///     estimator.push(t, 4.0 * t * t); // velocity 8 t
/// }
/// let slope = estimator.slope().unwrap();
/// assert!((slope.delay - 2e-3).abs() < 1e-12, "s");
/// assert!((slope.velocity - 8.0 * (4e-3 - slope.delay)).abs() < 1e-9);
/// ```
#[derive(Clone, Debug)]
pub struct SlopeEstimator {
    samples: Vec<(f64, f64)>,
    next: usize,
    count: usize,
}

impl SlopeEstimator {
    /// Creates an estimator over the last `samples` samples.
    ///
    /// # Panics
    /// If `samples` is less than two.
    pub fn new(samples: usize) -> Self {
        assert!(samples >= 2, "a line through {samples} samples");
        Self { samples: vec![(0.0, 0.0); samples], next: 0, count: 0 }
    }

    /// Adds the position at a time \[s\]. A time that is not after the previous position's restarts the
    /// estimator.
    pub fn push(&mut self, time: f64, position: f64) {
        let size = self.samples.len();
        if self.count > 0 && time <= self.samples[(self.next + size - 1) % size].0 {
            self.count = 0;
        }
        self.samples[self.next] = (time, position);
        self.next = (self.next + 1) % size;
        self.count = (self.count + 1).min(size);
    }

    /// Returns the velocity, or `None` before the second sample. Until `n` samples have been added, the slope
    /// of fewer samples is returned, with a shorter delay.
    pub fn slope(&self) -> Option<Slope> {
        if self.count < 2 {
            return None;
        }
        let size = self.samples.len();
        let recent = || (1..=self.count).map(|back| self.samples[(self.next + size - back) % size]);
        let (last, origin) = recent().next()?;
        // relative to the last sample, to keep precision in a long run
        let n = self.count as f64;
        let (time, position) =
            recent().fold((0.0, 0.0), |sum, (t, x)| (sum.0 + t - last, sum.1 + x - origin));
        let (time, position) = (time / n, position / n);
        let (spread, product) = recent().fold((0.0, 0.0), |(spread, product), (t, x)| {
            let (t, x) = (t - last - time, x - origin - position);
            (spread + t * t, product + t * x)
        });
        Some(Slope { velocity: product / spread, delay: -time, noise_gain: spread.sqrt().recip() })
    }

    /// Removes all samples.
    pub fn reset(&mut self) {
        self.count = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_samples_are_the_backward_difference_half_a_period_late() {
        let mut estimator = SlopeEstimator::new(2);
        estimator.push(100.0, 1.0);
        assert_eq!(estimator.slope(), None);
        estimator.push(100.5, 1.25);
        let slope = estimator.slope().unwrap();
        assert_eq!((slope.velocity, slope.delay), (0.5, 0.25));
    }

    #[test]
    fn delay_and_noise_gain_match_the_closed_form() {
        for n in [2_u32, 3, 7, 20] {
            let (dt, mut estimator) = (1e-3, SlopeEstimator::new(n as usize));
            (0..3 * n).for_each(|k| estimator.push(f64::from(k) * dt, 0.0));
            let (slope, n) = (estimator.slope().unwrap(), f64::from(n));
            assert!((slope.delay - 0.5 * (n - 1.0) * dt).abs() < 1e-12);
            let expected = (12.0 / (n * (n * n - 1.0))).sqrt() / dt;
            assert!((slope.noise_gain / expected - 1.0).abs() < 1e-9);
        }
    }

    #[test]
    fn quadratic_has_the_stated_delay() {
        let mut estimator = SlopeEstimator::new(9);
        for k in 0..50_u32 {
            let t = 3600.0 + 2e-3 * f64::from(k);
            estimator.push(t, 3.0 - 2.0 * (t - 3600.0) + 5.0 * (t - 3600.0).powi(2));
            if let Some(slope) = estimator.slope() {
                let at = t - 3600.0 - slope.delay;
                assert!((slope.velocity - (-2.0 + 10.0 * at)).abs() < 1e-7, "{k}");
            }
        }
    }

    #[test]
    fn restarted_signal_is_not_joined_to_the_old_one() {
        let mut estimator = SlopeEstimator::new(3);
        estimator.push(5.0, 100.0);
        estimator.push(6.0, 200.0);
        estimator.push(0.0, 1.0);
        assert_eq!(estimator.slope(), None);
        estimator.push(1.0, 3.0);
        assert_eq!(estimator.slope().unwrap().velocity, 2.0);
    }
}
