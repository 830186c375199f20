//! Goals of fingers, which move independently of the tasks.

use motorium::prelude::*;
use motorium::state::MotionGoal;

use super::setup::{ControllerSetup, FINGERS_INPUT};
use crate::SetpointIntegrator;

/// Goals of the fingers of the robot's end effectors. A goal of the input `fingers` moves its fingers at
/// constant speed to their positions, where they stay. Before its first goal a finger is moved by the tasks.
///
/// A goal with a pose, a joint other than a finger's, a position outside of the joint's range, or a negative
/// duration is refused.
pub(super) struct FingerGoals {
    /// `None` for a robot without fingers.
    input: Option<Input<MotionGoal>>,
    fingers: Vec<Finger>,
    /// Velocities of the fingers with a goal.
    velocities: Vec<JointVelocity>,
    /// The latest goal; repeating it has no effect.
    newest: Option<MotionGoal>,
    received: u64,
    refused: u64,
}

struct Finger {
    joint: usize,
    lower: f64,
    upper: f64,
    /// Velocity limit of the model, m/s or rad/s.
    fastest: f64,
    goal: Option<FingerGoal>,
}

#[derive(Clone, Copy)]
struct FingerGoal {
    position: f64,
    speed: f64,
}

/// A prescribed joint velocity, independent of the tasks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct JointVelocity {
    pub(super) joint: usize,
    /// rad/s or m/s.
    pub(super) velocity: f64,
}

impl FingerGoals {
    pub(super) fn declare(parts: &ControllerSetup, declare: &mut Declare) {
        if !fingers(parts).is_empty() {
            declare.optional_input::<MotionGoal>(
                FINGERS_INPUT,
                "positions of the fingers' joints; before the first goal, the tasks move these joints",
            );
        }
    }

    pub(super) fn configure(parts: &ControllerSetup, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let fingers = fingers(parts);
        Ok(Self {
            input: if fingers.is_empty() { None } else { Some(setup.input(FINGERS_INPUT)?) },
            velocities: Vec::with_capacity(fingers.len()),
            fingers,
            newest: None,
            received: 0,
            refused: 0,
        })
    }

    /// Reads the latest goal and returns the velocities of the fingers with a goal for a step of `dt`
    /// seconds, limited to `fraction` of their limits.
    pub(super) fn step(
        &mut self,
        setpoint: &SetpointIntegrator,
        velocity_fraction: f64,
        dt: f64,
    ) -> &[JointVelocity] {
        self.receive(setpoint.position());
        self.velocities.clear();
        for Finger { joint, fastest, goal, .. } in &self.fingers {
            let Some(FingerGoal { position, speed }) = goal else { continue };
            let most = speed.min(velocity_fraction * fastest);
            let velocity = ((position - setpoint.position()[*joint]) / dt).clamp(-most, most);
            self.velocities.push(JointVelocity { joint: *joint, velocity });
        }
        &self.velocities
    }

    /// Joints with a goal.
    pub(super) fn moved(&self) -> impl Iterator<Item = usize> {
        self.fingers.iter().filter(|finger| finger.goal.is_some()).map(|finger| finger.joint)
    }

    fn receive(&mut self, setpoint: &[f64]) {
        let Some(goal) = self.input.as_mut().and_then(Input::next_unread) else { return };
        if self.newest.as_ref() == Some(&*goal) {
            return;
        }
        self.newest = Some(*goal);
        if !accepts(&self.fingers, &goal) {
            self.refused += 1;
            return;
        }
        self.received += 1;
        for finger in &mut self.fingers {
            let Some(position) = goal.joint_at(finger.joint) else { continue };
            let distance = (position - setpoint[finger.joint]).abs();
            let speed = if goal.duration > 0.0 { distance / goal.duration } else { f64::INFINITY };
            finger.goal = Some(FingerGoal { position, speed });
        }
    }

    /// Removes all goals at the start of an episode.
    pub(super) fn reset(&mut self) {
        self.fingers.iter_mut().for_each(|finger| finger.goal = None);
        (self.newest, self.received, self.refused) = (None, 0, 0);
    }

    /// Adds the goals to the result of a run.
    pub(super) fn add_to(&self, result: &mut serde_json::Value) {
        if self.input.as_ref().is_some_and(Input::is_wired) {
            result["finger_goals"] = self.received.into();
            result["finger_goals_refused"] = self.refused.into();
        }
    }
}

fn accepts(fingers: &[Finger], goal: &MotionGoal) -> bool {
    let is_in_range = |joint: usize, position: f64| {
        let mut fingers = fingers.iter().filter(|finger| finger.joint == joint);
        fingers.any(|finger| (finger.lower..=finger.upper).contains(&position))
    };
    goal.has_position == 0
        && !goal.has_orientation()
        && goal.duration >= 0.0
        && (0..goal.count())
            .all(|joint| goal.joint_at(joint).is_none_or(|position| is_in_range(joint, position)))
}

/// Returns the fingers of all end effectors, without duplicates.
fn fingers(parts: &ControllerSetup) -> Vec<Finger> {
    let model = &parts.model;
    let ends = parts.profile.iter().flat_map(|profile| profile.end_effectors.values());
    let mut joints: Vec<usize> =
        ends.flat_map(|end| &end.fingers).filter_map(|name| model.joint_index(name)).collect();
    joints.sort_unstable();
    joints.dedup();
    let finger = |joint: usize| Finger {
        joint,
        lower: model.lower()[joint],
        upper: model.upper()[joint],
        fastest: model.velocity_limit()[joint],
        goal: None,
    };
    joints.into_iter().map(finger).collect()
}
