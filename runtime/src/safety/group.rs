//! The gates of one actuator: one for each robot that it moves, one account for all.

use core::cell::Cell;

use crate::region::{GateState, Latch};

/// Time for which all robots must have had good commands before those that stop together go on together, ns.
/// Without it a robot whose commands are refused now and then would throw the others into the safe state and
/// out of it each time.
pub(super) const GO_ON_AFTER_NS: u64 = 500_000_000;

/// State that the gates of one actuator share. Used by one thread.
#[derive(Debug)]
pub(super) struct Group {
    gates: Vec<Member>,
    /// A robot without a good command stops the others.
    together: bool,
    /// Time from which on the robots may go on, ns; `None` while one of them has no good command.
    go_on_ns: Cell<Option<u64>>,
    /// All had good commands before: the start is no outage.
    went_on: Cell<bool>,
}

#[derive(Debug)]
struct Member {
    /// The first of its joints among all of the actuator.
    first: usize,
    /// The newest command of its input is fresh, for its joints, and was not refused.
    good: Cell<bool>,
    state: Cell<GateState>,
    latch: Cell<Option<Latch>>,
    moves: Cell<bool>,
}

impl Group {
    /// Gates for so many joints each.
    pub(super) fn new(joints: impl Iterator<Item = usize>, together: bool) -> Self {
        let mut first = 0;
        let member = |count: usize| {
            let member = Member {
                first,
                good: Cell::new(false),
                state: Cell::new(GateState::Safe),
                latch: Cell::new(None),
                moves: Cell::new(false),
            };
            first += count;
            member
        };
        let gates = joints.map(member).collect();
        Self { gates, together, go_on_ns: Cell::new(None), went_on: Cell::new(false) }
    }

    pub(super) fn is_alone(&self) -> bool {
        self.gates.len() == 1
    }

    /// True if a robot without a good command stops others.
    pub(super) fn stops_together(&self) -> bool {
        self.together && !self.is_alone()
    }

    /// Notes at `now_ns` whether the newest command of a gate could be applied.
    pub(super) fn set_good(&self, place: usize, good: bool, now_ns: u64) {
        self.gates[place].good.set(good);
        if !self.gates.iter().all(|gate| gate.good.get()) {
            self.go_on_ns.set(None);
        } else if self.go_on_ns.get().is_none() {
            let wait_ns = if self.went_on.replace(true) { GO_ON_AFTER_NS } else { 0 };
            self.go_on_ns.set(Some(now_ns.saturating_add(wait_ns)));
        }
    }

    /// Sets a gate back for a new episode.
    pub(super) fn reset(&self, place: usize) {
        let gate = &self.gates[place];
        gate.good.set(false);
        gate.state.set(GateState::Safe);
        gate.latch.set(None);
        gate.moves.set(false);
        self.go_on_ns.set(None);
        self.went_on.set(false);
    }

    /// True if a gate must stay in its safe state at `now_ns`: another one has no good command, or they do
    /// not go on yet.
    pub(super) fn holds(&self, now_ns: u64) -> bool {
        self.stops_together() && self.go_on_ns.get().is_none_or(|go_on_ns| now_ns < go_on_ns)
    }

    /// The state and latch that the account shows: the safest of all gates.
    pub(super) fn show(
        &self,
        place: usize,
        state: GateState,
        latch: Option<Latch>,
    ) -> (GateState, Option<Latch>) {
        self.gates[place].state.set(state);
        self.gates[place].latch.set(latch);
        let states = self.gates.iter().map(|gate| gate.state.get());
        let safest = states.min_by_key(|state| *state as u32).unwrap_or(state);
        (safest, self.gates.iter().find_map(|gate| gate.latch.get()))
    }

    /// Notes whether the robot of a gate still moves in its safe state; returns whether any does.
    pub(super) fn show_moves(&self, place: usize, moves: bool) -> bool {
        self.gates[place].moves.set(moves);
        self.gates.iter().any(|gate| gate.moves.get())
    }

    /// Number of a gate's first joint among those of the actuator.
    pub(super) fn first_joint(&self, place: usize) -> usize {
        self.gates[place].first
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn a_gate_is_held_by_another_that_stops_with_it() {
        let joints = || [7, 7].into_iter();
        let (alone, together) = (Group::new(joints(), false), Group::new(joints(), true));
        for group in [&alone, &together] {
            group.set_good(0, true, MS);
        }
        assert!(!alone.holds(MS) && together.holds(MS), "the other has no command yet");
        together.set_good(1, true, 2 * MS);
        assert!(!together.holds(2 * MS), "the start is no outage");
        together.set_good(1, false, 3 * MS);
        assert!(together.holds(3 * MS));
    }

    #[test]
    fn robots_that_stopped_together_resume_together() {
        let group = Group::new([7, 7].into_iter(), true);
        (0..2).for_each(|place| group.set_good(place, true, 0));
        group.set_good(0, false, MS);
        group.set_good(0, true, 2 * MS);
        assert!(group.holds(2 * MS) && group.holds(MS + GO_ON_AFTER_NS));
        // Refused once more meanwhile: the time begins anew.
        group.set_good(0, false, 300 * MS);
        group.set_good(0, true, 301 * MS);
        assert!(group.holds(300 * MS + GO_ON_AFTER_NS));
        assert!(!group.holds(301 * MS + GO_ON_AFTER_NS));
        group.reset(0);
        assert!(group.holds(900 * MS), "a new episode begins without commands");
        group.set_good(0, true, 900 * MS);
        assert!(!group.holds(900 * MS), "and its start is no outage");
    }

    #[test]
    fn the_account_shows_the_safest_gate() {
        let group = Group::new([1, 2].into_iter(), false);
        assert_eq!(group.show(0, GateState::Following, None).0, GateState::Safe);
        assert_eq!(group.show(1, GateState::Resuming, None).0, GateState::Resuming);
        let latched = group.show(1, GateState::Safe, Some(Latch::SafeState));
        assert_eq!(latched, (GateState::Safe, Some(Latch::SafeState)));
        assert_eq!(group.show(0, GateState::Following, None), latched);
    }
}
