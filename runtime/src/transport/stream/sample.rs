//! Samples of a stream: a stamp and the bytes of a type that the port knows.
//!
//! All streams use the same iceoryx2 ports, whose services get their types at run time. Compiled separately
//! for each message type, the ports would be a fifth of a component's code.

#![allow(unsafe_code)] // bytes in shared memory become values of the type that their port was opened for

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::sample::Sample;
use iceoryx2::service::marker::{CustomHeaderMarker, CustomPayloadMarker};

use crate::domain::Shared;
use crate::state::{Stamp, StateBuffer};

/// The bytes of a sample; each is represented by a marker.
pub(crate) type Bytes = [CustomPayloadMarker];
/// The user header of a sample; its stamp is represented by a marker.
pub(crate) type Header = CustomHeaderMarker;
/// The reading end of a service.
pub(crate) type Queue = Subscriber<Shared, Bytes, Header>;
/// The writing end of a service.
pub(crate) type Sender = Publisher<Shared, Bytes, Header>;
/// A received sample.
pub(crate) type Received = Sample<Shared, Bytes, Header>;

/// Takes the next sample from a queue. An error means that a starting or dying publisher could not be
/// connected. It is treated like an empty queue; the age of the last sample reveals it.
#[inline(never)]
pub(crate) fn receive(queue: &Queue) -> Option<Received> {
    queue.receive().ok().flatten()
}

/// Returns the stamp of a sample and the bytes of its payload.
#[inline]
pub(crate) fn parts(sample: &Received) -> (&Stamp, &[u8]) {
    // SAFETY: every service of a topic is created with a `Stamp` as its user header, which the marker
    // represents. The memory does not belong to this program: its address was made from a number and stays
    // valid while the sample is held.
    let stamp = unsafe { &*exposed::<Stamp>(sample.user_header()) };
    (stamp, as_bytes(sample.payload()))
}

/// Returns the bytes behind their markers.
#[inline]
pub(super) fn as_bytes(payload: &Bytes) -> &[u8] {
    // SAFETY: a marker represents each byte of the payload, over all of its elements, and has the size of a
    // byte.
    unsafe { core::slice::from_raw_parts(payload.as_ptr().cast::<u8>(), payload.len()) }
}

/// Returns the memory behind a marker, in the mapping that its address came from.
#[inline]
pub(super) fn exposed<T>(marker: &Header) -> *const T {
    core::ptr::with_exposed_provenance(core::ptr::from_ref(marker).addr())
}

/// Returns the bytes of a sample as values.
///
/// # Safety
/// The service of the sample must have been opened for the layout of `T`.
#[inline]
pub(super) unsafe fn values<T: StateBuffer>(bytes: &[u8]) -> &[T] {
    // SAFETY: by the caller's contract, the bytes have the alignment and size of `T`, for which every bit
    // pattern is valid.
    unsafe { core::slice::from_raw_parts(bytes.as_ptr().cast::<T>(), bytes.len() / size_of::<T>()) }
}
