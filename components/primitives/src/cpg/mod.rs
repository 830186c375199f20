//! Central pattern generators: coupled oscillators that turn a few slow commands into rhythms.
//!
//! - [`PhaseNetwork`] (Ijspeert et al. 2007), with a phase, an amplitude and an offset per unit:
//!   `phi_i' = 2 pi nu + sum_j a_j w_ij sin(phi_j - phi_i - phi_ij)`, amplitude and offset by critically
//!   damped springs, `y_i = o_i + a_i cos(phi_i)`.
//! - [`HopfNetwork`] (Righetti and Ijspeert 2008), with x and y per unit:
//!   `z' = gamma (mu - r^2) z + omega J z + coupling`, with a separate `omega` for swing and stance.
//! - [`MatsuokaOscillator`] (Matsuoka 1985), with a membrane potential and a fatigue per unit:
//!   `tau_1 u' = -u - beta v - W y + c + s`, `tau_2 v' = -v + y`, `y = max(0, u)`.
//! - [`Kuramoto`] (Kuramoto 1975), with a phase per unit:
//!   `phi_i' = omega_i + sum_j k_ij sin(phi_j - phi_i - phi_ij)`.
//!
//! [`OscillatorNetwork`] builds a gait from any of the last three models, with one oscillator per leg and the
//! same coupling for every model.
//!
//! `phi_ij` is the lead of `j` over `i`. A pattern is consistent if `phi_ij = -phi_ji` and the lags around
//! every loop add up to whole turns. If and only if a pattern is consistent, the lags are differences of one
//! phase per unit, `phi_ij = theta_j - theta_i`; [`consistent_phases`] finds these phases or names the faulty
//! loop. The networks store `theta`, so the pattern stays consistent even during the transition from one
//! [`Gait`] to another.
//!
//! Phases, amplitudes and potentials are integrated by the classical Runge-Kutta method, springs exactly. All
//! nodes step simultaneously from the previous state. Only construction allocates.
//!
//! References: Ijspeert, Crespi, Ryczko, Cabelguen, *From swimming to walking with a salamander robot driven
//! by a spinal cord model*, Science 315, 2007. Ijspeert, *Central pattern generators for locomotion control
//! in animals and robots*, Neural Networks 21, 2008. Righetti, Ijspeert, *Pattern generators with sensory
//! feedback for the control of quadruped locomotion*, ICRA 2008. Matsuoka, *Sustained oscillations generated
//! by mutually inhibiting neurons with adaptation*, Biological Cybernetics 52, 1985, and *Mechanisms of
//! frequency and pattern control in the neural rhythm generators*, 56,
//! 1987. Adler, *A study of locking phenomena in oscillators*, Proc. IRE 34, 1946.

mod cycle;
mod entrainment;
mod follower;
mod gait;
mod hopf;
mod kuramoto;
mod lags;
mod matsuoka;
mod network;
mod oscillator_network;
mod oscillators;
mod phases;

use crate::ValueError;
pub use entrainment::Entrainment;
pub use gait::{Gait, GaitError};
pub use hopf::{HopfNetwork, HopfSettings};
pub use kuramoto::Kuramoto;
pub use lags::{Lag, LagError, consistent_phases};
pub use matsuoka::{MatsuokaOscillator, MatsuokaSettings};
pub use network::{LegSettings, NetworkSettings, Node, PhaseNetwork};
pub use oscillator_network::{JointOscillation, OscillatorNetwork, OscillatorNetworkSettings};
pub use oscillators::Oscillator;

/// Error returned when a pattern generator cannot be created or commanded. The generator is left unchanged.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CpgError {
    /// A number, vector or matrix is invalid.
    #[error(transparent)]
    Value(#[from] ValueError),
    /// The gait is not defined for this number of legs.
    #[error(transparent)]
    Gait(#[from] GaitError),
    /// The lags contradict each other.
    #[error(transparent)]
    Lags(#[from] LagError),
}

fn positive(name: &'static str, value: f64) -> Result<(), CpgError> {
    let holds = value > 0.0 && value.is_finite();
    if holds {
        Ok(())
    } else {
        Err(CpgError::Value(ValueError::OutOfRange { name, value, expected: "a positive number" }))
    }
}

fn finite(name: &'static str, values: &[f64]) -> Result<(), CpgError> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => {
            Err(CpgError::Value(ValueError::OutOfRange { name, value, expected: "finite numbers" }))
        }
        None => Ok(()),
    }
}

fn size(name: &'static str, found: usize, expected: usize) -> Result<(), CpgError> {
    if found == expected { Ok(()) } else { Err(CpgError::Value(ValueError::Size { name, found, expected })) }
}
