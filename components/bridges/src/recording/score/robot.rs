//! The robots of a recording.

use motorium::declare::RobotReference;
use motorium_robots::{BasePose, Loaded, RobotSource};

/// Loads a robot at its pose in the world.
pub(super) fn load(robot: &RobotReference) -> Option<Loaded> {
    let source = RobotSource {
        name: &robot.name,
        text: &robot.urdf,
        base: &robot.base,
        profile: robot.profile.as_deref(),
        packages: &robot.package_path,
        settings: robot.settings.as_ref(),
        pose: robot.pose.map(|pose| BasePose { position: pose.position, rpy: pose.rpy }),
    };
    source.load().ok()
}
