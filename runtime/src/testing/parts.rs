//! Components made of closures: sources, functions, probes.

use std::sync::{Arc, Mutex};

use super::closure::{Closure, Part, Step, lock};
use super::instance::Instance;
use crate::component::{ConfigureError, Setup, Tick};
use crate::declare::{Declare, StepError};
use crate::state::{Stamp, StateBuffer};
use crate::telemetry::set_apart;

/// A component that publishes the values returned by a closure. In steps in which the closure returns `None`,
/// the component publishes nothing. The default rate is 1 kHz.
#[derive(Debug)]
pub struct Source(Instance);

/// A component that passes the newest sample of an input topic to a closure (`None` before the first sample)
/// and publishes the closure's result on an output topic. The default rate is 1 kHz.
#[derive(Debug)]
pub struct Function(Instance);

/// A component that records samples of a topic. The probe reads the topic at 1 kHz or, if
/// [`triggered`](Self::triggered), at every publication. Clones of a probe share their recorded samples.
#[derive(Debug)]
pub struct Probe<T: StateBuffer> {
    topic: String,
    name: String,
    rate: Option<String>,
    samples: Arc<Mutex<Vec<Sample<T>>>>,
}

/// A sample recorded by a [`Probe`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample<T> {
    /// Step in which the probe first read the sample.
    pub tick: Tick,
    /// Stamp of the sample.
    pub stamp: Stamp,
    /// Time of the state, ns since the start of the run; see [`Reading::time_ns`](crate::transport::Reading).
    pub time_ns: u64,
    /// Content of the sample.
    pub value: T,
}

impl Source {
    /// Creates a source that publishes the values of `next` on a topic.
    pub fn new<T: StateBuffer>(
        name: &str,
        topic: &str,
        mut next: impl FnMut(&Tick) -> Option<T> + Send + 'static,
    ) -> Self {
        let declare = |declare: &mut Declare| declare.output::<T>("output", "the samples of the closure");
        let open = move |setup: &mut Setup| {
            let mut output = setup.output::<T>("output")?;
            Ok(step(move |tick| match next(tick) {
                Some(value) => output.send(&value),
                None => Ok(()),
            }))
        };
        Self(instance(name, declare, open).publish("output", topic).rate("1 kHz"))
    }

    /// Sets the rate of the steps, such as `"100 Hz"`.
    #[must_use]
    pub fn rate(self, rate: &str) -> Self {
        Self(self.0.rate(rate))
    }
}

impl Function {
    /// Creates a component that publishes the results of `function` on the topic `to`, from the samples of
    /// the topic `from`.
    pub fn new<I: StateBuffer, O: StateBuffer>(
        name: &str,
        from: &str,
        to: &str,
        mut function: impl FnMut(&Tick, Option<&I>) -> Option<O> + Send + 'static,
    ) -> Self {
        let declare = |declare: &mut Declare| {
            declare.input::<I>("input", "the argument of the closure");
            declare.output::<O>("output", "the result of the closure");
        };
        let open = move |setup: &mut Setup| {
            let mut input = setup.input::<I>("input")?;
            let mut output = setup.output::<O>("output")?;
            Ok(step(move |tick| {
                let reading = input.latest();
                match function(tick, reading.as_deref()) {
                    Some(value) => output.send(&value),
                    None => Ok(()),
                }
            }))
        };
        let instance = instance(name, declare, open);
        Self(instance.subscribe("input", from).publish("output", to).rate("1 kHz"))
    }

    /// Sets the rate of the steps, such as `"100 Hz"`.
    #[must_use]
    pub fn rate(self, rate: &str) -> Self {
        Self(self.0.rate(rate))
    }

    /// Triggers a step at every publication of `topic`, which must be the input topic.
    #[must_use]
    pub fn trigger(self, topic: &str) -> Self {
        Self(self.0.trigger(topic))
    }
}

impl<T: StateBuffer> Probe<T> {
    /// Creates a probe of a topic. Its component is named `probe` followed by the topic's name.
    pub fn for_topic(topic: &str) -> Self {
        let name = format!("probe-{}", topic.replace('/', "-"));
        Self { topic: topic.to_string(), name, rate: Some("1 kHz".to_string()), samples: Arc::default() }
    }

    /// Sets the rate at which the probe reads, such as `"100 Hz"`.
    #[must_use]
    pub fn rate(mut self, rate: &str) -> Self {
        self.rate = Some(rate.to_string());
        self
    }

    /// Makes the probe read at every publication.
    #[must_use]
    pub fn triggered(mut self) -> Self {
        self.rate = None;
        self
    }

    /// Returns the samples recorded so far.
    pub fn samples(&self) -> Vec<Sample<T>> {
        lock(&self.samples).clone()
    }

    /// Returns the values of the samples recorded so far.
    pub fn values(&self) -> Vec<T> {
        lock(&self.samples).iter().map(|sample| sample.value).collect()
    }
}

impl<T: StateBuffer> Clone for Probe<T> {
    fn clone(&self) -> Self {
        let Self { topic, name, rate, samples } = self;
        Self { topic: topic.clone(), name: name.clone(), rate: rate.clone(), samples: samples.clone() }
    }
}

impl From<Source> for Instance {
    fn from(source: Source) -> Self {
        source.0
    }
}

impl From<Function> for Instance {
    fn from(function: Function) -> Self {
        function.0
    }
}

impl<T: StateBuffer + Send> From<&Probe<T>> for Instance {
    fn from(probe: &Probe<T>) -> Self {
        let samples = probe.samples.clone();
        let declare = |declare: &mut Declare| declare.input::<T>("input", "the samples to record");
        let open = move |setup: &mut Setup| {
            let mut input = setup.input::<T>("input")?;
            let mut last = None;
            Ok(step(move |tick| {
                let Some(reading) = input.latest() else { return Ok(()) };
                let stamp = reading.stamp();
                let number = (stamp.publisher, stamp.restart_count, stamp.sequence);
                if last != Some(number) {
                    last = Some(number);
                    let sample = Sample { tick: *tick, stamp, time_ns: reading.time_ns(), value: *reading };
                    set_apart(|| lock(&samples).push(sample));
                }
                Ok(())
            }))
        };
        let instance = instance(&probe.name, declare, open).subscribe("input", &probe.topic);
        match &probe.rate {
            Some(rate) => instance.rate(rate),
            None => instance.trigger(&probe.topic),
        }
    }
}

fn instance(
    name: &str,
    declare: fn(&mut Declare),
    open: impl FnOnce(&mut Setup) -> Result<Step, ConfigureError> + Send + 'static,
) -> Instance {
    let part = Part::new(declare, open);
    let mut instance = Instance::of::<Closure>(name).config("part", part.number() as i64);
    instance.part = Some(part);
    instance
}

fn step(step: impl FnMut(&Tick) -> Result<(), StepError> + 'static) -> Step {
    Box::new(step)
}
