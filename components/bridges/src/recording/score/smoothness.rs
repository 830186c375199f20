//! Smoothness of movements.

use core::f64::consts::PI;

/// Frequency above which the spectrum of a movement is ignored, Hz.
const CUT_OFF_HZ: f64 = 10.0;
/// Fraction of the largest amplitude below which the end of the spectrum is ignored.
const THRESHOLD: f64 = 0.05;
/// Minimum number of speed samples for a spectrum.
const FEWEST: usize = 8;

/// Returns the spectral arc length of a movement from its speed, sampled at `rate_hz`: the negative arc
/// length of its normalised Fourier magnitude spectrum up to 10 Hz. A movement that accelerates and
/// decelerates once has a value of about -1.4; further speed changes lower the value. Noise above 10 Hz has
/// no effect. Returns `None` for fewer than 8 samples, or without motion.
///
/// S. Balasubramanian, A. Melendez-Calderon, A. Roby-Brami, E. Burdet: On the analysis of movement
/// smoothness. Journal of NeuroEngineering and Rehabilitation 12 (2015), section "SPARC", with their
/// zero-padding of four powers of two.
///
/// ```
/// use motorium_bridges::recording::spectral_arc_length;
///
/// // speeds of a movement of one second along a minimum-jerk profile, and of one that hesitates
/// let bell = |t: f64| 30.0 * t.powi(2) * (1.0 - t).powi(2);
/// let smooth: Vec<f64> = (0..100).map(|i| bell(f64::from(i) / 100.0)).collect();
/// let twice: Vec<f64> = (0..100).map(|i| bell(f64::from(i % 50) / 50.0)).collect();
/// let (smooth, twice) = (spectral_arc_length(&smooth, 100.0), spectral_arc_length(&twice, 100.0));
/// assert!(smooth.unwrap() > -1.5 && twice.unwrap() < -2.0);
/// ```
pub fn spectral_arc_length(speeds: &[f64], rate_hz: f64) -> Option<f64> {
    if speeds.len() < FEWEST || !rate_hz.is_finite() || rate_hz <= 0.0 {
        return None;
    }
    let padded = (16 * speeds.len().next_power_of_two()) as f64;
    let resolution_hz = rate_hz / padded;
    let highest = ((CUT_OFF_HZ / resolution_hz).floor()).min(padded / 2.0) as usize;
    let amplitude = |index: usize| {
        let turn = nalgebra::Complex::from_polar(1.0, -2.0 * PI * index as f64 / padded);
        // Horner's rule, starting at the last speed, needs one multiplication per sample and no table.
        let sum =
            speeds.iter().rev().fold(nalgebra::Complex::new(0.0, 0.0), |sum, speed| sum * turn + *speed);
        sum.norm()
    };
    let mut spectrum: Vec<f64> = (0..=highest).map(amplitude).collect();
    // Speeds are not negative, so no amplitude exceeds the one at frequency zero.
    let largest = spectrum.first().copied().filter(|largest| *largest > 0.0)?;
    spectrum.iter_mut().for_each(|amplitude| *amplitude /= largest);
    let last = spectrum.iter().rposition(|amplitude| *amplitude >= THRESHOLD)?;
    let step = 1.0 / last.max(1) as f64;
    let length: f64 = spectrum[..=last].windows(2).map(|pair| step.hypot(pair[1] - pair[0])).sum();
    Some(-length)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bell(t: f64) -> f64 {
        30.0 * t.powi(2) * (1.0 - t).powi(2)
    }

    /// Speeds of a wave that never comes to rest; its spectrum has more than one peak.
    fn wave(count: usize, rate_hz: f64) -> Vec<f64> {
        let time = (0..count).map(|index| index as f64 / rate_hz);
        time.map(|t| 1.0 + 0.5 * (7.0 * t).sin() + 0.3 * (19.0 * t + 0.4).cos().abs()).collect()
    }

    /// Expected values from the authors' formula, computed with `numpy.fft.fft` (numpy 2).
    #[test]
    fn arc_length_matches_a_fast_fourier_transform() {
        let bells: Vec<f64> = (0..1000).map(|index| bell(f64::from(index) / 1000.0)).collect();
        for (speeds, rate_hz, expected) in
            [(bells, 1000.0, BELL), (wave(300, 100.0), 100.0, WAVE_100), (wave(777, 250.0), 250.0, WAVE_250)]
        {
            let found = spectral_arc_length(&speeds, rate_hz).expect("enough speeds");
            assert!((found - expected).abs() < 1e-9, "{found}, expected {expected}");
        }
    }

    const BELL: f64 = -1.402_426_062_910_870_5;
    const WAVE_100: f64 = -3.368_784_644_398_684;
    const WAVE_250: f64 = -2.891_275_673_101_556_5;

    #[test]
    fn short_or_motionless_speeds_have_no_smoothness() {
        assert_eq!(spectral_arc_length(&[0.0; 100], 100.0), None);
        assert_eq!(spectral_arc_length(&[1.0; 7], 100.0), None);
        assert_eq!(spectral_arc_length(&[1.0; 70], 0.0), None);
    }
}
