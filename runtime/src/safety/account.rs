//! Statistics of the gates in the control block of their actuator.

use core::cell::Cell;

use crate::region::{ComponentBlock, LimitKind, Refusal, add};

/// Statistics of limited and refused commands.
pub trait Account {
    /// Counts a command that exceeded a limit of a joint.
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

/// The part of an actuator's statistics that one gate writes.
pub(super) struct GroupAccount<'a> {
    block: &'a ComponentBlock,
    first: usize,
    /// True if the offered command was refused.
    pub(super) has_refused: Cell<bool>,
}

impl<'a> GroupAccount<'a> {
    /// Creates the statistics of a gate whose first joint has this index among the actuator's joints.
    pub(super) fn new(block: &'a ComponentBlock, first: usize) -> Self {
        Self { block, first, has_refused: Cell::new(false) }
    }
}

/// Discards the statistics of a command that is only evaluated.
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
