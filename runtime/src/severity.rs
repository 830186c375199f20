//! The severity of a finding of a check.

use serde::Serialize;

/// Severity of a finding in a graph file or in the analysis of the graph's schedule.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// The graph cannot run.
    Error,
    /// The graph runs, but probably not as intended.
    Warning,
}
