//! A discrete primitive while it runs.

use super::model::DmpModel;
use super::quintic::{Jet, Quintic};
use super::scaling::ForcingScale;
use super::settings::Variant;

/// A movement in progress: position, velocity and acceleration in every dimension, advanced by [`step`](Self::step).
///
/// All memory is taken by [`new`](Self::new); starting, steering and stepping never allocate.
#[derive(Clone, Debug)]
pub struct DiscreteDmp {
    model: DmpModel,
    scale: ForcingScale,
    duration: f64,
    progress: f64,
    end: f64,
    start: Vec<f64>,
    /// The goal that was commanded, and where the goal filter has got to on the way there.
    goal: Vec<f64>,
    attractor: Vec<f64>,
    /// The minimum-jerk part; at rest at 0 in the variants that have none.
    quintics: Vec<Quintic>,
    /// State of the spring in normalised time: position (of the deviation, with a quintic goal) and its rate.
    spring: Vec<(f64, f64)>,
    /// Forcing term at the current progress, as a shift of the spring's equilibrium.
    forcing: Vec<f64>,
    features: Vec<f64>,
    position: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
}

/// Why a movement cannot start or be steered. What ran before goes on unchanged.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MoveError {
    /// A vector of another length than the model has dimensions.
    #[error("{name} has {found} entries, the primitive {expected} dimensions")]
    Dimensions {
        /// The vector.
        name: &'static str,
        /// Its length.
        found: usize,
        /// The dimensions of the model.
        expected: usize,
    },
    /// A number that is none.
    #[error("{name} holds {value}, expected finite numbers only")]
    NotFinite {
        /// The vector.
        name: &'static str,
        /// What was found.
        value: f64,
    },
    /// A duration that is not a positive time.
    #[error("a duration of {found} s, expected a positive time")]
    Duration {
        /// What was found, s.
        found: f64,
    },
}

/// With a quintic goal, the least part of a duration that is given to reach a goal set on the way.
pub const REPLANNING_TIME: f64 = 0.5;

impl DiscreteDmp {
    /// At rest at zero, until it is started.
    pub fn new(model: DmpModel) -> Self {
        let dimensions = model.dimensions();
        let zeros = vec![0.0; dimensions];
        Self {
            scale: ForcingScale::new(model.settings().scaling, dimensions),
            features: vec![0.0; model.kernels().count()],
            duration: 1.0,
            progress: 1.0,
            end: 1.0,
            start: zeros.clone(),
            goal: zeros.clone(),
            attractor: zeros.clone(),
            quintics: vec![Quintic::at_rest(0.0); dimensions],
            spring: vec![(0.0, 0.0); dimensions],
            forcing: zeros.clone(),
            position: zeros.clone(),
            velocity: zeros.clone(),
            acceleration: zeros,
            model,
        }
    }

    /// The model it runs.
    pub fn model(&self) -> &DmpModel {
        &self.model
    }

    /// The weights (kernels x dimensions), to be written between movements.
    pub fn weights_mut(&mut self) -> nalgebra::DMatrixViewMut<'_, f64> {
        self.model.weights_mut()
    }

    /// Starts from rest at `start` towards `goal`, to arrive after `duration` seconds.
    ///
    /// # Errors
    /// Wrong lengths, numbers that are not finite, a duration that is no positive time.
    pub fn start(&mut self, start: &[f64], goal: &[f64], duration: f64) -> Result<(), MoveError> {
        self.check_duration(duration)?;
        self.check("start", start)?;
        self.check("goal", goal)?;
        self.position.copy_from_slice(start);
        self.velocity.fill(0.0);
        self.acceleration.fill(0.0);
        self.begin(goal, duration);
        Ok(())
    }

    /// Starts in motion, from `position`, `velocity` (per second) and `acceleration` (per second squared).
    ///
    /// Only [`Variant::QuinticGoal`] begins with that acceleration (and what the forcing term adds at its start, which a
    /// fit keeps near zero); the other variants begin with the one their spring has.
    ///
    /// # Errors
    /// As [`Self::start`].
    pub fn start_moving(
        &mut self,
        [position, velocity, acceleration]: [&[f64]; 3],
        goal: &[f64],
        duration: f64,
    ) -> Result<(), MoveError> {
        self.check_duration(duration)?;
        self.check("position", position)?;
        self.check("velocity", velocity)?;
        self.check("acceleration", acceleration)?;
        self.check("goal", goal)?;
        self.position.copy_from_slice(position);
        self.velocity.copy_from_slice(velocity);
        self.acceleration.copy_from_slice(acceleration);
        self.begin(goal, duration);
        Ok(())
    }

    /// Sets another goal while it runs. Position and velocity stay continuous.
    ///
    /// [`Variant::QuinticGoal`] keeps the acceleration continuous too: it plans a new polynomial from where the old one
    /// is to the end of the movement, or over [`REPLANNING_TIME`] of the duration if less is left; the end is put off
    /// accordingly. The other variants change the acceleration by `K / T^2` times the change of the goal, unless
    /// `goal_rate` lets the goal slide over.
    ///
    /// # Errors
    /// Wrong length, or numbers that are not finite.
    pub fn set_goal(&mut self, goal: &[f64]) -> Result<(), MoveError> {
        self.check("goal", goal)?;
        if self.goal == goal {
            return Ok(());
        }
        self.goal.copy_from_slice(goal);
        match self.model.settings().variant {
            Variant::QuinticGoal => {
                self.attractor.copy_from_slice(goal);
                self.end = self.end.max(self.progress + REPLANNING_TIME);
                for (d, quintic) in self.quintics.iter_mut().enumerate() {
                    let from = quintic.sample(self.progress);
                    *quintic = Quintic::new(self.progress, self.end - self.progress, from, goal[d]);
                }
            }
            Variant::Classic | Variant::GoalSafe if self.model.settings().goal_rate.is_none() => {
                self.attractor.copy_from_slice(goal);
            }
            Variant::Classic | Variant::GoalSafe => {}
        }
        self.observe();
        Ok(())
    }

    /// Sets another duration while it runs: the rest of the movement is stretched, position and velocity stay continuous.
    ///
    /// # Errors
    /// A duration that is no positive time.
    pub fn set_duration(&mut self, duration: f64) -> Result<(), MoveError> {
        self.check_duration(duration)?;
        let stretch = duration / self.duration;
        self.duration = duration;
        self.spring.iter_mut().for_each(|(_, rate)| *rate *= stretch);
        if self.progress < self.end && self.model.settings().variant == Variant::QuinticGoal {
            for (d, quintic) in self.quintics.iter_mut().enumerate() {
                let mut from = quintic.sample(self.progress);
                from.rate *= stretch;
                from.acceleration *= stretch * stretch;
                *quintic = Quintic::new(self.progress, self.end - self.progress, from, self.attractor[d]);
            }
        }
        self.observe();
        Ok(())
    }

    /// Advances by `dt` seconds. A `dt` of zero or less changes nothing.
    pub fn step(&mut self, dt: f64) {
        let h = dt / self.duration;
        if h.is_nan() || h <= 0.0 {
            return;
        }
        let phase = self.model.kernels().phase(self.progress);
        // where the spring is drawn to at both ends of the step; `position` serves as scratch for the first
        for d in 0..self.spring.len() {
            self.position[d] = self.equilibrium(d, phase);
        }
        self.progress += h;
        if let Some(rate) = self.model.settings().goal_rate {
            let caught_up = -(-rate * h).exp_m1();
            for (attractor, goal) in self.attractor.iter_mut().zip(&self.goal) {
                *attractor += caught_up * (goal - *attractor);
            }
        }
        self.update_forcing();
        let phase = self.model.kernels().phase(self.progress);
        let stride = self.model.spring().stride(h);
        for d in 0..self.spring.len() {
            let (from, to) = (self.position[d], self.equilibrium(d, phase));
            self.spring[d] = stride.advance(self.spring[d], from, to);
        }
        self.observe();
    }

    /// Position in every dimension.
    pub fn position(&self) -> &[f64] {
        &self.position
    }

    /// Velocity in every dimension, per second.
    pub fn velocity(&self) -> &[f64] {
        &self.velocity
    }

    /// Acceleration in every dimension, per second squared.
    pub fn acceleration(&self) -> &[f64] {
        &self.acceleration
    }

    /// The goal last commanded.
    pub fn goal(&self) -> &[f64] {
        &self.goal
    }

    /// Seconds a movement takes.
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// Elapsed time over duration: 0 at the start, 1 at the nominal end; goes on growing.
    pub fn progress(&self) -> f64 {
        self.progress
    }

    /// The progress at which the movement ends: 1, or later if a goal was set too late for that.
    pub fn end(&self) -> f64 {
        self.end
    }

    /// Whether the time of the movement is over.
    pub fn is_over(&self) -> bool {
        self.progress >= self.end
    }

    /// Changes the coordinates under a running movement: the same motion now reads `jets`, the goal `goal` and the place
    /// it started from `start`. The deviation from the minimum-jerk part is kept.
    pub(super) fn rebase(&mut self, jets: &[Jet], start: &[f64], goal: &[f64]) {
        self.goal.copy_from_slice(goal);
        self.attractor.copy_from_slice(goal);
        self.start.copy_from_slice(start);
        let duration = self.duration;
        let quintic_goal = self.model.settings().variant == Variant::QuinticGoal;
        self.end = if quintic_goal { self.end.max(self.progress + REPLANNING_TIME) } else { self.end };
        for (d, jet) in jets.iter().enumerate() {
            let (rate, acceleration) = (jet.rate * duration, jet.acceleration * duration * duration);
            if quintic_goal {
                let (x, x_rate) = self.spring[d];
                let x_acceleration = self.model.spring().acceleration(x, x_rate, self.forcing[d]);
                let from = Jet {
                    value: jet.value - x,
                    rate: rate - x_rate,
                    acceleration: acceleration - x_acceleration,
                };
                self.quintics[d] = Quintic::new(self.progress, self.end - self.progress, from, goal[d]);
            } else {
                self.spring[d] = (jet.value, rate);
            }
        }
        self.observe();
    }

    /// Begins in the state that stands in `position`, `velocity` and `acceleration`.
    fn begin(&mut self, goal: &[f64], duration: f64) {
        self.duration = duration;
        self.progress = 0.0;
        self.end = 1.0;
        self.start.copy_from_slice(&self.position);
        self.goal.copy_from_slice(goal);
        self.attractor.copy_from_slice(goal);
        self.scale.prepare(self.model.displacement(), &self.start, goal);
        self.update_forcing();
        let quintic_goal = self.model.settings().variant == Variant::QuinticGoal;
        for (d, &goal) in goal.iter().enumerate() {
            let rate = self.velocity[d] * duration;
            if quintic_goal {
                let acceleration = self.acceleration[d] * duration * duration;
                let from = Jet { value: self.position[d], rate, acceleration };
                self.quintics[d] = Quintic::new(0.0, 1.0, from, goal);
                self.spring[d] = (0.0, 0.0);
            } else {
                self.spring[d] = (self.position[d], rate);
            }
        }
        self.observe();
    }

    /// Where the spring is drawn to in one dimension at the current progress, whose phase is given.
    fn equilibrium(&self, d: usize, phase: f64) -> f64 {
        match self.model.settings().variant {
            Variant::Classic => self.attractor[d] + self.forcing[d],
            Variant::GoalSafe => {
                self.attractor[d] - (self.attractor[d] - self.start[d]) * phase + self.forcing[d]
            }
            Variant::QuinticGoal => self.forcing[d],
        }
    }

    fn update_forcing(&mut self) {
        self.model.kernels().features_into(self.progress, &mut self.features);
        let divisor = self.model.forcing_divisor();
        for (forcing, weights) in self.forcing.iter_mut().zip(self.model.weights().column_iter()) {
            let sum: f64 = weights.iter().zip(&self.features).map(|(weight, feature)| weight * feature).sum();
            *forcing = sum / divisor;
        }
        self.scale.apply(&mut self.forcing);
    }

    /// Writes position, velocity and acceleration from the state.
    fn observe(&mut self) {
        let per_second = self.duration.recip();
        let phase = self.model.kernels().phase(self.progress);
        let quintic_goal = self.model.settings().variant == Variant::QuinticGoal;
        for d in 0..self.spring.len() {
            let (x, rate) = self.spring[d];
            let acceleration = self.model.spring().acceleration(x, rate, self.equilibrium(d, phase));
            let reference =
                if quintic_goal { self.quintics[d].sample(self.progress) } else { Jet::default() };
            self.position[d] = reference.value + x;
            self.velocity[d] = (reference.rate + rate) * per_second;
            self.acceleration[d] = (reference.acceleration + acceleration) * per_second * per_second;
        }
    }

    fn check(&self, name: &'static str, values: &[f64]) -> Result<(), MoveError> {
        let expected = self.model.dimensions();
        if values.len() != expected {
            return Err(MoveError::Dimensions { name, found: values.len(), expected });
        }
        match values.iter().find(|value| !value.is_finite()) {
            Some(&value) => Err(MoveError::NotFinite { name, value }),
            None => Ok(()),
        }
    }

    fn check_duration(&self, duration: f64) -> Result<(), MoveError> {
        let holds = duration.is_finite() && duration > 0.0;
        if holds { Ok(()) } else { Err(MoveError::Duration { found: duration }) }
    }
}
