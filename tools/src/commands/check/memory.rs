//! The shared memory of a graph's topics as a table.

use motorium::declare::TopicPattern;
use motorium::plan::Plan;
use serde::Serialize;

use crate::report::table;

/// The shared memory of one topic.
#[derive(Debug, Serialize)]
pub(super) struct TopicMemory<'a> {
    topic: &'a str,
    pattern: TopicPattern,
    #[serde(rename = "type")]
    type_name: &'a str,
    /// Bytes of a value.
    value_bytes: usize,
    /// Slots of a state, or samples of a stream's queues.
    slots: usize,
    /// Total size in whole pages, bytes.
    bytes: usize,
}

/// Returns the shared memory of each topic.
pub(super) fn per_topic(plan: &Plan) -> Vec<TopicMemory<'_>> {
    let topics = plan.topics.iter();
    let memory = topics.map(|topic| TopicMemory {
        topic: &topic.name,
        pattern: topic.pattern,
        type_name: &topic.layout.type_name,
        value_bytes: topic.layout.size,
        slots: topic.slots(),
        bytes: topic.memory_bytes(),
    });
    memory.collect()
}

/// Returns the table of all topics and their sum.
pub(super) fn describe(plan: &Plan) -> String {
    let topics = per_topic(plan);
    let mut rows = table(["topic", "pattern", "type", "value", "slots", "memory"]);
    for topic in &topics {
        let pattern = match topic.pattern {
            TopicPattern::State => "state".to_string(),
            TopicPattern::Stream { capacity } => format!("stream of {capacity}"),
            TopicPattern::Slices { capacity, longest } => format!("slices of {longest}, {capacity} deep"),
        };
        rows.add_row([
            topic.topic.to_string(),
            pattern,
            topic.type_name.to_string(),
            format!("{} B", topic.value_bytes),
            topic.slots.to_string(),
            size(topic.bytes),
        ]);
    }
    let total = topics.iter().map(|topic| topic.bytes).fold(0, usize::saturating_add);
    format!("{}\nshared memory of all topics: {}\n", rows.trim_fmt(), size(total))
}

fn size(bytes: usize) -> String {
    if bytes < 10 << 20 {
        format!("{} KiB", bytes.div_ceil(1 << 10))
    } else {
        format!("{} MiB", bytes.div_ceil(1 << 20))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_rounded_up() {
        assert_eq!([1, 4096, 11 << 20].map(size), ["1 KiB", "4 KiB", "11 MiB"]);
    }
}
