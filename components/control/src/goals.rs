//! The error of a controlled frame or point at each goal of its target.

/// Minimum time for which the target rests at the goal that is current when the run ends, s. Shorter rests
/// are not evaluated.
const SETTLE: f64 = 0.2;

/// Distance and angle between a controlled frame and its target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GoalError {
    /// Distance \[m\].
    pub position: f64,
    /// Angle \[rad\]; `None` if only a point is controlled, without an orientation.
    pub orientation: Option<f64>,
}

impl GoalError {
    /// Returns the worse of two errors, separately for each quantity: the larger distance and the larger
    /// angle.
    #[must_use]
    pub fn worse(self, other: Self) -> Self {
        let orientation = match (self.orientation, other.orientation) {
            (Some(one), Some(other)) => Some(one.max(other)),
            (one, other) => one.or(other),
        };
        Self { position: self.position.max(other.position), orientation }
    }
}

with_defaults! {
    /// Maximum error at which a goal counts as reached. Default 5 mm and 0.02 rad.
    ///
    /// ```
    /// use motorium_control::{GoalError, GoalTolerance};
    ///
    /// let tolerance = GoalTolerance { position: 5e-3, orientation: 0.02 };
    /// assert!(tolerance.allows(GoalError { position: 4e-3, orientation: None }));
    /// assert!(!tolerance.allows(GoalError { position: 4e-3, orientation: Some(0.1) }));
    /// ```
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct GoalTolerance;

    /// Maximum distance \[m\]. Default 5e-3.
    pub position: f64 = 5e-3;
    /// Maximum angle \[rad\]. Default 0.02.
    pub orientation: f64 = 0.02;
}

impl GoalTolerance {
    /// Returns `true` if `error` is within the tolerance.
    pub fn allows(&self, error: GoalError) -> bool {
        error.position <= self.position && error.orientation.is_none_or(|angle| angle <= self.orientation)
    }
}

/// Numbers of reached and missed goals of a run, with the worst error. Only goals at which the target came to
/// rest count.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GoalSummary {
    /// Number of goals that the controlled frame or point reached within the tolerance.
    pub reached: u64,
    /// Number of missed goals.
    pub missed: u64,
    /// Worst error at any counted goal; `None` if no goal was counted.
    pub worst: Option<GoalError>,
}

impl GoalSummary {
    /// Adds the numbers of goals of two summaries, and combines the worst errors.
    #[must_use]
    pub fn merge(self, other: Self) -> Self {
        let worst = match (self.worst, other.worst) {
            (Some(one), Some(other)) => Some(one.worse(other)),
            (one, other) => one.or(other),
        };
        Self { reached: self.reached + other.reached, missed: self.missed + other.missed, worst }
    }
}

/// A recorder of the error at each goal: the error at the last tick before the target leaves the goal, or
/// before the run ends.
#[derive(Clone, Copy, Debug, Default)]
pub struct GoalRecord {
    tolerance: GoalTolerance,
    goal: Option<u64>,
    /// The error while the target rests at the current goal.
    resting: Option<GoalError>,
    /// Time for which the target has rested at the current goal, s.
    rested: f64,
    past: GoalSummary,
    latest: Option<GoalError>,
}

impl GoalRecord {
    /// Creates an empty record with a tolerance for reaching goals.
    pub fn new(tolerance: GoalTolerance) -> Self {
        Self { tolerance, ..Self::default() }
    }

    /// Clears all goals.
    pub fn reset(&mut self) {
        *self = Self::new(self.tolerance);
    }

    /// Records the error of one tick of `dt` seconds. `goal` is the number of the goal towards which the
    /// target moves; `at_goal` is `true` while the target rests at this goal.
    pub fn observe(&mut self, goal: u64, at_goal: bool, error: GoalError, dt: f64) {
        if self.goal != Some(goal) {
            self.past = self.past.merge(self.current());
            (self.resting, self.rested) = (None, 0.0);
            self.goal = Some(goal);
        }
        self.latest = Some(error);
        if at_goal {
            self.resting = Some(error);
            self.rested += dt;
        }
    }

    /// Returns the goals with the current one, as if the target left it now.
    fn current(&self) -> GoalSummary {
        let reached = self.resting.map(|error| self.tolerance.allows(error));
        GoalSummary {
            reached: u64::from(reached == Some(true)),
            missed: u64::from(reached == Some(false)),
            worst: self.resting,
        }
    }

    /// Returns a summary of the goals so far, as if the run ended now.
    pub fn summary(&self) -> GoalSummary {
        if self.rested + 1e-9 >= SETTLE { self.past.merge(self.current()) } else { self.past }
    }

    /// The tolerance of the goals.
    pub(crate) fn tolerance(&self) -> GoalTolerance {
        self.tolerance
    }

    /// Returns the error at the last tick.
    pub fn latest(&self) -> Option<GoalError> {
        self.latest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(position: f64) -> GoalError {
        GoalError { position, orientation: Some(2.0 * position) }
    }

    fn observe(record: &mut GoalRecord, goal: u64, at_goal: bool, errors: &[f64]) {
        for error in errors {
            record.observe(goal, at_goal, pose(*error), 0.05);
        }
    }

    /// A record with tolerances of 50 mm and 0.1 rad.
    fn record() -> GoalRecord {
        GoalRecord::new(GoalTolerance { position: 0.05, orientation: 0.1 })
    }

    fn summary(reached: u64, worst: Option<GoalError>) -> GoalSummary {
        GoalSummary { reached, missed: 0, worst }
    }

    #[test]
    fn goal_error_is_sampled_at_the_last_tick_of_rest() {
        let mut record = record();
        observe(&mut record, 1, false, &[0.5, 0.4]);
        observe(&mut record, 1, true, &[0.3, 0.1, 0.01]);
        assert_eq!(record.summary(), summary(0, None), "the target has just arrived");
        observe(&mut record, 2, false, &[0.5, 0.6]);
        assert_eq!(record.summary(), summary(1, Some(pose(0.01))));
        assert_eq!(record.latest(), Some(pose(0.6)));
    }

    #[test]
    fn last_goal_counts_after_the_minimum_rest() {
        let mut record = record();
        observe(&mut record, 1, true, &[0.2, 0.1, 0.05]);
        assert_eq!(record.summary(), summary(0, None));
        observe(&mut record, 1, true, &[0.002]);
        assert_eq!(record.summary(), summary(1, Some(pose(0.002))));
    }

    #[test]
    fn worst_goal_is_reported_and_passed_goals_are_ignored() {
        let mut record = record();
        observe(&mut record, 1, true, &[0.01]);
        observe(&mut record, 2, false, &[0.9]);
        observe(&mut record, 3, true, &[0.03]);
        observe(&mut record, 4, true, &[0.02]);
        observe(&mut record, 5, false, &[0.9]);
        assert_eq!(record.summary(), summary(3, Some(pose(0.03))));
    }

    #[test]
    fn goal_is_missed_by_position_or_orientation() {
        let mut record = record();
        observe(&mut record, 1, true, &[0.5, 0.04]);
        observe(&mut record, 2, true, &[4.4]);
        record.observe(3, true, GoalError { position: 0.0, orientation: Some(0.2) }, 0.05);
        observe(&mut record, 4, false, &[0.0]);
        let expected = GoalSummary { reached: 1, missed: 2, worst: Some(pose(4.4)) };
        assert_eq!(record.summary(), expected);
        record.reset();
        observe(&mut record, 1, true, &[0.06; 4]);
        assert_eq!(record.summary().missed, 1, "the tolerance stays");
    }

    #[test]
    fn point_without_orientation_keeps_the_worst_angle() {
        let point = GoalSummary {
            reached: 2,
            missed: 1,
            worst: Some(GoalError { position: 0.5, orientation: None }),
        };
        assert_eq!(point.merge(GoalSummary::default()), point);
        let both = point.merge(summary(1, Some(pose(0.1))));
        let worst = Some(GoalError { position: 0.5, orientation: Some(0.2) });
        assert_eq!(both, GoalSummary { reached: 3, missed: 1, worst });
    }
}
