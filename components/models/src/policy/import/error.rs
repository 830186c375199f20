//! Errors and names shared by all imports.

use super::super::{NetworkMismatch, PolicyError, Term};
use crate::onnx::OnnxError;

/// File name of the network in an imported folder.
pub(super) const NETWORK: &str = "policy.onnx";

/// Observation terms of mjlab, by name.
pub(super) const TERMS: [(&str, Term); 11] = [
    ("base_lin_vel", Term::BaseLinearVelocity),
    ("base_ang_vel", Term::BaseAngularVelocity),
    ("projected_gravity", Term::ProjectedGravity),
    ("command", Term::Command),
    ("velocity_commands", Term::Command),
    ("joint_pos", Term::JointPositions),
    ("joint_vel", Term::JointVelocities),
    ("actions", Term::LastAction),
    ("last_action", Term::LastAction),
    ("height_scan", Term::HeightScan),
    ("height_scanner", Term::HeightScan),
];

/// The policy cannot be imported.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ImportError {
    /// The network cannot be read or compiled.
    #[error(transparent)]
    Onnx(#[from] OnnxError),
    /// An entry of the metadata is missing.
    #[error("no `{0}` in the metadata of the file; help: export it with mjlab, which adds it")]
    Missing(&'static str),
    /// An entry of the metadata is not a list of numbers.
    #[error("`{key}` has \"{found}\", expected numbers separated by commas")]
    Number {
        /// The entry.
        key: &'static str,
        /// The text found.
        found: String,
    },
    /// The length of an entry of the metadata differs from the action's.
    #[error("`{key}` has {found} entries, expected {expected}, one for each output of the network")]
    Count {
        /// The entry.
        key: &'static str,
        /// Number of entries found.
        found: usize,
        /// Number of outputs of the network.
        expected: usize,
    },
    /// The length of a list of the metadata differs from the observation's.
    #[error("`{key}` has {found} entries, expected {expected}, one for each observation")]
    Terms {
        /// The list.
        key: &'static str,
        /// Number of entries found.
        found: usize,
        /// Number of observation terms.
        expected: usize,
    },
    /// A setting of an observation term is unusable.
    #[error("observation \"{name}\": `{key}`: {message}")]
    Setting {
        /// Name of the term.
        name: String,
        /// The list of the metadata.
        key: &'static str,
        /// The value found, the value expected, and a remedy.
        message: String,
    },
    /// The grid of the height scan is unknown, or has another number of points.
    #[error(
        "the height scan has {rays} points, expected {}; help: pass the points along x and y with `--height-points`",
        points.map_or_else(|| "a grid".to_owned(), |[x, y]| format!("{x} x {y}"))
    )]
    HeightPoints {
        /// Number of points read by the network.
        rays: usize,
        /// Points along x and y.
        points: Option<[usize; 2]>,
    },
    /// The factor of the height scan is unknown.
    #[error(
        "the file has no scale of the height scan; help: pass it with `--height-scale`: 1 / `max_distance` of the sensor in the tasks of mjlab"
    )]
    HeightScale,
    /// Settings of a height scan are given for a network without one.
    #[error(
        "the file has no height scan; help: remove `--height-points`, `--height-scale` and `--height-offset`"
    )]
    NoHeightScan,
    /// No topic provides this observation term.
    #[error("observation \"{name}\" is unknown, expected one of {}", known())]
    Term {
        /// Name of the term.
        name: String,
    },
    /// The size of the observation terms differs from the network's input.
    #[error(
        "the observation terms have {expected} numbers, the network reads {found}; help: pass a history of several steps with `--history`"
    )]
    Width {
        /// Size of the network's input.
        found: usize,
        /// Size of the terms.
        expected: usize,
    },
    /// An entry of a description has an unusable value.
    #[error("{mark}: `{entry}`: {message}")]
    Entry {
        /// Position of the entry.
        mark: Mark,
        /// Name of the entry.
        entry: String,
        /// The value found, the value expected, and a remedy.
        message: String,
    },
    /// No topic provides this observation term or input of a network.
    #[error("{mark}: observation \"{name}\" is not supported, expected one of {expected}")]
    Observation {
        /// Position of the term.
        mark: Mark,
        /// Name of the term.
        name: String,
        /// Supported names.
        expected: String,
    },
    /// Joints cannot be commanded by this action term or output of a network.
    #[error("{mark}: action \"{name}\" is not supported, expected one of {expected}")]
    Action {
        /// Position of the term.
        mark: Mark,
        /// Name of the term.
        name: String,
        /// Supported names.
        expected: String,
    },
    /// An entry of the `env.yaml` is unusable.
    #[error(transparent)]
    Environment(Box<ImportError>),
    /// The gains of a joint are unknown.
    #[error(
        "the {gain} of joint \"{joint}\" is unknown; help: pass the `env.yaml` of the training run, which has the gains of its actuators"
    )]
    Gains {
        /// The gain, `stiffness` or `damping`.
        gain: &'static str,
        /// Name of the joint.
        joint: String,
    },
    /// The outputs of the network depend on the heading of the base.
    #[error(
        "the actions depend on the heading of the base in `{input}`, which no topic provides; help: train with `projected_gravity` in place of the orientation"
    )]
    Heading {
        /// Name of the input.
        input: String,
    },
    /// The outputs of the network depend on the position of a height scanner in the world.
    #[error(
        "the actions depend on the position of the sensor in the world in `{input}`, which no topic provides; help: train with the heights relative to the sensor, as in `height_scan` of Isaac Lab"
    )]
    Place {
        /// Name of the input.
        input: String,
    },
    /// A file of a bundle has changed since it was written.
    #[error(
        "{mark}: {file} has the SHA-256 {found}, expected {expected} as in the bundle; help: export the bundle again"
    )]
    Checksum {
        /// Position of the file in the bundle.
        mark: Mark,
        /// The file.
        file: String,
        /// SHA-256 of the file.
        found: String,
        /// SHA-256 in the bundle.
        expected: String,
    },
    /// The table does not parse.
    #[error("{0}")]
    Table(String),
    /// A key of the table is missing, misplaced or unusable.
    #[error("`{key}`: {message}")]
    Key {
        /// The key.
        key: &'static str,
        /// The value found, and the value expected.
        message: String,
    },
    /// A tensor is missing or has the wrong shape.
    #[error("tensor \"{name}\": {message}")]
    Tensor {
        /// Name of the tensor.
        name: String,
        /// The shape found and the shape expected.
        message: String,
    },
    /// The result is not a valid policy.
    #[error(transparent)]
    Policy(#[from] PolicyError),
    /// The network does not match the policy.
    #[error(transparent)]
    Network(#[from] NetworkMismatch),
}

fn known() -> String {
    TERMS.map(|(name, _)| name).join(", ")
}

/// Settings missing in the metadata of an ONNX file.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportOptions {
    /// Rate of the policy \[Hz\].
    pub rate: f64,
    /// Steps of history of each term; `None`: as in the file, or 1.
    pub history: Option<usize>,
    /// Robot for which the policy was trained.
    pub robot: Option<String>,
    /// Points of the height scan along x and y; `None`: 17 x 11 for 187 points, the grid of mjlab's velocity
    /// tasks.
    pub height_points: Option<[usize; 2]>,
    /// Factor of the height scan in a file without factors.
    pub height_scale: Option<f64>,
    /// Height subtracted from the height of the sensor above the surface \[m\]; `None`: 0, as in mjlab.
    pub height_offset: Option<f64>,
}

/// A position in a file, from 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mark {
    /// Line.
    pub line: usize,
    /// Column.
    pub column: usize,
}

impl core::fmt::Display for Mark {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "line {}, column {}", self.line, self.column)
    }
}

impl Mark {
    pub(super) fn entry(self, entry: &str, message: impl Into<String>) -> ImportError {
        ImportError::Entry { mark: self, entry: entry.to_owned(), message: message.into() }
    }
}
