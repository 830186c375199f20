//! The shared memory of one topic.

#![allow(unsafe_code)] // the only place where mapped bytes become the words and slots of a topic

use core::ptr::NonNull;
use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};

use iceoryx2::node::Node;
use iceoryx2_bb_posix::access_mode::AccessMode;
use iceoryx2_cal::named_concept::{
    NamedConceptBuilder as _, NamedConceptConfiguration as _, NamedConceptMgmt,
};
use iceoryx2_cal::shared_memory::{SharedMemory as _, SharedMemoryBuilder as _};
use iceoryx2_cal::shm_allocator::bump_allocator::{self, BumpAllocator};

use super::dimensions::{Dimensions, LINE, PAGE, Preface, SIDE_PINS};
use super::notify::{self, Futex};
use super::protocol::{Head, Newest, Pin, Reuse, Words, newest};
use crate::atomics::Native;
use crate::domain::Shared;
use crate::os::{futex_sleep, futex_wake_low};
use crate::plan::TopicPlan;
use crate::state::{Digest, InUse, Stamp};
use crate::transport::error::{PortError, refused};

/// iceoryx2's shared memory, so that iceoryx2 handles names, permissions and clean-up.
type Storage = iceoryx2_cal::shared_memory::recommended::Ipc<BumpAllocator>;
type Configuration = <Storage as NamedConceptMgmt>::Configuration;

/// First word of a topic's memory; the low digits are the version of its layout.
const MAGIC: u64 = 0x6d6f_746f_746f_0002;
/// Size of a value above which the time to fill it outweighs the choice of its slot, bytes.
const LARGE: usize = 16 * 1024;

/// The words before each value.
#[derive(Debug)]
#[repr(C, align(64))]
struct Slot {
    mark: AtomicU64,
    stamp: [AtomicU64; STAMP_WORDS],
}

/// Number of words of a stamp.
const STAMP_WORDS: usize = size_of::<Stamp>() / size_of::<AtomicU64>();
/// Index of the publication time among the words of a stamp.
const PUBLISH_TIME: usize = core::mem::offset_of!(Stamp, publish_time) / size_of::<AtomicU64>();

/// Mapped memory of a topic: words that any process may access at any time, and slots whose values are
/// accessed under the pin protocol only.
#[derive(Debug)]
pub(crate) struct TopicMemory {
    base: NonNull<u8>,
    dimensions: Dimensions,
    in_use: InUse,
    _storage: Storage,
}

impl TopicMemory {
    /// Creates the memory of a topic and reserves all pages, so that a lack of memory is an error here rather
    /// than a crash on a later access.
    pub(crate) fn create(node: &Node<Shared>, topic: &TopicPlan) -> Result<Self, PortError> {
        let refuse = refused(&topic.name, "creating its shared memory");
        let dimensions = Dimensions::from_topic(topic);
        let storage = builder(node, topic, &refuse)?
            .has_ownership(true)
            .size(dimensions.bytes().saturating_add(PAGE))
            .create(&bump_allocator::Config::default())
            .map_err(|error| refuse(&error))?;
        let memory =
            Self::map(storage, topic).ok_or_else(|| refuse(&"the mapping is smaller than requested"))?;
        memory.reserve().map_err(|error| refuse(&error))?;
        memory.preface().dimensions.store(dimensions.hash(topic), Relaxed);
        memory.preface().magic.store(MAGIC, Release);
        Ok(memory)
    }

    /// Opens the memory of a topic created by the launcher.
    pub(crate) fn open(node: &Node<Shared>, topic: &TopicPlan) -> Result<Self, PortError> {
        let refuse = refused(&topic.name, "opening its shared memory");
        let dimensions = Dimensions::from_topic(topic);
        let storage =
            builder(node, topic, &refuse)?.open(AccessMode::ReadWrite).map_err(|error| refuse(&error))?;
        let memory = Self::map(storage, topic).ok_or_else(|| refuse(&"the shared memory is truncated"))?;
        let preface = memory.preface();
        if preface.magic.load(Acquire) != MAGIC || preface.dimensions.load(Relaxed) != dimensions.hash(topic)
        {
            return Err(refuse(
                &"the shared memory was created by another version of motorium or for another type",
            ));
        }
        // If this fails, pages are mapped on first access, which only costs page faults.
        let _ = memory.reserve();
        Ok(memory)
    }

    fn map(storage: Storage, topic: &TopicPlan) -> Option<Self> {
        let dimensions = Dimensions::from_topic(topic);
        let address = storage.payload_start_address();
        let base = address.next_multiple_of(align_of::<Pin<Native>>());
        let fits = storage.size() >= (base - address).saturating_add(dimensions.bytes());
        let base = NonNull::new(core::ptr::with_exposed_provenance_mut::<u8>(base)).filter(|_| fits)?;
        let in_use = InUse::from_layout(&topic.layout, dimensions.value);
        Some(Self { base, dimensions, in_use, _storage: storage })
    }

    /// Maps every page now.
    fn reserve(&self) -> std::io::Result<()> {
        let first = self.base.as_ptr() as usize & !(PAGE - 1);
        let bytes = self.base.as_ptr() as usize + self.dimensions.bytes() - first;
        let advice = rustix::mm::Advice::LinuxPopulateWrite;
        // SAFETY: the range is in the mapping, which begins on a page; populating it changes no byte.
        match unsafe { rustix::mm::madvise(first as *mut _, bytes, advice) } {
            // Linux before 5.14 does not know the advice: pages are mapped on first use.
            Ok(()) | Err(rustix::io::Errno::INVAL) => Ok(()),
            Err(error) => Err(std::io::Error::other(format!(
                "reserving the pages of the shared memory failed: {error}"
            ))),
        }
    }

    fn preface(&self) -> &Preface {
        // SAFETY: the memory begins with the preface, aligned (see `map`); its words are atomics, valid for
        // any bytes.
        unsafe { self.base.cast::<Preface>().as_ref() }
    }

    #[inline]
    fn slot(&self, slot: usize) -> *mut Slot {
        assert!(slot < self.dimensions.slots, "a topic's words name a slot that it does not have");
        // SAFETY: in bounds of the mapping by the assertion; aligned, since every slot begins at a multiple
        // of a cache line.
        unsafe {
            self.base.as_ptr().add(self.dimensions.slots_at() + slot * self.dimensions.stride).cast::<Slot>()
        }
    }

    /// Returns the value in a slot. Only a reader that has pinned the slot, or the writer that has claimed
    /// it, may access the value.
    #[inline]
    pub(crate) fn value(&self, slot: usize) -> *mut u8 {
        self.slot(slot).cast::<u8>().wrapping_add(self.dimensions.value)
    }

    /// Returns the stamp in a slot. The same access rule applies as for its value.
    #[inline]
    pub(crate) fn stamp(&self, slot: usize) -> *const Stamp {
        self.stamp_words(slot).cast()
    }

    /// Returns the words of the stamp in a slot. Waiters read the time of publication without a pin, so the
    /// stamp is written word by word.
    #[inline]
    fn stamp_words(&self, slot: usize) -> *const [AtomicU64; STAMP_WORDS] {
        // SAFETY: in bounds; no reference is created.
        unsafe { &raw const (*self.slot(slot)).stamp }
    }

    /// Writes the stamp of a claimed slot, except for the time of publication, which the announcement writes.
    #[inline]
    pub(crate) fn write_stamp(&self, slot: usize, stamp: &Stamp) {
        // SAFETY: in bounds and aligned (see `slot`); an atomic is valid for any bytes.
        let cells = unsafe { &*self.stamp_words(slot) };
        // SAFETY: a stamp is this number of words without padding.
        let words: [u64; STAMP_WORDS] = unsafe { core::mem::transmute(*stamp) };
        let all = cells.iter().zip(words).enumerate().filter(|(index, _)| *index != PUBLISH_TIME);
        all.for_each(|(_, (cell, word))| cell.store(word, Relaxed));
    }

    /// Returns the size of a value, bytes.
    #[inline]
    pub(crate) fn value_bytes(&self) -> usize {
        self.dimensions.size
    }

    /// Prefetches the parts of a slot that are in use, assuming the same counts as in the slot `like`.
    /// Without `like`, prefetches the beginning of the slot. Returns the address of the slot.
    ///
    /// # Safety
    /// Nobody writes the value in the slot `like` during the call: the caller has pinned it, or is the only
    /// writer and has not claimed it.
    #[inline]
    pub(super) unsafe fn fetch(
        &self,
        slot: usize,
        like: Option<usize>,
        prefetch: impl Fn(*const u8, usize),
    ) -> *const u8 {
        let first = self.slot(slot).cast::<u8>().cast_const();
        let Some(like) = like else {
            prefetch(first, InUse::MOST);
            return first;
        };
        let value = self.value(like).cast_const();
        // SAFETY: `at` is within the value (see `InUse::from_layout`), which is initialised, and which nobody
        // writes, as the caller guarantees.
        let count = |at: usize| unsafe { value.add(at).cast::<u32>().read_unaligned() } as usize;
        self.in_use.each(count, |offset, size| prefetch(first.wrapping_add(offset), size));
        first
    }

    /// Returns the newest publication.
    #[inline]
    pub(crate) fn newest(&self) -> Newest {
        newest(self.head())
    }

    /// Returns the order in which the writer reuses the slots.
    pub(crate) fn reuse(&self) -> Reuse {
        if self.dimensions.slots > self.dimensions.pins + 2 {
            Reuse::Oldest
        } else if self.is_large() {
            Reuse::First
        } else {
            Reuse::Several
        }
    }

    /// Returns `true` if the time to fill a value outweighs the choice of its slot.
    #[inline]
    pub(crate) fn is_large(&self) -> bool {
        self.dimensions.size > LARGE
    }

    /// Wakes all waiters for the next publication.
    #[inline(always)]
    pub(crate) fn notify(&self) {
        notify::notify::<Native>(self.head(), &SystemFutex::FOREVER);
    }

    /// Interrupts all waiters without a publication.
    pub(crate) fn interrupt(&self) {
        notify::interrupt::<Native>(self.head(), &SystemFutex::FOREVER);
    }

    /// Sleeps until a publication or interrupt after `seen`, a signal, or the time `until_ns`.
    #[inline(always)]
    pub(crate) fn sleep(&self, seen: Newest, until_ns: Option<u64>) {
        notify::sleep::<Native>(self.head(), &SystemFutex { until_ns }, seen);
    }

    /// Records the core of the next publication.
    #[inline]
    pub(crate) fn publish_from(&self, core: usize) {
        let core = core as u32 + 1;
        if self.head().core.load(Relaxed) != core {
            self.head().core.store(core, Relaxed);
        }
    }

    /// Returns the core of the last publication, if there was one.
    #[inline]
    pub(crate) fn core(&self) -> Option<usize> {
        self.head().core.load(Relaxed).checked_sub(1).map(|core| core as usize)
    }

    /// Clears all publications for a new episode, while nobody publishes and only taps read.
    pub(crate) fn clear(&self) {
        (0..self.slots()).for_each(|slot| {
            self.mark(slot).store(0, Relaxed);
            self.time(slot).store(0, Relaxed);
        });
        self.head().newest.store(0, Release);
    }

    /// Returns the pins for observing processes, which follow the pins of the graph's readers.
    pub(crate) fn side_pins(&self) -> core::ops::Range<usize> {
        self.dimensions.pins - SIDE_PINS..self.dimensions.pins
    }
}

impl Words<Native> for TopicMemory {
    #[inline]
    fn head(&self) -> &Head<Native> {
        // SAFETY: the head follows the preface with the same alignment; its words are atomics, valid for any
        // bytes and shareable.
        unsafe { &*self.base.as_ptr().add(size_of::<Preface>()).cast::<Head<Native>>() }
    }

    #[inline]
    fn pins(&self) -> &[Pin<Native>] {
        // SAFETY: as for the head; `map` checked that all pins fit.
        unsafe {
            let first = self.base.as_ptr().add(self.dimensions.pins_at()).cast::<Pin<Native>>();
            core::slice::from_raw_parts(first, self.dimensions.pins)
        }
    }

    #[inline]
    fn slots(&self) -> usize {
        self.dimensions.slots
    }

    #[inline]
    fn mark(&self, slot: usize) -> &AtomicU64 {
        // SAFETY: in bounds and aligned (see `slot`); an atomic is valid for any bytes.
        unsafe { &(*self.slot(slot)).mark }
    }

    #[inline]
    fn time(&self, slot: usize) -> &AtomicU64 {
        // SAFETY: as in `mark`.
        unsafe { &(*self.slot(slot)).stamp[PUBLISH_TIME] }
    }
}

/// The system's futex on the low half of a word.
struct SystemFutex {
    /// Latest end of the sleep, ns on `CLOCK_MONOTONIC`.
    until_ns: Option<u64>,
}

impl SystemFutex {
    const FOREVER: Self = Self { until_ns: None };
}

impl Futex<Native> for SystemFutex {
    #[inline(always)]
    fn sleep(&self, word: &AtomicU64, seen: u64) {
        futex_sleep(word, seen, self.until_ns);
    }

    #[inline(always)]
    fn wake(&self, word: &AtomicU64) {
        futex_wake_low(word);
    }
}

fn builder(
    node: &Node<Shared>,
    topic: &TopicPlan,
    refuse: &impl Fn(&dyn core::fmt::Display) -> PortError,
) -> Result<<Storage as iceoryx2_cal::shared_memory::SharedMemory<BumpAllocator>>::Builder, PortError> {
    use iceoryx2::prelude::{FileName, SemanticString as _};
    if topic.layout.alignment > LINE {
        return Err(refuse(&format!(
            "the alignment of its type is {} bytes, expected at most {LINE}",
            topic.layout.alignment
        )));
    }
    let mut digest = Digest::default();
    digest.write(topic.name.as_bytes());
    let file = |text: &str| FileName::new(text.as_bytes()).map_err(|error| refuse(&format!("{error:?}")));
    let configuration = Configuration::default()
        .prefix(&node.config().global.prefix)
        .suffix(&file(".topic")?)
        .path_hint(node.config().global.root_path());
    let name = file(&format!("{:016x}", digest.finish()))?;
    Ok(<Storage as iceoryx2_cal::shared_memory::SharedMemory<BumpAllocator>>::Builder::new(&name)
        .config(&configuration))
}
