//! The cost of reading the newest value of a state without touching its bytes.

use std::path::Path;

use motorium::graph::{self, Machine};
use motorium::os::{Request, apply, monotonic_ns, prefault_stack};
use motorium::plan::SchedulingClass;
use motorium::run_folder::RunFolder;
use motorium::session::TopicReader;
use motorium::testing::{Endpoint, TopicSet, TopicSetError};
use motorium::transport::Output;
use motorium::worker::Registry;

use crate::MeasureError;
use crate::payload::{Payload, PayloadVisitor, with_payload};

/// The reader of a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Reader {
    /// A component of the graph.
    Component,
    /// A program outside the graph.
    Outside,
}

/// Publishes values of a size and reads each once. Returns the time of each read, ns, and the priority read
/// back.
pub(crate) fn newest(
    registry: &Registry,
    (bytes, reader): (usize, Reader),
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
        scope.spawn(move || with_payload(bytes, Reads { topics: path, reader, reads, core, fifo })).join()
    });
    measured
        .map_err(|_| MeasureError::Ended("the reader has panicked".to_string()))?
        .unwrap_or_else(|| Err(MeasureError::Ended(format!("there is no payload of {bytes} bytes"))))
}

struct Reads<'a> {
    topics: &'a Path,
    reader: Reader,
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
        let output = writer.output::<P>("out")?;
        let samples = match self.reader {
            Reader::Component => {
                let reader = Endpoint::join(self.topics, "reader")?;
                let mut input = reader.input::<P>("in")?;
                samples(self.reads, output, || core::hint::black_box(input.latest()).is_some())
            }
            Reader::Outside => {
                let mut reader = outside(self.topics)?;
                samples(self.reads, output, || {
                    reader.poll() && matches!(core::hint::black_box(reader.value::<P>()), Ok(Some(_)))
                })
            }
        };
        Ok((samples?, u32::from(applied.fifo_priority)))
    }
}

/// Returns a reader of the first topic of a run, as programs outside its graph open it.
fn outside(run: &Path) -> Result<TopicReader, TopicSetError> {
    let folder = RunFolder::open(run);
    let plan = folder.plan()?;
    Ok(TopicReader::open(&folder.domain()?, &plan.topics[0])?)
}

/// Publishes a value before each read. Returns the times of the reads, ns.
fn samples<P: Payload>(
    reads: usize,
    mut output: Output<P>,
    mut read: impl FnMut() -> bool,
) -> Result<Vec<u64>, MeasureError> {
    let mut samples = Vec::with_capacity(reads);
    for round in 0..reads + 10 {
        let failed = |error: &dyn core::fmt::Display| MeasureError::Ended(error.to_string());
        output.loan().map_err(|error| failed(&error))?.publish().map_err(|error| failed(&error))?;
        let began = monotonic_ns();
        let is_there = read();
        let took = monotonic_ns() - began;
        if !is_there {
            return Err(MeasureError::Ended("nothing was read".to_string()));
        }
        if round >= 10 {
            samples.push(took);
        }
    }
    Ok(samples)
}
