//! The account of the gates in the control block of their actuator.

use core::cell::Cell;

use crate::region::{ComponentBlock, LimitKind, Refusal, add};

/// The account of limited and refused commands.
pub trait Account {
    /// A command exceeded a limit of a joint.
    fn limited(&self, joint: usize, kind: LimitKind);
    /// A command was refused.
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

/// The part of an actuator's account that one gate writes.
pub(super) struct GroupAccount<'a> {
    block: &'a ComponentBlock,
    first: usize,
    /// The command that was offered has been refused.
    pub(super) has_refused: Cell<bool>,
}

impl<'a> GroupAccount<'a> {
    /// The account of a gate whose first joint has this number among those of the actuator.
    pub(super) fn new(block: &'a ComponentBlock, first: usize) -> Self {
        Self { block, first, has_refused: Cell::new(false) }
    }
}

/// An account of a command that is only looked at.
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
