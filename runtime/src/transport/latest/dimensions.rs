//! The dimensions of the memory of a topic, computed from the plan.

use std::sync::atomic::{AtomicU32, AtomicU64};

use super::protocol::{Head, Pin};
use crate::atomics::Native;
use crate::declare::TopicPattern;
use crate::plan::TopicPlan;
use crate::state::{Digest, Stamp};

/// Number of additional pins of each topic, for tools that observe it.
pub(crate) const SIDE_PINS: usize = 4;
pub(super) const LINE: usize = 64;
/// Size of the two cache lines that processors fetch together, bytes.
const PAIR: usize = 2 * LINE;
pub(super) const PAGE: usize = 4096;
/// Number of slots of a stream. Its values are not stored here, only the times of its two newest
/// publications.
pub(super) const TIMES: usize = 2;
/// Size of the words before each value, which share a cache line with its beginning, bytes.
const SLOT_WORDS: usize = size_of::<AtomicU64>() + size_of::<Stamp>();

/// The first words of the memory, which describe its content.
#[derive(Debug)]
#[repr(C, align(64))]
pub(super) struct Preface {
    pub(super) magic: AtomicU64,
    pub(super) dimensions: AtomicU64,
    pub(super) waiting: AtomicU32,
}

/// Offsets in the memory of a topic, computed from the plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Dimensions {
    pub(super) pins: usize,
    pub(super) slots: usize,
    /// Offset of the value in a slot, bytes.
    pub(super) value: usize,
    /// Distance between slots, bytes.
    pub(super) stride: usize,
    /// Size of a value, bytes.
    pub(super) size: usize,
}

/// Returns the smallest multiple of `step` not below `number`; saturates for excessive plans.
fn up_to_multiple(number: usize, step: usize) -> usize {
    number.checked_next_multiple_of(step).unwrap_or(usize::MAX)
}

impl Dimensions {
    pub(super) fn from_topic(topic: &TopicPlan) -> Self {
        let pins = topic.readers.len() + SIDE_PINS;
        let value = up_to_multiple(SLOT_WORDS, topic.layout.alignment.max(1));
        let (slots, size) = match topic.pattern {
            TopicPattern::State => (topic.history.saturating_add(pins + 2), topic.layout.size),
            TopicPattern::Stream { .. } | TopicPattern::Slices { .. } => (TIMES, 0),
        };
        // Processors fetch lines in pairs and prefetch the following ones, so an unused pair separates two
        // slots.
        let stride = up_to_multiple(size.saturating_add(value), PAIR).saturating_add(PAIR);
        Self { pins, slots, value, stride, size }
    }

    /// Returns a hash of the dimensions and the topic. It differs if the plans of two processes differ.
    pub(super) fn hash(self, topic: &TopicPlan) -> u64 {
        let mut digest = Digest::default();
        digest.write(topic.layout.hash().as_bytes());
        let numbers = [self.pins, self.slots, self.value, self.stride];
        numbers.iter().for_each(|number| digest.write_u64(*number as u64));
        digest.finish()
    }

    pub(super) fn pins_at(self) -> usize {
        (size_of::<Preface>() + size_of::<Head<Native>>()).next_multiple_of(align_of::<Pin<Native>>())
    }

    pub(super) fn slots_at(self) -> usize {
        self.pins_at() + self.pins * size_of::<Pin<Native>>()
    }

    pub(super) fn bytes(self) -> usize {
        self.slots.saturating_mul(self.stride).saturating_add(self.slots_at())
    }
}

impl TopicPlan {
    /// Returns the number of value slots of the topic. A state has one slot for each reader, four for taps,
    /// two for the writer, and one for each value of its history. A stream has enough slots to fill the
    /// queues of all readers and taps.
    pub fn slots(&self) -> usize {
        match self.pattern {
            TopicPattern::State => Dimensions::from_topic(self).slots,
            // Doubled, because a killed reader occupies its slots until the launcher has cleaned up.
            TopicPattern::Stream { capacity } | TopicPattern::Slices { capacity, .. } => {
                let queues = 2 * (self.readers.len() + SIDE_PINS);
                queues.saturating_mul(capacity.saturating_add(2)).saturating_add(2)
            }
        }
    }

    /// Returns the size of the topic's shared memory, rounded up to whole pages, bytes.
    pub fn memory_bytes(&self) -> usize {
        let values = match self.pattern {
            TopicPattern::State => 0,
            TopicPattern::Stream { .. } => 1,
            TopicPattern::Slices { longest, .. } => longest,
        };
        let stamps = 2 * size_of::<Stamp>();
        let sample = up_to_multiple(values.saturating_mul(self.layout.size).saturating_add(stamps), LINE);
        let queues = if values > 0 { self.slots().saturating_mul(sample) } else { 0 };
        up_to_multiple(Dimensions::from_topic(self).bytes().saturating_add(PAGE).saturating_add(queues), PAGE)
    }
}
