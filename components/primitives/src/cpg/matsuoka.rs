//! Matsuoka's mutually inhibiting neurons with fatigue.

use nalgebra::DMatrix;

use super::{CpgError, finite, positive, size};

/// Parameters of a Matsuoka neuron. [`Default`] returns the values documented on each field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MatsuokaSettings {
    /// Rise time `tau_1`, s. Default 0.25.
    pub rise_time: f64,
    /// Fatigue time `tau_2`, s. Default 0.5.
    pub fatigue_time: f64,
    /// Fatigue coefficient `beta`. Default 2.5.
    pub fatigue: f64,
    /// Tonic input `c`. Default 1.
    pub tonic: f64,
}

impl Default for MatsuokaSettings {
    fn default() -> Self {
        Self { rise_time: 0.25, fatigue_time: 0.5, fatigue: 2.5, tonic: 1.0 }
    }
}

impl MatsuokaSettings {
    /// Returns `true` if two neurons that inhibit each other with weight `w` oscillate: `1 + beta > w > 1 +
    /// tau_1 / tau_2` (Matsuoka 1985).
    pub fn pair_oscillates(&self, w: f64) -> bool {
        1.0 + self.fatigue > w && w > 1.0 + self.rise_time / self.fatigue_time
    }

    /// Returns the approximate frequency, Hz, of two neurons that inhibit each other with weight `w`, by
    /// harmonic balance (Matsuoka 2011): `sqrt(((tau_1 + tau_2) beta - tau_1 w) / (tau_1 w)) / (2 pi tau_2)`.
    /// Returns `None` if the equation has no solution.
    pub fn pair_frequency(&self, w: f64) -> Option<f64> {
        let Self { rise_time, fatigue_time, fatigue, .. } = *self;
        let squared = ((rise_time + fatigue_time) * fatigue - rise_time * w) / (rise_time * w);
        (squared > 0.0).then(|| squared.sqrt() / (std::f64::consts::TAU * fatigue_time))
    }
}

/// A network of mutually inhibiting neurons with fatigue:
///
/// `tau_1 u_i' = -u_i - beta v_i - sum_j w_ij y_j + c + s_i`, `tau_2 v_i' = -v_i + y_i`, `y_i = max(0, u_i)`.
#[derive(Clone, Debug)]
pub struct MatsuokaOscillator {
    settings: MatsuokaSettings,
    weights: DMatrix<f64>,
    /// Membrane potential and fatigue.
    state: Vec<(f64, f64)>,
    moved: Vec<(f64, f64)>,
    stages: [Vec<(f64, f64)>; 4],
    output: Vec<f64>,
}

impl MatsuokaOscillator {
    /// Creates neurons from the inhibition weights `w` (entry `w_ij`: action of neuron j on i; a positive
    /// weight inhibits). All neurons start at rest except the first, whose potential is 0.1, because
    /// identical neurons would stay identical.
    ///
    /// # Errors
    /// [`CpgError`] if the matrix is not square, or a number is out of range.
    pub fn new(settings: MatsuokaSettings, weights: DMatrix<f64>) -> Result<Self, CpgError> {
        let n = weights.nrows();
        size("the columns of the weights", weights.ncols(), n)?;
        finite("weights", weights.as_slice())?;
        finite("tonic", &[settings.tonic])?;
        positive("rise_time", settings.rise_time)?;
        positive("fatigue_time", settings.fatigue_time)?;
        positive("fatigue", settings.fatigue)?;
        let mut state = vec![(0.0, 0.0); n];
        if let Some(first) = state.first_mut() {
            first.0 = 0.1;
        }
        let zeros = vec![(0.0, 0.0); n];
        let mut oscillator = Self {
            settings,
            weights,
            state,
            moved: zeros.clone(),
            stages: std::array::from_fn(|_| zeros.clone()),
            output: vec![0.0; n],
        };
        oscillator.write();
        Ok(oscillator)
    }

    /// Creates a pair of neurons that inhibit each other with weight `w`, such as flexor and extensor of one
    /// joint.
    ///
    /// # Errors
    /// [`CpgError`] if a number is out of range.
    pub fn pair(settings: MatsuokaSettings, w: f64) -> Result<Self, CpgError> {
        Self::new(settings, DMatrix::from_row_slice(2, 2, &[0.0, w, w, 0.0]))
    }

    /// Sets the potential and fatigue of every neuron. This makes the output discontinuous.
    ///
    /// # Errors
    /// [`CpgError`] if the length is wrong, or a number is not finite.
    pub fn set_state(&mut self, state: &[(f64, f64)]) -> Result<(), CpgError> {
        size("the state", state.len(), self.state.len())?;
        for (u, v) in state {
            finite("the state", &[*u, *v])?;
        }
        self.state.copy_from_slice(state);
        self.write();
        Ok(())
    }

    /// Advances by `dt` seconds.
    pub fn step(&mut self, dt: f64) {
        self.step_with_feedback(dt, &[]);
    }

    /// Advances like [`step`](Self::step), with an entraining input `feedback[i]` to each neuron. An empty
    /// slice means no input.
    pub fn step_with_feedback(&mut self, dt: f64, feedback: &[f64]) {
        if dt.is_nan() || dt <= 0.0 {
            return;
        }
        for (stage, fraction) in [0.0, 0.5, 0.5, 1.0].into_iter().enumerate() {
            for i in 0..self.state.len() {
                let (u, v) = self.state[i];
                let (du, dv) = if stage == 0 { (0.0, 0.0) } else { self.stages[stage - 1][i] };
                self.moved[i] = (u + fraction * dt * du, v + fraction * dt * dv);
            }
            for i in 0..self.state.len() {
                self.stages[stage][i] = self.rate(i, feedback);
            }
        }
        for i in 0..self.state.len() {
            let [a, b, c, d] = [0, 1, 2, 3].map(|stage| self.stages[stage][i]);
            self.state[i].0 += dt / 6.0 * (a.0 + 2.0 * b.0 + 2.0 * c.0 + d.0);
            self.state[i].1 += dt / 6.0 * (a.1 + 2.0 * b.1 + 2.0 * c.1 + d.1);
        }
        self.write();
    }

    /// Returns the potential and fatigue of every neuron.
    pub fn states(&self) -> &[(f64, f64)] {
        &self.state
    }

    /// Returns the firing rate `y` of every neuron.
    pub fn output(&self) -> &[f64] {
        &self.output
    }

    /// Returns the output `y_0 - y_1` of a pair; zero for a single neuron.
    pub fn difference(&self) -> f64 {
        match self.output[..] {
            [flexor, extensor, ..] => flexor - extensor,
            _ => 0.0,
        }
    }

    fn rate(&self, i: usize, feedback: &[f64]) -> (f64, f64) {
        let MatsuokaSettings { rise_time, fatigue_time, fatigue, tonic } = self.settings;
        let (u, v) = self.moved[i];
        let inhibition: f64 =
            self.moved.iter().enumerate().map(|(j, (u, _))| self.weights[(i, j)] * u.max(0.0)).sum();
        let input = tonic + feedback.get(i).copied().unwrap_or(0.0);
        ((-u - fatigue * v - inhibition + input) / rise_time, (u.max(0.0) - v) / fatigue_time)
    }

    fn write(&mut self) {
        for (output, (u, _)) in self.output.iter_mut().zip(&self.state) {
            *output = u.max(0.0);
        }
    }
}
