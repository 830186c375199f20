//! Declared parameters and their values.

use serde::{Deserialize, Serialize};

/// The type of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ParameterKind {
    /// A 64-bit float.
    Float,
    /// A 64-bit signed integer.
    Integer,
    /// True or false.
    Boolean,
}

/// The value of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(untagged)]
pub enum ParameterValue {
    /// True or false.
    Boolean(bool),
    /// A 64-bit signed integer.
    Integer(i64),
    /// A 64-bit float.
    Float(f64),
}

impl ParameterValue {
    /// The kind of this value.
    pub fn kind(&self) -> ParameterKind {
        match self {
            Self::Boolean(_) => ParameterKind::Boolean,
            Self::Integer(_) => ParameterKind::Integer,
            Self::Float(_) => ParameterKind::Float,
        }
    }
}

impl From<f64> for ParameterValue {
    fn from(value: f64) -> Self {
        Self::Float(value)
    }
}

impl From<i64> for ParameterValue {
    fn from(value: i64) -> Self {
        Self::Integer(value)
    }
}

impl From<bool> for ParameterValue {
    fn from(value: bool) -> Self {
        Self::Boolean(value)
    }
}

impl core::fmt::Display for ParameterValue {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Boolean(value) => write!(f, "{value}"),
            Self::Integer(value) => write!(f, "{value}"),
            Self::Float(value) => write!(f, "{value}"),
        }
    }
}

/// A declared parameter: a value that may change while the component runs, applied between two steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ParameterDeclaration {
    /// Name of the parameter, unique in its component.
    pub name: String,
    /// Value unless the graph file sets another.
    pub default: ParameterValue,
    /// Smallest value allowed.
    pub min: Option<f64>,
    /// Largest value allowed.
    pub max: Option<f64>,
    /// Unit, or empty.
    pub unit: String,
    /// One line of explanation.
    pub doc: String,
}

impl ParameterDeclaration {
    /// Checks a value against type and range; an integer is accepted for a float.
    ///
    /// # Errors
    /// A text with the value found and the values expected.
    pub fn admit(&self, value: ParameterValue) -> Result<ParameterValue, String> {
        let value = match (self.default.kind(), value) {
            (ParameterKind::Float, ParameterValue::Integer(i)) => ParameterValue::Float(i as f64),
            (_, value) => value,
        };
        if value.kind() != self.default.kind() {
            return Err(format!(
                "parameter `{}` is {value}, expected {}",
                self.name,
                match self.default.kind() {
                    ParameterKind::Float => "a number",
                    ParameterKind::Integer => "a whole number",
                    ParameterKind::Boolean => "true or false",
                }
            ));
        }
        let number = match value {
            ParameterValue::Float(x) => x,
            ParameterValue::Integer(i) => i as f64,
            ParameterValue::Boolean(_) => return Ok(value),
        };
        let (low, high) = (self.min.unwrap_or(f64::NEG_INFINITY), self.max.unwrap_or(f64::INFINITY));
        if !number.is_finite() || number < low || number > high {
            let range = match (self.min, self.max) {
                (Some(low), Some(high)) => format!("from {low} to {high}"),
                (Some(low), None) => format!("at least {low}"),
                (None, Some(high)) => format!("at most {high}"),
                (None, None) => "a finite number".to_string(),
            };
            return Err(format!("parameter `{}` is {value}, expected {range}", self.name));
        }
        Ok(value)
    }
}
