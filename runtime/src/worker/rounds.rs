//! The order of ticks in lockstep: the next component to step, and its time.
//!
//! Simulated time advances from round to round. A round is a time at which a time-triggered component is due.
//! Within a round, each component is considered once, in the order of the plan. A time-triggered component
//! steps if the round is one of its releases, a triggered component if its topic was published since its last
//! tick.

use std::sync::atomic::Ordering::{Acquire, Relaxed};

use crate::plan::{Activation, Plan};
use crate::region::{Command, Phase, Region};

/// The order of ticks of a plan. Its state is in the control block of the run.
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
    /// After each publication of the topic with this index.
    After(usize),
    /// Never: there are no events in simulated time, and `check` rejects such a graph.
    Never,
}

impl Rounds {
    /// Creates the order of the components of a plan for which `takes_part` is true.
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

    /// Returns the time of the first round not before `time_ns`; `u64::MAX` if there is none.
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

    /// Returns the position after a component in the order.
    pub(crate) fn place_after(&self, component: usize) -> usize {
        self.turns.iter().position(|turn| turn.component == component).map_or(0, |place| place + 1)
    }

    /// Returns the index of the next component that is due in the round at `time_ns`, starting at a position
    /// in the order.
    pub(crate) fn next_due(&self, region: &Region, time_ns: u64, from: usize) -> Option<usize> {
        let turns = self.turns.get(from..).unwrap_or_default();
        let is_due = |turn: &&Turn| match turn.due {
            Due::At { phase_ns, period_ns } => {
                time_ns >= phase_ns && (time_ns - phase_ns).is_multiple_of(period_ns)
            }
            Due::After(topic) => {
                let seen = &region.components()[turn.component].trigger_seen;
                region.topics()[topic].published.load(Acquire) != seen.load(Relaxed)
            }
            Due::Never => false,
        };
        turns.iter().find(is_due).map(|turn| turn.component)
    }

    /// Records the tick of a component in the round at `time_ns`, and consumes the publications that
    /// triggered it so far.
    pub(crate) fn note(&self, region: &Region, component: usize, time_ns: u64) {
        let block = &region.components()[component];
        block.tick_time_ns.store(time_ns, Relaxed);
        block.tick_resets.store(0, Relaxed);
        let turn = self.turns.iter().find(|turn| turn.component == component);
        if let Some(Due::After(topic)) = turn.map(|turn| turn.due) {
            block.trigger_seen.store(region.topics()[topic].published.load(Acquire), Relaxed);
        }
    }

    /// Passes the turn from the component `giver`, which has stepped at `time_ns`, to the next due component.
    /// This component is due in the same round or, if the next round may begin without the launcher, in the
    /// next round. Otherwise, or if that component is not running, the launcher gets the turn.
    pub(super) fn pass_on(&self, region: &Region, giver: usize, time_ns: u64) {
        let header = region.header();
        let next = self.next(region, giver, time_ns).filter(|(component, _)| {
            header.command() == Command::Run && region.components()[*component].phase() == Phase::Running
        });
        let Some((component, round_ns)) = next else {
            header.turn.give_back(giver);
            return;
        };
        if round_ns != time_ns {
            header.turn.begin_round();
            header.reached_ns.store(time_ns + 1, Relaxed);
        }
        self.note(region, component, round_ns);
        header.turn.pass(Some(giver), Some(component));
        if component != giver {
            region.components()[component].call();
        }
    }

    /// Returns the component whose tick follows the tick of `giver` at `time_ns`, and its time.
    fn next(&self, region: &Region, giver: usize, time_ns: u64) -> Option<(usize, u64)> {
        if let Some(component) = self.next_due(region, time_ns, self.place_after(giver)) {
            return Some((component, time_ns));
        }
        let header = region.header();
        let round_ns = self.round_from(time_ns + 1);
        if header.is_episode_over() || !header.turn.may_begin(round_ns) {
            return None;
        }
        self.next_due(region, round_ns, 0).map(|component| (component, round_ns))
    }
}
