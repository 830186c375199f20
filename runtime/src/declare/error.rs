//! Errors of a configuration and of a step.

use std::borrow::Cow;

use crate::state::Defect;

/// Error of an invalid configuration, found when the graph is checked.
///
/// ```
/// use motorium::declare::ConfigError;
///
/// let error = ConfigError::key("radius", "0.9 m, expected 0 to 0.5 m").advise("the arm reaches 0.85 m");
/// assert_eq!(error.key.as_deref(), Some("radius"));
/// ```
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct ConfigError {
    /// The key of the `config` table at fault, dotted, if one can be named.
    pub key: Option<String>,
    /// Found value and expected values.
    pub message: String,
    /// Advice, if there is any.
    pub advice: Option<String>,
}

impl ConfigError {
    /// Creates an error about one key of the `config` table.
    pub fn key(key: impl Into<String>, message: impl Into<String>) -> Self {
        Self { key: Some(key.into()), message: message.into(), advice: None }
    }

    /// Creates an error about the configuration as a whole.
    pub fn new(message: impl Into<String>) -> Self {
        Self { key: None, message: message.into(), advice: None }
    }

    /// Adds advice.
    #[must_use]
    pub fn advise(mut self, advice: impl Into<String>) -> Self {
        self.advice = Some(advice.into());
        self
    }
}

/// Error of a step. It owns no heap memory unless its message is formatted at run time.
///
/// ```
/// use motorium::declare::StepError;
///
/// fn check(joints: usize) -> Result<(), StepError> {
///     if joints == 7 { Ok(()) } else { Err(StepError::failed("the state has another number of joints")) }
/// }
/// assert_eq!(check(6).unwrap_err().to_string(), "the state has another number of joints");
/// ```
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum StepError {
    /// An output contained an invalid value, which was not published.
    #[error("output `{port}`: {defect}")]
    InvalidOutput {
        /// The port.
        port: &'static str,
        /// The defect of the sample.
        defect: Defect,
    },
    /// The transport refused to lend or send a sample.
    #[error("output `{port}`: {reason}")]
    Transport {
        /// The port.
        port: &'static str,
        /// The transport's reason.
        reason: &'static str,
    },
    /// The source time of an output is in the future; the sample was not published.
    #[error("output `{port}`: its source time is {ahead_ns} ns in the future")]
    SourceInFuture {
        /// The port.
        port: &'static str,
        /// Time ahead of the clock, ns.
        ahead_ns: u64,
    },
    /// Any other failure, with the component's message.
    #[error("{0}")]
    Failed(Cow<'static, str>),
}

impl StepError {
    /// Creates an error with a message.
    pub fn failed(message: impl Into<Cow<'static, str>>) -> Self {
        Self::Failed(message.into())
    }
}
