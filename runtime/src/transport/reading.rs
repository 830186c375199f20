//! The effects of reading on the step of the reader, the same for all inputs.

use std::rc::Rc;

use super::Participant;
use crate::context::Context;
use crate::plan::TopicPlan;
use crate::state::Stamp;

/// The place of an input in the graph.
#[derive(Debug, Clone, Copy)]
pub(crate) struct InputPlace<'a> {
    /// Index of the topic.
    pub(crate) index: usize,
    pub(crate) topic: &'a TopicPlan,
    /// Name of the port.
    pub(crate) port: &'a str,
    /// Number of the port among the readers of the topic.
    pub(crate) pin: usize,
    pub(crate) is_cause: bool,
    /// Index of the edge from the topic to the component, if its ages are recorded.
    pub(crate) edge: Option<usize>,
}

/// The effects of reading an input: ages are recorded, source times go on to the outputs, an episode drops what was read.
#[derive(Debug)]
pub(super) struct Effects {
    context: Rc<Context>,
    /// True if outputs of the step propagate this input's source time.
    is_cause: bool,
    edge: Option<usize>,
    /// The episode of the last look.
    era: u32,
}

impl Effects {
    pub(super) fn new(participant: &Participant, place: &InputPlace<'_>) -> Self {
        let (is_cause, edge) = (place.is_cause, place.edge);
        Self { is_cause, edge, ..Self::none(participant.context().clone()) }
    }

    /// Those of an input that the graph leaves unwired.
    pub(super) fn none(context: Rc<Context>) -> Self {
        let era = context.era();
        Self { context, is_cause: false, edge: None, era }
    }

    #[inline]
    pub(super) fn context(&self) -> &Context {
        &self.context
    }

    /// True if no episode has begun since the last look.
    #[inline]
    pub(super) fn is_of_this_episode(&self) -> bool {
        self.era == self.context.era()
    }

    /// Notes a look; true if it is the first of an episode.
    #[inline]
    pub(super) fn begins_episode(&mut self) -> bool {
        let begins = !self.is_of_this_episode();
        self.era = self.context.era();
        begins
    }

    /// A sample was read for the first time.
    #[inline]
    pub(super) fn first_read(&self, stamp: &Stamp) {
        if let Some(edge) = self.edge {
            self.context.note_read(edge, stamp);
        }
    }

    /// A sample was read, for the first time or again.
    #[inline]
    pub(super) fn read(&self, stamp: &Stamp) {
        if self.is_cause {
            self.context.causality().propagate(stamp);
        }
    }
}
