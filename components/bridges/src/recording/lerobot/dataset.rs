//! The contents of a dataset.

use super::super::Signal;

/// The contents of a dataset.
#[derive(Debug, Clone, PartialEq)]
pub struct Dataset {
    /// Policy inputs: `observation.state`, concatenated signals.
    pub state: Vec<Signal>,
    /// Policy outputs: `action`.
    pub action: Vec<Signal>,
    /// Policy images: the latest image of each camera at each frame.
    pub cameras: Vec<Camera>,
    /// Frames per second.
    pub fps: u32,
    /// Description of the task.
    pub task: String,
    /// Type of the robot.
    pub robot: Option<String>,
    /// Names of the entries of state and action; signal names where entry names are missing.
    pub names: [Vec<String>; 2],
}

/// A camera whose images are part of a dataset.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Camera {
    /// Topic of its images.
    pub topic: String,
    /// Name of its feature after `observation.images.`.
    pub name: String,
}

impl Camera {
    /// Creates the camera of a topic, with its default name.
    ///
    /// ```
    /// use motorium_bridges::recording::Camera;
    ///
    /// assert_eq!(Camera::of_topic("wrist/image").name, "wrist");
    /// assert_eq!(Camera::of_topic("left/camera/colour").name, "left_camera_colour");
    /// ```
    pub fn of_topic(topic: &str) -> Self {
        // LeRobot rejects names with `/`, and gives `.` a special meaning.
        let name = topic.strip_suffix("/image").unwrap_or(topic).replace(['/', '.'], "_");
        Self { topic: topic.to_string(), name }
    }
}
