//! Memory shared by the two processes of a measurement: words for the floors, and space for samples.

#![allow(unsafe_code)] // the one place where mapped bytes become words

use std::fs::OpenOptions;
use std::path::Path;
use std::sync::atomic::Ordering::{Relaxed, Release};
use std::sync::atomic::{AtomicU32, AtomicU64};

use memmap2::{MmapOptions, MmapRaw};

/// A word alone on its cache line and the adjacent one, which the processor may prefetch.
#[derive(Debug)]
#[repr(C, align(128))]
pub(super) struct Line {
    pub(super) word: AtomicU64,
    pub(super) futex: AtomicU32,
}

/// Numbers of a payload of 512 B.
pub(super) const NUMBERS: usize = 64;
/// Payloads that a side writes in turn.
pub(super) const PAYLOADS: usize = 4;

/// A payload in plain shared memory.
#[derive(Debug)]
#[repr(C, align(128))]
pub(super) struct Payload(pub(super) [AtomicU64; NUMBERS]);

/// State of one of the two processes.
#[derive(Debug)]
#[repr(C, align(128))]
pub(super) struct Side {
    /// 1 when ready to start.
    pub(super) ready: AtomicU32,
    /// `SCHED_FIFO` priority read back; 0 for normal time sharing.
    pub(super) fifo: AtomicU32,
    /// Number of samples that this side has recorded.
    pub(super) recorded: AtomicU64,
}

#[derive(Debug)]
#[repr(C)]
struct Head {
    /// Lines on which the two sides send, one for each direction.
    lines: [Line; 2],
    sides: [Side; 2],
    payloads: [[Payload; PAYLOADS]; 2],
}

/// The memory that the two processes of one measurement share.
#[derive(Debug)]
pub(super) struct SharedBuffer {
    memory: MmapRaw,
    room: usize,
}

impl SharedBuffer {
    /// Creates a buffer for `room` samples of each side.
    pub(super) fn create(path: &Path, room: usize) -> std::io::Result<Self> {
        let file = OpenOptions::new().read(true).write(true).create_new(true).open(path)?;
        let bytes = size_of::<Head>() + 2 * room * 8;
        rustix::fs::fallocate(&file, rustix::fs::FallocateFlags::empty(), 0, bytes as u64)?;
        Ok(Self { memory: MmapOptions::new().len(bytes).map_raw(&file)?, room })
    }

    /// Opens the buffer that was created with the same `room`.
    pub(super) fn open(path: &Path, room: usize) -> std::io::Result<Self> {
        let file = OpenOptions::new().read(true).write(true).open(path)?;
        let bytes = size_of::<Head>() + 2 * room * 8;
        if file.metadata()?.len() < bytes as u64 {
            return Err(std::io::Error::other("the shared memory was cut short"));
        }
        Ok(Self { memory: MmapOptions::new().len(bytes).map_raw(&file)?, room })
    }

    fn head(&self) -> &Head {
        // SAFETY: the mapping is page-aligned and longer than the head, which is all atomics, valid for any
        // bytes.
        unsafe { &*self.memory.as_ptr().cast::<Head>() }
    }

    /// Returns the line on which a side sends.
    pub(super) fn line(&self, side: usize) -> &Line {
        &self.head().lines[side]
    }

    /// Returns the payload of a round of a side.
    pub(super) fn payload(&self, side: usize, round: u64) -> &Payload {
        &self.head().payloads[side][round as usize % PAYLOADS]
    }

    /// Returns the state of a side.
    pub(super) fn side(&self, side: usize) -> &Side {
        &self.head().sides[side]
    }

    fn samples(&self, side: usize) -> &[AtomicU64] {
        // SAFETY: twice `room` words follow the header (ensured by both constructors), aligned because the
        // header's size is a multiple of its alignment; atomics are valid for any bytes.
        unsafe {
            let first = self.memory.as_ptr().add(size_of::<Head>()).cast::<AtomicU64>();
            core::slice::from_raw_parts(first.add(side * self.room), self.room)
        }
    }

    /// Records a sample; one too many is dropped.
    pub(super) fn record(&self, side: usize, nanoseconds: u64) {
        let recorded = &self.side(side).recorded;
        let index = recorded.load(Relaxed);
        if let Some(cell) = self.samples(side).get(index as usize) {
            cell.store(nanoseconds, Relaxed);
            recorded.store(index + 1, Release);
        }
    }

    /// Returns the samples of a side.
    pub(super) fn recorded(&self, side: usize) -> Vec<u64> {
        let count = self.side(side).recorded.load(std::sync::atomic::Ordering::Acquire) as usize;
        self.samples(side)[..count.min(self.room)].iter().map(|cell| cell.load(Relaxed)).collect()
    }

    /// Touches all memory, so that recording never causes a page fault.
    pub(super) fn touch(&self, side: usize) {
        self.samples(side).iter().for_each(|cell| cell.store(0, Relaxed));
    }
}
