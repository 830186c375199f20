//! Checks of the gains of joint drives.

use motorium_robots::{Gains, Model};

/// Error returned when gains are invalid for the joint drives of a model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GainsError {
    /// The number of entries differs from the number of joints.
    #[error("{gain} has {found} entries, expected {expected}: one per independent joint")]
    Length {
        /// Name of the gain, `kp` or `kd`.
        gain: &'static str,
        /// Number of entries found.
        found: usize,
        /// Number of entries expected.
        expected: usize,
    },
    /// A gain is negative or not finite.
    #[error("{gain} of joint \"{joint}\" is {value}, expected a finite number >= 0")]
    Value {
        /// Name of the gain, `kp` or `kd`.
        gain: &'static str,
        /// Name of the joint.
        joint: String,
        /// Value of the gain.
        value: f64,
    },
}

impl GainsError {
    /// Returns the name of the invalid gain, `kp` or `kd`.
    pub fn gain(&self) -> &'static str {
        match self {
            Self::Length { gain, .. } | Self::Value { gain, .. } => gain,
        }
    }
}

/// Checks that `kp` and `kd` each have one finite number of at least 0 for each independent joint of `model`.
///
/// # Errors
/// [`GainsError`] names the first invalid gain.
pub fn check_gains(model: &Model, gains: &Gains) -> Result<(), GainsError> {
    for (gain, values) in [("kp", &gains.kp), ("kd", &gains.kd)] {
        let (found, expected) = (values.len(), model.joint_count());
        if found != expected {
            return Err(GainsError::Length { gain, found, expected });
        }
        if let Some(index) = values.iter().position(|value| !value.is_finite() || *value < 0.0) {
            let joint = model.joint_names()[index].clone();
            return Err(GainsError::Value { gain, joint, value: values[index] });
        }
    }
    Ok(())
}
