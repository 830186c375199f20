//! Goals that arrive while the policy runs.

use motorium::component::{ConfigureError, Setup};
use motorium::declare::{Declare, StepError};
use motorium::state::{GoalState, GoalStatus, MotionGoal};
use motorium::transport::{Input, Output};

use super::planner::{GoalPlanner, Planned, Refusal};

/// Iterations of the search for a pose in each step.
const ITERATIONS: usize = 2;
/// Minimum increase of the progress that is published.
const PROGRESS: f64 = 0.01;

/// The newest goal of the input `goal`, and its status.
#[derive(Debug)]
pub(super) struct LiveGoals {
    input: Input<MotionGoal>,
    output: Output<GoalStatus>,
    planner: GoalPlanner,
    goal: Option<MotionGoal>,
    status: GoalStatus,
    /// `true` if the status differs from the published one.
    is_news: bool,
    received: u64,
    refused: u64,
}

impl LiveGoals {
    pub(super) fn declare(declare: &mut Declare) {
        declare.optional_input::<MotionGoal>(
            "goal",
            "goal that replaces the configured ones, from the present motion on",
        );
        declare.output::<GoalStatus>("goal_status", "progress of the newest goal from the input `goal`");
    }

    pub(super) fn open(planner: GoalPlanner, setup: &mut Setup) -> Result<Self, ConfigureError> {
        Ok(Self {
            input: setup.input("goal")?,
            output: setup.output("goal_status")?,
            planner,
            goal: None,
            status: GoalStatus::default(),
            is_news: false,
            received: 0,
            refused: 0,
        })
    }

    pub(super) fn reset(&mut self) {
        (self.goal, self.status, self.is_news) = (None, GoalStatus::default(), false);
        (self.received, self.refused) = (0, 0);
    }

    /// Reads the newest goal and continues the search for its joint positions. `previous` are the joint
    /// positions of the previous goal. Returns `true` once, when the positions are known.
    pub(super) fn poll(&mut self, previous: &[f64]) -> bool {
        if let Some(goal) = self.input.next_unread()
            && self.goal.as_ref() != Some(&*goal)
        {
            self.goal = Some(*goal);
            self.status = GoalStatus::new(goal.number, GoalState::Planning);
            self.is_news = true;
            self.received += 1;
            if let Some(goal) = &self.goal
                && let Err(refusal) = self.planner.begin(goal, previous)
            {
                self.refuse(&refusal);
            }
        }
        if !self.is(GoalState::Planning) {
            return false;
        }
        match self.planner.advance(ITERATIONS) {
            Planned::Searching => false,
            Planned::Ready => {
                self.set_state(GoalState::Moving);
                true
            }
            Planned::Refused(refusal) => {
                self.refuse(&refusal);
                false
            }
        }
    }

    /// Joint positions of the goal for which [`poll`](Self::poll) returned `true`, rad or m.
    pub(super) fn target(&self) -> &[f64] {
        self.planner.target()
    }

    /// Requested duration of the motion, s.
    pub(super) fn duration(&self) -> Option<f64> {
        self.goal.as_ref().map(|goal| goal.duration).filter(|duration| *duration > 0.0)
    }

    /// Records the progress of the motion, 0 to 1, and the time to its end, s. No effect while the status
    /// refers to a newer goal, as in [`end`](Self::end).
    pub(super) fn advance(&mut self, progress: f64, remaining: f64) {
        let is_first = self.status.remaining == 0.0;
        if !self.is(GoalState::Moving) || (!is_first && progress - self.status.progress < PROGRESS) {
            return;
        }
        (self.status.progress, self.status.remaining) = (progress, remaining);
        self.is_news = true;
    }

    /// Records the end of the motion with the largest error of a joint, rad or m; `missed` is the joint's
    /// name if the goal was missed.
    pub(super) fn end(&mut self, error: f64, missed: Option<&str>) {
        if !self.is(GoalState::Moving) {
            return;
        }
        (self.status.progress, self.status.remaining, self.status.error) = (1.0, 0.0, error);
        match missed {
            None => self.set_state(GoalState::Reached),
            Some(joint) => {
                self.status.set_text(format_args!("joint `{joint}` is {error:.4} rad or m from its goal"));
                self.set_state(GoalState::Missed);
            }
        }
    }

    /// Publishes the status if it has changed.
    pub(super) fn publish(&mut self) -> Result<(), StepError> {
        if !core::mem::take(&mut self.is_news) {
            return Ok(());
        }
        let mut status = self.output.loan()?;
        *status = self.status;
        status.publish()
    }

    /// Adds the numbers of goals to the result of the policy, if the input is wired.
    pub(super) fn add_to(&self, result: &mut serde_json::Value) {
        if self.input.is_wired() {
            result["goals_received"] = self.received.into();
            result["goals_refused"] = self.refused.into();
        }
    }

    fn is(&self, state: GoalState) -> bool {
        self.status.state == state as u64
    }

    fn set_state(&mut self, state: GoalState) {
        self.status.state = state as u64;
        self.is_news = true;
    }

    fn refuse(&mut self, refusal: &Refusal) {
        self.refused += 1;
        self.status.set_text(self.planner.explain(refusal));
        self.set_state(GoalState::Refused);
    }
}
