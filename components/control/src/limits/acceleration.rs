//! Limits of joint accelerations and decelerations.

use motorium::declare::ConfigError;
use motorium_qp::Problem;
use motorium_robots::{Model, PerJoint, Profile};
use nalgebra::DVector;
use schemars::JsonSchema;
use serde::Deserialize;

use super::PositionLimit;
use crate::RobotState;
use crate::checks::{in_range, per_joint};

/// Limits the change of joint velocities per tick by the maximum acceleration `a` of each joint, and makes
/// joints brake in time for their position limits:
///
/// ```text
/// v' - a dt  <=  v  <=  v' + a dt                       v': velocity of the tick before
/// -b(q - q_min - margin)  <=  v  <=  b(q_max - margin - q)
/// b(l) = r l                        if l <= a / r^2,    r = min(rate, 1/dt)
/// b(l) = sqrt(2 a l - (a / r)^2)    else
/// ```
///
/// `b` is the speed from which a deceleration of `a` merges into the exponential approach of
/// [`PositionLimit`], with the same `rate` and `margin`. Limits of positions and velocities take precedence.
/// Unlike position and velocity limits, this limit does not let a moving joint stop immediately.
/// [`DifferentialIk::add_acceleration_limit`](crate::DifferentialIk::add_acceleration_limit) drops this limit
/// if other constraints contradict it.
#[derive(Clone, Debug, PartialEq)]
pub struct AccelerationLimit {
    position: PositionLimit,
    most: DVector<f64>,
}

impl AccelerationLimit {
    /// Creates a limit from the maximum acceleration of each joint \[rad/s2 or m/s2\], above 0; infinity
    /// means no limit. `position` sets the `rate` and `margin` of the approach to position limits.
    ///
    /// # Panics
    /// If the length differs from the number of joints of `model`.
    pub fn new(model: &Model, most: DVector<f64>, position: PositionLimit) -> Self {
        assert_eq!(most.len(), model.joint_count(), "one acceleration for each joint");
        Self { position, most }
    }

    /// Returns the maximum acceleration of each joint \[rad/s2 or m/s2\].
    pub fn most(&self) -> &DVector<f64> {
        &self.most
    }

    /// Narrows the bounds of `problem`, which admit 0; `before` are the velocities of the previous tick.
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

    /// Returns the maximum speed `b` of approach to a position limit at a distance.
    fn approach(&self, left: f64, most: f64, dt: f64) -> f64 {
        let (left, rate) = (left.max(0.0), self.position.rate.min(dt.recip()));
        // in discrete steps the parabola requires slightly more than the nominal deceleration
        let most = most * (1.0 - 0.5 * rate * dt);
        let slow = most / rate;
        if left * rate <= slow { rate * left } else { (2.0 * most * left - slow * slow).sqrt() }
    }
}

with_defaults! {
    /// Maximum accelerations of the joints. Joints start to brake in time for their position limits.
    ///
    /// ```toml
    /// fraction = 0.5
    /// ```
    #[derive(Debug, Clone, Deserialize, JsonSchema)]
    #[serde(default, deny_unknown_fields)]
    pub struct AccelerationConfig;

    /// Fraction of the acceleration limits that may be used, above 0, at most 1. Default 1.
    pub fraction: f64 = 1.0;
    /// Maximum acceleration, rad/s2 or m/s2, above 0: one number, or one per joint. Default: the limits in
    /// the robot's profile; a joint without a limit is unlimited.
    pub most: Option<PerJoint> = None;
}

impl AccelerationConfig {
    /// Converts and checks the limit.
    pub(crate) fn build(
        &self,
        model: &Model,
        profile: Option<&Profile>,
        position: PositionLimit,
    ) -> Result<AccelerationLimit, ConfigError> {
        let key = |name: &str| format!("limits.acceleration.{name}");
        let fraction = in_range(&key("fraction"), self.fraction, 1e-6..=1.0)?;
        let most = match (&self.most, profile) {
            (Some(given), _) => {
                let most = per_joint(&key("most"), given, model)?;
                for most in &most {
                    in_range(&key("most"), *most, 1e-6..=f64::MAX)?;
                }
                Some(most)
            }
            (None, Some(profile)) => {
                let most = profile.acceleration_limit(model);
                Some(most.map_err(|error| ConfigError::key("limits.acceleration", error.to_string()))?)
            }
            (None, None) => None,
        };
        let Some(most) = most.filter(|most| most.iter().any(|most| most.is_finite())) else {
            let message = format!("robot `{}` has no acceleration limits in its profile", model.name());
            return Err(ConfigError::key("limits.acceleration", message)
                .advise("give them here: `most`, one number or one per joint, rad/s2 or m/s2"));
        };
        Ok(AccelerationLimit::new(model, most * fraction, position))
    }
}
