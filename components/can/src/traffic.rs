//! Bus traffic as text: lines in the format of `candump -L`.

mod foreign;
mod listener;

use core::fmt;
use core::str::FromStr;
use std::time::{SystemTime, UNIX_EPOCH};

use socketcan::dump::{CanDumpRecord, Reader};
use socketcan::{CanAnyFrame, EmbeddedFrame as _, Frame as _};

use crate::bus::time::monotonic_ns;
use crate::{Form, Frame, Id, Received, Report};
pub use listener::{Listener, Sender};

/// One line of bus traffic: time, interface and frame.
///
/// ```
/// use motorium_can::{Id, Record};
///
/// let line = "(1735270496.916858) can0 11F##5AABB";
/// let record: Record = line.parse()?;
/// assert_eq!((record.interface(), record.time_us()), ("can0", 1_735_270_496_916_858));
/// assert_eq!(record.frame().map(|frame| frame.id), Some(Id::Standard(0x11f)));
/// assert_eq!(record.to_string(), line);
///
/// let report: Record = "(0.000000) can0 20000040#0000000000000000".parse()?;
/// assert_eq!(report.error().as_deref(), Some("bus off"));
/// # Ok::<(), motorium_can::RecordError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Record(CanDumpRecord);

/// Error returned when a line of bus traffic cannot be parsed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{} is not a frame: {message}", excerpt(found))]
pub struct RecordError {
    /// Line that failed to parse.
    pub found: String,
    /// Column of the error, counted from 1.
    pub column: usize,
    /// Reason.
    pub message: String,
}

/// Returns the beginning of a line in quotes, for a message.
fn excerpt(line: &str) -> String {
    // longer than every line with a valid frame of CAN FD
    const LONGEST: usize = 200;
    match line.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{:?}...", &line[..end]),
        None => format!("{line:?}"),
    }
}

impl RecordError {
    /// Advice on the correct format.
    pub const ADVICE: &'static str = "write `123#0102` (classic), `123##10102` (CAN FD, its data at the higher rate), `00000123#01` (29 bits), or `123#R`";
    /// Advice on the formats of logs.
    pub const LOG_ADVICE: &'static str = "a log has lines of `candump -L`, such as `(1735270496.916858) can0 123#0102`, of the screen output of `candump`, or of an ASC file";
}

impl FromStr for Record {
    type Err = RecordError;

    /// Parses a line of `candump -L`.
    fn from_str(line: &str) -> Result<Self, RecordError> {
        let refuse = |message: String| {
            let (column, message) = mistake_in_line(line).unwrap_or((1, message));
            RecordError { found: line.to_string(), column, message }
        };
        match Reader::from_reader(line.as_bytes()).next_record() {
            // the parser pads data of CAN FD to the next length
            Ok(Some(record)) => match line.contains("##").then(|| mistake_in_line(line)).flatten() {
                Some((column, message)) => Err(RecordError { found: line.to_string(), column, message }),
                None => Ok(Self(record)),
            },
            Ok(None) => Err(refuse("the line is empty".into())),
            Err(error) => Err(refuse(error.to_string())),
        }
    }
}

/// Identifies the mistake in a line of `candump -L`: its column, counted from 1, and the reason.
fn mistake_in_line(line: &str) -> Option<(usize, String)> {
    const FRAME: &str = "such as `123#0102`";
    let column = |part: &str| line[..part.as_ptr() as usize - line.as_ptr() as usize].chars().count() + 1;
    let end = line.trim_end().chars().count() + 1;
    let mut fields = line.split_whitespace();
    let time = fields.next()?;
    let inside = time.strip_prefix('(').and_then(|time| time.strip_suffix(')'));
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|digit| digit.is_ascii_digit());
    let parts = inside.and_then(|time| time.split_once('.'));
    if !parts.is_some_and(|(seconds, fraction)| is_number(seconds) && is_number(fraction)) {
        let expected = "expected a time in s such as `(1735270496.916858)`";
        return Some((column(time), format!("found `{time}`, {expected}")));
    }
    let Some(interface) = fields.next() else {
        let message = format!("the line ends after its time, expected interface and frame, {FRAME}");
        return Some((end, message.replace("`123", "`can0 123")));
    };
    let Some(frame) = fields.next() else {
        return Some((end, format!("the line ends after `{interface}`, expected a frame, {FRAME}")));
    };
    mistake(frame).map(|message| (column(frame), message))
}

/// Identifies a common mistake in the text of a frame.
fn mistake(frame: &str) -> Option<String> {
    let Some((id, data)) = frame.split_once('#') else {
        return Some("there is no `#` between identifier and data".into());
    };
    let no_digit = |text: &str| text.chars().find(|letter| !letter.is_ascii_hexdigit());
    if let Some(letter) = no_digit(id) {
        return Some(format!("`{letter}` in the identifier is not a hexadecimal digit"));
    }
    if !matches!(id.len(), 3 | 8) {
        return Some(format!("an identifier of {} digits, expected 3 (11 bits) or 8 (29 bits)", id.len()));
    }
    let largest = if id.len() == 3 { 0x7ff } else { 0x1fff_ffff };
    if u32::from_str_radix(id, 16).is_ok_and(|id| id > largest) {
        return Some(format!("the identifier 0x{id} is beyond 0x{largest:X}"));
    }
    let (bytes, most, form) = match data.strip_prefix('#') {
        Some(fd) => (fd.get(1..).unwrap_or_default(), 64, "of CAN FD (after the digit of its flags)"),
        None => (data, 8, "of classic CAN"),
    };
    if let Some(letter) = no_digit(bytes).filter(|letter| !matches!(letter, 'R' | 'r' | '.')) {
        return Some(format!("`{letter}` in the data is not a hexadecimal digit"));
    }
    // bytes may be separated by dots
    let digits = bytes.chars().filter(|letter| *letter != '.').count();
    if digits > 2 * most {
        let count = digits.div_ceil(2);
        return Some(format!("{count} bytes of data, but a frame {form} has at most {most}"));
    }
    if digits % 2 == 1 {
        return Some("the data end with half a byte".to_string());
    }
    let fits = most == 8 || Frame::LENGTHS.contains(&(digits / 2));
    (!fits).then(|| {
        format!(
            "{} bytes of data, expected 0 to 8, 12, 16, 20, 24, 32, 48 or 64 in a frame of CAN FD",
            digits / 2
        )
    })
}

impl Record {
    /// Parses a frame, such as `123#0102`, for an interface. Dots may separate the data bytes.
    ///
    /// # Errors
    /// Returns an error if the text is not a frame.
    pub fn of_frame(frame: &str, interface: &str) -> Result<Self, RecordError> {
        let plain = match frame.split_once('#') {
            Some((id, data)) => format!("{id}#{}", data.replace('.', "")),
            None => frame.to_string(),
        };
        let line = format!("(0.000000) {interface} {plain}");
        line.parse().map_err(|error: RecordError| {
            let message = mistake(frame).unwrap_or(error.message);
            RecordError { found: frame.to_string(), column: 1, message }
        })
    }

    /// Converts a frame of a simulated bus; `None` for a servo packet.
    fn of_simulated(name: &str, received: &Received) -> Option<Self> {
        let Received { frame, time_ns } = received;
        let mut text = match frame.id {
            Id::Standard(id) => format!("{id:03X}#"),
            Id::Extended(id) => format!("{id:08X}#"),
        };
        text += match frame.form {
            Form::Classic => "",
            Form::Fd => "#0",
            Form::FdFast => "#1",
            Form::Packet => return None,
        };
        frame.data().iter().for_each(|byte| text += &format!("{byte:02X}"));
        let mut record = Self::of_frame(&text, name).ok()?;
        record.0.t_us = since_1970_of_ns(*time_ns);
        Some(record)
    }

    /// Converts a report of a simulated bus's controller, stamped with the current time.
    fn of_report(name: &str, report: &Report) -> Option<Self> {
        let (classes, data) = report.encode();
        let mut text = format!("{:08X}#", libc::CAN_ERR_FLAG | classes & libc::CAN_ERR_MASK);
        data.iter().for_each(|byte| text += &format!("{byte:02X}"));
        let mut record = Self::of_frame(&text, name).ok()?;
        record.0.t_us = since_1970_us(SystemTime::now());
        Some(record)
    }

    /// Returns the receive time, in us since 1970 or since the epoch of the log.
    pub fn time_us(&self) -> u64 {
        self.0.t_us
    }

    /// Returns the name of the interface.
    pub fn interface(&self) -> &str {
        &self.0.device
    }

    /// Returns the data frame; `None` if the record does not contain one.
    pub fn frame(&self) -> Option<Frame> {
        let form = match &self.0.frame {
            CanAnyFrame::Normal(_) => Form::Classic,
            CanAnyFrame::Fd(fd) if fd.is_brs() => Form::FdFast,
            CanAnyFrame::Fd(_) => Form::Fd,
            CanAnyFrame::Remote(_) | CanAnyFrame::Error(_) => return None,
        };
        let raw = self.0.frame.raw_id();
        let id =
            if self.0.frame.is_extended() { Id::extended(raw)? } else { Id::standard(raw.try_into().ok()?)? };
        Frame::new(id, form, self.0.frame.data())
    }

    /// Returns the controller report; `None` if the record does not contain one.
    pub fn report(&self) -> Option<Report> {
        match &self.0.frame {
            CanAnyFrame::Error(error) => {
                let mut data = [0; 8];
                let bytes = error.data();
                data[..bytes.len().min(8)].copy_from_slice(&bytes[..bytes.len().min(8)]);
                Some(Report::decode(error.id_word() & libc::CAN_ERR_MASK, &data))
            }
            _ => None,
        }
    }

    /// Returns a description of the controller report; `None` if the record does not contain a report.
    pub fn error(&self) -> Option<String> {
        match &self.0.frame {
            CanAnyFrame::Error(error) => Some(error.into_error().to_string().to_lowercase()),
            _ => None,
        }
    }
}

impl fmt::Display for Record {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Converts a time on the monotonic clock to us since 1970.
fn since_1970_of_ns(time_ns: u64) -> u64 {
    let ago_ns = monotonic_ns().saturating_sub(time_ns);
    since_1970_us(SystemTime::now()).saturating_sub(ago_ns / 1000)
}

fn since_1970_us(time: SystemTime) -> u64 {
    time.duration_since(UNIX_EPOCH).map_or(0, |since| u64::try_from(since.as_micros()).unwrap_or(u64::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_every_kind_round_trip() {
        for line in [
            "(1735270496.916858) can0 110#00112233",
            "(1735270588.936508) can0 120##500112233445566778899AABB",
            "(1735279041.257318) can1 104#R",
            "(1735279048.349278) can1 110#R4",
            "(1469439874.299654) can1 104#",
            "(1785099856.242430) can1 20000004#000C000000000000",
            "(0.000001) vcan0 1FFFFFFF#0102030405060708",
        ] {
            let record: Record = line.parse().unwrap();
            assert_eq!(record.to_string(), line);
        }
    }

    #[test]
    fn parsed_frames_have_identifier_form_and_data() {
        let frame = |text: &str| Record::of_frame(text, "can0").unwrap().frame();
        assert_eq!(frame("123#0102"), Some(Frame::classic(Id::Standard(0x123), &[1, 2])));
        assert_eq!(frame("00000123#01"), Some(Frame::classic(Id::Extended(0x123), &[1])));
        assert_eq!(frame("123##0AA"), Frame::new(Id::Standard(0x123), Form::Fd, &[0xaa]));
        assert_eq!(frame("123##1AA"), Frame::new(Id::Standard(0x123), Form::FdFast, &[0xaa]));
        assert_eq!(frame("123#01.02"), frame("123#0102"));
        assert_eq!(frame("123#R"), None);
    }

    #[test]
    fn an_invalid_frame_is_refused_with_its_text() {
        for text in ["", "123", "123#0", "123#GG", "800#00", "123#112233445566778899", "12#00"] {
            let error = Record::of_frame(text, "can0").unwrap_err();
            assert_eq!(error.found, text);
            assert!(error.to_string().contains("is not a frame"), "{error}");
        }
    }

    #[test]
    fn mistakes_in_log_lines_have_column_and_expectation() {
        for (line, column, words) in [
            (
                "(1735270496.916858)",
                20,
                "ends after its time, expected interface and frame, such as `can0 123#0102`",
            ),
            ("(1735270496.916858) can0", 25, "ends after `can0`, expected a frame, such as `123#0102`"),
            ("(1735270496.916858 can0 123#01", 1, "found `(1735270496.916858`, expected a time in s"),
            ("  (now) can0 123#01", 3, "found `(now)`, expected a time in s such as `(1735270496.916858)`"),
            ("(1735270496.916858) can0 123#0", 26, "the data end with half a byte"),
            ("(1735270496.916858) can0 12#01", 26, "an identifier of 2 digits, expected 3 (11 bits)"),
            ("hello", 1, "found `hello`, expected a time in s"),
            (
                "  can0  123   [3]  11 22",
                15,
                "found 2 bytes after `[3]`, expected 3 bytes of two hexadecimal digits each",
            ),
            (
                "(1.5)  can0  123   [2]  11 2",
                20,
                "found 1 bytes after `[2]`, expected 2 bytes of two hexadecimal digits each",
            ),
            ("0.5 1 123x Rx d 3 11 22", 1, "expected time, channel, identifier"),
            (
                "(0.5) can0 123##1112233445566778899",
                12,
                "9 bytes of data, expected 0 to 8, 12, 16, 20, 24, 32, 48 or 64 in a frame of CAN FD",
            ),
        ] {
            let error = Record::of_log(line).err().unwrap_or_else(|| panic!("{line} is read"));
            assert_eq!(error.column, column, "{line}: {error}");
            assert!(error.to_string().contains(words), "{line}: {error}");
        }
        let long = format!("(0.5) can0 123#{}", "00".repeat(10_000));
        let error = Record::of_log(&long).expect_err("20,000 digits").to_string();
        assert!(error.contains("10000 bytes of data") && error.len() < 400, "{error}");
        let marked = Record::of_log("\u{feff}(0.500000) can0 123#01").expect("a byte order mark");
        assert_eq!(marked.map(|record| record.to_string()).as_deref(), Some("(0.500000) can0 123#01"));
    }

    #[test]
    fn a_missing_interface_is_reported_with_alternatives() {
        let error = Listener::open(["no-such-bus"]).err().unwrap();
        assert!(error.to_string().contains("the CAN interface `no-such-bus` does not exist"), "{error}");
        assert!(error.advice().contains("ip -details link show type can"));
        let error = Sender::open("vcan77").err().unwrap();
        assert!(error.advice().contains("sudo ip link add vcan77 type vcan"), "{}", error.advice());
    }

    #[test]
    fn mistakes_in_a_frame_are_named() {
        for (frame, words) in [
            ("123", "there is no `#` between identifier and data"),
            ("12G#01", "`G` in the identifier is not a hexadecimal digit"),
            ("12#01", "an identifier of 2 digits, expected 3 (11 bits) or 8 (29 bits)"),
            ("8FF#01", "the identifier 0x8FF is beyond 0x7FF"),
            ("40000000#01", "the identifier 0x40000000 is beyond 0x1FFFFFFF"),
            ("123#0G", "`G` in the data is not a hexadecimal digit"),
            ("123#010", "the data end with half a byte"),
            ("123#01.020", "the data end with half a byte"),
            ("123#010203040506070809", "9 bytes of data, but a frame of classic CAN has at most 8"),
            ("123#01.02.03.04.05.06.07.08.09", "9 bytes of data, but a frame of classic CAN has at most 8"),
        ] {
            let message = Record::of_frame(frame, "can0").err().map(|error| error.to_string());
            assert!(message.as_ref().is_some_and(|message| message.contains(words)), "{frame}: {message:?}");
        }
        for right in ["123#", "123#0102", "123#01.02", "00000123#01", "123##10102", "123#R"] {
            assert!(Record::of_frame(right, "can0").is_ok(), "{right}");
        }
    }
}
