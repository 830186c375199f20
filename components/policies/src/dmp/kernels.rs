//! The canonical system in closed form and the normalised kernels that ride on it.

/// How the forcing term fades as the movement ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gate {
    /// `gate = s`: never exactly zero, `exp(-decay)` of the start value is left at the nominal end (Ijspeert 2013).
    Phase,
    /// `gate = (s - s(1)) / (1 - s(1))` until the nominal end, zero from there on.
    Finite,
}

/// Gaussian kernels over the phase `s(p) = exp(-decay p)`.
///
/// `p` is the progress of the movement: elapsed time over duration, 0 at the start and 1 at the nominal end. The phase
/// is always computed from `p` in closed form, so it does not drift with the step width.
///
/// Kernel `i` of `n` is `psi_i(s) = exp(-h_i (s - c_i)^2)`, centred at the phase of the evenly spaced progress
/// `i / (n - 1)`, and as wide as makes it worth `overlap` at the centre of its successor:
/// `h_i = -ln(overlap) / (c_{i+1} - c_i)^2` (the last one takes the width of its neighbour). The features of the
/// forcing term are the kernels divided by their sum and multiplied by the [`Gate`].
#[derive(Clone, Debug, PartialEq)]
pub struct Kernels {
    decay: f64,
    gate: Gate,
    final_phase: f64,
    centres: Vec<f64>,
    widths: Vec<f64>,
}

/// Exponents below this one are worth less than a rounding error beside the largest kernel.
const NEGLIGIBLE: f64 = -50.0;

impl Kernels {
    /// `count >= 2` kernels; `decay > 0`; `overlap` in (0, 1). The caller has checked the ranges.
    pub(crate) fn new(count: usize, decay: f64, overlap: f64, gate: Gate) -> Self {
        let centres: Vec<f64> = (0..count).map(|i| (-decay * i as f64 / (count - 1) as f64).exp()).collect();
        let mut widths: Vec<f64> =
            centres.windows(2).map(|pair| -overlap.ln() / (pair[1] - pair[0]).powi(2)).collect();
        widths.extend(widths.last().copied());
        Self { decay, gate, final_phase: (-decay).exp(), centres, widths }
    }

    /// Number of kernels.
    pub fn count(&self) -> usize {
        self.centres.len()
    }

    /// The phase `s` at a progress: 1 at the start, `exp(-decay)` at the nominal end.
    pub fn phase(&self, progress: f64) -> f64 {
        (-self.decay * progress).exp()
    }

    /// The factor that fades the forcing term at a progress.
    pub fn gate(&self, progress: f64) -> f64 {
        let phase = self.phase(progress);
        match self.gate {
            Gate::Phase => phase,
            Gate::Finite if progress < 1.0 => (phase - self.final_phase) / (1.0 - self.final_phase),
            Gate::Finite => 0.0,
        }
    }

    /// One kernel at a phase, neither gated nor normalised.
    pub fn kernel(&self, index: usize, phase: f64) -> f64 {
        let distance = phase - self.centres[index];
        (-self.widths[index] * distance * distance).exp()
    }

    /// Writes the gated, normalised activation of every kernel at a progress into `features` (one per kernel).
    ///
    /// The exponents are taken relative to the largest one, so the sum is at least 1 and the quotient stays defined
    /// however far the phase has run past the last centre.
    pub fn features_into(&self, progress: f64, features: &mut [f64]) {
        debug_assert_eq!(features.len(), self.count());
        let gate = self.gate(progress);
        if gate == 0.0 {
            features.fill(0.0);
            return;
        }
        let phase = self.phase(progress);
        let mut largest = f64::NEG_INFINITY;
        for ((feature, centre), width) in features.iter_mut().zip(&self.centres).zip(&self.widths) {
            *feature = -width * (phase - centre) * (phase - centre);
            largest = largest.max(*feature);
        }
        let mut sum = 0.0;
        for feature in features.iter_mut() {
            let exponent = *feature - largest;
            *feature = if exponent < NEGLIGIBLE { 0.0 } else { exponent.exp() };
            sum += *feature;
        }
        let factor = gate / sum;
        features.iter_mut().for_each(|feature| *feature *= factor);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ungated_features_sum_to_one_everywhere_even_far_past_the_end() {
        let kernels = Kernels::new(500, 25.0 / 3.0, 0.8, Gate::Phase);
        let mut features = vec![0.0; 500];
        for progress in [0.0, 0.1, 0.5, 1.0, 3.0, 20.0, 80.0] {
            kernels.features_into(progress, &mut features);
            let sum: f64 = features.iter().sum::<f64>() / kernels.gate(progress);
            assert!((sum - 1.0).abs() < 1e-12, "at progress {progress} the sum is {sum}");
        }
    }

    #[test]
    fn a_kernel_is_worth_the_overlap_at_the_centre_of_its_successor() {
        let kernels = Kernels::new(7, 4.0, 0.7, Gate::Phase);
        for i in 0..6 {
            let at_next = (-kernels.widths[i] * (kernels.centres[i + 1] - kernels.centres[i]).powi(2)).exp();
            assert!((at_next - 0.7).abs() < 1e-12);
        }
    }

    #[test]
    fn the_finite_gate_starts_at_one_and_is_zero_from_the_end_on() {
        let kernels = Kernels::new(5, 4.0, 0.8, Gate::Finite);
        assert!((kernels.gate(0.0) - 1.0).abs() < 1e-15);
        assert!(kernels.gate(1.0 - 1e-9) < 1e-8);
        let mut features = [1.0; 5];
        kernels.features_into(1.0, &mut features);
        assert_eq!(features, [0.0; 5]);
    }
}
