//! Buses behind an adapter on a serial line, in user space: slcan.
//!
//! An adapter such as a CANable with its slcan firmware is a serial line (`/dev/ttyACM0`), on which frames are lines of text.
//! [`write`] and [`Reader`] are the codec; a [`SlcanBus`] is a bus over such a line, which needs no driver and no rights over
//! network interfaces.

mod codec;

use std::fs::File;
use std::io::{self, Read as _, Write as _};
use std::os::fd::{AsFd, BorrowedFd};
use std::time::{Duration, Instant};

use crate::bus::time::monotonic_ns;

use super::bits::Rates;
use super::report::{ErrorState, Report};
use super::serial;
use super::socket::{Condition, OpenError, SocketCounts};
use super::{Bus, Received};
use crate::frame::{Frame, Id};
pub use codec::{LONGEST, Line, Reader, write};

/// A bus behind an adapter on a serial line.
///
/// ```no_run
/// use motorium_can::{Bus, Frame, Id, Rates, Received, SlcanBus};
///
/// let rates = Rates { nominal: 1_000_000, fast: 1_000_000 };
/// let mut bus = SlcanBus::open("/dev/ttyACM0", rates, false)?;
/// assert_eq!(bus.send(&[Frame::classic(Id::Standard(1), &[0xff; 8])]), 1);
/// let mut answers = [Received::default(); 8];
/// let count = bus.receive(&mut answers);
/// # Ok::<(), motorium_can::OpenError>(())
/// ```
#[derive(Debug)]
pub struct SlcanBus {
    path: String,
    rates: Rates,
    is_fd: bool,
    file: File,
    reader: Reader,
    text: Vec<u8>,
    /// The end of a line of which the beginning is written already.
    rest: Vec<u8>,
    bytes: Box<[u8; 1024]>,
    /// Bytes of `bytes` that are yet to be read, from where to where.
    unread: (usize, usize),
    filters: Vec<Id>,
    condition: Condition,
    counters: [u8; 2],
    counts: SocketCounts,
    reopen_ns: u64,
}

/// Frames of which the text goes to the line at once.
const BATCH: usize = 32;
/// Time after which an adapter that has gone is looked for again, ns.
const REOPEN_NS: u64 = 1_000_000_000;
/// Time within which an adapter refuses what it does not know.
const SETTLE: Duration = Duration::from_millis(50);

/// The command that sets a bitrate; `None` for one that the protocol does not know.
fn bitrate(rate: u32) -> Option<&'static str> {
    Some(match rate {
        10_000 => "S0\r",
        20_000 => "S1\r",
        50_000 => "S2\r",
        100_000 => "S3\r",
        125_000 => "S4\r",
        250_000 => "S5\r",
        500_000 => "S6\r",
        800_000 => "S7\r",
        1_000_000 => "S8\r",
        _ => return None,
    })
}

/// The command that sets the bitrate of the data.
fn data_bitrate(rate: u32) -> Option<&'static str> {
    match rate {
        2_000_000 => Some("Y2\r"),
        5_000_000 => Some("Y5\r"),
        _ => None,
    }
}

/// Sets an adapter up: closes its channel, sets the bitrates, opens it.
fn set_up(path: &str, rates: &Rates, is_fd: bool) -> Result<File, OpenError> {
    let refused = |error| OpenError::Refused(path.into(), error);
    let unknown = |rate: u32| OpenError::NoBitrate { name: path.into(), rate };
    let nominal = bitrate(rates.nominal).ok_or_else(|| unknown(rates.nominal))?;
    let fast = match is_fd {
        true => data_bitrate(rates.fast).ok_or_else(|| unknown(rates.fast))?,
        false => "",
    };
    let mut file = serial::open(path, libc::B1000000).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => OpenError::NoLine(path.into()),
        _ => refused(error),
    })?;
    // a channel that is closed already may refuse to be closed
    file.write_all(b"\rC\r").map_err(refused)?;
    let _ = answers(&mut file, SETTLE, usize::MAX);
    let commands = format!("{nominal}{fast}O\r");
    file.write_all(commands.as_bytes()).map_err(refused)?;
    let count = commands.matches('\r').count();
    // many adapters answer nothing at all, and are believed
    if answers(&mut file, SETTLE, count).contains(&Line::Refused) {
        let error =
            io::Error::new(io::ErrorKind::InvalidInput, "the adapter refuses its bitrate, or to open");
        return Err(refused(error));
    }
    Ok(file)
}

/// The lines that come within this time, until there are so many.
fn answers(file: &mut File, within: Duration, count: usize) -> Vec<Line> {
    let (until, mut reader, mut lines) = (Instant::now() + within, Reader::default(), Vec::new());
    let mut bytes = [0; 64];
    while Instant::now() < until && lines.len() < count {
        match file.read(&mut bytes) {
            Ok(length) if length > 0 => {
                lines.extend(bytes[..length].iter().filter_map(|byte| reader.push(*byte)));
            }
            _ => std::thread::sleep(Duration::from_millis(1)),
        }
    }
    lines
}

impl SlcanBus {
    /// Opens the adapter on a serial line for a bus of these rates.
    ///
    /// # Errors
    /// There is no such line, it cannot be opened, or the adapter does not know the bitrate.
    pub fn open(path: &str, rates: Rates, is_fd: bool) -> Result<Self, OpenError> {
        Ok(Self {
            path: path.into(),
            rates,
            is_fd,
            file: set_up(path, &rates, is_fd)?,
            reader: Reader::default(),
            text: Vec::with_capacity(BATCH * LONGEST),
            rest: Vec::with_capacity(LONGEST),
            bytes: Box::new([0; 1024]),
            unread: (0, 0),
            filters: Vec::new(),
            condition: Condition::Active,
            counters: [0; 2],
            counts: SocketCounts::default(),
            reopen_ns: 0,
        })
    }

    /// Its line.
    pub fn name(&self) -> &str {
        &self.path
    }

    /// Its condition: as the adapter reports, where it does, and whether it is there.
    pub fn condition(&self) -> Condition {
        self.condition
    }

    /// Errors that its controller has counted as sender and as receiver, as it reported last.
    pub fn counters(&self) -> [u8; 2] {
        self.counters
    }

    /// Its counts.
    pub fn counts(&self) -> &SocketCounts {
        &self.counts
    }

    /// True for a pseudo-terminal, behind which there is a program and no wire.
    pub fn is_virtual(&self) -> bool {
        std::fs::canonicalize(&self.path).is_ok_and(|path| path.starts_with("/dev/pts"))
    }

    /// Receives frames with these identifiers only.
    pub fn receive_only(&mut self, ids: &[Id]) {
        self.filters = ids.to_vec();
    }

    fn take(&mut self, report: &Report) {
        self.counts.reports += 1;
        self.counts.unacknowledged += u64::from(report.is_unacknowledged);
        self.counts.disturbed += u64::from(report.is_disturbed);
        self.counts.overflows += u64::from(report.is_overflow);
        self.counters = report.counters.unwrap_or(self.counters);
        if let Some(state) = report.state {
            let is_new = state == ErrorState::Off && self.condition != Condition::Off;
            self.counts.bus_off += u64::from(is_new);
            self.condition = state.into();
        }
    }

    /// Notes that the adapter has gone.
    fn lose(&mut self) {
        if self.condition != Condition::Gone {
            self.counts.down += 1;
            self.condition = Condition::Gone;
            self.reopen_ns = monotonic_ns() + REOPEN_NS;
        }
    }

    /// Looks for an adapter that has gone, once a second.
    fn look_again(&mut self) {
        let now_ns = monotonic_ns();
        if now_ns < self.reopen_ns {
            return;
        }
        self.reopen_ns = now_ns + REOPEN_NS;
        if let Ok(file) = set_up(&self.path, &self.rates, self.is_fd) {
            (self.file, self.condition, self.reader) = (file, Condition::Active, Reader::default());
            self.rest.clear();
            self.unread = (0, 0);
        }
    }

    /// Writes what is left of a line; false if some of it is still left.
    fn finish_line(&mut self) -> bool {
        while !self.rest.is_empty() {
            match self.file.write(&self.rest) {
                Ok(0) => return false,
                Ok(count) => drop(self.rest.drain(..count)),
                Err(error) => {
                    self.fail(&error);
                    return false;
                }
            }
        }
        true
    }

    fn fail(&mut self, error: &io::Error) {
        match error.kind() {
            io::ErrorKind::WouldBlock => self.counts.queue_full += 1,
            io::ErrorKind::Interrupted => {}
            _ => self.lose(),
        }
    }

    /// The next byte, if one is there.
    fn next_byte(&mut self) -> Option<u8> {
        if self.unread.0 == self.unread.1 {
            match self.file.read(&mut self.bytes[..]) {
                // a line that has hung up
                Ok(0) => {
                    self.lose();
                    return None;
                }
                Ok(count) => self.unread = (0, count),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return None,
                Err(error) => {
                    self.fail(&error);
                    return None;
                }
            }
        }
        self.unread.0 += 1;
        self.bytes.get(self.unread.0 - 1).copied()
    }
}

impl AsFd for SlcanBus {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.file.as_fd()
    }
}

impl Bus for SlcanBus {
    fn send(&mut self, frames: &[Frame]) -> usize {
        if self.condition == Condition::Gone {
            self.look_again();
        }
        if !self.condition.can_send() || !self.finish_line() {
            return 0;
        }
        let mut sent = 0;
        for batch in frames.chunks(BATCH) {
            self.text.clear();
            let mut line = [0; LONGEST];
            for frame in batch {
                let length = write(frame, &mut line);
                self.text.extend_from_slice(&line[..length]);
            }
            let written = match self.file.write(&self.text) {
                Ok(written) => written,
                Err(error) => {
                    self.fail(&error);
                    return sent;
                }
            };
            // a line that is begun is finished before the next one
            let whole = self.text[..written].iter().filter(|byte| **byte == b'\r').count();
            let is_begun = written > 0 && self.text[written - 1] != b'\r';
            sent += whole + usize::from(is_begun);
            if is_begun {
                let end =
                    self.text[written..].iter().position(|byte| *byte == b'\r').map_or(0, |end| end + 1);
                self.rest.extend_from_slice(&self.text[written..written + end]);
            }
            if written < self.text.len() {
                self.counts.queue_full += 1;
                return sent;
            }
        }
        sent
    }

    fn receive(&mut self, frames: &mut [Received]) -> usize {
        if self.condition == Condition::Gone {
            return 0;
        }
        let (mut count, time_ns) = (0, monotonic_ns());
        while count < frames.len() {
            let Some(byte) = self.next_byte() else { break };
            match self.reader.push(byte) {
                Some(Line::Frame(frame)) if self.filters.is_empty() || self.filters.contains(&frame.id) => {
                    frames[count] = Received { frame, time_ns };
                    count += 1;
                }
                Some(Line::Report(report)) => self.take(&report),
                Some(Line::Other) => self.counts.other += 1,
                // a frame that the adapter had no room for
                Some(Line::Refused) => self.counts.queue_full += 1,
                Some(Line::Frame(_) | Line::Done) | None => {}
            }
        }
        count
    }
}
