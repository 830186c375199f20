//! A word in shared memory that tells of publications, and wakes whoever waits for one.

#![allow(unsafe_code)] // the one place where mapped bytes become a bell

use std::cell::Cell;
use std::fs::OpenOptions;
use std::io;
use std::path::Path;
use std::rc::Rc;
use std::sync::atomic::Ordering::{Acquire, Relaxed, SeqCst};
use std::sync::atomic::{AtomicU32, AtomicU64};

use memmap2::{MmapOptions, MmapRaw};

use crate::os::{current_core, futex_wait, futex_wake};

const FILE_BYTES: u64 = 4096;

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
}

/// The bell of one topic. Any number ring it, any number wait, and no ring is lost: a waiter names the last ring it
/// has heard, and sleeps only while there was none since.
#[derive(Debug)]
pub(super) struct Bell(MmapRaw);

impl Bell {
    /// Makes the file of a bell.
    pub(super) fn create(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new().read(true).write(true).create_new(true).open(path)?;
        // Reserve the page now: on a full file system the first ring would otherwise die of SIGBUS.
        rustix::fs::fallocate(&file, rustix::fs::FallocateFlags::empty(), 0, FILE_BYTES)?;
        Ok(Self(MmapOptions::new().len(FILE_BYTES as usize).map_raw(&file)?))
    }

    /// Opens the file of a bell.
    pub(super) fn open(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new().read(true).write(true).open(path)?;
        if file.metadata()?.len() != FILE_BYTES {
            return Err(io::Error::other("its file was cut short"));
        }
        Ok(Self(MmapOptions::new().len(FILE_BYTES as usize).map_raw(&file)?))
    }

    fn words(&self) -> &Words {
        // SAFETY: the mapping is page-aligned and as long as a page (checked when it was made or opened); the words
        // are all atomics, valid for any bytes and shareable between processes.
        unsafe { &*self.0.as_ptr().cast::<Words>() }
    }

    /// Rings: wakes all who wait. A system call only if somebody sleeps.
    pub(super) fn ring(&self) {
        self.count();
        self.wake();
    }

    /// Counts a ring, which those see who look; [`wake`](Self::wake) is to follow.
    fn count(&self) {
        let words = self.words();
        let core = current_core() as u32 + 1;
        if words.core.load(Relaxed) != core {
            words.core.store(core, Relaxed);
        }
        // Either this sees the sleeper, or the sleeper (who counts itself first) sees the ring.
        words.rings.fetch_add(1, SeqCst);
    }

    /// Wakes all who wait for a ring that was counted.
    fn wake(&self) {
        let words = self.words();
        if words.sleepers.load(SeqCst) != 0 {
            futex_wake(&words.rings);
        }
    }

    /// Says where the newest sample lies; to be followed by a ring.
    pub(super) fn point_to(&self, place: u64) {
        self.words().place.store(place, Relaxed);
    }

    /// Where the newest sample lies, if it has not been overwritten by a newer one meanwhile.
    pub(super) fn place(&self) -> u64 {
        self.words().place.load(Relaxed)
    }

    /// The rings so far.
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
        futex_wait(&words.rings, heard, None);
        words.sleepers.fetch_sub(1, SeqCst);
    }
}

/// A bell that wakes nobody before the step of its publisher is over.
///
/// Whom a topic wakes on the publisher's own core cannot run before that gives up the core anyway; woken earlier, those
/// more urgent would cut the step in two.
#[derive(Debug)]
pub(crate) struct LateBell {
    bell: Rc<Bell>,
    owes: Cell<bool>,
}

impl LateBell {
    pub(super) fn new(bell: Rc<Bell>) -> Self {
        Self { bell, owes: Cell::new(false) }
    }

    /// Counts a ring; whoever sleeps goes on sleeping.
    pub(super) fn ring(&self) {
        self.bell.count();
        self.owes.set(true);
    }

    /// Wakes those who wait for what has been published since the last time.
    pub(crate) fn wake(&self) {
        if self.owes.take() {
            self.bell.wake();
        }
    }
}
