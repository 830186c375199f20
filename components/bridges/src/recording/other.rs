//! MCAP files of other programs, as curves and tables.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use memmap2::Mmap;
use motorium::nearest::suggest;
use motorium_recordings::messages::{Channel, Leaf, LogError, MessageLog, Number, Value};

use super::csv::TableError;
use super::reader::{ReadError, Recording, opened};
use super::signals::{Curve, Signal, SignalsError};
use crate::parquet::{Column, Values, write};

/// Rows per row group.
const GROUP: usize = 1 << 16;
/// Maximum number of columns of a table.
const WIDEST: usize = 10_000;

/// An opened MCAP file.
#[derive(Debug)]
pub enum Opened {
    /// A recording written by motorium.
    Run(Box<Recording>),
    /// A file written by another program.
    Other(Box<OtherLog>),
}

/// An MCAP file of another program, whose messages are JSON, CDR (ROS 2) or protobuf.
#[derive(Debug)]
pub struct OtherLog {
    path: PathBuf,
    log: MessageLog<Mmap>,
}

/// Opens an MCAP file of motorium or of another program.
///
/// # Errors
/// Returns an error if the file cannot be read, is not an MCAP file, or has no channels.
pub fn open(path: &Path) -> Result<Opened, ReadError> {
    match opened(path)? {
        Ok(recording) => Ok(Opened::Run(Box::new(recording))),
        Err(map) => {
            let path = path.to_path_buf();
            match MessageLog::new(map) {
                Ok(log) => Ok(Opened::Other(Box::new(OtherLog { path, log }))),
                Err(reason) => Err(ReadError::Log { path, reason }),
            }
        }
    }
}

impl OtherLog {
    /// Returns the path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the name of the program that wrote the file; empty if the file does not name it.
    pub fn writer(&self) -> &str {
        self.log.writer()
    }

    /// Returns the channels of the file.
    pub fn channels(&self) -> &[Channel] {
        self.log.channels()
    }

    /// Returns the times of the first and the last message, ns; `None` without messages.
    pub fn times(&self) -> Option<(u64, u64)> {
        self.log.times()
    }

    /// Returns descriptions of the faults of a readable file.
    pub fn faults(&self) -> Vec<String> {
        self.log.faults()
    }

    /// Returns the message times of each channel, ns, ascending.
    pub fn message_times(&self) -> Vec<Vec<u64>> {
        let mut times = vec![Vec::new(); self.channels().len()];
        self.log.messages().for_each(|message| times[message.channel].push(message.time_ns));
        times.iter_mut().for_each(|times| times.sort_unstable());
        times
    }

    /// Returns the curves of signals, in the order of the signals. An array has one curve per entry. The
    /// field of a signal is a path such as `pose.position.x` or `transforms[0].transform.translation`.
    ///
    /// # Errors
    /// Returns an error if a channel, field or entry of a signal is missing from the file, or if the file
    /// cannot be decoded.
    pub fn curves(&self, signals: &[Signal]) -> Result<Vec<Curve>, SignalsError> {
        let mut wanted = Vec::new();
        for signal in signals {
            let (channel, field) = self.resolve(signal)?;
            wanted.push(Wanted::new(signal, channel, field));
        }
        let begin_ns = self.times().map_or(0, |(first, _)| first);
        let mut numbers = vec![0; self.channels().len()];
        for message in self.log.messages() {
            let mut of_channel =
                wanted.iter_mut().filter(|wanted| wanted.channel == message.channel).peekable();
            numbers[message.channel] += 1;
            if of_channel.peek().is_none() {
                continue;
            }
            let value = self.decode(message.channel, numbers[message.channel], &message.data)?;
            // Floating-point numbers round times since 1970 to fractions of a microsecond.
            let time = message.time_ns.saturating_sub(begin_ns) as f64 * 1e-9;
            of_channel.for_each(|wanted| wanted.add(time, &value));
        }
        for wanted in &wanted {
            wanted.check(&self.channels()[wanted.channel].topic)?;
        }
        let mut curves: Vec<Curve> = wanted.into_iter().flat_map(|wanted| wanted.curves).collect();
        curves.iter_mut().for_each(|curve| curve.points.sort_by(|a, b| a.0.total_cmp(&b.0)));
        Ok(curves)
    }

    /// Resolves a signal to its channel and path. The name of a channel may contain dots.
    fn resolve(&self, signal: &Signal) -> Result<(usize, Option<String>), SignalsError> {
        let full = match &signal.field {
            Some(field) => format!("{}.{field}", signal.topic),
            None => signal.topic.clone(),
        };
        let rest = |topic: &str| {
            let rest = full.strip_prefix(topic)?;
            (rest.is_empty() || rest.starts_with('.')).then_some(rest)
        };
        let channels = self.channels().iter().enumerate();
        let found = channels.filter_map(|(index, channel)| Some((index, rest(&channel.topic)?)));
        let Some((index, rest)) = found.min_by_key(|(_, rest)| rest.len()) else {
            let names = self.channels().iter().map(|channel| channel.topic.as_str());
            let advice = suggest(&signal.topic, names, "its topics are");
            return Err(SignalsError::NoTopic { topic: signal.topic.clone(), advice });
        };
        self.log.decoder(index).map_err(|reason| self.refused(reason))?;
        Ok((index, rest.strip_prefix('.').map(str::to_string)))
    }

    fn refused(&self, reason: LogError) -> ReadError {
        ReadError::Log { path: self.path.clone(), reason }
    }

    fn decode(&self, channel: usize, number: u64, message: &[u8]) -> Result<Value, ReadError> {
        let decoder = self.log.decoder(channel).map_err(|reason| self.refused(reason))?;
        decoder.decode(message).map_err(|reason| {
            let topic = self.channels()[channel].topic.clone();
            self.refused(LogError::Damaged { topic, number, reason: reason.to_string() })
        })
    }

    /// Decodes the messages of a channel in file order.
    fn values(&self, channel: usize) -> impl Iterator<Item = Result<(u64, Value), ReadError>> {
        let of_channel = self.log.messages().filter(move |message| message.channel == channel);
        of_channel
            .zip(1..)
            .map(move |(message, number)| Ok((message.time_ns, self.decode(channel, number, &message.data)?)))
    }

    /// Returns the columns of a channel in the order of its fields, with the kind of their content, and the
    /// number of rows. Columns of arrays with named entries use these names, as in `position[panda_joint1]`.
    fn columns(&self, channel: usize) -> Result<(Vec<(String, Kind)>, usize), TableError> {
        let mut order: Vec<String> = Vec::new();
        // Number of values, and kind, of each column.
        let mut columns: BTreeMap<String, (usize, Kind)> = BTreeMap::new();
        let mut rows = 0;
        for value in self.values(channel) {
            let (_, value) = value.map_err(SignalsError::from)?;
            rows += 1;
            let mut before: Option<String> = None;
            visit(&value, &mut |path, leaf| {
                match columns.get_mut(path) {
                    Some((count, kind)) => (*count, *kind) = (*count + 1, kind.with(Kind::from_leaf(&leaf))),
                    None => {
                        columns.insert(path.to_string(), (1, Kind::from_leaf(&leaf)));
                        // A new column is inserted after its predecessor in the message.
                        let place =
                            before.as_ref().and_then(|before| order.iter().rposition(|name| name == before));
                        order.insert(place.map_or(0, |place| place + 1), path.to_string());
                    }
                }
                before = Some(path.to_string());
            });
            if order.len() > WIDEST {
                let topic = self.channels()[channel].topic.clone();
                return Err(TableError::Wide { topic, most: WIDEST });
            }
        }
        let kind = |name: String| {
            let (count, kind) = columns[&name];
            // A column with gaps holds floating-point numbers, with NaN for a gap.
            let kind = if count < rows { kind.with_gaps() } else { kind };
            (name, kind)
        };
        Ok((order.into_iter().map(kind).collect(), rows))
    }

    /// Writes a channel as comma-separated values: the time of each message, and one column per number or
    /// text. Byte arrays are omitted. Returns the number of rows.
    ///
    /// # Errors
    /// Returns an error if the messages cannot be decoded, or the table cannot be written.
    pub fn write_csv(&self, channel: usize, out: &mut impl Write) -> Result<u64, TableError> {
        let (columns, rows) = self.columns(channel)?;
        write!(out, "time_ns")?;
        for (name, _) in &columns {
            write!(out, ",{}", cell(name))?;
        }
        writeln!(out)?;
        for value in self.values(channel) {
            let (time_ns, value) = value.map_err(SignalsError::from)?;
            let mut cells = BTreeMap::new();
            visit(&value, &mut |path, leaf| {
                let text = match leaf {
                    Leaf::Number(number) => number.to_string(),
                    Leaf::Text(text) => cell(text),
                };
                cells.insert(path.to_string(), text);
            });
            write!(out, "{time_ns}")?;
            for (name, _) in &columns {
                write!(out, ",{}", cells.get(name).map_or("", String::as_str))?;
            }
            writeln!(out)?;
        }
        Ok(rows as u64)
    }

    /// Writes a channel as a Parquet table with the columns of [`write_csv`](Self::write_csv). Returns the
    /// number of rows.
    ///
    /// # Errors
    /// Returns an error in the same cases as [`write_csv`](Self::write_csv).
    pub fn write_parquet(&self, channel: usize, out: &mut impl Write) -> Result<u64, TableError> {
        let (names, rows) = self.columns(channel)?;
        let mut times = Vec::with_capacity(rows);
        let mut columns: Vec<Column> =
            names.iter().map(|(name, kind)| Column { name: name.clone(), values: kind.empty() }).collect();
        for value in self.values(channel) {
            let (time_ns, value) = value.map_err(SignalsError::from)?;
            let mut leaves = BTreeMap::new();
            visit(&value, &mut |path, leaf| {
                leaves.insert(path.to_string(), leaf);
            });
            times.push(time_ns);
            for column in &mut columns {
                push(&mut column.values, leaves.get(&column.name));
            }
        }
        columns.insert(0, Column { name: "time_ns".to_string(), values: Values::UInt64(times) });
        let groups: Vec<usize> = (0..rows).step_by(GROUP).map(|first| GROUP.min(rows - first)).collect();
        let channel = &self.channels()[channel];
        let schema = channel.schema.as_ref().map_or_else(String::new, |schema| schema.name.clone());
        write(out, &columns, &groups, &[("topic", channel.topic.clone()), ("schema", schema)])?;
        Ok(rows as u64)
    }
}

/// Visits the numbers and texts of a message. Array entries are visited by name if they have names.
fn visit<'v>(value: &'v Value, each: &mut impl FnMut(&str, Leaf<'v>)) {
    let mut names: BTreeMap<String, Option<Vec<&str>>> = BTreeMap::new();
    value.visit(&mut |path, leaf| {
        let entry = path.strip_suffix(']').and_then(|path| path.rsplit_once('['));
        let Some((array, index)) = entry.filter(|_| matches!(leaf, Leaf::Number(_))) else {
            return each(path, leaf);
        };
        let names = names.entry(array.to_string()).or_insert_with(|| value.names_of(array));
        let name = names.as_ref().and_then(|names| names.get(index.parse::<usize>().ok()?));
        match name {
            Some(name) => each(&format!("{array}[{name}]"), leaf),
            None => each(path, leaf),
        }
    });
}

/// Formats a text as a table cell.
fn cell(text: &str) -> String {
    match text.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_string(),
    }
}

/// Kind of the values in a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Natural,
    Integer,
    Single,
    Double,
    Text,
}

impl Kind {
    fn from_leaf(leaf: &Leaf<'_>) -> Self {
        match leaf {
            Leaf::Number(Number::Natural(_)) => Self::Natural,
            Leaf::Number(Number::Integer(_)) => Self::Integer,
            Leaf::Number(Number::Single(_)) => Self::Single,
            Leaf::Number(Number::Double(_)) => Self::Double,
            Leaf::Text(_) => Self::Text,
        }
    }

    /// Returns the kind that can represent both.
    fn with(self, other: Self) -> Self {
        match (self, other) {
            (a, b) if a == b => a,
            (Self::Text, _) | (_, Self::Text) => Self::Text,
            (Self::Natural | Self::Integer, Self::Natural | Self::Integer) => Self::Integer,
            _ => Self::Double,
        }
    }

    fn with_gaps(self) -> Self {
        match self {
            Self::Text => Self::Text,
            _ => Self::Double,
        }
    }

    fn empty(self) -> Values {
        match self {
            Self::Natural => Values::UInt64(Vec::new()),
            Self::Integer => Values::Int64(Vec::new()),
            Self::Single => Values::Float(Vec::new()),
            Self::Double => Values::Double(Vec::new()),
            Self::Text => Values::Text(Vec::new()),
        }
    }
}

fn push(values: &mut Values, leaf: Option<&Leaf<'_>>) {
    let number = match leaf {
        Some(Leaf::Number(number)) => Some(*number),
        _ => None,
    };
    let double = number.map_or(f64::NAN, Number::as_f64);
    match values {
        Values::Text(texts) => texts.push(match leaf {
            Some(Leaf::Text(text)) => (*text).to_string(),
            Some(Leaf::Number(number)) => number.to_string(),
            None => String::new(),
        }),
        Values::UInt64(values) => {
            values.push(if let Some(Number::Natural(value)) = number { value } else { 0 })
        }
        Values::Int64(values) => values.push(match number {
            Some(Number::Integer(value)) => value,
            Some(Number::Natural(value)) => value as i64,
            _ => 0,
        }),
        Values::Float(values) => values.push(double as f32),
        Values::Double(values) => values.push(double),
        Values::Bytes(_) | Values::List { .. } | Values::Group(_) => {}
    }
}

/// A requested signal, and its curves so far.
struct Wanted<'s> {
    signal: &'s Signal,
    channel: usize,
    field: Option<String>,
    curves: Vec<Curve>,
    of_name: BTreeMap<String, usize>,
    messages: u64,
    /// Maximum number of array entries in a message; `None` if no message has the field.
    most: Option<usize>,
    /// Fields of the first message.
    known: Vec<String>,
}

impl<'s> Wanted<'s> {
    fn new(signal: &'s Signal, channel: usize, field: Option<String>) -> Self {
        let (curves, of_name, known) = (Vec::new(), BTreeMap::new(), Vec::new());
        Self { signal, channel, field, curves, of_name, messages: 0, most: None, known }
    }

    fn add(&mut self, time: f64, message: &Value) {
        self.messages += 1;
        if self.known.is_empty() {
            message.visit(&mut |path, _| {
                let field = path.split('[').next().unwrap_or_default().to_string();
                if !self.known.contains(&field) {
                    self.known.push(field);
                }
            });
        }
        let path = self.field.clone().unwrap_or_default();
        let Some(part) = message.get(&path) else { return };
        let entries = part.numbers().map_or(0, |numbers| numbers.len());
        self.most = self.most.max(Some(entries));
        if let Value::Bytes(bytes) = part {
            for (entry, byte) in bytes.iter().enumerate() {
                self.point(time, &path, &format!("[{entry}]"), f64::from(*byte), message);
            }
            return;
        }
        part.visit(&mut |inner, leaf| {
            if let Leaf::Number(number) = leaf {
                self.point(time, &path, inner, number.as_f64(), message);
            }
        });
    }

    /// Adds a number at a path within the field.
    fn point(&mut self, time: f64, field: &str, inner: &str, value: f64, message: &Value) {
        let entry = inner.strip_prefix('[').and_then(|inner| inner.split(']').next()?.parse::<usize>().ok());
        if let (Some(entries), Some(entry)) = (&self.signal.entries, entry)
            && !entries.contains(&entry)
        {
            return;
        }
        let dot = if field.is_empty() || inner.is_empty() || inner.starts_with('[') { "" } else { "." };
        let path = format!("{field}{dot}{inner}");
        let place = *self.of_name.entry(path).or_insert_with_key(|path| {
            let array = path.strip_suffix(']').and_then(|path| path.rsplit_once('['));
            let label = array.and_then(|(array, index)| {
                message.names_of(array)?.get(index.parse::<usize>().ok()?).map(|name| (*name).to_string())
            });
            let name = format!("{}.{path}", self.signal.topic);
            self.curves.push(Curve { name, entry, label, points: Vec::new() });
            self.curves.len() - 1
        });
        self.curves[place].points.push((time, value));
    }

    fn check(&self, topic: &str) -> Result<(), SignalsError> {
        let field = self.field.clone().unwrap_or_default();
        let name = format!("{topic}.{field}");
        match (self.most, &self.signal.entries) {
            _ if self.messages == 0 => Err(SignalsError::NoSample(topic.to_string())),
            (None, _) => {
                let advice = suggest(&field, self.known.iter().map(String::as_str), "its fields are");
                Err(SignalsError::NoField { topic: topic.to_string(), field, advice })
            }
            (Some(most), Some(entries)) if entries.end > most => {
                Err(SignalsError::NoEntry { name, most, entries: entries.clone() })
            }
            _ if self.curves.is_empty() => Err(SignalsError::NoNumbers { name }),
            _ => Ok(()),
        }
    }
}
