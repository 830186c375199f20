//! The gates of one actuator: one for each robot that it moves, with common statistics.

use core::cell::Cell;

use crate::region::{GateState, Latch};

/// Time for which all robots must have had good commands before robots that stop together resume, ns. Without
/// it, a robot with occasionally refused commands would make the others enter and leave the safe state each
/// time.
pub(super) const GO_ON_AFTER_NS: u64 = 500_000_000;

/// State shared by the gates of one actuator. Used by one thread.
#[derive(Debug)]
pub(super) struct Group {
    gates: Vec<Member>,
    /// True if a robot without a good command stops the others.
    together: bool,
    /// Time from which the robots may resume, ns; `None` while one of them has no good command.
    go_on_ns: Cell<Option<u64>>,
    /// True once all robots have had good commands; the start does not count as an outage.
    went_on: Cell<bool>,
}

#[derive(Debug)]
struct Member {
    /// Index of its first joint among all joints of the actuator.
    first: usize,
    /// True if the newest command of the gate's input is fresh, matches the gate's joints, and was not
    /// refused.
    good: Cell<bool>,
    state: Cell<GateState>,
    latch: Cell<Option<Latch>>,
    moves: Cell<bool>,
}

impl Group {
    /// Creates the group of gates with these numbers of joints.
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

    /// Returns `true` if a robot without a good command stops others.
    pub(super) fn stops_together(&self) -> bool {
        self.together && !self.is_alone()
    }

    /// Records at `now_ns` whether the newest command of a gate could be applied.
    pub(super) fn set_good(&self, place: usize, good: bool, now_ns: u64) {
        self.gates[place].good.set(good);
        if !self.gates.iter().all(|gate| gate.good.get()) {
            self.go_on_ns.set(None);
        } else if self.go_on_ns.get().is_none() {
            let wait_ns = if self.went_on.replace(true) { GO_ON_AFTER_NS } else { 0 };
            self.go_on_ns.set(Some(now_ns.saturating_add(wait_ns)));
        }
    }

    /// Resets a gate for a new episode.
    pub(super) fn reset(&self, place: usize) {
        let gate = &self.gates[place];
        gate.good.set(false);
        gate.state.set(GateState::Safe);
        gate.latch.set(None);
        gate.moves.set(false);
        self.go_on_ns.set(None);
        self.went_on.set(false);
    }

    /// Returns `true` if gates must stay in their safe state at `now_ns`, because one has no good command or
    /// [`GO_ON_AFTER_NS`] has not passed yet.
    pub(super) fn holds(&self, now_ns: u64) -> bool {
        self.stops_together() && self.go_on_ns.get().is_none_or(|go_on_ns| now_ns < go_on_ns)
    }

    /// Returns the safest state of all gates and the first latch, for the control block.
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

    /// Records whether the robot of a gate still moves in its safe state. Returns `true` if any robot does.
    pub(super) fn show_moves(&self, place: usize, moves: bool) -> bool {
        self.gates[place].moves.set(moves);
        self.gates.iter().any(|gate| gate.moves.get())
    }

    /// Returns the index of a gate's first joint among the actuator's joints.
    pub(super) fn first_joint(&self, place: usize) -> usize {
        self.gates[place].first
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn gate_without_a_command_stops_the_other() {
        let joints = || [7, 7].into_iter();
        let (alone, together) = (Group::new(joints(), false), Group::new(joints(), true));
        for group in [&alone, &together] {
            group.set_good(0, true, MS);
        }
        assert!(!alone.holds(MS) && together.holds(MS), "the other has no command yet");
        together.set_good(1, true, 2 * MS);
        assert!(!together.holds(2 * MS), "the start is not an outage");
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
        // Another refusal meanwhile restarts the time.
        group.set_good(0, false, 300 * MS);
        group.set_good(0, true, 301 * MS);
        assert!(group.holds(300 * MS + GO_ON_AFTER_NS));
        assert!(!group.holds(301 * MS + GO_ON_AFTER_NS));
        group.reset(0);
        assert!(group.holds(900 * MS), "a new episode starts without commands");
        group.set_good(0, true, 900 * MS);
        assert!(!group.holds(900 * MS), "and its start is not an outage");
    }

    #[test]
    fn statistics_show_the_safest_gate() {
        let group = Group::new([1, 2].into_iter(), false);
        assert_eq!(group.show(0, GateState::Following, None).0, GateState::Safe);
        assert_eq!(group.show(1, GateState::Resuming, None).0, GateState::Resuming);
        let latched = group.show(1, GateState::Safe, Some(Latch::SafeState));
        assert_eq!(latched, (GateState::Safe, Some(Latch::SafeState)));
        assert_eq!(group.show(0, GateState::Following, None), latched);
    }
}
