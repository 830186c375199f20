//! How close a frame came to the goals it was sent to.

use motorium::state::PoseTarget;

/// Time for which the target must have rested at a goal that is still held when the run ends, s: less says nothing
/// about the controller.
const SETTLE: f64 = 0.2;

/// Distance and angle between a frame and its target.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct PoseError {
    /// m.
    pub(super) position: f64,
    /// rad.
    pub(super) orientation: f64,
}

impl PoseError {
    pub(super) fn worse(self, other: Self) -> Self {
        Self {
            position: self.position.max(other.position),
            orientation: self.orientation.max(other.orientation),
        }
    }
}

/// Records the error at each goal: at the last tick before the target left it, or before the run ended.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct GoalRecord {
    goal: Option<u64>,
    /// The error while the target rests at the current goal.
    resting: Option<PoseError>,
    rested: f64,
    reached: u64,
    worst: PoseError,
    latest: Option<PoseError>,
}

impl GoalRecord {
    /// Takes in the error of one tick of `dt` seconds.
    pub(super) fn observe(&mut self, target: &PoseTarget, error: PoseError, dt: f64) {
        if self.goal != Some(target.goal) {
            self.leave();
            self.goal = Some(target.goal);
        }
        self.latest = Some(error);
        if target.at_goal != 0 {
            self.resting = Some(error);
            self.rested += dt;
        }
    }

    fn leave(&mut self) {
        if let Some(error) = self.resting.take() {
            self.worst = self.worst.worse(error);
            self.reached += 1;
        }
        self.rested = 0.0;
    }

    /// Number of goals and the worst error at any of them, as if the run ended now.
    pub(super) fn summary(mut self) -> (u64, Option<PoseError>) {
        if self.rested + 1e-9 >= SETTLE {
            self.leave();
        }
        (self.reached, (self.reached > 0).then_some(self.worst))
    }

    /// The error at the last tick.
    pub(super) fn latest(&self) -> Option<PoseError> {
        self.latest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drive(record: &mut GoalRecord, goal: u64, at_goal: u64, errors: &[f64]) {
        for error in errors {
            let target = PoseTarget { goal, at_goal, ..Default::default() };
            record.observe(&target, PoseError { position: *error, orientation: 2.0 * error }, 0.05);
        }
    }

    #[test]
    fn the_error_at_a_goal_is_the_last_one_before_the_target_leaves_it() {
        let mut record = GoalRecord::default();
        drive(&mut record, 1, 0, &[0.5, 0.4]);
        drive(&mut record, 1, 1, &[0.3, 0.1, 0.01]);
        assert_eq!(record.summary(), (0, None), "it has hardly arrived");
        drive(&mut record, 2, 0, &[0.5, 0.6]);
        let worst = Some(PoseError { position: 0.01, orientation: 0.02 });
        assert_eq!(record.summary(), (1, worst));
        assert_eq!(record.latest(), Some(PoseError { position: 0.6, orientation: 1.2 }));
    }

    #[test]
    fn the_last_goal_counts_once_the_target_has_rested_there() {
        let mut record = GoalRecord::default();
        drive(&mut record, 1, 1, &[0.2, 0.1, 0.05]);
        assert_eq!(record.summary(), (0, None));
        drive(&mut record, 1, 1, &[0.002]);
        assert_eq!(record.summary(), (1, Some(PoseError { position: 0.002, orientation: 0.004 })));
    }

    #[test]
    fn the_worst_goal_is_reported_and_a_goal_never_rested_at_is_none() {
        let mut record = GoalRecord::default();
        drive(&mut record, 1, 1, &[0.01]);
        drive(&mut record, 2, 0, &[0.9]);
        drive(&mut record, 3, 1, &[0.03]);
        drive(&mut record, 4, 1, &[0.02]);
        drive(&mut record, 5, 0, &[0.9]);
        assert_eq!(record.summary(), (3, Some(PoseError { position: 0.03, orientation: 0.06 })));
    }
}
