//! The reading side of a stream.

#![allow(unsafe_code)] // the bytes of a sample are read as the type that the port was opened for

use core::marker::PhantomData;
use std::rc::Rc;
use std::sync::atomic::Ordering::Relaxed;

use iceoryx2::port::update_connections::UpdateConnections;

use super::Connect;
use super::sample::{Queue, Received, parts, receive, values};
use super::service::open_queue;
use crate::context::Context;
use crate::region::add;
use crate::state::{Stamp, StateBuffer};
use crate::transport::{InputPlace, Participant, PortError};

/// A reader of one stream of values or slices, with its queue.
#[derive(Debug)]
pub(crate) struct StreamReader<T> {
    queue: Rc<Queue>,
    /// Index of the topic.
    topic: usize,
    current: Option<Received>,
    /// Restart count of the publisher and number of the last publication read.
    last: (u32, u64),
    lost: u64,
    content: PhantomData<T>,
}

impl<T: StateBuffer> StreamReader<T> {
    /// Joins a topic whose layout matches the content.
    pub(crate) fn open(participant: &Participant, place: &InputPlace<'_>) -> Result<Self, PortError> {
        let queue = Rc::new(open_queue(participant.node(), place.topic)?);
        let (topic, content) = (place.index, PhantomData);
        Ok(Self { queue, topic, current: None, last: (0, 0), lost: 0, content })
    }

    pub(crate) fn connection(&self) -> Rc<dyn Connect> {
        self.queue.clone()
    }

    /// Takes the next valid sample from the queue. Returns `true` if there was one. A sample is refused and
    /// counted if it is invalid or its number is not above the previous one; the previous sample is then
    /// kept.
    pub(crate) fn take(&mut self, context: &Context, is_valid: impl Fn(&[T]) -> bool) -> bool {
        while let Some(sample) = receive(&self.queue) {
            let (stamp, bytes) = parts(&sample);
            let (restarts, number) = (stamp.restart_count, stamp.sequence);
            // SAFETY: the queue was opened for the layout of the content.
            if number == 0 || (restarts, number) <= self.last || !is_valid(unsafe { values(bytes) }) {
                add(&context.block().refused, 1);
                continue;
            }
            // A restarted publisher continues the count; a reader that joins late has lost nothing.
            let lost = if self.last.1 == 0 { 0 } else { number.saturating_sub(self.last.1 + 1) };
            if lost > 0 {
                self.lost += lost;
                context.region().topics()[self.topic].dropped.fetch_add(lost, Relaxed);
            }
            self.last = (restarts, number);
            self.current = Some(sample);
            return true;
        }
        false
    }

    /// Drops the sample that was read in the previous episode. The queue has already been emptied.
    pub(crate) fn begin_episode(&mut self) {
        (self.current, self.last) = (None, (0, 0));
    }

    /// Returns the sample that was read last.
    #[inline]
    pub(crate) fn current(&self) -> Option<(&Stamp, &[T])> {
        let (stamp, bytes) = parts(self.current.as_ref()?);
        // SAFETY: the queue was opened for the layout of the content.
        Some((stamp, unsafe { values(bytes) }))
    }

    /// Returns the value that was read last from a stream of single values.
    #[inline]
    pub(crate) fn value(&self) -> Option<(&Stamp, &T)> {
        // SAFETY: the queue was opened for single values.
        self.current().map(|(stamp, values)| (stamp, unsafe { values.get_unchecked(0) }))
    }

    /// Returns the number of values that were overwritten in the queue before they were read.
    pub(crate) fn lost(&self) -> u64 {
        self.lost
    }
}

impl Connect for Queue {
    fn connect(&self) -> Result<(), String> {
        self.update_connections().map_err(|error| error.to_string())
    }

    fn begin_episode(&self) {
        while receive(self).is_some() {}
    }
}
