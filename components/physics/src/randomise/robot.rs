//! Robots of a simulation whose properties are sampled.

use motorium_robots::Model;

/// A robot of a simulation whose properties are sampled.
#[derive(Clone, Debug)]
pub struct RandomisedRobot {
    /// Name of the robot if there are several. The names of its links then start with `NAME/` in the
    /// simulation.
    pub name: Option<String>,
    /// Index of the articulation that contains the robot.
    pub articulation: usize,
    /// Model of this robot alone.
    pub model: Model,
}
