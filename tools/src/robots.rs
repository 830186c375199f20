//! The robots of graphs, as the command loads them.

use motorium::declare::RobotReference;
use motorium::plan::{ComponentPlan, Plan};
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

/// The names of the joints to which the arrays of a topic belong: those of the robot of its writer, then its rotors. `None`
/// where it has none, or its file is no longer what it was.
pub(crate) fn joints_of_topic(plan: &Plan, topic: usize) -> Option<Vec<String>> {
    let writer = plan.components.get(plan.topics.get(topic)?.writer)?;
    let loaded = load(robot_of(writer, topic)?).ok()?;
    let rotors = loaded.profile.iter().flat_map(|profile| profile.rotors.keys());
    Some(loaded.model.joint_names().iter().chain(rotors).cloned().collect())
}

/// The robot of a component; of one with several that of the port `ROBOT.PORT` which writes the topic.
fn robot_of(writer: &ComponentPlan, topic: usize) -> Option<&RobotReference> {
    if let Some(robot) = &writer.robot {
        return Some(robot);
    }
    let port = writer.outputs.iter().find(|port| port.topic == Some(topic))?;
    let (robot, _) = port.port.split_once('.')?;
    writer.robots.iter().find(|known| known.name == robot)
}
