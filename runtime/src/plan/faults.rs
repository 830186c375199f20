//! Consequences of faults of one component: late and failed steps, crashes, hangs.

use serde::{Deserialize, Serialize};

/// The consequence of a step that ran past the next release.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnOverrun {
    /// Drop the missed releases; continue with the next future release on the grid.
    Skip,
    /// Run the missed releases immediately, one after the other, until the component is back on the grid.
    CatchUp,
    /// Restart the grid at the end of the late step.
    Rephase,
    /// Like `skip`, and withhold the outputs of the late step: readers keep the older value.
    Hold,
    /// Bring the whole graph to its safe state.
    SafeStop,
}

/// Policy for a step that returned an error or produced an invalid output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnError {
    /// The component fails; `restart` and `on_failure` take effect.
    Fail,
    /// Report and count the error; the component continues, its readers keep the older value.
    Hold,
}

/// Policy for a component that failed and is not restarted, or not again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnFailure {
    /// Bring the whole graph to its safe state and end the run.
    SafeStop,
    /// Continue without the component.
    Ignore,
}

/// Condition of a restart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RestartWhen {
    /// Never.
    Never,
    /// After a crash, an error or a kill.
    Failure,
    /// After every end, including a normal one.
    Always,
}

/// Restart policy.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct RestartPlan {
    /// The condition.
    pub when: RestartWhen,
    /// Maximum number of restarts within `window_ns`.
    pub at_most: u32,
    /// The window over which restarts are counted, ns.
    pub window_ns: u64,
    /// Time within which a restarted component must step again, ns; otherwise it has failed again.
    pub within_ns: u64,
}

/// Limits of one component on time without a step, computing time and lost steps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LivenessPlan {
    /// Time without a due step after which it counts as hung, ns.
    pub hang_after_ns: u64,
    /// Time it may compute without waiting before the kernel kills it, ns; `None` unless its class is
    /// `SCHED_FIFO`.
    pub cpu_limit_ns: Option<u64>,
    /// Share of lost steps, 0 to 1, above which there is a warning.
    pub lost_steps: f64,
}

impl Default for LivenessPlan {
    /// Returns unreachable limits.
    fn default() -> Self {
        Self { hang_after_ns: u64::MAX, cpu_limit_ns: None, lost_steps: 1.0 }
    }
}
