//! The pose target of a task, and its goals.

use motorium::prelude::*;
use motorium_robots::Twist;
use nalgebra::{Isometry3, Vector3};

use super::ramp::TaskBounds;
use crate::checks::pose_of;
use crate::{GoalError, GoalRecord, GoalTolerance};

/// Pose target from an input, and the errors at its goals.
pub(super) struct TargetInput {
    input: Input<PoseTarget>,
    /// The latest valid target.
    current: Option<PoseTarget>,
    /// Number of invalid target poses: the orientation is not a unit quaternion, or a number is not finite.
    refused: u64,
    goals: GoalRecord,
}

impl TargetInput {
    pub(super) fn new(input: Input<PoseTarget>, tolerance: GoalTolerance) -> Self {
        Self { input, current: None, refused: 0, goals: GoalRecord::new(tolerance) }
    }

    pub(super) fn reset(&mut self) {
        self.goals.reset();
        (self.current, self.refused) = (None, 0);
    }

    /// Returns `true` after the first valid target.
    pub(super) fn is_set(&self) -> bool {
        self.current.is_some()
    }

    /// Number of invalid target poses.
    pub(super) fn refused(&self) -> u64 {
        self.refused
    }

    /// Position and linear velocity of the latest target; a stale target is at rest.
    pub(super) fn point(&mut self, bounds: &TaskBounds) -> Option<(Vector3<f64>, Vector3<f64>)> {
        let reading = self.input.latest()?;
        let fresh = reading.age_ns() <= bounds.target_timeout_ns;
        let velocity = if fresh { Vector3::from(reading.linear_velocity) } else { Vector3::zeros() };
        self.current = Some(*reading);
        Some((Vector3::from(reading.position), velocity))
    }

    /// Pose and velocity of the latest target, if valid; a stale target is at rest.
    pub(super) fn pose(&mut self, bounds: &TaskBounds) -> Option<(Isometry3<f64>, Twist)> {
        let reading = self.input.latest()?;
        let velocity = Twist {
            linear: Vector3::from(reading.linear_velocity),
            angular: Vector3::from(reading.angular_velocity),
        };
        let finite = velocity.linear.iter().chain(&velocity.angular).all(|number| number.is_finite());
        let Some(pose) = pose_of(reading.position, reading.orientation).filter(|_| finite) else {
            self.refused += 1;
            return None;
        };
        let fresh = reading.age_ns() <= bounds.target_timeout_ns;
        self.current = Some(*reading);
        Some((pose, if fresh { velocity } else { Twist::zero() }))
    }

    /// Records the error of a step of `dt` seconds, if there is a target.
    pub(super) fn observe(&mut self, error: GoalError, dt: f64) {
        if let Some(target) = &self.current {
            self.goals.observe(target.goal, target.at_goal != 0, error, dt);
        }
    }

    /// The goals so far.
    pub(super) fn goals(&self) -> &GoalRecord {
        &self.goals
    }

    /// Entry of a task in the result of a run: goals, and errors of the quantities with a tolerance.
    pub(super) fn result(&self) -> serde_json::Value {
        let (summary, latest) = (self.goals.summary(), self.goals.latest());
        let mut result =
            serde_json::json!({ "goals_reached": summary.reached, "goals_missed": summary.missed });
        let GoalTolerance { position, orientation } = self.goals.tolerance();
        for (prefix, error) in [("", summary.worst), ("last_", latest)] {
            if position.is_finite() {
                result[format!("{prefix}position_error_m")] = error.map(|error| error.position).into();
            }
            if orientation.is_finite() {
                result[format!("{prefix}orientation_error_rad")] =
                    error.and_then(|error| error.orientation).into();
            }
        }
        result
    }
}
