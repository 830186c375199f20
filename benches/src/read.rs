//! The cost of reading the newest value of a state without touching its bytes.

use std::path::Path;

use motorium::graph::{self, Machine};
use motorium::os::{Request, apply, monotonic_ns, prefault_stack};
use motorium::plan::SchedulingClass;
use motorium::testing::{Endpoint, TopicSet};
use motorium::worker::Registry;

use crate::MeasureError;
use crate::payload::{Payload, PayloadVisitor, with_payload};

/// Publishes values of a size and reads each once; the time of each read, ns, and the priority read back.
pub(crate) fn newest(
    registry: &Registry,
    bytes: usize,
    reads: usize,
    core: usize,
    fifo: u8,
) -> Result<(Vec<u64>, u32), MeasureError> {
    let text = format!(
        r#"
name = "bench-read"
[component.writer]
kind = "bench.relay"
rate = "1 kHz"
publish = {{ out = "bench/state" }}
config = {{ bytes = {bytes} }}
[component.reader]
kind = "bench.relay"
rate = "1 kHz"
subscribe = {{ in = "bench/state" }}
config = {{ bytes = {bytes} }}
"#
    );
    let checked = graph::check(Path::new("bench-read.toml"), text, &[], registry, &Machine::detect())
        .map_err(|error| MeasureError::Graph(error.render(false)))?;
    let topics = TopicSet::create(&checked.plan)?;
    let path = topics.path();
    let measured = std::thread::scope(|scope| {
        // A separate thread, whose priority and core end with it.
        scope.spawn(move || with_payload(bytes, Reads { topics: path, reads, core, fifo })).join()
    });
    measured
        .map_err(|_| MeasureError::Ended("the reader has panicked".to_string()))?
        .unwrap_or_else(|| Err(MeasureError::Ended(format!("there is no payload of {bytes} bytes"))))
}

struct Reads<'a> {
    topics: &'a Path,
    reads: usize,
    core: usize,
    fifo: u8,
}

impl PayloadVisitor for Reads<'_> {
    type Output = Result<(Vec<u64>, u32), MeasureError>;

    fn visit<P: Payload>(self) -> Self::Output {
        let class = if self.fifo > 0 { SchedulingClass::Fifo(self.fifo) } else { SchedulingClass::Normal };
        let (applied, _) = apply(&Request { class, cores: vec![self.core], lock_memory: false });
        prefault_stack();
        let writer = Endpoint::join(self.topics, "writer")?;
        let reader = Endpoint::join(self.topics, "reader")?;
        let (mut output, mut input) = (writer.output::<P>("out")?, reader.input::<P>("in")?);
        let mut samples = Vec::with_capacity(self.reads);
        for round in 0..self.reads + 10 {
            let failed = |error: &dyn core::fmt::Display| MeasureError::Ended(error.to_string());
            output.loan().map_err(|error| failed(&error))?.publish().map_err(|error| failed(&error))?;
            let began = monotonic_ns();
            let is_there = core::hint::black_box(input.latest()).is_some();
            let took = monotonic_ns() - began;
            if !is_there {
                return Err(MeasureError::Ended("nothing was read".to_string()));
            }
            if round >= 10 {
                samples.push(took);
            }
        }
        Ok((samples, u32::from(applied.fifo_priority)))
    }
}
