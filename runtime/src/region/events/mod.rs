//! The event log of a run in its control block, with a ring of fixed size for each severity and one for
//! printed lines.
//!
//! The launcher writes the log. If the launcher has ended, the guard does. Workers do not write to the log:
//! they count misses and refusals, which the launcher reports as events. Separate rings prevent printed lines
//! from displacing events, and warnings from displacing failures.

mod kind;
mod ring;

use std::sync::atomic::AtomicU64;
use std::sync::atomic::Ordering::Relaxed;

pub use kind::{EventKind, EventSeverity};
#[cfg(test)]
pub(crate) use ring::Found as RingFound;
use ring::Found;
pub(crate) use ring::Ring;

use crate::atomics::Native;

/// The severity of the events in each ring. The last ring is for printed lines.
const RINGS: [EventSeverity; 4] =
    [EventSeverity::Information, EventSeverity::Warning, EventSeverity::Error, EventSeverity::Information];
/// Number of records per ring.
const RECORDS: usize = 128;
/// Words of a record, chosen for a slot of 512 bytes.
const WORDS: usize = 63;
/// Words of a record before its text.
const HEAD: usize = 6;
/// Maximum length of the text of an event, bytes.
pub const EVENT_TEXT_BYTES: usize = (WORDS - HEAD) * 8;
/// Marks a missing simulated time.
const NONE: u64 = u64::MAX;

/// The event log in the control block of a run.
#[derive(Debug)]
#[repr(C, align(64))]
pub struct EventLog {
    /// Time at which the log was opened, `CLOCK_MONOTONIC` ns.
    opened_ns: AtomicU64,
    rings: [Ring<Native, RECORDS, WORDS>; RINGS.len()],
}

/// One event in the log.
#[derive(Debug, Clone, PartialEq)]
pub struct EventRecord {
    /// Time at which the event occurred or was detected, `CLOCK_MONOTONIC` ns.
    pub time_ns: u64,
    /// Index of the episode in which the event occurred.
    pub episode: u64,
    /// Simulated time in the episode, ns; `None` in real time.
    pub simulated_ns: Option<u64>,
    /// Severity of the event.
    pub severity: EventSeverity,
    /// Kind of the event.
    pub kind: EventKind,
    /// Index in the plan of the affected component; `None` if the event concerns the whole run.
    pub component: Option<usize>,
    /// Value of the event, as defined by its kind; 0 for kinds without a value.
    pub value: f64,
    /// Text for users, truncated to [`EVENT_TEXT_BYTES`].
    pub text: String,
}

impl EventLog {
    /// Opens the log of a new run.
    pub(super) fn open(&self, now_ns: u64) {
        self.opened_ns.store(now_ns, Relaxed);
    }

    /// Returns the time at which the log was opened, `CLOCK_MONOTONIC` ns.
    pub fn opened_ns(&self) -> u64 {
        self.opened_ns.load(Relaxed)
    }

    /// Writes an event over the oldest one in the ring of its severity. Wait-free; does not allocate.
    pub fn write(&self, record: &EventRecord) {
        // A write only fails if the writers of the slot were killed, and then there is nobody to inform.
        let ring = if record.kind == EventKind::Output { RINGS.len() - 1 } else { record.severity as usize };
        let _ = self.rings[ring].write(&encode(record));
    }

    /// Returns the number of events written to the log so far.
    pub fn count(&self) -> u64 {
        self.rings.iter().map(Ring::newest).fold(0, u64::saturating_add)
    }

    /// Returns all events that are still in the log, oldest first, and the number of overwritten events.
    pub fn all(&self) -> (Vec<EventRecord>, u64) {
        let mut reader = EventReader::default();
        let mut records = reader.read(self);
        if reader.is_waiting() {
            // A record was being written: if it is not complete a moment later, it never will be.
            std::thread::sleep(core::time::Duration::from_millis(1));
            records.extend(reader.read(self));
            in_order(&mut records);
        }
        (records, reader.lost())
    }
}

fn in_order(records: &mut [EventRecord]) {
    records.sort_by_key(|record| record.time_ns);
}

/// A reader of an event log that remembers its position.
///
/// ```no_run
/// use motorium::region::{EventReader, Region};
///
/// let region = Region::open("/dev/shm/motorium-0/arm-0a1b2c3d/region".as_ref())?;
/// let mut reader = EventReader::default();
/// loop {
///     for event in reader.read(region.events()) {
///         println!("{} {}", event.kind.name(), event.text);
///     }
///     std::thread::sleep(std::time::Duration::from_millis(50));
/// }
/// # #[allow(unreachable_code)] Ok::<(), motorium::region::RegionError>(())
/// ```
#[derive(Debug, Clone, Default)]
pub struct EventReader {
    places: [Place; RINGS.len()],
    lost: u64,
}

/// Position of a reader in one ring.
#[derive(Debug, Clone, Copy, Default)]
struct Place {
    /// Number of the record read last.
    read: u64,
    /// Number of a record that was still being written at the last read.
    waits_for: u64,
}

impl EventReader {
    /// Returns the events since the last call, oldest first. The first call returns all events that are still
    /// in the log.
    pub fn read(&mut self, log: &EventLog) -> Vec<EventRecord> {
        let mut records = Vec::new();
        for ((place, ring), severity) in self.places.iter_mut().zip(&log.rings).zip(RINGS) {
            self.lost = self.lost.saturating_add(place.read_on(ring, severity, &mut records));
        }
        in_order(&mut records);
        records
    }

    /// Returns the number of events that were overwritten before this reader read them.
    pub fn lost(&self) -> u64 {
        self.lost
    }

    /// Returns `true` if the last call skipped an event that was being written.
    fn is_waiting(&self) -> bool {
        self.places.iter().any(|place| place.waits_for > place.read)
    }
}

impl Place {
    /// Reads the new records of a ring and returns the number of lost ones.
    fn read_on(
        &mut self,
        ring: &Ring<Native, RECORDS, WORDS>,
        severity: EventSeverity,
        records: &mut Vec<EventRecord>,
    ) -> u64 {
        let newest = ring.newest();
        // Numbers only increase, except in a damaged log.
        self.read = self.read.min(newest);
        let oldest = newest.saturating_sub(RECORDS as u64);
        let mut lost = oldest.saturating_sub(self.read);
        self.read = self.read.max(oldest);
        let mut words = [0; WORDS];
        while self.read < newest {
            let number = self.read + 1;
            match ring.read(number, &mut words) {
                Found::Record => match decode(&words, severity) {
                    Some(record) => records.push(record),
                    None => lost += 1,
                },
                Found::Pending if self.waits_for != number => {
                    self.waits_for = number;
                    break;
                }
                Found::Pending | Found::Overwritten => lost += 1,
            }
            self.read = number;
        }
        lost
    }
}

fn encode(record: &EventRecord) -> [u64; WORDS] {
    let mut words = [0; WORDS];
    let text = &record.text[..record.text.floor_char_boundary(EVENT_TEXT_BYTES)];
    let component = record.component.and_then(|index| u16::try_from(index + 1).ok()).unwrap_or(0);
    words[0] = record.time_ns;
    words[1] = record.episode;
    words[2] = record.simulated_ns.unwrap_or(NONE);
    words[3] = u64::from(record.kind as u32) << 32 | u64::from(component);
    words[4] = record.value.to_bits();
    words[5] = text.len() as u64;
    for (word, bytes) in words[HEAD..].iter_mut().zip(text.as_bytes().chunks(8)) {
        let mut whole = [0; 8];
        whole[..bytes.len()].copy_from_slice(bytes);
        *word = u64::from_le_bytes(whole);
    }
    words
}

/// Decodes an event. Returns `None` if the words are not an event of this version, because the log is
/// damaged.
fn decode(words: &[u64; WORDS], severity: EventSeverity) -> Option<EventRecord> {
    let value = f64::from_bits(words[4]);
    let length = usize::try_from(words[5]).ok().filter(|length| *length <= EVENT_TEXT_BYTES)?;
    let bytes: Vec<u8> = words[HEAD..].iter().flat_map(|word| word.to_le_bytes()).take(length).collect();
    Some(EventRecord {
        time_ns: words[0],
        episode: words[1],
        simulated_ns: Some(words[2]).filter(|ns| *ns != NONE),
        severity,
        kind: EventKind::from_number((words[3] >> 32) as u32)?,
        component: usize::from(words[3] as u16).checked_sub(1),
        value: if value.is_finite() { value } else { 0.0 },
        text: String::from_utf8_lossy(&bytes).into_owned(),
    })
}

#[cfg(test)]
mod tests;
