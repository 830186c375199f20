//! Logs in formats other than `candump -L`: the screen output of `candump`, and ASC files of Vector's tools.

use super::{Record, RecordError, mistake_in_line};

/// Converts a log line to the format of `candump -L`; `None` for a line without traffic, such as a header.
pub(super) fn translate(line: &str) -> Result<Option<String>, RecordError> {
    let refuse = |message: &str| {
        let column = line.chars().take_while(|letter| letter.is_whitespace()).count() + 1;
        Err(RecordError { found: line.to_string(), column, message: message.to_string() })
    };
    let fields: Vec<&str> = line.split_whitespace().collect();
    match fields[..] {
        [] => Ok(None),
        ["base", "hex", "timestamps", "relative", ..] => refuse(
            "times of this ASC file are relative to the previous line: export it with `timestamps absolute`",
        ),
        ["base", "hex", ..] => Ok(None),
        ["base", ..] => refuse("numbers of this ASC file are decimal: export it with `base hex`"),
        ["date" | "internal" | "no" | "Begin" | "End" | "begin" | "end", ..] => Ok(None),
        [comment, ..] if comment.starts_with("//") => Ok(None),
        [time, ..] if time.starts_with('(') => {
            let Some((time, rest)) = time
                .strip_prefix('(')
                .zip(line.split_once(')'))
                .and_then(|(time, (_, rest))| Some((micros(time.strip_suffix(')')?)?, rest.trim())))
            else {
                return Ok(Some(line.to_string()));
            };
            match screen(&time, rest) {
                Some(record) => Ok(Some(record)),
                None => short_screen(line).map_or_else(|| Ok(Some(format!("({time}) {rest}"))), Err),
            }
        }
        [time, ..] if micros(time).is_some() => asc(&fields).map_or_else(
            || refuse("expected time, channel, identifier, direction, `d`, length and bytes of an ASC file"),
            Ok,
        ),
        _ => match screen("0.000000", line) {
            Some(record) => Ok(Some(record)),
            None => short_screen(line).map_or_else(|| Ok(Some(line.to_string())), Err),
        },
    }
}

/// Returns the error of a screen line with other bytes than its length states; `None` without a length.
fn short_screen(line: &str) -> Option<RecordError> {
    let length = line.split_whitespace().find(|field| field.starts_with('[') && field.ends_with(']'))?;
    let count: usize = length.strip_prefix('[')?.strip_suffix(']')?.parse().ok()?;
    let at = line.find(length)?;
    let is_byte = |text: &&str| text.len() == 2 && text.bytes().all(|digit| digit.is_ascii_hexdigit());
    let found = line[at + length.len()..].split_whitespace().take_while(is_byte).count();
    (found < count).then(|| RecordError {
        found: line.to_string(),
        column: line[..at].chars().count() + 1,
        message: format!(
            "found {found} bytes after `{length}`, expected {count} bytes of two hexadecimal digits each"
        ),
    })
}

/// Formats a time in seconds with six decimals.
fn micros(time: &str) -> Option<String> {
    let (seconds, fraction) = time.split_once('.')?;
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|digit| digit.is_ascii_digit());
    (is_number(seconds) && is_number(fraction)).then(|| format!("{seconds}.{:0<6.6}", fraction))
}

/// Parses a screen line without its time: `can0 123 [3] 11 22 33`. The length of a CAN FD frame has two
/// digits.
fn screen(time: &str, line: &str) -> Option<String> {
    let mut fields = line.split_whitespace().filter(|field| !matches!(*field, "RX" | "TX" | "-" | "B" | "E"));
    let (interface, id) = (fields.next()?, fields.next()?);
    let length = fields.next()?.strip_prefix('[')?.strip_suffix(']')?;
    let count: usize = length.parse().ok()?;
    let is_byte = |text: &str| text.len() == 2 && text.bytes().all(|digit| digit.is_ascii_hexdigit());
    let rest: Vec<&str> = fields.collect();
    if rest.first() == Some(&"remote") {
        let length = if count == 0 { String::new() } else { count.to_string() };
        return Some(format!("({time}) {interface} {id}#R{length}"));
    }
    // text after the bytes comes from `candump -a`, or is the name of an error
    let bytes = rest.get(..count).filter(|bytes| bytes.iter().all(|byte| is_byte(byte)))?;
    // flag `B` of `candump -x`: the data are sent at the higher rate
    let is_fast =
        || line.split_whitespace().take_while(|field| !field.starts_with('[')).any(|field| field == "B");
    let separator = match length.len() {
        2 if is_fast() => "##1",
        2 => "##0",
        _ => "#",
    };
    Some(format!("({time}) {interface} {id}{separator}{}", bytes.concat()))
}

/// Converts a line of an ASC file to a line of the interface `canN` for channel N. Returns `None` for a line
/// that does not parse, and `Some(None)` for an event other than a frame.
fn asc(fields: &[&str]) -> Option<Option<String>> {
    let time = micros(fields.first()?)?;
    let id_of = |text: &str| match text.strip_suffix(['x', 'X']) {
        Some(extended) => u32::from_str_radix(extended, 16).ok().map(|id| format!("{id:08X}")),
        None => u32::from_str_radix(text, 16).ok().map(|id| format!("{id:03X}")),
    };
    let data = |length: &str, bytes: &[&str]| -> Option<String> {
        let bytes = bytes.get(..length.parse::<usize>().ok()?)?;
        bytes.iter().all(|byte| byte.len() == 2).then(|| bytes.concat())
    };
    if fields.get(1) == Some(&"CANFD") {
        let (channel, id) = (fields.get(2)?, id_of(fields.get(4)?)?);
        // a symbolic name may come between identifier and flags
        let flags = if matches!(fields.get(5), Some(&("0" | "1"))) { 5 } else { 6 };
        let separator = if fields.get(flags) == Some(&"1") { "##1" } else { "##0" };
        let bytes = data(fields.get(flags + 3)?, fields.get(flags + 4..)?)?;
        return Some(Some(format!("({time}) can{channel} {id}{separator}{bytes}")));
    }
    let Ok(channel) = fields.get(1)?.parse::<u32>() else { return Some(None) };
    let second = fields.get(2)?;
    if *second == "ErrorFrame" {
        return Some(Some(format!("({time}) can{channel} 20000000#0000000000000000")));
    }
    if matches!(*second, "Statistic:" | "CAN" | "Status:") {
        return Some(None);
    }
    let id = id_of(second)?;
    match (*fields.get(4)?).to_ascii_lowercase().as_str() {
        "r" => {
            let length = fields.get(5).filter(|length| matches!(length.parse(), Ok(1_u8..=8)));
            Some(Some(format!("({time}) can{channel} {id}#R{}", length.unwrap_or(&""))))
        }
        "d" => {
            let bytes = data(fields.get(5)?, fields.get(6..)?)?;
            Some(Some(format!("({time}) can{channel} {id}#{bytes}")))
        }
        _ => None,
    }
}

impl Record {
    /// Parses a log line: `candump -L`, the screen output of `candump`, or an ASC file. Channel N of an ASC
    /// file becomes the interface `canN`. Returns `None` for an empty line or a header.
    ///
    /// ```
    /// use motorium_can::Record;
    ///
    /// let screen = Record::of_log("  can0  123   [3]  11 22 33")?.map(|record| record.to_string());
    /// assert_eq!(screen.as_deref(), Some("(0.000000) can0 123#112233"));
    /// let asc = Record::of_log("   0.5 1  123x  Rx   d 3 11 22 33")?.map(|record| record.to_string());
    /// assert_eq!(asc.as_deref(), Some("(0.500000) can1 00000123#112233"));
    /// assert!(Record::of_log("base hex  timestamps absolute")?.is_none());
    /// # Ok::<(), motorium_can::RecordError>(())
    /// ```
    ///
    /// # Errors
    /// Returns an error if the line is not a record.
    pub fn of_log(line: &str) -> Result<Option<Self>, RecordError> {
        // at the start of a file that an editor on Windows saved
        let line = line.trim_start_matches('\u{feff}');
        let Some(translated) = translate(line)? else { return Ok(None) };
        // A screen line has no `#`: mistakes are found in its translation.
        let is_screen = line.contains('[');
        let refuse = |error: RecordError| match mistake_in_line(line).filter(|_| !is_screen) {
            Some((column, message)) => RecordError { found: line.to_string(), column, message },
            None => RecordError { found: line.to_string(), ..error },
        };
        translated.parse().map(Some).map_err(refuse)
    }
}
