//! The robots of graphs, as the command loads them.

use motorium::declare::RobotReference;
use motorium::plan::{ComponentPlan, Plan, PortPlan};
use motorium_robots::{Loaded, RobotSource, RobotSourceError};

/// Loads a robot as the graph refers to it, with its profile, at the origin.
pub(crate) fn load(robot: &RobotReference) -> Result<Loaded, RobotSourceError> {
    let source = RobotSource {
        name: &robot.name,
        text: &robot.urdf,
        base: &robot.base,
        profile: robot.profile.as_deref(),
        packages: &robot.package_path,
        settings: robot.settings.as_ref(),
        pose: None,
    };
    source.load()
}

/// The names of the joints to which the arrays of a topic belong: those of the robot of its writer, else of a reader, then its
/// rotors. `None` where neither has one, or its file is no longer what it was.
pub(crate) fn joints_of_topic(plan: &Plan, index: usize) -> Option<Vec<String>> {
    let topic = plan.topics.get(index)?;
    let writer = std::iter::once((topic.writer, true));
    let mut ends = writer.chain(topic.readers.iter().map(|reader| (*reader, false)));
    let robot = ends.find_map(|(component, writes)| {
        let component = plan.components.get(component)?;
        robot_of(component, if writes { &component.outputs } else { &component.inputs }, index)
    })?;
    let loaded = load(robot).ok()?;
    let rotors = loaded.profile.iter().flat_map(|profile| profile.rotors.keys());
    Some(loaded.model.joint_names().iter().chain(rotors).cloned().collect())
}

/// The robot of a component; of one with several that of its port `ROBOT.PORT` which a topic is wired to.
fn robot_of<'p>(
    component: &'p ComponentPlan,
    ports: &[PortPlan],
    topic: usize,
) -> Option<&'p RobotReference> {
    if let Some(robot) = &component.robot {
        return Some(robot);
    }
    let port = ports.iter().find(|port| port.topic == Some(topic))?;
    let (robot, _) = port.port.split_once('.')?;
    component.robots.iter().find(|known| known.name == robot)
}
