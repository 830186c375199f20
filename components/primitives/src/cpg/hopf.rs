//! Coupled Hopf oscillators with separate speeds for swing and stance.

use nalgebra::DMatrix;

use super::{CpgError, finite, positive, size};
use crate::ValueError;

/// Parameters of a Hopf oscillator. [`Default`] returns the values documented on each field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HopfSettings {
    /// Rate of convergence `gamma` to the limit cycle, 1/s per squared unit of the output. Default 8.
    pub convergence: f64,
    /// Radius of the limit cycle, `sqrt(mu)`, in the unit of the output. Default 1.
    pub amplitude: f64,
    /// Angular velocity while `y > 0` (stance), rad/s. Default 2 pi.
    pub stance_speed: f64,
    /// Angular velocity while `y < 0` (swing), rad/s. Default 2 pi.
    pub swing_speed: f64,
    /// Sharpness `b` of the transition between stance and swing speed, relative to the amplitude. Default 50.
    pub sharpness: f64,
}

impl Default for HopfSettings {
    fn default() -> Self {
        let turn = std::f64::consts::TAU;
        Self { convergence: 8.0, amplitude: 1.0, stance_speed: turn, swing_speed: turn, sharpness: 50.0 }
    }
}

impl HopfSettings {
    /// Returns these settings with speeds for a stride of `period` seconds. `duty_factor`, in (0, 1), is the
    /// fraction of the stride spent in stance. Each half of the cycle has its own speed: `omega_st = pi / (d
    /// P)`, `omega_sw = pi / ((1 - d) P)`.
    #[must_use]
    pub fn with_stride(self, period: f64, duty_factor: f64) -> Self {
        Self {
            stance_speed: std::f64::consts::PI / (duty_factor * period),
            swing_speed: std::f64::consts::PI / ((1.0 - duty_factor) * period),
            ..self
        }
    }
}

/// A network of coupled Hopf oscillators. With `mu` the squared amplitude and `r^2 = x^2 + y^2`,
///
/// `x_i' = gamma (mu - r^2) x_i - omega_i y_i + c_i^x + s_i`, `y_i' = gamma (mu - r^2) y_i + omega_i x_i +
/// c_i^y`,
///
/// `omega_i = omega_st / (exp(-b y_i / sqrt(mu)) + 1) + omega_sw / (exp(b y_i / sqrt(mu)) + 1)` (Righetti and
/// Ijspeert 2008). The coupling is diffusive, `c_i = sum_j k_ij (R(-phi_ij) z_j - z_i)` with the rotation
/// `R`. The coupling vanishes if the oscillators are in the pattern and have equal speeds, so the amplitude
/// stays `sqrt(mu)`. `s_i` is feedback. The output of a leg is `x`.
#[derive(Clone, Debug)]
pub struct HopfNetwork {
    settings: HopfSettings,
    couplings: DMatrix<f64>,
    /// `cos` and `sin` of the phases of the pattern.
    pattern: Vec<(f64, f64)>,
    state: Vec<(f64, f64)>,
    moved: Vec<(f64, f64)>,
    stages: [Vec<(f64, f64)>; 4],
    output: Vec<f64>,
    velocity: Vec<f64>,
    rates: Vec<(f64, f64)>,
}

impl HopfNetwork {
    /// Creates a network from settings, couplings `k` (entry `k_ij`: action of oscillator j on i, 1/s) and
    /// the phases of the pattern, rad. All oscillators start on the limit cycle, in the pattern.
    ///
    /// # Errors
    /// [`CpgError`] if sizes do not match, or a number is out of range.
    pub fn new(settings: HopfSettings, couplings: DMatrix<f64>, phases: &[f64]) -> Result<Self, CpgError> {
        let n = phases.len();
        size("the rows of the couplings", couplings.nrows(), n)?;
        size("the columns of the couplings", couplings.ncols(), n)?;
        finite("couplings", couplings.as_slice())?;
        for (name, value) in [
            ("convergence", settings.convergence),
            ("amplitude", settings.amplitude),
            ("stance_speed", settings.stance_speed),
            ("swing_speed", settings.swing_speed),
            ("sharpness", settings.sharpness),
        ] {
            positive(name, value)?;
        }
        let zeros = vec![(0.0, 0.0); n];
        let mut network = Self {
            settings,
            couplings,
            pattern: zeros.clone(),
            moved: zeros.clone(),
            stages: std::array::from_fn(|_| zeros.clone()),
            output: vec![0.0; n],
            velocity: vec![0.0; n],
            rates: zeros.clone(),
            state: zeros,
        };
        network.set_pattern(phases)?;
        for (state, (cosine, sine)) in network.state.iter_mut().zip(&network.pattern) {
            *state = (settings.amplitude * cosine, settings.amplitude * sine);
        }
        network.write(&[]);
        Ok(network)
    }

    /// Sets the target phase of every oscillator in the pattern, rad. The state stays continuous and
    /// converges to the new pattern.
    ///
    /// # Errors
    /// [`CpgError`] if the length is wrong, or a number is not finite.
    pub fn set_pattern(&mut self, phases: &[f64]) -> Result<(), CpgError> {
        size("the pattern", phases.len(), self.state.len())?;
        finite("the pattern", phases)?;
        for (place, phase) in self.pattern.iter_mut().zip(phases) {
            *place = (phase.cos(), phase.sin());
        }
        Ok(())
    }

    /// Changes the settings, including amplitude and speeds, at run time.
    ///
    /// # Errors
    /// [`CpgError`] if a number is out of range.
    pub fn set_settings(&mut self, settings: HopfSettings) -> Result<(), CpgError> {
        for (name, value) in [
            ("convergence", settings.convergence),
            ("amplitude", settings.amplitude),
            ("stance_speed", settings.stance_speed),
            ("swing_speed", settings.swing_speed),
            ("sharpness", settings.sharpness),
        ] {
            positive(name, value)?;
        }
        self.settings = settings;
        Ok(())
    }

    /// Sets the state `(x, y)` of an oscillator. This makes the output discontinuous.
    ///
    /// # Errors
    /// [`CpgError`] if the oscillator does not exist, or a number is not finite.
    pub fn set_state(&mut self, oscillator: usize, (x, y): (f64, f64)) -> Result<(), CpgError> {
        finite("the state", &[x, y])?;
        let found = self.state.len();
        let state = self.state.get_mut(oscillator);
        *state.ok_or(CpgError::Value(ValueError::Size {
            name: "the network",
            found,
            expected: oscillator + 1,
        }))? = (x, y);
        self.write(&[]);
        Ok(())
    }

    /// Advances by `dt` seconds.
    pub fn step(&mut self, dt: f64) {
        self.step_with_feedback(dt, &[]);
    }

    /// Advances like [`step`](Self::step), with `feedback[i]` (unit of the output per second) added to
    /// `x_i'`. An empty slice means no feedback.
    pub fn step_with_feedback(&mut self, dt: f64, feedback: &[f64]) {
        if dt.is_nan() || dt <= 0.0 {
            return;
        }
        for (stage, fraction) in [0.0, 0.5, 0.5, 1.0].into_iter().enumerate() {
            for i in 0..self.state.len() {
                let (x, y) = self.state[i];
                let (dx, dy) = if stage == 0 { (0.0, 0.0) } else { self.stages[stage - 1][i] };
                self.moved[i] = (x + fraction * dt * dx, y + fraction * dt * dy);
            }
            for i in 0..self.state.len() {
                self.stages[stage][i] = self.rate(&self.moved, i, feedback);
            }
        }
        for i in 0..self.state.len() {
            let [a, b, c, d] = [0, 1, 2, 3].map(|stage| self.stages[stage][i]);
            self.state[i].0 += dt / 6.0 * (a.0 + 2.0 * b.0 + 2.0 * c.0 + d.0);
            self.state[i].1 += dt / 6.0 * (a.1 + 2.0 * b.1 + 2.0 * c.1 + d.1);
        }
        self.write(feedback);
    }

    /// Returns the output `x` of every oscillator.
    pub fn output(&self) -> &[f64] {
        &self.output
    }

    /// Returns the derivative of the output, per second.
    pub fn velocity(&self) -> &[f64] {
        &self.velocity
    }

    /// Returns the state `(x, y)` of every oscillator.
    pub fn states(&self) -> &[(f64, f64)] {
        &self.state
    }

    /// Returns the derivative `(x', y')` of every state, per second.
    pub fn rates(&self) -> &[(f64, f64)] {
        &self.rates
    }

    /// Returns `true` while a leg is in stance (`y > 0`).
    pub fn is_stance(&self, oscillator: usize) -> bool {
        self.state.get(oscillator).is_some_and(|state| state.1 > 0.0)
    }

    fn rate(&self, state: &[(f64, f64)], i: usize, feedback: &[f64]) -> (f64, f64) {
        let HopfSettings { convergence, amplitude, stance_speed, swing_speed, sharpness } = self.settings;
        let (x, y) = state[i];
        let radial = convergence * (amplitude * amplitude - x * x - y * y);
        // the two weights sum to one
        let stance = 1.0 / ((-sharpness * y / amplitude).exp() + 1.0);
        let omega = stance_speed * stance + swing_speed * (1.0 - stance);
        let (mut dx, mut dy) = (radial * x - omega * y, radial * y + omega * x);
        let (own_cosine, own_sine) = self.pattern[i];
        for (j, (xj, yj)) in state.iter().enumerate() {
            let k = self.couplings[(i, j)];
            if k != 0.0 {
                // rotated by theta_i - theta_j
                let (cosine, sine) = self.pattern[j];
                let (c, s) = (own_cosine * cosine + own_sine * sine, own_sine * cosine - own_cosine * sine);
                dx += k * (c * xj - s * yj - x);
                dy += k * (s * xj + c * yj - y);
            }
        }
        (dx + feedback.get(i).copied().unwrap_or(0.0), dy)
    }

    fn write(&mut self, feedback: &[f64]) {
        for i in 0..self.state.len() {
            self.output[i] = self.state[i].0;
            self.rates[i] = self.rate(&self.state, i, feedback);
            self.velocity[i] = self.rates[i].0;
        }
    }
}
