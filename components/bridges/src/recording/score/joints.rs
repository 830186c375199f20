//! Joint scores of a recording: tracking errors and distances from the limits.

use motorium::plan::Plan;
use motorium::state::{JointState, from_bytes};
use motorium_robots::Loaded;
use serde::Serialize;

use super::super::{RecordedSample, Recording, Tracking};
use crate::foxglove::{load_in_world, robot_of_topic};

/// Scores of the joints in one topic of joint states.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct JointsScore {
    /// Topic of the joint states.
    pub state: String,
    /// Topic of the commands that the joints follow; `None` if the state was not published by an actuator.
    pub command: Option<String>,
    /// Scores of the joints, in the order of the robot model.
    pub joints: Vec<JointScore>,
}

/// Score of one joint. Positions are in rad for revolute joints and in m for prismatic joints.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct JointScore {
    /// Name of the joint.
    pub name: String,
    /// Root mean square distance from the commanded position; `null` without position commands.
    pub tracking_rms: Option<f64>,
    /// Maximum distance from the commanded position; `null` without position commands.
    pub tracking_max: Option<f64>,
    /// Minimum measured position.
    pub position_min: f64,
    /// Maximum measured position.
    pub position_max: f64,
    /// Minimum distance from a position limit, negative beyond the limit; `null` without a limit.
    pub position_margin: Option<f64>,
    /// Maximum speed, rad/s or m/s.
    pub velocity_max: f64,
    /// Maximum speed as a fraction of the velocity limit; `null` without a limit.
    pub velocity_share: Option<f64>,
    /// Maximum effort, N m or N.
    pub effort_max: f64,
    /// Maximum effort as a fraction of the effort limit; `null` without a limit.
    pub effort_share: Option<f64>,
    /// Number of samples beyond a position or velocity limit.
    pub beyond_limits: u64,
}

/// Largest rounding error of a position at its limit, rad or m.
const ROUNDING: f64 = 1e-9;

/// Extremes of one topic.
pub(super) struct Limits {
    /// Index in the recording.
    topic: usize,
    name: String,
    loaded: Loaded,
    joints: Vec<JointScore>,
    samples: u64,
}

impl Limits {
    /// Returns `None` if the topic was not recorded, or if its robot cannot be loaded.
    pub(super) fn new(recording: &Recording, plan: &Plan, index: usize) -> Option<Self> {
        let name = plan.topics[index].name.clone();
        let topic = recording.topic(&name)?;
        let loaded = load_in_world(robot_of_topic(plan, index)?).ok()?;
        let of = |name: &String| JointScore {
            name: name.clone(),
            position_min: f64::INFINITY,
            position_max: f64::NEG_INFINITY,
            ..JointScore::default()
        };
        let joints = loaded.model.joint_names().iter().map(of).collect();
        Some(Self { topic, name, loaded, joints, samples: 0 })
    }

    pub(super) fn take(&mut self, sample: &RecordedSample) {
        if sample.topic != self.topic {
            return;
        }
        let Some(state) = from_bytes::<JointState>(&sample.bytes) else { return };
        self.samples += 1;
        let model = &self.loaded.model;
        for (index, joint) in self.joints.iter_mut().enumerate().take(state.count()) {
            let (q, v, tau) = (state.position()[index], state.velocity()[index], state.effort()[index]);
            joint.position_min = joint.position_min.min(q);
            joint.position_max = joint.position_max.max(q);
            joint.velocity_max = joint.velocity_max.max(v.abs());
            joint.effort_max = joint.effort_max.max(tau.abs());
            let margin = (q - model.lower()[index]).min(model.upper()[index] - q);
            if margin.is_finite() {
                joint.position_margin = Some(joint.position_margin.unwrap_or(f64::INFINITY).min(margin));
            }
            let beyond = margin < -ROUNDING || v.abs() > model.velocity_limit()[index];
            joint.beyond_limits += u64::from(beyond);
        }
    }

    /// Returns `None` without samples.
    pub(super) fn result(mut self, tracking: &[Tracking]) -> Option<JointsScore> {
        if self.samples == 0 {
            return None;
        }
        let tracking = tracking.iter().find(|tracking| tracking.state == self.name);
        let model = &self.loaded.model;
        let share = |value: f64, limit: f64| (limit.is_finite() && limit > 0.0).then(|| value / limit);
        for (index, joint) in self.joints.iter_mut().enumerate() {
            joint.velocity_share = share(joint.velocity_max, model.velocity_limit()[index]);
            joint.effort_share = share(joint.effort_max, model.effort_limit()[index]);
            // No comparison without commanded positions.
            let errors =
                tracking.and_then(|tracking| tracking.joints.get(index)).filter(|joint| joint.most > 0.0);
            (joint.tracking_rms, joint.tracking_max) =
                (errors.map(|joint| joint.rms), errors.map(|joint| joint.most));
        }
        self.joints.retain(|joint| joint.position_min <= joint.position_max);
        let command = tracking.map(|tracking| tracking.command.clone());
        Some(JointsScore { state: self.name, command, joints: self.joints })
    }
}
