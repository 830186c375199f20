//! Configured limits of a joint motion.

use motorium::declare::ConfigError;
use motorium_primitives::profile::MotionLimits;
use motorium_robots::{Model, PerJoint, Profile};
use schemars::JsonSchema;
use serde::Deserialize;

/// Time to reach the velocity limit if no acceleration limit is specified, s.
const TO_SPEED: f64 = 0.5;
/// Time to reach the acceleration limit if no jerk limit is specified, s.
const TO_ACCELERATION: f64 = 0.05;

/// Limits of a motion: one number for all joints, or one per joint.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MotionLimitsConfig {
    /// Maximum velocity, rad/s or m/s. Default: the limit of the robot's model.
    pub velocity: Option<PerJoint>,
    /// Maximum acceleration, rad/s^2 or m/s^2. Default: the limit of the robot's profile, or the value that
    /// reaches the velocity limit in half a second.
    pub acceleration: Option<PerJoint>,
    /// Maximum jerk, rad/s^3 or m/s^3. Default: the value that reaches the acceleration limit in 50 ms.
    pub jerk: Option<PerJoint>,
    /// Fraction of all limits that is used, above 0, at most 1. Default 0.9.
    pub fraction: f64,
}

impl Default for MotionLimitsConfig {
    fn default() -> Self {
        Self { velocity: None, acceleration: None, jerk: None, fraction: 0.9 }
    }
}

impl MotionLimitsConfig {
    /// Returns the limits of all joints.
    pub(crate) fn resolve(
        &self,
        model: &Model,
        profile: Option<&Profile>,
    ) -> Result<Vec<MotionLimits>, ConfigError> {
        let fraction = self.fraction;
        if !(fraction > 0.0 && fraction <= 1.0) {
            let message = format!("{fraction}, expected above 0 and at most 1");
            return Err(ConfigError::key("limits.fraction", message));
        }
        let given = |key: &str, given: &Option<PerJoint>| -> Result<Option<Vec<f64>>, ConfigError> {
            let key = format!("limits.{key}");
            let Some(given) = given else { return Ok(None) };
            let values = given.resolve(model.joint_count());
            let values = values.map_err(|error| {
                ConfigError::key(&key, error.to_string())
                    .advise(format!("in this order: {}", model.joint_names().join(", ")))
            })?;
            match values.iter().find(|value| !(value.is_finite() && **value > 0.0)) {
                Some(value) => Err(ConfigError::key(key, format!("{value}, expected a positive number"))),
                None => Ok(Some(values)),
            }
        };
        let velocity = given("velocity", &self.velocity)?;
        let acceleration = given("acceleration", &self.acceleration)?;
        let jerk = given("jerk", &self.jerk)?;
        let of_profile = profile.map(|profile| profile.acceleration_limit(model)).transpose();
        let of_profile = of_profile.map_err(|error| ConfigError::key("robot", error.to_string()))?;
        let of_joint = |joint: usize| {
            let velocity = velocity.as_ref().map_or(model.velocity_limit()[joint], |given| given[joint]);
            if !velocity.is_finite() {
                let message = format!("joint \"{}\" has no velocity limit", model.joint_names()[joint]);
                return Err(ConfigError::key("limits.velocity", message)
                    .advise("give one number for all joints, or one for each"));
            }
            let usual = of_profile.as_ref().map_or(f64::INFINITY, |limits| limits[joint]);
            let usual = if usual.is_finite() { usual } else { velocity / TO_SPEED };
            let acceleration = acceleration.as_ref().map_or(usual, |given| given[joint]);
            let jerk = jerk.as_ref().map_or(acceleration / TO_ACCELERATION, |given| given[joint]);
            Ok(MotionLimits {
                velocity: fraction * velocity,
                acceleration: fraction * acceleration,
                jerk: fraction * jerk,
            })
        };
        (0..model.joint_count()).map(of_joint).collect()
    }
}
