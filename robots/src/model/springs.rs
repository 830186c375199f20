//! Springs in the joints of a robot.

use super::Model;
use crate::nearest::nearest;

/// Error of a spring setting that is not valid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SpringError {
    /// The robot has no joint with this name.
    #[error("the robot has no joint \"{joint}\"{}", crate::nearest::suggestion(.nearest.as_deref()))]
    UnknownJoint {
        /// The unknown name.
        joint: String,
        /// The closest existing joint.
        nearest: Option<String>,
    },
    /// A number is out of range.
    #[error("{name} {value} of the spring of joint \"{joint}\", expected {expected}")]
    Value {
        /// Name of the joint.
        joint: String,
        /// Name of the setting.
        name: &'static str,
        /// Actual value.
        value: f64,
        /// Expected range, as a phrase.
        expected: &'static str,
    },
}

impl Model {
    /// Returns the robot with springs in the given joints. These springs replace springs that the joints
    /// already have. Each entry of `springs` is the joint's name, the stiffness \[Nm/rad or N/m\], and the
    /// rest position \[rad or m\].
    ///
    /// ```
    /// let arm = motorium_robots::load("planar-3r", std::path::Path::new("."))?.model;
    /// let joint = arm.joint_names()[1].clone();
    /// let sprung = arm.with_springs(&[(&joint, 40.0, 0.3)])?;
    /// assert_eq!(sprung.joint(1).dynamics.stiffness, 40.0);
    /// assert!(arm.with_springs(&[(&joint, -1.0, 0.0)]).is_err());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`SpringError`] for an unknown joint or a number out of range.
    pub fn with_springs(&self, springs: &[(&str, f64, f64)]) -> Result<Self, SpringError> {
        let mut bodies = self.bodies.clone();
        for &(name, stiffness, rest) in springs {
            let Some(body) = bodies.iter_mut().find(|body| body.joint.name == name) else {
                let names = self.bodies.iter().map(|body| body.joint.name.as_str());
                let nearest = nearest(name, names).map(str::to_owned);
                return Err(SpringError::UnknownJoint { joint: name.to_owned(), nearest });
            };
            let refused = |what, value, expected| SpringError::Value {
                joint: name.to_owned(),
                name: what,
                value,
                expected,
            };
            if !(stiffness >= 0.0 && stiffness.is_finite()) {
                return Err(refused("stiffness", stiffness, "a number from 0 up"));
            }
            if !rest.is_finite() {
                return Err(refused("rest", rest, "a finite number"));
            }
            (body.joint.dynamics.stiffness, body.joint.dynamics.rest) = (stiffness, rest);
        }
        Ok(Self::new(self.name.clone(), self.base.clone(), bodies, self.frames.clone()))
    }
}
