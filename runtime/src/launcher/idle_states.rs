//! The limit on idle states of all cores while real-time components run.

use std::time::Duration;

use super::{Hosting, LaunchError};
use crate::os::IdleLimit;
use crate::plan::{ClockKind, OnDenied, Plan, SchedulingClass};

/// Limit above which nothing is requested, ns: every idle state is faster.
const ANY_NS: u64 = 1_000_000_000;

/// The limit on idle states that a plan requests, and the system's answer.
#[derive(Debug, Default)]
pub(super) struct IdleStates {
    _limit: Option<IdleLimit>,
    /// Limit in force, ns; `None` if none was requested or the system denied it.
    pub(super) exit_ns: Option<u64>,
    /// Reason why the system denied the limit; `None` if it did not.
    pub(super) denied: Option<String>,
}

impl IdleStates {
    /// Requests the limit of a plan until this value is dropped or the process dies. Without effect if the
    /// components are threads of one process, which have no priorities.
    ///
    /// # Errors
    /// The system denied the limit, and the plan is strict.
    pub(super) fn request(plan: &Plan, hosting: Hosting) -> Result<Self, LaunchError> {
        let this = if hosting == Hosting::Processes { Self::begin(plan) } else { Self::default() };
        match &this.denied {
            Some(reason) if plan.scheduling.on_denied == OnDenied::Strict => Err(LaunchError::System {
                what: "limiting idle states (/dev/cpu_dma_latency)",
                reason: reason.clone(),
            }),
            _ => Ok(this),
        }
    }

    fn begin(plan: &Plan) -> Self {
        let exit_ns = plan.scheduling.idle_exit_ns;
        let waits = plan.components.iter().any(|component| component.class != SchedulingClass::Normal);
        if plan.clock != ClockKind::Realtime || !waits || exit_ns >= ANY_NS {
            return Self::default();
        }
        match IdleLimit::hold(Duration::from_nanos(exit_ns)) {
            Ok(limit) => Self { _limit: Some(limit), exit_ns: Some(exit_ns), denied: None },
            Err(error) => Self { denied: Some(error.to_string()), ..Self::default() },
        }
    }
}
