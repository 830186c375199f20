//! Reading every value of a state, in order.

#![allow(unsafe_code)] // a pinned value is read as bytes, by a type described at run time

use super::TopicMemory;
use super::protocol::{Words as _, pin_marked, unpin};
use crate::os::Lock;
use crate::state::Stamp;
use std::sync::atomic::Ordering::Relaxed;

/// Number of attempts to pin a publication before it counts as not yet available.
const TRIES: usize = 64;

/// A reader of every publication of a topic, in order, from slots that still contain older values. Reading
/// costs the writer nothing.
#[derive(Debug)]
pub(crate) struct Tap {
    memory: TopicMemory,
    pin: usize,
    /// Number of the last publication read.
    last: u64,
    /// Slot of the last publication read; the next one usually follows it.
    slot: usize,
    missed: u64,
    /// Lock on the pin, dropped after its last use.
    _place: Lock,
}

impl Tap {
    /// Joins a topic with one of its side pins and the lock of that pin. The first value is the newest one.
    pub(crate) fn join(memory: TopicMemory, (place, pin): (Lock, usize)) -> Self {
        unpin(&memory.pins()[pin]);
        let newest = memory.newest();
        let last = newest.number().saturating_sub(1);
        Self { memory, pin, last, slot: newest.slot(), missed: 0, _place: place }
    }

    /// Passes the stamp and bytes of the next publication to `read`, without copying. Returns `false` if
    /// there is no new publication.
    pub(crate) fn next(&mut self, read: impl FnOnce(&Stamp, &[u8])) -> bool {
        // An attempt fails if the writer claims the slot; damaged words make all attempts fail.
        for _ in 0..TRIES {
            let newest = self.memory.newest().number();
            if self.last > newest {
                // A new episode has begun: it withdraws earlier publications and restarts the numbers.
                self.last = 0;
            }
            if self.last == newest {
                return false;
            }
            let Some((number, slot)) = self.find(newest) else { continue };
            if !pin_marked(&self.memory, &self.memory.pins()[self.pin], slot, number) {
                continue;
            }
            self.missed += number - self.last - 1;
            (self.last, self.slot) = (number, slot);
            // SAFETY: the slot is pinned until `unpin`, so the writer does not touch it in the meantime.
            let (stamp, bytes) = unsafe {
                let value = self.memory.value(slot).cast_const();
                (&*self.memory.stamp(slot), core::slice::from_raw_parts(value, self.memory.value_bytes()))
            };
            read(stamp, bytes);
            unpin(&self.memory.pins()[self.pin]);
            return true;
        }
        false
    }

    /// Returns the oldest publication after the last one read that is still available, and its slot.
    fn find(&self, newest: u64) -> Option<(u64, usize)> {
        let wanted = self.last + 1;
        let (slots, memory) = (self.memory.slots(), &self.memory);
        let mut oldest: Option<(u64, usize)> = None;
        for slot in (0..slots).map(|i| (self.slot + 1 + i) % slots) {
            let number = memory.mark(slot).load(Relaxed);
            if number == wanted {
                return Some((number, slot));
            }
            if number > wanted && number <= newest && oldest.is_none_or(|(least, _)| number < least) {
                oldest = Some((number, slot));
            }
        }
        oldest
    }

    /// Returns the number of publications that were overwritten before they could be read.
    pub(crate) fn missed(&self) -> u64 {
        self.missed
    }
}

impl Drop for Tap {
    fn drop(&mut self) {
        unpin(&self.memory.pins()[self.pin]);
    }
}
