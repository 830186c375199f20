//! The writing side of a stream.

#![allow(unsafe_code)] // a lent sample is shared memory that any bit pattern makes a valid value of

use std::rc::Rc;

use iceoryx2::node::Node;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::sample_mut::SampleMut;

use super::Shared;
use crate::plan::TopicPlan;
use crate::state::{Stamp, StateBuffer};
use crate::transport::topic::{open, refused};
use crate::transport::{Connect, PortError};

/// The one writer of a stream.
#[derive(Debug)]
pub(crate) struct StreamWriter<T: StateBuffer> {
    publisher: Rc<Publisher<Shared, T, Stamp>>,
}

/// A sample lent for filling.
pub(crate) type Lent<T> = SampleMut<Shared, T, Stamp>;

impl<T: StateBuffer> StreamWriter<T> {
    pub(crate) fn open(node: &Node<Shared>, topic: &TopicPlan, port: &str) -> Result<Self, PortError> {
        let publisher = open::<T>(node, topic, port)?
            .publisher_builder()
            .max_loaned_samples(1)
            .create()
            .map_err(|error| refused(&topic.name, "making a publisher")(&error))?;
        Ok(Self { publisher: Rc::new(publisher) })
    }

    pub(crate) fn connection(&self) -> Rc<dyn Connect> {
        self.publisher.clone()
    }

    /// Lends the memory of the next sample; `None` if readers hold all of it.
    pub(crate) fn lend(&self) -> Option<Lent<T>> {
        let sample = self.publisher.loan_uninit().ok()?;
        // SAFETY: the memory is mapped, initialised by the system or an earlier sample, and every bit pattern is a valid
        // `T` (the contract of `Field`).
        Some(unsafe { sample.assume_init() })
    }

    /// Sends a filled sample; false if it could not be.
    pub(crate) fn send(&self, mut sample: Lent<T>, stamp: Stamp) -> bool {
        *sample.user_header_mut() = stamp;
        sample.send().is_ok()
    }
}

impl<T: StateBuffer> Connect for Publisher<Shared, T, Stamp> {
    fn connect(&self) -> Result<(), String> {
        self.update_connections().map_err(|error| error.to_string())
    }
}
