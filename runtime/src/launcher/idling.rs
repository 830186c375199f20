//! Keeping all cores awake, or nearly, while real-time components wait for their time.

use std::time::Duration;

use super::{Hosting, Launch};
use crate::os::IdleLimit;
use crate::plan::{ClockKind, Plan, SchedulingClass};

/// What became of the limit on idle states that a plan asks for.
#[derive(Debug, Default)]
pub(super) struct Idling {
    limit: Option<IdleLimit>,
    /// Nothing was asked for, or it was denied: `None`; ns.
    pub(super) exit_ns: Option<u64>,
    pub(super) is_denied: bool,
}

impl Idling {
    /// Asks for the limit of a plan; it holds until [`end`](Self::end) or until this process dies.
    pub(super) fn begin(plan: &Plan) -> Self {
        let waits = plan.components.iter().any(|component| component.class != SchedulingClass::Normal);
        if plan.clock != ClockKind::Realtime || !waits {
            return Self::default();
        }
        let exit_ns = plan.scheduling.idle_exit_ns;
        match IdleLimit::hold(Duration::from_nanos(exit_ns)) {
            Ok(limit) => Self { limit: Some(limit), exit_ns: Some(exit_ns), is_denied: false },
            Err(_) => Self { is_denied: true, ..Self::default() },
        }
    }

    /// Lets the cores idle as they like.
    pub(super) fn end(&mut self) {
        self.limit = None;
    }
}

impl Launch<'_> {
    /// Threads of one process have no priorities, and need no cores that are awake.
    pub(super) fn limit_idling(&mut self) {
        if self.options.hosting == Hosting::Processes {
            self.idling = Idling::begin(&self.plan);
        }
    }
}
