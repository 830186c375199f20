//! Model of a primitive: settings, weights and displacement of the demonstration.

use nalgebra::{DMatrix, DVector};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::kernels::{Gate, Kernels};
use super::settings::{ModelError, Settings, Variant};
use super::spring::CriticalSpring;
use crate::ValueError;

/// A discrete primitive without run-time state. The model does not change during a movement.
///
/// Weights are in the unit of the movement: the forcing term is an acceleration in normalised time (unit of y
/// per duration squared), or a displacement (unit of y) for [`Variant::GoalSafe`]. The weights do not depend
/// on the duration. Serialises as [`StoredModel`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredModel", into = "StoredModel")]
pub struct DmpModel {
    settings: Settings,
    kernels: Kernels,
    weights: DMatrix<f64>,
    displacement: DVector<f64>,
}

impl DmpModel {
    /// Creates a primitive without a forcing term: a smooth reach. `dimensions` must be at least 1. The
    /// displacement is 1 in each dimension.
    ///
    /// # Errors
    /// [`ModelError`] if a setting is out of range, or there is no dimension.
    pub fn new(dimensions: usize, settings: Settings) -> Result<Self, ModelError> {
        let kernels = settings.kernels;
        Self::with_weights(
            settings,
            DMatrix::zeros(kernels, dimensions),
            DVector::from_element(dimensions, 1.0),
        )
    }

    /// Creates a primitive from weights (kernels x dimensions) and the displacement `g - y0` for which the
    /// weights were learned.
    ///
    /// # Errors
    /// [`ModelError`] if a setting is out of range, sizes do not match, or a number is not finite.
    pub fn with_weights(
        settings: Settings,
        weights: DMatrix<f64>,
        displacement: DVector<f64>,
    ) -> Result<Self, ModelError> {
        settings.check()?;
        let size = |name, found, expected| ModelError::Value(ValueError::Size { name, found, expected });
        if weights.ncols() == 0 {
            return Err(ModelError::Value(ValueError::OutOfRange {
                name: "dimensions",
                value: 0.0,
                expected: "at least 1",
            }));
        }
        if weights.nrows() != settings.kernels {
            return Err(size("a column of weights", weights.nrows(), settings.kernels));
        }
        if displacement.len() != weights.ncols() {
            return Err(size("displacement", displacement.len(), weights.ncols()));
        }
        for (name, values) in [("weights", weights.as_slice()), ("displacement", displacement.as_slice())] {
            if let Some(&value) = values.iter().find(|value| !value.is_finite()) {
                return Err(ModelError::Value(ValueError::NotFinite { name, value }));
            }
        }
        let gate = match settings.variant {
            Variant::Classic | Variant::GoalSafe => Gate::Phase,
            Variant::QuinticGoal | Variant::FinalVelocity => Gate::Finite,
        };
        let kernels = Kernels::new(settings.kernels, settings.decay, settings.overlap, gate);
        Ok(Self { settings, kernels, weights, displacement })
    }

    /// Returns the number of dimensions.
    pub fn dimensions(&self) -> usize {
        self.weights.ncols()
    }

    /// Returns the settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Returns the kernels over the phase.
    pub fn kernels(&self) -> &Kernels {
        &self.kernels
    }

    /// Returns the weights, kernels x dimensions.
    pub fn weights(&self) -> &DMatrix<f64> {
        &self.weights
    }

    /// Returns the weights (kernels x dimensions), so that learners can change them. The number of weights is
    /// fixed.
    pub fn weights_mut(&mut self) -> nalgebra::DMatrixViewMut<'_, f64> {
        self.weights.as_view_mut()
    }

    /// Copies weights and displacement from a model of the same size.
    pub(super) fn copy_weights(&mut self, other: &Self) {
        self.weights.copy_from(&other.weights);
        self.displacement.copy_from(&other.displacement);
    }

    /// Returns the displacement `g - y0` for which the weights were learned.
    pub fn displacement(&self) -> &DVector<f64> {
        &self.displacement
    }

    /// Returns the transformation system: the spring that pulls the motion to the goal.
    pub fn spring(&self) -> CriticalSpring {
        CriticalSpring::new(self.settings.damping)
    }

    /// Divisor that turns weighted features into an equilibrium of the spring.
    pub(super) fn forcing_divisor(&self) -> f64 {
        match self.settings.variant {
            Variant::GoalSafe => 1.0,
            Variant::Classic | Variant::QuinticGoal | Variant::FinalVelocity => self.spring().stiffness(),
        }
    }
}

/// File format of a [`DmpModel`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StoredModel {
    /// Settings of the primitive.
    pub settings: Settings,
    /// Displacement `g - y0` of the demonstration, one entry per dimension.
    pub displacement: Vec<f64>,
    /// Weight of each kernel, for each dimension.
    pub weights: Vec<Vec<f64>>,
}

impl From<DmpModel> for StoredModel {
    fn from(model: DmpModel) -> Self {
        let weights = model.weights.column_iter().map(|column| column.iter().copied().collect()).collect();
        Self { weights, displacement: model.displacement.as_slice().to_vec(), settings: model.settings }
    }
}

impl TryFrom<StoredModel> for DmpModel {
    type Error = ModelError;

    fn try_from(stored: StoredModel) -> Result<Self, ModelError> {
        let kernels = stored.settings.kernels;
        if let Some(column) = stored.weights.iter().find(|column| column.len() != kernels) {
            return Err(ModelError::Value(ValueError::Size {
                name: "a dimension of weights",
                found: column.len(),
                expected: kernels,
            }));
        }
        let weights =
            DMatrix::from_iterator(kernels, stored.weights.len(), stored.weights.into_iter().flatten());
        Self::with_weights(stored.settings, weights, DVector::from_vec(stored.displacement))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn model_survives_json() {
        let mut model = DmpModel::new(2, Settings { kernels: 3, ..Settings::default() }).unwrap();
        model.weights_mut().copy_from_slice(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        let text = serde_json::to_string(&model).unwrap();
        assert_eq!(serde_json::from_str::<DmpModel>(&text).unwrap(), model);
    }

    #[test]
    fn missing_weight_is_rejected_with_both_counts() {
        let text = r#"{"settings": {"kernels": 3}, "displacement": [1.0], "weights": [[1.0, 2.0]]}"#;
        let error = serde_json::from_str::<DmpModel>(text).unwrap_err().to_string();
        assert!(error.contains("a dimension of weights has 2 entries, expected 3"), "{error}");
    }

    #[test]
    fn settings_out_of_range_are_rejected_by_name() {
        let refuse = |settings: Settings| DmpModel::new(1, settings).unwrap_err().to_string();
        assert_eq!(
            refuse(Settings { kernels: 1, ..Settings::default() }),
            "kernels = 1: expected at least 2"
        );
        assert!(refuse(Settings { overlap: 1.0, ..Settings::default() }).contains("overlap = 1"));
        assert!(refuse(Settings { damping: f64::NAN, ..Settings::default() }).contains("damping = NaN"));
        assert!(refuse(Settings { goal_rate: Some(2.0), ..Settings::default() }).contains("goal_rate"));
        assert!(DmpModel::new(0, Settings::default()).unwrap_err().to_string().contains("dimensions = 0"));
    }
}
