//! The reading side of a stream.

use std::rc::Rc;

use iceoryx2::node::Node;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::sample::Sample;

use super::Shared;
use crate::plan::TopicPlan;
use crate::state::{Stamp, StateBuffer};
use crate::transport::topic::{open, refused};
use crate::transport::{Connect, PortError};

/// A reader of one stream with a queue of its own.
#[derive(Debug)]
pub(crate) struct StreamReader<T: StateBuffer> {
    subscriber: Rc<Subscriber<Shared, T, Stamp>>,
    current: Option<Sample<Shared, T, Stamp>>,
    place: Place,
}

/// The place of a reader in a stream: restart count of the publisher and number of its last publication read.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Place {
    restarts: u32,
    number: u64,
}

impl Place {
    /// Goes on to a publication; how many were lost before it, or `None` if it is not newer than the last one.
    pub(super) fn advance(&mut self, stamp: &Stamp) -> Option<u64> {
        let before = (self.restarts, self.number);
        if stamp.sequence == 0 || (stamp.restart_count, stamp.sequence) <= before {
            return None;
        }
        // A restarted publisher goes on counting; a reader that comes late has lost nothing.
        let lost = if self.number == 0 { 0 } else { stamp.sequence.saturating_sub(self.number + 1) };
        *self = Self { restarts: stamp.restart_count, number: stamp.sequence };
        Some(lost)
    }
}

/// A sample was taken from the queue.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Taken {
    /// It is the next one that may be read; so many before it were overwritten in the queue.
    Next { lost: u64 },
    /// It must not be read: its number is not newer than the last one's, or its content is invalid.
    Refused,
}

impl<T: StateBuffer> StreamReader<T> {
    pub(crate) fn open(node: &Node<Shared>, topic: &TopicPlan, port: &str) -> Result<Self, PortError> {
        let subscriber = open::<T>(node, topic, port)?
            .subscriber_builder()
            .create()
            .map_err(|error| refused(&topic.name, "making a subscriber")(&error))?;
        Ok(Self { subscriber: Rc::new(subscriber), current: None, place: Place::default() })
    }

    pub(crate) fn connection(&self) -> Rc<dyn Connect> {
        self.subscriber.clone()
    }

    /// Takes the next sample from the queue, if there is one. What was read before stays if it is refused.
    pub(crate) fn take(&mut self) -> Option<Taken> {
        // An error here means a connection could not be made to a publisher that is just dying or being born; the
        // sample is then simply not there yet, and its age tells.
        let sample = self.subscriber.receive().ok().flatten()?;
        if sample.payload().check().is_err() {
            return Some(Taken::Refused);
        }
        let Some(lost) = self.place.advance(sample.user_header()) else { return Some(Taken::Refused) };
        self.current = Some(sample);
        Some(Taken::Next { lost })
    }

    /// Forgets what was read in the episode before; what was left in the queue is gone already.
    pub(crate) fn forget(&mut self) {
        (self.current, self.place) = (None, Place::default());
    }

    /// The sample read last.
    #[inline]
    pub(crate) fn current(&self) -> Option<(&Stamp, &T)> {
        self.current.as_ref().map(|sample| (sample.user_header(), sample.payload()))
    }
}

impl<T: StateBuffer> Connect for Subscriber<Shared, T, Stamp> {
    fn connect(&self) -> Result<(), String> {
        self.update_connections().map_err(|error| error.to_string())
    }

    fn begin_episode(&self) {
        while matches!(self.receive(), Ok(Some(_))) {}
    }
}
