//! The writing side of a topic.

#![allow(unsafe_code)] // a lent sample is shared memory that any bit pattern makes a valid value of

use std::rc::Rc;
use std::sync::atomic::Ordering::Relaxed;

use iceoryx2::node::Node;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::sample_mut::SampleMut;

use super::topic::{open, open_waker, refused};
use super::{PortError, Shared, Waker};
use crate::component::StepError;
use crate::plan::{OnMiss, TopicPlan};
use crate::region::{Command, add};
use crate::state::{Digest, Stamp, StateBuffer};
use crate::worker::Context;

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
    waker: Option<Waker>,
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
        let publisher = open::<T>(node, topic, port)?
            .publisher_builder()
            .max_loaned_samples(1)
            .create()
            .map_err(|error| refused(&topic.name, "making a publisher")(&error))?;
        let waker = if context.is_lockstep() { None } else { open_waker(node, topic)? };
        let publisher = Rc::new(publisher);
        let wired = Wired { topic: index, publisher, waker, probes, digest: Digest::default() };
        Ok(Self { wired: Some(wired), ..Self::unwired(port, context) })
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
        let sample = match &self.wired {
            None => None,
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
        match &self.sample {
            Some(sample) => sample.payload(),
            None => &self.output.scratch,
        }
    }
}

impl<T: StateBuffer> core::ops::DerefMut for Loan<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        match &mut self.sample {
            Some(sample) => sample.payload_mut(),
            None => &mut self.output.scratch,
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
        let output = &mut *self.output;
        let context = &output.context;
        let content: &T = self.sample.as_ref().map_or(&output.scratch, |sample| sample.payload());
        if let Err(defect) = content.check() {
            add(&context.block().refused, 1);
            return Err(StepError::InvalidOutput { port: output.port, defect });
        }
        let (Some(mut sample), Some(wired)) = (self.sample.take(), output.wired.as_mut()) else {
            return Ok(());
        };
        let now = context.now_ns();
        if context.withholds(now) {
            add(&context.block().refused, 1);
            return Ok(());
        }
        output.sequence += 1;
        let source_time = context.source_time_or(now);
        *sample.user_header_mut() = Stamp {
            sequence: output.sequence,
            source_time,
            publish_time: now,
            origin: context.index() as u32,
            incarnation: context.incarnation(),
        };
        let region = context.region();
        let block = &region.topics()[wired.topic];
        if context.is_lockstep() {
            wired.digest.write_u64(output.sequence);
            wired.digest.write_u64(now);
            sample.payload().digest(&mut wired.digest);
            block.digest.store(wired.digest.finish(), Relaxed);
        }
        sample
            .send()
            .map_err(|_| StepError::Transport { port: output.port, reason: "the sample was not sent" })?;
        add(&block.published, 1);
        block.last_publish_ns.store(now, Relaxed);
        for probe in &wired.probes {
            let latency = now.saturating_sub(source_time);
            let measured = &region.latencies()[probe.index];
            measured.latency.record(latency);
            if latency > probe.max_ns {
                add(&measured.missed, 1);
                if probe.on_miss == OnMiss::SafeStop {
                    region.header().order(Command::SafeStop);
                }
            }
        }
        if let Some(waker) = &wired.waker {
            waker.wake();
        }
        Ok(())
    }
}

impl<T: StateBuffer> Connect for Publisher<Shared, T, Stamp> {
    fn connect(&self) -> Result<(), String> {
        self.update_connections().map_err(|error| error.to_string())
    }
}
