//! The list `limits.frames` of `control.qp`: limits of position and velocity of frames.

use motorium::declare::ConfigError;
use motorium_robots::{Model, Profile};
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

use super::{CartesianPositionLimit, CartesianVelocityLimit, RowLimit};
use crate::checks::in_range;

with_defaults! {
    /// Limits of one frame, enforced at every level: a box in the world for its origin, and maximum
    /// velocities.
    #[derive(Debug, Clone, Deserialize, JsonSchema)]
    #[serde(default, deny_unknown_fields)]
    pub struct FrameLimitConfig;

    /// Link whose frame is limited. Default: the robot's only end effector.
    pub frame: Option<String> = None;
    /// Minimum and maximum coordinate of the frame's origin along x of the world, m. Default: no limit.
    pub x: Option<[f64; 2]> = None;
    /// Minimum and maximum coordinate along y, m. Default: no limit.
    pub y: Option<[f64; 2]> = None;
    /// Minimum and maximum coordinate along z, m. Default: no limit.
    pub z: Option<[f64; 2]> = None;
    /// Distance kept from the sides of the box, m, at least 0. Default 0.
    pub margin: f64 = 0.0;
    /// Fraction of the remaining distance to a side that may be covered per second, 1/s, at least 1e-3.
    /// Default 5.
    pub rate: f64 = 5.0;
    /// Maximum speed along each axis of the world, m/s, at least 0. Default: no limit.
    pub max_linear: Option<f64> = None;
    /// Maximum angular speed about each axis of the world, rad/s, at least 0. Default: no limit.
    pub max_angular: Option<f64> = None;
}

impl FrameLimitConfig {
    /// Builds, checks and appends the limits; `path` is the path of the table.
    pub(crate) fn build(
        &self,
        path: &str,
        model: &Model,
        profile: Option<&Profile>,
        limits: &mut Vec<Box<dyn RowLimit>>,
    ) -> Result<(), ConfigError> {
        let key = |name: &str| format!("{path}.{name}");
        let frame = model
            .end_effector(profile, self.frame.as_deref())
            .map_err(|error| ConfigError::key(key("frame"), error.to_string()))?;
        let margin = in_range(&key("margin"), self.margin, 0.0..=1e3)?;
        let rate = in_range(&key("rate"), self.rate, 1e-3..=1e6)?;
        let (mut lower, mut upper) = (Vector3::repeat(f64::NEG_INFINITY), Vector3::repeat(f64::INFINITY));
        for (axis, (name, range)) in [("x", self.x), ("y", self.y), ("z", self.z)].into_iter().enumerate() {
            let Some([least, most]) = range else { continue };
            if most - least < 2.0 * margin {
                let message = format!("the range {least} to {most} is too narrow for a margin of {margin}");
                return Err(ConfigError::key(key(name), message)
                    .advise("give the smaller bound first, and at least twice the margin between them"));
            }
            (lower[axis], upper[axis]) = (least, most);
        }
        let speed = |name: &str, speed: Option<f64>| match speed {
            None => Ok(f64::INFINITY),
            Some(speed) => in_range(&key(name), speed, 0.0..=f64::MAX),
        };
        let (linear, angular) =
            (speed("max_linear", self.max_linear)?, speed("max_angular", self.max_angular)?);
        let within = CartesianPositionLimit::within(model, frame, lower, upper).with(rate, margin);
        let bounded = within.rows() > 0;
        if bounded {
            limits.push(Box::new(within));
        }
        if linear.is_finite() || angular.is_finite() {
            limits.push(Box::new(CartesianVelocityLimit::new(model, frame, linear, angular)));
        } else if !bounded {
            return Err(ConfigError::key(
                key("frame"),
                "the limit has neither a position nor a velocity bound",
            )
            .advise("add `x`, `y`, `z`, `max_linear` or `max_angular`"));
        }
        Ok(())
    }
}
