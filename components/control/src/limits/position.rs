//! Position limits of joints.

use motorium_qp::Problem;
use schemars::JsonSchema;
use serde::Deserialize;

use super::Limit;
use crate::RobotState;

with_defaults! {
    /// Limits the speed at which joints approach their position limits, so that they can still stop:
    ///
    /// ```text
    /// min(rate, 1/dt) (q_min + margin - q)  <=  v  <=  min(rate, 1/dt) (q_max - margin - q)
    /// ```
    ///
    /// so that one tick never crosses a limit and the distance to the limit shrinks at most exponentially. A
    /// joint outside its limits may stay there or return, but not move farther out (zero velocity stays
    /// feasible, as in OpenSoT). Joints without limits are not affected.
    #[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
    #[serde(default, deny_unknown_fields)]
    pub struct PositionLimit;

    /// Fraction of the remaining distance that may be covered per second, 1/s, at least 1e-3. Default 20.
    pub rate: f64 = 20.0;
    /// Distance kept from the position limits of the robot, rad or m, at least 0. Limited to half the range.
    /// Default 0.
    pub margin: f64 = 0.0;
}

impl Limit for PositionLimit {
    fn intersect(&self, state: &RobotState<'_>, dt: f64, problem: &mut Problem) {
        let rate = self.rate.min(dt.recip());
        let (lower, upper) = (state.model.lower(), state.model.upper());
        let first = state.model.nv() - state.model.joint_count();
        for (joint, q) in state.model.joints_of_q(state.q).iter().enumerate() {
            let margin = self.margin.min(0.5 * (upper[joint] - lower[joint]));
            let below = rate * (lower[joint] + margin - q);
            let above = rate * (upper[joint] - margin - q);
            let variable = first + joint;
            problem.lower[variable] = problem.lower[variable].max(below.min(0.0));
            problem.upper[variable] = problem.upper[variable].min(above.max(0.0));
        }
    }
}
