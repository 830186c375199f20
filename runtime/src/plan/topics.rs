//! Topics of a plan, and the latency budgets between them.

use serde::{Deserialize, Serialize};

use crate::declare::TopicPattern;
use crate::state::TypeLayout;

/// A resolved topic.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TopicPlan {
    /// Name, such as `panda/joint_state`.
    pub name: String,
    /// Delivery pattern: state, stream or slices.
    pub pattern: TopicPattern,
    /// Layout of the samples.
    pub layout: TypeLayout,
    /// Index of the writing component.
    pub writer: usize,
    /// Indices of the reading components.
    pub readers: Vec<usize>,
    /// Indices of the components that the topic triggers.
    pub triggers: Vec<usize>,
    /// Number of values of a state that are kept for taps, in addition to the values that readers need.
    #[serde(default)]
    pub history: usize,
}

/// An end-to-end latency budget between two topics.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LatencyPlan {
    /// Index of the topic at the head of the chain.
    pub from: usize,
    /// Index of the topic at the end of the chain.
    pub to: usize,
    /// Maximum latency, from the source time of `from` to the publish time of `to`, ns.
    pub max_ns: u64,
    /// Policy for a latency above the budget.
    pub on_miss: OnMiss,
    /// Index of the component that publishes `to` and therefore measures the latency.
    pub component: usize,
    /// Index of `to` in that component's outputs.
    pub output: usize,
}

/// Policy for a latency above its budget.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnMiss {
    /// Count and report the miss.
    Warn,
    /// Bring the whole graph to its safe state.
    SafeStop,
}
