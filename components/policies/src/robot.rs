//! Loading of a component's robot.

use motorium::declare::{ConfigError, Declare, RobotReference, StepError};
use motorium_robots::{BasePose, EndEffectorError, FrameId, Loaded, RobotSource, degrees_doubt};

/// Returns the robot of a component that moves its joints or wheels (`parts`).
pub(crate) fn required<'a>(
    robot: Option<&'a RobotReference>,
    parts: &str,
) -> Result<&'a RobotReference, ConfigError> {
    robot.ok_or_else(|| {
        ConfigError::new(format!("the component needs the {parts} of a robot, but names no robot"))
            .advise("add `robot = \"NAME\"` to the component")
    })
}

/// Warns of angles \[rad\] of the setting `key` that were probably written in degrees.
pub(crate) fn warn_of_angles(key: &str, angles: &[f64], declare: &mut Declare) {
    if let Some(doubt) = degrees_doubt(angles) {
        declare.warn(doubt).key(key);
    }
}

/// Error of a step that reads a joint state of another robot.
#[cold]
pub(crate) fn unexpected_joints(expected: usize, found: usize) -> StepError {
    StepError::failed(format!("joint state: expected {expected} joints, found {found}"))
}

/// Error of a step that reads a joint state with fewer joints than it needs.
#[cold]
pub(crate) fn too_few_joints(expected: usize, found: usize) -> StepError {
    StepError::failed(format!("joint state: expected at least {expected} joints, found {found}"))
}

/// Loads the robot of a component.
pub(crate) fn load(robot: &RobotReference) -> Result<Loaded, ConfigError> {
    RobotSource {
        name: &robot.name,
        text: &robot.urdf,
        base: &robot.base,
        pose: robot.pose.map(|pose| BasePose { position: pose.position, rpy: pose.rpy }),
        profile: robot.profile.as_deref(),
        packages: &robot.package_path,
        settings: robot.settings.as_ref(),
    }
    .load()
    .map_err(|error| ConfigError::new(error.to_string()))
}

/// Loads a robot and returns it with the controlled frame.
pub(crate) fn load_moved(
    reference: &RobotReference,
    frame: Option<&str>,
) -> Result<(Loaded, FrameId), ConfigError> {
    let loaded = load(reference)?;
    let id = end_effector(&loaded, frame, "frame")?;
    Ok((loaded, id))
}

/// Loads a robot whose joint positions alone determine the pose of the controlled frame, and returns that
/// frame.
pub(crate) fn load_fixed(
    reference: &RobotReference,
    frame: Option<&str>,
) -> Result<(Loaded, FrameId), ConfigError> {
    let (loaded, id) = load_moved(reference, frame)?;
    if loaded.model.base().floating {
        let message = format!(
            "robot `{}` has a floating base: its joint positions alone do not determine the pose of its end effector",
            reference.name
        );
        return Err(ConfigError::new(message).advise("use a robot with a fixed base, or a policy of joints"));
    }
    Ok((loaded, id))
}

/// Returns the controlled frame: the one configured under `key`, or the frame of the robot's only end
/// effector.
pub(crate) fn end_effector(robot: &Loaded, frame: Option<&str>, key: &str) -> Result<FrameId, ConfigError> {
    robot.end_effector(frame).map_err(|error| {
        let message = error.to_string();
        match (&error, error.example()) {
            (EndEffectorError::UnknownFrame(_), _) => ConfigError::key(key, message),
            (_, Some(example)) => ConfigError::new(message)
                .advise(format!("name the link to move, such as `{key} = \"{example}\"`")),
            (_, None) => ConfigError::new(message),
        }
    })
}
