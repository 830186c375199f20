//! Weights of a pose per axis.

use motorium::declare::ConfigError;
use motorium_robots::Twist;
use nalgebra::{Isometry3, Matrix3, Vector3, Vector6};
use schemars::JsonSchema;
use serde::Deserialize;

use super::context::TaskContext;

/// Relative weight below which a direction is free.
const FREE: f64 = 1e-9;

/// Axes in which a task evaluates the error of a pose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PoseAxes {
    /// Axes of the controlled frame: free directions move with the tool.
    #[default]
    Frame,
    /// Axes of the target.
    Target,
    /// Axes of the world.
    World,
}

/// Weight factors for the directions of a pose: one matrix for the position and one for the orientation, in
/// selectable axes.
///
/// With `R` from these axes to the world the error is
///
/// ```text
/// e = (R'(p* - p), R' log(R* R_f'))               m, rad; p, R_f: the frame, p*, R*: its target
/// ```
///
/// and the rows `S_p` and `S_o` of the factors replace the six axes. A diagonal factor weights an axis, and 0
/// leaves the axis free; a row may have any direction. Directions without a row have no error.
///
/// ```
/// use motorium_control::tasks::{AxisShares, CartesianSettings, PoseAxes};
///
/// // a height and an upright tool: it may go anywhere in the plane, and turn about the vertical
/// let shares = AxisShares::new(PoseAxes::World, [0.0, 0.0, 1.0], [1.0, 1.0, 0.0]);
/// let settings = CartesianSettings { shares: Some(shares), ..CartesianSettings::default() };
/// # let _ = settings;
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisShares {
    axes: PoseAxes,
    position: Part,
    orientation: Part,
}

/// The factors of a position or of an orientation.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Part {
    shares: Matrix3<f64>,
    /// Projector onto the directions covered by a row.
    seen: Matrix3<f64>,
}

impl Part {
    fn new(shares: Matrix3<f64>) -> Self {
        let decomposed = shares.svd(false, true);
        let largest = decomposed.singular_values.max();
        let mut seen = Matrix3::zeros();
        if let Some(directions) = decomposed.v_t.filter(|_| largest > 0.0) {
            for (row, length) in directions.row_iter().zip(&decomposed.singular_values) {
                if *length > FREE * largest {
                    seen += row.transpose() * row;
                }
            }
        }
        Self { shares, seen }
    }
}

impl AxisShares {
    /// Creates one factor per axis: for the position along x, y and z, and for the rotations about them. A
    /// factor of 0 leaves an axis free.
    pub fn new(axes: PoseAxes, position: [f64; 3], orientation: [f64; 3]) -> Self {
        let [position, orientation] =
            [position, orientation].map(|shares| Matrix3::from_diagonal(&Vector3::from(shares)));
        Self::matrices(axes, position, orientation)
    }

    /// Creates factors from matrices; each row is a direction whose error has a cost.
    pub fn matrices(axes: PoseAxes, position: Matrix3<f64>, orientation: Matrix3<f64>) -> Self {
        Self { axes, position: Part::new(position), orientation: Part::new(orientation) }
    }

    /// Returns the axes in which the error is evaluated.
    pub fn axes(&self) -> PoseAxes {
        self.axes
    }

    /// Returns `true` if any direction of the position has a cost.
    pub fn has_position(&self) -> bool {
        self.position.seen != Matrix3::zeros()
    }

    /// Returns `true` if any direction of the orientation has a cost.
    pub fn has_orientation(&self) -> bool {
        self.orientation.seen != Matrix3::zeros()
    }

    /// Returns the error of a frame at `pose` relative to `target`, in these axes: position \[m\] and
    /// rotation vector \[rad\]. Free directions are zero.
    pub fn error(&self, pose: &Isometry3<f64>, target: &Isometry3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let from_world = self.world_to_axes(pose, target);
        let offset = target.translation.vector - pose.translation.vector;
        let turn = (target.rotation * pose.rotation.inverse()).scaled_axis();
        (self.position.seen * (from_world * offset), self.orientation.seen * (from_world * turn))
    }

    /// `R'`, the rotation from the world to the axes.
    pub(crate) fn world_to_axes(&self, pose: &Isometry3<f64>, target: &Isometry3<f64>) -> Matrix3<f64> {
        match self.axes {
            PoseAxes::Frame => pose.rotation.inverse().to_rotation_matrix().into_inner(),
            PoseAxes::Target => target.rotation.inverse().to_rotation_matrix().into_inner(),
            PoseAxes::World => Matrix3::identity(),
        }
    }

    /// Angular velocity of the axes: `frame` for frame axes, `target` for target axes, zero for the world.
    pub(crate) fn turning(&self, frame: Vector3<f64>, target: Vector3<f64>) -> Vector3<f64> {
        match self.axes {
            PoseAxes::Frame => frame,
            PoseAxes::Target => target,
            PoseAxes::World => Vector3::zeros(),
        }
    }

    /// Returns `true` if the axes turn with the frame.
    pub(crate) fn follow_frame(&self) -> bool {
        self.axes == PoseAxes::Frame
    }

    /// Returns `S v` for a vector in the axes.
    pub(crate) fn weigh(&self, linear: &Vector3<f64>, angular: &Vector3<f64>) -> Vector6<f64> {
        stacked((self.position.shares * linear, self.orientation.shares * angular))
    }

    /// `S`: the factors of the position and of the orientation.
    pub(crate) fn factors(&self) -> [Matrix3<f64>; 2] {
        [self.position.shares, self.orientation.shares]
    }

    /// Returns 1 for each row of `S` with a factor, otherwise 0.
    pub(crate) fn rows(&self) -> Vector6<f64> {
        let counts = |part: &Part| {
            let of =
                |row: usize| if part.shares.row(row).iter().any(|share| *share != 0.0) { 1.0 } else { 0.0 };
            Vector3::new(of(0), of(1), of(2))
        };
        stacked((counts(&self.position), counts(&self.orientation)))
    }
}

/// The linear and the angular part of a pose error as one vector.
pub(super) fn stacked((linear, angular): (Vector3<f64>, Vector3<f64>)) -> Vector6<f64> {
    Twist { linear, angular }.vector()
}

with_defaults! {
    /// Weight factors for the axes of a pose.
    ///
    /// ```toml
    /// axes = { of = "world", position = [0.0, 0.0, 1.0], orientation = [1.0, 1.0, 0.0] }
    /// ```
    #[derive(Debug, Clone, Deserialize, JsonSchema)]
    #[serde(default, deny_unknown_fields)]
    pub struct AxesConfig;

    /// Axes in which the error is evaluated. Default "frame".
    pub of: PoseAxes = PoseAxes::default();
    /// Factors of `position_weight`: one number per axis, 0 to 1, or a matrix whose rows are directions, with
    /// entries from -1 to 1. Default [1, 1, 1].
    pub position: SharesConfig = SharesConfig::default();
    /// Factors of `orientation_weight`, for the rotations about the axes. Default [1, 1, 1].
    pub orientation: SharesConfig = SharesConfig::default();
}

/// Weight factors for three axes.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected three numbers, one for each axis, or a matrix of three rows")]
pub enum SharesConfig {
    /// One factor per axis; 0 leaves the axis free.
    Each([f64; 3]),
    /// A matrix; each row is a direction whose error has a cost.
    Matrix([[f64; 3]; 3]),
}

impl Default for SharesConfig {
    fn default() -> Self {
        Self::Each([1.0; 3])
    }
}

impl SharesConfig {
    fn matrix(&self, context: &TaskContext<'_>, name: &str) -> Result<Matrix3<f64>, ConfigError> {
        let key = format!("axes.{name}");
        match self {
            Self::Each(shares) => {
                for share in shares {
                    context.in_range(&key, *share, 0.0..=1.0)?;
                }
                Ok(Matrix3::from_diagonal(&(*shares).into()))
            }
            Self::Matrix(rows) => {
                for share in rows.iter().flatten() {
                    context.in_range(&key, *share, -1.0..=1.0)?;
                }
                Ok(Matrix3::from_row_slice(rows.as_flattened()))
            }
        }
    }
}

impl AxesConfig {
    /// Converts and checks the factors.
    pub(super) fn shares(&self, context: &TaskContext<'_>) -> Result<AxisShares, ConfigError> {
        let position = self.position.matrix(context, "position")?;
        let shares =
            AxisShares::matrices(self.of, position, self.orientation.matrix(context, "orientation")?);
        if !shares.has_position() && !shares.has_orientation() {
            return Err(ConfigError::key(
                context.key("axes"),
                "no axis has a factor, so the whole pose is free",
            )
            .advise(
                "give at least one axis a factor, such as `position = [1, 1, 0]`, or leave the task out",
            ));
        }
        Ok(shares)
    }
}
