//! What a policy sees of the robot.

use motorium::declare::{ConfigError, RobotReference};
use motorium_robots::{FrameId, Kinematics, Model};
use nalgebra::Isometry3;

/// The hand of a robot, found from its joint positions.
#[derive(Debug)]
pub(super) struct Hand {
    model: Model,
    frame: FrameId,
    kinematics: Kinematics,
}

impl Hand {
    pub(super) fn new(robot: &RobotReference, frame: Option<&str>) -> Result<Self, ConfigError> {
        let loaded = motorium_robots::load(&robot.urdf, &robot.base)
            .map_err(|error| ConfigError::new(error.to_string()))?;
        let mut hands = loaded.profile.iter().flat_map(|profile| profile.end_effectors.values());
        let name = match (frame, hands.next(), hands.next()) {
            (Some(name), _, _) => name.to_string(),
            (None, Some(hand), None) => hand.frame.clone(),
            _ => {
                let message =
                    format!("robot `{}` has not one end effector, and no `frame` is given", robot.name);
                return Err(ConfigError::key("hand.frame", message).advise("name the link that is led"));
            }
        };
        let frame =
            loaded.model.frame(&name).map_err(|error| ConfigError::key("hand.frame", error.to_string()))?;
        let kinematics = Kinematics::new(&loaded.model);
        Ok(Self { model: loaded.model, frame, kinematics })
    }

    /// The pose of the hand, or nothing if the positions are those of another robot.
    pub(super) fn pose(&mut self, q: &[f64]) -> Option<Isometry3<f64>> {
        if q.len() != self.model.nq() {
            return None;
        }
        self.kinematics.update(&self.model, q);
        Some(self.kinematics.pose(&self.model, self.frame))
    }
}

/// The joints that the degrees of freedom of a library are, by name: index in `q` of each.
pub(super) fn joints(robot: &RobotReference, names: &[String]) -> Result<Vec<usize>, ConfigError> {
    let loaded = motorium_robots::load(&robot.urdf, &robot.base)
        .map_err(|error| ConfigError::new(error.to_string()))?;
    let find = |name: &String| {
        loaded.model.joint_index(name).ok_or_else(|| {
            let message = format!("the library moves `{name}`, which is no joint of `{}`", robot.name);
            ConfigError::key("library", message)
                .advise("name the degrees of freedom of the recordings as the joints, or give `hand`")
        })
    };
    names.iter().map(find).collect()
}
