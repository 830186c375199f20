//! Robot states at which tasks and limits of one tick are evaluated.

use motorium_robots::{Kinematics, Model};

/// A robot model with a configuration and the kinematics at that configuration.
#[derive(Clone, Copy, Debug)]
pub struct RobotState<'a> {
    /// Model of the robot.
    pub model: &'a Model,
    /// Kinematics updated at `q`, from which poses and Jacobians are read.
    pub kinematics: &'a Kinematics,
    /// Configuration of length nq: the pose of a floating base, then the joint positions \[rad or m\].
    pub q: &'a [f64],
}

/// A robot model with a configuration, a velocity and the kinematics at both.
#[derive(Clone, Copy, Debug)]
pub struct MotionState<'a> {
    /// Model of the robot.
    pub model: &'a Model,
    /// Kinematics updated at `q` and `v`, from which poses, velocities, Jacobians and drifts are read.
    pub kinematics: &'a Kinematics,
    /// Configuration of length nq: the pose of a floating base, then the joint positions \[rad or m\].
    pub q: &'a [f64],
    /// Velocity of length nv: the twist of a floating base, then the joint velocities \[rad/s or m/s\].
    pub v: &'a [f64],
}

impl<'a> MotionState<'a> {
    /// Returns the configuration without the velocity.
    pub fn robot(&self) -> RobotState<'a> {
        RobotState { model: self.model, kinematics: self.kinematics, q: self.q }
    }
}
