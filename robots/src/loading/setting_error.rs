//! Errors in the settings of a robot in a graph file.

/// Error of a robot setting in a graph file that does not match the robot.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("`{key}`: {message}")]
pub struct SettingError {
    /// Key of the setting: `joints`, `fixed`, `frame`, `start` or `gains`.
    pub key: &'static str,
    /// Reason for rejecting the value.
    pub message: String,
}

impl SettingError {
    pub(crate) fn new(key: &'static str, message: impl ToString) -> Self {
        Self { key, message: message.to_string() }
    }
}
