//! Topics of a plan, and the latency budgets between them.

use serde::{Deserialize, Serialize};

use crate::declare::TopicPattern;
use crate::state::TypeLayout;

/// A resolved topic.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TopicPlan {
    /// Name, such as `panda/joint_state`.
    pub name: String,
    /// State or stream.
    pub pattern: TopicPattern,
    /// Layout of its samples.
    pub layout: TypeLayout,
    /// Index of the writing component.
    pub writer: usize,
    /// Indices of the reading components.
    pub readers: Vec<usize>,
    /// Indices of the triggered components.
    pub triggers: Vec<usize>,
    /// Number of values of a state kept for taps, in addition to those needed by readers.
    #[serde(default)]
    pub history: usize,
}

/// An end-to-end latency budget.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LatencyPlan {
    /// Topic at the head of the chain.
    pub from: usize,
    /// Topic at its end.
    pub to: usize,
    /// Longest time allowed from the source time of `from` to the publish time of `to`, ns.
    pub max_ns: u64,
    /// The consequence of a miss.
    pub on_miss: OnMiss,
    /// Component that publishes `to` and therefore measures the latency.
    pub component: usize,
    /// Index of `to` in that component's outputs.
    pub output: usize,
}

/// The consequence of a missed latency budget.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnMiss {
    /// Count and report it.
    Warn,
    /// Bring the whole graph to its safe state.
    SafeStop,
}
