//! Errors of a configuration and of a step.

use std::borrow::Cow;

use crate::state::Defect;

/// A configuration that cannot work, found while the graph is checked.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct ConfigError {
    /// The key of the `config` table at fault, dotted, if one can be named.
    pub key: Option<String>,
    /// What was found and what was expected.
    pub message: String,
    /// What to try, if something can be advised.
    pub advice: Option<String>,
}

impl ConfigError {
    /// An error about one key of the `config` table.
    pub fn key(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self { key: Some(key.into()), message: message.into(), advice: None }
    }

    /// An error about the configuration as a whole.
    pub fn new(message: impl Into<String>) -> Self {
        Self { key: None, message: message.into(), advice: None }
    }

    /// Adds what to try.
    #[must_use]
    pub fn advise(mut self, advice: impl Into<String>) -> Self {
        self.advice = Some(advice.into());
        self
    }
}

/// A step that failed. Holds no heap memory unless its words were put together at run time.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StepError {
    /// An output held what must never be published; it was not published.
    #[error("output `{port}`: {defect}")]
    InvalidOutput {
        /// The port.
        port: &'static str,
        /// What was wrong with the sample.
        defect: Defect,
    },
    /// The transport refused to lend or send a sample.
    #[error("output `{port}`: {reason}")]
    Transport {
        /// The port.
        port: &'static str,
        /// What the transport said.
        reason: &'static str,
    },
    /// Anything else, in the component's own words.
    #[error("{0}")]
    Failed(Cow<'static, str>),
}

impl StepError {
    /// A failure in the component's own words.
    pub fn failed(message: impl Into<Cow<'static, str>>) -> Self {
        Self::Failed(message.into())
    }
}
