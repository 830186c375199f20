//! Checks that a port and its topic have the same layout.

use super::error::PortError;
use crate::plan::TopicPlan;
use crate::state::{StateBuffer, TypeLayout};

/// Checks that the topic's layout equals the layout of `T` in this program.
pub(crate) fn same_layout<T: StateBuffer>(topic: &TopicPlan, port: &str) -> Result<(), PortError> {
    fits(&T::layout(), topic, port)
}

/// Checks that the topic's layout matches the port's layout.
pub(crate) fn fits(mine: &TypeLayout, topic: &TopicPlan, port: &str) -> Result<(), PortError> {
    if mine.hash() == topic.layout.hash() {
        return Ok(());
    }
    Err(PortError::Layout {
        topic: topic.name.clone(),
        port: port.to_string(),
        difference: mine.difference("this program", &topic.layout, "the topic"),
    })
}
