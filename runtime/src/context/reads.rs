//! Effects of reading an input on the step of the reader, common to all inputs.

use std::rc::Rc;

use super::Context;
use crate::state::Stamp;

/// Effects of reading an input: records ages, propagates source times to the outputs, and drops the value in
/// a new episode.
#[derive(Debug)]
pub(crate) struct ReadEffects {
    context: Rc<Context>,
    /// True if outputs of the step propagate this input's source time.
    is_cause: bool,
    edge: Option<usize>,
    /// Episode of the last check.
    era: u32,
}

impl ReadEffects {
    pub(crate) fn new(context: Rc<Context>, is_cause: bool, edge: Option<usize>) -> Self {
        Self { is_cause, edge, ..Self::none(context) }
    }

    /// Creates the effects of an unwired input.
    pub(crate) fn none(context: Rc<Context>) -> Self {
        let era = context.era();
        Self { context, is_cause: false, edge: None, era }
    }

    #[inline]
    pub(crate) fn context(&self) -> &Context {
        &self.context
    }

    /// Returns `true` if no episode has started since the last check.
    #[inline]
    pub(crate) fn is_of_this_episode(&self) -> bool {
        self.era == self.context.era()
    }

    /// Records a check; returns `true` for the first one of an episode.
    #[inline]
    pub(crate) fn begins_episode(&mut self) -> bool {
        let begins = !self.is_of_this_episode();
        self.era = self.context.era();
        begins
    }

    /// Records that a sample was read for the first time.
    #[inline]
    pub(crate) fn first_read(&self, stamp: &Stamp) {
        if let Some(edge) = self.edge {
            self.context.note_read(edge, stamp);
        }
    }

    /// Records that a sample was read, for the first time or again.
    #[inline]
    pub(crate) fn read(&self, stamp: &Stamp) {
        if self.is_cause {
            self.context.causality().propagate(stamp);
        }
    }
}
