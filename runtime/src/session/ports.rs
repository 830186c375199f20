//! The ports of a session.

use std::any::Any;
use std::rc::Rc;

use iceoryx2::node::Node;

use super::TopicReader;
use crate::context::Context;
use crate::transport::Shared;

/// The ports of a session, opened when they are first used.
#[derive(Default)]
pub(super) struct Ports {
    pub(super) node: Option<Rc<Node<Shared>>>,
    pub(super) readers: Vec<(usize, TopicReader)>,
    pub(super) writers: Vec<(usize, Box<dyn Any>, Rc<Context>)>,
}

impl Ports {
    /// Begins an episode: inputs are empty and outputs have published nothing.
    pub(super) fn begin_episode(&mut self, index: u64) {
        self.readers.iter_mut().for_each(|(_, reader)| reader.begin_episode());
        self.writers.iter().for_each(|(.., context)| context.begin_episode(index));
    }
}
