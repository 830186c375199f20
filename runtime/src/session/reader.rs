//! Reading of the newest value of a topic from outside the graph, without copying.

#![allow(unsafe_code)] // bytes are read as a type whose layout was compared with the topic's

use core::any::TypeId;
use core::cell::Cell;
use std::rc::Rc;

use iceoryx2::node::Node;

use crate::declare::TopicPattern;
use crate::domain::{Domain, Shared};
use crate::os::{Lock, OtherProcess, Owned};
use crate::plan::TopicPlan;
use crate::state::{Stamp, StateBuffer, TypeLayout};
use crate::transport::latest::StateReader;
use crate::transport::stream::{Queue, Received, parts, receive};
use crate::transport::{PortError, TopicMemory, open_queue, refused, same_layout, side_pin};

/// A reader of the newest value of a topic, without copying, for programs outside the graph.
///
/// Reading costs the writer nothing, and the writer never waits for a reader. [`poll`](Self::poll) pins the
/// newest value. The pinned value stays valid and unchanged until the next call of `poll`, regardless of its
/// size and of the time between calls. A topic supports four readers outside the graph at a time, including
/// [taps](crate::transport::Tap). A reader is released immediately when its process is killed.
///
/// On a stream, `poll` skips to the newest value. Use a [`Tap`](crate::transport::Tap) to read every value.
///
/// ```no_run
/// # use motorium::{plan::Plan, state::JointState, session::TopicReader, transport::{Domain, PortError}};
/// fn newest_positions(domain: &Domain, plan: &Plan) -> Result<Vec<f64>, PortError> {
///     let mut reader = TopicReader::open(domain, &plan.topics[0])?;
///     reader.poll();
///     Ok(reader.value::<JointState>()?.map_or_else(Vec::new, |state| state.position().to_vec()))
/// }
/// ```
#[derive(Debug)]
pub struct TopicReader {
    topic: TopicPlan,
    source: Owned<Source>,
    /// The last type whose layout was found to match the topic's.
    known: Cell<Option<TypeId>>,
    /// Lock on the pin, dropped after its last use.
    _place: Owned<Option<Lock>>,
    _node: Owned<Option<Node<Shared>>>,
}

#[derive(Debug)]
enum Source {
    State(StateReader),
    Stream { queue: Queue, newest: Option<Received> },
}

impl TopicReader {
    /// Joins a topic. The reader has no value before the first [`poll`](Self::poll).
    ///
    /// # Errors
    /// The run or the topic cannot be opened, or four other programs already read the topic.
    pub fn open(domain: &Domain, topic: &TopicPlan) -> Result<Self, PortError> {
        let node = domain.node().map_err(|error| refused(&topic.name, "joining the run")(&error))?;
        let reader = Self::join(domain, &node, topic)?;
        Ok(Self { _node: Owned::new(Some(node)), ..reader })
    }

    /// Joins a topic like [`open`](Self::open), through a node of the domain that outlives the reader.
    pub(crate) fn join(domain: &Domain, node: &Node<Shared>, topic: &TopicPlan) -> Result<Self, PortError> {
        let (source, place) = match topic.pattern {
            TopicPattern::State => {
                let memory = TopicMemory::open(node, topic)?;
                let (place, pin) = side_pin(domain, topic, &memory)?;
                (Source::State(StateReader::new(Rc::new(memory), pin)), Some(place))
            }
            TopicPattern::Stream { .. } | TopicPattern::Slices { .. } => {
                (Source::Stream { queue: open_queue(node, topic)?, newest: None }, None)
            }
        };
        let (source, topic) = (Owned::new(source), topic.clone());
        Ok(Self { topic, source, known: Cell::new(None), _place: Owned::new(place), _node: Owned::new(None) })
    }

    /// Returns the layout of the topic's values or, on a topic of slices, of their elements.
    pub fn layout(&self) -> &TypeLayout {
        &self.topic.layout
    }

    /// Checks that the current process opened this reader. In a forked child, a reader reads nothing and
    /// dropping it has no effect.
    ///
    /// # Errors
    /// The reader was opened by another process.
    pub fn check(&self) -> Result<(), OtherProcess> {
        self.source.check()
    }

    /// Pins the newest value. Returns `true` for a new value, `false` if the value was already pinned.
    pub fn poll(&mut self) -> bool {
        if !self.source.is_own() {
            return false;
        }
        match &mut *self.source {
            Source::State(reader) => {
                if reader.newest() < reader.seen() {
                    // A new episode has begun and withdraws earlier publications.
                    reader.begin_episode();
                }
                reader.look()
            }
            Source::Stream { queue, newest } => {
                let mut is_new = false;
                // The older sample is returned first: a queue lends two at a time.
                while let Some(sample) = receive(queue) {
                    *newest = Some(sample);
                    is_new = true;
                }
                is_new
            }
        }
    }

    /// Returns the stamp of the pinned value, or `None` before the first publication.
    pub fn stamp(&self) -> Option<&Stamp> {
        self.pinned().map(|(stamp, _)| stamp)
    }

    /// Returns the bytes of the pinned value in the [layout](Self::layout) of the topic, or `None` before the
    /// first publication. On a topic of slices, the result contains the bytes of all elements.
    pub fn bytes(&self) -> Option<&[u8]> {
        self.pinned().map(|(_, bytes)| bytes)
    }

    /// Returns the pinned value as `T`, or `None` before the first publication.
    ///
    /// # Errors
    /// The layout of the topic differs from the layout of `T`, the topic contains slices, or this process is
    /// a forked child.
    pub fn value<T: StateBuffer>(&self) -> Result<Option<&T>, PortError> {
        self.check().map_err(|error| refused(&self.topic.name, "reading a value")(&error))?;
        if self.known.get() != Some(TypeId::of::<T>()) {
            same_layout::<T>(&self.topic, "the reader")?;
            if matches!(self.topic.pattern, TopicPattern::Slices { .. }) {
                return Err(refused(&self.topic.name, "reading a value")(
                    &"the topic contains slices; read their bytes",
                ));
            }
            self.known.set(Some(TypeId::of::<T>()));
        }
        // SAFETY: the bytes are one value of this layout, aligned by the transport; every bit pattern is a
        // valid value.
        Ok(self.bytes().map(|bytes| unsafe { &*bytes.as_ptr().cast::<T>() }))
    }

    /// Releases the value that was read in the previous episode.
    pub(crate) fn begin_episode(&mut self) {
        match &mut *self.source {
            Source::State(reader) => reader.begin_episode(),
            Source::Stream { queue, newest } => {
                while receive(queue).is_some() {}
                *newest = None;
            }
        }
    }

    fn pinned(&self) -> Option<(&Stamp, &[u8])> {
        match self.source.is_own().then_some(&*self.source)? {
            Source::State(reader) => reader.current_bytes(),
            Source::Stream { newest, .. } => newest.as_ref().map(parts),
        }
    }
}

#[cfg(test)]
#[path = "tests/reader.rs"]
mod tests;
