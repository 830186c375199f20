//! Goals that the robot cannot reach.

use motorium::declare::{ConfigError, Declare};
use motorium_robots::{FrameId, IkFailure, IkOptions, InverseKinematics, Kinematics, Loaded};
use nalgebra::{DVector, Isometry3, Translation3};

use super::waypoints::{GoalPlace, Waypoints};
use crate::reach::{Reach, moving_joints};

/// Options of the search for joint positions. Smaller errors do not justify a warning.
const SEARCH: IkOptions = IkOptions {
    position_tolerance: 1e-3,
    rotation_tolerance: 1e-2,
    iterations: 100,
    seeds: 16,
    posture: 0.1,
};

/// Rejects goals beyond the reach of the end effector. Warns of goals that are out of reach only if the robot
/// starts in its home pose, and of the first goal without joint positions within their limits. `start` is the
/// configured start pose. A floating base can reach any goal.
pub(super) fn check(
    waypoints: &Waypoints,
    robot: &Loaded,
    frame: FrameId,
    start: Option<&Isometry3<f64>>,
    declare: &mut Declare,
) -> Result<(), ConfigError> {
    let Some(reach) = Reach::of_frame(&robot.model, frame).filter(|_| !robot.model.base().floating) else {
        return Ok(());
    };
    let home = robot.profile.as_ref().and_then(|profile| profile.home(&robot.model).ok());
    let mut pose = start.copied();
    if pose.is_none()
        && let Some(home) = &home
    {
        let mut kinematics = Kinematics::new(&robot.model);
        kinematics.update(&robot.model, home.as_slice());
        pose = Some(kinematics.pose(&robot.model, frame));
    }
    let mut is_place_certain = start.is_some();
    let mut is_turn_certain = start.is_some();
    let mut search = Search::new(robot, frame, home);
    for (place, turn, key) in waypoints.poses() {
        let rotation = turn.or(pose.map(|pose| pose.rotation));
        is_turn_certain |= turn.is_some();
        let position = match place {
            GoalPlace::At(position) => {
                is_place_certain = true;
                Some(position)
            }
            GoalPlace::Beside(offset) => pose.map(|pose| pose.translation.vector + offset),
        };
        let Some(position) = position else { continue };
        pose = Some(Isometry3::from_parts(Translation3::from(position), rotation.unwrap_or_default()));
        if let Some(distance) = reach.beyond(&position) {
            let link = &robot.model.frames()[frame.index()].name;
            let from = format!("{distance:.3} m from the first joint that moves `{link}`");
            let most = format!("its links reach {:.3} m in one line", reach.length());
            let advice = "bring the goal nearer; positions are in metres, in the world frame";
            if is_place_certain {
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
        let Some(missed) = pose.and_then(|pose| search.miss(&pose, rotation.is_some())) else { continue };
        let certainly = is_place_certain && (is_turn_certain || !search.turns);
        let condition = if certainly { "" } else { " if the robot starts in its home pose" };
        declare
            .warn(format!(
                "no joint positions within their limits are found for goal {key}{condition}: {missed}"
            ))
            .key(format!("goals[{key}]"))
            .advise("bring the goal nearer or turn it; the robot stops where it cannot follow");
        return Ok(());
    }
    Ok(())
}

/// A search for the joint positions of one goal after another.
struct Search<'a> {
    robot: &'a Loaded,
    frame: FrameId,
    kinematics: InverseKinematics,
    /// Joint positions at the previous goal.
    q: DVector<f64>,
    /// `true` if enough joints move the frame for any orientation.
    turns: bool,
}

impl<'a> Search<'a> {
    fn new(robot: &'a Loaded, frame: FrameId, home: Option<DVector<f64>>) -> Self {
        let model = &robot.model;
        let joints = moving_joints(model, frame).into_iter().filter(|moves| *moves).count();
        Self {
            robot,
            frame,
            kinematics: InverseKinematics::new(model),
            q: home.unwrap_or_else(|| DVector::zeros(model.nq())),
            turns: joints >= 6,
        }
    }

    /// Returns a description of the remaining distance to a pose if no joint positions reach it. `turned` is
    /// `true` if the orientation of the pose is known.
    fn miss(&mut self, pose: &Isometry3<f64>, turned: bool) -> Option<String> {
        let model = &self.robot.model;
        let has_rotation = self.turns && turned;
        let rotation_tolerance = if has_rotation { SEARCH.rotation_tolerance } else { f64::INFINITY };
        let options = IkOptions { rotation_tolerance, ..SEARCH };
        let mut solve = |options: &IkOptions| {
            let mut q = self.q.clone();
            self.kinematics.solve(model, self.frame, pose, options, q.as_mut_slice()).map(|_| q)
        };
        match solve(&options) {
            Ok(q) => {
                self.q = q;
                None
            }
            Err(IkFailure { position_error, .. }) if !has_rotation => {
                Some(format!("the nearest positions found are {position_error:.3} m away"))
            }
            Err(IkFailure { position_error, rotation_error, .. }) => {
                let free = IkOptions { rotation_tolerance: f64::INFINITY, ..options };
                let remark =
                    if solve(&free).is_ok() { "; the position of the goal alone can be reached" } else { "" };
                Some(format!(
                    "the nearest positions found are {position_error:.3} m and {rotation_error:.3} rad away{remark}"
                ))
            }
        }
    }
}
