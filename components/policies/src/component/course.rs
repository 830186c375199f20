//! Goals as they are configured, turned into legs.

use motorium::component::ConfigError;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use super::config::{DmpPolicyConfig, GoalConfig, PoseConfig, ShapeConfig};
use crate::dmp::DmpModel;
use crate::reach::{Leg, PathShape, PoseReach, ReachError, Repeat, SteerError};

/// The goals of a policy, some of them relative to where it starts.
#[derive(Debug)]
pub(super) struct Course {
    goals: Vec<Goal>,
    legs: Vec<Leg>,
    repeat: Repeat,
    origin: Isometry3<f64>,
}

#[derive(Debug)]
struct Goal {
    place: Place,
    /// None: as the goal before.
    turn: Option<UnitQuaternion<f64>>,
}

#[derive(Debug)]
enum Place {
    At(Vector3<f64>),
    /// Relative to the goal before, in world axes.
    Beside(Vector3<f64>),
}

impl Course {
    pub(super) fn new(config: &DmpPolicyConfig) -> Result<Self, ConfigError> {
        let mut course = Self {
            goals: Vec::new(),
            legs: Vec::new(),
            repeat: config.repeat,
            origin: Isometry3::identity(),
        };
        for (index, goal) in config.goals.iter().enumerate() {
            let key = |name: &str| format!("goals[{index}].{name}");
            course.goals.push(Goal {
                place: place(goal, &format!("goals[{index}]"), key)?,
                turn: orientation(goal.orientation, goal.rpy, key)?,
            });
            course.legs.push(Leg {
                goal: Isometry3::identity(),
                duration: goal.duration,
                dwell: goal.dwell,
                shape: shape(&goal.shape).map_err(|message| ConfigError::key(key("shape"), message))?,
            });
        }
        Ok(course)
    }

    /// The reach, its goals still to be aimed at.
    pub(super) fn reach(&self) -> Result<PoseReach, ConfigError> {
        PoseReach::new(self.legs.clone(), self.repeat).map_err(|error| match &error {
            ReachError::NoLegs => ConfigError::key("goals", error.to_string()),
            ReachError::Goal { leg } => ConfigError::key(format!("goals[{leg}]"), error.to_string()),
            ReachError::Duration { leg, .. } => {
                ConfigError::key(format!("goals[{leg}].duration"), error.to_string())
            }
            ReachError::Shape { leg, source } => {
                ConfigError::key(format!("goals[{leg}].shape"), source.to_string())
            }
        })
    }

    /// Aims every leg, for a course that begins at a pose.
    pub(super) fn aim(&mut self, reach: &mut PoseReach, origin: &Isometry3<f64>) -> Result<(), SteerError> {
        let (mut place, mut turn) = (origin.translation.vector, origin.rotation);
        for (leg, goal) in self.goals.iter().enumerate() {
            place = match goal.place {
                Place::At(position) => position,
                Place::Beside(offset) => place + offset,
            };
            turn = goal.turn.unwrap_or(turn);
            reach.aim(leg, Isometry3::from_parts(Translation3::from(place), turn))?;
        }
        self.origin = *origin;
        Ok(())
    }

    /// The pose the course began at.
    pub(super) fn origin(&self) -> Isometry3<f64> {
        self.origin
    }
}

/// A configured pose. `key` is that of its table.
pub(super) fn pose(config: &PoseConfig, key: &str) -> Result<Isometry3<f64>, ConfigError> {
    let key = |name: &str| format!("{key}.{name}");
    let position = finite(config.position, key("position"))?;
    let turn = orientation(config.orientation, config.rpy, key)?.unwrap_or_default();
    Ok(Isometry3::from_parts(Translation3::from(position), turn))
}

fn place(goal: &GoalConfig, table: &str, key: impl Fn(&str) -> String) -> Result<Place, ConfigError> {
    match (goal.position, goal.offset) {
        (Some(position), None) => Ok(Place::At(finite(position, key("position"))?)),
        (None, Some(offset)) => Ok(Place::Beside(finite(offset, key("offset"))?)),
        (Some(_), Some(_)) => Err(ConfigError::key(key("offset"), "both `position` and `offset` are given")
            .advise("keep one of them")),
        (None, None) => Err(ConfigError::key(table, "neither `position` nor `offset` is given").advise(
            "give `position` in the world frame, or `offset` from the goal before (zero to turn on the spot)",
        )),
    }
}

fn orientation(
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
            // printed digits are rounded, but no further than this
            if (norm - 1.0).abs() > 1e-2 || !norm.is_finite() {
                let message = format!("the quaternion has the length {norm}, expected 1");
                let error = ConfigError::key(key("orientation"), message);
                return Err(error.advise("the order is x y z w"));
            }
            Ok(Some(UnitQuaternion::new_normalize(quaternion)))
        }
    }
}

fn shape(config: &ShapeConfig) -> Result<PathShape, String> {
    match config {
        ShapeConfig::Straight => Ok(PathShape::Straight),
        ShapeConfig::Arc(apex) => Ok(PathShape::Arc { apex: Vector3::from(*apex) }),
        ShapeConfig::Primitive(stored) => DmpModel::try_from(stored.clone())
            .map(|model| PathShape::Learned(Box::new(model)))
            .map_err(|error| error.to_string()),
    }
}

fn finite(values: [f64; 3], key: String) -> Result<Vector3<f64>, ConfigError> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(value) => Err(ConfigError::key(key, format!("{value} is no number to work with"))),
        None => Ok(Vector3::from(values)),
    }
}
