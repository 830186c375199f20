//! Message databases (DBC files): names, units and scaling of the signals in frames.

use core::ops::RangeInclusive;
use std::collections::BTreeMap;

use can_dbc::{ByteOrder, Dbc, MessageId, MultiplexIndicator, SignalExtendedValueType, ValueType};

use crate::decimal::Decimal;
use crate::{Frame, Id};

/// Database of a bus's messages, read from a DBC file.
///
/// ```
/// use motorium_can::{Database, Frame, Id};
///
/// let text = r#"VERSION ""
/// NS_ :
/// BS_:
/// BU_:
/// BO_ 23 Supply: 8 Vector__XXX
///  SG_ Voltage : 0|16@1+ (0.01,0) [0|100] "V" Vector__XXX
/// "#;
/// let database = Database::parse(text)?;
/// let frame = Frame::classic(Id::Standard(23), &[0x60, 0x09, 0, 0, 0, 0, 0, 0]);
/// let message = database.decode(&frame).ok_or("no such message")?;
/// assert_eq!(message.to_string(), "Supply(Voltage: 24 V)");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Database {
    messages: BTreeMap<(bool, u32), Message>,
    /// Significant bits of the identifiers.
    mask: u32,
}

/// Error returned when a database cannot be read.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DatabaseError {
    /// The text is not a DBC file.
    #[error("the text is not a DBC file: {0}")]
    Syntax(String),
    /// A signal is invalid.
    #[error("the signal `{signal}` of the message `{message}`: {cause}")]
    Signal {
        /// Name of the message.
        message: String,
        /// Name of the signal.
        signal: String,
        /// Reason why the signal is invalid.
        cause: String,
    },
    /// Two messages have the same identifier.
    #[error("the messages `{first}` and `{second}` have the same identifier{}", under(*.mask))]
    Twice {
        /// Name of the first message.
        first: String,
        /// Name of the second message.
        second: String,
        /// Significant bits of the identifiers.
        mask: u32,
    },
}

fn under(mask: u32) -> String {
    if mask == ALL { String::new() } else { format!(" under the mask 0x{mask:X}") }
}

const ALL: u32 = 0x1fff_ffff;

/// Message as described in the database.
#[derive(Clone, Debug)]
struct Message {
    name: String,
    signals: Vec<Signal>,
}

/// Signal as described in the database.
#[derive(Clone, Debug)]
struct Signal {
    name: String,
    unit: String,
    start: usize,
    bits: usize,
    order: ByteOrder,
    form: Form,
    factor: f64,
    offset: f64,
    labels: Vec<(i64, String)>,
    /// The signal is present if this multiplexer has one of these values.
    switch: Option<(usize, Vec<RangeInclusive<u64>>)>,
}

/// Interpretation of a signal's bits.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    Unsigned,
    Signed,
    Single,
    Double,
}

/// Frame decoded with a database.
#[derive(Clone, Debug, PartialEq)]
pub struct Decoded<'a> {
    /// Name of the message.
    pub name: &'a str,
    /// Signals, in the order of the database. Signals beyond the end of the frame and inactive multiplexed
    /// signals are omitted.
    pub signals: Vec<SignalValue<'a>>,
}

/// Value of a signal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SignalValue<'a> {
    /// Name of the signal.
    pub name: &'a str,
    /// Scaled value, in `unit`.
    pub value: f64,
    /// Exact value of an integer signal; `None` otherwise. `value` cannot represent all 64-bit integers.
    pub whole: Option<i128>,
    /// Scaled value with all digits, unless the signal is a floating-point number.
    exact: Option<Decimal>,
    /// Significant digits of a floating-point number.
    digits: usize,
    /// Unit; empty if the database has none.
    pub unit: &'a str,
    /// Name of the value; `None` if the database does not name it.
    pub label: Option<&'a str>,
}

/// Returns `true` for an integer that a floating-point number represents exactly.
fn is_whole(number: f64) -> bool {
    number.fract() == 0.0 && number.abs() < 1e15
}

/// Rounds a number to at most this number of significant digits.
fn rounded(value: f64, digits: usize) -> f64 {
    format!("{value:.0$e}", digits - 1).parse().unwrap_or(value)
}

impl core::fmt::Display for SignalValue<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}: ", self.name)?;
        match self.label {
            Some(label) => write!(f, "{label}"),
            None => match self.exact {
                Some(exact) => write!(f, "{exact}"),
                None if is_whole(self.value) => write!(f, "{}", self.value),
                None => write!(f, "{}", rounded(self.value, self.digits)),
            },
        }?;
        if self.unit.is_empty() || self.label.is_some() { Ok(()) } else { write!(f, " {}", self.unit) }
    }
}

impl core::fmt::Display for Decoded<'_> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}(", self.name)?;
        for (index, value) in self.signals.iter().enumerate() {
            write!(f, "{}{value}", if index == 0 { "" } else { ", " })?;
        }
        write!(f, ")")
    }
}

impl Database {
    /// Reads a DBC file.
    ///
    /// # Errors
    /// Returns an error if the text is not a database, if a signal does not fit into its message, or if two
    /// messages have the same identifier.
    pub fn parse(text: &str) -> Result<Self, DatabaseError> {
        let text = text.trim_start_matches('\u{feff}');
        let file = Dbc::try_from(text).map_err(|error| DatabaseError::Syntax(error.to_string()))?;
        let mut read = Self { messages: BTreeMap::new(), mask: ALL };
        for message in &file.messages {
            // placeholder message in which tools store signals without a message
            if message.name == "VECTOR__INDEPENDENT_SIG_MSG" {
                continue;
            }
            let signals = signals(&file, message).map_err(|(signal, cause)| DatabaseError::Signal {
                message: message.name.clone(),
                signal,
                cause,
            })?;
            read.add(key(message.id), Message { name: message.name.clone(), signals })?;
        }
        Ok(read)
    }

    fn add(&mut self, key: (bool, u32), message: Message) -> Result<(), DatabaseError> {
        let second = message.name.clone();
        match self.messages.insert(key, message) {
            Some(first) => Err(DatabaseError::Twice { first: first.name, second, mask: self.mask }),
            None => Ok(()),
        }
    }

    /// Restricts the comparison of identifiers to the bits that are set in `mask`, for example to apply the
    /// database of node 0 to all nodes.
    ///
    /// # Errors
    /// Returns an error if the identifiers of two messages differ only in ignored bits.
    pub fn with_mask(self, mask: u32) -> Result<Self, DatabaseError> {
        let mut masked = Self { messages: BTreeMap::new(), mask };
        for ((extended, id), message) in self.messages {
            masked.add((extended, id & mask), message)?;
        }
        Ok(masked)
    }

    /// Returns the number of messages.
    pub fn len(&self) -> usize {
        self.messages.len()
    }

    /// Returns `true` if the database has no messages.
    pub fn is_empty(&self) -> bool {
        self.messages.is_empty()
    }

    /// Decodes a frame; `None` if the database has no message with its identifier.
    pub fn decode(&self, frame: &Frame) -> Option<Decoded<'_>> {
        let (extended, id) = match frame.id {
            Id::Standard(id) => (false, u32::from(id)),
            Id::Extended(id) => (true, id),
        };
        let message = self.messages.get(&(extended, id & self.mask))?;
        let data = frame.data();
        let signals = message.signals.iter().filter(|signal| message.has(signal, data));
        let signals = signals.filter_map(|signal| signal.value(data));
        Some(Decoded { name: &message.name, signals: signals.collect() })
    }
}

fn key(id: MessageId) -> (bool, u32) {
    match id {
        MessageId::Standard(id) => (false, id.into()),
        MessageId::Extended(id) => (true, id & ALL),
    }
}

/// Returns the signals of a message, or the name of the first invalid signal and the reason.
fn signals(file: &Dbc, message: &can_dbc::Message) -> Result<Vec<Signal>, (String, String)> {
    let place = |name: &str| message.signals.iter().position(|signal| signal.name == name);
    let is_switch =
        |signal: &can_dbc::Signal| signal.multiplexer_indicator == MultiplexIndicator::Multiplexor;
    let main = message.signals.iter().position(is_switch);
    let read = |found: &can_dbc::Signal| {
        let refuse = |cause: String| Err((found.name.clone(), cause));
        let form = match file.extended_value_type_for_signal(message.id, &found.name) {
            Some(SignalExtendedValueType::IEEEfloat32Bit) => Form::Single,
            Some(SignalExtendedValueType::IEEEdouble64bit) => Form::Double,
            _ if found.value_type == ValueType::Signed => Form::Signed,
            _ => Form::Unsigned,
        };
        let bits = usize::try_from(found.size).unwrap_or(usize::MAX);
        let most = match form {
            Form::Single => 32..=32,
            Form::Double => 64..=64,
            Form::Unsigned | Form::Signed => 1..=64,
        };
        if !most.contains(&bits) {
            return refuse(format!("{bits} bits, expected {} to {}", most.start(), most.end()));
        }
        let extended = file
            .extended_multiplex
            .iter()
            .filter(|entry| entry.message_id == message.id && entry.signal_name == found.name);
        let mut switch: Option<(usize, Vec<RangeInclusive<u64>>)> = None;
        for entry in extended {
            let Some(at) = place(&entry.multiplexor_signal_name) else {
                return refuse(format!(
                    "its multiplexer `{}` is not a signal of the message",
                    entry.multiplexor_signal_name
                ));
            };
            let ranges = entry.mappings.iter().map(|values| values.min_value..=values.max_value);
            match &mut switch {
                Some((known, all)) if *known == at => all.extend(ranges),
                Some(_) => return refuse("it has two multiplexers".into()),
                None => switch = Some((at, ranges.collect())),
            }
        }
        if let (
            None,
            MultiplexIndicator::MultiplexedSignal(value)
            | MultiplexIndicator::MultiplexorAndMultiplexedSignal(value),
        ) = (&switch, found.multiplexer_indicator)
        {
            let Some(at) = main else { return refuse("its multiplexer is missing".into()) };
            switch = Some((at, vec![value..=value]));
        }
        let labels = file.value_descriptions_for_signal(message.id, &found.name).unwrap_or_default();
        let signal = Signal {
            name: found.name.clone(),
            unit: found.unit.clone(),
            start: usize::try_from(found.start_bit).unwrap_or(usize::MAX / 2),
            bits,
            order: found.byte_order,
            form,
            factor: found.factor,
            offset: found.offset,
            labels: labels.iter().map(|label| (label.id, label.description.clone())).collect(),
            switch,
        };
        let bytes = usize::try_from(message.size).unwrap_or(usize::MAX).min(64);
        if signal.end() > 8 * bytes {
            return refuse(format!(
                "its {bits} bits from bit {} on exceed the {bytes} bytes of the message",
                signal.start
            ));
        }
        if signal.factor == 0.0 {
            return refuse("its factor is 0, expected a number other than 0".into());
        }
        Ok(signal)
    };
    let signals = message.signals.iter().map(read).collect::<Result<Vec<Signal>, _>>()?;
    for (index, signal) in signals.iter().enumerate() {
        // multiplexed signals of one name are not in the same frame
        let is_same = |other: &Signal| other.name == signal.name && other.switch == signal.switch;
        if signals[..index].iter().any(is_same) {
            return Err((
                signal.name.clone(),
                "a second signal has this name, expected distinct names".into(),
            ));
        }
    }
    Ok(signals)
}

impl Message {
    /// Returns `true` if the data contains a signal: its multiplexer is present and has one of its values.
    fn has(&self, signal: &Signal, data: &[u8]) -> bool {
        let mut signal = signal;
        // Each multiplexer is visited at most once. Multiplexers that depend on each other in a cycle are
        // never present.
        for _ in 0..=self.signals.len() {
            let Some((at, values)) = &signal.switch else { return true };
            signal = &self.signals[*at];
            let has = |raw: u64| values.iter().any(|range| range.contains(&raw));
            if !signal.raw(data).is_some_and(has) {
                return false;
            }
        }
        false
    }
}

impl Signal {
    /// Returns the number of bits from the start of the data to the end of the signal, in transmission order.
    fn end(&self) -> usize {
        match self.order {
            ByteOrder::LittleEndian => self.start.saturating_add(self.bits),
            // a big-endian signal starts with its most significant bit and continues downwards in each byte
            ByteOrder::BigEndian => (self.start / 8 * 8 + 7 - self.start % 8).saturating_add(self.bits),
        }
    }

    /// Returns the raw bits; `None` if the data is too short.
    fn raw(&self, data: &[u8]) -> Option<u64> {
        if self.end() > 8 * data.len() {
            return None;
        }
        let bit = |at: usize| u64::from(data[at / 8] >> (at % 8) & 1);
        Some(match self.order {
            ByteOrder::LittleEndian => (0..self.bits).fold(0, |raw, i| raw | bit(self.start + i) << i),
            ByteOrder::BigEndian => {
                let first = self.end() - self.bits;
                (first..self.end()).fold(0, |raw, i| raw << 1 | bit(i / 8 * 8 + 7 - i % 8))
            }
        })
    }

    fn value(&self, data: &[u8]) -> Option<SignalValue<'_>> {
        let raw = self.raw(data)?;
        let spare = 64 - self.bits;
        let signed = (raw << spare) as i64 >> spare;
        let (number, whole) = match self.form {
            Form::Unsigned => (raw as f64, i64::try_from(raw).ok()),
            Form::Signed => (signed as f64, Some(signed)),
            Form::Single => (f32::from_bits(raw as u32).into(), None),
            Form::Double => (f64::from_bits(raw), None),
        };
        let exact = match self.form {
            Form::Unsigned => Some(i128::from(raw)),
            Form::Signed => Some(i128::from(signed)),
            Form::Single | Form::Double => None,
        };
        let scaled = exact.filter(|_| is_whole(self.factor) && is_whole(self.offset));
        let label = self.labels.iter().find(|(value, _)| Some(*value) == whole);
        Some(SignalValue {
            name: &self.name,
            value: number * self.factor + self.offset,
            whole: scaled.map(|number| number * self.factor as i128 + self.offset as i128),
            exact: exact.and_then(|number| Decimal::scaled(number, self.factor, self.offset)),
            // number of significant digits: 8 for 32-bit floating-point numbers, 15 otherwise
            digits: if self.form == Form::Single { 8 } else { 15 },
            unit: &self.unit,
            label: label.map(|(_, label)| label.as_str()),
        })
    }
}
