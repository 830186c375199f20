//! The severity of a problem found by a check: error or warning.

use serde::Serialize;

/// Severity of a problem found in a graph file, or in the timing analysis of a graph.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// The graph cannot run.
    Error,
    /// The graph runs, but probably not as intended.
    Warning,
}
