//! Events for misses, refusals and safe states, derived from the statistics of workers. The launcher polls
//! these off the path from wake-up to publication. In lockstep it polls in simulated time, so that equal runs
//! produce equal events.

use std::sync::atomic::Ordering::Relaxed;

use super::Event;
use crate::plan::Plan;
use crate::region::{Command, ComponentBlock, GateState, Latch, Misses, Refusal, Region};

/// Initial and final interval between repeated events of one kind and component, ns.
const FIRST_QUIET_NS: u64 = 1_000_000_000;
const LONGEST_QUIET_NS: u64 = 64_000_000_000;
/// Simulated time between two polls in lockstep, ns.
const LOOK_NS: u64 = 100_000_000;

/// Time of the next report of a persistent condition: immediately at first, then at doubling intervals.
#[derive(Debug, Clone, Default)]
struct Pause {
    until_ns: u64,
    length_ns: u64,
}

impl Pause {
    /// Returns `true` if a change must be reported at `now_ns`.
    fn is_over(&mut self, now_ns: u64) -> bool {
        if now_ns < self.until_ns {
            return false;
        }
        // After a quiet time as long as the last interval, the condition counts as new.
        let goes_on = now_ns < self.until_ns.saturating_add(self.length_ns);
        self.length_ns = if goes_on && self.length_ns > 0 {
            (self.length_ns * 2).min(LONGEST_QUIET_NS)
        } else {
            FIRST_QUIET_NS
        };
        self.until_ns = now_ns.saturating_add(self.length_ns);
        true
    }
}

/// The last reported value of a counter.
#[derive(Debug, Clone, Default)]
struct Told<T> {
    count: T,
    pause: Pause,
}

impl<T: Clone + PartialEq> Told<T> {
    /// Returns the previously reported value if the counter has changed and the change must be reported now.
    fn change(&mut self, count: &T, now_ns: u64, all: bool) -> Option<T> {
        if self.count == *count || !(all || self.pause.is_over(now_ns)) {
            return None;
        }
        Some(core::mem::replace(&mut self.count, count.clone()))
    }
}

/// Reported counters of one component.
#[derive(Debug, Clone, Default)]
struct Account {
    misses: Told<[u64; 3]>,
    refused: Told<[u64; Refusal::ALL.len()]>,
    /// Reported entries into the safe state, and the reported state.
    entries: u64,
    state: GateState,
    /// Reported numbers of safe states without rest, and of late recoveries.
    faults: [u32; 2],
    /// Refusals at the last poll.
    refusals_seen: u64,
    /// Number of state changes that may be reported before a pause, so that a flapping gate does not displace
    /// other events.
    changes_left: u32,
    refilled_ns: u64,
}

/// Number of consecutive state changes of an actuator that are reported.
const CHANGES: u32 = 8;
/// Time after which one more change may be reported, ns.
const REFILL_NS: u64 = 10_000_000_000;

/// Reported counters of a run.
#[derive(Debug, Clone, Default)]
pub(super) struct Accounts {
    components: Vec<Account>,
    latencies: Vec<Told<u64>>,
    /// In lockstep, simulated time of the next poll, ns.
    next_look_ns: u64,
}

impl Accounts {
    /// Creates the counters for a run of this plan, with nothing reported.
    pub(super) fn new(plan: &Plan) -> Self {
        let fresh = Account { changes_left: CHANGES, ..Account::default() };
        Self {
            components: vec![fresh; plan.components.len()],
            latencies: vec![Told::default(); plan.latencies.len()],
            next_look_ns: 0,
        }
    }

    /// Restarts simulated time, and resets the times of earlier reports.
    pub(super) fn begin_episode(&mut self) {
        for account in &mut self.components {
            // The reset has put the actuator into its safe state, without a command.
            account.state = GateState::Safe;
            account.misses.pause = Pause::default();
            account.refused.pause = Pause::default();
            (account.changes_left, account.refilled_ns) = (CHANGES, 0);
        }
        self.latencies.iter_mut().for_each(|reported| reported.pause = Pause::default());
        self.next_look_ns = 0;
    }

    /// Returns the simulated time of the next poll in lockstep, ns.
    pub(super) fn next_look_ns(&self) -> u64 {
        self.next_look_ns
    }

    /// Reports changes in lockstep, if a poll is due in simulated time.
    #[inline]
    pub(super) fn report_at(
        &mut self,
        (plan, region): (&Plan, &Region),
        simulated_ns: u64,
        observe: &mut dyn FnMut(Event<'_>),
    ) {
        if simulated_ns >= self.next_look_ns {
            self.next_look_ns = simulated_ns + LOOK_NS;
            self.report((plan, region), simulated_ns, false, observe);
        }
    }

    /// Reports changes; with `all`, including changes withheld by a pause.
    pub(super) fn report(
        &mut self,
        (plan, region): (&Plan, &Region),
        now_ns: u64,
        all: bool,
        observe: &mut dyn FnMut(Event<'_>),
    ) {
        let blocks = plan.components.iter().zip(region.components());
        for (account, (component, block)) in self.components.iter_mut().zip(blocks) {
            let name = component.name.as_str();
            let misses = block.misses();
            let late = [misses.late_wake, misses.long_step, misses.stolen];
            if let Some(before) = account.misses.change(&late, now_ns, all) {
                let since = |place: usize| late[place].saturating_sub(before[place]);
                let misses = Misses {
                    late_wake: since(0),
                    long_step: since(1),
                    stolen: since(2),
                    ..Misses::default()
                };
                observe(Event::Missed { component: name, misses });
            }
            if component.actuator {
                account.report_gate((name, block), region, (now_ns, all), observe);
            }
        }
        let blocks = plan.latencies.iter().zip(region.latencies());
        for (reported, (latency, block)) in self.latencies.iter_mut().zip(blocks) {
            let missed = block.missed.load(Relaxed);
            if let Some(before) = reported.change(&missed, now_ns, all) {
                observe(Event::LatencyMissed {
                    from: &plan.topics[latency.from].name,
                    to: &plan.topics[latency.to].name,
                    count: missed.saturating_sub(before),
                    max_ns: latency.max_ns,
                    longest_ns: block.latency.percentiles().max,
                });
            }
        }
    }
}

impl Account {
    fn report_gate(
        &mut self,
        (component, block): (&str, &ComponentBlock),
        region: &Region,
        (now_ns, all): (u64, bool),
        observe: &mut dyn FnMut(Event<'_>),
    ) {
        let refusals = block.gate.refusals();
        if let Some(before) = self.refused.change(&refusals, now_ns, all) {
            let since = Refusal::ALL.into_iter().zip(refusals.iter().zip(before));
            let refused: Vec<(Refusal, u64)> = since
                .map(|(reason, (count, before))| (reason, count.saturating_sub(before)))
                .filter(|(_, count)| *count > 0)
                .collect();
            observe(Event::Refused { component, refused: &refused });
        }
        let refusals: u64 = refusals.iter().fold(0, |sum, count| sum.saturating_add(*count));
        let refuses = refusals > core::mem::replace(&mut self.refusals_seen, refusals);
        let entries = block.gate.entries();
        let state = block.gate.state();
        let faults = gate_faults(block);
        let before = core::mem::replace(&mut self.faults, faults);
        for ((count, before), fault) in faults.iter().zip(before).zip(GATE_FAULTS) {
            if *count > before {
                observe(Event::Warning(&format!("`{component}` {fault}")));
            }
        }
        if (entries, state) == (self.entries, self.state) || !(self.may_report(now_ns) || all) {
            return;
        }
        let times = entries.saturating_sub(self.entries);
        let followed = core::mem::replace(&mut self.state, state) != GateState::Safe;
        self.entries = entries;
        // The safe state was entered and left between two polls.
        let since_ns = block.safe_since_ns.load(Relaxed);
        if !followed && times > 0 {
            observe(Event::LeftSafeState { component, before_ns: Some(since_ns), resuming: false });
        }
        if times > 0 {
            let is_end = region.header().command() as u32 > Command::Run as u32;
            let latch = block.gate.latch().or(region.header().latched());
            let cause = cause(latch, is_end, refuses);
            observe(Event::EnteredSafeState { component, times, cause, is_end, since_ns });
        }
        if state != GateState::Safe {
            let resuming = state == GateState::Resuming;
            observe(Event::LeftSafeState { component, before_ns: None, resuming });
        }
    }

    fn may_report(&mut self, now_ns: u64) -> bool {
        if now_ns.saturating_sub(self.refilled_ns) >= REFILL_NS {
            (self.changes_left, self.refilled_ns) = ((self.changes_left + 1).min(CHANGES), now_ns);
        }
        let may = self.changes_left > 0;
        self.changes_left -= u32::from(may);
        may
    }
}

/// Faults of a gate that its actuator counts, in the order of [`gate_faults`].
const GATE_FAULTS: [&str; 2] = [
    "is not at rest 1 s after it entered its safe state",
    "has been resuming for more than 2 s: its command is too far away, or too fast for its limits",
];

/// Returns the numbers of safe states in which joints did not come to rest in time, and of recoveries that
/// lasted too long.
pub(super) fn gate_faults(block: &ComponentBlock) -> [u32; 2] {
    [block.gate.unsettled(), block.gate.late_resumes()]
}

/// Returns the reason why an actuator entered its safe state.
fn cause(latch: Option<Latch>, is_end: bool, refuses: bool) -> &'static str {
    match latch {
        _ if is_end => "the run ends",
        Some(Latch::Stop) => "by `motorium stop --now`",
        Some(Latch::EmergencyStop) => "by an emergency stop",
        _ if refuses => "its commands are refused",
        _ => "its commands are stale",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;

    #[test]
    fn persistent_condition_is_reported_with_back_off() {
        let mut pause = Pause::default();
        let reported: Vec<u64> = (0..300).filter(|second| pause.is_over(second * S)).collect();
        assert_eq!(reported, [0, 1, 3, 7, 15, 31, 63, 127, 191, 255]);
        assert!(pause.is_over(1_000 * S), "after a quiet time");
        assert!(pause.is_over(1_001 * S), "and it begins with a short pause again");
    }

    #[test]
    fn counter_is_reported_on_change_and_at_the_end() {
        let mut reported = Told::<u64>::default();
        assert_eq!(reported.change(&0, S, false), None);
        assert_eq!(reported.change(&3, S, false), Some(0));
        assert_eq!(reported.change(&5, S + 1, false), None, "a moment ago");
        assert_eq!(reported.change(&5, S + 2, true), Some(3));
        assert_eq!(reported.change(&5, S + 3, true), None);
    }

    #[test]
    fn flapping_actuator_is_rate_limited() {
        let mut account = Account { changes_left: CHANGES, ..Account::default() };
        let reported = (0..60 * 50).filter(|look| account.may_report(look * 20_000_000)).count();
        assert_eq!(reported, CHANGES as usize + 5);
    }

    #[test]
    fn cause_of_a_safe_state_is_named() {
        assert_eq!(cause(None, false, false), "its commands are stale");
        assert_eq!(cause(None, false, true), "its commands are refused");
        assert_eq!(cause(Some(Latch::SafeState), false, true), "its commands are refused");
        assert_eq!(cause(Some(Latch::Stop), false, true), "by `motorium stop --now`");
        assert_eq!(cause(Some(Latch::Stop), true, false), "the run ends");
    }
}
