//! Velocity limits of joints.

use motorium_qp::Problem;
use schemars::JsonSchema;
use serde::Deserialize;

use super::Limit;
use crate::RobotState;

with_defaults! {
    /// Keeps joint velocities within a fraction of the model's limits:
    ///
    /// ```text
    /// -fraction v_max <= v <= fraction v_max
    /// ```
    #[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
    #[serde(default, deny_unknown_fields)]
    pub struct VelocityLimit;

    /// Fraction of the robot's velocity limits that may be used, more than 0, at most 1. Default 1.
    pub fraction: f64 = 1.0;
}

impl Limit for VelocityLimit {
    fn intersect(&self, state: &RobotState<'_>, _dt: f64, problem: &mut Problem) {
        let first = state.model.nv() - state.model.joint_count();
        for (joint, limit) in state.model.velocity_limit().iter().enumerate() {
            let (variable, limit) = (first + joint, self.fraction * limit);
            problem.lower[variable] = problem.lower[variable].max(-limit);
            problem.upper[variable] = problem.upper[variable].min(limit);
        }
    }
}
