//! The URDF text of a robot.

use motorium_robots::Loaded;

/// Returns the URDF text of a loaded robot.
pub(super) fn text(robot: &Loaded) -> anyhow::Result<String> {
    robot.text()?.ok_or_else(|| anyhow::anyhow!("the robot has no source file"))
}
