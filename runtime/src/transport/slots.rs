//! The newest values of a small state topic, in the memory of its bell.
//!
//! A writer fills its slots in turn and says which one is newest; a reader copies that one and then looks whether it was
//! written to meanwhile (a sequence lock: L. Lamport, *Concurrent reading and writing*, 1977; H. Boehm, *Can seqlocks get
//! along with programming language memory models?*, 2012). So neither ever waits for the other, a reader that dies leaves
//! nothing behind, a writer that dies half-way leaves the older value, and a value crosses to another core with one look
//! at the bell and one at the slot. For values of a few kilobytes the copy costs less than handing a sample back would;
//! larger ones are read in place, through iceoryx2.

#![allow(unsafe_code)] // slots are mapped memory in which any bit pattern is a valid value

use std::marker::PhantomData;
use std::rc::Rc;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::sync::atomic::{AtomicU64, fence};

use super::bell::{Bell, WORDS_BYTES};
use super::eager::fetch_to_write;
use crate::declare::TopicPattern;
use crate::plan::TopicPlan;
use crate::state::{Stamp, StateBuffer};

/// So many values are kept: a reader that copies one is not disturbed before the writer has published as many more.
const SLOTS: u64 = 4;
/// Values larger than this are not copied, bytes.
const LARGEST: usize = 4096;
const LINE: usize = 64;
/// So often a reader tries again whose copy was overwritten.
const TRIES: u32 = 8;

/// One value.
#[repr(C, align(64))]
struct Slot<T> {
    /// Twice the number of the publication; one less while it is written.
    version: AtomicU64,
    stamp: Stamp,
    payload: T,
}

/// A value as it was copied.
#[derive(Debug)]
pub(super) struct Copied<T> {
    pub(super) stamp: Stamp,
    pub(super) payload: T,
}

impl<T: StateBuffer> Copied<T> {
    pub(super) fn nothing() -> Self {
        Self { stamp: Stamp::default(), payload: T::ZERO }
    }
}

/// The slots of a topic. One thread at a time may write.
#[derive(Debug)]
pub(super) struct Slots<T> {
    bell: Rc<Bell>,
    payload: PhantomData<T>,
}

/// Whether the values of a topic are kept in slots.
pub(super) fn are_for(topic: &TopicPlan) -> bool {
    topic.pattern == TopicPattern::State && topic.layout.size <= LARGEST && topic.layout.alignment <= LINE
}

/// What the slots of a topic take, bytes.
pub(super) fn bytes(topic: &TopicPlan) -> usize {
    if !are_for(topic) {
        return 0;
    }
    let payload = (size_of::<AtomicU64>() + size_of::<Stamp>()).next_multiple_of(topic.layout.alignment);
    SLOTS as usize * (payload + topic.layout.size).next_multiple_of(LINE)
}

impl<T: StateBuffer> Slots<T> {
    /// The slots behind a bell, if the values of this topic are kept there.
    pub(super) fn of(bell: &Rc<Bell>, topic: &TopicPlan) -> Option<Self> {
        let room = bytes(topic);
        let fits = room > 0
            && room == SLOTS as usize * size_of::<Slot<T>>()
            && bell.len() >= WORDS_BYTES + room
            && align_of::<T>() <= LINE;
        fits.then(|| Self { bell: bell.clone(), payload: PhantomData })
    }

    fn slot(&self, number: u64) -> *mut Slot<T> {
        // SAFETY: the mapping holds all slots behind the words (checked in `of`), whose length is a multiple of the
        // alignment of a slot; mappings begin on a page.
        unsafe { self.bell.behind_words().cast::<Slot<T>>().add((number % SLOTS) as usize) }
    }

    /// The next value, to be filled in place and [published](Self::publish). It holds whatever an earlier one left.
    pub(super) fn begin(&mut self) -> &mut T {
        let number = self.bell.newest() + 1;
        let slot = self.slot(number);
        // SAFETY: in bounds and aligned; any bit pattern is a valid `Slot<T>`. Only the one writer makes a reference to
        // a payload, and the mutable borrow keeps it from making two; readers copy bytes and check the version.
        let slot = unsafe { &mut *slot };
        slot.version.store(2 * number - 1, Relaxed);
        // Nothing of the value may become visible before that.
        fence(Release);
        &mut slot.payload
    }

    /// The value that is being filled.
    pub(super) fn begun(&self) -> &T {
        // SAFETY: as in `begin`; the shared borrow keeps the writer from changing it.
        unsafe { &(*self.slot(self.bell.newest() + 1)).payload }
    }

    /// The value being filled, to change it again.
    pub(super) fn begun_mut(&mut self) -> &mut T {
        // SAFETY: as in `begin`.
        unsafe { &mut (*self.slot(self.bell.newest() + 1)).payload }
    }

    /// Makes the value that was begun the newest one; a ring of the bell is to follow.
    pub(super) fn publish(&mut self, stamp: Stamp) {
        let number = self.bell.newest() + 1;
        let slot = self.slot(number);
        // SAFETY: as in `begin`.
        let slot = unsafe { &mut *slot };
        slot.stamp = stamp;
        slot.version.store(2 * number, Release);
        self.bell.say_newest(number);
    }

    /// Asks for the memory of the value to be written next.
    pub(super) fn fetch_next(&self) {
        fetch_to_write(self.slot(self.bell.newest() + 1) as usize, size_of::<Slot<T>>());
    }

    /// The newest value and its stamp, for the writer itself.
    pub(super) fn newest(&self) -> Option<(&Stamp, &T)> {
        let number = self.bell.newest();
        // SAFETY: as in `begin`; the newest value is not written to before three others were.
        let slot = unsafe { &*self.slot(number) };
        (number > 0).then_some((&slot.stamp, &slot.payload))
    }

    /// Copies the newest value unless it is the publication of number `last`. Returns its number.
    ///
    /// Where the writer overtakes the reader again and again, there is no news.
    pub(super) fn read(&self, last: u64, into: &mut Copied<T>) -> Option<u64> {
        for _ in 0..TRIES {
            let number = self.bell.newest();
            if number == last || number == 0 {
                return None;
            }
            let slot = self.slot(number);
            // SAFETY: in bounds, aligned, and any bytes are an atomic.
            let version = unsafe { &(*slot).version };
            if version.load(Acquire) != 2 * number {
                continue;
            }
            // SAFETY: in bounds; the targets are this thread's own. The writer may write meanwhile: then the copy is any
            // mixture of bytes, which is a valid value, and the version tells that it must not be used.
            unsafe {
                core::ptr::copy_nonoverlapping(&raw const (*slot).stamp, &raw mut into.stamp, 1);
                core::ptr::copy_nonoverlapping(&raw const (*slot).payload, &raw mut into.payload, 1);
            }
            fence(Acquire);
            if version.load(Relaxed) == 2 * number {
                return Some(number);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::*;
    use crate::state::{JointState, TypeLayout, Wrench};

    fn topic(layout: TypeLayout) -> TopicPlan {
        TopicPlan {
            name: "test/slots".to_string(),
            pattern: TopicPattern::State,
            layout,
            writer: 0,
            readers: Vec::new(),
            triggers: Vec::new(),
        }
    }

    fn stamp(sequence: u64) -> Stamp {
        Stamp { sequence, ..Stamp::default() }
    }

    #[test]
    fn small_states_have_slots_and_large_ones_and_streams_have_none() {
        let mut joints = topic(JointState::layout());
        assert_eq!(bytes(&joints), SLOTS as usize * size_of::<Slot<JointState>>());
        joints.layout.size = LARGEST + 1;
        assert_eq!(bytes(&joints), 0);
        let mut stream = topic(Wrench::layout());
        stream.pattern = TopicPattern::Stream { capacity: 4 };
        assert_eq!(bytes(&stream), 0);
    }

    #[test]
    fn the_newest_value_is_read_once_and_one_that_was_only_begun_is_not_seen() {
        let folder = tempfile::tempdir().unwrap();
        let (path, topic) = (folder.path().join("bell"), topic(Wrench::layout()));
        let bell = Rc::new(Bell::create(&path, bytes(&topic)).unwrap());
        let mut writer = Slots::<Wrench>::of(&bell, &topic).unwrap();
        let reader_bell = Rc::new(Bell::open(&path, bytes(&topic)).unwrap());
        let reader = Slots::<Wrench>::of(&reader_bell, &topic).unwrap();
        let mut seen = Copied::nothing();
        assert_eq!(reader.read(0, &mut seen), None);
        for number in 1..=10 {
            writer.begin().force = [number as f64; 3];
            writer.publish(stamp(number));
        }
        writer.begin().force = [-1.0; 3];
        assert_eq!(reader.read(0, &mut seen), Some(10));
        assert_eq!((seen.stamp.sequence, seen.payload.force), (10, [10.0; 3]));
        assert_eq!(reader.read(10, &mut seen), None);
        // the writer dies and comes back: what it had begun is gone, the newest value is still there
        drop(writer);
        let mut writer = Slots::<Wrench>::of(&bell, &topic).unwrap();
        assert_eq!(writer.newest().unwrap().0.sequence, 10);
        writer.begin().force = [11.0; 3];
        writer.publish(stamp(1));
        assert_eq!(reader.read(10, &mut seen), Some(11));
        assert_eq!((seen.stamp.sequence, seen.payload.force), (1, [11.0; 3]));
    }

    #[test]
    fn no_value_is_ever_torn_however_reading_and_writing_fall_together() {
        let folder = tempfile::tempdir().unwrap();
        let (path, topic) = (folder.path().join("bell"), topic(JointState::layout()));
        drop(Bell::create(&path, bytes(&topic)).unwrap());
        let over = AtomicBool::new(false);
        std::thread::scope(|scope| {
            let (over, path, topic) = (&over, &path, &topic);
            scope.spawn(move || {
                let bell = Rc::new(Bell::open(path, bytes(topic)).unwrap());
                let mut writer = Slots::<JointState>::of(&bell, topic).unwrap();
                for number in 1_u64.. {
                    if over.load(Acquire) {
                        break;
                    }
                    let value = writer.begin();
                    value.set_count(7);
                    value.position_mut().fill(number as f64);
                    value.effort_mut().fill(number as f64);
                    writer.publish(stamp(number));
                }
            });
            let bell = Rc::new(Bell::open(path, bytes(topic)).unwrap());
            let reader = Slots::<JointState>::of(&bell, topic).unwrap();
            let (mut last, mut seen, mut count) = (0, Copied::<JointState>::nothing(), 0);
            while count < 5_000 {
                let Some(number) = reader.read(last, &mut seen) else { continue };
                assert!(number > last && seen.stamp.sequence == number);
                let all = seen.payload.position().iter().chain(seen.payload.effort());
                assert!(all.clone().all(|value| *value == number as f64), "torn at {number}");
                (last, count) = (number, count + 1);
            }
            over.store(true, Release);
        });
    }
}
