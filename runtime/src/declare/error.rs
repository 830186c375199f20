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
    /// Dotted path of the invalid key in the `config` table; `None` if the error concerns several keys.
    pub key: Option<String>,
    /// Message with the found value and the expected values.
    pub message: String,
    /// Advice on how to correct the configuration, or `None`.
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

    /// Adds advice on how to correct the configuration.
    #[must_use]
    pub fn advise(mut self, advice: impl Into<String>) -> Self {
        self.advice = Some(advice.into());
        self
    }
}

/// Error of a step. Owns no heap memory unless its message is formatted at run time.
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
    /// An output received an invalid value, which was not published.
    #[error("output `{port}`: {defect}")]
    InvalidOutput {
        /// Name of the output port.
        port: &'static str,
        /// Defect of the value.
        defect: Defect,
    },
    /// The transport could not provide memory for a sample, or could not publish it.
    #[error("output `{port}`: {reason}")]
    Transport {
        /// Name of the output port.
        port: &'static str,
        /// Reason given by the transport.
        reason: &'static str,
    },
    /// The source time of a sample is more than 1 ms in the future. The sample was not published.
    #[error("output `{port}`: the source time is {ahead_ns} ns in the future, expected at most 1 ms")]
    SourceInFuture {
        /// Name of the output port.
        port: &'static str,
        /// Difference between the source time and the current time, ns.
        ahead_ns: u64,
    },
    /// A failure that has no separate variant, with the component's message.
    #[error("{0}")]
    Failed(Cow<'static, str>),
}

impl StepError {
    /// Creates an error with this message.
    pub fn failed(message: impl Into<Cow<'static, str>>) -> Self {
        Self::Failed(message.into())
    }
}
