//! Parts of several robots in the models of a simulation.

use super::robot::RandomisedRobot;

/// A robot's part of the models of a simulation.
#[derive(Clone, Debug)]
pub(super) struct Share {
    /// Index of the articulation that contains the robot.
    pub(super) articulation: usize,
    /// Index of its first body.
    pub(super) bodies: usize,
    /// Index of its first joint.
    pub(super) joints: usize,
    /// Prefix of its link names.
    pub(super) prefix: String,
}

/// Returns each robot's part of the model of its articulation.
pub(super) fn shares(robots: &[RandomisedRobot]) -> Vec<Share> {
    let share = |(index, robot): (usize, &RandomisedRobot)| {
        // Robots in one articulation keep their order.
        let before = || robots[..index].iter().filter(|other| other.articulation == robot.articulation);
        Share {
            articulation: robot.articulation,
            bodies: before().map(|other| other.model.bodies().len()).sum(),
            joints: before().map(|other| other.model.joint_count()).sum(),
            prefix: robot.name.as_ref().map(|name| format!("{name}/")).unwrap_or_default(),
        }
    };
    robots.iter().enumerate().map(share).collect()
}
