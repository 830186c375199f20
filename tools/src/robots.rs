//! The robots of graphs, as the command loads them.

use motorium::declare::RobotReference;
use motorium_robots::{BasePose, Loaded, RobotSource, RobotSourceError};

/// Loads a robot as the graph refers to it, with its profile, at the origin.
pub(crate) fn load(robot: &RobotReference) -> Result<Loaded, RobotSourceError> {
    source(robot).load()
}

/// Loads a robot at its pose in the world of the graph.
pub(crate) fn load_in_world(robot: &RobotReference) -> Result<Loaded, RobotSourceError> {
    let pose = robot.pose.map(|pose| BasePose { position: pose.position, rpy: pose.rpy });
    RobotSource { pose, ..source(robot) }.load()
}

fn source(robot: &RobotReference) -> RobotSource<'_> {
    RobotSource {
        name: &robot.name,
        text: &robot.urdf,
        base: &robot.base,
        profile: robot.profile.as_deref(),
        packages: &robot.package_path,
        settings: robot.settings.as_ref(),
        pose: None,
    }
}

/// Returns the joint positions of a named pose of the robot's profile or SRDF.
pub(crate) fn pose(robot: &Loaded, name: &str) -> anyhow::Result<Vec<f64>> {
    let profile = robot.profile.as_ref();
    if let Some(profile) = profile.filter(|profile| profile.poses.contains_key(name)) {
        return Ok(profile.pose(&robot.model, name)?.as_slice().to_vec());
    }
    if let Some(posture) = robot.postures.iter().find(|posture| posture.name == name) {
        return Ok(posture.joints.as_slice().to_vec());
    }
    let of_profile = profile.into_iter().flat_map(|profile| profile.poses.keys().cloned());
    let all: Vec<String> =
        of_profile.chain(robot.postures.iter().map(|posture| posture.name.clone())).collect();
    match all.is_empty() {
        true => anyhow::bail!(
            "the robot has no poses: write a profile next to its file (`motorium robot profile`)"
        ),
        false => anyhow::bail!("the robot has no pose `{name}`; it has {}", all.join(", ")),
    }
}
