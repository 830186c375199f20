//! The score of a run, computed from its recording: goals, paths, tracking and limits.
//!
//! The score does not rely on figures reported by components. It compares recorded targets with frame poses,
//! which are computed from recorded joint states with motorium's kinematics. The scored frame is the frame
//! controlled by the component that reads the targets.

mod goals;
mod joints;
mod smoothness;

use motorium::plan::Plan;
use motorium::state::{JointState, PoseTarget, StateBuffer as _};
use serde::Serialize;

pub use goals::{GoalScore, PoseScore, Tolerance};
pub use joints::{JointScore, JointsScore};
pub use smoothness::spectral_arc_length;

use super::{Analysis, ReadError, Recording, analyse};
use goals::Follower;
use joints::Limits;

/// The score of a run.
///
/// ```no_run
/// use motorium_bridges::recording::{Recording, Tolerance, score};
///
/// let recording = Recording::open("out/run.mcap".as_ref())?;
/// for pose in score(&recording, &recording.plan()?, Tolerance::default())?.poses {
///     println!("{}: {} reached, {} missed", pose.target, pose.goals_reached, pose.goals_missed);
/// }
/// # Ok::<(), motorium_bridges::recording::ReadError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Score {
    /// Name of the graph.
    pub graph: String,
    /// Time from the first sample to the last, s.
    pub duration_s: f64,
    /// Score of each component that reads pose targets.
    pub poses: Vec<PoseScore>,
    /// Score of each topic with the joint states of a robot.
    pub joints: Vec<JointsScore>,
}

impl Score {
    /// Returns the number of reached goals and the number of missed goals.
    pub fn goals(&self) -> (u64, u64) {
        let sum = |of: fn(&PoseScore) -> u64| self.poses.iter().map(of).sum();
        (sum(|pose| pose.goals_reached), sum(|pose| pose.goals_missed))
    }
}

/// Computes the score of a recording.
///
/// # Errors
/// Returns an error if a message is damaged.
pub fn score(recording: &Recording, plan: &Plan, tolerance: Tolerance) -> Result<Score, ReadError> {
    analyse(recording, plan)?.score(recording, plan, tolerance)
}

impl Analysis {
    /// Computes the score of a recording from its analysis.
    ///
    /// # Errors
    /// Returns an error if a message is damaged.
    pub fn score(
        &self,
        recording: &Recording,
        plan: &Plan,
        tolerance: Tolerance,
    ) -> Result<Score, ReadError> {
        let of_type = |name: &'static str| {
            plan.topics.iter().enumerate().filter(move |(_, topic)| topic.layout.type_name == name)
        };
        let readers = of_type(PoseTarget::NAME)
            .flat_map(|(index, topic)| topic.readers.iter().map(move |reader| (index, *reader)));
        let mut followers: Vec<Follower> = readers
            .filter_map(|(topic, reader)| Follower::new(recording, plan, topic, reader, tolerance))
            .collect();
        let mut limits: Vec<Limits> =
            of_type(JointState::NAME).filter_map(|(index, _)| Limits::new(recording, plan, index)).collect();
        let mut samples = recording.in_order().peekable();
        // Values with equal times, such as all values of a lockstep tick, are processed together: first the
        // states, then the targets derived from them.
        let mut together = Vec::new();
        while let Some(sample) = samples.next() {
            let sample = sample?;
            let time_ns = sample.time_ns;
            together.push(sample);
            if samples.peek().is_some_and(|next| next.as_ref().is_ok_and(|next| next.time_ns == time_ns)) {
                continue;
            }
            let is_target = |topic: usize| followers.iter().any(|follower| follower.reads_target(topic));
            together.sort_by_key(|sample| is_target(sample.topic));
            for sample in together.drain(..) {
                followers.iter_mut().for_each(|follower| follower.take(&sample));
                limits.iter_mut().for_each(|limits| limits.take(&sample));
            }
        }
        Ok(Score {
            graph: plan.name.clone(),
            duration_s: self.duration_s,
            poses: followers.into_iter().filter_map(Follower::result).collect(),
            joints: limits.into_iter().filter_map(|limits| limits.result(&self.tracking)).collect(),
        })
    }
}
