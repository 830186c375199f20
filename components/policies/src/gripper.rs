//! Grippers: goals of fingers, and the corresponding joint positions.

use core::str::FromStr;
use std::time::Duration;

use motorium_robots::{EndEffectorError, Loaded};
use schemars::JsonSchema;
use serde::Deserialize;

/// Goal of a gripper.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected \"open\", \"close\", or a position of the fingers' joints")]
pub enum Gripper {
    /// Fully open or fully closed.
    End(GripperEnd),
    /// Position of every joint of the fingers, rad or m.
    Position(f64),
}

/// End of the range of a gripper.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum GripperEnd {
    /// The profile's pose "open", or the upper limits of the fingers' joints.
    Open,
    /// The profile's pose "closed", or the lower limits of the fingers' joints. An object may stop the
    /// fingers.
    Close,
}

/// Error returned when a text is not a gripper goal.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("found `{found}`, expected `open`, `close`, or a position of the fingers' joints in rad or m")]
pub struct GripperTextError {
    /// Text found.
    pub found: String,
}

impl FromStr for Gripper {
    type Err = GripperTextError;

    fn from_str(text: &str) -> Result<Self, GripperTextError> {
        match (text, text.parse::<f64>()) {
            ("open", _) => Ok(Self::End(GripperEnd::Open)),
            ("close", _) => Ok(Self::End(GripperEnd::Close)),
            (_, Ok(position)) if position.is_finite() => Ok(Self::Position(position)),
            _ => Err(GripperTextError { found: text.to_owned() }),
        }
    }
}

/// Error returned when a gripper cannot be commanded.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GripperError {
    /// There is no unique end effector.
    #[error(transparent)]
    EndEffector(#[from] EndEffectorError),
    /// The end effector has no fingers.
    #[error("the end effector of robot `{robot}` has no `fingers` in its profile")]
    NoFingers {
        /// Name of the robot in the robot's file.
        robot: String,
    },
    /// The position is outside of a joint's range.
    #[error("finger `{joint}` at {position}, outside of its range {lower} to {upper}")]
    OutsideRange {
        /// Name of the joint.
        joint: String,
        /// Position found, rad or m.
        position: f64,
        /// Lower limit of the joint, rad or m.
        lower: f64,
        /// Upper limit of the joint, rad or m.
        upper: f64,
    },
}

/// Fingers of an end effector.
///
/// ```
/// use motorium_policies::{Fingers, Gripper};
///
/// let panda = motorium_robots::load("panda", std::path::Path::new(".")).unwrap();
/// let fingers = Fingers::of_robot(&panda, None).unwrap();
/// let open: Vec<_> = fingers.positions("open".parse().unwrap()).unwrap().collect();
/// assert_eq!(open, [(7, 0.04)]);
/// assert!(fingers.positions(Gripper::Position(0.5)).is_err());
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Fingers(Vec<Finger>);

#[derive(Debug, Clone, PartialEq)]
struct Finger {
    /// Index of its joint.
    joint: usize,
    name: String,
    lower: f64,
    upper: f64,
    open: f64,
    closed: f64,
    /// Velocity limit, rad/s or m/s.
    velocity: f64,
}

impl Fingers {
    /// Returns the fingers of the end effector with the frame `frame`. If `frame` is `None`, the robot's only
    /// end effector is used.
    ///
    /// # Errors
    /// [`GripperError`] if the end effector does not exist or has no fingers.
    pub fn of_robot(robot: &Loaded, frame: Option<&str>) -> Result<Self, GripperError> {
        let model = &robot.model;
        let id = robot.end_effector(frame)?;
        let frame = &model.frames()[id.index()].name;
        let profile = robot.profile.as_ref();
        let ends = profile.into_iter().flat_map(|profile| profile.end_effectors.values());
        let names = ends.filter(|end| end.frame == *frame).flat_map(|end| &end.fingers);
        let at = |pose: &str, joint: usize, usual: f64| {
            let pose = profile.and_then(|profile| profile.pose(model, pose).ok());
            pose.map_or(usual, |pose| pose[joint])
        };
        let finger = |name: &String| {
            let joint = model.joint_index(name)?;
            let (lower, upper) = (model.lower()[joint], model.upper()[joint]);
            let (open, closed) = (at("open", joint, upper), at("closed", joint, lower));
            let velocity = model.velocity_limit()[joint];
            Some(Finger { joint, name: name.clone(), lower, upper, open, closed, velocity })
        };
        let fingers: Vec<Finger> = names.filter_map(finger).collect();
        match fingers.is_empty() {
            true => Err(GripperError::NoFingers { robot: model.name().to_owned() }),
            false => Ok(Self(fingers)),
        }
    }

    /// Returns the index of each finger's joint with its position for a goal, rad or m.
    ///
    /// # Errors
    /// [`GripperError`] if the position is outside of a joint's range.
    pub fn positions(&self, goal: Gripper) -> Result<impl Iterator<Item = (usize, f64)>, GripperError> {
        let position = move |finger: &Finger| match goal {
            Gripper::End(GripperEnd::Open) => finger.open,
            Gripper::End(GripperEnd::Close) => finger.closed,
            Gripper::Position(position) => position,
        };
        let is_outside = |finger: &&Finger| !(finger.lower..=finger.upper).contains(&position(finger));
        if let Some(finger) = self.0.iter().find(is_outside) {
            return Err(GripperError::OutsideRange {
                joint: finger.name.clone(),
                position: position(finger),
                lower: finger.lower,
                upper: finger.upper,
            });
        }
        Ok(self.0.iter().map(move |finger| (finger.joint, position(finger))))
    }

    /// Returns the shortest time in which every finger can move through its whole range; 0 without velocity
    /// limits.
    pub(crate) fn travel_time(&self) -> Duration {
        let times = self.0.iter().map(|finger| (finger.upper - finger.lower) / finger.velocity);
        Duration::try_from_secs_f64(times.fold(0.0, f64::max)).unwrap_or_default()
    }

    /// Returns `true` if a finger is closed at this position, in which case an object may stop it earlier.
    pub(crate) fn is_closed(&self, joint: usize, position: f64) -> bool {
        self.0.iter().any(|finger| finger.joint == joint && (position - finger.closed).abs() < 1e-9)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gripper_goals_are_ends_or_positions() {
        assert_eq!("close".parse(), Ok(Gripper::End(GripperEnd::Close)));
        assert_eq!("0.02".parse(), Ok(Gripper::Position(0.02)));
        for text in ["shut", "nan", ""] {
            assert_eq!(text.parse::<Gripper>(), Err(GripperTextError { found: text.to_owned() }));
        }
    }

    #[test]
    fn profile_poses_take_precedence_over_limits() {
        let panda = motorium_robots::load("panda", std::path::Path::new(".")).unwrap();
        let mut fingers = Fingers::of_robot(&panda, None).unwrap();
        let closed: Vec<_> = fingers.positions(Gripper::End(GripperEnd::Close)).unwrap().collect();
        assert_eq!(closed, [(7, 0.0)]);
        assert!(fingers.is_closed(7, 0.0) && !fingers.is_closed(7, 0.012) && !fingers.is_closed(6, 0.0));
        fingers.0[0].closed = -1.0;
        assert!(fingers.positions(Gripper::End(GripperEnd::Close)).is_err());
        let arm = motorium_robots::load("ur5e", std::path::Path::new(".")).unwrap();
        assert!(matches!(Fingers::of_robot(&arm, None), Err(GripperError::NoFingers { .. })));
    }
}
