//! Execution of a rhythmic primitive.

use super::model::RhythmicModel;
use crate::dmp::discrete::MoveError;
use crate::dmp::kernels::dot;
use crate::dmp::spring::CriticalSpring;

/// A rhythm in progress (Ijspeert et al. 2013, section 2.1.2). With the period `P`, `tau = P / (2 pi)` and
/// the phase `tau phi' = 1`,
///
/// `tau^2 y'' = K (g - y) - D tau y' + r f`, `f = sum(psi_i w_i) / sum(psi_i)`, `psi_i = exp(h (cos(phi -
/// c_i) - 1))`, `c_i = 2 pi i / N`, `K = D^2 / 4`.
///
/// `g` is the baseline, `r` the amplitude relative to the demonstration. Period, amplitude and baseline may
/// change at any time; position and velocity stay continuous. The spring is advanced by its exact solution
/// for an input that is linear within a step. Only [`new`](Self::new) allocates.
#[derive(Clone, Debug)]
pub struct RhythmicDmp {
    model: RhythmicModel,
    period: f64,
    phase: f64,
    cycles: u64,
    amplitude: f64,
    baseline: Vec<f64>,
    forcing: Vec<f64>,
    features: Vec<f64>,
    /// Position and its derivative with respect to phase.
    state: Vec<(f64, f64)>,
    position: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
}

impl RhythmicDmp {
    /// Creates a rhythm at rest at its baseline, with a period of 1 s, at phase 0.
    pub fn new(model: RhythmicModel) -> Self {
        let zeros = vec![0.0; model.dimensions()];
        let baseline = model.baseline.as_slice().to_vec();
        let mut dmp = Self {
            period: 1.0,
            phase: 0.0,
            cycles: 0,
            amplitude: 1.0,
            forcing: zeros.clone(),
            features: vec![0.0; model.settings.kernels],
            state: baseline.iter().map(|value| (*value, 0.0)).collect(),
            position: zeros.clone(),
            velocity: zeros.clone(),
            acceleration: zeros,
            baseline,
            model,
        };
        dmp.update_forcing();
        dmp.observe();
        dmp
    }

    /// Returns the model of the rhythm.
    pub fn model(&self) -> &RhythmicModel {
        &self.model
    }

    /// Starts at a phase (rad) with an initial position and velocity (per second), and converges to the
    /// rhythm.
    ///
    /// # Errors
    /// [`MoveError`] if a length is wrong, or a number is not finite.
    pub fn start(&mut self, phase: f64, position: &[f64], velocity: &[f64]) -> Result<(), MoveError> {
        finite("phase", &[phase], 1)?;
        finite("position", position, self.state.len())?;
        finite("velocity", velocity, self.state.len())?;
        let tau = self.period / std::f64::consts::TAU;
        for (state, (y, v)) in self.state.iter_mut().zip(position.iter().zip(velocity)) {
            *state = (*y, v * tau);
        }
        self.phase = phase.rem_euclid(std::f64::consts::TAU);
        self.cycles = 0;
        self.update_forcing();
        self.observe();
        Ok(())
    }

    /// Sets the period, s.
    ///
    /// # Errors
    /// [`MoveError`] if the period is not positive.
    pub fn set_period(&mut self, period: f64) -> Result<(), MoveError> {
        if !(period.is_finite() && period > 0.0) {
            return Err(MoveError::Duration { found: period });
        }
        let stretch = period / self.period;
        self.state.iter_mut().for_each(|(_, rate)| *rate *= stretch);
        self.period = period;
        self.observe();
        Ok(())
    }

    /// Sets the amplitude relative to the demonstration. Default 1.
    ///
    /// # Errors
    /// [`MoveError`] if the number is not finite.
    pub fn set_amplitude(&mut self, amplitude: f64) -> Result<(), MoveError> {
        finite("amplitude", &[amplitude], 1)?;
        self.amplitude = amplitude;
        self.update_forcing();
        self.observe();
        Ok(())
    }

    /// Sets the centre of the oscillation of each dimension.
    ///
    /// # Errors
    /// [`MoveError`] if the length is wrong, or a number is not finite.
    pub fn set_baseline(&mut self, baseline: &[f64]) -> Result<(), MoveError> {
        finite("baseline", baseline, self.state.len())?;
        self.baseline.copy_from_slice(baseline);
        self.observe();
        Ok(())
    }

    /// Advances by `dt` seconds. No effect if `dt` is zero or negative.
    pub fn step(&mut self, dt: f64) {
        self.step_entrained(dt, 0.0);
    }

    /// Advances like [`step`](Self::step), with the phase rate increased by `pull` (rad/s), such as `k
    /// sin(phi_measured - phi)`.
    pub fn step_entrained(&mut self, dt: f64, pull: f64) {
        let h = dt * std::f64::consts::TAU / self.period;
        let advance = h + if pull.is_finite() { pull * dt } else { 0.0 };
        if h.is_nan() || h <= 0.0 {
            return;
        }
        let stride = CriticalSpring::new(self.model.settings.damping).stride(h);
        self.position.copy_from_slice(&self.forcing);
        self.phase += advance;
        if !(0.0..std::f64::consts::TAU).contains(&self.phase) {
            self.cycles += u64::from(self.phase > 0.0);
            self.phase = self.phase.rem_euclid(std::f64::consts::TAU);
        }
        self.update_forcing();
        for (d, state) in self.state.iter_mut().enumerate() {
            let (from, to) = (self.baseline[d] + self.position[d], self.baseline[d] + self.forcing[d]);
            *state = stride.advance(*state, from, to);
        }
        self.observe();
    }

    /// Returns the position in every dimension.
    pub fn position(&self) -> &[f64] {
        &self.position
    }

    /// Returns the velocity in every dimension, per second.
    pub fn velocity(&self) -> &[f64] {
        &self.velocity
    }

    /// Returns the acceleration in every dimension, per second squared.
    pub fn acceleration(&self) -> &[f64] {
        &self.acceleration
    }

    /// Returns the phase in \[0, 2 pi), rad.
    pub fn phase(&self) -> f64 {
        self.phase
    }

    /// Returns the number of whole periods since the start.
    pub fn cycles(&self) -> u64 {
        self.cycles
    }

    /// The forcing term as a shift of the equilibrium.
    fn update_forcing(&mut self) {
        self.model.features_into(self.phase, &mut self.features);
        let factor = self.amplitude / CriticalSpring::new(self.model.settings.damping).stiffness();
        let columns = self.model.weights.as_slice().chunks_exact(self.features.len());
        for (forcing, weights) in self.forcing.iter_mut().zip(columns) {
            *forcing = factor * dot(weights, &self.features);
        }
    }

    fn observe(&mut self) {
        let spring = CriticalSpring::new(self.model.settings.damping);
        let per_second = std::f64::consts::TAU / self.period;
        for (d, (y, rate)) in self.state.iter().enumerate() {
            self.position[d] = *y;
            self.velocity[d] = rate * per_second;
            let equilibrium = self.baseline[d] + self.forcing[d];
            self.acceleration[d] = spring.acceleration(*y, *rate, equilibrium) * per_second * per_second;
        }
    }
}

fn finite(name: &'static str, values: &[f64], expected: usize) -> Result<(), MoveError> {
    if values.len() != expected {
        return Err(MoveError::Dimensions { name, found: values.len(), expected });
    }
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(MoveError::NotFinite { name, value }),
        None => Ok(()),
    }
}
