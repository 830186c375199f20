//! The folder of a trained policy: `policy.toml` and its network.
//!
//! The file lists the joints of the action, which maps each number to the right joint on a robot with a
//! different joint order:
//!
//! ```
//! use motorium_models::policy::Policy;
//!
//! let policy = Policy::parse(
//!     r#"
//!     network = "policy.onnx"
//!     rate = 50.0
//!     observations = [{ term = "joint_positions" }, { term = "command", scale = 2.0 }]
//!     [action]
//!     joints = ["hip", "knee"]
//!     scale = 0.5
//!     default_pose = [0.1, -0.2]
//!     "#,
//! )?;
//! assert_eq!(policy.inputs(), Ok(5));
//! let targets = policy.joint_targets(&["knee", "hip"])?;
//! let mut q = [0.0; 2];
//! targets.apply(&[1.0, 2.0], &mut q);
//! assert_eq!(q, [0.8, 0.6]);
//! # Ok::<(), motorium_models::policy::PolicyError>(())
//! ```

mod action;
mod assembly;
mod chunk;
mod error;
mod folder;
mod import;
mod numbers;
mod observer;
mod pattern;
mod robot;
mod targets;
mod twist;

use serde::{Deserialize, Serialize};

pub use action::{Action, ActionKind};
pub use assembly::Assembly;
pub use chunk::{Chunk, ChunkArrival, ChunkError, ChunkPlan, ChunkTiming};
pub use error::PolicyError;
pub use folder::{NetworkMismatch, PolicyFolder, PolicyFolderError, PolicyNetwork};
pub use import::{
    ActionDescriptor, Actuator, Articulation, Bundle, BundleModel, BundlePort, Descriptors, Environment,
    Gain, HeightGrid, ImportError, ImportOptions, Mark, ObservationDescriptor, import_isaac, import_leapp,
    import_mjlab, import_weights,
};
pub use numbers::Numbers;
use numbers::{finite, one};
pub use observer::{BaseMotion, Measurements, Observer, projected_gravity};
pub use pattern::{Pattern, PatternJoint};
pub use robot::{RobotDifference, RobotDigest};
pub use targets::{JointTarget, JointTargets};
pub use twist::TwistRanges;

/// Content of a `policy.toml`, which describes a policy.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Policy {
    /// Path of the network's file, relative to the folder of `policy.toml`.
    pub network: String,
    /// Rate at which the policy was trained \[Hz\], more than 0.
    pub rate: f64,
    /// Name of the robot for which the policy was trained. `motorium robot list` lists the names.
    pub robot: Option<String>,
    /// Initial values of each recurrent state at the start of an episode, in the order of the network's
    /// inputs after the observation. Default: zeros.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub initial_states: Vec<Vec<f32>>,
    /// Observation terms, in the order of the network's inputs.
    pub observations: Vec<Observation>,
    /// Mapping of the network's outputs to commands.
    pub action: Action,
    /// Pattern generator that the action commands. Default: the action commands the joints directly.
    pub pattern: Option<Pattern>,
    /// Digest of the robot for which the policy was trained. Default: robots are compared by joint names
    /// only.
    pub robot_digest: Option<RobotDigest>,
}

/// A term of the observation.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Observation {
    /// Quantity that is observed.
    pub term: Term,
    /// Factor of the term's values: one number for all values, or one number per value. Default: 1.
    #[serde(default = "one")]
    pub scale: Numbers,
    /// Minimum and maximum of the values before the factor. Default: unbounded.
    pub clip: Option<[f64; 2]>,
    /// Number of consecutive steps whose values are observed, 1 to 64, from the oldest to the newest.
    /// Default: 1.
    #[serde(default = "single")]
    pub history: usize,
    /// Number of rays. Only for a height scan.
    pub rays: Option<usize>,
    /// Duration of one gait cycle \[s\], more than 0. Only for the phase.
    pub period: Option<f64>,
    /// A point and, optionally, its reference point (default: the origin of the world). Only for the position
    /// and the velocity of a point. A point is the origin of a link, the centre of an object, or [`TARGET`].
    pub points: Option<Vec<String>>,
    /// Name of a camera: up to 32 lower-case letters, digits and underscores. Only for images.
    pub camera: Option<String>,
    /// Columns and rows of an image, 1 to 1024 each. Only for images.
    pub pixels: Option<[usize; 2]>,
    /// Depths that are observed as 0 and as 1 \[m\], at least 0; only for a depth image. Depths outside the
    /// range are clamped to it, and a pixel without a depth is observed as 1.
    pub range: Option<[f64; 2]>,
}

/// Name of the target among [`Observation::points`].
pub const TARGET: &str = "target";

impl Observation {
    /// Creates a term with a factor of 1, without bounds or history.
    pub fn new(term: Term) -> Self {
        Self {
            term,
            scale: one(),
            clip: None,
            history: single(),
            rays: None,
            period: None,
            points: None,
            camera: None,
            pixels: None,
            range: None,
        }
    }
}

/// A quantity that a policy observes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Term {
    /// Linear velocity of the base in the frame of the base \[m/s\].
    BaseLinearVelocity,
    /// Angular velocity of the base in the frame of the base \[rad/s\].
    BaseAngularVelocity,
    /// Direction of gravity in the frame of the base.
    ProjectedGravity,
    /// Desired motion of the base: forward velocity, velocity to the left \[m/s\] and yaw rate \[rad/s\].
    Command,
    /// Joint positions relative to the default pose \[rad or m\].
    JointPositions,
    /// Joint velocities \[rad/s or m/s\].
    JointVelocities,
    /// Action of the previous step.
    LastAction,
    /// Heights of the surface around the robot \[m\].
    HeightScan,
    /// Sine and cosine of the gait phase.
    Phase,
    /// Position of a point in world axes \[m\], relative to the reference point if given.
    PointPosition,
    /// Velocity of a point in world axes \[m/s\], relative to the reference point if given.
    PointVelocity,
    /// Depths of the pixels of a camera, from 0 at the near end of [`Observation::range`] to 1 at its far
    /// end, row by row from the top left corner.
    DepthImage,
    /// Grey levels of the pixels of a depth camera, 0 to 1, row by row from the top left corner.
    GreyImage,
}

impl Term {
    /// Returns `true` for an image of a camera.
    pub fn is_image(self) -> bool {
        matches!(self, Self::DepthImage | Self::GreyImage)
    }

    /// Returns the name of the term in `policy.toml`.
    pub fn name(self) -> &'static str {
        match self {
            Self::BaseLinearVelocity => "base_linear_velocity",
            Self::BaseAngularVelocity => "base_angular_velocity",
            Self::ProjectedGravity => "projected_gravity",
            Self::Command => "command",
            Self::JointPositions => "joint_positions",
            Self::JointVelocities => "joint_velocities",
            Self::LastAction => "last_action",
            Self::HeightScan => "height_scan",
            Self::Phase => "phase",
            Self::PointPosition => "point_position",
            Self::PointVelocity => "point_velocity",
            Self::DepthImage => "depth_image",
            Self::GreyImage => "grey_image",
        }
    }

    /// Returns the name of the message that contains the quantity; `None` for quantities computed by the
    /// policy. If the point of a term is the target, its position is in the message `motorium.PoseTarget`.
    pub fn message(self) -> Option<&'static str> {
        Some(match self {
            Self::BaseLinearVelocity => "motorium.BaseState",
            Self::BaseAngularVelocity | Self::ProjectedGravity => "motorium.ImuSample",
            Self::Command => "motorium.TwistTarget",
            Self::JointPositions | Self::JointVelocities | Self::PointPosition | Self::PointVelocity => {
                "motorium.JointState"
            }
            Self::HeightScan => "motorium.HeightScan",
            Self::DepthImage | Self::GreyImage => "slices of u8",
            Self::LastAction | Self::Phase => return None,
        })
    }
}

fn single() -> usize {
    1
}

fn is_ordered(clip: &Option<[f64; 2]>) -> bool {
    clip.is_none_or(|[low, high]| low < high)
}

impl Policy {
    /// Parses the text of a `policy.toml`.
    ///
    /// # Errors
    ///
    /// [`PolicyError`] with the line and column of a syntax error, or the key of an invalid value.
    pub fn parse(text: &str) -> Result<Self, PolicyError> {
        let policy: Self = toml::from_str(text).map_err(|error| {
            let start = error.span().map_or(0, |span| span.start).min(text.len());
            let before = text.get(..start).unwrap_or("");
            let line = before.matches('\n').count() + 1;
            let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
            PolicyError::Parse { line, column, message: error.message().to_owned() }
        })?;
        policy.check()?;
        Ok(policy)
    }

    /// Returns the policy as the text of a `policy.toml`.
    ///
    /// # Errors
    ///
    /// [`PolicyError::Value`] if a number cannot be represented in TOML.
    pub fn to_toml(&self) -> Result<String, PolicyError> {
        toml::to_string(self)
            .map_err(|error| PolicyError::Value { key: "policy".to_owned(), message: error.to_string() })
    }

    fn check(&self) -> Result<(), PolicyError> {
        let wrong = |key: &str, message: String| Err(PolicyError::Value { key: key.to_owned(), message });
        if !(self.rate > 0.0 && self.rate.is_finite()) {
            return wrong("rate", format!("found {}, expected a rate above 0 Hz", self.rate));
        }
        self.action.check("action.")?;
        if let Some(pattern) = &self.pattern {
            pattern.check(&self.action)?;
        }
        for (index, state) in self.initial_states.iter().enumerate() {
            finite(&format!("initial_states[{index}]"), state.iter().copied().map(f64::from))?;
        }
        for (index, observation) in self.observations.iter().enumerate() {
            let key = |name: &str| format!("observations[{index}].{name}");
            if !(1..=64).contains(&observation.history) {
                return wrong(&key("history"), format!("found {}, expected 1 to 64", observation.history));
            }
            if !is_ordered(&observation.clip) {
                let message = format!("found {:?}, expected a lower and a higher bound", observation.clip);
                return wrong(&key("clip"), message);
            }
            let is_scan = observation.term == Term::HeightScan;
            match observation.rays {
                Some(1..) if is_scan => {}
                None if !is_scan => {}
                Some(_) if !is_scan => {
                    return wrong(&key("rays"), "expected only for a height scan".to_owned());
                }
                _ => {
                    return wrong(
                        &key("rays"),
                        "missing, expected the number of rays of the height scan".to_owned(),
                    );
                }
            }
            match (observation.period, observation.term) {
                (Some(period), Term::Phase) if period > 0.0 && period.is_finite() => {}
                (None, term) if term != Term::Phase => {}
                (Some(_), term) if term != Term::Phase => {
                    return wrong(&key("period"), "expected only for the phase".to_owned());
                }
                (Some(period), _) => {
                    return wrong(&key("period"), format!("found {period}, expected a time above 0 s"));
                }
                (None, _) => {
                    return wrong(&key("period"), "missing, expected the cycle of the gait in s".to_owned());
                }
            }
            let observes_joints = matches!(observation.term, Term::JointPositions | Term::JointVelocities);
            if observes_joints && self.action.joints.is_empty() {
                let found = observation.term.name();
                return wrong(
                    &key("term"),
                    format!("found {found}, expected a term without joints for a base twist"),
                );
            }
            let is_point = matches!(observation.term, Term::PointPosition | Term::PointVelocity);
            match observation.points.as_deref() {
                None if !is_point => {}
                Some([_]) if is_point => {}
                Some([first, second]) if is_point && first != second => {}
                Some(_) if !is_point => {
                    return wrong(&key("points"), "expected only for points".to_owned());
                }
                found => {
                    let found = found.map_or_else(|| "none".to_owned(), |points| format!("{points:?}"));
                    return wrong(&key("points"), format!("found {found}, expected one or two points"));
                }
            }
            self.check_image(index)?;
            observation.scale.check(&key("scale"), self.width(observation))?;
        }
        self.inputs().map(drop)
    }

    /// Checks the keys of an image; other terms have none of them.
    fn check_image(&self, index: usize) -> Result<(), PolicyError> {
        let observation = &self.observations[index];
        let Observation { term, camera, pixels, range, .. } = observation;
        let wrong = |name: &str, message: String| {
            Err(PolicyError::Value { key: format!("observations[{index}].{name}"), message })
        };
        if !term.is_image() {
            return match (camera, pixels, range) {
                (Some(_), ..) => wrong("camera", "expected for images only".to_owned()),
                (_, Some(_), _) => wrong("pixels", "expected for images only".to_owned()),
                (.., Some(_)) => wrong("range", "expected for a depth image only".to_owned()),
                _ => Ok(()),
            };
        }
        let is_name = |name: &String| {
            let is_allowed = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_';
            (1..=32).contains(&name.len()) && name.bytes().all(is_allowed)
        };
        match camera {
            None => return wrong("camera", "missing, expected the name of a camera".to_owned()),
            Some(name) if !is_name(name) => {
                let expected = "up to 32 lower-case letters, digits and underscores";
                return wrong("camera", format!("found \"{name}\", expected {expected}"));
            }
            Some(_) => {}
        }
        let is_same = |other: &Observation| other.term == *term && other.camera == *camera;
        if self.observations[..index].iter().any(is_same) {
            return wrong(
                "camera",
                "found an image that another term has, expected each image once".to_owned(),
            );
        }
        match pixels {
            None => return wrong("pixels", "missing, expected columns and rows of the image".to_owned()),
            Some(pixels) if !pixels.iter().all(|count| (1..=1024).contains(count)) => {
                return wrong("pixels", format!("found {pixels:?}, expected 1 to 1024 columns and rows"));
            }
            Some(_) => {}
        }
        let expected = "a near and a far depth in m, from 0 up";
        match range {
            Some(_) if *term != Term::DepthImage => {
                wrong("range", "expected for a depth image only".to_owned())
            }
            None if *term == Term::DepthImage => wrong("range", format!("missing, expected {expected}")),
            Some([near, far]) if !(0.0 <= *near && near < far && far.is_finite()) => {
                wrong("range", format!("found {range:?}, expected {expected}", range = [near, far]))
            }
            _ => Ok(()),
        }
    }

    /// Returns the number of values of a term in one step.
    pub fn width(&self, observation: &Observation) -> usize {
        match observation.term {
            Term::BaseLinearVelocity
            | Term::BaseAngularVelocity
            | Term::ProjectedGravity
            | Term::Command
            | Term::PointPosition
            | Term::PointVelocity => 3,
            Term::JointPositions | Term::JointVelocities => self.action.joints.len(),
            Term::LastAction => self.outputs(),
            Term::HeightScan => observation.rays.unwrap_or(0),
            Term::Phase => 2,
            Term::DepthImage | Term::GreyImage => {
                observation.pixels.map_or(0, |[columns, rows]| columns.saturating_mul(rows))
            }
        }
    }

    /// Returns the number of the network's outputs: the outputs of the action, plus [`Pattern::OUTPUTS`] if
    /// the policy has a pattern generator.
    pub fn outputs(&self) -> usize {
        self.action.outputs() + self.pattern.as_ref().map_or(0, |_| Pattern::OUTPUTS)
    }

    /// Returns the number of values of the whole observation, including histories.
    ///
    /// # Errors
    ///
    /// [`PolicyError::Value`] if there are no terms, or the observation is too large.
    pub fn inputs(&self) -> Result<usize, PolicyError> {
        let widths = self.observations.iter().map(|term| self.width(term).checked_mul(term.history));
        let sum = widths.into_iter().try_fold(0_usize, |sum, width| sum.checked_add(width?));
        sum.filter(|sum| (1..1 << 20).contains(sum)).ok_or_else(|| PolicyError::Value {
            key: "observations".to_owned(),
            message: "expected a total of one to a million numbers in all terms".to_owned(),
        })
    }

    /// Creates the mapping from actions to joint targets of a robot with the joints `robot`. Joints that the
    /// policy does not command are unaffected; a base twist commands no joints.
    ///
    /// # Errors
    ///
    /// [`PolicyError::Joints`] if the robot lacks a joint of the policy.
    pub fn joint_targets(&self, robot: &[impl AsRef<str>]) -> Result<JointTargets, PolicyError> {
        self.action.joint_targets(robot)
    }
}

#[cfg(test)]
mod tests;
