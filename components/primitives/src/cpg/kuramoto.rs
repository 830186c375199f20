//! Kuramoto's coupled phases.

use nalgebra::DMatrix;

use super::phases::{CoupledPhases, Influence};
use super::{CpgError, finite, size};

/// A network of Kuramoto oscillators: `phi_i' = omega_i + sum_j k_ij sin(phi_j - phi_i - phi_ij)`, with
/// `phi_ij = theta_j - theta_i`.
#[derive(Clone, Debug)]
pub struct Kuramoto {
    phases: CoupledPhases,
    omega: Vec<f64>,
    theta: Vec<f64>,
    ones: Vec<f64>,
    wrapped: Vec<f64>,
}

impl Kuramoto {
    /// Creates oscillators from their natural angular velocities (rad/s), the couplings `k` (entry `k_ij`:
    /// action of oscillator j on i, rad/s) and the phases `theta` of the pattern (rad; zeros synchronise).
    /// The phases start at `theta`.
    ///
    /// # Errors
    /// [`CpgError`] if sizes do not match, or a number is not finite.
    pub fn new(omega: Vec<f64>, couplings: DMatrix<f64>, theta: Vec<f64>) -> Result<Self, CpgError> {
        let n = omega.len();
        size("the phases of the pattern", theta.len(), n)?;
        size("the rows of the couplings", couplings.nrows(), n)?;
        size("the columns of the couplings", couplings.ncols(), n)?;
        finite("omega", &omega)?;
        finite("couplings", couplings.as_slice())?;
        finite("theta", &theta)?;
        let mut kuramoto = Self {
            phases: CoupledPhases::new(couplings, theta.clone()),
            omega,
            theta,
            ones: vec![1.0; n],
            wrapped: vec![0.0; n],
        };
        kuramoto.wrap();
        Ok(kuramoto)
    }

    /// Sets the phases, rad.
    ///
    /// # Errors
    /// [`CpgError`] if the length is wrong, or a number is not finite.
    pub fn set_phases(&mut self, phases: &[f64]) -> Result<(), CpgError> {
        size("phases", phases.len(), self.omega.len())?;
        finite("phases", phases)?;
        self.phases.phase.copy_from_slice(phases);
        self.wrap();
        Ok(())
    }

    /// Advances by `dt` seconds.
    pub fn step(&mut self, dt: f64) {
        self.step_entrained(dt, &[]);
    }

    /// Advances like [`step`](Self::step), with `pull[i]` (rad/s) added to the rate of each phase; see
    /// [`Entrainment`](super::Entrainment). An empty slice means no entrainment.
    pub fn step_entrained(&mut self, dt: f64, pull: &[f64]) {
        let (omega, theta) = (&self.omega, &self.theta);
        let amplitude = [&self.ones[..]; 3];
        self.phases.step(dt, &Influence { omega, pull, theta, amplitude });
        self.wrap();
    }

    /// Returns the phases in \[0, 2 pi), rad.
    pub fn phases(&self) -> &[f64] {
        &self.wrapped
    }

    /// Returns the order parameter `r = |sum_j exp(i (phi_j - theta_j))| / n`: 1 in the pattern, near 0 for
    /// incoherent phases.
    pub fn order(&self) -> f64 {
        let (mut real, mut imaginary) = (0.0, 0.0);
        for (phase, theta) in self.phases.phase.iter().zip(&self.theta) {
            let (sine, cosine) = (phase - theta).sin_cos();
            real += cosine;
            imaginary += sine;
        }
        real.hypot(imaginary) / self.omega.len() as f64
    }

    fn wrap(&mut self) {
        for (wrapped, phase) in self.wrapped.iter_mut().zip(&mut self.phases.phase) {
            *phase = phase.rem_euclid(std::f64::consts::TAU);
            *wrapped = *phase;
        }
    }
}
