//! Numbers in the description of a policy: one number for all elements, or one number for each element.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::PolicyError;

/// One number for all elements, or one per element.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(untagged, expecting = "expected one number, or a list of numbers")]
pub enum Numbers {
    /// The same number for all elements.
    All(f64),
    /// One number per element, in the order of the policy's joints or of the term's values.
    Each(Vec<f64>),
}

impl Numbers {
    /// Returns the number for the element `index`.
    ///
    /// # Panics
    ///
    /// If `index` is beyond the end of the list.
    pub fn get(&self, index: usize) -> f64 {
        match self {
            Self::All(value) => *value,
            Self::Each(values) => values[index],
        }
    }

    pub(super) fn check(&self, key: &str, count: usize) -> Result<(), PolicyError> {
        match self {
            Self::Each(values) if values.len() != count => Err(PolicyError::Value {
                key: key.to_owned(),
                message: format!("found {} numbers, expected 1 or {count}", values.len()),
            }),
            _ => finite(key, (0..count).map(|index| self.get(index))),
        }
    }
}

pub(super) fn one() -> Numbers {
    Numbers::All(1.0)
}

pub(super) fn zero() -> Numbers {
    Numbers::All(0.0)
}

pub(super) fn finite(key: &str, mut values: impl Iterator<Item = f64>) -> Result<(), PolicyError> {
    match values.find(|value| !value.is_finite()) {
        Some(value) => Err(PolicyError::Value {
            key: key.to_owned(),
            message: format!("found {value}, expected finite numbers"),
        }),
        None => Ok(()),
    }
}
