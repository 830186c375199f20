//! Coupled phases, advanced together by the classical Runge-Kutta method.

use nalgebra::DMatrix;

/// Coupled phases: `phi_i' = omega_i + p_i + sum_j a_j w_ij sin(psi_j - psi_i)`, `psi_i = phi_i - theta_i`.
///
/// The sine of a difference is computed from the sines and cosines of both angles, so a step needs `4 n` of
/// them instead of `4 n^2`.
#[derive(Clone, Debug)]
pub(super) struct CoupledPhases {
    /// Row i: how strongly each j acts on i.
    weights: DMatrix<f64>,
    pub(super) phase: Vec<f64>,
    /// Rate at the current phases, rad/s.
    pub(super) rate: Vec<f64>,
    stages: [Vec<f64>; 4],
    moved: Vec<f64>,
    sine: Vec<f64>,
    cosine: Vec<f64>,
}

/// Inputs to the phases within a step. Amplitudes are at its beginning, middle and end.
pub(super) struct Influence<'a> {
    /// Natural angular velocity of every oscillator, rad/s.
    pub(super) omega: &'a [f64],
    /// Entrainment added to it, rad/s; empty for none.
    pub(super) pull: &'a [f64],
    /// The phase of every oscillator in the pattern, rad.
    pub(super) theta: &'a [f64],
    /// Amplitudes: the weight of every oscillator in the coupling.
    pub(super) amplitude: [&'a [f64]; 3],
}

impl CoupledPhases {
    pub(super) fn new(weights: DMatrix<f64>, phase: Vec<f64>) -> Self {
        let zeros = vec![0.0; phase.len()];
        let stages = std::array::from_fn(|_| zeros.clone());
        Self {
            weights,
            rate: zeros.clone(),
            stages,
            moved: zeros.clone(),
            sine: zeros.clone(),
            cosine: zeros,
            phase,
        }
    }

    /// Advances the phases by `dt` seconds without wrapping them.
    pub(super) fn step(&mut self, dt: f64, influence: &Influence<'_>) {
        for (stage, (fraction, amplitude)) in [(0.0, 0), (0.5, 1), (0.5, 1), (1.0, 2)].into_iter().enumerate()
        {
            for i in 0..self.phase.len() {
                let slope = if stage == 0 { 0.0 } else { self.stages[stage - 1][i] };
                self.moved[i] = self.phase[i] + fraction * dt * slope;
            }
            self.rates(stage, influence, amplitude);
        }
        for i in 0..self.phase.len() {
            let [a, b, c, d] = [0, 1, 2, 3].map(|stage| self.stages[stage][i]);
            self.phase[i] += dt / 6.0 * (a + 2.0 * b + 2.0 * c + d);
        }
        self.observe(influence);
    }

    /// Writes the rates at the current phases.
    pub(super) fn observe(&mut self, influence: &Influence<'_>) {
        self.moved.copy_from_slice(&self.phase);
        self.rates(0, influence, 2);
        self.rate.copy_from_slice(&self.stages[0]);
    }

    fn rates(&mut self, stage: usize, influence: &Influence<'_>, amplitude: usize) {
        let Influence { omega, pull, theta, amplitude: amplitudes } = influence;
        let amplitudes = amplitudes[amplitude];
        for i in 0..self.phase.len() {
            (self.sine[i], self.cosine[i]) = (self.moved[i] - theta[i]).sin_cos();
        }
        for i in 0..self.phase.len() {
            let (mut sines, mut cosines) = (0.0, 0.0);
            for (j, amplitude) in amplitudes.iter().enumerate() {
                let weight = amplitude * self.weights[(i, j)];
                sines += weight * self.sine[j];
                cosines += weight * self.cosine[j];
            }
            let pull = pull.get(i).copied().unwrap_or(0.0);
            self.stages[stage][i] = omega[i] + pull + sines * self.cosine[i] - cosines * self.sine[i];
        }
    }
}
