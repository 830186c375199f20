//! The reading side of a stream.

#![allow(unsafe_code)] // samples of types described at run time are read as bytes

use core::fmt::Debug;
use std::rc::Rc;
use std::sync::atomic::Ordering::Relaxed;

use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::sample::Sample;
use iceoryx2::service::marker::CustomPayloadMarker;
use iceoryx2_bb_elementary_traits::iceoryx_send::IceoryxSend;

use super::Connect;
use crate::context::Context;
use crate::domain::Shared;
use crate::region::add;
use crate::state::{Stamp, StateBuffer};
use crate::transport::topic::{Samples, refused};
use crate::transport::{InputPlace, PortError};

/// The bytes of a sample of a type that is known at run time only: a marker stands for each.
pub(crate) type Bytes = [CustomPayloadMarker];

/// The bytes behind their markers.
pub(crate) fn bytes(sample: &Bytes) -> &[u8] {
    // SAFETY: a marker stands for each byte of the payload, all of its elements, and has its size.
    unsafe { core::slice::from_raw_parts(sample.as_ptr().cast::<u8>(), sample.len()) }
}

/// The content of a sample: a value, a slice of values, or bytes.
pub(crate) trait Carried: IceoryxSend + Debug + 'static {
    /// Takes the next sample from a queue. An error there means that a connection could not be made to a publisher that is
    /// just dying or being born; the sample is then simply not there yet, and its age tells.
    fn receive(queue: &Subscriber<Shared, Self, Stamp>) -> Option<Sample<Shared, Self, Stamp>>;

    /// The content of a sample.
    fn of(sample: &Sample<Shared, Self, Stamp>) -> &Self;

    /// True if it may reach a reader.
    fn is_valid(&self) -> bool;
}

macro_rules! carried {
    ({ $($generics:tt)* } $type:ty, $content:ident => $valid:expr) => {
        impl $($generics)* Carried for $type {
            fn receive(queue: &Subscriber<Shared, Self, Stamp>) -> Option<Sample<Shared, Self, Stamp>> {
                queue.receive().ok().flatten()
            }

            fn of(sample: &Sample<Shared, Self, Stamp>) -> &Self {
                sample.payload()
            }

            fn is_valid(&self) -> bool {
                let $content = self;
                $valid
            }
        }
    };
}
carried!({ <T: StateBuffer> } T, value => value.check().is_ok());
carried!({ <T: StateBuffer> } [T], values => T::check_all(values).is_ok());
carried!({} Bytes, _bytes => true);

/// A reader of one stream with a queue of its own.
#[derive(Debug)]
pub(crate) struct StreamReader<P: Carried + ?Sized> {
    queue: Rc<Subscriber<Shared, P, Stamp>>,
    /// Index of the topic.
    topic: usize,
    current: Option<Sample<Shared, P, Stamp>>,
    /// Restart count of the publisher and number of its last publication read.
    last: (u32, u64),
    lost: u64,
}

impl<P: Carried + ?Sized> StreamReader<P> {
    pub(crate) fn open(service: &Samples<P>, place: &InputPlace<'_>) -> Result<Self, PortError> {
        let queue = service.subscriber_builder().create();
        let queue = queue.map_err(|error| refused(&place.topic.name, "making a subscriber")(&error))?;
        Ok(Self { queue: Rc::new(queue), topic: place.index, current: None, last: (0, 0), lost: 0 })
    }

    pub(crate) fn connection(&self) -> Rc<dyn Connect> {
        self.queue.clone()
    }

    /// Takes the next sample from the queue that may be read; whether there was one. One whose content is invalid, or whose
    /// number is not above the last one's, is refused and counted, and what was read before stays.
    pub(crate) fn take(&mut self, context: &Context) -> bool {
        while let Some(sample) = P::receive(&self.queue) {
            let stamp = *sample.user_header();
            let (restarts, number) = (stamp.restart_count, stamp.sequence);
            if number == 0 || (restarts, number) <= self.last || !P::of(&sample).is_valid() {
                add(&context.block().refused, 1);
                continue;
            }
            // A restarted publisher goes on counting; a reader that comes late has lost nothing.
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

    /// Forgets what was read in the episode before; what was left in the queue is gone already.
    pub(crate) fn begin_episode(&mut self) {
        (self.current, self.last) = (None, (0, 0));
    }

    /// The sample read last.
    #[inline]
    pub(crate) fn current(&self) -> Option<(&Stamp, &P)> {
        self.current.as_ref().map(|sample| (sample.user_header(), P::of(sample)))
    }

    /// Values that were overwritten in the queue before they were read.
    pub(crate) fn lost(&self) -> u64 {
        self.lost
    }
}

impl<P: Carried + ?Sized> Connect for Subscriber<Shared, P, Stamp> {
    fn connect(&self) -> Result<(), String> {
        self.update_connections().map_err(|error| error.to_string())
    }

    fn begin_episode(&self) {
        while P::receive(self).is_some() {}
    }
}
