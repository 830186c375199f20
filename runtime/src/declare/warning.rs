//! Warnings of a component about its own configuration.

use serde::{Deserialize, Serialize};

/// A warning about a component's configuration that is valid but probably unintended.
///
/// ```
/// use motorium::declare::Declare;
///
/// let mut declare = Declare::new(None);
/// declare.warn("a noise of 3 rad, more than the range of the joint").key("noise").advise("0.003 is usual");
/// let warning = &declare.into_declaration().warnings[0];
/// assert_eq!((warning.key.as_deref(), warning.advice.as_deref()), (Some("noise"), Some("0.003 is usual")));
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeclareWarning {
    /// Affected key of the `config` table, dotted; `None` if the warning concerns the component as a whole.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub key: Option<String>,
    /// Description of the finding and of its consequence.
    pub message: String,
    /// Advice in one sentence, or `None`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub advice: Option<String>,
}

impl DeclareWarning {
    /// Creates a warning about the component as a whole.
    pub(super) fn new(message: impl Into<String>) -> Self {
        Self { key: None, message: message.into(), advice: None }
    }

    /// Sets the affected key of the `config` table, dotted, such as `goals[0].duration`.
    pub fn key(&mut self, key: impl Into<String>) -> &mut Self {
        self.key = Some(key.into());
        self
    }

    /// Adds advice in one sentence.
    pub fn advise(&mut self, advice: impl Into<String>) -> &mut Self {
        self.advice = Some(advice.into());
        self
    }
}
