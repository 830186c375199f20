//! Evenly spaced samples of a recording.

use nalgebra::DMatrix;

use crate::{Recording, RecordingError};

/// Sample rate for filtering, as a multiple of the cutoff. High enough to resolve the kernel.
const OVERSAMPLING: f64 = 20.0;

/// Minimum duration of a recording in cutoff periods. A slower filter would average over far more than the
/// recording.
const FEWEST_PERIODS: f64 = 0.1;

/// Maximum deviation from even spacing at which samples count as evenly spaced, in sample steps.
const UNEVENNESS: f64 = 0.01;

impl Recording {
    /// Returns a matrix (samples x channels) with the same number of samples, evenly spaced in time. If all
    /// times are even to 1 % of a step, the values are returned unchanged. Otherwise they are interpolated as
    /// by [`evenly`](Self::evenly).
    pub fn evenly_spaced(&self) -> DMatrix<f64> {
        let step = self.duration() / (self.samples() - 1) as f64;
        let is_even = self
            .times
            .iter()
            .enumerate()
            .all(|(k, time)| (time - self.times[0] - k as f64 * step).abs() <= UNEVENNESS * step);
        if is_even { self.values.clone() } else { self.interpolated(self.samples()) }
    }

    /// Returns the recording resampled to `samples` evenly spaced samples, as a matrix (samples x channels).
    /// Values are interpolated by a cubic spline and, with a `cutoff` \[Hz\], smoothed by a low-pass filter.
    ///
    /// The interpolation is a cubic Hermite spline whose slopes come from a parabola through each sample and
    /// its neighbours. The filter is a Gaussian in time with the standard deviation
    /// `sqrt(ln 2) / (2 pi cutoff)`, which halves the power at the cutoff frequency. The filter has no delay
    /// and no overshoot. Beyond both ends, the recording continues as its own point reflection, so the filter
    /// does not change the first and the last sample.
    ///
    /// # Errors
    /// `samples` is less than 2, the cutoff is not positive, or the period of the cutoff frequency is over
    /// ten times the duration.
    pub fn evenly(&self, samples: usize, cutoff: Option<f64>) -> Result<DMatrix<f64>, RecordingError> {
        if samples < 2 {
            return Err(RecordingError::TooShort { found: samples, expected: 2 });
        }
        let Some(cutoff) = cutoff else { return Ok(self.interpolated(samples)) };
        if !(cutoff > 0.0 && cutoff.is_finite()) {
            let expected = "a positive number of Hz";
            return Err(RecordingError::OutOfRange { name: "cutoff", value: cutoff, expected });
        }
        if cutoff * self.duration() < FEWEST_PERIODS {
            let expected = "at least a tenth of the inverse of the duration";
            return Err(RecordingError::OutOfRange { name: "cutoff", value: cutoff, expected });
        }
        let wanted = (self.duration() * cutoff * OVERSAMPLING).ceil().clamp(16.0, 200_000.0) as usize;
        // a whole number of fine steps between two output samples, so that nothing is interpolated twice
        let substeps = wanted.div_ceil(samples - 1).max(1);
        let fine = self.interpolated((samples - 1) * substeps + 1);
        let dt = self.duration() / (fine.nrows() - 1) as f64;
        let deviation = 2.0_f64.ln().sqrt() / (std::f64::consts::TAU * cutoff) / dt;
        let reach = (5.0 * deviation).ceil() as isize;
        let kernel: Vec<f64> =
            (-reach..=reach).map(|k| (-0.5 * (k as f64 / deviation).powi(2)).exp()).collect();
        let total: f64 = kernel.iter().sum();
        let last = fine.nrows() as isize - 1;
        let filtered = DMatrix::from_fn(samples, fine.ncols(), |k, channel| {
            let centre = (k * substeps) as isize;
            let sum: f64 = (-reach..=reach)
                .zip(&kernel)
                .map(|(offset, weight)| weight * reflected(&fine, centre + offset, last, channel))
                .sum();
            sum / total
        });
        Ok(filtered)
    }

    /// Returns a continuous curve through the samples, interpolated as by [`evenly`](Self::evenly).
    pub fn interpolation(&self) -> Interpolation {
        Interpolation { times: self.times.clone(), values: self.values.clone(), slopes: self.slopes() }
    }

    fn interpolated(&self, samples: usize) -> DMatrix<f64> {
        let (first, duration) = (self.times[0], self.duration());
        let curve = self.interpolation();
        let mut out = DMatrix::zeros(samples, self.names.len());
        for k in 0..samples {
            let time = first + duration * k as f64 / (samples - 1) as f64;
            let interval = curve.interval(time);
            for channel in 0..self.names.len() {
                out[(k, channel)] = curve.cubic(interval, time, channel).0;
            }
        }
        out
    }

    /// Returns the slope at every sample, from the parabola through it and its neighbours.
    fn slopes(&self) -> DMatrix<f64> {
        let n = self.times.len();
        let secant = |k: usize, channel: usize| {
            (self.values[(k + 1, channel)] - self.values[(k, channel)]) / (self.times[k + 1] - self.times[k])
        };
        DMatrix::from_fn(n, self.names.len(), |k, channel| {
            if n == 2 {
                return secant(0, channel);
            }
            let middle = k.clamp(1, n - 2);
            let (before, after) =
                (self.times[middle] - self.times[middle - 1], self.times[middle + 1] - self.times[middle]);
            let (s0, s1) = (secant(middle - 1, channel), secant(middle, channel));
            let curvature = (s1 - s0) / (before + after);
            let at_middle = s0 + curvature * before;
            at_middle + 2.0 * curvature * (self.times[k] - self.times[middle])
        })
    }
}

/// A continuous curve through a recording: a piecewise cubic through every sample with continuous velocity.
///
/// ```
/// use motorium_recordings::{Selection, read_text};
///
/// let recording = read_text("x.csv", "time_s,x\n1,0\n2,1\n4,9\n", &Selection::default())?;
/// let curve = recording.interpolation();
/// let (mut position, mut velocity) = ([0.0], [0.0]);
/// curve.evaluate(3.0, &mut position, &mut velocity);
/// assert_eq!(position, [9.0]);
/// # Ok::<(), motorium_recordings::RecordingError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Interpolation {
    times: Vec<f64>,
    values: DMatrix<f64>,
    slopes: DMatrix<f64>,
}

impl Interpolation {
    /// Returns the number of channels.
    pub fn channels(&self) -> usize {
        self.values.ncols()
    }

    /// Returns the time from the first sample to the last, s.
    pub fn duration(&self) -> f64 {
        self.times[self.times.len() - 1] - self.times[0]
    }

    /// Writes the values and their rates (per second) at a time since the first sample \[s\]. Outside the
    /// recording, the first or last sample is used. Does not allocate.
    ///
    /// # Panics
    /// If a slice is shorter than the number of channels.
    pub fn evaluate(&self, time: f64, values: &mut [f64], rates: &mut [f64]) {
        let time = self.times[0] + time.clamp(0.0, self.duration());
        let interval = self.interval(time);
        for channel in 0..self.channels() {
            (values[channel], rates[channel]) = self.cubic(interval, time, channel);
        }
    }

    /// Returns the index of the sample before a time.
    fn interval(&self, time: f64) -> usize {
        let before = self.times.partition_point(|sample| *sample <= time);
        before.saturating_sub(1).min(self.times.len() - 2)
    }

    /// Returns value and rate of a channel in an interval.
    fn cubic(&self, interval: usize, time: f64, channel: usize) -> (f64, f64) {
        let width = self.times[interval + 1] - self.times[interval];
        let u = ((time - self.times[interval]) / width).clamp(0.0, 1.0);
        let (a, b) = (1.0 - u, u);
        let (y0, y1) = (self.values[(interval, channel)], self.values[(interval + 1, channel)]);
        let (m0, m1) =
            (self.slopes[(interval, channel)] * width, self.slopes[(interval + 1, channel)] * width);
        let value = a * a * ((1.0 + 2.0 * b) * y0 + b * m0) + b * b * ((1.0 + 2.0 * a) * y1 - a * m1);
        let slope = 6.0 * a * b * (y1 - y0) + (a * a - 2.0 * a * b) * m0 + (b * b - 2.0 * a * b) * m1;
        (value, slope / width)
    }
}

/// Returns a sample, with point reflection beyond the ends.
fn reflected(values: &DMatrix<f64>, index: isize, last: isize, channel: usize) -> f64 {
    let at = |index: isize| values[(index.clamp(0, last) as usize, channel)];
    if index < 0 {
        2.0 * at(0) - at(-index)
    } else if index > last {
        2.0 * at(last) - at(2 * last - index)
    } else {
        at(index)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn evenly_sampled_times_are_kept_others_interpolated() {
        let f = |t: f64| t * t;
        let even = recorded(&[0.0, 0.333, 0.667, 1.0], f);
        assert_eq!(even.evenly_spaced(), *even.values());
        let uneven = recorded(&[0.0, 0.1, 0.2, 1.2], f).evenly_spaced();
        assert!((0..4).all(|k| (uneven[(k, 0)] - f(0.4 * k as f64)).abs() < 1e-12), "{uneven}");
    }

    fn recorded(times: &[f64], f: impl Fn(f64) -> f64) -> Recording {
        let values = DMatrix::from_iterator(times.len(), 1, times.iter().map(|t| f(*t)));
        Recording::new(vec!["y".into()], times.to_vec(), values).unwrap()
    }

    #[test]
    fn unevenly_sampled_parabola_is_reproduced_exactly() {
        let f = |t: f64| 1.0 - 2.0 * t + 3.0 * t * t;
        let even = recorded(&[1.0, 1.1, 1.5, 1.6, 2.4, 3.0], f).evenly(41, None).unwrap();
        for k in 0..41 {
            assert!((even[(k, 0)] - f(1.0 + 0.05 * k as f64)).abs() < 1e-12);
        }
    }

    #[test]
    fn interpolation_passes_through_samples_with_its_rate() {
        let f = |t: f64| 1.0 - 2.0 * t + 3.0 * t * t;
        let curve = recorded(&[1.0, 1.1, 1.5, 1.6, 2.4, 3.0], f).interpolation();
        let at = |time: f64| {
            let (mut value, mut rate) = ([0.0], [0.0]);
            curve.evaluate(time, &mut value, &mut rate);
            (value[0], rate[0])
        };
        for k in 0..=40 {
            let t = 1.0 + 0.05 * f64::from(k);
            let (value, rate) = at(t - 1.0);
            assert!((value - f(t)).abs() < 1e-12 && (rate - (6.0 * t - 2.0)).abs() < 1e-10, "{t}");
        }
        assert_eq!((at(-1.0), at(9.0)), (at(0.0), at(2.0)));
    }

    #[test]
    fn filter_halves_the_power_at_its_cutoff() {
        let times: Vec<f64> = (0..4001).map(|k| f64::from(k) * 1e-3).collect();
        let wave = recorded(&times, |t| (std::f64::consts::TAU * 3.0 * t).sin());
        let filtered = wave.evenly(2001, Some(3.0)).unwrap();
        assert!(
            filtered[(0, 0)].abs() < 1e-12 && (filtered[(2000, 0)] - wave.values()[(4000, 0)]).abs() < 1e-12
        );
        let largest = filtered.rows(500, 1000).amax();
        assert!((largest - 0.5_f64.sqrt()).abs() < 1e-3, "{largest}");
        let slow =
            recorded(&times, |t| (std::f64::consts::TAU * 0.2 * t).sin()).evenly(101, Some(3.0)).unwrap();
        for k in 10..90 {
            let expected = (std::f64::consts::TAU * 0.2 * 0.04 * k as f64).sin();
            assert!((slow[(k, 0)] - expected).abs() < 2e-3);
        }
    }

    #[test]
    fn repeated_time_is_rejected_with_its_sample() {
        let error = Recording::new(vec!["y".into()], vec![0.0, 1.0, 1.0], DMatrix::zeros(3, 1)).unwrap_err();
        assert!(error.to_string().starts_with("sample 3 is at 1 s, not after"), "{error}");
    }
}
