//! Counters of limited and refused commands, in the control block of the actuator.

use core::cell::Cell;

use crate::region::{ComponentBlock, LimitKind, Refusal, add};

/// Counts the commands that a gate limits or refuses.
pub trait Account {
    /// Counts a command that exceeded a limit of a joint. `joint` is the index of the joint among the gate's
    /// joints.
    fn limited(&self, joint: usize, kind: LimitKind);
    /// Counts a refused command.
    fn refused(&self, reason: Refusal);
}

impl Account for ComponentBlock {
    fn limited(&self, joint: usize, kind: LimitKind) {
        self.gate.limit(joint, kind);
    }

    fn refused(&self, reason: Refusal) {
        self.gate.refuse(reason);
        add(&self.refused, 1);
    }
}

/// Counters of one gate among the gates of an actuator.
pub(super) struct GroupAccount<'a> {
    block: &'a ComponentBlock,
    first: usize,
    /// True if the offered command was refused.
    pub(super) has_refused: Cell<bool>,
}

impl<'a> GroupAccount<'a> {
    /// Creates the counters of a gate. `first` is the index of the gate's first joint among the actuator's
    /// joints.
    pub(super) fn new(block: &'a ComponentBlock, first: usize) -> Self {
        Self { block, first, has_refused: Cell::new(false) }
    }
}

/// Counts nothing, for commands that are only evaluated.
pub(super) struct NoAccount;

impl Account for NoAccount {
    fn limited(&self, _: usize, _: LimitKind) {}

    fn refused(&self, _: Refusal) {}
}

impl Account for GroupAccount<'_> {
    fn limited(&self, joint: usize, kind: LimitKind) {
        self.block.limited(self.first + joint, kind);
    }

    fn refused(&self, reason: Refusal) {
        self.has_refused.set(true);
        self.block.refused(reason);
    }
}
