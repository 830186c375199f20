//! Selection of the signals and cameras of a dataset.

use super::super::Signal;

/// Selection of the signals and cameras of a dataset, and its description.
#[derive(Debug, Clone, PartialEq)]
pub struct Dataset {
    /// Signals of the policy input `observation.state`, concatenated.
    pub state: Vec<Signal>,
    /// Signals of the policy output `action`, concatenated.
    pub action: Vec<Signal>,
    /// Cameras of the policy input. Each frame contains the latest image of each camera.
    pub cameras: Vec<Camera>,
    /// Frame rate, frames per second.
    pub fps: u32,
    /// Description of the task.
    pub task: String,
    /// Type of the robot.
    pub robot: Option<String>,
    /// Names of the entries of state and action. Entries without a name have the name of their signal.
    pub names: [Vec<String>; 2],
}

/// A camera whose images are part of a dataset.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Camera {
    /// Topic of the camera's images.
    pub topic: String,
    /// Name of the feature, after `observation.images.`.
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
