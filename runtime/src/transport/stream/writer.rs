//! The writing side of a stream.

#![allow(unsafe_code)] // samples are lent for the type that the port was opened for

use core::marker::PhantomData;
use std::rc::Rc;

use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::sample_mut::SampleMut;

use super::Connect;
use super::sample::{Bytes, Header, Sender, as_bytes, exposed, values};
use super::service::open_sender;
use crate::domain::Shared;
use crate::plan::TopicPlan;
use crate::state::{Stamp, StateBuffer};
use crate::transport::{Participant, PortError};

/// The only writer of a stream of values or slices.
#[derive(Debug)]
pub(crate) struct StreamWriter<T> {
    sender: Rc<Sender>,
    content: PhantomData<T>,
}

impl<T: StateBuffer> StreamWriter<T> {
    /// Joins a topic. `longest` is the maximum number of values per sample, 1 for a stream of single values.
    pub(crate) fn open(
        participant: &Participant,
        topic: &TopicPlan,
        longest: usize,
    ) -> Result<Self, PortError> {
        Ok(Self { sender: Rc::new(open_sender(participant.node(), topic, longest)?), content: PhantomData })
    }

    /// Lends the memory of the next sample, for `count` values (1 in a stream of single values). Returns
    /// `None` if readers still use all samples.
    pub(crate) fn lend(&self, count: usize) -> Option<Lent<T>> {
        lend(&self.sender, count).map(|sample| Lent { sample, content: PhantomData })
    }

    pub(crate) fn connection(&self) -> Rc<dyn Connect> {
        self.sender.clone()
    }
}

/// A lent sample, to be filled with values.
#[derive(Debug)]
pub(crate) struct Lent<T> {
    sample: SampleMut<Shared, Bytes, Header>,
    content: PhantomData<T>,
}

impl<T: StateBuffer> Lent<T> {
    /// Returns the values filled so far.
    #[inline]
    pub(crate) fn payload(&self) -> &[T] {
        // SAFETY: its sender was opened for values of this type.
        unsafe { values(as_bytes(self.sample.payload())) }
    }

    /// Returns mutable access to the values.
    #[inline]
    pub(crate) fn payload_mut(&mut self) -> &mut [T] {
        let bytes = self.sample.payload_mut();
        let count = bytes.len() / size_of::<T>();
        // SAFETY: as for `payload`; the sample is lent to this loan only.
        unsafe { core::slice::from_raw_parts_mut(bytes.as_mut_ptr().cast::<T>(), count) }
    }

    /// Sends the sample; returns `false` on failure.
    pub(crate) fn send(self, stamp: Stamp) -> bool {
        send(self.sample, stamp)
    }
}

#[inline(never)]
fn lend(sender: &Sender, count: usize) -> Option<SampleMut<Shared, Bytes, Header>> {
    // SAFETY: exactly one value is requested from a service of single values, by the only port that writes
    // them.
    let sample = unsafe { sender.loan_custom_payload(count) }.ok()?;
    // SAFETY: the memory is mapped, initialised by the system or an earlier sample, and every bit pattern is
    // a valid value (the contract of `Field`).
    Some(unsafe { sample.assume_init() })
}

#[inline(never)]
fn send(mut sample: SampleMut<Shared, Bytes, Header>, stamp: Stamp) -> bool {
    let header = exposed::<Stamp>(sample.user_header_mut()).cast_mut();
    // SAFETY: as in `parts`; the sample is lent to this call only.
    unsafe { header.write(stamp) };
    sample.send().is_ok()
}

impl Connect for Sender {
    fn connect(&self) -> Result<(), String> {
        self.update_connections().map_err(|error| error.to_string())
    }
}
