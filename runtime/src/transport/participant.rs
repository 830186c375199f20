//! A component of a run as a participant in its topics.

use std::cell::RefCell;
use std::rc::Rc;

use iceoryx2::node::Node;

use super::latest::TopicMemory;
use super::{PortError, Trigger};
use crate::context::Context;
use crate::domain::Shared;
use crate::plan::TopicPlan;

/// A component that joins topics: its node in the run's domain, its context, and the memory of each topic it
/// has joined, mapped once for all of its ports.
#[derive(Debug)]
pub(crate) struct Participant {
    node: Rc<Node<Shared>>,
    context: Rc<Context>,
    topics: RefCell<Vec<(String, Rc<TopicMemory>)>>,
}

impl Participant {
    pub(crate) fn new(node: Rc<Node<Shared>>, context: Rc<Context>) -> Self {
        Self { node, context, topics: RefCell::default() }
    }

    pub(crate) fn node(&self) -> &Node<Shared> {
        &self.node
    }

    pub(crate) fn context(&self) -> &Rc<Context> {
        &self.context
    }

    /// Returns the memory of a topic.
    pub(crate) fn memory(&self, topic: &TopicPlan) -> Result<Rc<TopicMemory>, PortError> {
        let mut topics = self.topics.borrow_mut();
        if let Some((_, memory)) = topics.iter().find(|(name, _)| *name == topic.name) {
            return Ok(memory.clone());
        }
        let memory = Rc::new(TopicMemory::open(&self.node, topic)?);
        topics.push((topic.name.clone(), memory.clone()));
        Ok(memory)
    }

    /// Returns the waiting side of a topic.
    pub(crate) fn trigger(&self, topic: &TopicPlan) -> Result<Trigger, PortError> {
        Ok(Trigger::new(self.memory(topic)?, self.context.restart_count()))
    }
}
