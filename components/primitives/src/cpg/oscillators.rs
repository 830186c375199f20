//! The oscillator models from which a rhythm can be built.

use std::f64::consts::{PI, TAU};

use nalgebra::DMatrix;

use super::cycle::Cycle;
use super::{CpgError, HopfNetwork, HopfSettings, MatsuokaOscillator, MatsuokaSettings};

/// An oscillator model with its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Oscillator {
    /// A phase oscillator whose output is the cosine of the phase.
    Kuramoto,
    /// A point that moves on a circle; the output is `x`. The half of the cycle with `y > 0` is stance and
    /// lasts the fraction `duty_factor` of the stride. The speeds and amplitude in the settings are ignored.
    Hopf(HopfSettings),
    /// A pair of neurons per joint. The output is the difference of their fatigues, `v_0 - v_1`, which has no
    /// corners. Only the ratio of the time constants matters; the tonic input has no effect.
    Matsuoka {
        /// Settings of each neuron.
        settings: MatsuokaSettings,
        /// Inhibition weight `w` between the neurons of a pair.
        inhibition: f64,
    },
}

/// Oscillators of one model, each with its own angular velocity. An oscillator provides a value of amplitude
/// 1, the same value a quarter turn later, and a phase. The phase grows linearly in time and is 0 at the
/// maximum of the value.
#[derive(Clone, Debug)]
pub(super) enum Oscillators {
    Kuramoto { phases: Vec<f64>, omega: Vec<f64> },
    Hopf { oscillators: Vec<HopfNetwork>, settings: HopfSettings, duty_factor: f64 },
    Matsuoka { pairs: Vec<MatsuokaOscillator>, omega: Vec<f64>, cycle: Box<Cycle> },
}

impl Oscillators {
    pub(super) fn new(model: &Oscillator, phases: &[f64], duty_factor: f64) -> Result<Self, CpgError> {
        let mut units = match model {
            Oscillator::Kuramoto => {
                Self::Kuramoto { phases: vec![0.0; phases.len()], omega: vec![0.0; phases.len()] }
            }
            Oscillator::Hopf(settings) => {
                let settings = HopfSettings { amplitude: 1.0, ..*settings };
                let one = HopfNetwork::new(settings, DMatrix::zeros(1, 1), &[0.0])?;
                Self::Hopf { oscillators: vec![one; phases.len()], settings, duty_factor }
            }
            Oscillator::Matsuoka { settings, inhibition } => {
                let settings = MatsuokaSettings { tonic: 1.0, ..*settings };
                let cycle = Box::new(Cycle::measure(settings, *inhibition)?);
                let pair = MatsuokaOscillator::pair(settings, *inhibition)?;
                Self::Matsuoka { pairs: vec![pair; phases.len()], omega: vec![0.0; phases.len()], cycle }
            }
        };
        for (unit, phase) in phases.iter().enumerate() {
            units.set_phase(unit, *phase);
        }
        Ok(units)
    }

    /// Returns `true` if the joints of a leg can have different phases.
    pub(super) fn has_joint_phases(model: &Oscillator) -> bool {
        !matches!(model, Oscillator::Matsuoka { .. })
    }

    /// Puts an oscillator on its cycle at a phase.
    pub(super) fn set_phase(&mut self, unit: usize, phase: f64) {
        match self {
            Self::Kuramoto { phases, .. } => phases[unit] = phase.rem_euclid(TAU),
            Self::Hopf { oscillators, duty_factor, .. } => {
                let phase = phase.rem_euclid(TAU);
                let stance = TAU * *duty_factor;
                let angle = if phase < stance {
                    PI * phase / stance
                } else {
                    PI + PI * (phase - stance) / (TAU - stance)
                };
                // the state is finite and the oscillator exists
                let _ = oscillators[unit].set_state(0, (angle.cos(), angle.sin()));
            }
            Self::Matsuoka { pairs, cycle, .. } => {
                let _ = pairs[unit].set_state(&cycle.state(phase));
            }
        }
    }

    /// Sets the fraction of the stride spent in stance. Used by Hopf oscillators only.
    pub(super) fn set_duty_factor(&mut self, value: f64) {
        if let Self::Hopf { duty_factor, .. } = self {
            *duty_factor = value;
        }
    }

    /// Advances an oscillator by `dt` seconds at `omega` rad/s. Only plain phases can run backwards.
    pub(super) fn advance(&mut self, unit: usize, dt: f64, speed: f64) {
        match self {
            Self::Kuramoto { phases, omega } => {
                omega[unit] = speed;
                phases[unit] = (phases[unit] + speed * dt).rem_euclid(TAU);
            }
            Self::Hopf { oscillators, settings, duty_factor } => {
                let turns = speed.max(1e-9) / TAU;
                // the settings are positive and finite, as at construction
                let _ = oscillators[unit].set_settings(settings.with_stride(turns.recip(), *duty_factor));
                oscillators[unit].step(dt);
            }
            Self::Matsuoka { pairs, omega, cycle } => {
                omega[unit] = speed.max(0.0);
                pairs[unit].step(dt * omega[unit] / TAU * cycle.period);
            }
        }
    }

    /// Returns the value and its rate, and both a quarter turn later (unavailable for pairs of neurons).
    pub(super) fn read(&self, unit: usize) -> [(f64, f64); 2] {
        match self {
            Self::Kuramoto { phases, omega } => {
                let (sine, cosine) = phases[unit].sin_cos();
                [(cosine, -sine * omega[unit]), (sine, cosine * omega[unit])]
            }
            Self::Hopf { oscillators, .. } => {
                let ((x, y), (dx, dy)) = (oscillators[unit].states()[0], oscillators[unit].rates()[0]);
                [(x, dx), (y, dy)]
            }
            Self::Matsuoka { pairs, omega, cycle } => {
                let (value, rate) = cycle.output(&pairs[unit]);
                [(value, rate * omega[unit] / TAU * cycle.period), (0.0, 0.0)]
            }
        }
    }

    /// The phase, rad in \[0, 2 pi).
    pub(super) fn phase(&self, unit: usize) -> f64 {
        match self {
            Self::Kuramoto { phases, .. } => phases[unit],
            Self::Hopf { oscillators, duty_factor, .. } => {
                let (x, y) = oscillators[unit].states()[0];
                let angle = y.atan2(x).rem_euclid(TAU);
                let phase = if angle < PI {
                    2.0 * duty_factor * angle
                } else {
                    TAU * duty_factor + 2.0 * (1.0 - duty_factor) * (angle - PI)
                };
                phase.rem_euclid(TAU)
            }
            Self::Matsuoka { pairs, cycle, .. } => cycle.phase(&pairs[unit]),
        }
    }
}
