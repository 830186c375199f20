//! The mapped file of a control block.

#![allow(unsafe_code)] // the only place where mapped bytes become blocks

use std::fs::OpenOptions;
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};

use memmap2::{MmapOptions, MmapRaw};

use super::trace::{MOST_EVENTS, TraceHead, TraceRing, TraceSlot};
use super::{ComponentBlock, EdgeBlock, EventLog, Header, LatencyBlock, TopicBlock};
use crate::plan::Plan;

/// First word of every control block; the low digits are the version of its layout.
const MAGIC: u64 = 0x6d6f_746f_7269_000b;

/// Error of creating or opening a control block.
#[derive(Debug, thiserror::Error)]
pub enum RegionError {
    /// A file operation failed.
    #[error("{path}: {source}")]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file is not a control block of this version of motorium, or is truncated.
    #[error("{path}: {found}; expected the control block of a run created by this version of motorium")]
    NotARegion {
        /// Path of the file.
        path: PathBuf,
        /// Description of the content found.
        found: String,
    },
}

/// Numbers of blocks in a control block.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Counts {
    components: usize,
    topics: usize,
    latencies: usize,
    edges: usize,
    /// Number of events in the trace of each component: a power of two, or 0.
    traced: usize,
}

impl Counts {
    /// The event log is between the header and the first block.
    const COMPONENTS_AT: usize = size_of::<Header>() + size_of::<EventLog>();

    fn from_plan(plan: &Plan) -> Self {
        Self {
            components: plan.components.len(),
            topics: plan.topics.len(),
            latencies: plan.latencies.len(),
            edges: plan.edges().len(),
            traced: match plan.trace_events {
                0 => 0,
                events => events.clamp(2, MOST_EVENTS).next_power_of_two(),
            },
        }
    }

    fn bytes(self) -> usize {
        let rings = if self.traced == 0 { 0 } else { self.components };
        self.trace_at() + rings * (size_of::<TraceHead>() + self.traced * size_of::<TraceSlot>())
    }

    #[inline]
    fn topics_at(self) -> usize {
        Self::COMPONENTS_AT + self.components * size_of::<ComponentBlock>()
    }

    fn latencies_at(self) -> usize {
        self.topics_at() + self.topics * size_of::<TopicBlock>()
    }

    fn edges_at(self) -> usize {
        self.latencies_at() + self.latencies * size_of::<LatencyBlock>()
    }

    /// Returns the offset of the heads of the rings, which are followed by the slots of each ring.
    fn trace_at(self) -> usize {
        self.edges_at() + self.edges * size_of::<EdgeBlock>()
    }

    fn slots_at(self, component: usize) -> usize {
        self.trace_at()
            + self.components * size_of::<TraceHead>()
            + component * self.traced * size_of::<TraceSlot>()
    }
}

/// The control block of a run, mapped into this process.
#[derive(Debug)]
pub struct Region {
    memory: MmapRaw,
    counts: Counts,
}

/// Returns a digest of the layouts of all parts of a control block. Programs with equal digests can share a
/// control block.
pub fn layout_digest() -> String {
    let mut digest = crate::state::Digest::default();
    digest.write_u64(MAGIC);
    for size in [
        size_of::<Header>(),
        core::mem::offset_of!(Header, start_ns),
        core::mem::offset_of!(Header, episode),
        core::mem::offset_of!(Header, turn),
        size_of::<EventLog>(),
        size_of::<ComponentBlock>(),
        core::mem::offset_of!(ComponentBlock, lateness),
        core::mem::offset_of!(ComponentBlock, gate),
        core::mem::offset_of!(ComponentBlock, checkpoint),
        size_of::<TopicBlock>(),
        size_of::<EdgeBlock>(),
        size_of::<LatencyBlock>(),
        size_of::<TraceHead>(),
        size_of::<TraceSlot>(),
        size_of::<crate::state::Stamp>(),
    ] {
        digest.write_u64(size as u64);
    }
    format!("{:016x}", digest.finish())
}

impl Region {
    /// Returns the size of the control block for a plan, bytes.
    pub fn bytes(plan: &Plan) -> usize {
        Counts::from_plan(plan).bytes()
    }

    /// Returns `true` if the control block has as many blocks of each type as the plan requires. Returns
    /// `false` if the control block is damaged.
    pub fn fits(&self, plan: &Plan) -> bool {
        self.counts == Counts::from_plan(plan)
    }

    /// Creates the control block for a run of a plan.
    ///
    /// # Errors
    /// The file cannot be created: it already exists, or space or permission is missing.
    pub fn create(path: &Path, plan: &Plan) -> Result<Self, RegionError> {
        let counts = Counts::from_plan(plan);
        let io = |source| RegionError::Io { path: path.to_path_buf(), source };
        let file =
            OpenOptions::new().read(true).write(true).create_new(true).mode(0o600).open(path).map_err(io)?;
        let size = counts.bytes();
        // Reserve the memory now: a sparse file on a full file system would kill a writer with SIGBUS later.
        rustix::fs::fallocate(&file, rustix::fs::FallocateFlags::empty(), 0, size as u64)
            .map_err(|error| io(error.into()))?;
        let memory = MmapOptions::new().len(size).map_raw(&file).map_err(io)?;
        let region = Self { memory, counts };
        let header = region.header();
        header.components.store(counts.components as u32, Relaxed);
        header.topics.store(counts.topics as u32, Relaxed);
        header.latencies.store(counts.latencies as u32, Relaxed);
        header.edges.store(counts.edges as u32, Relaxed);
        header.traced.store(counts.traced as u32, Relaxed);
        region.events().open(crate::os::monotonic_ns());
        header.magic.store(MAGIC, Release);
        Ok(region)
    }

    /// Opens the control block of a run.
    ///
    /// # Errors
    /// The file cannot be opened, or is not a control block of this version of motorium.
    pub fn open(path: &Path) -> Result<Self, RegionError> {
        let io = |source| RegionError::Io { path: path.to_path_buf(), source };
        let wrong = |found: String| RegionError::NotARegion { path: path.to_path_buf(), found };
        let file = OpenOptions::new().read(true).write(true).open(path).map_err(io)?;
        let size = file.metadata().map_err(io)?.len() as usize;
        if size < Counts::COMPONENTS_AT {
            return Err(wrong(format!("{size} bytes")));
        }
        let memory = MmapOptions::new().len(size).map_raw(&file).map_err(io)?;
        let mut region = Self { memory, counts: Counts::default() };
        let header = region.header();
        let magic = header.magic.load(Acquire);
        if magic != MAGIC {
            return Err(wrong(format!("the version mark is {magic:016x}")));
        }
        let load = |count: &std::sync::atomic::AtomicU32| count.load(Relaxed) as usize;
        let counts = Counts {
            components: load(&header.components),
            topics: load(&header.topics),
            latencies: load(&header.latencies),
            edges: load(&header.edges),
            traced: load(&header.traced),
        };
        if counts.traced > MOST_EVENTS || (counts.traced > 0 && !counts.traced.is_power_of_two()) {
            return Err(wrong(format!(
                "the trace has {} events, expected a power of two up to {MOST_EVENTS}",
                counts.traced
            )));
        }
        let expected = counts.bytes();
        if size < expected {
            return Err(wrong(format!("the file has {size} bytes, but its blocks need {expected}")));
        }
        region.counts = counts;
        Ok(region)
    }

    /// Returns the header of the control block.
    #[inline]
    pub fn header(&self) -> &Header {
        // SAFETY: the mapping is page-aligned and at least a header long (checked on creation and opening); a
        // header consists of atomics, valid for any bytes and shareable between processes.
        unsafe { &*self.memory.as_ptr().cast::<Header>() }
    }

    /// Returns the event log of the run.
    pub fn events(&self) -> &EventLog {
        &self.blocks(size_of::<Header>(), 1)[0]
    }

    /// Returns the block of each component, in the order of the plan.
    #[inline]
    pub fn components(&self) -> &[ComponentBlock] {
        self.blocks(Counts::COMPONENTS_AT, self.counts.components)
    }

    /// Returns the block of each topic, in the order of the plan.
    #[inline]
    pub fn topics(&self) -> &[TopicBlock] {
        self.blocks(self.counts.topics_at(), self.counts.topics)
    }

    /// Returns the block of each latency budget, in the order of the plan.
    pub fn latencies(&self) -> &[LatencyBlock] {
        self.blocks(self.counts.latencies_at(), self.counts.latencies)
    }

    /// Returns the block of each edge, in the order of [`Plan::edges`].
    #[inline]
    pub fn edges(&self) -> &[EdgeBlock] {
        self.blocks(self.counts.edges_at(), self.counts.edges)
    }

    /// Returns the ring of a component's trace, or `None` if the run is not traced.
    #[inline]
    pub(super) fn trace(&self, component: usize) -> Option<TraceRing<'_>> {
        if self.counts.traced == 0 || component >= self.counts.components {
            return None;
        }
        let head = &self.blocks(self.counts.trace_at(), self.counts.components)[component];
        let slots = self.blocks(self.counts.slots_at(component), self.counts.traced);
        Some(TraceRing { head, slots })
    }

    #[inline]
    fn blocks<T>(&self, offset: usize, count: usize) -> &[T] {
        debug_assert!(offset + count * size_of::<T>() <= self.memory.len());
        // SAFETY: in bounds (the size was checked against the counts), aligned (the header and all blocks
        // have sizes and alignments in multiples of 64 bytes), and consisting of atomics, which are valid for
        // any bytes and shareable.
        unsafe { core::slice::from_raw_parts(self.memory.as_ptr().add(offset).cast::<T>(), count) }
    }
}
