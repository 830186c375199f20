//! The two ends of a component's trace: the writer in the component's worker, and the readers in tools.

use std::cell::Cell;
use std::rc::Rc;
use std::sync::atomic::Ordering::{Acquire, Relaxed};

use super::Region;
use super::trace::TraceEvent;

/// The writing side of a component's ring.
#[derive(Debug)]
pub(crate) struct TraceWriter {
    region: Rc<Region>,
    component: usize,
    written: Cell<u64>,
}

impl TraceWriter {
    /// Opens the trace writer of a component, which continues after the previous writer. Returns `None` if
    /// the run is not traced.
    pub(crate) fn open(region: &Rc<Region>, component: usize) -> Option<Self> {
        let ring = region.trace(component)?;
        // A write that changes nothing maps the pages before the first step.
        ring.slots.iter().for_each(|slot| {
            slot.0[0].fetch_or(0, Relaxed);
        });
        let written = Cell::new(ring.head.written.load(Acquire));
        Some(Self { region: region.clone(), component, written })
    }

    /// Writes an event.
    #[inline]
    pub(crate) fn write(&self, event: TraceEvent) {
        let number = self.written.get();
        self.written.set(number.wrapping_add(1));
        if let Some(ring) = self.region.trace(self.component) {
            ring.write(number, event);
        }
    }
}

/// A reader of one component's trace that remembers its position.
///
/// ```no_run
/// use motorium::region::{Region, TraceReader};
///
/// let region = Region::open("/dev/shm/motorium-0/arm-0a1b2c3d/region".as_ref())?;
/// let mut reader = TraceReader::new(0);
/// for event in reader.read(&region) {
///     println!("{event:?}");
/// }
/// println!("{} were overwritten before they were read", reader.lost());
/// # Ok::<(), motorium::region::RegionError>(())
/// ```
#[derive(Debug, Clone)]
pub struct TraceReader {
    component: usize,
    /// Events read or lost so far.
    read: u64,
    lost: u64,
}

impl TraceReader {
    /// Creates a reader for the component with index `component` in the plan. The reader starts with the
    /// oldest event in the trace.
    pub fn new(component: usize) -> Self {
        Self { component, read: 0, lost: 0 }
    }

    /// Returns the events since the last call, oldest first. Empty if the run is not traced.
    pub fn read(&mut self, region: &Region) -> Vec<TraceEvent> {
        let Some(ring) = region.trace(self.component) else { return Vec::new() };
        let written = ring.head.written.load(Acquire);
        // Numbers only increase, except in a damaged ring.
        self.read = self.read.min(written);
        // The event being written replaces the oldest one.
        let oldest = written.saturating_sub(ring.slots.len() as u64 - 1);
        self.lost += oldest.saturating_sub(self.read);
        self.read = self.read.max(oldest);
        let numbers = self.read..written;
        self.read = written;
        let events: Vec<_> = numbers.clone().filter_map(|n| TraceEvent::decode(ring.read(n)?)).collect();
        self.lost += (numbers.end - numbers.start) - events.len() as u64;
        events
    }

    /// Returns the number of events that were overwritten before this reader read them.
    pub fn lost(&self) -> u64 {
        self.lost
    }
}
