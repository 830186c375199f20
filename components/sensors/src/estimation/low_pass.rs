//! The first-order low-pass.

use std::f64::consts::TAU;

/// A first-order low-pass: `dy/dt = 2 pi f_c (x - y)`.
///
/// The filter is exact for an input that is constant between two samples: `y += (1 - exp(-2 pi f_c dt)) (x -
/// y)`, for steps of any length. The first sample sets the output.
///
/// ```
/// use motorium_sensors::estimation::LowPass;
///
/// let mut filter = LowPass::new(10.0);
/// assert_eq!(filter.update(2.0, 1e-3), 2.0);
/// // Half-way to a new value after ln 2 / (2 pi f_c).
/// let half_life = std::f64::consts::LN_2 / (std::f64::consts::TAU * 10.0);
/// assert!((filter.update(4.0, half_life) - 3.0).abs() < 1e-12);
/// ```
#[derive(Clone, Debug)]
pub struct LowPass {
    cutoff_hz: f64,
    value: Option<f64>,
}

impl LowPass {
    /// Creates a filter with a cut-off frequency \[Hz\], at which the amplitude of a sine is reduced to `1 /
    /// sqrt(2)`.
    ///
    /// # Panics
    /// If the frequency is not positive and finite.
    pub fn new(cutoff_hz: f64) -> Self {
        assert!(cutoff_hz > 0.0 && cutoff_hz.is_finite(), "a cut-off frequency of {cutoff_hz} Hz");
        Self { cutoff_hz, value: None }
    }

    /// Returns the output after `input` has been applied for `dt` \[s\]. A `dt` that is not positive leaves
    /// the output unchanged.
    pub fn update(&mut self, input: f64, dt: f64) -> f64 {
        let value = match self.value {
            None => input,
            Some(value) if dt > 0.0 => value + Self::share(self.cutoff_hz, dt) * (input - value),
            Some(value) => value,
        };
        self.value = Some(value);
        value
    }

    /// Returns the fraction of an input step that reaches the output after `dt` \[s\]: `1 - exp(-2 pi f_c
    /// dt)`.
    pub fn share(cutoff_hz: f64, dt: f64) -> f64 {
        -(-TAU * cutoff_hz * dt).exp_m1()
    }

    /// Returns the output; `None` before the first sample.
    pub fn value(&self) -> Option<f64> {
        self.value
    }

    /// Resets the filter to its state before the first sample.
    pub fn reset(&mut self) {
        self.value = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn step_response_is_independent_of_the_step_width() {
        let mut even = LowPass::new(3.0);
        let mut uneven = LowPass::new(3.0);
        even.update(0.0, 0.0);
        uneven.update(0.0, 0.0);
        (0..40).for_each(|_| {
            even.update(1.0, 1e-3);
        });
        for dt in [0.01, 0.002, 0.025, 0.003] {
            uneven.update(1.0, dt);
        }
        let expected = 1.0 - (-TAU * 3.0 * 0.04_f64).exp();
        assert!((even.value().unwrap() - expected).abs() < 1e-12);
        assert!((uneven.value().unwrap() - expected).abs() < 1e-12);
    }

    #[test]
    fn sine_at_the_cutoff_loses_three_decibels() {
        let mut filter = LowPass::new(5.0);
        let dt = 1e-5;
        let mut most = 0.0_f64;
        for k in 0..200_000_u32 {
            let output = filter.update((TAU * 5.0 * dt * f64::from(k)).sin(), dt);
            most = if k > 100_000 { most.max(output) } else { 0.0 };
        }
        assert!((most - std::f64::consts::FRAC_1_SQRT_2).abs() < 1e-3, "{most}");
    }

    #[test]
    fn zero_length_sample_has_no_effect_and_reset_clears() {
        let mut filter = LowPass::new(5.0);
        filter.update(1.0, 1e-3);
        assert_eq!(filter.update(9.0, 0.0), 1.0);
        filter.reset();
        assert_eq!(filter.update(9.0, 1e-3), 9.0);
    }
}
