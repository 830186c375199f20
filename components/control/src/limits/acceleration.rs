//! Joints accelerate and brake no faster than they can.

use motorium_robots::Model;
use nalgebra::DVector;

use super::PositionLimit;
use crate::{RobotState, solver::Problem};

/// Joint velocities change from one tick to the next by no more than the largest acceleration `a` of each
/// joint allows, and joints begin to brake in time for their position limits:
///
/// ```text
/// v' - a dt  <=  v  <=  v' + a dt                       v': velocity of the tick before
/// -b(q - q_min - margin)  <=  v  <=  b(q_max - margin - q)
/// b(l) = r l                        if l <= a / r^2,    r = min(rate, 1/dt)
/// b(l) = sqrt(2 a l - (a / r)^2)    else
/// ```
///
/// `b` is the speed from which a deceleration of `a` leads onto the exponential approach of
/// [`PositionLimit`], whose `rate` and `margin` it shares. Limits of positions and velocities are kept where
/// they ask for more. Unlike those this limit excludes standing still where a joint is moving:
/// [`DifferentialIk::add_acceleration_limit`](crate::DifferentialIk::add_acceleration_limit) gives it up
/// where constraints contradict it.
#[derive(Clone, Debug, PartialEq)]
pub struct AccelerationLimit {
    position: PositionLimit,
    most: DVector<f64>,
}

impl AccelerationLimit {
    /// With the largest acceleration of each joint \[rad/s2 or m/s2\], more than 0; an infinite one does not
    /// bound.
    ///
    /// # Panics
    /// If it is not one number for each joint of `model`.
    pub fn new(model: &Model, most: DVector<f64>, position: PositionLimit) -> Self {
        assert_eq!(most.len(), model.joint_count(), "one acceleration for each joint");
        Self { position, most }
    }

    /// Largest acceleration of each joint \[rad/s2 or m/s2\].
    pub fn most(&self) -> &DVector<f64> {
        &self.most
    }

    /// Narrows the bounds of `problem`, which admit 0; `before` are the velocities of the tick before.
    pub(crate) fn narrow(&self, state: &RobotState<'_>, before: &[f64], dt: f64, problem: &mut Problem) {
        let first = state.model.nv() - state.model.joint_count();
        let (lower, upper) = (state.model.lower(), state.model.upper());
        for (joint, q) in state.model.joints_of_q(state.q).iter().enumerate() {
            let (most, variable) = (self.most[joint], first + joint);
            if most.is_infinite() {
                continue;
            }
            let margin = self.position.margin.min(0.5 * (upper[joint] - lower[joint]));
            let below = self.approach(q - lower[joint] - margin, most, dt);
            let above = self.approach(upper[joint] - margin - q, most, dt);
            let (least, largest) = (problem.lower[variable].max(-below), problem.upper[variable].min(above));
            problem.lower[variable] = (before[variable] - most * dt).clamp(least, largest);
            problem.upper[variable] = (before[variable] + most * dt).clamp(least, largest);
        }
    }

    /// The speed `b` with which a position limit may be approached from a distance.
    fn approach(&self, left: f64, most: f64, dt: f64) -> f64 {
        let (left, rate) = (left.max(0.0), self.position.rate.min(dt.recip()));
        // in steps the parabola asks for a little more than its own deceleration
        let most = most * (1.0 - 0.5 * rate * dt);
        let slow = most / rate;
        if left * rate <= slow { rate * left } else { (2.0 * most * left - slow * slow).sqrt() }
    }
}
