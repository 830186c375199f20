//! Robot states at which tasks and limits of one tick are evaluated.

use motorium_robots::{Kinematics, Model};

/// A model, its configuration, and its kinematics at that configuration.
#[derive(Clone, Copy, Debug)]
pub struct RobotState<'a> {
    /// The robot.
    pub model: &'a Model,
    /// Kinematics updated at `q`, the source of poses and Jacobians.
    pub kinematics: &'a Kinematics,
    /// Configuration of length nq: the pose of a floating base, then the joint positions \[rad or m\].
    pub q: &'a [f64],
}

/// A model, its configuration and velocity, and its kinematics at both.
#[derive(Clone, Copy, Debug)]
pub struct MotionState<'a> {
    /// The robot.
    pub model: &'a Model,
    /// Kinematics updated at `q` and `v`, the source of poses, velocities, Jacobians and drifts.
    pub kinematics: &'a Kinematics,
    /// Configuration of length nq: a floating base, then the joints.
    pub q: &'a [f64],
    /// Velocity of length nv.
    pub v: &'a [f64],
}

impl<'a> MotionState<'a> {
    /// Returns the configuration without the velocity.
    pub fn robot(&self) -> RobotState<'a> {
        RobotState { model: self.model, kinematics: self.kinematics, q: self.q }
    }
}
