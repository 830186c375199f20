//! The pin protocol: how one writer and any number of readers share the slots of a topic without copying or
//! waiting.
//!
//! * The writer fills a slot that is neither the newest nor pinned, and announces it with a single store of
//!   one word, which holds the publication number and the slot.
//! * A reader pins the announced slot, then checks that it is still the announced one. If it is, the writer
//!   sees the pin before it could choose that slot again, and the reader may use the value in place for as
//!   long as it keeps the pin. If not, the reader pins the newer one; it retries at most once per
//!   publication.
//! * A tap wants a particular publication, whether or not it is the newest. It pins the slot that is marked
//!   with its number, then checks that the mark is still there; the writer removes the mark from a slot
//!   before it checks who has pinned it.
//!
//! With two more slots than pins, the writer always finds a free one. A reader that dies leaves one slot
//! pinned until its successor pins another; a writer that dies leaves the last announced value and one slot
//! without a mark.

use core::fmt::Debug;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};

use crate::atomics::{Atomics, Site, Word};

const INTERRUPT_BITS: u32 = 4;
const NUMBER_BITS: u32 = 44;

/// The newest publication of a topic, packed into one word: interrupt count, number, slot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Newest(pub(crate) u64);

impl Newest {
    /// A publication of this number in this slot, not interrupted.
    #[inline]
    pub(crate) fn new(number: u64, slot: usize) -> Self {
        let number = number & ((1 << NUMBER_BITS) - 1);
        Self((slot as u64) << (INTERRUPT_BITS + NUMBER_BITS) | (number << INTERRUPT_BITS))
    }

    /// Number of the publication, counted from 1; 0 before the first.
    #[inline]
    pub(crate) fn number(self) -> u64 {
        (self.0 >> INTERRUPT_BITS) & ((1 << NUMBER_BITS) - 1)
    }

    /// The slot that holds it.
    #[inline]
    pub(crate) fn slot(self) -> usize {
        (self.0 >> (INTERRUPT_BITS + NUMBER_BITS)) as usize
    }

    /// Returns the publication after one more interrupt.
    pub(crate) fn interrupted(self) -> Self {
        let mask = (1 << INTERRUPT_BITS) - 1;
        Self((self.0 & !mask) | ((self.0 + 1) & mask))
    }
}

/// The words shared by the writer of a topic and everyone who waits for it: one cache line.
#[derive(Debug)]
#[repr(C, align(64))]
pub(crate) struct Head<A: Atomics> {
    /// The newest publication ([`Newest`]). Its low half is the futex on which waiters sleep.
    pub(crate) newest: A::U64,
    /// Number of sleeping readers. A reader killed while asleep stays counted, which only costs one system
    /// call per publication.
    pub(crate) sleepers: A::U32,
    /// Core of the last publication plus 1; 0 before the first.
    pub(crate) core: A::U32,
}

/// The slot that a reader uses. It fills a cache line and the neighbour that processors prefetch with it.
#[derive(Debug)]
#[repr(C, align(128))]
pub(crate) struct Pin<A: Atomics> {
    /// Slot plus 1; 0 for none.
    pub(crate) slot: A::U32,
}

/// The shared words of a topic, wherever they are stored.
pub(crate) trait Words<A: Atomics> {
    /// The words of the newest publication.
    fn head(&self) -> &Head<A>;
    /// All pins; those of components come first.
    fn pins(&self) -> &[Pin<A>];
    /// Number of slots.
    fn slots(&self) -> usize;
    /// Number of the publication that a slot holds; 0 while it is being filled.
    fn mark(&self, slot: usize) -> &A::U64;
    /// Time of the publication that a slot holds, ns.
    fn time(&self, slot: usize) -> &A::U64;
}

/// The newest publication.
#[inline]
pub(crate) fn newest<A: Atomics>(head: &Head<A>) -> Newest {
    Newest(head.newest.load(A::ordering(Site::Look, Acquire)))
}

/// The order in which a writer takes its slots.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reuse {
    /// The first free one, one at a time: two large values take turns, and stay in the cache.
    First,
    /// Takes all free slots at once. A free slot stays free until it is published, so the writer reads the
    /// pins, which takes their cache lines away from the readers, only once in several publications.
    Several,
    /// Takes the slots that were filled longest ago, so that taps find the earlier values. If there are many
    /// slots, several are taken at once.
    Oldest,
}

/// Largest number of slots that a writer takes at once.
const TAKEN: usize = 8;
/// Smallest number of slots, for each slot taken at once, in a topic with a history.
const MANY: usize = 16;

/// The writing side of a topic. There is one at a time.
#[derive(Debug)]
pub(crate) struct Writer {
    reuse: Reuse,
    /// Number of the last publication.
    number: u64,
    /// Slot of the last publication.
    newest: usize,
    /// The slots taken for the next publications; the last one is filled first.
    taken: [usize; TAKEN],
    /// Number of slots taken.
    count: usize,
}

impl Writer {
    /// Takes over from the previous writer, if there was one.
    pub(crate) fn new<A: Atomics>(words: &impl Words<A>, reuse: Reuse) -> Self {
        let newest = newest(words.head());
        Self { reuse, number: newest.number(), newest: newest.slot(), taken: [0; TAKEN], count: 0 }
    }

    /// The first writer of a topic without publications.
    pub(crate) fn of_empty(reuse: Reuse) -> Self {
        Self { reuse, number: 0, newest: 0, taken: [0; TAKEN], count: 0 }
    }

    /// Number of the publication to come.
    #[inline]
    pub(crate) fn number(&self) -> u64 {
        self.number + 1
    }

    /// The slot to fill.
    #[inline]
    pub(crate) fn slot<A: Atomics>(&mut self, words: &impl Words<A>) -> usize {
        if self.count == 0 {
            self.take(words);
        }
        self.taken[self.count - 1]
    }

    /// Announces the filled slot as the newest value.
    #[inline]
    pub(crate) fn publish<A: Atomics>(&mut self, words: &impl Words<A>, time_ns: u64) {
        let slot = self.slot(words);
        self.number += 1;
        announce(words, Newest::new(self.number, slot), time_ns);
        self.newest = slot;
        self.count -= 1;
    }

    /// Takes slots for the next publications; at least one.
    #[cold]
    fn take<A: Atomics>(&mut self, words: &impl Words<A>) {
        let wanted = match self.reuse {
            Reuse::First => 1,
            Reuse::Several => TAKEN,
            // Taps find nothing in taken slots: take few of many, and no more than there are beyond the
            // history.
            Reuse::Oldest => (words.slots() / MANY).clamp(1, TAKEN.min(words.pins().len() + 1)),
        };
        // Glancing at the pins first saves a fence for each taken slot.
        let seems_free = |slot: usize| !is_pinned::<A>(words.pins(), slot, Relaxed);
        let mut strict = false;
        while self.count == 0 {
            let mut candidates =
                self.candidates(words.slots()).filter(|slot| strict || seems_free(*slot)).peekable();
            while self.count == 0 && candidates.peek().is_some() {
                self.claim(words, candidates.by_ref().take(wanted));
            }
            // With two more slots than pins, one is free; the first glance at the pins may have been out of
            // date.
            strict = true;
        }
        if self.reuse == Reuse::Oldest {
            // A tap finds the next value in the next slot.
            self.taken[..self.count].reverse();
        }
    }

    /// Takes the unpinned ones of the slots, at most [`TAKEN`].
    fn claim<A: Atomics>(&mut self, words: &impl Words<A>, slots: impl Iterator<Item = usize>) {
        let mut marked = [(0, 0); TAKEN];
        let mut count = 0;
        for (slot, entry) in slots.zip(&mut marked) {
            let mark = words.mark(slot);
            *entry = (slot, mark.load(Relaxed));
            mark.store(0, Relaxed);
            count += 1;
        }
        A::fence(Site::Claim);
        // The last one is filled first, so the slots are used from highest to lowest: a reader's processor
        // prefetches lines beyond the end of what it reads, which then belong to an older value, not to the
        // next one to be filled.
        for (slot, held) in &marked[..count] {
            if is_pinned::<A>(words.pins(), *slot, A::ordering(Site::Scan, Acquire)) {
                // Its value is unchanged.
                words.mark(*slot).store(*held, A::ordering(Site::Mark, Release));
            } else {
                self.taken[self.count] = *slot;
                self.count += 1;
            }
        }
    }

    /// Returns all slots but the newest, in the order in which to try them.
    fn candidates(&self, slots: usize) -> impl Iterator<Item = usize> + use<> {
        let (newest, published) = (self.newest, self.number > 0);
        let first = match self.reuse {
            Reuse::Oldest if published => newest + 1,
            Reuse::First | Reuse::Several | Reuse::Oldest => 0,
        };
        (0..slots).map(move |i| (first + i) % slots).filter(move |slot| !published || *slot != newest)
    }
}

fn is_pinned<A: Atomics>(pins: &[Pin<A>], slot: usize, ordering: std::sync::atomic::Ordering) -> bool {
    pins.iter().fold(false, |pinned, pin| pinned | (pin.slot.load(ordering) == slot as u32 + 1))
}

/// Announces a publication: first its time and number in its slot, then the publication itself.
///
/// This is the only store to the line that waiters poll: a polling core takes the line away after each store,
/// and a further store would have to fetch it back.
#[inline]
pub(crate) fn announce<A: Atomics>(words: &impl Words<A>, newest: Newest, time_ns: u64) {
    words.time(newest.slot()).store(time_ns, A::ordering(Site::Time, Release));
    words.mark(newest.slot()).store(newest.number(), A::ordering(Site::Mark, Release));
    // Swapped with whatever an interrupt left there: a reader that sees the publication then also sees what
    // the interrupt was for.
    words.head().newest.swap(newest.0, A::ordering(Site::Publish, Release));
}

/// The newest publication with its own time, ns.
#[inline]
pub(crate) fn newest_with_time<A: Atomics>(words: &impl Words<A>) -> (Newest, u64) {
    loop {
        let seen = newest(words.head());
        // A word that names a nonexistent slot is damaged.
        let time_ns = if seen.slot() < words.slots() { words.time(seen.slot()).load(Relaxed) } else { 0 };
        A::read_fence(Site::TimeRead);
        // The slot is refilled once another one is the newest.
        if Newest(words.head().newest.load(Relaxed)).number() == seen.number() {
            return (seen, time_ns);
        }
    }
}

/// Pins the newest value unless it is the publication `last` or there is none. Returns which one is pinned. A
/// word that names a nonexistent slot is damaged and counts as no news.
///
/// `fetch` is called with the slot just before it is pinned, because both may have to come from another core
/// at the same time.
#[inline]
pub(crate) fn pin_newest<A: Atomics>(
    words: &impl Words<A>,
    pin: &Pin<A>,
    last: u64,
    fetch: impl Fn(usize),
) -> Option<Newest> {
    let mut wanted = newest(words.head());
    if wanted.number() == last || wanted.number() == 0 {
        return None;
    }
    while wanted.slot() < words.slots() {
        fetch(wanted.slot());
        A::store_fenced(&pin.slot, wanted.slot() as u32 + 1, Site::Pin, Site::Pinned);
        let again = newest(words.head());
        if again.number() == wanted.number() {
            return Some(wanted);
        }
        wanted = again;
    }
    None
}

/// Pins a slot if it holds this publication. Returns whether it does.
pub(crate) fn pin_marked<A: Atomics>(words: &impl Words<A>, pin: &Pin<A>, slot: usize, number: u64) -> bool {
    let mark = words.mark(slot);
    if mark.load(Relaxed) != number {
        return false;
    }
    A::store_fenced(&pin.slot, slot as u32 + 1, Site::Pin, Site::Pinned);
    mark.load(Acquire) == number
}

/// Releases whatever a pin holds.
pub(crate) fn unpin<A: Atomics>(pin: &Pin<A>) {
    pin.slot.store(0, A::ordering(Site::Pin, Release));
}
