//! Robot state as used by the tasks and limits of one tick.

use motorium_robots::{Kinematics, Model};

/// A model, its configuration, and its kinematics at that configuration.
#[derive(Clone, Copy, Debug)]
pub struct RobotState<'a> {
    /// The robot.
    pub model: &'a Model,
    /// Updated at `q`; poses and Jacobians are read from here.
    pub kinematics: &'a Kinematics,
    /// Configuration, nq long: the joint positions \[rad or m\], after the pose of a floating base.
    pub q: &'a [f64],
}
