//! Per-joint values in configurations.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{JointKind, Model};

/// One number for all joints of a robot, or a list of one number per joint in the model's order.
///
/// ```
/// use motorium_robots::PerJoint;
///
/// let all: PerJoint = serde_json::from_str("400.0")?;
/// assert_eq!(all.resolve(3)?, [400.0; 3]);
/// let each: PerJoint = serde_json::from_str("[400.0, 300.0]")?;
/// assert_eq!(each.resolve(3).unwrap_err().to_string(), "2 numbers, expected 3: one per joint");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected one number, or a list with one number per joint")]
pub enum PerJoint {
    /// One number for all joints.
    All(f64),
    /// One number for each joint.
    Each(Vec<f64>),
}

/// The length of a list differs from the number of joints.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{found} numbers, expected {expected}: one per joint")]
pub struct PerJointError {
    /// Length of the list.
    pub found: usize,
    /// Number of joints of the robot.
    pub expected: usize,
}

impl Default for PerJoint {
    /// The value 0 for all joints.
    fn default() -> Self {
        Self::All(0.0)
    }
}

impl PerJoint {
    /// Returns a list of one number for each of `joints` joints.
    ///
    /// # Errors
    /// [`PerJointError`] if the value is a list whose length is not `joints`.
    pub fn resolve(&self, joints: usize) -> Result<Vec<f64>, PerJointError> {
        match self {
            Self::All(value) => Ok(vec![*value; joints]),
            Self::Each(values) if values.len() == joints => Ok(values.clone()),
            Self::Each(values) => Err(PerJointError { found: values.len(), expected: joints }),
        }
    }

    /// Returns the numbers as written: a single number, or one per joint.
    pub fn values(&self) -> &[f64] {
        match self {
            Self::All(value) => core::slice::from_ref(value),
            Self::Each(values) => values,
        }
    }
}

impl Model {
    /// Returns advice for a position of a revolute joint that was probably written in degrees: it is outside
    /// the joint's limits in rad, but would be within the limits if converted from degrees. Returns `None`
    /// for all other positions.
    ///
    /// ```
    /// let panda = motorium_robots::load("panda", std::path::Path::new("."))?.model;
    /// let advice = panda.degrees_advice(0, 90.0);
    /// assert_eq!(advice.as_deref(), Some("positions of joints that turn are in rad: 90 degrees are 1.5708 rad"));
    /// assert_eq!(panda.degrees_advice(0, 3.0), None);
    /// # Ok::<(), motorium_robots::LoadError>(())
    /// ```
    pub fn degrees_advice(&self, joint: usize, position: f64) -> Option<String> {
        // a position of less than two turns may be in rad
        const LEAST: f64 = 2.0 * core::f64::consts::TAU;
        let turns = self.joint(joint).kind != JointKind::Prismatic;
        let (lower, upper, meant) = (self.lower()[joint], self.upper()[joint], position.to_radians());
        let is_meant = turns && position.abs() > LEAST && (lower..=upper).contains(&meant);
        is_meant.then(|| {
            format!("positions of joints that turn are in rad: {position} degrees are {meant:.4} rad")
        })
    }
}
