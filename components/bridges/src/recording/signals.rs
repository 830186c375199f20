//! Signals of a recording: numbers over time.

use std::ops::Range;
use std::str::FromStr;

use motorium::nearest::suggest;
use motorium::state::{DecodeError, Decoder, FieldValue, Number};

use super::{ReadError, Recording};

/// Selection of the numbers of a topic, such as `panda/joint_state.position[0..7]`,
/// `panda/joint_state.position[2]` or `panda/target.position`. The name of the topic alone selects all its
/// numbers.
///
/// ```
/// use motorium_bridges::recording::Signal;
///
/// let signal: Signal = "panda/joint_state.position[0..7]".parse().unwrap();
/// assert_eq!((signal.topic.as_str(), signal.field.as_deref()), ("panda/joint_state", Some("position")));
/// assert_eq!(signal.entries, Some(0..7));
/// assert!("panda/joint_state.position[7..0]".parse::<Signal>().is_err());
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Signal {
    /// Name of the topic.
    pub topic: String,
    /// Name of the field; all fields if `None`.
    pub field: Option<String>,
    /// Range of entries of an array; all used entries if `None`.
    pub entries: Option<Range<usize>>,
}

/// The text is not a signal.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{0}` is not a signal: expected TOPIC.FIELD, TOPIC.FIELD[I] or TOPIC.FIELD[A..B], such as panda/joint_state.position[0..7]"
)]
pub struct SignalError(String);

impl FromStr for Signal {
    type Err = SignalError;

    fn from_str(text: &str) -> Result<Self, SignalError> {
        let wrong = || SignalError(text.to_string());
        let (name, entries) = match text.strip_suffix(']').map(|text| text.split_once('[').ok_or_else(wrong))
        {
            None => (text, None),
            Some(parts) => {
                let (name, entries) = parts?;
                let number = |text: &str| text.trim().parse::<usize>().map_err(|_| wrong());
                let range = match entries.split_once("..") {
                    Some((first, end)) => number(first)?..number(end)?,
                    None => number(entries)?..number(entries)?.checked_add(1).ok_or_else(wrong)?,
                };
                if range.is_empty() {
                    return Err(wrong());
                }
                (name, Some(range))
            }
        };
        let (topic, field) = match name.split_once('.') {
            Some((topic, field)) => (topic, Some(field.to_string())),
            None => (name, None),
        };
        if topic.is_empty()
            || field.as_ref().is_some_and(String::is_empty)
            || (field.is_none() && entries.is_some())
        {
            return Err(wrong());
        }
        Ok(Self { topic: topic.to_string(), field, entries })
    }
}

/// Values of one number over time.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Name of the curve, such as `panda/joint_state.position[2]`.
    pub name: String,
    /// Index of the array entry; `None` for a single number.
    pub entry: Option<usize>,
    /// Name of the array entry, if the sample contains one.
    pub label: Option<String>,
    /// Points: time since the first sample of the recording \[s\], and value.
    pub points: Vec<(f64, f64)>,
}

/// The signals cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum SignalsError {
    /// The recording cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A sample cannot be read.
    #[error(transparent)]
    Decode(#[from] DecodeError),
    /// The recording has no topic with this name.
    #[error("the recording has no topic `{topic}`; {advice}")]
    NoTopic {
        /// Name of the topic.
        topic: String,
        /// Similar topic, or all topics.
        advice: String,
    },
    /// The topic has no field with this name.
    #[error("topic `{topic}` has no field `{field}`; {advice}")]
    NoField {
        /// Name of the topic.
        topic: String,
        /// Name of the field.
        field: String,
        /// Similar field, or all fields.
        advice: String,
    },
    /// No sample has the requested entries.
    #[error(
        "`{name}` has {} in this recording, found {}..{}; entries are counted from 0, and the end is exclusive",
        counted(*.most), .entries.start, .entries.end
    )]
    NoEntry {
        /// Names of the topic and the field.
        name: String,
        /// Maximum number of entries in a sample.
        most: usize,
        /// Requested entries.
        entries: Range<usize>,
    },
    /// The field contains no numbers.
    #[error(
        "`{name}` has no numbers in this recording, because it is a text or an array without used entries"
    )]
    NoNumbers {
        /// Names of the topic and the field.
        name: String,
    },
    /// The recording has no sample of a topic.
    #[error("the recording has no samples of topic `{0}`")]
    NoSample(String),
}

fn counted(entries: usize) -> String {
    match entries {
        0 => "no entries".to_string(),
        1 => "one entry".to_string(),
        many => format!("{many} entries"),
    }
}

/// Converts a number to floating point.
pub(super) fn as_f64(number: Number) -> f64 {
    match number {
        Number::Natural(number) => number as f64,
        Number::Integer(number) => number as f64,
        Number::Double(number) => number,
        Number::Single(number) => f64::from(number),
    }
}

/// Returns the curves of signals, in the order of the signals. An array has one curve per entry.
///
/// # Errors
/// Returns an error if a topic, field or entry of a signal is missing from the recording, if a topic has no
/// samples, or if the recording cannot be read.
pub fn curves(recording: &Recording, signals: &[Signal]) -> Result<Vec<Curve>, SignalsError> {
    let mut wanted = Vec::new();
    for signal in signals {
        let topics = recording.topics();
        let index = recording.topic(&signal.topic).ok_or_else(|| SignalsError::NoTopic {
            topic: signal.topic.clone(),
            advice: suggest(&signal.topic, topics.iter().map(|topic| topic.name.as_str()), "its topics are"),
        })?;
        let layout = &topics[index].layout;
        let names =
            || layout.fields.iter().map(|field| field.name.as_str()).filter(|name| *name != "reserved");
        if let Some(field) = &signal.field
            && !names().any(|name| name == field)
        {
            let (topic, field) = (signal.topic.clone(), field.clone());
            let advice = suggest(&field, names(), "its fields are");
            return Err(SignalsError::NoField { topic, field, advice });
        }
        wanted.push((signal, index, Decoder::new(layout)?, Vec::<Curve>::new(), None));
    }
    let mut begin_ns = None;
    for sample in recording.samples() {
        let sample = sample?;
        let begin_ns = *begin_ns.get_or_insert(sample.time_ns);
        // Floating-point numbers round times since 1970 to fractions of a microsecond. Messages may be out of
        // order.
        let time = (sample.time_ns as i64 - begin_ns as i64) as f64 * 1e-9;
        let of_topic = wanted.iter_mut().filter(|(_, index, ..)| *index == sample.topic);
        for (signal, _, decoder, curves, most) in of_topic {
            for (field, value) in &decoder.decode(&sample.bytes)?.0 {
                if signal.field.as_deref().is_some_and(|wanted| wanted != *field) {
                    continue;
                }
                let many = matches!(value, FieldValue::Many(_));
                *most = (*most).max(Some(value.numbers().len()));
                for (entry, number) in value.numbers().iter().enumerate() {
                    if many && signal.entries.as_ref().is_some_and(|entries| !entries.contains(&entry)) {
                        continue;
                    }
                    let entry = many.then_some(entry);
                    let name = match entry {
                        Some(entry) => format!("{}.{field}[{entry}]", signal.topic),
                        None => format!("{}.{field}", signal.topic),
                    };
                    let place = curves.iter().position(|curve| curve.name == name).unwrap_or_else(|| {
                        curves.push(Curve { name, entry, label: None, points: Vec::new() });
                        curves.len() - 1
                    });
                    curves[place].points.push((time, as_f64(*number)));
                }
            }
        }
    }
    for (signal, _, _, _, most) in &wanted {
        match (most, &signal.entries, &signal.field) {
            (None, ..) => return Err(SignalsError::NoSample(signal.topic.clone())),
            (Some(0), _, Some(field)) => {
                return Err(SignalsError::NoNumbers { name: format!("{}.{field}", signal.topic) });
            }
            (Some(most), Some(entries), Some(field)) if entries.end > *most => {
                let name = format!("{}.{field}", signal.topic);
                return Err(SignalsError::NoEntry { name, most: *most, entries: entries.clone() });
            }
            _ => {}
        }
    }
    Ok(wanted.into_iter().flat_map(|(_, _, _, curves, _)| curves).collect())
}

impl Curve {
    /// Returns the points of the curve, thinned to at most `points`. A curve with more points is divided into
    /// time intervals, each represented by its minimum and maximum.
    #[must_use]
    pub fn thinned(&self, points: usize) -> Vec<(f64, f64)> {
        if self.points.len() <= points {
            return self.points.clone();
        }
        let times = || self.points.iter().map(|(time, _)| *time);
        let ends = (times().fold(f64::INFINITY, f64::min), times().fold(f64::NEG_INFINITY, f64::max));
        let mut envelope = Envelope::new(ends, points / 2);
        self.points.iter().for_each(|(time, value)| envelope.take(*time, *value));
        envelope.points()
    }
}

/// Minimum and maximum of a curve in each time interval. An envelope reduces a curve of any length to at most
/// two points per interval, for drawing.
///
/// ```
/// use motorium_bridges::recording::Envelope;
///
/// let mut envelope = Envelope::new((0.0, 1.0), 10);
/// (0..=1000).for_each(|sample| envelope.take(1e-3 * f64::from(sample), f64::from(sample % 7)));
/// assert_eq!(envelope.points().len(), 20);
/// ```
#[derive(Debug, Clone, Default)]
pub struct Envelope {
    begin: f64,
    /// Intervals per second.
    rate: f64,
    /// Points with the minimum and the maximum of each interval.
    stretches: Vec<Option<[(f64, f64); 2]>>,
}

impl Envelope {
    /// Creates an empty envelope with `stretches` intervals (at least one) between two times, s. Earlier
    /// values are added to the first interval, later values to the last.
    pub fn new((begin, end): (f64, f64), stretches: usize) -> Self {
        let stretches = vec![None; stretches.max(1)];
        let rate = if end > begin { stretches.len() as f64 / (end - begin) } else { 0.0 };
        Self { begin, rate, stretches }
    }

    /// Adds a value at a time, s. Times may be in any order.
    pub fn take(&mut self, time: f64, value: f64) {
        // The conversion clamps negative numbers to 0.
        let index = ((time - self.begin) * self.rate) as usize;
        let last = self.stretches.len() - 1;
        match &mut self.stretches[index.min(last)] {
            empty @ None => *empty = Some([(time, value); 2]),
            Some([least, greatest]) => {
                if value < least.1 {
                    *least = (time, value);
                }
                if value > greatest.1 {
                    *greatest = (time, value);
                }
            }
        }
    }

    /// Returns the points in time order: one or two per interval with values.
    pub fn points(&self) -> Vec<(f64, f64)> {
        let mut points = Vec::with_capacity(2 * self.stretches.len());
        for [least, greatest] in self.stretches.iter().flatten() {
            let (first, second) = if least.0 <= greatest.0 { (least, greatest) } else { (greatest, least) };
            points.push(*first);
            if second != first {
                points.push(*second);
            }
        }
        points
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimated_curve_keeps_its_peaks() {
        let points: Vec<(f64, f64)> = (0..10_000).map(|i| (f64::from(i), f64::from(i % 7))).collect();
        let mut curve = Curve { name: String::new(), entry: None, label: None, points };
        curve.points[5_432].1 = 99.0;
        curve.points[7_001].1 = -99.0;
        let thinned = curve.thinned(500);
        assert!(thinned.len() <= 502, "{}", thinned.len());
        assert!(thinned.contains(&(5_432.0, 99.0)) && thinned.contains(&(7_001.0, -99.0)));
        assert!(thinned.is_sorted_by(|a, b| a.0 < b.0));
    }
}
