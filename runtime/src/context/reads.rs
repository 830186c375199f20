//! The effects of reading on the step of the reader, the same for all inputs.

use std::rc::Rc;

use super::Context;
use crate::state::Stamp;

/// Effects of reading an input: ages are recorded, source times are passed to the outputs, and a new episode
/// drops the value.
#[derive(Debug)]
pub(crate) struct ReadEffects {
    context: Rc<Context>,
    /// True if outputs of the step propagate this input's source time.
    is_cause: bool,
    edge: Option<usize>,
    /// The episode of the last look.
    era: u32,
}

impl ReadEffects {
    pub(crate) fn new(context: Rc<Context>, is_cause: bool, edge: Option<usize>) -> Self {
        Self { is_cause, edge, ..Self::none(context) }
    }

    /// Effects for an unwired input.
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

    /// A sample was read for the first time.
    #[inline]
    pub(crate) fn first_read(&self, stamp: &Stamp) {
        if let Some(edge) = self.edge {
            self.context.note_read(edge, stamp);
        }
    }

    /// A sample was read, for the first time or again.
    #[inline]
    pub(crate) fn read(&self, stamp: &Stamp) {
        if self.is_cause {
            self.context.causality().propagate(stamp);
        }
    }
}
