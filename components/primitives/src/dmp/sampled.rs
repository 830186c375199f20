//! A primitive with a sampled forcing term that reproduces its demonstration to rounding.

use nalgebra::DMatrix;

use super::demonstration::DemonstrationError;
use super::discrete::MoveError;
use super::quintic::{Jet, Quintic};
use super::settings::{ModelError, Settings, Variant};

/// A primitive whose forcing term is a table with one value per step, found by inverting the integration
/// step.
///
/// The step is the semi-implicit Euler step, with `h = 1 / steps` in normalised time: `v_{k+1} = v_k + h
/// a_k`, `y_{k+1} = y_k + h v_{k+1}`, where `a_k` is the right side of the equation of the [`Variant`] at
/// `(y_k, v_k, k h)` plus `F_k`. The inverse, `v_{k+1} = (y_{k+1} - y_k) / h`, `a_k = (v_{k+1} - v_k) / h`,
/// is exact, so the round trip is limited by rounding only, for every variant. `F` is an acceleration in
/// normalised time in all variants. The velocity of the first step, `v_0 = (y_1 - y_0) / h`, is stored with
/// the table, so the first force is not an impulse.
#[derive(Clone, Debug, PartialEq)]
pub struct SampledModel {
    variant: Variant,
    damping: f64,
    decay: f64,
    /// Forces, dimensions x steps: the forces of a step are contiguous.
    forces: DMatrix<f64>,
    first_rate: Vec<f64>,
    final_rate: Vec<f64>,
    start: Vec<f64>,
    goal: Vec<f64>,
}

/// Error returned when a recording cannot be tabulated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SampledError {
    /// The demonstration is invalid.
    #[error(transparent)]
    Demonstration(#[from] DemonstrationError),
    /// A setting is out of range.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The steps are too long for the spring to be stable.
    #[error(
        "{steps} steps are too few for a damping of {damping}, because the spring would be unstable: use at least {least} samples"
    )]
    TooCoarse {
        /// Number of steps found.
        steps: usize,
        /// Damping of the spring.
        damping: f64,
        /// Minimum number of samples.
        least: usize,
    },
}

impl SampledModel {
    /// Creates the table from a recording of evenly spaced positions, samples x dimensions. Only variant,
    /// damping and decay of the settings are used, since there are no kernels.
    ///
    /// # Errors
    /// [`SampledError`] if there are too few samples, a number is not finite, a setting is out of range, or
    /// the steps are too long to be stable.
    pub fn new(settings: &Settings, positions: &DMatrix<f64>) -> Result<Self, SampledError> {
        settings.check()?;
        super::demonstration::check(1.0, positions)?;
        let (samples, dimensions) = positions.shape();
        let (steps, last) = (samples - 1, samples - 1);
        let h = 1.0 / steps as f64;
        // trace 2 - h D - (h D / 2)^2 and determinant 1 - h D: stable for h D < sqrt(32) - 4
        let limit = 32.0_f64.sqrt() - 4.0;
        if settings.damping * h >= limit {
            let least = (settings.damping / limit).ceil() as usize + 2;
            return Err(SampledError::TooCoarse { steps, damping: settings.damping, least });
        }
        let rate = |k: usize, d: usize| (positions[(k, d)] - positions[(k - 1, d)]) / h;
        let ends_in_motion = settings.variant.may_end_in_motion();
        let mut model = Self {
            variant: settings.variant,
            damping: settings.damping,
            decay: settings.decay,
            forces: DMatrix::zeros(dimensions, steps),
            first_rate: (0..dimensions).map(|d| rate(1, d)).collect(),
            final_rate: (0..dimensions).map(|d| if ends_in_motion { rate(last, d) } else { 0.0 }).collect(),
            start: positions.row(0).iter().copied().collect(),
            goal: positions.row(last).iter().copied().collect(),
        };
        for d in 0..dimensions {
            let quintic = model.quintic(d, model.start[d], model.first_rate[d], model.goal[d]);
            for k in 0..steps {
                let now = if k == 0 { model.first_rate[d] } else { rate(k, d) };
                let acceleration = (rate(k + 1, d) - now) / h;
                let unforced = model.unforced(
                    (positions[(k, d)], now),
                    (model.start[d], model.goal[d]),
                    &quintic,
                    k as f64 * h,
                );
                model.forces[(d, k)] = acceleration - unforced;
            }
        }
        Ok(model)
    }

    /// Returns the number of dimensions.
    pub fn dimensions(&self) -> usize {
        self.forces.nrows()
    }

    /// Returns the number of steps, one less than the number of samples.
    pub fn steps(&self) -> usize {
        self.forces.ncols()
    }

    /// Returns the table of forces, dimensions x steps, unit of y per duration squared.
    pub fn forces(&self) -> &DMatrix<f64> {
        &self.forces
    }

    /// Returns the start of the demonstration, one entry per dimension.
    pub fn shown_start(&self) -> &[f64] {
        &self.start
    }

    /// Returns the end of the demonstration, one entry per dimension.
    pub fn shown_goal(&self) -> &[f64] {
        &self.goal
    }

    fn quintic(&self, d: usize, start: f64, rate: f64, goal: f64) -> Quintic {
        let from = Jet { value: start, rate, acceleration: 0.0 };
        Quintic::passing(0.0, 1.0, from, goal, self.final_rate[d])
    }

    /// The acceleration without forcing, in normalised time.
    fn unforced(&self, (y, v): (f64, f64), (start, goal): (f64, f64), quintic: &Quintic, p: f64) -> f64 {
        let (stiffness, damping) = (0.25 * self.damping * self.damping, self.damping);
        if self.variant.plans_goal() {
            let g = quintic.sample(p);
            return stiffness * (g.value - y) + damping * (g.rate - v) + g.acceleration;
        }
        let eased = if self.variant.eases_in() { (goal - start) * (-self.decay * p).exp() } else { 0.0 };
        stiffness * (goal - y - eased) - damping * v
    }
}

/// Execution of a [`SampledModel`], one step of the table at a time. Only [`new`](Self::new) allocates.
#[derive(Clone, Debug)]
pub struct SampledDmp {
    model: SampledModel,
    duration: f64,
    taken: usize,
    start: Vec<f64>,
    goal: Vec<f64>,
    quintics: Vec<Quintic>,
    position: Vec<f64>,
    rate: Vec<f64>,
    velocity: Vec<f64>,
}

impl SampledDmp {
    /// Creates a movement at the start of its demonstration, with a duration of 1 s.
    pub fn new(model: SampledModel) -> Self {
        let zeros = vec![0.0; model.dimensions()];
        let mut dmp = Self {
            duration: 1.0,
            taken: 0,
            start: model.start.clone(),
            goal: model.goal.clone(),
            quintics: vec![Quintic::at_rest(0.0); model.dimensions()],
            position: zeros.clone(),
            rate: zeros.clone(),
            velocity: zeros,
            model,
        };
        dmp.begin(1.0);
        dmp
    }

    /// Starts a movement from `start` to `goal`, to arrive after `duration` seconds. The initial velocity is
    /// the velocity of the demonstration, scaled to the duration.
    ///
    /// # Errors
    /// [`MoveError`] if a length is wrong, a number is not finite, or the duration is not positive.
    pub fn start(&mut self, start: &[f64], goal: &[f64], duration: f64) -> Result<(), MoveError> {
        let expected = self.model.dimensions();
        for (name, values) in [("start", start), ("goal", goal)] {
            if values.len() != expected {
                return Err(MoveError::Dimensions { name, found: values.len(), expected });
            }
            if let Some(&value) = values.iter().find(|value| !value.is_finite()) {
                return Err(MoveError::NotFinite { name, value });
            }
        }
        if !(duration.is_finite() && duration > 0.0) {
            return Err(MoveError::Duration { found: duration });
        }
        self.start.copy_from_slice(start);
        self.goal.copy_from_slice(goal);
        self.begin(duration);
        Ok(())
    }

    /// Changes the goal during a movement. Variants that plan their goal at the start use the new goal from
    /// the next movement on.
    ///
    /// # Errors
    /// [`MoveError`] if the length is wrong, or a number is not finite.
    pub fn set_goal(&mut self, goal: &[f64]) -> Result<(), MoveError> {
        let expected = self.model.dimensions();
        if goal.len() != expected {
            return Err(MoveError::Dimensions { name: "goal", found: goal.len(), expected });
        }
        if let Some(&value) = goal.iter().find(|value| !value.is_finite()) {
            return Err(MoveError::NotFinite { name: "goal", value });
        }
        self.goal.copy_from_slice(goal);
        Ok(())
    }

    /// Advances by one step of `duration / steps`. After the end the forces are zero.
    pub fn step(&mut self) {
        let h = 1.0 / self.model.steps() as f64;
        let p = self.taken as f64 * h;
        for d in 0..self.position.len() {
            let force =
                if self.taken < self.model.steps() { self.model.forces[(d, self.taken)] } else { 0.0 };
            let state = (self.position[d], self.rate[d]);
            let unforced = self.model.unforced(state, (self.start[d], self.goal[d]), &self.quintics[d], p);
            self.rate[d] += h * (unforced + force);
            self.position[d] += h * self.rate[d];
            self.velocity[d] = self.rate[d] / self.duration;
        }
        self.taken += 1;
    }

    /// Returns the duration of one step, s.
    pub fn dt(&self) -> f64 {
        self.duration / self.model.steps() as f64
    }

    /// Returns the position in every dimension.
    pub fn position(&self) -> &[f64] {
        &self.position
    }

    /// Returns the velocity in every dimension, per second.
    pub fn velocity(&self) -> &[f64] {
        &self.velocity
    }

    /// Returns `true` after the last step of the movement.
    pub fn is_over(&self) -> bool {
        self.taken >= self.model.steps()
    }

    fn begin(&mut self, duration: f64) {
        self.duration = duration;
        self.taken = 0;
        self.position.copy_from_slice(&self.start);
        self.rate.copy_from_slice(&self.model.first_rate);
        for d in 0..self.position.len() {
            self.quintics[d] = self.model.quintic(d, self.start[d], self.rate[d], self.goal[d]);
            self.velocity[d] = self.rate[d] / duration;
        }
    }
}
