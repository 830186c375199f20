//! Buses behind an slcan adapter on a serial line, in user space.
//!
//! An adapter such as a CANable with slcan firmware appears as a serial line (`/dev/ttyACM0`) that carries
//! frames as lines of text. [`write()`] and [`Reader`] are the codec. A [`SlcanBus`] is a bus over such a
//! line; it needs neither a driver nor network privileges.

mod attach;
mod codec;

use std::fs::File;
use std::io::{self, Read as _, Write as _};
use std::os::fd::{AsFd, BorrowedFd};
use std::time::{Duration, Instant};

use super::bits::Rates;
use super::report::Report;
use super::socket::{Condition, OpenError, SocketCounts};
use super::terminal::{self, Terminal};
use super::time::monotonic_ns;
use super::{Bus, Received};
use crate::frame::{Frame, Id};
pub use attach::Attached;
pub use codec::{LONGEST, Line, Reader, Request, write, write_report};

/// Bus behind an adapter on a serial line.
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
    rates: Rates,
    is_fd: bool,
    line: Terminal,
    reader: Reader,
    text: Vec<u8>,
    counters: [u8; 2],
}

/// Number of frames whose text is written to the line in one call.
const BATCH: usize = 32;
/// Time to wait for an adapter to refuse an unknown command.
const SETTLE: Duration = Duration::from_millis(50);

/// Returns the command that sets a bitrate; `None` for an unsupported bitrate.
fn bitrate(rate: u32) -> Option<String> {
    let digit = codec::BITRATES.iter().position(|known| *known == rate)?;
    Some(format!("S{digit}\r"))
}

/// Returns the command that sets the data bitrate.
fn data_bitrate(rate: u32) -> Option<String> {
    matches!(rate, 2_000_000 | 5_000_000).then(|| format!("Y{}\r", rate / 1_000_000))
}

/// Configures an adapter: closes its channel, sets the bitrates, opens the channel.
fn set_up(path: &str, rates: &Rates, is_fd: bool) -> Result<File, OpenError> {
    let refused = |error| OpenError::Refused(path.into(), error);
    let unknown = |rate: u32| OpenError::NoBitrate { name: path.into(), rate };
    let nominal = bitrate(rates.nominal).ok_or_else(|| unknown(rates.nominal))?;
    let fast = match is_fd {
        true => data_bitrate(rates.fast).ok_or_else(|| unknown(rates.fast))?,
        false => String::new(),
    };
    let mut file = terminal::open(path, libc::B1000000)?;
    // closing a closed channel may be refused
    file.write_all(b"\rC\r").map_err(refused)?;
    let _ = answers(&mut file, SETTLE, usize::MAX);
    let commands = format!("{nominal}{fast}O\r");
    file.write_all(commands.as_bytes()).map_err(refused)?;
    let count = commands.matches('\r').count();
    // many adapters never answer, so silence counts as acceptance
    if answers(&mut file, SETTLE, count).contains(&Line::Refused) {
        let error = io::Error::new(
            io::ErrorKind::InvalidInput,
            "the adapter refuses the bitrate, or refuses to open its channel",
        );
        return Err(refused(error));
    }
    Ok(file)
}

/// Returns the lines that arrive within this time, at most `count`.
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

/// Returns the version reported by an slcan adapter on a serial line; `None` if the adapter does not answer.
/// If the adapter sends frames but no version, the returned text is "it reports no version".
///
/// # Errors
/// Returns an error if the line does not exist or cannot be opened.
pub fn adapter_version(path: &str) -> Result<Option<String>, OpenError> {
    let mut file = terminal::open(path, libc::B1000000)?;
    file.write_all(b"\rV\r").map_err(|error| OpenError::Refused(path.into(), error))?;
    let (until, mut text) = (Instant::now() + 2 * SETTLE, Vec::new());
    let mut bytes = [0; 64];
    while Instant::now() < until {
        match file.read(&mut bytes) {
            Ok(length @ 1..) => text.extend_from_slice(&bytes[..length]),
            _ => std::thread::sleep(Duration::from_millis(1)),
        }
    }
    // Frames from a busy bus also identify an adapter.
    let lines = || text.split(|byte| matches!(byte, b'\r' | b'\n' | 0x07));
    let is_frame = |line: &&[u8]| {
        let mut reader = Reader::default();
        let mut read = line.iter().chain(b"\r").filter_map(|byte| reader.push(*byte));
        matches!(read.next(), Some(Line::Frame(_)))
    };
    let is_plain = |line: &&[u8]| line.len() > 2 && line.iter().all(|byte| matches!(byte, 0x20..=0x7e));
    let version = lines().filter(is_plain).find(|line| !is_frame(line));
    let unknown = || lines().any(|line| is_frame(&line)).then(|| "it reports no version".to_string());
    Ok(version.map(|line| String::from_utf8_lossy(line).into_owned()).or_else(unknown))
}

impl SlcanBus {
    /// Opens the adapter on a serial line for a bus with these bitrates.
    ///
    /// # Errors
    /// Returns an error if the line does not exist or cannot be opened, or if the adapter does not support
    /// the bitrate.
    pub fn open(path: &str, rates: Rates, is_fd: bool) -> Result<Self, OpenError> {
        Ok(Self {
            rates,
            is_fd,
            line: Terminal::new(path, set_up(path, &rates, is_fd)?, LONGEST),
            reader: Reader::default(),
            text: Vec::with_capacity(BATCH * LONGEST),
            counters: [0; 2],
        })
    }

    /// Returns the path of the line.
    pub fn name(&self) -> &str {
        self.line.path()
    }

    /// Returns the condition of the bus, derived from the adapter's reports (if any) and its presence.
    pub fn condition(&self) -> Condition {
        self.line.condition
    }

    /// Returns the transmit and receive error counters of the latest report.
    pub fn counters(&self) -> [u8; 2] {
        self.counters
    }

    /// Returns the counters of the bus.
    pub fn counts(&self) -> &SocketCounts {
        &self.line.counts
    }

    /// Returns `true` for a pseudo-terminal, which has a program instead of a wire behind it.
    pub fn is_virtual(&self) -> bool {
        self.line.is_virtual()
    }

    /// Restricts reception to frames with these identifiers.
    pub fn receive_only(&mut self, ids: &[Id]) {
        self.line.receive_only(ids);
    }

    fn take(&mut self, report: &Report) {
        let Terminal { counts, condition, .. } = &mut self.line;
        counts.take(report, *condition);
        self.counters = report.counters.unwrap_or(self.counters);
        *condition = report.state.map_or(*condition, Condition::from);
    }
}

impl Drop for SlcanBus {
    /// Closes the channel: otherwise the adapter would acknowledge and buffer frames for a program that has
    /// ended.
    fn drop(&mut self) {
        if self.line.condition != Condition::Gone && self.line.flush() {
            self.line.write(b"C\r");
        }
    }
}

impl AsFd for SlcanBus {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.line.as_fd()
    }
}

impl Bus for SlcanBus {
    fn send(&mut self, frames: &[Frame]) -> usize {
        let Self { rates, is_fd, line, reader, text, .. } = self;
        if line.look_again(|path| set_up(path, rates, *is_fd)) {
            *reader = Reader::default();
        }
        if !line.condition.can_send() || !line.flush() {
            return 0;
        }
        let mut sent = 0;
        for batch in frames.chunks(BATCH) {
            text.clear();
            let mut one = [0; LONGEST];
            for frame in batch {
                let length = write(frame, &mut one);
                text.extend_from_slice(&one[..length]);
            }
            let written = line.write(text);
            // a partly written line is completed before the next one
            let whole = text[..written].iter().filter(|byte| **byte == b'\r').count();
            let is_begun = written > 0 && text[written - 1] != b'\r';
            sent += whole + usize::from(is_begun);
            if is_begun {
                let end = text[written..].iter().position(|byte| *byte == b'\r').map_or(0, |end| end + 1);
                line.push(&text[written..written + end]);
            }
            if written < text.len() {
                // if nothing was written, the frame is already counted
                line.counts.queue_full += u64::from(written > 0);
                return sent;
            }
        }
        sent
    }

    fn receive(&mut self, frames: &mut [Received]) -> usize {
        if self.line.condition == Condition::Gone {
            return 0;
        }
        let (mut count, time_ns) = (0, monotonic_ns());
        while count < frames.len() {
            let Some(byte) = self.line.next_byte() else { break };
            match self.reader.push(byte) {
                Some(Line::Frame(frame)) if self.line.wants(frame.id) => {
                    frames[count] = Received { frame, time_ns };
                    count += 1;
                }
                Some(Line::Report(report)) => self.take(&report),
                Some(Line::Other) => self.line.counts.other += 1,
                // the adapter had no room for a frame
                Some(Line::Refused) => self.line.counts.queue_full += 1,
                Some(Line::Frame(_) | Line::Done) | None => {}
            }
        }
        count
    }
}
