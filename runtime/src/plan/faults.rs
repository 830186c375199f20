//! Consequences of a component's faults: late and failed steps, crashes, hangs.

use serde::{Deserialize, Serialize};

/// Policy for a step that ran past the next release.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnOverrun {
    /// Drop the missed releases, and continue with the next release on the original time grid.
    Skip,
    /// Run the missed releases immediately, one after the other, until the component is back on its original
    /// time grid.
    CatchUp,
    /// Restart the time grid of the releases at the end of the late step.
    Rephase,
    /// Same as `skip`, and withhold the outputs of the late step: readers keep the previous value.
    Hold,
    /// Bring the whole graph to its safe state.
    SafeStop,
}

/// Policy for a step that returned an error or produced an invalid output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnError {
    /// The component fails, and its policies `restart` and `on_failure` take effect.
    Fail,
    /// Report and count the error. The component continues, and its readers keep the previous value.
    Hold,
}

/// Policy for a component that has failed and will not be restarted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnFailure {
    /// Bring the whole graph to its safe state and end the run.
    SafeStop,
    /// Continue without the component.
    Ignore,
}

/// Condition under which a component is restarted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RestartWhen {
    /// The component is never restarted.
    Never,
    /// The component is restarted after a crash, an error or a kill.
    Failure,
    /// The component is restarted after every end, including a normal one.
    Always,
}

/// Restart policy of a component.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct RestartPlan {
    /// Condition under which the component is restarted.
    pub when: RestartWhen,
    /// Maximum number of restarts within `window_ns`.
    pub at_most: u32,
    /// Time window over which restarts are counted, ns.
    pub window_ns: u64,
    /// Time within which a restarted component must complete a step, ns. A component that takes longer counts
    /// as failed again.
    pub within_ns: u64,
}

/// Limits that detect a component which hangs or falls behind: time without a step, computing time, and lost
/// steps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LivenessPlan {
    /// Time for which a due step may be missing before the component counts as hung, ns.
    pub hang_after_ns: u64,
    /// Time for which the component may compute without sleeping before the kernel kills it, ns; `None`
    /// unless its class is `SCHED_FIFO`.
    pub cpu_limit_ns: Option<u64>,
    /// Fraction of lost steps, 0 to 1, above which a warning is printed.
    pub lost_steps: f64,
}

impl Default for LivenessPlan {
    /// Returns limits that are never reached.
    fn default() -> Self {
        Self { hang_after_ns: u64::MAX, cpu_limit_ns: None, lost_steps: 1.0 }
    }
}
