//! The pin protocol: how one writer and any number of readers share the slots of a topic without copying or
//! waiting.
//!
//! * The writer fills a slot that is neither the newest nor pinned, and announces it with a single store of
//!   one word that contains the publication number and the slot.
//! * A reader pins the announced slot, then checks that this slot is still announced. If so, the writer sees
//!   the pin before it can choose that slot again, and the reader may use the value in place while it keeps
//!   the pin. Otherwise, the reader pins the newly announced slot. It retries at most once per publication.
//! * A tap reads a particular publication, which need not be the newest. It pins the slot marked with the
//!   number of that publication, then checks that the mark is still there. The writer removes the mark of a
//!   slot before it checks the pins.
//!
//! With two more slots than pins, the writer always finds a free slot. A killed reader leaves one slot pinned
//! until its successor pins a new slot. A killed writer leaves the last announced value and one slot without
//! a mark.

use core::fmt::Debug;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};

use crate::atomics::{Atomics, Site, Word};

const INTERRUPT_BITS: u32 = 4;
const NUMBER_BITS: u32 = 44;

/// The newest publication of a topic, packed into one word: interrupt count, number, slot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Newest(pub(crate) u64);

impl Newest {
    /// Creates a publication with this number in this slot, not interrupted.
    #[inline]
    pub(crate) fn new(number: u64, slot: usize) -> Self {
        let number = number & ((1 << NUMBER_BITS) - 1);
        Self((slot as u64) << (INTERRUPT_BITS + NUMBER_BITS) | (number << INTERRUPT_BITS))
    }

    /// Returns the number of the publication, counted from 1; 0 before the first.
    #[inline]
    pub(crate) fn number(self) -> u64 {
        (self.0 >> INTERRUPT_BITS) & ((1 << NUMBER_BITS) - 1)
    }

    /// Returns the slot of the publication.
    #[inline]
    pub(crate) fn slot(self) -> usize {
        (self.0 >> (INTERRUPT_BITS + NUMBER_BITS)) as usize
    }

    /// Returns the publication with one more interrupt.
    pub(crate) fn interrupted(self) -> Self {
        let mask = (1 << INTERRUPT_BITS) - 1;
        Self((self.0 & !mask) | ((self.0 + 1) & mask))
    }
}

/// The words shared by the writer of a topic and its waiters, in one cache line.
#[derive(Debug)]
#[repr(C, align(64))]
pub(crate) struct Head<A: Atomics> {
    /// The newest publication ([`Newest`]). Its low half is the futex on which waiters sleep.
    pub(crate) newest: A::U64,
    /// Number of sleeping readers. A reader killed during its sleep remains counted, which only costs one
    /// system call per publication.
    pub(crate) sleepers: A::U32,
    /// Core of the last publication plus 1; 0 before the first.
    pub(crate) core: A::U32,
}

/// The slot that a reader uses. It fills a pair of cache lines, because processors prefetch the neighbouring
/// line.
#[derive(Debug)]
#[repr(C, align(128))]
pub(crate) struct Pin<A: Atomics> {
    /// Index of the slot plus 1; 0 if nothing is pinned.
    pub(crate) slot: A::U32,
}

/// Access to the shared words of a topic, independent of where they are stored.
pub(crate) trait Words<A: Atomics> {
    /// Returns the words of the newest publication.
    fn head(&self) -> &Head<A>;
    /// Returns all pins; the pins of components come first.
    fn pins(&self) -> &[Pin<A>];
    /// Returns the number of slots.
    fn slots(&self) -> usize;
    /// Returns the number of the publication in a slot; 0 while the slot is being filled.
    fn mark(&self, slot: usize) -> &A::U64;
    /// Returns the time of the publication in a slot, ns.
    fn time(&self, slot: usize) -> &A::U64;
}

/// Returns the newest publication.
#[inline]
pub(crate) fn newest<A: Atomics>(head: &Head<A>) -> Newest {
    Newest(head.newest.load(A::ordering(Site::Look, Acquire)))
}

/// Order in which a writer claims slots.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reuse {
    /// Claims the first free slot, one at a time: two slots of large values alternate and stay in the cache.
    First,
    /// Claims several free slots together. A free slot stays free until it is published, so the writer reads
    /// the pins, which moves their cache lines away from the readers, only once in several publications.
    Several,
    /// Claims the slots that were filled longest ago, so that taps find the earlier values. If there are many
    /// slots, several are claimed together.
    Oldest,
}

/// Maximum number of slots that a writer claims together.
const TAKEN: usize = 8;
/// Minimum number of slots per slot claimed together, in a topic with a history.
const MANY: usize = 16;

/// The writing side of a topic. There is only one at a time.
#[derive(Debug)]
pub(crate) struct Writer {
    reuse: Reuse,
    /// Number of the last publication.
    number: u64,
    /// Slot of the last publication.
    newest: usize,
    /// Slots claimed for the next publications; the last one is filled first.
    taken: [usize; TAKEN],
    /// Number of claimed slots.
    count: usize,
}

impl Writer {
    /// Creates the writer, which continues after the previous one, if there was one.
    pub(crate) fn new<A: Atomics>(words: &impl Words<A>, reuse: Reuse) -> Self {
        let newest = newest(words.head());
        Self { reuse, number: newest.number(), newest: newest.slot(), taken: [0; TAKEN], count: 0 }
    }

    /// Creates the first writer of a topic without publications.
    pub(crate) fn of_empty(reuse: Reuse) -> Self {
        Self { reuse, number: 0, newest: 0, taken: [0; TAKEN], count: 0 }
    }

    /// Returns the number of the next publication.
    #[inline]
    pub(crate) fn number(&self) -> u64 {
        self.number + 1
    }

    /// Returns the slot to fill.
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

    /// Claims slots for the next publications, at least one.
    #[cold]
    fn take<A: Atomics>(&mut self, words: &impl Words<A>) {
        let wanted = match self.reuse {
            Reuse::First => 1,
            Reuse::Several => TAKEN,
            // Taps find nothing in claimed slots, so claim few of many, and no more than there are beyond the
            // history.
            Reuse::Oldest => (words.slots() / MANY).clamp(1, TAKEN.min(words.pins().len() + 1)),
        };
        // A relaxed read of the pins first saves a fence for each claimed slot.
        let seems_free = |slot: usize| !is_pinned::<A>(words.pins(), slot, Relaxed);
        let mut strict = false;
        while self.count == 0 {
            let mut candidates =
                self.candidates(words.slots()).filter(|slot| strict || seems_free(*slot)).peekable();
            while self.count == 0 && candidates.peek().is_some() {
                self.claim(words, candidates.by_ref().take(wanted));
            }
            // With two more slots than pins, one is free; the relaxed read of the pins may have been out of
            // date.
            strict = true;
        }
        if self.reuse == Reuse::Oldest {
            // A tap finds the next value in the next slot.
            self.taken[..self.count].reverse();
        }
    }

    /// Claims the unpinned slots, at most [`TAKEN`].
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
        // The last one is filled first, so the slots are used from highest to lowest. A reader's processor
        // prefetches lines past the end of its value, which then belong to an older value, not to the next
        // slot to be filled.
        for (slot, held) in &marked[..count] {
            if is_pinned::<A>(words.pins(), *slot, A::ordering(Site::Scan, Acquire)) {
                // The value in the slot is unchanged.
                words.mark(*slot).store(*held, A::ordering(Site::Mark, Release));
            } else {
                self.taken[self.count] = *slot;
                self.count += 1;
            }
        }
    }

    /// Returns all slots except the newest, in the order in which to try them.
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
/// This is the only store to the line that waiters poll. A polling core fetches the line after every store,
/// and a second store would have to fetch it back.
#[inline]
pub(crate) fn announce<A: Atomics>(words: &impl Words<A>, newest: Newest, time_ns: u64) {
    words.time(newest.slot()).store(time_ns, A::ordering(Site::Time, Release));
    words.mark(newest.slot()).store(newest.number(), A::ordering(Site::Mark, Release));
    // A swap, not a store, because of interrupts: a reader that sees the publication then also sees the
    // command behind an earlier interrupt.
    words.head().newest.swap(newest.0, A::ordering(Site::Publish, Release));
}

/// Returns the newest publication with its own time, ns.
#[inline]
pub(crate) fn newest_with_time<A: Atomics>(words: &impl Words<A>) -> (Newest, u64) {
    loop {
        let seen = newest(words.head());
        // A word that names a nonexistent slot is damaged.
        let time_ns = if seen.slot() < words.slots() { words.time(seen.slot()).load(Relaxed) } else { 0 };
        A::read_fence(Site::TimeRead);
        // The slot may be refilled once another one is the newest.
        if Newest(words.head().newest.load(Relaxed)).number() == seen.number() {
            return (seen, time_ns);
        }
    }
}

/// Pins the newest value and returns its publication. Returns `None` if nothing was published or the newest
/// publication is `last`. A word that names a nonexistent slot is damaged and counts as no publication.
///
/// `fetch` is called with the slot just before it is pinned, so that the transfers of slot and pin from other
/// cores overlap.
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

/// Pins a slot if it contains the publication `number`. Returns `true` on success.
pub(crate) fn pin_marked<A: Atomics>(words: &impl Words<A>, pin: &Pin<A>, slot: usize, number: u64) -> bool {
    let mark = words.mark(slot);
    if mark.load(Relaxed) != number {
        return false;
    }
    A::store_fenced(&pin.slot, slot as u32 + 1, Site::Pin, Site::Pinned);
    mark.load(Acquire) == number
}

/// Releases the slot of a pin.
pub(crate) fn unpin<A: Atomics>(pin: &Pin<A>) {
    pin.slot.store(0, A::ordering(Site::Pin, Release));
}
