//! Errors of ranges.

/// A range is invalid.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{key}`: {message}")]
pub struct RangeError {
    /// Dotted key in the `randomise` table.
    pub key: String,
    /// Actual and expected values.
    pub message: String,
    /// Suggested action.
    pub advice: Option<String>,
}

impl RangeError {
    pub(super) fn new(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self { key: key.into(), message: message.into(), advice: None }
    }

    pub(super) fn advise(mut self, advice: impl Into<String>) -> Self {
        self.advice = Some(advice.into());
        self
    }
}
