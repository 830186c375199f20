//! The order of the ticks of lockstep: which component steps next, and for which time.
//!
//! Simulated time goes from round to round: a round is a time at which a time-triggered component is due. Within a round
//! each component is looked at once, in the order of the plan: a time-triggered one steps if the round is one of its
//! releases, a triggered one if its topic was published since it was looked at last.

use std::sync::atomic::Ordering::{Acquire, Relaxed};

use crate::plan::{Activation, Plan};
use crate::region::Region;

/// The order of the ticks of a plan. All it remembers stands in the control block of the run.
#[derive(Debug, Clone)]
pub(crate) struct Rounds {
    turns: Vec<Turn>,
}

/// One component in the order.
#[derive(Debug, Clone, Copy)]
struct Turn {
    component: usize,
    due: Due,
}

/// The times at which a component steps.
#[derive(Debug, Clone, Copy)]
enum Due {
    At {
        phase_ns: u64,
        period_ns: u64,
    },
    /// When the topic of this index was published.
    After(usize),
    /// Never: there are no events in simulated time, and `check` refuses such a graph.
    Never,
}

impl Rounds {
    /// The order of the components of a plan that `takes_part`.
    pub(crate) fn new(plan: &Plan, takes_part: impl Fn(usize) -> bool) -> Self {
        let mut order: Vec<usize> = (0..plan.components.len()).filter(|index| takes_part(*index)).collect();
        order.sort_by_key(|index| plan.components[*index].order);
        let turn = |component: usize| {
            let due = match plan.components[component].activation {
                Activation::Periodic { period_ns, phase_ns } => Due::At { phase_ns, period_ns },
                Activation::Triggered { topic, .. } => Due::After(topic),
                Activation::Descriptor { .. } => Due::Never,
            };
            Turn { component, due }
        };
        Self { turns: order.into_iter().map(turn).collect() }
    }

    /// The time of the first round not before `time_ns`; `u64::MAX` if there is none.
    pub(crate) fn round_from(&self, time_ns: u64) -> u64 {
        let next = |turn: &Turn| match turn.due {
            Due::At { phase_ns, period_ns } => {
                let since = time_ns.saturating_sub(phase_ns);
                phase_ns.saturating_add(since.div_ceil(period_ns).saturating_mul(period_ns))
            }
            Due::After(_) | Due::Never => u64::MAX,
        };
        self.turns.iter().map(next).min().unwrap_or(u64::MAX)
    }

    /// The place in the order, from `from` on, and the index of the next component that is due in the round of `time_ns`.
    pub(crate) fn next_due(&self, region: &Region, time_ns: u64, from: usize) -> Option<(usize, usize)> {
        let mut places = self.turns.iter().enumerate().skip(from);
        places.find_map(|(place, turn)| {
            let is_due = match turn.due {
                Due::At { phase_ns, period_ns } => {
                    time_ns >= phase_ns && (time_ns - phase_ns).is_multiple_of(period_ns)
                }
                Due::After(topic) => {
                    let published = region.topics()[topic].published.load(Acquire);
                    let seen = &region.components()[turn.component].trigger_seen;
                    let is_due = published != seen.load(Relaxed);
                    seen.store(published, Relaxed);
                    is_due
                }
                Due::Never => false,
            };
            is_due.then_some((place, turn.component))
        })
    }
}
