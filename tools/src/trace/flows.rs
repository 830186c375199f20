//! The hand-overs of a trace: each sample with the step that published it and the step that first read it.

use std::collections::HashMap;

use motorium::plan::Plan;
use motorium::region::TraceEvent;

/// A step with its publications and first reads.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Step {
    pub(super) number: u64,
    /// Release time on the clock of stamps, which is simulated time in lockstep, ns.
    pub(super) release_ns: u64,
    pub(super) begin_ns: u64,
    pub(super) end_ns: u64,
    pub(super) published: Vec<Publication>,
    reads: Vec<Read>,
}

/// A sample that was published in a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Publication {
    pub(super) topic: usize,
    pub(super) sequence: u64,
    pub(super) at_ns: u64,
    publish_ns: u64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Read {
    edge: usize,
    sequence: u64,
    publish_ns: u64,
}

/// A sample between the step that published it and the step that first read it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct HandOver {
    pub(super) topic: usize,
    pub(super) reader: usize,
    pub(super) sequence: u64,
    pub(super) published_ns: u64,
    /// Time of the read, within the reading step and not before the publication.
    pub(super) read_ns: u64,
    /// `true` if the topic wakes the reader, which waited for this sample.
    pub(super) wakes: bool,
}

/// Returns the steps of a component. Events of a step that did not end, or whose end was overwritten, are
/// counted in the next one.
pub(super) fn steps(events: &[TraceEvent]) -> Vec<Step> {
    let (mut steps, mut published, mut reads) = (Vec::new(), Vec::new(), Vec::new());
    for event in events {
        match *event {
            TraceEvent::Published { topic, sequence, publish_ns, at_ns } => {
                published.push(Publication { topic, sequence, at_ns, publish_ns });
            }
            TraceEvent::Read { edge, sequence, publish_ns } => {
                reads.push(Read { edge, sequence, publish_ns })
            }
            TraceEvent::Step { number, release_ns, begin_ns, end_ns } => {
                let (published, reads) = (core::mem::take(&mut published), core::mem::take(&mut reads));
                steps.push(Step { number, release_ns, begin_ns, end_ns, published, reads });
            }
        }
    }
    steps
}

/// Returns all hand-overs whose two ends are in the trace, by reader.
pub(super) fn hand_overs(plan: &Plan, components: &[Vec<Step>]) -> Vec<HandOver> {
    let all = components.iter().flatten().flat_map(|step| &step.published);
    let published: HashMap<(usize, u64, u64), u64> =
        all.map(|sample| ((sample.topic, sample.sequence, sample.publish_ns), sample.at_ns)).collect();
    let edges = plan.edges();
    let mut found = Vec::new();
    for (reader, steps) in components.iter().enumerate() {
        for step in steps {
            for read in &step.reads {
                let Some((topic, _)) = edges.get(read.edge).copied() else { continue };
                let key = (topic, read.sequence, read.publish_ns);
                let Some(published_ns) = published.get(&key).copied() else { continue };
                found.push(HandOver {
                    topic,
                    reader,
                    sequence: read.sequence,
                    published_ns,
                    read_ns: published_ns.clamp(step.begin_ns, step.end_ns.max(step.begin_ns)),
                    wakes: plan.topics[topic].triggers.contains(&reader),
                });
            }
        }
    }
    found
}
