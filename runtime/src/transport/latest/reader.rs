//! The reading side of a state.

#![allow(unsafe_code)] // a pinned value is used in place

use std::cell::Cell;
use std::rc::Rc;

use super::TopicMemory;
use super::protocol::{Newest, Pin, Words as _, pin_newest, unpin};
use crate::atomics::Native;
use crate::context::{Access, FirstLines};
use crate::os::prefetch_read;
use crate::state::{Stamp, StateBuffer};

/// A reader of one topic, with its pin.
#[derive(Debug)]
pub(crate) struct StateReader {
    memory: Rc<TopicMemory>,
    pin: usize,
    /// The pinned publication; its number is 0 if nothing is pinned.
    pinned: Newest,
}

impl StateReader {
    /// Creates a reader with the pin of a port. Only one reader at a time may use it.
    pub(crate) fn new(memory: Rc<TopicMemory>, pin: usize) -> Self {
        let reader = Self { memory, pin, pinned: Newest::default() };
        unpin(reader.pin());
        reader
    }

    /// Records the cache lines that a read needs first.
    pub(crate) fn note_first_lines(&self, lines: &FirstLines) {
        lines.note(Rc::as_ptr(&self.memory), Access::Read);
        lines.note(self.memory.head(), Access::Read);
        lines.note(self.pin(), Access::Write);
    }

    /// Returns the memory of the topic.
    pub(crate) fn memory(&self) -> &TopicMemory {
        &self.memory
    }

    fn pin(&self) -> &Pin<Native> {
        &self.memory.pins()[self.pin]
    }

    /// Returns the number of the newest publication; 0 before the first.
    #[inline]
    pub(crate) fn newest(&self) -> u64 {
        self.memory.newest().number()
    }

    /// Returns the number of the pinned publication; 0 if nothing is pinned.
    #[inline]
    pub(crate) fn seen(&self) -> u64 {
        self.pinned.number()
    }

    /// Releases the value read in the previous episode.
    pub(crate) fn begin_episode(&mut self) {
        self.pinned = Newest::default();
    }

    /// Pins the newest value. Returns `true` for a new value, `false` if the value was already pinned.
    #[inline(never)]
    pub(crate) fn look(&mut self) -> bool {
        let memory = &*self.memory;
        // The next value usually has the same length as the pinned one. That one stays pinned until the first
        // new slot is pinned, so only the first attempt may read it.
        let like = Cell::new((self.seen() > 0).then_some(self.pinned.slot()));
        let fetch = |slot| {
            // SAFETY: `pin_newest` calls this before it moves the pin, and `like` is empty from then on.
            unsafe { memory.fetch(slot, like.take(), prefetch_read) };
        };
        match pin_newest(memory, self.pin(), self.pinned.number(), fetch) {
            Some(pinned) => {
                self.pinned = pinned;
                true
            }
            None => false,
        }
    }

    /// Returns the pinned value.
    #[inline]
    pub(crate) fn current<T: StateBuffer>(&self) -> Option<(&Stamp, &T)> {
        debug_assert_eq!(size_of::<T>(), self.memory.value_bytes());
        let slot = (self.seen() > 0).then_some(self.pinned.slot())?;
        // SAFETY: the slot is pinned, so the writer does not touch it until this reader pins another one,
        // which needs `&mut self`. The port was opened for exactly this layout; every bit pattern is a valid
        // value.
        Some(unsafe { (&*self.memory.stamp(slot), &*self.memory.value(slot).cast::<T>()) })
    }

    /// Returns the pinned value as bytes.
    #[inline]
    pub(crate) fn current_bytes(&self) -> Option<(&Stamp, &[u8])> {
        let slot = (self.seen() > 0).then_some(self.pinned.slot())?;
        // SAFETY: as in `current`; the slot has room for a value of this size and was initialised by the
        // system or the writer.
        Some(unsafe {
            let value = core::slice::from_raw_parts(self.memory.value(slot), self.memory.value_bytes());
            (&*self.memory.stamp(slot), value)
        })
    }
}

impl Drop for StateReader {
    fn drop(&mut self) {
        unpin(self.pin());
    }
}
