//! Keeping all cores awake, or nearly, while real-time components wait for their time.

use std::time::Duration;

use super::{Hosting, Launch, LaunchError};
use crate::os::IdleLimit;
use crate::plan::{ClockKind, OnDenied, Plan, SchedulingClass};

/// No idle state takes this long to leave: then there is nothing to ask for, ns.
const ANY_NS: u64 = 1_000_000_000;

/// What became of the limit on idle states that a plan asks for.
#[derive(Debug, Default)]
pub(super) struct Idling {
    _limit: Option<IdleLimit>,
    /// Nothing was asked for, or it was denied: `None`; ns.
    pub(super) exit_ns: Option<u64>,
    /// Why it was denied.
    pub(super) denied: Option<String>,
}

impl Idling {
    /// Asks for the limit of a plan; it holds until this is dropped, when all components have ended, or this process dies.
    pub(super) fn begin(plan: &Plan) -> Self {
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

impl Launch<'_> {
    /// Threads of one process have no priorities, and need no cores that are awake.
    pub(super) fn limit_idling(&mut self) -> Result<(), LaunchError> {
        if self.options.hosting == Hosting::Processes {
            self.idling = Idling::begin(&self.plan);
        }
        match &self.idling.denied {
            Some(reason) if self.plan.scheduling.on_denied == OnDenied::Strict => Err(LaunchError::System {
                what: "limiting idle states (/dev/cpu_dma_latency)",
                reason: reason.clone(),
            }),
            _ => Ok(()),
        }
    }
}
