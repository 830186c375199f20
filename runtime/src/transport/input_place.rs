//! Wiring of an input in the graph.

use super::Participant;
use crate::context::ReadEffects;
use crate::plan::TopicPlan;

/// Wiring of an input in the graph.
#[derive(Debug, Clone, Copy)]
pub(crate) struct InputPlace<'a> {
    /// Index of the topic.
    pub(crate) index: usize,
    pub(crate) topic: &'a TopicPlan,
    /// Name of the port.
    pub(crate) port: &'a str,
    /// Index of the port among the readers of the topic.
    pub(crate) pin: usize,
    pub(crate) is_cause: bool,
    /// Index of the edge from the topic to the component if the ages of read values are recorded.
    pub(crate) edge: Option<usize>,
}

impl InputPlace<'_> {
    /// Returns the effects of reading this input.
    pub(crate) fn effects(&self, participant: &Participant) -> ReadEffects {
        ReadEffects::new(participant.context().clone(), self.is_cause, self.edge)
    }
}
