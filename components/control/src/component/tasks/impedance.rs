//! The tables `impedance` of Cartesian and posture tasks.

use motorium::prelude::*;
use motorium_robots::PerJoint;
use schemars::JsonSchema;
use serde::Deserialize;

use super::{TaskParameter, TaskPlace};
use crate::component::checks::per_joint;
use crate::tasks::CartesianImpedance;

/// Range of every stiffness and damping.
const FIGURES: core::ops::RangeInclusive<f64> = 0.0..=1e6;

/// A spring and a damper that pull a frame to its target, replacing `gain`. Requires `inverse_dynamics`.
///
/// ```toml
/// impedance = { stiffness = 300.0, damping = 50.0, rotational_stiffness = 20.0, rotational_damping = 3.0 }
/// ```
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CartesianImpedanceConfig {
    /// Stiffness along each axis, N/m, 0 to 1e6.
    pub stiffness: f64,
    /// Damping along each axis, N s/m, 0 to 1e6.
    pub damping: f64,
    /// Stiffness about each axis, N m/rad, 0 to 1e6.
    pub rotational_stiffness: f64,
    /// Damping about each axis, N m s/rad, 0 to 1e6.
    pub rotational_damping: f64,
}

impl CartesianImpedanceConfig {
    /// Spring and damper, checked.
    pub(super) fn build(&self, place: &TaskPlace<'_>, gain: Gain) -> Result<CartesianImpedance, ConfigError> {
        gain.check(place)?;
        let figure = |name: &str, value| place.in_range(&format!("impedance.{name}"), value, FIGURES);
        Ok(CartesianImpedance {
            stiffness: figure("stiffness", self.stiffness)?,
            damping: figure("damping", self.damping)?,
            rotational_stiffness: figure("rotational_stiffness", self.rotational_stiffness)?,
            rotational_damping: figure("rotational_damping", self.rotational_damping)?,
        })
    }

    /// Parameters that replace the gain.
    pub(super) fn parameters(&self) -> [TaskParameter; 2] {
        [
            TaskParameter::new("stiffness", self.stiffness, FIGURES, "N/m", "stiffness towards the target"),
            TaskParameter::new("damping", self.damping, FIGURES, "N s/m", "damping of the motion"),
        ]
    }
}

/// Springs and dampers that pull the joints to their posture, replacing `gain`. Requires `inverse_dynamics`.
///
/// ```toml
/// impedance = { stiffness = 100.0, damping = 10.0 }
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JointImpedanceConfig {
    /// Stiffness of the joints, N m/rad or N/m, 0 to 1e6: one number, or one per joint.
    pub stiffness: PerJoint,
    /// Damping of the joints, N m s/rad or N s/m, 0 to 1e6: one number, or one per joint.
    pub damping: PerJoint,
}

impl JointImpedanceConfig {
    /// Stiffness and damping of each joint, checked.
    pub(super) fn build(&self, place: &TaskPlace<'_>, gain: Gain) -> Result<[Vec<f64>; 2], ConfigError> {
        gain.check(place)?;
        let of = |name: &str, given: &PerJoint| {
            let key = format!("impedance.{name}");
            let values = per_joint(&place.key(&key), given, place.model)?;
            for value in &values {
                place.in_range(&key, *value, FIGURES)?;
            }
            Ok(values.as_slice().to_vec())
        };
        Ok([of("stiffness", &self.stiffness)?, of("damping", &self.damping)?])
    }
}

/// Gain of a task and its default; unused with an impedance.
pub(super) struct Gain {
    pub(super) given: f64,
    pub(super) default: f64,
}

impl Gain {
    fn check(&self, place: &TaskPlace<'_>) -> Result<(), ConfigError> {
        if !place.torque {
            return Err(ConfigError::key(
                place.key("impedance"),
                "without `inverse_dynamics`, which computes forces",
            )
            .advise("add `inverse_dynamics = {}`, or use `gain`"));
        }
        if self.given != self.default {
            return Err(ConfigError::key(place.key("gain"), "beside `impedance`, which takes its place")
                .advise("keep one of the two"));
        }
        Ok(())
    }
}
