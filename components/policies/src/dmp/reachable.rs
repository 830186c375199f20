//! Goals beyond the reach of the robot.

use motorium::declare::{ConfigError, Declare};
use motorium_robots::{FrameId, Kinematics, Loaded};
use nalgebra::Isometry3;

use super::waypoints::{GoalPlace, Waypoints};
use crate::reach::Reach;

/// Rejects goals beyond the reach of the end effector, and warns of goals that are out of reach only if the
/// robot starts in its home pose. `start` is the configured start pose.
pub(super) fn check(
    waypoints: &Waypoints,
    robot: &Loaded,
    frame: FrameId,
    start: Option<&Isometry3<f64>>,
    declare: &mut Declare,
) -> Result<(), ConfigError> {
    let Some(reach) = Reach::of_frame(&robot.model, frame) else { return Ok(()) };
    let mut place = start.map(|start| start.translation.vector);
    let mut is_certain = start.is_some();
    if place.is_none()
        && let Some(home) = robot.profile.as_ref().and_then(|profile| profile.home(&robot.model).ok())
    {
        let mut kinematics = Kinematics::new(&robot.model);
        kinematics.update(&robot.model, home.as_slice());
        place = Some(kinematics.pose(&robot.model, frame).translation.vector);
    }
    for (goal, key) in waypoints.places() {
        place = match goal {
            GoalPlace::At(position) => {
                is_certain = true;
                Some(position)
            }
            GoalPlace::Beside(offset) => place.map(|place| place + offset),
        };
        let Some(distance) = place.and_then(|place| reach.beyond(&place)) else { continue };
        let link = &robot.model.frames()[frame.index()].name;
        let from = format!("{distance:.3} m from the first joint that moves `{link}`");
        let most = format!("its links reach {:.3} m in one line", reach.length());
        let advice = "bring the goal nearer; positions are in metres, in the world frame";
        if is_certain {
            let message = format!("goal {key} is {from}, and {most}");
            return Err(ConfigError::key(format!("goals[{key}]"), message).advise(advice));
        }
        declare
            .warn(format!("goal {key} is {from} if the robot starts in its home pose, and {most}"))
            .key(format!("goals[{key}]"))
            .advise(advice);
        // one warning is enough: the following goals have no known start
        return Ok(());
    }
    Ok(())
}
