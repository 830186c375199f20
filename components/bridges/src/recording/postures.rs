//! Poses of the robots of a recording at selected times.

use motorium::declare::RobotReference;
use motorium::plan::Plan;
use motorium::state::{BaseState, JointState, StateBuffer, from_bytes};
use motorium_robots::Loaded;

use super::{ReadError, RecordedSample, Recording};
use crate::foxglove::{load_in_world, robot_of_topic, robots};

/// A robot of a recording.
#[derive(Debug, Clone)]
pub struct Postures {
    /// The robot, with a fixed base at its pose in the world.
    pub robot: Loaded,
    /// Its configurations in the order of time: s since the first sample, and `q` of its model.
    pub configurations: Vec<(f64, Vec<f64>)>,
}

/// Returns each robot of a recording at `count` evenly spaced times from the first sample to the last.
///
/// Robots without recorded joint states, or whose file no longer exists, are skipped, as are times before a
/// robot's first states.
///
/// # Errors
/// If a message is damaged.
pub fn postures(recording: &Recording, plan: &Plan, count: usize) -> Result<Vec<Postures>, ReadError> {
    let (begin_ns, end_ns) = recording.times().unwrap_or_default();
    let mut followed: Vec<Followed> =
        robots(plan).into_iter().filter_map(|robot| Followed::new(recording, plan, robot)).collect();
    let moment = |index: usize| {
        let share = index as f64 / count.saturating_sub(1).max(1) as f64;
        begin_ns + ((end_ns - begin_ns) as f64 * share) as u64
    };
    let mut moments = (0..count).map(moment).peekable();
    for sample in recording.in_order() {
        let sample = sample?;
        while let Some(time_ns) = moments.next_if(|time_ns| *time_ns < sample.time_ns) {
            followed.iter_mut().for_each(|robot| robot.record((time_ns - begin_ns) as f64 * 1e-9));
        }
        followed.iter_mut().for_each(|robot| robot.take(&sample));
    }
    for time_ns in moments {
        followed.iter_mut().for_each(|robot| robot.record((time_ns - begin_ns) as f64 * 1e-9));
    }
    let followed = followed.into_iter().map(|robot| robot.postures);
    Ok(followed.filter(|postures| !postures.configurations.is_empty()).collect())
}

/// State of a robot at the current reading position.
struct Followed {
    joints: usize,
    base: Option<usize>,
    q: Vec<f64>,
    /// `true` once the joints, and the base, have been read.
    seen: (bool, bool),
    postures: Postures,
}

impl Followed {
    fn new(recording: &Recording, plan: &Plan, robot: &RobotReference) -> Option<Self> {
        let robot_loaded = load_in_world(robot).ok()?;
        let topic = |type_name: &str| {
            let mut topics = plan.topics.iter().enumerate();
            topics.find_map(|(index, topic)| {
                let is_its = topic.layout.type_name == type_name
                    && robot_of_topic(plan, index).is_some_and(|owner| owner.name == robot.name);
                recording.topic(&topic.name).filter(|_| is_its)
            })
        };
        let base = topic(BaseState::NAME).filter(|_| robot_loaded.model.base().floating);
        Some(Self {
            joints: topic(JointState::NAME)?,
            base,
            q: robot_loaded.model.neutral(),
            seen: (false, base.is_none()),
            postures: Postures { robot: robot_loaded, configurations: Vec::new() },
        })
    }

    fn take(&mut self, sample: &RecordedSample) {
        if sample.topic == self.joints {
            let Some(state) = from_bytes::<JointState>(&sample.bytes) else { return };
            let joints = self.postures.robot.model.joint_count();
            let first = self.q.len() - joints;
            if let Some(position) = state.position().get(..joints) {
                self.q[first..].copy_from_slice(position);
                self.seen.0 = true;
            }
        } else if Some(sample.topic) == self.base
            && let Some(state) = from_bytes::<BaseState>(&sample.bytes)
        {
            self.q[..3].copy_from_slice(&state.position);
            self.q[3..7].copy_from_slice(&state.orientation);
            self.seen.1 = true;
        }
    }

    fn record(&mut self, time_s: f64) {
        if self.seen == (true, true) {
            self.postures.configurations.push((time_s, self.q.clone()));
        }
    }
}
