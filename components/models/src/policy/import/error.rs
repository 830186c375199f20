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

/// Error of importing a policy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ImportError {
    /// The network cannot be read or compiled.
    #[error(transparent)]
    Onnx(#[from] OnnxError),
    /// An entry of the metadata is missing.
    #[error("no `{0}` in the metadata of the file; help: export it with mjlab, which adds it")]
    Missing(&'static str),
    /// An entry of the metadata is not a list of numbers.
    #[error("`{key}` is \"{found}\", expected numbers separated by commas")]
    Number {
        /// Key of the entry.
        key: &'static str,
        /// Text found.
        found: String,
    },
    /// An entry of the metadata does not have one value per output of the network.
    #[error("`{key}` has {found} entries, expected {expected}, one for each output of the network")]
    Count {
        /// Key of the entry.
        key: &'static str,
        /// Number of entries found.
        found: usize,
        /// Number of outputs of the network.
        expected: usize,
    },
    /// A list of the metadata does not have one value per observation term.
    #[error("`{key}` has {found} entries, expected {expected}, one for each observation")]
    Terms {
        /// Key of the list.
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
        /// Key of the list in the metadata.
        key: &'static str,
        /// Description of the value found, the value expected, and a remedy.
        message: String,
    },
    /// The grid of the height scan is unknown, or has a different number of points.
    #[error(
        "the height scan has {rays} points, expected {}; help: pass the points along x and y with `--height-points`",
        points.map_or_else(|| "a grid".to_owned(), |[x, y]| format!("{x} x {y}"))
    )]
    HeightPoints {
        /// Number of points that the network reads.
        rays: usize,
        /// Number of points along x and y; `None` if unknown.
        points: Option<[usize; 2]>,
    },
    /// The scale of the height scan is unknown.
    #[error(
        "the file has no scale of the height scan; help: pass it with `--height-scale`: 1 / `max_distance` of the sensor in the tasks of mjlab"
    )]
    HeightScale,
    /// Settings of a height scan are given for a network without a height scan.
    #[error(
        "the file has no height scan; help: remove `--height-points`, `--height-scale` and `--height-offset`"
    )]
    NoHeightScan,
    /// The observation term is unknown, so no topic provides it.
    #[error("observation \"{name}\" is unknown, expected one of {}", known())]
    Term {
        /// Name of the term.
        name: String,
    },
    /// The total size of the observation terms differs from the network's input.
    #[error(
        "the observation terms have {expected} numbers, but the network reads {found}; help: pass a history of several steps with `--history`"
    )]
    Width {
        /// Size of the network's input.
        found: usize,
        /// Total size of the observation terms.
        expected: usize,
    },
    /// An entry of a description has an unusable value.
    #[error("{mark}: `{entry}`: {message}")]
    Entry {
        /// Position of the entry.
        mark: Mark,
        /// Name of the entry.
        entry: String,
        /// Description of the value found, the value expected, and a remedy.
        message: String,
    },
    /// An observation term or input of the network is not supported, because no topic provides it.
    #[error("{mark}: observation \"{name}\" is not supported, expected one of {expected}")]
    Observation {
        /// Position of the term.
        mark: Mark,
        /// Name of the term.
        name: String,
        /// Supported names.
        expected: String,
    },
    /// An action term or output of the network is not supported, because it cannot command joints.
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
        /// Name of the gain, `stiffness` or `damping`.
        gain: &'static str,
        /// Name of the joint.
        joint: String,
    },
    /// The outputs of the network depend on the heading of the base, which is not observed.
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
        /// Name of the file.
        file: String,
        /// SHA-256 of the file as found.
        found: String,
        /// SHA-256 stated in the bundle.
        expected: String,
    },
    /// The table with the policy does not parse.
    #[error("{0}")]
    Table(String),
    /// A key of the table is missing, misplaced or unusable.
    #[error("`{key}`: {message}")]
    Key {
        /// Name of the key.
        key: &'static str,
        /// Description of the value found and the value expected.
        message: String,
    },
    /// A tensor is missing or has the wrong shape.
    #[error("tensor \"{name}\": {message}")]
    Tensor {
        /// Name of the tensor.
        name: String,
        /// Description of the shape found and the shape expected.
        message: String,
    },
    /// The imported policy is invalid.
    #[error(transparent)]
    Policy(#[from] PolicyError),
    /// The network does not match the policy.
    #[error(transparent)]
    Network(#[from] NetworkMismatch),
}

fn known() -> String {
    TERMS.map(|(name, _)| name).join(", ")
}

/// Import settings for properties of a policy that are missing in the metadata of its ONNX file.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportOptions {
    /// Rate of the policy \[Hz\].
    pub rate: f64,
    /// Number of steps of history of each term; `None` means the number in the file, or 1 if the file
    /// contains no number.
    pub history: Option<usize>,
    /// Robot for which the policy was trained.
    pub robot: Option<String>,
    /// Number of points of the height scan along x and y; `None` means 17 x 11 for 187 points, the grid of
    /// mjlab's velocity tasks.
    pub height_points: Option<[usize; 2]>,
    /// Factor of the height scan, if the file contains no factors.
    pub height_scale: Option<f64>,
    /// Offset subtracted from the height of the sensor above the surface \[m\]; `None` means 0, as in mjlab.
    pub height_offset: Option<f64>,
}

/// A position in a file, counted from 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mark {
    /// Line number.
    pub line: usize,
    /// Column number.
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
