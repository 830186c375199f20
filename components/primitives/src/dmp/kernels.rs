//! The canonical system in closed form, and the normalised kernels over its phase.

use std::ops::Range;

use super::exponential::exp_of_negative;

/// Decay of the forcing term towards the end of the movement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gate {
    /// `gate = s`. The gate is never exactly zero: a fraction `exp(-decay)` of the initial value remains at
    /// the nominal end (Ijspeert 2013).
    Phase,
    /// `gate = (s - s(1)) / (1 - s(1))` until the nominal end, and zero afterwards.
    Finite,
}

/// Gaussian kernels over the phase `s(p) = exp(-decay p)`.
///
/// `p` is the progress of the movement: elapsed time divided by duration, 0 at the start and 1 at the nominal
/// end. The phase is computed from `p` in closed form, so it does not depend on the step width.
///
/// Kernel `i` of `n` is `psi_i(s) = exp(-h_i (s - c_i)^2)`. The kernel is centred at the phase of the evenly
/// spaced progress `i / (n - 1)`, and its value at the centre of its successor is `overlap`:
/// `h_i = -ln(overlap) / (c_{i+1} - c_i)^2`. The last kernel has the width of its neighbour. The features of
/// the forcing term are the kernels divided by their sum and multiplied by the [`Gate`].
#[derive(Clone, Debug, PartialEq)]
pub struct Kernels {
    decay: f64,
    overlap: f64,
    gate: Gate,
    final_phase: f64,
    centres: Vec<f64>,
    widths: Vec<f64>,
    /// Number of non-negligible kernels before and after the nearest one.
    reach: [usize; 2],
}

/// Range of non-negligible kernels at a progress, and the phase there.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Activation {
    pub(super) kernels: Range<usize>,
    pub(super) phase: f64,
}

/// Exponents below this are smaller than a rounding error of the largest kernel.
const NEGLIGIBLE: f64 = -40.0;

impl Kernels {
    /// Creates `count >= 2` kernels with `decay > 0` and `overlap` in (0, 1). The caller has checked the
    /// ranges.
    pub(crate) fn new(count: usize, decay: f64, overlap: f64, gate: Gate) -> Self {
        let centres: Vec<f64> = (0..count).map(|i| (-decay * i as f64 / (count - 1) as f64).exp()).collect();
        let mut widths: Vec<f64> =
            centres.windows(2).map(|pair| -overlap.ln() / (pair[1] - pair[0]).powi(2)).collect();
        widths.extend(widths.last().copied());
        let mut kernels = Self {
            decay,
            overlap,
            gate,
            final_phase: (-decay).exp(),
            centres,
            widths,
            reach: [count, count],
        };
        kernels.reach = [kernels.reach_of(false), kernels.reach_of(true)];
        kernels
    }

    /// Smallest distance, in kernels, beyond which a kernel is negligible at the centre of any kernel before
    /// (or after) it, and therefore at any phase farther away.
    fn reach_of(&self, later: bool) -> usize {
        let count = self.count();
        let negligible = |distance: usize| {
            (0..count.saturating_sub(distance)).all(|i| {
                let (at, kernel) = if later { (i, i + distance) } else { (i + distance, i) };
                let d = self.centres[at] - self.centres[kernel];
                -self.widths[kernel] * d * d < NEGLIGIBLE
            })
        };
        (1..count).find(|distance| negligible(*distance)).unwrap_or(count)
    }

    /// Returns the number of kernels.
    pub fn count(&self) -> usize {
        self.centres.len()
    }

    /// Returns the phase `s` at this progress: 1 at the start, `exp(-decay)` at the nominal end.
    pub fn phase(&self, progress: f64) -> f64 {
        (-self.decay * progress).exp()
    }

    /// Returns the factor that fades the forcing term at this progress.
    pub fn gate(&self, progress: f64) -> f64 {
        self.gate_at(progress, self.phase(progress))
    }

    fn gate_at(&self, progress: f64, phase: f64) -> f64 {
        match self.gate {
            Gate::Phase => phase,
            Gate::Finite if progress < 1.0 => (phase - self.final_phase) / (1.0 - self.final_phase),
            Gate::Finite => 0.0,
        }
    }

    /// Returns the value of one kernel at this phase, neither gated nor normalised.
    pub fn kernel(&self, index: usize, phase: f64) -> f64 {
        let distance = phase - self.centres[index];
        (-self.widths[index] * distance * distance).exp()
    }

    /// Writes the gated, normalised activation of every kernel at this progress into `features`, one entry
    /// per kernel.
    ///
    /// Exponents are relative to the largest exponent. The sum is therefore at least 1, and the quotient is
    /// defined even for phases far past the last centre.
    pub fn features_into(&self, progress: f64, features: &mut [f64]) {
        let active = self.activate(progress, features);
        features[..active.kernels.start].fill(0.0);
        features[active.kernels.end..].fill(0.0);
    }

    /// Like [`features_into`](Self::features_into), but writes only the non-negligible activations.
    pub(super) fn activate(&self, progress: f64, features: &mut [f64]) -> Activation {
        debug_assert_eq!(features.len(), self.count());
        let phase = self.phase(progress);
        let gate = self.gate_at(progress, phase);
        if gate == 0.0 {
            return Activation { kernels: 0..0, phase };
        }
        let kernels = self.window(progress);
        let (centres, widths) = (&self.centres[kernels.clone()], &self.widths[kernels.clone()]);
        let features = &mut features[kernels.clone()];
        // within the movement, the preceding kernel is at least `overlap`; past the end, all kernels may be
        // tiny
        let largest = if (0.0..=1.0).contains(&progress) && self.overlap > 1e-3 {
            0.0
        } else {
            let exponents = centres.iter().zip(widths).map(|(c, h)| -h * (phase - c) * (phase - c));
            exponents.fold(f64::NEG_INFINITY, f64::max)
        };
        let (blocks, rest) = features.as_chunks_mut::<4>();
        let (centre_blocks, centre_rest) = centres.as_chunks::<4>();
        let (width_blocks, width_rest) = widths.as_chunks::<4>();
        let mut strands = [0.0; 4];
        for ((block, centres), widths) in blocks.iter_mut().zip(centre_blocks).zip(width_blocks) {
            for k in 0..4 {
                let distance = phase - centres[k];
                block[k] = exp_of_negative(-widths[k] * distance * distance - largest);
            }
            for k in 0..4 {
                strands[k] += block[k];
            }
        }
        let mut sum = strands.iter().sum::<f64>();
        for ((feature, centre), width) in rest.iter_mut().zip(centre_rest).zip(width_rest) {
            let distance = phase - centre;
            *feature = exp_of_negative(-width * distance * distance - largest);
            sum += *feature;
        }
        let factor = gate / sum;
        features.iter_mut().for_each(|feature| *feature *= factor);
        Activation { kernels, phase }
    }

    /// Range of non-negligible kernels at a progress.
    fn window(&self, progress: f64) -> Range<usize> {
        let count = self.count();
        // far past the end, the early, wide kernels become significant again compared with the last one
        if !(0.0..=1.0).contains(&progress) {
            return 0..count;
        }
        let before = ((progress * (count - 1) as f64) as usize).min(count - 1);
        // whole blocks of four
        let (first, end) = ((before + 1).saturating_sub(self.reach[0]), before + 1 + self.reach[1]);
        first & !3..end.next_multiple_of(4).min(count)
    }
}

/// Inner product of two vectors of equal length, with several independent accumulators.
#[inline]
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<4>(), b.as_chunks::<4>());
    let mut strands = [0.0; 4];
    for (a, b) in a.iter().zip(b) {
        for k in 0..4 {
            strands[k] += a[k] * b[k];
        }
    }
    strands.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ungated_features_sum_to_one_even_past_the_end() {
        let kernels = Kernels::new(500, 25.0 / 3.0, 0.8, Gate::Phase);
        let mut features = vec![0.0; 500];
        for progress in [0.0, 0.1, 0.5, 1.0, 3.0, 20.0, 80.0] {
            kernels.features_into(progress, &mut features);
            let sum: f64 = features.iter().sum::<f64>() / kernels.gate(progress);
            assert!((sum - 1.0).abs() < 1e-12, "at progress {progress} the sum is {sum}");
        }
    }

    #[test]
    fn kernel_equals_overlap_at_the_next_centre() {
        let kernels = Kernels::new(7, 4.0, 0.7, Gate::Phase);
        for i in 0..6 {
            let at_next = (-kernels.widths[i] * (kernels.centres[i + 1] - kernels.centres[i]).powi(2)).exp();
            assert!((at_next - 0.7).abs() < 1e-12);
        }
    }

    #[test]
    fn finite_gate_falls_from_one_to_zero_at_the_end() {
        let kernels = Kernels::new(5, 4.0, 0.8, Gate::Finite);
        assert!((kernels.gate(0.0) - 1.0).abs() < 1e-15);
        assert!(kernels.gate(1.0 - 1e-9) < 1e-8);
        let mut features = [1.0; 5];
        kernels.features_into(1.0, &mut features);
        assert_eq!(features, [0.0; 5]);
    }

    /// Compares with the formula evaluated for every kernel.
    #[test]
    fn omitted_kernels_are_below_rounding() {
        for (count, decay, overlap) in [(50, 4.6, 0.8), (20, 8.0, 0.3), (2, 4.6, 0.8), (200, 1.0, 0.9)] {
            let kernels = Kernels::new(count, decay, overlap, Gate::Phase);
            let mut features = vec![0.0; count];
            for k in 0..=300 {
                let progress = f64::from(k) / 250.0;
                kernels.features_into(progress, &mut features);
                let phase = kernels.phase(progress);
                let all: Vec<f64> = (0..count).map(|i| kernels.kernel(i, phase)).collect();
                let sum: f64 = all.iter().sum();
                for (feature, kernel) in features.iter().zip(&all) {
                    assert!((feature - phase * kernel / sum).abs() < 4e-16 * count as f64);
                }
            }
        }
    }
}
