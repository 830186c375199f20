//! Topics as iceoryx2 services.

use std::rc::Rc;

use iceoryx2::node::Node;
use iceoryx2::prelude::AttributeSpecifier;
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable as _;

use super::error::{PortError, refused};
use super::latest::{SIDE_PINS, TopicMemory};
use super::stream::{Samples, builder, layout_attribute};
use crate::declare::TopicPattern;
use crate::domain::Shared;
use crate::plan::TopicPlan;

/// The services of one topic. The launcher owns them, so they outlive every component.
#[derive(Debug)]
pub(crate) struct TopicService {
    samples: Samples,
    memory: Rc<TopicMemory>,
    wakes: bool,
}

impl TopicService {
    /// Creates the services of a topic, with limits derived from the plan.
    pub(crate) fn create(node: &Node<Shared>, topic: &TopicPlan) -> Result<Self, PortError> {
        let depth = match topic.pattern {
            TopicPattern::State => 1,
            TopicPattern::Stream { capacity } | TopicPattern::Slices { capacity, .. } => capacity,
        };
        let parties = topic.readers.len() + SIDE_PINS;
        let (key, value) = layout_attribute(topic)?;
        let failed = refused(&topic.name, "creating");
        let attributes = AttributeSpecifier::new().define(&key, &value).map_err(|error| failed(&error))?;
        let samples = builder(node, topic)?
            .subscriber_max_buffer_size(depth)
            .subscriber_max_borrowed_samples(2)
            .history_size(1)
            .enable_safe_overflow(true)
            // Spare places, because a killed publisher keeps its place until it is cleaned up.
            .max_publishers(4)
            .max_subscribers(2 * parties)
            .max_nodes(2 * parties + 4)
            .create_with_attributes(&attributes)
            .map_err(|error| failed(&error))?;
        let memory = Rc::new(TopicMemory::create(node, topic)?);
        Ok(Self { samples, memory, wakes: !topic.triggers.is_empty() })
    }

    /// Drops the topic without reading iceoryx2's data in shared memory, which may be damaged. Everything is
    /// removed together with the domain.
    pub(crate) fn abandon(self) {
        self.samples.abandon();
    }

    /// Returns the memory of the topic.
    pub(crate) fn memory(&self) -> &TopicMemory {
        &self.memory
    }

    /// Returns the topic's memory if components wait for it, so that the launcher can interrupt them to read
    /// the run's command.
    pub(crate) fn waited_for(&self) -> Option<Rc<TopicMemory>> {
        self.wakes.then(|| self.memory.clone())
    }
}
