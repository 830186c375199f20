//! Robot states that tasks and limits of one tick are evaluated at.

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

/// A model, its configuration and velocity, and its kinematics at both.
#[derive(Clone, Copy, Debug)]
pub struct MotionState<'a> {
    /// The robot.
    pub model: &'a Model,
    /// Updated at `q` and `v`: poses, velocities, Jacobians and drifts are read from here.
    pub kinematics: &'a Kinematics,
    /// Configuration, nq long: a floating base first.
    pub q: &'a [f64],
    /// Velocity, nv long.
    pub v: &'a [f64],
}

impl<'a> MotionState<'a> {
    /// The configuration without the velocity.
    pub fn robot(&self) -> RobotState<'a> {
        RobotState { model: self.model, kinematics: self.kinematics, q: self.q }
    }
}
