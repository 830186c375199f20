//! Frames as text on a serial line: the protocol of Lawicel adapters, with CANable's extensions for CAN FD
//! and Linux's extensions for error states.

use crate::bus::report::{ErrorState, Report};
use crate::frame::{Form, Frame, Id};

/// Length of the longest line, bytes: a CAN FD frame with a 29-bit identifier, 64 data bytes and a timestamp.
pub const LONGEST: usize = 1 + 8 + 1 + 2 * 64 + 4 + 1;

/// Line from an adapter.
///
/// ```
/// use motorium_can::{Frame, Id};
/// use motorium_can::bus::slcan::{Line, Reader};
///
/// let mut reader = Reader::default();
/// let lines: Vec<Line> = b"t1412A0FF\r\x07".iter().filter_map(|byte| reader.push(*byte)).collect();
/// let frame = Frame::classic(Id::Standard(0x141), &[0xa0, 0xff]);
/// assert_eq!(lines, [Line::Frame(frame), Line::Refused]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line {
    /// Received data frame.
    Frame(Frame),
    /// Status report of the controller.
    Report(Report),
    /// A command was accepted, or a frame was sent.
    Done,
    /// A command was refused.
    Refused,
    /// A remote request, an answer to an unsupported query, or an invalid line.
    Other,
}

/// Encodes a frame as a line. Returns the number of bytes written to `line`.
pub fn write(frame: &Frame, line: &mut [u8; LONGEST]) -> usize {
    let (digits, id) = match frame.id {
        Id::Standard(id) => (3, u32::from(id)),
        Id::Extended(id) => (8, id),
    };
    let kind = match (frame.form, digits) {
        (Form::Classic | Form::Packet, 3) => b't',
        (Form::Classic | Form::Packet, _) => b'T',
        (Form::Fd, 3) => b'd',
        (Form::Fd, _) => b'D',
        (Form::FdFast, 3) => b'b',
        (Form::FdFast, _) => b'B',
    };
    let data = frame.data();
    let mut length = 0;
    let mut put = |byte: u8| {
        line[length] = byte;
        length += 1;
    };
    put(kind);
    (0..digits).rev().for_each(|digit| put(hex(id >> (4 * digit))));
    put(hex(code_of(data.len())));
    for byte in data {
        put(hex(u32::from(*byte) >> 4));
        put(hex((*byte).into()));
    }
    put(b'\r');
    length
}

fn code_of(length: usize) -> u32 {
    Frame::LENGTHS.iter().position(|known| *known == length).unwrap_or(0) as u32
}

fn hex(number: u32) -> u8 {
    b"0123456789ABCDEF"[(number & 0xf) as usize]
}

/// Parses hexadecimal digits of either case.
fn number(digits: &[u8]) -> Option<u32> {
    digits.iter().try_fold(0_u32, |number, digit| Some(number << 4 | char::from(*digit).to_digit(16)?))
}

/// Reader of lines, byte by byte.
#[derive(Clone, Debug)]
pub struct Reader {
    line: [u8; LONGEST],
    length: usize,
    /// `true` if the line exceeds the maximum length and is dropped up to its end.
    is_too_long: bool,
}

impl Default for Reader {
    fn default() -> Self {
        Self { line: [0; LONGEST], length: 0, is_too_long: false }
    }
}

impl Reader {
    /// Appends a byte. Returns the line that the byte completes, if any.
    pub fn push(&mut self, byte: u8) -> Option<Line> {
        // a bell ends any line
        if byte == 0x07 {
            (self.length, self.is_too_long) = (0, false);
            return Some(Line::Refused);
        }
        self.end(byte).map(|line| line.map_or(Line::Other, read))
    }

    /// Appends a byte that the adapter has received. Returns the request that the byte completes, if any.
    pub fn push_request(&mut self, byte: u8) -> Option<Request> {
        self.end(byte).map(|line| line.map_or(Request::Other, request))
    }

    /// Appends a byte. Returns the line that it completes, with `Some(None)` for a line that is too long.
    fn end(&mut self, byte: u8) -> Option<Option<&[u8]>> {
        match byte {
            b'\r' => {
                let length = core::mem::take(&mut self.length);
                let is_too_long = core::mem::take(&mut self.is_too_long);
                Some((!is_too_long).then(|| &self.line[..length]))
            }
            b'\n' if self.length == 0 => None,
            _ if self.length == LONGEST => {
                self.is_too_long = true;
                None
            }
            _ => {
                self.line[self.length] = byte;
                self.length += 1;
                None
            }
        }
    }
}

/// Parses a line without its terminator.
fn read(line: &[u8]) -> Line {
    match line {
        [] | [b'z' | b'Z'] => Line::Done,
        [b't' | b'T' | b'd' | b'D' | b'b' | b'B', ..] => frame(line).map_or(Line::Other, Line::Frame),
        [b's', state, counters @ ..] => state_report(*state, counters).map_or(Line::Other, Line::Report),
        [b'e', causes @ ..] => error_report(causes).map_or(Line::Other, Line::Report),
        _ => Line::Other,
    }
}

fn frame(line: &[u8]) -> Option<Frame> {
    let (kind, rest) = line.split_first()?;
    let form = match kind {
        b't' | b'T' => Form::Classic,
        b'd' | b'D' => Form::Fd,
        _ => Form::FdFast,
    };
    let digits = if kind.is_ascii_lowercase() { 3 } else { 8 };
    let (id, rest) = rest.split_at_checked(digits)?;
    let id = number(id)?;
    let id = if digits == 3 { Id::standard(id.try_into().ok()?)? } else { Id::extended(id)? };
    let (code, rest) = rest.split_first()?;
    let length = Frame::LENGTHS[number(&[*code])? as usize];
    let (bytes, time) = rest.split_at_checked(2 * length)?;
    // an adapter with timestamps appends the milliseconds of the current minute
    if !(time.is_empty() || time.len() == 4 && number(time).is_some()) {
        return None;
    }
    let mut data = [0; 64];
    for (place, digits) in data.iter_mut().zip(bytes.chunks_exact(2)) {
        *place = number(digits)? as u8;
    }
    Frame::new(id, form, &data[..length])
}

/// Line from the computer, as received by an adapter.
///
/// ```
/// use motorium_can::bus::slcan::{Reader, Request};
///
/// let mut reader = Reader::default();
/// let requests: Vec<Request> = b"C\rS8\rO\r".iter().filter_map(|byte| reader.push_request(*byte)).collect();
/// assert_eq!(requests, [Request::Close, Request::Bitrate(1_000_000), Request::Open]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Send a frame.
    Frame(Frame),
    /// Open the channel.
    Open,
    /// Close the channel.
    Close,
    /// Set this bitrate.
    Bitrate(u32),
    /// Set this bitrate for the data of CAN FD frames.
    DataBitrate(u32),
    /// Report the version.
    Version,
    /// Empty line, which terminates an incomplete one.
    Nothing,
    /// Remote request, or an invalid line.
    Other,
}

/// Bitrates of the protocol, indexed by their digit.
pub(super) const BITRATES: [u32; 9] =
    [10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];

/// Parses a line from the computer without its terminator.
fn request(line: &[u8]) -> Request {
    match line {
        [] => Request::Nothing,
        b"O" => Request::Open,
        b"C" => Request::Close,
        b"V" => Request::Version,
        [b'S', digit] => {
            let rate = digit.checked_sub(b'0').and_then(|digit| BITRATES.get(usize::from(digit)));
            rate.map_or(Request::Other, |rate| Request::Bitrate(*rate))
        }
        [b'Y', digit @ (b'2' | b'5')] => Request::DataBitrate(u32::from(digit - b'0') * 1_000_000),
        [b't' | b'T' | b'd' | b'D' | b'b' | b'B', ..] => frame(line).map_or(Request::Other, Request::Frame),
        _ => Request::Other,
    }
}

/// Encodes a report of the adapter as lines. Returns the number of bytes written to `line`.
pub fn write_report(report: &Report, line: &mut [u8; LONGEST]) -> usize {
    let mut length = 0;
    let mut put = |bytes: &[u8]| {
        line[length..length + bytes.len()].copy_from_slice(bytes);
        length += bytes.len();
    };
    let causes = [
        (report.is_unacknowledged, b"e1a\r"),
        (report.is_disturbed, b"e1b\r"),
        (report.is_overflow, b"e1o\r"),
    ];
    causes.iter().filter(|(is, _)| *is).for_each(|(_, cause)| put(*cause));
    if let Some(state) = report.state {
        // without error counters, the lowest count of the state is used
        let (letter, fewest) = match state {
            ErrorState::Active => (b'a', 0),
            ErrorState::Warning => (b'w', 96),
            ErrorState::Passive => (b'p', 128),
            ErrorState::Off => (b'b', 255),
        };
        let [sender, receiver] = report.counters.unwrap_or([fewest, 0]);
        let digits = |number: u8| [b'0' + number / 100, b'0' + number / 10 % 10, b'0' + number % 10];
        put(&[b's', letter]);
        put(&digits(receiver));
        put(&digits(sender));
        put(b"\r");
    }
    length
}

/// Parses `saRRRTTT`: state, receive error counter and transmit error counter, in decimal digits.
fn state_report(state: u8, counters: &[u8]) -> Option<Report> {
    let state = match state {
        b'a' => ErrorState::Active,
        b'w' => ErrorState::Warning,
        b'p' => ErrorState::Passive,
        b'b' => ErrorState::Off,
        _ => return None,
    };
    let decimal = |digits: &[u8]| {
        digits.iter().try_fold(0_u32, |number, digit| {
            digit.is_ascii_digit().then(|| number * 10 + u32::from(digit - b'0'))
        })
    };
    let (receiver, sender) = counters.split_at_checked(3).filter(|(_, sender)| sender.len() == 3)?;
    let counters = [sender, receiver].map(|digits| decimal(digits).map(|number| number.min(255) as u8));
    Some(Report { state: Some(state), counters: Some([counters[0]?, counters[1]?]), ..Report::default() })
}

/// Parses `e1a`: number of causes, and one letter per cause.
fn error_report(causes: &[u8]) -> Option<Report> {
    let (count, causes) = causes.split_first()?;
    if usize::from(count.checked_sub(b'0')?) != causes.len() || causes.is_empty() {
        return None;
    }
    let mut report = Report::default();
    for cause in causes {
        match cause {
            b'a' => report.is_unacknowledged = true,
            b'o' | b'O' => report.is_overflow = true,
            // bit, CRC, form or stuff error
            b'b' | b'B' | b'c' | b'f' | b's' => report.is_disturbed = true,
            _ => return None,
        }
    }
    Some(report)
}
