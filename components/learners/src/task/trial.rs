//! One attempt at a task: actions and measured states in, observations and rewards out.

use motorium_models::policy::{Measurements, Observer};

use super::noise::NoisyState;
use super::terms::Actions;
use super::{Points, RobotState, Terms, Verdict};
use crate::random::Counter;

/// Reason for the end of an episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// A termination with the verdict `failure` was met, or a physics step failed.
    Failure,
    /// A termination with the verdict `success` was met.
    Success,
    /// The maximum duration was reached. The episode is truncated, not terminated, so its return includes the
    /// estimated value of the final state.
    Truncated,
}

impl End {
    /// Returns `true` if the episode ended in a terminal state, which has no future return; `false` if it was
    /// truncated.
    pub fn is_terminal(self) -> bool {
        self != Self::Truncated
    }
}

/// Result of a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Step {
    /// Reward of the state after the step.
    pub reward: f64,
    /// Reason for the end of the episode; `None` if it continues.
    pub end: Option<End>,
}

/// One attempt at a task, independent of the simulated world. Environments and the component `learner.task`
/// share this type. Only [`new`](Self::new) and [`with_noise`](Self::with_noise) allocate.
///
/// Call [`begin`](Self::begin) with the first state, then [`act`](Self::act) and [`judge`](Self::judge) for
/// each policy step.
#[derive(Clone, Debug)]
pub struct Trial {
    observer: Observer,
    /// Actions within their bounds.
    newest: Vec<f64>,
    before: Vec<f64>,
    command: [f64; 3],
    points: Points,
    /// Measurements with the noise of the task.
    noisy: Option<NoisyState>,
    counter: Counter,
    level: f64,
    step: usize,
    total: f64,
}

impl Trial {
    /// Creates a trial whose observations contain no noise.
    pub fn new(terms: &Terms) -> Self {
        let zeros = vec![0.0; terms.actions()];
        Self {
            observer: terms.observer(),
            newest: zeros.clone(),
            before: zeros,
            command: [0.0; 3],
            points: terms.points(),
            noisy: None,
            counter: Counter::default(),
            level: 1.0,
            step: 0,
            total: 0.0,
        }
    }

    /// Creates a trial whose observations contain the measurement noise of the task.
    pub fn with_noise(terms: &Terms) -> Self {
        let noisy = terms.noise().map(|noise| NoisyState::new(noise, terms.joints()));
        Self { noisy, ..Self::new(terms) }
    }

    /// Starts the trial in a state. Commands are sampled with the random numbers of `counter`, from ranges
    /// that depend on the level of the curriculum (0 to 1).
    pub fn begin(&mut self, terms: &Terms, (counter, level): (Counter, f64), state: &RobotState<'_>) {
        (self.counter, self.level) = (counter, level);
        (self.step, self.total) = (0, 0.0);
        self.newest.fill(0.0);
        self.before.fill(0.0);
        self.set_command(terms.new_command(counter, level, 0).unwrap_or_default());
        self.points.locate((state.positions, state.velocities), state.objects);
        self.observer.reset();
        self.observe(terms, state);
    }

    /// Clamps the action of a step to the bounds of the task and stores the result.
    ///
    /// # Panics
    ///
    /// If the action has too few entries.
    pub fn act(&mut self, terms: &Terms, action: impl IntoIterator<Item = f64>) {
        core::mem::swap(&mut self.before, &mut self.newest);
        let mut action = action.into_iter();
        for slot in &mut self.newest {
            *slot = terms.targets().clipped(action.next().expect("a number for each joint"));
        }
    }

    /// Evaluates the state after a step. If the physics step failed (`is_stepped` is `false`), the episode
    /// ends as a failure.
    pub fn judge(&mut self, terms: &Terms, state: &RobotState<'_>, is_stepped: bool) -> Step {
        self.step += 1;
        self.points.locate((state.positions, state.velocities), state.objects);
        let outcome = terms.evaluate(state, self.actions());
        self.total += outcome.reward;
        if let Some(command) = terms.new_command(self.counter, self.level, self.step) {
            self.set_command(command);
        }
        self.observe(terms, state);
        let verdict = if is_stepped { outcome.end } else { Some(Verdict::Failure) };
        let end = match verdict {
            Some(Verdict::Failure) => Some(End::Failure),
            Some(Verdict::Success) => Some(End::Success),
            None if self.step >= terms.steps() => Some(End::Truncated),
            None => None,
        };
        Step { reward: outcome.reward, end }
    }

    /// Writes the observation after the last step.
    ///
    /// # Panics
    ///
    /// If the length of `observation` differs from [`Terms::inputs`].
    pub fn write(&self, observation: &mut [f32]) {
        self.observer.write(observation);
    }

    /// Returns the number of steps so far.
    pub fn step(&self) -> usize {
        self.step
    }

    /// Returns the sum of the rewards so far.
    pub fn total(&self) -> f64 {
        self.total
    }

    /// Returns the action before the last, within its bounds.
    pub(crate) fn action_before(&self) -> &[f64] {
        &self.before
    }

    /// Returns the last action, within its bounds.
    pub(crate) fn action(&self) -> &[f64] {
        &self.newest
    }

    /// Returns the current command: forward velocity, velocity to the left \[m/s\] and yaw rate \[rad/s\], or
    /// the position of the target \[m\].
    pub fn command(&self) -> [f64; 3] {
        self.command
    }

    fn actions(&self) -> Actions<'_> {
        let Self { newest, before, command, points, .. } = self;
        Actions { newest, before, command: *command, points }
    }

    fn set_command(&mut self, command: [f64; 3]) {
        self.command = command;
        self.points.set_target(command);
    }

    fn observe(&mut self, terms: &Terms, state: &RobotState<'_>) {
        let counter = Counter { step: self.step as u64, ..self.counter };
        let exact = (state.positions, state.velocities, state.base);
        let (positions, velocities, base) = match &mut self.noisy {
            Some(noisy) => noisy.measure(counter, exact),
            None => exact,
        };
        self.observer.observe(&Measurements {
            positions,
            velocities,
            base,
            command: self.command,
            last_action: &self.newest,
            heights: &[],
            points: self.points.observed(),
            images: state.images,
            time: terms.time(self.step),
        });
    }
}
