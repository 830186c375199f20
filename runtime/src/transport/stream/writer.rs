//! The writing side of a stream.

#![allow(unsafe_code)] // a lent sample is shared memory that any bit pattern makes a valid value of

use core::fmt::Debug;
use std::rc::Rc;

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::sample_mut::SampleMut;
use iceoryx2_bb_elementary_traits::iceoryx_send::IceoryxSend;

use super::Connect;
use crate::domain::Shared;
use crate::plan::TopicPlan;
use crate::state::{Stamp, StateBuffer};
use crate::transport::topic::{open, open_slices, refused};
use crate::transport::{Participant, PortError};

/// The one writer of a stream of values, or of slices of them.
#[derive(Debug)]
pub(crate) struct StreamWriter<P: IceoryxSend + Debug + ?Sized + 'static> {
    publisher: Rc<Publisher<Shared, P, Stamp>>,
}

/// A sample lent for filling.
pub(crate) type Lent<P> = SampleMut<Shared, P, Stamp>;

impl<T: StateBuffer> StreamWriter<T> {
    pub(crate) fn open(participant: &Participant, topic: &TopicPlan) -> Result<Self, PortError> {
        let service = open::<T>(participant, topic)?;
        let publisher = service.publisher_builder().max_loaned_samples(1).create();
        let refuse = refused(&topic.name, "making a publisher");
        Ok(Self { publisher: Rc::new(publisher.map_err(|error| refuse(&error))?) })
    }

    /// Lends the memory of the next sample; `None` if readers hold all of it.
    pub(crate) fn lend(&self) -> Option<Lent<T>> {
        let sample = self.publisher.loan_uninit().ok()?;
        // SAFETY: the memory is mapped, initialised by the system or an earlier sample, and every bit pattern is a valid
        // `T` (the contract of `Field`).
        Some(unsafe { sample.assume_init() })
    }
}

impl<T: StateBuffer> StreamWriter<[T]> {
    pub(crate) fn open(
        participant: &Participant,
        topic: &TopicPlan,
        longest: usize,
    ) -> Result<Self, PortError> {
        let service = open_slices::<T>(participant, topic)?;
        let publisher =
            service.publisher_builder().max_loaned_samples(1).initial_max_slice_len(longest).create();
        let refuse = refused(&topic.name, "making a publisher");
        Ok(Self { publisher: Rc::new(publisher.map_err(|error| refuse(&error))?) })
    }

    /// As that of single values, for a slice of this length.
    pub(crate) fn lend(&self, length: usize) -> Option<Lent<[T]>> {
        let sample = self.publisher.loan_slice_uninit(length).ok()?;
        // SAFETY: as for single values.
        Some(unsafe { sample.assume_init() })
    }
}

impl<P: IceoryxSend + Debug + ?Sized + 'static> StreamWriter<P> {
    pub(crate) fn connection(&self) -> Rc<dyn Connect> {
        self.publisher.clone()
    }

    /// Sends a filled sample; false if it could not be.
    pub(crate) fn send(&self, mut sample: Lent<P>, stamp: Stamp) -> bool {
        *sample.user_header_mut() = stamp;
        sample.send().is_ok()
    }
}

impl<P: IceoryxSend + Debug + ?Sized> Connect for Publisher<Shared, P, Stamp> {
    fn connect(&self) -> Result<(), String> {
        self.update_connections().map_err(|error| error.to_string())
    }
}
