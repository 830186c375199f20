//! The consequences of faults of one component: late and failed steps, death, hanging.

use serde::{Deserialize, Serialize};

/// The consequence of a step that ran past the next release.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnOverrun {
    /// Drop the releases that have passed; go on with the next future one of the grid.
    Skip,
    /// Run the releases that have passed at once, one after the other, until the grid is met again.
    CatchUp,
    /// Start the grid anew at the end of the late step.
    Rephase,
    /// As `skip`, and withhold the outputs of the late step: readers keep the older value.
    Hold,
    /// Bring the whole graph to its safe state.
    SafeStop,
}

/// The consequence of a step that returned an error or made an invalid output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnError {
    /// The component fails; `restart` and `on_failure` take effect.
    Fail,
    /// Report and count the error; the component goes on, its readers keep the older value.
    Hold,
}

/// The consequence of a component that failed and is not restarted, or not again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnFailure {
    /// Bring the whole graph to its safe state and end the run.
    SafeStop,
    /// Go on without the component.
    Ignore,
}

/// The condition of a restart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RestartWhen {
    /// Never.
    Never,
    /// After a crash, an error or a kill.
    Failure,
    /// After every end, also one in good order.
    Always,
}

/// Restart policy.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct RestartPlan {
    /// The condition.
    pub when: RestartWhen,
    /// At most this many restarts within `window_ns`.
    pub at_most: u32,
    /// The window over which restarts are counted, ns.
    pub window_ns: u64,
    /// Time within which a restarted component must step again, ns; otherwise it has failed again.
    pub within_ns: u64,
}

/// Limits of one component on standing still, on computing, and on losing steps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LivenessPlan {
    /// Time without a step, although one was due, after which it has hung, ns.
    pub hang_after_ns: u64,
    /// Time for which it may compute without waiting before the kernel ends it, ns; `None` unless its class is
    /// `SCHED_FIFO`.
    pub cpu_limit_ns: Option<u64>,
    /// Share of its steps, 0 to 1, above which losing them is a warning.
    pub lost_steps: f64,
}

impl Default for LivenessPlan {
    /// Limits that nothing reaches.
    fn default() -> Self {
        Self { hang_after_ns: u64::MAX, cpu_limit_ns: None, lost_steps: 1.0 }
    }
}
