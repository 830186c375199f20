//! The gates of one actuator: one for each robot that it moves, one account for all.

use core::cell::Cell;

use super::gate::Account;
use crate::region::{ComponentBlock, GateState, Latch, LimitKind, Refusal};

/// What the gates of one actuator know of one another. Used by one thread.
#[derive(Debug)]
pub(super) struct Group {
    gates: Vec<Member>,
    /// A robot without a good command stops the others.
    together: bool,
}

#[derive(Debug)]
struct Member {
    /// The first of its joints among all of the actuator.
    first: usize,
    /// The newest command of its input is fresh and for its joints.
    good: Cell<bool>,
    state: Cell<GateState>,
    latch: Cell<Option<Latch>>,
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
            };
            first += count;
            member
        };
        Self { gates: joints.map(member).collect(), together }
    }

    pub(super) fn is_alone(&self) -> bool {
        self.gates.len() == 1
    }

    /// Notes whether the newest command of a gate could be applied.
    pub(super) fn set_good(&self, place: usize, good: bool) {
        self.gates[place].good.set(good);
    }

    /// Sets a gate back for a new episode.
    pub(super) fn reset(&self, place: usize) {
        let gate = &self.gates[place];
        gate.good.set(false);
        gate.state.set(GateState::Safe);
        gate.latch.set(None);
    }

    /// True if a gate must stay in its safe state for want of a good command of another one.
    pub(super) fn holds(&self, place: usize) -> bool {
        let others = || self.gates.iter().enumerate().filter(|(index, _)| *index != place);
        self.together && others().any(|(_, gate)| !gate.good.get())
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

    /// The account of one gate, in which joints are numbered among all of the actuator.
    pub(super) fn account<'a>(&self, place: usize, block: &'a ComponentBlock) -> GroupAccount<'a> {
        GroupAccount { block, first: self.gates[place].first }
    }
}

/// The part of an actuator's account that one gate writes.
pub(super) struct GroupAccount<'a> {
    block: &'a ComponentBlock,
    first: usize,
}

impl Account for GroupAccount<'_> {
    fn limited(&self, joint: usize, kind: LimitKind) {
        self.block.limited(self.first + joint, kind);
    }

    fn refused(&self, reason: Refusal) {
        self.block.refused(reason);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gate_is_held_by_another_without_a_good_command_where_they_stop_together() {
        let joints = || [7, 7].into_iter();
        let (alone, together) = (Group::new(joints(), false), Group::new(joints(), true));
        for group in [&alone, &together] {
            group.set_good(0, true);
        }
        assert!(!alone.holds(0) && together.holds(0), "the other has no command yet");
        assert!(!together.holds(1));
        together.set_good(1, true);
        assert!(!together.holds(0) && !together.holds(1));
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
