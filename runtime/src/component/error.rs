//! Errors of configuring a component.

use crate::declare::ConfigError;
use crate::transport::PortError;

/// Error of configuring a component.
#[derive(Debug, thiserror::Error)]
pub enum ConfigureError {
    /// The configuration is invalid.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A port could not be opened.
    #[error(transparent)]
    Port(#[from] PortError),
    /// A failure that has no separate variant, with the component's message.
    #[error("{0}")]
    Failed(String),
}

impl ConfigureError {
    /// Returns the message, followed by the advice if the error has one.
    pub(crate) fn with_advice(&self) -> String {
        match self {
            Self::Config(ConfigError { advice: Some(advice), .. }) => format!("{self}; {advice}"),
            _ => self.to_string(),
        }
    }

    /// Creates an error with this message.
    pub fn failed(message: impl core::fmt::Display) -> Self {
        Self::Failed(message.to_string())
    }
}
