//! The robots of graphs, as the command loads them.

use motorium::declare::RobotReference;
use motorium_robots::{Loaded, RobotSource, RobotSourceError};

/// Loads a robot as the graph refers to it, with its profile, at the origin.
pub(crate) fn load(robot: &RobotReference) -> Result<Loaded, RobotSourceError> {
    let source = RobotSource {
        name: &robot.name,
        text: &robot.urdf,
        base: &robot.base,
        profile: robot.profile.as_deref(),
        packages: &robot.package_path,
        pose: None,
    };
    source.load()
}
