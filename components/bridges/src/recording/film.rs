//! Robots and world of a recording at selected times.

use motorium::declare::RobotReference;
use motorium::plan::Plan;
use motorium::state::{BaseState, JointState, ObjectPoses, StateBuffer, from_bytes};
use motorium_pictures::robot::{Film, Postures};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use super::{ReadError, RecordedSample, Recording};
use crate::foxglove::{load_visible, robot_of_topic, robots, world_of};

/// Returns the robots and the world of a recording at ascending times, ns since the first sample. Before the
/// first recorded state of a robot, the robot has the configuration of that state.
///
/// # Errors
/// Returns an error if a message is damaged.
pub fn film(recording: &Recording, plan: &Plan, times_ns: &[u64]) -> Result<Film, ReadError> {
    let (begin_ns, _) = recording.times().unwrap_or_default();
    let mut followed: Vec<Followed> =
        robots(plan).into_iter().filter_map(|robot| Followed::new(recording, plan, robot)).collect();
    let world = world_of(plan);
    let mut poses: Vec<_> =
        world.iter().flat_map(|world| &world.objects).map(|object| object.pose()).collect();
    let moved = plan.topics.iter().find(|topic| topic.layout.type_name == ObjectPoses::NAME);
    let moved = moved.and_then(|topic| recording.topic(&topic.name));
    let mut objects = Vec::with_capacity(times_ns.len());
    let mut moments = times_ns.iter().copied().peekable();
    for sample in recording.in_order() {
        let sample = sample?;
        while moments.next_if(|moment| begin_ns + moment < sample.time_ns).is_some() {
            followed.iter_mut().for_each(Followed::record);
            objects.push(poses.clone());
        }
        if moments.peek().is_none() && followed.iter().all(Followed::is_seen) {
            break;
        }
        followed.iter_mut().for_each(|robot| robot.take(&sample));
        if Some(sample.topic) == moved
            && let Some(state) = from_bytes::<ObjectPoses>(&sample.bytes)
        {
            take_objects(&state, &mut poses);
        }
    }
    for _ in moments {
        followed.iter_mut().for_each(Followed::record);
        objects.push(poses.clone());
    }
    let followed = followed.into_iter().filter(Followed::is_seen).map(|robot| robot.postures);
    Ok(Film {
        times_s: times_ns.iter().map(|time_ns| *time_ns as f64 * 1e-9).collect(),
        robots: followed.collect(),
        world,
        objects,
    })
}

fn take_objects(state: &ObjectPoses, poses: &mut [Isometry3<f64>]) {
    for index in 0..state.count() {
        let Some(pose) = poses.get_mut(state.object()[index] as usize) else { continue };
        let position = [state.position_x()[index], state.position_y()[index], state.position_z()[index]];
        let [x, y, z, w] = [
            state.orientation_x()[index],
            state.orientation_y()[index],
            state.orientation_z()[index],
            state.orientation_w()[index],
        ];
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        *pose = Isometry3::from_parts(Translation3::from(position), rotation);
    }
}

/// A robot at the current time of the reader.
struct Followed {
    joints: usize,
    base: Option<usize>,
    q: Vec<f64>,
    /// `true` for the joints, and for the base, once they have been read.
    seen: (bool, bool),
    /// Number of times before the first state.
    before: usize,
    postures: Postures,
}

impl Followed {
    fn new(recording: &Recording, plan: &Plan, robot: &RobotReference) -> Option<Self> {
        let robot_loaded = load_visible(robot).ok()?;
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
            before: 0,
            postures: Postures { robot: robot_loaded, configurations: Vec::new() },
        })
    }

    fn is_seen(&self) -> bool {
        self.seen == (true, true)
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
        if self.is_seen() {
            let early = std::iter::repeat_n(self.q.clone(), core::mem::take(&mut self.before));
            self.postures.configurations.extend(early);
        }
    }

    fn record(&mut self) {
        match self.is_seen() {
            true => self.postures.configurations.push(self.q.clone()),
            false => self.before += 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use motorium::state::Stamp;

    use super::*;

    #[test]
    fn posture_before_the_first_state_is_the_first_one() {
        let robot = motorium_robots::load("panda", Path::new("")).unwrap();
        let q = robot.model.neutral();
        let postures = Postures { robot, configurations: Vec::new() };
        let mut followed = Followed { joints: 3, base: None, q, seen: (false, true), before: 0, postures };
        let layout = JointState::layout();
        let sample = |topic: usize, text: &str| RecordedSample {
            topic,
            time_ns: 0,
            stamp: Stamp::default(),
            bytes: motorium::state::encode(&layout, text).unwrap(),
        };
        followed.record();
        followed.take(&sample(2, "position=[9, 9, 9, 9, 9, 9, 9, 9]"));
        followed.record();
        assert!(!followed.is_seen());
        followed.take(&sample(3, "position=[1, 2, 3, 4, 5, 6, 7, 0.01]"));
        followed.record();
        followed.take(&sample(3, "position=[0, 0, 0, 0, 0, 0, 0, 0]"));
        followed.record();
        let first = vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 0.01];
        assert_eq!(followed.postures.configurations, [first.clone(), first.clone(), first, vec![0.0; 8]]);
    }
}
