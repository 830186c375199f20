//! The writing side of a state.

#![allow(unsafe_code)] // a claimed slot is filled in place

use std::cell::RefCell;
use std::rc::Rc;

use super::TopicMemory;
use super::dimensions::TIMES;
use super::protocol::{Newest, Words as _, Writer, announce};
use crate::atomics::Native;
use crate::os::prefetch_write;
use crate::state::{Stamp, StateBuffer};

/// The only writer of a topic.
#[derive(Debug)]
pub(crate) struct StateWriter {
    memory: Rc<TopicMemory>,
    writer: RefCell<Writer>,
}

impl StateWriter {
    pub(crate) fn new(memory: Rc<TopicMemory>) -> Self {
        let writer = RefCell::new(Writer::new(&*memory, memory.reuse()));
        Self { memory, writer }
    }

    /// Returns the slot to fill next. It still contains an earlier publication.
    #[inline]
    pub(crate) fn slot(&self) -> usize {
        self.writer.borrow_mut().slot(&*self.memory)
    }

    /// Returns mutable access to the value in the slot that is being filled.
    ///
    /// # Safety
    /// The caller must have the only reference to the value: an output is the only user of its writer's slot,
    /// and lends it through its own `&mut`.
    #[inline]
    #[allow(clippy::mut_from_ref)]
    pub(crate) unsafe fn value_mut<T: StateBuffer>(&self) -> &mut T {
        debug_assert_eq!(size_of::<T>(), self.memory.value_bytes());
        // A polling core has a copy of the line: fetch it back while the value is being filled.
        prefetch_write(core::ptr::from_ref(self.memory.head()).cast(), 1);
        // SAFETY: the slot is claimed, so no reader uses it, and by the caller's contract nothing else does.
        // The port was opened for exactly this layout; every bit pattern is a valid value.
        unsafe { &mut *self.memory.value(self.slot()).cast::<T>() }
    }

    /// Returns mutable access to the bytes of the value in the slot that is being filled.
    ///
    /// # Safety
    /// As for [`value_mut`](Self::value_mut).
    #[inline]
    #[allow(clippy::mut_from_ref)]
    pub(crate) unsafe fn bytes_mut(&self) -> &mut [u8] {
        // SAFETY: the slot is claimed, so no reader uses it, and by the caller's contract nothing else does.
        // It has room for a value of this size and was initialised by the system or an earlier publication.
        unsafe { core::slice::from_raw_parts_mut(self.memory.value(self.slot()), self.memory.value_bytes()) }
    }

    /// Begins an episode: publications are numbered from 1 again.
    pub(crate) fn begin_episode(&self) {
        *self.writer.borrow_mut() = Writer::of_empty(self.memory.reuse());
    }

    /// Returns the number of the next publication.
    #[inline]
    pub(crate) fn number(&self) -> u64 {
        self.writer.borrow().number()
    }

    /// Announces the filled slot; the caller then calls [`TopicMemory::notify`].
    #[inline(always)]
    pub(crate) fn publish(&self, stamp: &Stamp) {
        let mut writer = self.writer.borrow_mut();
        let slot = writer.slot(&*self.memory);
        self.memory.write_stamp(slot, stamp);
        writer.publish(&*self.memory, stamp.publish_time);
    }

    /// Chooses and prefetches the slot of the next publication while nobody waits for the writer. Returns its
    /// address.
    ///
    /// The slot of a large value is chosen only when it is filled: by then the readers have released the
    /// previous one, and two alternating slots stay in the cache where three would not.
    #[inline]
    pub(crate) fn prepare(&self) -> Option<*const u8> {
        if self.memory.is_large() {
            return None;
        }
        let slot = self.writer.borrow_mut().slot(&*self.memory);
        // The next value usually has the same length as the previous one.
        let newest = self.memory.newest();
        let like = (newest.number() > 0 && newest.slot() != slot).then_some(newest.slot());
        // SAFETY: this is the only writer, and the slot it has claimed is not `like`.
        Some(unsafe { self.memory.fetch(slot, like, prefetch_write) })
    }
}

impl TopicMemory {
    /// Announces a publication of a stream, whose value is sent through iceoryx2.
    #[inline]
    pub(crate) fn count(&self, time_ns: u64) {
        let number = self.newest().number() + 1;
        announce::<Native>(self, Newest::new(number, number as usize % TIMES), time_ns);
    }
}
