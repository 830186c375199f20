//! The writing side of a topic.

#![allow(unsafe_code)] // a lent sample is shared memory that any bit pattern makes a valid value of

use std::rc::Rc;
use std::sync::atomic::Ordering::Relaxed;

use iceoryx2::node::Node;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::sample_mut::SampleMut;

use super::bell::Bell;
use super::eager::{fetch_to_write, learn};
use super::echo::Echo;
use super::slots::Slots;
use super::topic::{open, refused};
use super::{AfterStep as _, Context, PortError, Shared};
use crate::declare::StepError;
use crate::plan::{OnMiss, TopicPlan};
use crate::region::{Command, add};
use crate::state::{Digest, Stamp, StateBuffer};

/// So much of a sample is fetched ahead, bytes: beyond, the processor sees the pattern itself.
pub(super) const FETCHED: usize = 1024;
/// How often an output learns over which connections it sends: readers come and go.
const RELEARNT: u64 = 64;
/// So many places of samples are remembered.
const TURNS: usize = 8;

/// A port whose connections can be made before the first step.
pub(crate) trait Connect {
    fn connect(&self) -> Result<(), String>;
}

/// A latency budget that ends at an output.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Probe {
    pub(crate) index: usize,
    pub(crate) max_ns: u64,
    pub(crate) on_miss: OnMiss,
}

/// Writes a topic in place. What is published on an output that the graph leaves unwired goes nowhere.
#[derive(Debug)]
pub struct Output<T: StateBuffer> {
    port: &'static str,
    wired: Option<Wired<T>>,
    scratch: Box<T>,
    sequence: u64,
    context: Rc<Context>,
}

#[derive(Debug)]
struct Wired<T: StateBuffer> {
    topic: usize,
    publisher: Rc<Publisher<Shared, T, Stamp>>,
    /// Not used in lockstep, where nobody waits for a topic.
    bell: Option<Rc<Bell>>,
    /// Of a small state: where its readers find it.
    slots: Option<Slots<T>>,
    echo: Rc<Echo<T>>,
    /// Whether the worker ends every step, and with it wakes those on its own core, and echoes.
    ends_steps: bool,
    wakes_late: bool,
    places: Places,
    probes: Vec<Probe>,
    digest: Digest,
}

/// A sample to fill in place and publish. Dropping it publishes nothing.
///
/// It holds whatever an earlier sample left there: write every field that is meant to be read.
#[derive(Debug)]
pub struct Loan<'a, T: StateBuffer> {
    sample: Option<SampleMut<Shared, T, Stamp>>,
    output: &'a mut Output<T>,
}

impl<T: StateBuffer> Output<T> {
    pub(crate) fn unwired(port: &'static str, context: Rc<Context>) -> Self {
        Self { port, wired: None, scratch: Box::new(T::ZERO), sequence: 0, context }
    }

    pub(crate) fn open(
        node: &Node<Shared>,
        topic: (usize, &TopicPlan),
        port: &'static str,
        probes: Vec<Probe>,
        context: Rc<Context>,
    ) -> Result<Self, PortError> {
        let (index, topic) = topic;
        let samples = open::<T>(node, topic, port)?;
        let publisher = samples
            .publisher_builder()
            .max_loaned_samples(1)
            .create()
            .map_err(|error| refused(&topic.name, "making a publisher")(&error))?;
        let bell = context.bell(node, topic)?;
        let publisher = Rc::new(publisher);
        let slots = Slots::of(&bell, topic);
        // In lockstep nobody waits for a topic.
        let rings = (!context.clock().is_lockstep()).then(|| bell.clone());
        let echo = Rc::new(Echo::new(samples, publisher.clone(), rings.clone(), Slots::of(&bell, topic)));
        let wired = Wired {
            topic: index,
            publisher,
            bell: rings,
            slots,
            echo,
            ends_steps: false,
            wakes_late: false,
            places: Places::default(),
            probes,
            digest: Digest::default(),
        };
        Ok(Self { wired: Some(wired), ..Self::unwired(port, context) })
    }

    /// The worker ends every step of this output's component; only then those are woken that it triggers, if they are
    /// all on its own core.
    pub(crate) fn ending_steps(mut self, stays_on_core: bool) -> Self {
        if let Some(wired) = &mut self.wired {
            (wired.ends_steps, wired.wakes_late) = (true, stays_on_core);
            self.context.deferred().add(wired.echo.clone());
        }
        self
    }

    /// What must be connected before the first step.
    pub(crate) fn connection(&self) -> Option<Rc<dyn Connect>> {
        self.wired.as_ref().map(|wired| wired.publisher.clone() as Rc<dyn Connect>)
    }

    /// Whether the graph wires this output.
    pub fn is_wired(&self) -> bool {
        self.wired.is_some()
    }

    /// Lends the memory of the next sample.
    ///
    /// # Errors
    /// All samples are held by readers, which cannot happen while every reader keeps to its limits.
    pub fn loan(&mut self) -> Result<Loan<'_, T>, StepError> {
        let sample = match &mut self.wired {
            None => None,
            Some(Wired { slots: Some(slots), .. }) => {
                slots.begin();
                None
            }
            Some(wired) => {
                let sample = wired.publisher.loan_uninit().map_err(|_| StepError::Transport {
                    port: self.port,
                    reason: "no sample could be lent",
                })?;
                // SAFETY: the memory is mapped, initialised by the system or an earlier sample, and every bit
                // pattern is a valid `T` (the contract of `Field`).
                Some(unsafe { sample.assume_init() })
            }
        };
        Ok(Loan { sample, output: self })
    }

    /// Publishes a copy of a value.
    ///
    /// # Errors
    /// As [`Loan::publish`].
    pub fn send(&mut self, value: &T) -> Result<(), StepError> {
        let mut loan = self.loan()?;
        *loan = *value;
        loan.publish()
    }
}

impl<T: StateBuffer> core::ops::Deref for Loan<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        match (&self.sample, &self.output.wired) {
            (Some(sample), _) => sample.payload(),
            (None, Some(Wired { slots: Some(slots), .. })) => slots.begun(),
            (None, _) => &self.output.scratch,
        }
    }
}

impl<T: StateBuffer> core::ops::DerefMut for Loan<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        match (&mut self.sample, &mut self.output.wired) {
            (Some(sample), _) => sample.payload_mut(),
            (None, Some(Wired { slots: Some(slots), .. })) => slots.begun_mut(),
            (None, _) => &mut self.output.scratch,
        }
    }
}

impl<T: StateBuffer> Loan<'_, T> {
    /// Publishes the sample and wakes whom it triggers.
    ///
    /// # Errors
    /// [`StepError::InvalidOutput`] if it holds a number that is not finite or a count that does not fit: it is then
    /// not published, its readers keep the older value.
    pub fn publish(mut self) -> Result<(), StepError> {
        if let Err(defect) = self.check() {
            add(&self.output.context.block().refused, 1);
            return Err(StepError::InvalidOutput { port: self.output.port, defect });
        }
        let sample = self.sample.take();
        let output = &mut *self.output;
        let context = &output.context;
        let Some(wired) = output.wired.as_mut() else { return Ok(()) };
        let now = context.clock().now_ns();
        if context.withholds(now) {
            add(&context.block().refused, 1);
            return Ok(());
        }
        output.sequence += 1;
        let source_time = context.causality().source_time_or(now);
        let stamp = Stamp {
            sequence: output.sequence,
            source_time,
            publish_time: now,
            state_time: context.causality().state_time_or(context.clock().step_ns()),
            origin: context.index() as u32,
            incarnation: context.incarnation(),
        };
        if context.clock().is_lockstep() {
            let content: &T = match (&sample, &wired.slots) {
                (Some(sample), _) => sample.payload(),
                (None, Some(slots)) => slots.begun(),
                (None, None) => &output.scratch,
            };
            wired.digest.write_u64(output.sequence);
            wired.digest.write_u64(now);
            content.digest(&mut wired.digest);
            context.region().topics()[wired.topic].digest.store(wired.digest.finish(), Relaxed);
        }
        match (sample, &mut wired.slots) {
            (Some(sample), _) => wired.send(sample, stamp, output.port)?,
            (None, Some(slots)) => {
                slots.publish(stamp);
                wired.echo.owe_echo();
            }
            (None, None) => {}
        }
        wired.tell(context, stamp);
        Ok(())
    }
}

impl<T: StateBuffer> Wired<T> {
    /// Sends an iceoryx2 sample.
    fn send(
        &mut self,
        mut sample: SampleMut<Shared, T, Stamp>,
        stamp: Stamp,
        port: &'static str,
    ) -> Result<(), StepError> {
        let address = core::ptr::from_ref::<T>(sample.payload()) as usize;
        *sample.user_header_mut() = stamp;
        let sent = if stamp.sequence % RELEARNT == 1 { learn(|| sample.send()) } else { sample.send() };
        sent.map_err(|_| StepError::Transport { port, reason: "the sample was not sent" })?;
        if let Some(bell) = &self.bell {
            bell.point_to(self.places.offset(address));
        }
        fetch_to_write(self.places.after(address), size_of::<T>().min(FETCHED));
        Ok(())
    }

    /// Lets everybody know of a publication: those who wait, those who count, those who measure.
    fn tell(&self, context: &Context, stamp: Stamp) {
        let region = context.region();
        let block = &region.topics()[self.topic];
        add(&block.published, 1);
        block.last_publish_ns.store(stamp.publish_time, Relaxed);
        if let Some(bell) = &self.bell {
            bell.count(context.core());
            if self.wakes_late {
                self.echo.owe_wake();
            } else {
                bell.wake();
            }
        }
        if let Some(slots) = &self.slots {
            if !self.wakes_late {
                slots.fetch_next();
            }
            if !self.ends_steps {
                self.echo.echo();
            }
        }
        for probe in &self.probes {
            let latency = stamp.publish_time.saturating_sub(stamp.source_time);
            let measured = &region.latencies()[probe.index];
            measured.latency.record(latency);
            if latency > probe.max_ns {
                add(&measured.missed, 1);
                if probe.on_miss == OnMiss::SafeStop {
                    region.header().order(Command::SafeStop);
                }
            }
        }
    }
}

/// Where the samples of one publisher lie. They take turns, so the next can be fetched while there is time.
#[derive(Debug, Default)]
struct Places {
    first: usize,
    last: usize,
    /// Each place with the one that followed it the last time.
    turns: [(usize, usize); TURNS],
    oldest: usize,
}

impl Places {
    /// Of a sample, from the first that was ever published.
    fn offset(&mut self, address: usize) -> u64 {
        if self.first == 0 {
            self.first = address;
        }
        address.wrapping_sub(self.first) as u64
    }

    /// The place that followed this one the last time; the first one if it is new.
    fn after(&mut self, address: usize) -> usize {
        match self.turns.iter_mut().find(|(before, _)| *before == self.last) {
            Some(turn) => turn.1 = address,
            None => {
                self.turns[self.oldest] = (self.last, address);
                self.oldest = (self.oldest + 1) % TURNS;
            }
        }
        self.last = address;
        self.turns.iter().find(|(before, _)| *before == address).map_or(self.first, |(_, next)| *next)
    }
}

impl<T: StateBuffer> Connect for Publisher<Shared, T, Stamp> {
    fn connect(&self) -> Result<(), String> {
        self.update_connections().map_err(|error| error.to_string())
    }
}
