//! Streams of slices: images, clouds, frames, each of another length up to a declared longest one.

#![allow(unsafe_code)] // a lent slice is shared memory that any bit pattern makes valid elements of

use std::rc::Rc;
use std::sync::atomic::Ordering::Relaxed;

use iceoryx2::node::Node;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::sample::Sample;
use iceoryx2::sample_mut::SampleMut;

use super::Shared;
use super::reader::Place;
use crate::declare::{StepError, TopicPattern};
use crate::plan::TopicPlan;
use crate::region::add;
use crate::state::{Stamp, StateBuffer};
use crate::transport::input::InputPlace;
use crate::transport::output::Wired;
use crate::transport::stamping::{source_time, stamp};
use crate::transport::topic::{open_slices, refused};
use crate::transport::{Connect, Context, PortError, Probe};

/// An input port that reads every slice of a stream, in order and in place.
///
/// ```
/// # use motorium::prelude::*;
/// # use motorium::transport::SliceInput;
/// fn mean_brightness(image: &mut SliceInput<u8>) -> Option<f64> {
///     let (_, pixels) = image.next_unread()?;
///     let sum: u64 = pixels.iter().map(|pixel| u64::from(*pixel)).sum();
///     Some(sum as f64 / pixels.len().max(1) as f64)
/// }
/// ```
#[derive(Debug)]
pub struct SliceInput<T: StateBuffer> {
    subscriber: Option<Rc<Subscriber<Shared, [T], Stamp>>>,
    current: Option<Sample<Shared, [T], Stamp>>,
    place: Place,
    /// Index of the topic.
    topic: usize,
    is_cause: bool,
    edge: Option<usize>,
    lost: u64,
    /// The episode of the last look.
    episode: u64,
    context: Rc<Context>,
}

impl<T: StateBuffer> SliceInput<T> {
    pub(crate) fn unwired(context: Rc<Context>) -> Self {
        Self {
            subscriber: None,
            current: None,
            place: Place::default(),
            topic: 0,
            is_cause: false,
            edge: None,
            lost: 0,
            episode: 0,
            context,
        }
    }

    pub(crate) fn open(
        node: &Node<Shared>,
        place: InputPlace<'_>,
        context: Rc<Context>,
    ) -> Result<Self, PortError> {
        let InputPlace { index, topic, port, is_cause, edge, .. } = place;
        let subscriber = open_slices::<T>(node, topic, port)?
            .subscriber_builder()
            .create()
            .map_err(|error| refused(&topic.name, "making a subscriber")(&error))?;
        let subscriber = Some(Rc::new(subscriber));
        Ok(Self { subscriber, topic: index, is_cause, edge, ..Self::unwired(context) })
    }

    /// The connection to be made before the first step.
    pub(crate) fn connection(&self) -> Option<Rc<dyn Connect>> {
        self.subscriber.clone().map(|subscriber| subscriber as Rc<dyn Connect>)
    }

    /// True if the graph wires this input.
    pub fn is_wired(&self) -> bool {
        self.subscriber.is_some()
    }

    /// The next slice that was not read, in order, with its stamp. It stays where it is until the next call.
    pub fn next_unread(&mut self) -> Option<(Stamp, &[T])> {
        let subscriber = self.subscriber.as_ref()?;
        if self.episode != self.context.episode() {
            self.episode = self.context.episode();
            (self.current, self.place) = (None, Place::default());
        }
        loop {
            let sample = subscriber.receive().ok().flatten()?;
            let stamp = *sample.user_header();
            let valid = T::check_all(sample.payload()).is_ok();
            let Some(lost) = self.place.advance(&stamp).filter(|_| valid) else {
                add(&self.context.block().refused, 1);
                continue;
            };
            if lost > 0 {
                self.lost += lost;
                self.context.region().topics()[self.topic].dropped.fetch_add(lost, Relaxed);
            }
            if let Some(edge) = self.edge {
                self.context.note_read(edge, &stamp);
            }
            if self.is_cause {
                self.context.causality().propagate(&stamp);
            }
            let sample = self.current.insert(sample);
            return Some((stamp, sample.payload()));
        }
    }

    /// The slice read last.
    pub fn current(&self) -> Option<(Stamp, &[T])> {
        let current = self.current.as_ref().filter(|_| self.episode == self.context.episode());
        current.map(|sample| (*sample.user_header(), sample.payload()))
    }

    /// Slices that were overwritten before they were read.
    pub fn lost(&self) -> u64 {
        self.lost
    }
}

type SlicePublisher<T> = Publisher<Shared, [T], Stamp>;

/// An output port that writes slices of up to a declared longest length, in place.
///
/// ```
/// # use motorium::prelude::*;
/// # use motorium::transport::SliceOutput;
/// fn publish_black(image: &mut SliceOutput<u8>, pixels: usize) -> Result<(), StepError> {
///     let mut loan = image.loan(pixels)?; // holds whatever an earlier slice left there
///     loan.fill(0);
///     loan.publish()
/// }
/// ```
#[derive(Debug)]
pub struct SliceOutput<T: StateBuffer> {
    port: &'static str,
    longest: usize,
    wired: Option<(Rc<SlicePublisher<T>>, Wired)>,
    scratch: Vec<T>,
    context: Rc<Context>,
}

/// A slice to fill in place and publish. Dropping it publishes nothing.
#[derive(Debug)]
pub struct SliceLoan<'a, T: StateBuffer> {
    sample: Option<SampleMut<Shared, [T], Stamp>>,
    length: usize,
    output: &'a mut SliceOutput<T>,
}

impl<T: StateBuffer> SliceOutput<T> {
    pub(crate) fn unwired(port: &'static str, longest: usize, context: Rc<Context>) -> Self {
        Self { port, longest, wired: None, scratch: vec![T::ZERO; longest], context }
    }

    pub(crate) fn open(
        node: &Node<Shared>,
        topic: (usize, &TopicPlan),
        port: &'static str,
        probes: Vec<Probe>,
        context: Rc<Context>,
    ) -> Result<Self, PortError> {
        let (index, topic) = topic;
        let TopicPattern::Slices { longest, .. } = topic.pattern else {
            return Err(refused(&topic.name, "opening a port for slices")(&"it carries single values"));
        };
        let publisher = open_slices::<T>(node, topic, port)?
            .publisher_builder()
            .max_loaned_samples(1)
            .initial_max_slice_len(longest)
            .create()
            .map_err(|error| refused(&topic.name, "making a publisher")(&error))?;
        let wired = Wired::new(index, context.memory(node, topic)?, None, probes);
        Ok(Self { port, longest, wired: Some((Rc::new(publisher), wired)), scratch: Vec::new(), context })
    }

    /// The worker ends every step of this output's component.
    pub(crate) fn ending_steps(mut self, stays_on_core: bool) -> Self {
        if let Some((_, wired)) = &mut self.wired {
            wired.ending_steps(&self.context, stays_on_core);
        }
        self
    }

    /// The connection to be made before the first step.
    pub(crate) fn connection(&self) -> Option<Rc<dyn Connect>> {
        self.wired.as_ref().map(|(publisher, _)| publisher.clone() as Rc<dyn Connect>)
    }

    /// True if the graph wires this output.
    pub fn is_wired(&self) -> bool {
        self.wired.is_some()
    }

    /// The longest slice, elements.
    pub fn longest(&self) -> usize {
        self.longest
    }

    /// Lends the memory of the next slice, of this length.
    ///
    /// # Errors
    /// The slice is longer than declared, or readers hold all samples.
    pub fn loan(&mut self, length: usize) -> Result<SliceLoan<'_, T>, StepError> {
        let failed = |reason| StepError::Transport { port: self.port, reason };
        if length > self.longest {
            return Err(failed("the slice is longer than the output declares"));
        }
        let sample = match &self.wired {
            None => None,
            Some((publisher, _)) => {
                let sample =
                    publisher.loan_slice_uninit(length).map_err(|_| failed("no sample could be lent"))?;
                // SAFETY: the memory is mapped, initialised by the system or an earlier sample, and every bit pattern
                // is a valid `T` (the contract of `Field`).
                Some(unsafe { sample.assume_init() })
            }
        };
        Ok(SliceLoan { sample, length, output: self })
    }
}

impl<T: StateBuffer> core::ops::Deref for SliceLoan<'_, T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        match &self.sample {
            Some(sample) => sample.payload(),
            None => &self.output.scratch[..self.length],
        }
    }
}

impl<T: StateBuffer> core::ops::DerefMut for SliceLoan<'_, T> {
    fn deref_mut(&mut self) -> &mut [T] {
        match &mut self.sample {
            Some(sample) => sample.payload_mut(),
            None => &mut self.output.scratch[..self.length],
        }
    }
}

impl<T: StateBuffer> SliceLoan<'_, T> {
    /// Publishes the slice and wakes the components that it triggers.
    ///
    /// # Errors
    /// [`StepError::InvalidOutput`] if it holds a number that is not finite: it is then not published.
    pub fn publish(self) -> Result<(), StepError> {
        self.finish(None)
    }

    /// As [`publish`](Self::publish), with the source time of the slice, such as the exposure of an image, ns on the clock
    /// of stamps: see [`Loan::publish_from`](crate::transport::Loan::publish_from).
    ///
    /// # Errors
    /// As [`publish`](Self::publish); and [`StepError::SourceInFuture`] if the source time is in the future by more than
    /// 1 ms.
    pub fn publish_from(self, source_ns: u64) -> Result<(), StepError> {
        self.finish(Some(source_ns))
    }

    #[inline(always)]
    fn finish(self, source_ns: Option<u64>) -> Result<(), StepError> {
        let port = self.output.port;
        if let Err(defect) = T::check_all(&self) {
            add(&self.output.context.block().refused, 1);
            return Err(StepError::InvalidOutput { port, defect });
        }
        let Self { sample, output, .. } = self;
        let context = &*output.context;
        let (Some(mut sample), Some((_, wired))) = (sample, &mut output.wired) else { return Ok(()) };
        let now = context.clock().now_ns();
        if context.withholds(now) {
            add(&context.block().refused, 1);
            return Ok(());
        }
        let source = source_time(context, source_ns, now)
            .map_err(|ahead_ns| StepError::SourceInFuture { port, ahead_ns })?;
        let stamp = stamp(context, wired.next_number(), now, source);
        if context.clock().is_lockstep() {
            wired.digest(context, stamp, |digest| {
                digest.write_u64(sample.payload().len() as u64);
                T::digest_all(sample.payload(), digest);
            });
        }
        *sample.user_header_mut() = stamp;
        sample.send().map_err(|_| StepError::Transport { port, reason: "the sample was not sent" })?;
        wired.count(context, now);
        wired.announce(context, stamp);
        Ok(())
    }
}

impl<T: StateBuffer> Connect for Subscriber<Shared, [T], Stamp> {
    fn connect(&self) -> Result<(), String> {
        self.update_connections().map_err(|error| error.to_string())
    }

    fn begin_episode(&self) {
        while matches!(self.receive(), Ok(Some(_))) {}
    }
}

impl<T: StateBuffer> Connect for SlicePublisher<T> {
    fn connect(&self) -> Result<(), String> {
        self.update_connections().map_err(|error| error.to_string())
    }
}
