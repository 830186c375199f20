//! The trace of a run: a ring of step events per component, in the control block of a traced run.
//!
//! A ring is wait-free. Its only writer is the worker of its component; the number of readers is unlimited.
//! An event has four words, and `written` counts complete events. The next event replaces the oldest event. A
//! reader therefore reads `written` after the words of an event, and accepts the event only if its slot was
//! not the next slot to be written.

use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::sync::atomic::{AtomicU64, fence};

/// Maximum number of events in a ring.
pub(super) const MOST_EVENTS: usize = 1 << 20;
/// Words of an event.
const WORDS: usize = 4;
/// Position of the kind of an event in its first word, bits.
const KIND_AT: u32 = 56;

/// The head of a ring. Written by the worker of its component.
#[derive(Debug, Default)]
#[repr(C, align(64))]
pub(super) struct TraceHead {
    /// Events written so far.
    pub(super) written: AtomicU64,
}

/// Slot of one event.
#[derive(Debug, Default)]
#[repr(C)]
pub(super) struct TraceSlot(pub(super) [AtomicU64; WORDS]);

/// The ring of one component.
#[derive(Debug, Clone, Copy)]
pub(super) struct TraceRing<'a> {
    pub(super) head: &'a TraceHead,
    /// Slots, whose number is a power of two.
    pub(super) slots: &'a [TraceSlot],
}

/// An event in the trace of a component. The event of a step comes after the events of publications and reads
/// in the same step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TraceEvent {
    /// A step has ended.
    Step {
        /// Index of the step, counted from 0, across restarts and episodes.
        number: u64,
        /// Release time, ns on the clock of stamps (simulated time in lockstep).
        release_ns: u64,
        /// Start of the step, `CLOCK_MONOTONIC` ns.
        begin_ns: u64,
        /// End of the step, `CLOCK_MONOTONIC` ns.
        end_ns: u64,
    },
    /// A sample was published.
    Published {
        /// Index of the topic in the plan.
        topic: usize,
        /// Sequence number of the sample.
        sequence: u64,
        /// Publish time in the stamp of the sample, ns.
        publish_ns: u64,
        /// Time of the publication, `CLOCK_MONOTONIC` ns.
        at_ns: u64,
    },
    /// A sample was read for the first time.
    Read {
        /// Index of the edge in [`Plan::edges`](crate::plan::Plan::edges).
        edge: usize,
        /// Sequence number of the sample.
        sequence: u64,
        /// Publish time in the stamp of the sample, ns.
        publish_ns: u64,
    },
}

const STEP: u64 = 1;
const PUBLISHED: u64 = 2;
const READ: u64 = 3;

impl TraceEvent {
    #[inline(always)]
    fn encode(self) -> [u64; WORDS] {
        match self {
            Self::Step { number, release_ns, begin_ns, end_ns } => {
                [STEP << KIND_AT | number, release_ns, begin_ns, end_ns]
            }
            Self::Published { topic, sequence, publish_ns, at_ns } => {
                [PUBLISHED << KIND_AT | topic as u64, sequence, publish_ns, at_ns]
            }
            Self::Read { edge, sequence, publish_ns } => {
                [READ << KIND_AT | edge as u64, sequence, publish_ns, 0]
            }
        }
    }

    /// Decodes an event. Returns `None` if the words are not a valid event, because the ring is damaged.
    pub(super) fn decode([first, a, b, c]: [u64; WORDS]) -> Option<Self> {
        let number = first & ((1 << KIND_AT) - 1);
        let index = number as usize;
        match first >> KIND_AT {
            STEP => Some(Self::Step { number, release_ns: a, begin_ns: b, end_ns: c }),
            PUBLISHED => Some(Self::Published { topic: index, sequence: a, publish_ns: b, at_ns: c }),
            READ => Some(Self::Read { edge: index, sequence: a, publish_ns: b }),
            _ => None,
        }
    }
}

impl TraceRing<'_> {
    /// Writes an event over the oldest one. Events are numbered from 0.
    #[inline(always)]
    pub(super) fn write(self, number: u64, event: TraceEvent) {
        // Readers that see any of the following words also see the number of the previous event.
        fence(Release);
        let slot = &self.slots[number as usize & (self.slots.len() - 1)];
        event.encode().into_iter().zip(&slot.0).for_each(|(word, cell)| cell.store(word, Relaxed));
        self.head.written.store(number + 1, Release);
    }

    /// Reads the event with a number below `written`. Returns `None` if it was overwritten.
    pub(super) fn read(self, number: u64) -> Option<[u64; WORDS]> {
        let slot = &self.slots[number as usize & (self.slots.len() - 1)];
        let words = core::array::from_fn(|word| slot.0[word].load(Relaxed));
        fence(Acquire);
        // The next event may be partially written to its slot.
        let kept = self.head.written.load(Relaxed).saturating_sub(number) < self.slots.len() as u64;
        kept.then_some(words)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::*;

    fn step(number: u64) -> TraceEvent {
        TraceEvent::Step {
            number,
            release_ns: 10 * number,
            begin_ns: 10 * number + 1,
            end_ns: 10 * number + 2,
        }
    }

    fn memory(slots: usize) -> (TraceHead, Vec<TraceSlot>) {
        (TraceHead::default(), core::iter::repeat_with(TraceSlot::default).take(slots).collect())
    }

    #[test]
    fn events_are_read_as_written() {
        for event in [
            step(7),
            TraceEvent::Published { topic: 3, sequence: 9, publish_ns: 11, at_ns: 12 },
            TraceEvent::Read { edge: 65_000, sequence: u64::MAX, publish_ns: 1 },
        ] {
            assert_eq!(TraceEvent::decode(event.encode()), Some(event));
        }
        assert_eq!(TraceEvent::decode([0; WORDS]), None);
        assert_eq!(TraceEvent::decode([u64::MAX; WORDS]), None);
    }

    #[test]
    fn newest_events_are_kept_except_the_next_slot() {
        let (head, slots) = memory(4);
        let ring = TraceRing { head: &head, slots: &slots };
        (0..6).for_each(|number| ring.write(number, step(number)));
        for number in [0, 1, 2] {
            assert_eq!(ring.read(number), None, "{number}");
        }
        for number in [3, 4, 5] {
            assert_eq!(ring.read(number).and_then(TraceEvent::decode), Some(step(number)));
        }
    }

    #[test]
    fn no_event_is_torn_while_it_is_overwritten() {
        let (head, slots) = memory(8);
        let ring = TraceRing { head: &head, slots: &slots };
        let done = AtomicBool::new(false);
        let (mut read, mut last) = (0u64, 0);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                (0..400_000).for_each(|number| ring.write(number, step(number)));
                done.store(true, Release);
            });
            while !done.load(Acquire) {
                let written = head.written.load(Acquire);
                for number in written.saturating_sub(7)..written {
                    let Some(words) = ring.read(number) else { continue };
                    assert_eq!(TraceEvent::decode(words), Some(step(number)));
                    (read, last) = (read + 1, number);
                }
            }
        });
        assert!(last < 400_000 && read < 400_000 * 8);
        assert_eq!(ring.read(399_999).and_then(TraceEvent::decode), Some(step(399_999)));
    }
}
