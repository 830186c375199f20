//! Pose goals of a recording, and the path of a frame between them.

use motorium::plan::{ComponentPlan, Plan};
use motorium::state::{BaseState, JointState, PoseTarget, StateBuffer, from_bytes};
use motorium_robots::{FrameId, Kinematics, Loaded};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::Serialize;

use super::super::{RecordedSample, Recording};
use super::spectral_arc_length;
use crate::foxglove::load_in_world;

/// Tolerances within which a goal counts as reached. They override the tolerances in the configuration of the
/// component that reads the targets.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Tolerance {
    /// Position tolerance, m.
    pub position: Option<f64>,
    /// Orientation tolerance, rad.
    pub orientation: Option<f64>,
}

/// Default position tolerance within which a goal counts as reached, m.
const POSITION: f64 = 5e-3;
/// Default orientation tolerance within which a goal counts as reached, rad.
const ORIENTATION: f64 = 0.02;
/// Time for which the target must rest at the last goal of a run or episode for the goal to count, s.
const SETTLE_S: f64 = 0.2;

/// Score of a frame that follows the pose targets of one topic.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PoseScore {
    /// Topic of the pose targets.
    pub target: String,
    /// Name of the component that reads the targets.
    pub reader: String,
    /// Topic of the joint states or of the base state that the component reads.
    pub state: String,
    /// Name of the frame.
    pub frame: String,
    /// Number of reached goals: the target rested, and the frame was within the tolerances when the target
    /// moved on.
    pub goals_reached: u64,
    /// Number of missed goals: the frame was outside the tolerances when the target moved on.
    pub goals_missed: u64,
    /// Maximum position error of the goals, m; `None` without goals. The error is measured when the target
    /// moves on.
    pub position_error_m: Option<f64>,
    /// Maximum orientation error of the goals, rad; `None` without goals. The error is measured when the
    /// target moves on.
    pub orientation_error_rad: Option<f64>,
    /// Root mean square distance of the frame from the target over the whole recording, m.
    pub path_position_rms_m: f64,
    /// Maximum distance of the frame from the target over the whole recording, m.
    pub path_position_max_m: f64,
    /// Root mean square angle between frame and target over the whole recording, rad.
    pub path_orientation_rms_rad: f64,
    /// Maximum angle between frame and target over the whole recording, rad.
    pub path_orientation_max_rad: f64,
    /// Mean [smoothness](GoalScore::smoothness) of the movements to the goals.
    pub smoothness: Option<f64>,
    /// `true` if the reader does not control the position; the position errors are then meaningless.
    pub position_is_free: bool,
    /// `true` if the reader does not control the orientation; the orientation errors are then meaningless.
    pub orientation_is_free: bool,
    /// Goals in time order.
    pub goals: Vec<GoalScore>,
}

impl PoseScore {
    /// Formats a position error \[m\] and an orientation error \[rad\] in mm and mrad. The error of a
    /// position or an orientation that the reader does not control is omitted.
    pub fn errors(&self, position: f64, orientation: f64) -> String {
        let both = [
            (self.position_is_free, format!("{:.3} mm", 1e3 * position)),
            (self.orientation_is_free, format!("{:.2} mrad", 1e3 * orientation)),
        ];
        let shown: Vec<String> =
            both.into_iter().filter(|(is_free, _)| !is_free).map(|(_, text)| text).collect();
        shown.join(", ")
    }
}

/// Score of one goal at which the target has rested.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GoalScore {
    /// Index of the episode.
    pub episode: u64,
    /// Number of the goal in the target's messages.
    pub goal: u64,
    /// Time at which the target came to rest, s since the first sample of the recording.
    pub at_rest_s: f64,
    /// Distance of the frame from the goal when the target moved on, m.
    pub position_error_m: f64,
    /// Angle between the frame and the goal when the target moved on, rad.
    pub orientation_error_rad: f64,
    /// `true` if both errors were within the tolerances.
    pub reached: bool,
    /// Spectral arc length of the frame's speed on the path to the goal. The arc length is about -1.4 for a
    /// movement with one acceleration and one deceleration, and lower for hesitant movements.
    pub smoothness: Option<f64>,
}

/// Frame whose pose is tracked through the recording.
pub(super) struct Follower {
    target: usize,
    joints: Option<usize>,
    base: Option<usize>,
    loaded: Loaded,
    kinematics: Kinematics,
    q: Vec<f64>,
    /// `true` for the joints, and for the base, once they have been read.
    seen: (bool, bool),
    /// `None` for the base itself.
    frame: Option<FrameId>,
    tolerance: [f64; 2],
    begin_ns: Option<u64>,
    last_ns: u64,
    movement: Option<Movement>,
    squares: [f64; 2],
    samples: f64,
    score: PoseScore,
}

/// Movement to one goal.
struct Movement {
    episode: u64,
    goal: u64,
    /// Times and positions of the frame until the target rests.
    way: Vec<(u64, Vector3<f64>)>,
    /// Time at which the target came to rest \[ns\], duration of the rest \[s\], and latest error while at
    /// rest.
    rest: Option<(u64, f64, [f64; 2])>,
}

impl Follower {
    /// Returns `None` if the reader has no robot with such a frame, if it does not move a frame to the
    /// target, or if its inputs were not recorded.
    pub(super) fn new(
        recording: &Recording,
        plan: &Plan,
        topic: usize,
        reader: usize,
        tolerance: Tolerance,
    ) -> Option<Self> {
        let component = &plan.components[reader];
        let loaded = load_in_world(component.robot.as_ref()?).ok()?;
        let recorded = |topic: usize| recording.topic(&plan.topics[topic].name);
        let input = |type_name: &str| {
            let found = component.inputs.iter().find(|input| input.layout.type_name == type_name);
            found.and_then(|input| input.topic)
        };
        let (joints, base) = (input(JointState::NAME), input(BaseState::NAME));
        let port = component.inputs.iter().find(|input| input.topic == Some(topic))?;
        let task = task_of(component, &port.port);
        // The target of another kind of task, such as a gaze target, is not a frame pose.
        if task.is_none() && component.config.get("tasks").is_some() {
            return None;
        }
        let named = task.and_then(|task| task.get("frame")).and_then(serde_json::Value::as_str);
        let frame = match joints {
            Some(_) => Some(loaded.model.end_effector(loaded.profile.as_ref(), named).ok()?),
            None => None,
        };
        if frame.is_none() && base.is_none() {
            return None;
        }
        let number = |key: &str| task?.get(key)?.as_f64();
        let is_free = |weight: &str| number(weight) == Some(0.0);
        // An axis that the task does not control cannot miss.
        let of_task = |key: &str, weight: &str, usual: f64| {
            if is_free(weight) { f64::INFINITY } else { number(key).unwrap_or(usual) }
        };
        let name = frame.map_or("base", |frame| loaded.model.frames()[frame.index()].name.as_str());
        let score = PoseScore {
            target: plan.topics[topic].name.clone(),
            reader: component.name.clone(),
            state: plan.topics[joints.or(base)?].name.clone(),
            frame: name.to_string(),
            goals_reached: 0,
            goals_missed: 0,
            position_error_m: None,
            orientation_error_rad: None,
            path_position_rms_m: 0.0,
            path_position_max_m: 0.0,
            path_orientation_rms_rad: 0.0,
            path_orientation_max_rad: 0.0,
            smoothness: None,
            position_is_free: is_free("position_weight"),
            orientation_is_free: is_free("orientation_weight"),
            goals: Vec::new(),
        };
        Some(Self {
            target: recorded(topic)?,
            joints: joints.and_then(recorded),
            base: base.and_then(recorded),
            kinematics: Kinematics::new(&loaded.model),
            q: loaded.model.neutral(),
            seen: (joints.is_none(), base.is_none()),
            loaded,
            frame,
            tolerance: [
                tolerance
                    .position
                    .unwrap_or_else(|| of_task("position_tolerance", "position_weight", POSITION)),
                tolerance
                    .orientation
                    .unwrap_or_else(|| of_task("orientation_tolerance", "orientation_weight", ORIENTATION)),
            ],
            begin_ns: None,
            last_ns: 0,
            movement: None,
            squares: [0.0; 2],
            samples: 0.0,
            score,
        })
    }

    /// Returns `true` if this topic of the recording contains the targets.
    pub(super) fn reads_target(&self, topic: usize) -> bool {
        topic == self.target
    }

    pub(super) fn take(&mut self, sample: &RecordedSample) {
        let begin_ns = *self.begin_ns.get_or_insert(sample.time_ns);
        if Some(sample.topic) == self.joints {
            let Some(state) = from_bytes::<JointState>(&sample.bytes) else { return };
            let joints = self.loaded.model.joint_count();
            let first = self.q.len() - joints;
            if let Some(position) = state.position().get(..joints) {
                self.q[first..].copy_from_slice(position);
                self.seen.0 = true;
            }
        } else if Some(sample.topic) == self.base {
            let Some(state) = from_bytes::<BaseState>(&sample.bytes) else { return };
            if self.loaded.model.base().floating {
                self.q[..3].copy_from_slice(&state.position);
                self.q[3..7].copy_from_slice(&state.orientation);
            }
            self.seen.1 = true;
        } else if sample.topic == self.target
            && self.seen == (true, true)
            && let Some(target) = from_bytes::<PoseTarget>(&sample.bytes)
            && let Some(wanted) = pose(target.position, target.orientation)
        {
            self.compare(sample, &target, &wanted, begin_ns);
        }
    }

    fn compare(
        &mut self,
        sample: &RecordedSample,
        target: &PoseTarget,
        wanted: &Isometry3<f64>,
        begin_ns: u64,
    ) {
        let model = &self.loaded.model;
        let frame = match self.frame {
            Some(frame) => {
                self.kinematics.update(model, &self.q);
                self.kinematics.pose(model, frame)
            }
            None => {
                let at = |range: core::ops::Range<usize>| self.q.get(range).unwrap_or(&[]);
                let (Ok(position), Ok(orientation)) = (at(0..3).try_into(), at(3..7).try_into()) else {
                    return;
                };
                let Some(frame) = pose(position, orientation) else { return };
                frame
            }
        };
        let error = [
            (wanted.translation.vector - frame.translation.vector).norm(),
            frame.rotation.angle_to(&wanted.rotation),
        ];
        self.samples += 1.0;
        self.squares.iter_mut().zip(error).for_each(|(sum, error)| *sum += error * error);
        self.score.path_position_max_m = self.score.path_position_max_m.max(error[0]);
        self.score.path_orientation_max_rad = self.score.path_orientation_max_rad.max(error[1]);

        let (episode, goal) = (sample.stamp.episode, target.goal);
        let dt = sample.time_ns.saturating_sub(self.last_ns) as f64 * 1e-9;
        self.last_ns = sample.time_ns;
        let is_new = |movement: &Movement| (movement.episode, movement.goal) != (episode, goal);
        if self.movement.as_ref().is_none_or(is_new) {
            if let Some(left) = self.movement.take() {
                self.finish(&left, left.episode == episode, begin_ns);
            }
            self.movement = Some(Movement { episode, goal, way: Vec::new(), rest: None });
        }
        let Some(movement) = &mut self.movement else { return };
        if target.at_goal != 0 {
            let (since_ns, rested, _) = movement.rest.unwrap_or((sample.time_ns, 0.0, error));
            movement.rest = Some((since_ns, rested + dt, error));
        } else if movement.rest.is_none() {
            movement.way.push((sample.time_ns, frame.translation.vector));
        }
    }

    /// Records a goal. `left` is `true` if the target moved on, and `false` at the end of a run or episode.
    fn finish(&mut self, movement: &Movement, left: bool, begin_ns: u64) {
        let Some((since_ns, rested, error)) = movement.rest else { return };
        if !left && rested + 1e-9 < SETTLE_S {
            return;
        }
        let reached = error.iter().zip(&self.tolerance).all(|(error, tolerance)| error <= tolerance);
        let worst = |known: Option<f64>, error: f64| Some(known.unwrap_or(0.0).max(error));
        let score = &mut self.score;
        score.goals_reached += u64::from(reached);
        score.goals_missed += u64::from(!reached);
        score.position_error_m = worst(score.position_error_m, error[0]);
        score.orientation_error_rad = worst(score.orientation_error_rad, error[1]);
        score.goals.push(GoalScore {
            episode: movement.episode,
            goal: movement.goal,
            at_rest_s: since_ns.saturating_sub(begin_ns) as f64 * 1e-9,
            position_error_m: error[0],
            orientation_error_rad: error[1],
            reached,
            smoothness: smoothness(&movement.way),
        });
    }

    /// Returns `None` if there is no target, or no state to compare.
    pub(super) fn result(mut self) -> Option<PoseScore> {
        if let (Some(last), Some(begin_ns)) = (self.movement.take(), self.begin_ns) {
            self.finish(&last, false, begin_ns);
        }
        if self.samples == 0.0 {
            return None;
        }
        let [position, orientation] = self.squares.map(|sum| (sum / self.samples).sqrt());
        (self.score.path_position_rms_m, self.score.path_orientation_rms_rad) = (position, orientation);
        let smooth: Vec<f64> = self.score.goals.iter().filter_map(|goal| goal.smoothness).collect();
        self.score.smoothness =
            (!smooth.is_empty()).then(|| smooth.iter().sum::<f64>() / smooth.len() as f64);
        Some(self.score)
    }
}

/// Kinds of tasks that move a frame to their target.
const FOLLOWING: [&str; 2] = ["cartesian", "admittance"];

/// Configuration of the controller task that moves a frame to the target of this port.
fn task_of<'c>(component: &'c ComponentPlan, port: &str) -> Option<&'c serde_json::Value> {
    let tasks = component.config.get("tasks")?.as_array()?;
    let mut following = tasks.iter().flat_map(|task| FOLLOWING.iter().filter_map(|kind| task.get(*kind)));
    let target = |task: &serde_json::Value| {
        task.get("target").and_then(serde_json::Value::as_str).unwrap_or("target") == port
    };
    following.find(|task| target(task))
}

/// Returns `None` if the orientation is not a unit quaternion.
fn pose(position: [f64; 3], [x, y, z, w]: [f64; 4]) -> Option<Isometry3<f64>> {
    let rotation = UnitQuaternion::try_new(Quaternion::new(w, x, y, z), 0.5)?;
    Some(Isometry3::from_parts(Translation3::from(position), rotation))
}

/// Smoothness of a path.
fn smoothness(way: &[(u64, Vector3<f64>)]) -> Option<f64> {
    let (first, last) = (way.first()?.0, way.last()?.0);
    let seconds = last.saturating_sub(first) as f64 * 1e-9;
    let rate_hz = (way.len() - 1) as f64 / seconds;
    let speeds: Vec<f64> = way.windows(2).map(|pair| (pair[1].1 - pair[0].1).norm() * rate_hz).collect();
    spectral_arc_length(&speeds, rate_hz)
}
