//! Measured pose and joints of the robot.

use motorium::declare::{ConfigError, RobotReference, StepError};
use motorium_robots::{FrameId, Kinematics, Model};
use nalgebra::Isometry3;

use crate::robot;

/// The end effector of a robot, computed from its joint positions.
#[derive(Debug)]
pub(super) struct EndEffector {
    model: Model,
    frame: FrameId,
    kinematics: Kinematics,
}

impl EndEffector {
    pub(super) fn new(reference: &RobotReference, frame: Option<&str>) -> Result<Self, ConfigError> {
        let loaded = robot::load(reference)?;
        let frame = robot::end_effector(&loaded, frame, "end_effector.frame")?;
        let kinematics = Kinematics::new(&loaded.model);
        Ok(Self { model: loaded.model, frame, kinematics })
    }

    /// Returns the pose of the end effector. Fails if the robot has a different number of joints.
    pub(super) fn pose(&mut self, q: &[f64]) -> Result<Isometry3<f64>, StepError> {
        if q.len() != self.model.nq() {
            return Err(robot::unexpected_joints(self.model.nq(), q.len()));
        }
        self.kinematics.update(&self.model, q);
        Ok(self.kinematics.pose(&self.model, self.frame))
    }
}

/// Returns the indices in `q` of the joints that are the degrees of freedom of a library, by name.
pub(super) fn joints(reference: &RobotReference, names: &[String]) -> Result<Vec<usize>, ConfigError> {
    let loaded = robot::load(reference)?;
    let find = |name: &String| {
        loaded.model.joint_index(name).ok_or_else(|| {
            let message = format!("the library moves `{name}`, which is not a joint of `{}`", reference.name);
            ConfigError::key("library", message)
                .advise("name the degrees of freedom of the recordings as the joints, or give `end_effector`")
        })
    };
    names.iter().map(find).collect()
}
