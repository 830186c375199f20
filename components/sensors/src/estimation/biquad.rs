//! Second-order filters.

use std::f64::consts::TAU;

/// Frequency response of a [`Biquad`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BiquadShape {
    /// Passes frequencies below `frequency`. `q = 1 / sqrt(2)` gives a Butterworth filter.
    LowPass,
    /// Passes frequencies above `frequency`.
    HighPass,
    /// Passes a band of width `frequency / q` around `frequency`, with a gain of 1 at its centre.
    BandPass,
    /// Rejects a band of width `frequency / q` around `frequency`.
    Notch,
}

/// Invalid filter parameters.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum BiquadError {
    /// The frequency is not between zero and half the sample rate.
    #[error("a frequency of {frequency_hz} Hz at {rate_hz} samples per second, expected a frequency above 0 and below {} Hz", 0.5 * .rate_hz)]
    Frequency {
        /// The frequency, Hz.
        frequency_hz: f64,
        /// The sample rate, Hz.
        rate_hz: f64,
    },
    /// The quality factor `q` is not positive.
    #[error("a quality factor of {0}, expected a positive number, such as 0.7071")]
    Quality(f64),
}

/// A second-order filter of a signal with a constant sample rate.
///
/// ```text
/// y_k = b0 x_k + b1 x_(k-1) + b2 x_(k-2) - a1 y_(k-1) - a2 y_(k-2)
/// ```
///
/// The coefficients follow from the bilinear transform, pre-warped so that the frequency is exact
/// (Bristow-Johnson, *Audio EQ Cookbook*). The structure is the transposed direct form II. The filter starts
/// in the steady state of the first sample.
///
/// ```
/// use motorium_sensors::estimation::{Biquad, BiquadShape};
///
/// let mut filter = Biquad::new(BiquadShape::LowPass, 50.0, std::f64::consts::FRAC_1_SQRT_2, 1000.0)?;
/// assert!((filter.update(3.0) - 3.0).abs() < 1e-12);
/// let peak = (0..100).map(|_| filter.update(4.0)).fold(0.0, f64::max);
/// assert!((1.03..1.05).contains(&(peak - 3.0)), "a Butterworth filter overshoots by 4 %");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Biquad {
    b: [f64; 3],
    a: [f64; 2],
    state: Option<[f64; 2]>,
}

impl Biquad {
    /// Creates a filter for `rate_hz` samples per second with the characteristic frequency `frequency_hz` and
    /// the quality factor `q`.
    ///
    /// # Errors
    /// [`BiquadError`] if the frequency is not between zero and half the rate, or `q` is not positive.
    pub fn new(shape: BiquadShape, frequency_hz: f64, q: f64, rate_hz: f64) -> Result<Self, BiquadError> {
        if !(frequency_hz > 0.0 && frequency_hz < 0.5 * rate_hz && rate_hz.is_finite()) {
            return Err(BiquadError::Frequency { frequency_hz, rate_hz });
        }
        if !(q > 0.0 && q.is_finite()) {
            return Err(BiquadError::Quality(q));
        }
        let (sin, cos) = (TAU * frequency_hz / rate_hz).sin_cos();
        let alpha = 0.5 * sin / q;
        let b = match shape {
            BiquadShape::LowPass => [0.5 * (1.0 - cos), 1.0 - cos, 0.5 * (1.0 - cos)],
            BiquadShape::HighPass => [0.5 * (1.0 + cos), -(1.0 + cos), 0.5 * (1.0 + cos)],
            BiquadShape::BandPass => [alpha, 0.0, -alpha],
            BiquadShape::Notch => [1.0, -2.0 * cos, 1.0],
        };
        let scale = 1.0 / (1.0 + alpha);
        Ok(Self { b: b.map(|b| b * scale), a: [-2.0 * cos * scale, (1.0 - alpha) * scale], state: None })
    }

    /// Adds a sample and returns the output.
    pub fn update(&mut self, input: f64) -> f64 {
        let (b, a) = (self.b, self.a);
        let [first, second] = self.state.unwrap_or_else(|| {
            // steady state at this input: y = gain x
            let output = self.gain(0.0) * input;
            let second = b[2] * input - a[1] * output;
            [b[1] * input - a[0] * output + second, second]
        });
        let output = b[0] * input + first;
        self.state = Some([b[1] * input - a[0] * output + second, b[2] * input - a[1] * output]);
        output
    }

    /// Returns the gain at a frequency of `turns` cycles per sample, from 0 to 0.5.
    pub fn gain(&self, turns: f64) -> f64 {
        let size = |coefficients: [f64; 3]| {
            let part = |of: fn(f64) -> f64| -> f64 {
                (0_u32..).zip(coefficients).map(|(k, c)| c * of(TAU * turns * f64::from(k))).sum()
            };
            part(f64::cos).hypot(part(f64::sin))
        };
        size(self.b) / size([1.0, self.a[0], self.a[1]])
    }

    /// Resets the filter to its state before the first sample.
    pub fn reset(&mut self) {
        self.state = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `scipy.signal.butter(2, 50, fs=1000)` of scipy 1.17.1.
    #[test]
    fn low_pass_with_default_quality_is_butterworth() {
        let filter =
            Biquad::new(BiquadShape::LowPass, 50.0, std::f64::consts::FRAC_1_SQRT_2, 1000.0).unwrap();
        let (b, a) = (
            [0.020083365564211232, 0.040166731128422464, 0.020083365564211232],
            [-1.5610180758007182, 0.641351538057563],
        );
        assert!(filter.b.iter().zip(b).all(|(found, expected)| (found - expected).abs() < 1e-14));
        assert!(filter.a.iter().zip(a).all(|(found, expected)| (found - expected).abs() < 1e-14));
    }

    #[test]
    fn gains_match_the_filter_shape() {
        let gains = |shape| {
            let filter = Biquad::new(shape, 100.0, 2.0, 1000.0).unwrap();
            [0.0, 0.1, 0.5].map(|turns| filter.gain(turns))
        };
        let close = |found: [f64; 3], expected: [f64; 3]| {
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
        };
        close(gains(BiquadShape::LowPass), [1.0, 2.0, 0.0]);
        close(gains(BiquadShape::HighPass), [0.0, 2.0, 1.0]);
        close(gains(BiquadShape::BandPass), [0.0, 1.0, 0.0]);
        close(gains(BiquadShape::Notch), [1.0, 0.0, 1.0]);
    }

    #[test]
    fn sine_response_matches_the_computed_gain() {
        let mut filter = Biquad::new(BiquadShape::LowPass, 40.0, 0.9, 1000.0).unwrap();
        let mut most = 0.0_f64;
        for k in 0..5000_u32 {
            let output = filter.update((TAU * 0.0317 * f64::from(k)).sin());
            most = if k > 2000 { most.max(output) } else { 0.0 };
        }
        assert!((most - filter.gain(0.0317)).abs() < 1e-3, "{most}");
    }

    #[test]
    fn starts_in_steady_state_and_after_a_reset() {
        for shape in [BiquadShape::LowPass, BiquadShape::Notch, BiquadShape::HighPass, BiquadShape::BandPass]
        {
            let mut filter = Biquad::new(shape, 40.0, 0.9, 1000.0).unwrap();
            for start in [5.0, -2.0] {
                let rest = filter.gain(0.0) * start;
                assert!((0..10).all(|_| (filter.update(start) - rest).abs() < 1e-12), "{shape:?}");
                filter.reset();
            }
        }
    }

    #[test]
    fn invalid_parameters_are_rejected() {
        let new = |f, q| Biquad::new(BiquadShape::Notch, f, q, 1000.0).map(|_| ());
        assert_eq!(new(500.0, 1.0), Err(BiquadError::Frequency { frequency_hz: 500.0, rate_hz: 1000.0 }));
        assert_eq!(new(50.0, 0.0), Err(BiquadError::Quality(0.0)));
        assert!(new(f64::NAN, 1.0).is_err() && new(50.0, f64::NAN).is_err());
    }
}
