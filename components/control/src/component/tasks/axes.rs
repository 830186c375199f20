//! The table `axes` of a Cartesian task.

use motorium::prelude::*;
use nalgebra::Matrix3;
use schemars::JsonSchema;
use serde::Deserialize;

use super::TaskPlace;
use crate::tasks::{AxisShares, PoseAxes};

/// Factors of the weights of a pose by axis.
///
/// ```toml
/// axes = { of = "world", position = [0.0, 0.0, 1.0], orientation = [1.0, 1.0, 0.0] }
/// ```
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AxesConfig {
    /// Axes in which the error is counted. Default "frame".
    pub of: PoseAxes,
    /// Factors of `position_weight`: one for each axis, 0 to 1, or a matrix, each row a direction, -1 to 1.
    /// Default [1, 1, 1].
    pub position: SharesConfig,
    /// Factors of `orientation_weight`, for the rotations about the axes. Default [1, 1, 1].
    pub orientation: SharesConfig,
}

/// Factors of three axes.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected three numbers, one for each axis, or a matrix of three rows")]
pub enum SharesConfig {
    /// One factor per axis; 0 leaves the axis free.
    Each([f64; 3]),
    /// A matrix: each row a direction whose error costs.
    Matrix([[f64; 3]; 3]),
}

impl Default for SharesConfig {
    fn default() -> Self {
        Self::Each([1.0; 3])
    }
}

impl Default for AxesConfig {
    fn default() -> Self {
        let all = SharesConfig::default();
        Self { of: PoseAxes::default(), position: all, orientation: all }
    }
}

impl SharesConfig {
    fn matrix(&self, place: &TaskPlace<'_>, name: &str) -> Result<Matrix3<f64>, ConfigError> {
        let key = format!("axes.{name}");
        match self {
            Self::Each(shares) => {
                for share in shares {
                    place.in_range(&key, *share, 0.0..=1.0)?;
                }
                Ok(Matrix3::from_diagonal(&(*shares).into()))
            }
            Self::Matrix(rows) => {
                for share in rows.iter().flatten() {
                    place.in_range(&key, *share, -1.0..=1.0)?;
                }
                Ok(Matrix3::from_row_slice(rows.as_flattened()))
            }
        }
    }
}

impl AxesConfig {
    /// The factors, checked.
    pub(super) fn shares(&self, place: &TaskPlace<'_>) -> Result<AxisShares, ConfigError> {
        let position = self.position.matrix(place, "position")?;
        let shares = AxisShares::matrices(self.of, position, self.orientation.matrix(place, "orientation")?);
        if !shares.has_position() && !shares.has_orientation() {
            return Err(ConfigError::key(place.key("axes"), "they leave the whole pose free")
                .advise("give some axis a factor, such as `position = [1, 1, 0]`, or leave the task out"));
        }
        Ok(shares)
    }
}
