//! Execution of a discrete primitive.

mod move_error;
mod steering;

pub use move_error::MoveError;

use super::coupling::Coupling;
use super::kernels::dot;
use super::model::DmpModel;
use super::quintic::{Jet, Quintic};
use super::scaling::ForcingScale;
use super::spring::Stride;

/// A discrete movement in progress: position, velocity and acceleration in every dimension, advanced by
/// [`step`](Self::step).
///
/// Only [`new`](Self::new) allocates; starting, steering and stepping do not.
#[derive(Clone, Debug)]
pub struct DiscreteDmp {
    model: DmpModel,
    scale: ForcingScale,
    duration: f64,
    progress: f64,
    end: f64,
    start: Vec<f64>,
    /// Commanded goal, and the state of the goal filter that follows it.
    goal: Vec<f64>,
    attractor: Vec<f64>,
    /// Velocity at the goal, per duration; zero in the variants that end at rest.
    final_rate: Vec<f64>,
    /// Minimum-jerk part; at rest at 0 in the variants without a quintic goal.
    quintics: Vec<Quintic>,
    /// State of the spring in normalised time: position (or deviation, with a quintic goal) and rate.
    spring: Vec<(f64, f64)>,
    /// Forcing term at the current progress, as a shift of the spring's equilibrium.
    forcing: Vec<f64>,
    /// Contribution of the last step's coupling to the forcing term.
    pushed: Vec<f64>,
    features: Vec<f64>,
    /// Phase at the current progress, and its rate: 1 unless a coupling slows it down.
    phase: f64,
    phase_rate: f64,
    /// Width and stride of the last step, cached for steps of equal width.
    stride: (f64, Stride),
    position: Vec<f64>,
    velocity: Vec<f64>,
    acceleration: Vec<f64>,
}

/// Minimum time for reaching a goal set during the movement, as a fraction of the duration. Used by the
/// variants with a quintic goal.
pub const REPLANNING_TIME: f64 = 0.5;

impl DiscreteDmp {
    /// Creates a primitive at rest at zero. Call [`start`](Self::start) to start a movement.
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
            final_rate: zeros.clone(),
            quintics: vec![Quintic::at_rest(0.0); dimensions],
            spring: vec![(0.0, 0.0); dimensions],
            forcing: zeros.clone(),
            pushed: zeros.clone(),
            phase: model.kernels().phase(1.0),
            phase_rate: 1.0,
            stride: (0.0, model.spring().stride(0.0)),
            position: zeros.clone(),
            velocity: zeros.clone(),
            acceleration: zeros,
            model,
        }
    }

    /// Returns the model of the primitive.
    pub fn model(&self) -> &DmpModel {
        &self.model
    }

    /// Returns the weights (kernels x dimensions) for writing. Change them only between movements.
    pub fn weights_mut(&mut self) -> nalgebra::DMatrixViewMut<'_, f64> {
        self.model.weights_mut()
    }

    /// Starts a movement from rest at `start` to `goal`, to arrive after `duration` seconds.
    ///
    /// # Errors
    /// [`MoveError`] if a length is wrong, a number is not finite, or the duration is not positive.
    pub fn start(&mut self, start: &[f64], goal: &[f64], duration: f64) -> Result<(), MoveError> {
        self.check_duration(duration)?;
        self.check("start", start)?;
        self.check("goal", goal)?;
        self.position.copy_from_slice(start);
        self.velocity.fill(0.0);
        self.acceleration.fill(0.0);
        self.final_rate.fill(0.0);
        self.begin(goal, duration, false);
        Ok(())
    }

    /// Starts a movement with an initial velocity (per second) and the initial acceleration of the forcing
    /// term. In a fitted model this is the initial acceleration of the demonstrations.
    ///
    /// # Errors
    /// [`MoveError`] in the same cases as [`Self::start`].
    pub fn start_at_velocity(
        &mut self,
        [position, velocity]: [&[f64]; 2],
        goal: &[f64],
        duration: f64,
    ) -> Result<(), MoveError> {
        self.check_duration(duration)?;
        self.check("position", position)?;
        self.check("velocity", velocity)?;
        self.check("goal", goal)?;
        self.position.copy_from_slice(position);
        self.velocity.copy_from_slice(velocity);
        self.acceleration.fill(0.0);
        self.final_rate.fill(0.0);
        self.begin(goal, duration, false);
        Ok(())
    }

    /// Starts a movement with an initial `position`, `velocity` (per second) and `acceleration` (per second
    /// squared).
    ///
    /// Only variants with a quintic goal start with the given acceleration and can therefore continue another
    /// movement without a discontinuity in acceleration. The other variants start with the acceleration of
    /// their spring. To start like a demonstration, use [`start_at_velocity`](Self::start_at_velocity), which
    /// needs no acceleration.
    ///
    /// # Errors
    /// [`MoveError`] in the same cases as [`Self::start`].
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
        self.final_rate.fill(0.0);
        self.begin(goal, duration, true);
        Ok(())
    }

    /// Starts a stroke: a movement with an initial velocity and acceleration that passes the goal after
    /// `duration` seconds with `final_velocity` (per second). Afterwards the primitive continues at that
    /// velocity. The initial acceleration of the forcing term is added to `acceleration`. Only
    /// [`Variant::FinalVelocity`](super::Variant::FinalVelocity) supports strokes.
    ///
    /// # Errors
    /// [`MoveError`] in the same cases as [`Self::start`], and if the model has a variant other than
    /// [`Variant::FinalVelocity`](super::Variant::FinalVelocity).
    pub fn start_striking(
        &mut self,
        [position, velocity, acceleration]: [&[f64]; 3],
        [goal, final_velocity]: [&[f64]; 2],
        duration: f64,
    ) -> Result<(), MoveError> {
        let variant = self.model.settings().variant;
        if !variant.may_end_in_motion() {
            return Err(MoveError::EndsAtRest { variant });
        }
        self.check("final velocity", final_velocity)?;
        self.check("position", position)?;
        self.check("velocity", velocity)?;
        self.check("acceleration", acceleration)?;
        self.check("goal", goal)?;
        self.check_duration(duration)?;
        self.position.copy_from_slice(position);
        self.velocity.copy_from_slice(velocity);
        self.acceleration.copy_from_slice(acceleration);
        for (rate, velocity) in self.final_rate.iter_mut().zip(final_velocity) {
            *rate = velocity * duration;
        }
        self.begin(goal, duration, false);
        Ok(())
    }

    /// Advances by `dt` seconds. No effect if `dt` is zero or negative.
    pub fn step(&mut self, dt: f64) {
        self.phase_rate = 1.0;
        self.pushed.fill(0.0);
        self.advance(dt);
    }

    /// Advances by `dt` seconds with feedback from the robot; see [`Coupling`]. The coupling acceleration is
    /// constant throughout the step. No effect if `dt` is zero or negative.
    ///
    /// # Errors
    /// [`MoveError`] if the coupling has the wrong length or a number that is not finite. The primitive is
    /// then left unchanged.
    pub fn step_coupled(&mut self, dt: f64, coupling: &Coupling<'_>) -> Result<(), MoveError> {
        let rate = coupling.phase_rate;
        if !rate.is_finite() {
            return Err(MoveError::NotFinite { name: "the phase rate", value: rate });
        }
        if coupling.acceleration.is_empty() {
            self.pushed.fill(0.0);
        } else {
            self.check("the acceleration of the coupling", coupling.acceleration)?;
            let factor = self.duration * self.duration / self.model.spring().stiffness();
            for (pushed, acceleration) in self.pushed.iter_mut().zip(coupling.acceleration) {
                *pushed = factor * acceleration;
            }
        }
        self.phase_rate = rate.clamp(0.0, 1.0);
        self.advance(dt);
        Ok(())
    }

    fn advance(&mut self, dt: f64) {
        let h = dt / self.duration;
        if h.is_nan() || h <= 0.0 {
            return;
        }
        if self.stride.0 != h {
            self.stride = (h, self.model.spring().stride(h));
        }
        // equilibrium of the spring at both ends of the step; `position` is scratch space for the first
        for d in 0..self.spring.len() {
            self.position[d] = self.equilibrium(d);
        }
        self.progress += h * self.phase_rate;
        if let Some(rate) = self.model.settings().goal_rate {
            let caught_up = -(-rate * h).exp_m1();
            for (attractor, goal) in self.attractor.iter_mut().zip(&self.goal) {
                *attractor += caught_up * (goal - *attractor);
            }
        }
        self.update_forcing();
        let stride = self.stride.1;
        for d in 0..self.spring.len() {
            let (from, to) = (self.position[d], self.equilibrium(d));
            self.spring[d] = stride.advance(self.spring[d], from, to);
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

    /// Returns the goal set last.
    pub fn goal(&self) -> &[f64] {
        &self.goal
    }

    /// Returns the nominal duration of the movement \[s\].
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// Returns the elapsed time divided by the duration: 0 at the start, 1 at the nominal end, more
    /// afterwards.
    pub fn progress(&self) -> f64 {
        self.progress
    }

    /// Returns the progress at which the movement ends: 1, or more if a goal was set too late to be reached
    /// by then.
    pub fn end(&self) -> f64 {
        self.end
    }

    /// Returns `true` if the duration of the movement has elapsed.
    pub fn is_over(&self) -> bool {
        self.progress >= self.end
    }

    /// Starts from the state in `position`, `velocity` and `acceleration`. If `whole`, the acceleration
    /// belongs to the movement, otherwise to its polynomial.
    fn begin(&mut self, goal: &[f64], duration: f64, whole: bool) {
        self.duration = duration;
        self.progress = 0.0;
        self.end = 1.0;
        self.phase_rate = 1.0;
        self.pushed.fill(0.0);
        self.start.copy_from_slice(&self.position);
        self.goal.copy_from_slice(goal);
        self.attractor.copy_from_slice(goal);
        self.scale.prepare(self.model.displacement(), &self.start, goal);
        self.update_forcing();
        let plans_goal = self.model.settings().variant.plans_goal();
        for (d, &goal) in goal.iter().enumerate() {
            let rate = self.velocity[d] * duration;
            if plans_goal {
                let forced = match whole {
                    true => self.model.spring().acceleration(0.0, 0.0, self.forcing[d]),
                    false => 0.0,
                };
                let acceleration = self.acceleration[d] * duration * duration - forced;
                let from = Jet { value: self.position[d], rate, acceleration };
                self.quintics[d] = Quintic::passing(0.0, 1.0, from, goal, self.final_rate[d]);
                self.spring[d] = (0.0, 0.0);
            } else {
                self.spring[d] = (self.position[d], rate);
            }
        }
        self.observe();
    }

    /// Equilibrium of the spring in one dimension at the current progress.
    #[inline(always)]
    fn equilibrium(&self, d: usize) -> f64 {
        let forced = self.forcing[d] + self.pushed[d];
        let variant = self.model.settings().variant;
        if variant.plans_goal() {
            forced
        } else if variant.eases_in() {
            self.attractor[d] - (self.attractor[d] - self.start[d]) * self.phase + forced
        } else {
            self.attractor[d] + forced
        }
    }

    fn update_forcing(&mut self) {
        let active = self.model.kernels().activate(self.progress, &mut self.features);
        self.phase = active.phase;
        let features = &self.features[active.kernels.clone()];
        let per_divisor = self.model.forcing_divisor().recip();
        for (forcing, weights) in
            self.forcing.iter_mut().zip(self.model.weights().as_slice().chunks_exact(self.features.len()))
        {
            *forcing = dot(&weights[active.kernels.clone()], features) * per_divisor;
        }
        self.scale.apply(&mut self.forcing);
    }

    /// Writes position, velocity and acceleration from the state.
    fn observe(&mut self) {
        let per_second = self.duration.recip();
        let plans_goal = self.model.settings().variant.plans_goal();
        let phase_rate = self.phase_rate;
        let spring = self.model.spring();
        for d in 0..self.spring.len() {
            let (x, rate) = self.spring[d];
            let acceleration = spring.acceleration(x, rate, self.equilibrium(d));
            let reference = if plans_goal { self.quintics[d].sample(self.progress) } else { Jet::default() };
            self.position[d] = reference.value + x;
            self.velocity[d] = (reference.rate * phase_rate + rate) * per_second;
            self.acceleration[d] =
                (reference.acceleration * phase_rate * phase_rate + acceleration) * per_second * per_second;
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
