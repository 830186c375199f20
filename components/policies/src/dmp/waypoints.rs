//! Conversion of configured goals to segments.

use std::time::Duration;

use motorium::declare::{ConfigError, RobotReference};
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use super::config::{DmpPolicyConfig, GoalConfig, PoseConfig, ShapeConfig, WeightsConfig};
use super::imitation::{self, Demonstrated, PathRecord};
use motorium_primitives::dmp::{DmpModel, Settings};
use motorium_primitives::reach::{PathShape, PoseReach, ReachError, Repeat, Segment, SteerError};

use crate::gripper::Fingers;

/// The goals of a policy, some of them relative to the start.
#[derive(Debug)]
pub(super) struct Waypoints {
    goals: Vec<Goal>,
    segments: Vec<Segment>,
    /// For each segment, its goal in the configuration and its demonstrated path.
    keys: Vec<usize>,
    paths: Vec<Option<Vec<Vector3<f64>>>>,
    primitives: Vec<DmpModel>,
    selected: Vec<usize>,
    /// Segments whose weights come from an input, with their initial primitives.
    weighted: Vec<(usize, DmpModel)>,
    repeat: Repeat,
    origin: Isometry3<f64>,
}

#[derive(Debug)]
struct Goal {
    place: GoalPlace,
    /// `None` keeps the previous orientation.
    turn: Option<UnitQuaternion<f64>>,
    /// Joints of the fingers and their positions, rad or m; `None` keeps the previous ones.
    fingers: Option<Vec<(usize, f64)>>,
}

/// The position of a goal.
#[derive(Clone, Copy, Debug)]
pub(super) enum GoalPlace {
    At(Vector3<f64>),
    /// Relative to the previous goal, in world axes.
    Beside(Vector3<f64>),
}

impl Waypoints {
    pub(super) fn new(config: &DmpPolicyConfig, robot: Option<&RobotReference>) -> Result<Self, ConfigError> {
        let mut waypoints = Self {
            goals: Vec::new(),
            segments: Vec::new(),
            keys: Vec::new(),
            paths: Vec::new(),
            primitives: Vec::new(),
            selected: Vec::new(),
            weighted: Vec::new(),
            repeat: config.repeat,
            origin: Isometry3::identity(),
        };
        for (index, file) in config.primitives.iter().enumerate() {
            let key = format!("primitives[{index}]");
            let model = imitation::primitive(file, robot, &key)?;
            if waypoints.primitives.first().is_some_and(|first| first.settings() != model.settings()) {
                let message =
                    format!("the settings of {file} differ from the settings of the first primitive");
                return Err(ConfigError::key(key, message)
                    .advise("fit all primitives with the same variant and number of kernels"));
            }
            waypoints.primitives.push(model);
        }
        let first = config.goals.iter().position(|goal| goal.gripper.is_some());
        let fingers = first.map(|index| fingers(robot, config.frame.as_deref(), index)).transpose()?;
        for (index, goal) in config.goals.iter().enumerate() {
            waypoints.add(index, goal, robot, config.frame.as_deref(), fingers.as_ref())?;
        }
        Ok(waypoints)
    }

    /// Adds the segments of a goal.
    fn add(
        &mut self,
        index: usize,
        goal: &GoalConfig,
        robot: Option<&RobotReference>,
        frame: Option<&str>,
        fingers: Option<&Fingers>,
    ) -> Result<(), ConfigError> {
        let key = |name: &str| format!("goals[{index}].{name}");
        let gripper = goal.gripper.zip(fingers);
        let positions = gripper.map(|(gripper, fingers)| fingers.positions(gripper)).transpose();
        let positions = positions
            .map_err(|error| ConfigError::key(key("gripper"), error.to_string()))?
            .map(Iterator::collect);
        let mut turn = orientation(goal.orientation, goal.rpy, key)?;
        let mut segment = Segment {
            goal: Isometry3::identity(),
            duration: goal.duration.unwrap_or_default().into(),
            dwell: goal.dwell.into(),
            shape: PathShape::Straight,
        };
        let (mut at, mut path) = (None, None);
        if let ShapeConfig::Demonstration(config) = &goal.shape {
            let shown = Demonstrated::read(config, robot, frame, &key("shape"))?;
            if let Some(approach) = config.approach {
                let goal = Goal {
                    place: GoalPlace::At(shown.start()),
                    turn: shown.turns.map(|[start, _]| start).or(turn),
                    fingers: None,
                };
                let to_start =
                    Segment { duration: approach.into(), dwell: Duration::ZERO, ..segment.clone() };
                self.push(index, goal, to_start, None);
            }
            at = Some(GoalPlace::At(shown.end()));
            turn = turn.or(shown.turns.map(|[_, end]| end));
            segment.duration = goal.duration.map_or(shown.duration, Into::into);
            segment.shape = PathShape::Learned(Box::new(shown.model));
            path = Some(shown.path);
        } else {
            let is_still = goal.position.is_none() && goal.offset.is_none() && turn.is_none();
            if let (None, true, Some((_, fingers))) = (goal.duration, is_still, gripper) {
                segment.duration = fingers.travel_time();
            } else if goal.duration.is_none() {
                return Err(ConfigError::key(format!("goals[{index}]"), "`duration` is not given")
                    .advise("give the time to this goal, such as `duration = \"2 s\"`"));
            }
            segment.shape =
                self.shape(&goal.shape, robot, &key("shape")).map_err(|error| match error.key {
                    None => ConfigError { key: Some(key("shape")), ..error },
                    Some(_) => error,
                })?;
            if matches!(goal.shape, ShapeConfig::Selected) {
                self.selected.push(self.segments.len());
            }
            if let (ShapeConfig::Weights(_), PathShape::Learned(model)) = (&goal.shape, &segment.shape) {
                self.weighted.push((self.segments.len(), (**model).clone()));
            }
        }
        let place = match at {
            // a demonstrated path is only compared with a movement to its own end
            Some(at) if goal.position.is_none() && goal.offset.is_none() => at,
            _ => {
                path = None;
                goal_position(goal, &format!("goals[{index}]"), key)?
            }
        };
        self.push(index, Goal { place, turn, fingers: positions }, segment, path);
        Ok(())
    }

    fn push(&mut self, index: usize, goal: Goal, segment: Segment, path: Option<Vec<Vector3<f64>>>) {
        self.goals.push(goal);
        self.segments.push(segment);
        self.keys.push(index);
        self.paths.push(path);
    }

    fn shape(
        &self,
        config: &ShapeConfig,
        robot: Option<&RobotReference>,
        key: &str,
    ) -> Result<PathShape, ConfigError> {
        let learned = |model: DmpModel| PathShape::Learned(Box::new(model));
        match config {
            ShapeConfig::Straight | ShapeConfig::Demonstration(_) => Ok(PathShape::Straight),
            ShapeConfig::Arc(apex) => Ok(PathShape::Arc { apex: Vector3::from(*apex) }),
            ShapeConfig::Primitive(stored) => DmpModel::try_from(stored.clone())
                .map(learned)
                .map_err(|error| ConfigError::key(key, error.to_string())),
            ShapeConfig::File(file) => Ok(learned(imitation::primitive(file, robot, key)?)),
            ShapeConfig::Weights(config) => Ok(learned(weighted(config, robot, key)?)),
            ShapeConfig::Selected => match self.primitives.first() {
                Some(model) => Ok(learned(model.clone())),
                None => Err(ConfigError::key(key, "there are no `primitives` to select from")),
            },
        }
    }

    /// Returns the position and the orientation (`None`: the previous goal's) of each goal, with the index of
    /// its goal in the configuration.
    pub(super) fn poses(&self) -> impl Iterator<Item = (GoalPlace, Option<UnitQuaternion<f64>>, usize)> + '_ {
        self.goals.iter().zip(&self.keys).map(|(goal, key)| (goal.place, goal.turn, *key))
    }

    /// Returns `true` if a goal has a gripper.
    pub(super) fn has_grippers(&self) -> bool {
        self.goals.iter().any(|goal| goal.fingers.is_some())
    }

    /// Returns the joints and positions of the fingers at the newest goal with a gripper among the last
    /// `count` started segments, and the duration of its movement. `segment` is the current segment.
    pub(super) fn fingers(&self, segment: usize, count: u64) -> Option<(&[(usize, f64)], Duration)> {
        let all = self.segments.len();
        let started = (0..all).take(usize::try_from(count).unwrap_or(all));
        started.map(|back| (segment + all - back) % all).find_map(|segment| {
            let fingers = self.goals[segment].fingers.as_deref()?;
            Some((fingers, self.segments[segment].duration))
        })
    }

    /// Returns the selectable primitives.
    pub(super) fn primitives(&self) -> &[DmpModel] {
        &self.primitives
    }

    /// Returns the segments that follow the selected primitive.
    pub(super) fn selected(&self) -> &[usize] {
        &self.selected
    }

    /// Returns the segments whose weights come from an input, with their initial primitives.
    pub(super) fn weighted(&self) -> &[(usize, DmpModel)] {
        &self.weighted
    }

    /// Returns a record of the deviations from the demonstrated paths.
    pub(super) fn record(&self) -> PathRecord {
        PathRecord::new(self.paths.clone())
    }

    /// Creates the reach, with goals still to be set.
    pub(super) fn reach(&self) -> Result<PoseReach, ConfigError> {
        PoseReach::new(self.segments.clone(), self.repeat).map_err(|error| match &error {
            ReachError::NoSegments => ConfigError::key("goals", error.to_string()),
            ReachError::Goal { segment } => {
                ConfigError::key(format!("goals[{}]", self.keys[*segment]), error.to_string())
            }
            ReachError::Duration { segment, .. } => {
                ConfigError::key(format!("goals[{}].duration", self.keys[*segment]), error.to_string())
            }
            ReachError::Shape { segment, source } => {
                ConfigError::key(format!("goals[{}].shape", self.keys[*segment]), source.to_string())
            }
        })
    }

    /// Sets the goal of every segment for a start pose.
    pub(super) fn set_goals(
        &mut self,
        reach: &mut PoseReach,
        origin: &Isometry3<f64>,
    ) -> Result<(), SteerError> {
        let (mut place, mut turn) = (origin.translation.vector, origin.rotation);
        for (segment, goal) in self.goals.iter().enumerate() {
            place = match goal.place {
                GoalPlace::At(position) => position,
                GoalPlace::Beside(offset) => place + offset,
            };
            turn = goal.turn.unwrap_or(turn);
            reach.set_goal(segment, Isometry3::from_parts(Translation3::from(place), turn))?;
        }
        self.origin = *origin;
        Ok(())
    }

    /// Returns the start pose of the waypoints.
    pub(super) fn origin(&self) -> Isometry3<f64> {
        self.origin
    }
}

/// Largest number of kernels of a primitive whose weights come from an input.
const MOST_KERNELS: usize = 1000;

/// Returns the initial primitive of a goal whose weights come from an input.
fn weighted(
    config: &WeightsConfig,
    robot: Option<&RobotReference>,
    key: &str,
) -> Result<DmpModel, ConfigError> {
    let kernels = match (&config.file, config.kernels) {
        (Some(_), Some(_)) => {
            return Err(
                ConfigError::key(key, "both `kernels` and `file` are given").advise("keep one of them")
            );
        }
        (Some(file), None) => return imitation::primitive(file, robot, key),
        (None, kernels) => kernels.unwrap_or(Settings::default().kernels),
    };
    if !(2..=MOST_KERNELS).contains(&kernels) {
        return Err(ConfigError::key(key, format!("{kernels} kernels, expected 2 to {MOST_KERNELS}")));
    }
    DmpModel::new(3, Settings { kernels, ..Settings::default() })
        .map_err(|error| ConfigError::key(key, error.to_string()))
}

/// Converts a configured pose. `key` is the key of its table.
pub(super) fn pose(config: &PoseConfig, key: &str) -> Result<Isometry3<f64>, ConfigError> {
    let key = |name: &str| format!("{key}.{name}");
    let position = finite(config.position, key("position"))?;
    let turn = orientation(config.orientation, config.rpy, key)?.unwrap_or_default();
    Ok(Isometry3::from_parts(Translation3::from(position), turn))
}

/// Largest coordinate of a goal along an axis, m: robots do not walk that far in one run.
const FARTHEST: f64 = 1e5;

/// Checks that a position is within the range of goals.
fn near(values: [f64; 3], key: String) -> Result<Vector3<f64>, ConfigError> {
    match values.iter().find(|value| value.abs() > FARTHEST) {
        Some(value) => {
            Err(ConfigError::key(key, format!("{value} m, expected at most {FARTHEST} m along each axis"))
                .advise("positions are written in metres"))
        }
        None => finite(values, key),
    }
}

/// Returns the fingers of the robot for the gripper of a goal.
fn fingers(
    robot: Option<&RobotReference>,
    frame: Option<&str>,
    index: usize,
) -> Result<Fingers, ConfigError> {
    let robot = crate::robot::load(crate::robot::required(robot, "fingers")?)?;
    Fingers::of_robot(&robot, frame)
        .map_err(|error| ConfigError::key(format!("goals[{index}].gripper"), error.to_string()))
}

fn goal_position(
    goal: &GoalConfig,
    table: &str,
    key: impl Fn(&str) -> String,
) -> Result<GoalPlace, ConfigError> {
    match (goal.position, goal.offset) {
        (Some(position), None) => Ok(GoalPlace::At(near(position, key("position"))?)),
        (None, Some(offset)) => Ok(GoalPlace::Beside(near(offset, key("offset"))?)),
        (Some(_), Some(_)) => Err(ConfigError::key(key("offset"), "both `position` and `offset` are given")
            .advise("keep one of them")),
        (None, None) if goal.gripper.is_some() => Ok(GoalPlace::Beside(Vector3::zeros())),
        (None, None) => Err(ConfigError::key(table, "neither `position` nor `offset` is given").advise(
            "give `position` in the world frame, or `offset` from the previous goal (zero to turn on the spot)",
        )),
    }
}

/// Converts a configured orientation: a quaternion, or roll, pitch and yaw. `key` names a key of its table.
pub(crate) fn orientation(
    quaternion: Option<[f64; 4]>,
    rpy: Option<[f64; 3]>,
    key: impl Fn(&str) -> String,
) -> Result<Option<UnitQuaternion<f64>>, ConfigError> {
    match (quaternion, rpy) {
        (None, None) => Ok(None),
        (Some(_), Some(_)) => {
            Err(ConfigError::key(key("rpy"), "both `orientation` and `rpy` are given")
                .advise("keep one of them"))
        }
        (None, Some(rpy)) => {
            let [roll, pitch, yaw] = finite(rpy, key("rpy"))?.into();
            Ok(Some(UnitQuaternion::from_euler_angles(roll, pitch, yaw)))
        }
        (Some([x, y, z, w]), None) => {
            let quaternion = Quaternion::new(w, x, y, z);
            let norm = quaternion.norm();
            // printed digits are rounded, but by no more than this
            if (norm - 1.0).abs() > 1e-2 || !norm.is_finite() {
                let message = format!("the quaternion has the length {norm}, expected 1");
                let error = ConfigError::key(key("orientation"), message);
                return Err(error.advise("the order is x y z w"));
            }
            Ok(Some(UnitQuaternion::new_normalize(quaternion)))
        }
    }
}

fn finite(values: [f64; 3], key: String) -> Result<Vector3<f64>, ConfigError> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(value) => Err(ConfigError::key(key, format!("{value}, expected a finite number"))),
        None => Ok(Vector3::from(values)),
    }
}
