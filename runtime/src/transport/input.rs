//! The reading side of a topic.

use std::rc::Rc;
use std::sync::atomic::Ordering::Relaxed;

use iceoryx2::node::Node;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::sample::Sample;

use super::bell::Bell;
use super::eager::{fetch_sent_over, fetch_to_read};
use super::echo::own_name;
use super::output::FETCHED;
use super::slots::{Copied, Slots};
use super::topic::{open, refused};
use super::{Connect, Context, PortError, Shared};
use crate::declare::TopicPattern;
use crate::plan::TopicPlan;
use crate::region::add;
use crate::state::{Stamp, StateBuffer};

/// At the first and then at every so manieth look all connections are asked, not only until the topic's own component
/// has no more to say.
const THOROUGH: u32 = 16;

/// Reads a topic in place. An input that the graph leaves unwired never has a sample.
#[derive(Debug)]
pub struct Input<T: StateBuffer> {
    subscriber: Option<Rc<Subscriber<Shared, T, Stamp>>>,
    /// Of a small state: where its component leaves it.
    slots: Option<Slots<T>>,
    /// Number of the value copied last.
    copied: u64,
    /// The value copied last and one to copy the next into, which take turns.
    copies: Box<[Copied<T>; 2]>,
    /// Which of them was copied last.
    last_copy: usize,
    /// Incarnation and sequence of the value copied last.
    own: (u32, u64),
    /// What was read last.
    current: Current<T>,
    /// Whether other iceoryx2 programs publish on the topic as well.
    has_guests: bool,
    /// Index of the component that writes the topic.
    writer: u32,
    context: Rc<Context>,
    is_cause: bool,
    last_origin: (u32, u32),
    last_sequence: u64,
    lost: u64,
    /// Index of the topic if it is a stream: what is lost of it counts.
    stream: Option<usize>,
    /// Rung at every publication; not in lockstep.
    bell: Option<Rc<Bell>>,
    /// Rings heard at the last look.
    heard: u32,
    /// Where the publisher counts the places of its samples from, in the memory of this process.
    base: usize,
    /// Looks at the newest sample so far.
    looks: u32,
    /// Index of the edge from the topic to this component.
    edge: Option<usize>,
}

/// What was read last.
#[derive(Debug)]
enum Current<T: StateBuffer> {
    Nothing,
    /// The value copied last.
    Copy,
    /// In place.
    Sample(Sample<Shared, T, Stamp>),
}

/// A sample: a small state as it was when it was read, anything else in place in shared memory.
#[derive(Debug)]
pub struct Reading<'a, T: StateBuffer> {
    stamp: &'a Stamp,
    payload: &'a T,
    context: &'a Context,
}

impl<T: StateBuffer> core::ops::Deref for Reading<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        self.payload
    }
}

impl<T: StateBuffer> Reading<'_, T> {
    /// When and by whom it was made.
    pub fn stamp(&self) -> Stamp {
        *self.stamp
    }

    /// The time that the state is for, ns since the run began: the scheduled release of the time-triggered step at the
    /// head of the chain of triggers. It keeps to the grid of that rate, so a difference quotient over it does not jitter;
    /// [`Tick::time_ns`](crate::component::Tick::time_ns) of a time-triggered component is on the same clock.
    pub fn time_ns(&self) -> u64 {
        self.stamp.state_time.saturating_sub(self.context.clock().start_ns())
    }

    /// Time since it was published, ns.
    pub fn age_ns(&self) -> u64 {
        self.context.clock().now_ns().saturating_sub(self.stamp.publish_time)
    }
}

impl<T: StateBuffer> Input<T> {
    pub(crate) fn unwired(context: Rc<Context>) -> Self {
        Self {
            subscriber: None,
            slots: None,
            copied: 0,
            own: (0, 0),
            copies: Box::new([Copied::nothing(), Copied::nothing()]),
            last_copy: 0,
            current: Current::Nothing,
            has_guests: false,
            writer: 0,
            context,
            is_cause: false,
            last_origin: (0, 0),
            last_sequence: 0,
            lost: 0,
            stream: None,
            bell: None,
            heard: 0,
            base: 0,
            looks: 0,
            edge: None,
        }
    }

    pub(crate) fn open(
        node: &Node<Shared>,
        topic: (usize, &TopicPlan),
        port: &str,
        is_cause: bool,
        edge: Option<usize>,
        context: Rc<Context>,
    ) -> Result<Self, PortError> {
        let (index, topic) = topic;
        let stream = matches!(topic.pattern, TopicPattern::Stream { .. }).then_some(index);
        let name = own_name().map_err(|error| refused(&topic.name, "naming a subscriber")(&error))?;
        let subscriber = open::<T>(node, topic, port)?
            .subscriber_builder()
            .name(&name)
            .create()
            .map_err(|error| refused(&topic.name, "making a subscriber")(&error))?;
        let bell = context.bell(node, topic)?;
        Ok(Self {
            subscriber: Some(Rc::new(subscriber)),
            is_cause,
            stream,
            edge,
            slots: Slots::of(&bell, topic),
            bell: (!context.clock().is_lockstep()).then_some(bell),
            writer: topic.writer as u32,
            ..Self::unwired(context)
        })
    }

    /// What must be connected before the first step.
    pub(crate) fn connection(&self) -> Option<Rc<dyn Connect>> {
        self.subscriber.clone().map(|subscriber| subscriber as Rc<dyn Connect>)
    }

    /// Whether the graph wires this input.
    pub fn is_wired(&self) -> bool {
        self.subscriber.is_some()
    }

    /// Whether the topic's component has published since the last look at this input; for loops that look again and
    /// again, which this costs far less than [`latest`](Self::latest) and does not disturb the publisher. What other
    /// iceoryx2 programs publish does not show here. Always true in lockstep.
    pub fn has_news(&self) -> bool {
        self.bell.as_ref().is_none_or(|bell| bell.rings() != self.heard)
    }

    /// The newest valid sample, if there ever was one.
    pub fn latest(&mut self) -> Option<Reading<'_, T>> {
        let thorough = self.looks.is_multiple_of(THOROUGH);
        self.looks = self.looks.wrapping_add(1);
        if self.slots.is_some() {
            if let Some(bell) = &self.bell {
                self.heard = bell.rings();
            }
            self.copy();
            if thorough || self.has_guests {
                self.hear_guests();
            }
            return self.reading();
        }
        let (place, published) = self.fetch();
        while let Some(sample) = self.receive() {
            let stamp = sample.user_header();
            let next = (stamp.origin, stamp.incarnation) == self.last_origin
                && stamp.sequence == self.last_sequence.wrapping_add(1);
            if self.admit(*stamp, sample.payload().check().is_ok()) {
                let address = core::ptr::from_ref::<T>(sample.payload()) as usize;
                self.base = address.wrapping_sub(place);
                self.current = Current::Sample(sample);
                if next && published == 1 && !thorough {
                    // The one publication since the last look: only another iceoryx2 program may have sent more.
                    break;
                }
            }
        }
        self.reading()
    }

    /// Copies the newest value that the topic's component has left, if it is news and valid.
    fn copy(&mut self) {
        let Some(slots) = &self.slots else { return };
        let next = 1 - self.last_copy;
        let Some(number) = slots.read(self.copied, &mut self.copies[next]) else { return };
        self.copied = number;
        let Copied { stamp, payload } = &self.copies[next];
        // Seen already if it came as an echo.
        self.own = (stamp.incarnation, stamp.sequence);
        let known = (stamp.origin, stamp.incarnation) == self.last_origin
            && stamp.sequence == self.last_sequence
            && stamp.sequence > 0;
        if known || self.admit(*stamp, payload.check().is_ok()) {
            self.last_copy = next;
            self.current = Current::Copy;
        }
    }

    /// Takes what other iceoryx2 programs have published; echoes of the topic's own component are no news.
    fn hear_guests(&mut self) {
        while let Some(sample) = self.receive() {
            let stamp = *sample.user_header();
            let is_echo = stamp.origin == self.writer
                && stamp.sequence > 0
                && (stamp.incarnation, stamp.sequence) <= self.own;
            if is_echo {
                continue;
            }
            self.has_guests |= stamp.origin != self.writer || stamp.sequence == 0;
            if self.admit(stamp, sample.payload().check().is_ok()) {
                self.current = Current::Sample(sample);
            }
        }
    }

    /// Has the newest sample on its way from the publisher's core while the queue is asked for it. Only a hint: the
    /// queue decides what is read. Returns its place, and the publications since the last look; 0 in lockstep.
    fn fetch(&mut self) -> (usize, u32) {
        let Some(bell) = &self.bell else { return (0, 0) };
        let rings = bell.rings();
        let place = bell.place() as usize;
        let published = rings.wrapping_sub(self.heard);
        if published > 0 {
            self.heard = rings;
            if self.base != 0 {
                // The two headers lie before the payload.
                let headers = 2 * size_of::<Stamp>();
                let bytes = headers + size_of::<T>().min(FETCHED);
                fetch_to_read(self.base.wrapping_add(place).wrapping_sub(headers), bytes);
            }
            fetch_sent_over();
        }
        (place, published)
    }

    /// The next valid sample of a stream, in order, if there is one that has not been read.
    pub fn next_unread(&mut self) -> Option<Reading<'_, T>> {
        loop {
            let sample = self.receive()?;
            if self.admit(*sample.user_header(), sample.payload().check().is_ok()) {
                self.current = Current::Sample(sample);
                return self.reading();
            }
        }
    }

    /// The sample read last, without looking for a newer one.
    pub fn current(&self) -> Option<Reading<'_, T>> {
        let (stamp, payload) = match &self.current {
            Current::Nothing => return None,
            Current::Copy => {
                let copy = &self.copies[self.last_copy];
                (&copy.stamp, &copy.payload)
            }
            Current::Sample(sample) => (sample.user_header(), sample.payload()),
        };
        Some(Reading { stamp, payload, context: &self.context })
    }

    /// Samples of a stream that were overwritten before they were read.
    pub fn lost(&self) -> u64 {
        self.lost
    }

    fn receive(&self) -> Option<Sample<Shared, T, Stamp>> {
        // An error here means a connection could not be made to a publisher that is just dying or being born; the
        // sample is then simply not there yet, and its age tells.
        self.subscriber.as_ref()?.receive().ok().flatten()
    }

    /// A sample is only looked at when its sequence and its content have been checked.
    fn admit(&mut self, stamp: Stamp, is_valid: bool) -> bool {
        let origin = (stamp.origin, stamp.incarnation);
        let newer = origin != self.last_origin || stamp.sequence > self.last_sequence;
        if stamp.sequence == 0 || !newer || !is_valid {
            add(&self.context.block().refused, 1);
            return false;
        }
        if origin == self.last_origin {
            let lost = stamp.sequence - self.last_sequence - 1;
            self.lost += lost;
            if lost > 0
                && let Some(topic) = self.stream
            {
                self.context.region().topics()[topic].dropped.fetch_add(lost, Relaxed);
            }
        }
        (self.last_origin, self.last_sequence) = (origin, stamp.sequence);
        if let Some(edge) = self.edge {
            self.context.note_age(edge, stamp.publish_time);
        }
        true
    }

    fn reading(&self) -> Option<Reading<'_, T>> {
        let reading = self.current()?;
        if self.is_cause {
            self.context.causality().propagate(reading.stamp);
        }
        Some(reading)
    }
}

impl<T: StateBuffer> Connect for Subscriber<Shared, T, Stamp> {
    fn connect(&self) -> Result<(), String> {
        self.update_connections().map_err(|error| error.to_string())
    }
}
