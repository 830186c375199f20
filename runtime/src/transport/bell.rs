//! A word in shared memory that tells of publications, and wakes whoever waits for one. Behind it lie the newest values of
//! a small state topic.

#![allow(unsafe_code)] // the one place where mapped bytes become a bell

use std::fs::OpenOptions;
use std::io;
use std::path::Path;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release, SeqCst};
use std::sync::atomic::{AtomicU32, AtomicU64};

use memmap2::{MmapOptions, MmapRaw};

use crate::os::{futex_wait, futex_wake};

const PAGE: usize = 4096;
/// What lies before the values, bytes.
pub(super) const WORDS_BYTES: usize = 64;

/// What lies in the file. Zero bytes are a bell that was never rung.
#[derive(Debug)]
#[repr(C, align(64))]
struct Words {
    /// Counts the rings, wrapping.
    rings: AtomicU32,
    /// How many wait in the kernel. One that is killed there stays counted: it costs a system call per ring, and
    /// nothing else.
    sleepers: AtomicU32,
    /// One more than the core on which it was rung last; 0 before.
    core: AtomicU32,
    /// Where the newest sample lies, counted from wherever its publisher likes, bytes.
    place: AtomicU64,
    /// Number of the newest of the values behind the words; 0 for none.
    newest: AtomicU64,
}

const _: () = assert!(size_of::<Words>() == WORDS_BYTES);

/// The bell of one topic. Any number ring it, any number wait, and no ring is lost: a waiter names the last ring it
/// has heard, and sleeps only while there was none since.
#[derive(Debug)]
pub(crate) struct Bell(MmapRaw);

impl Bell {
    /// Makes the file of a bell with room for values of so many bytes.
    pub(super) fn create(path: &Path, values: usize) -> io::Result<Self> {
        let file = OpenOptions::new().read(true).write(true).create_new(true).open(path)?;
        // Reserve the pages now: on a full file system the first ring would otherwise die of SIGBUS.
        let bytes = file_bytes(values);
        rustix::fs::fallocate(&file, rustix::fs::FallocateFlags::empty(), 0, bytes as u64)?;
        Ok(Self(MmapOptions::new().len(bytes).map_raw(&file)?))
    }

    /// Opens the file of a bell with room for values of so many bytes.
    pub(super) fn open(path: &Path, values: usize) -> io::Result<Self> {
        let file = OpenOptions::new().read(true).write(true).open(path)?;
        let bytes = file_bytes(values);
        if file.metadata()?.len() != bytes as u64 {
            return Err(io::Error::other("its file was cut short"));
        }
        Ok(Self(MmapOptions::new().len(bytes).map_raw(&file)?))
    }

    /// Length of the mapping, bytes.
    #[inline]
    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    /// The memory of the values.
    #[inline]
    pub(super) fn behind_words(&self) -> *mut u8 {
        self.0.as_mut_ptr().wrapping_add(WORDS_BYTES)
    }

    /// Number of the newest value; 0 for none.
    #[inline]
    pub(super) fn newest(&self) -> u64 {
        self.words().newest.load(Acquire)
    }

    /// Says which value is the newest; to be followed by a ring.
    #[inline]
    pub(super) fn say_newest(&self, number: u64) {
        self.words().newest.store(number, Release);
    }

    #[inline]
    fn words(&self) -> &Words {
        // SAFETY: the mapping is page-aligned and as long as a page (checked when it was made or opened); the words
        // are all atomics, valid for any bytes and shareable between processes.
        unsafe { &*self.0.as_ptr().cast::<Words>() }
    }

    /// Rings from a core: wakes all who wait. A system call only if somebody sleeps.
    pub(super) fn ring(&self, core: usize) {
        self.count(core);
        self.wake();
    }

    /// Counts a ring from a core, which those see who look; [`wake`](Self::wake) is to follow.
    #[inline]
    pub(super) fn count(&self, core: usize) {
        let words = self.words();
        let core = core as u32 + 1;
        if words.core.load(Relaxed) != core {
            words.core.store(core, Relaxed);
        }
        // Either this sees the sleeper, or the sleeper (who counts itself first) sees the ring.
        words.rings.fetch_add(1, SeqCst);
    }

    /// Wakes all who wait for a ring that was counted.
    #[inline]
    pub(super) fn wake(&self) {
        let words = self.words();
        if words.sleepers.load(SeqCst) != 0 {
            futex_wake(&words.rings);
        }
    }

    /// Says where the newest sample lies; to be followed by a ring.
    #[inline]
    pub(super) fn point_to(&self, place: u64) {
        self.words().place.store(place, Relaxed);
    }

    /// Where the newest sample lies, if it has not been overwritten by a newer one meanwhile.
    #[inline]
    pub(super) fn place(&self) -> u64 {
        self.words().place.load(Relaxed)
    }

    /// The rings so far.
    #[inline]
    pub(super) fn rings(&self) -> u32 {
        self.words().rings.load(Acquire)
    }

    /// The core on which it was rung last, if it ever was.
    pub(super) fn core(&self) -> Option<usize> {
        self.words().core.load(Relaxed).checked_sub(1).map(|core| core as usize)
    }

    /// Sleeps while there was no ring after `heard`; may return early, when a signal arrives.
    pub(super) fn sleep(&self, heard: u32) {
        let words = self.words();
        words.sleepers.fetch_add(1, SeqCst);
        while !futex_wait(&words.rings, heard, None) && words.rings.load(Acquire) == heard {}
        words.sleepers.fetch_sub(1, SeqCst);
    }
}

fn file_bytes(values: usize) -> usize {
    (WORDS_BYTES + values).next_multiple_of(PAGE)
}
