//! Movements in MCAP files: the numbers of one channel over time.

use nalgebra::DMatrix;

use crate::error::{Place, RecordingError};
use crate::messages::{Channel, LogError, MessageLog, Value, metadata};
use crate::names::chosen;
use crate::{Recording, Selection};

/// Representation of measured joint positions in a message.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Joints {
    /// Arrays of names and numbers: `sensor_msgs/msg/JointState`, `motorium.JointState`.
    Arrays,
    /// An array with one table for each joint: `foxglove.JointStates`.
    Tables,
}

impl Joints {
    fn held_by(channel: &Channel) -> Option<Self> {
        match channel.schema.as_ref()?.short_name() {
            "JointState" => Some(Self::Arrays),
            "JointStates" => Some(Self::Tables),
            _ => None,
        }
    }
}

/// Reads the movement of the selected channel, or of the only channel with numbers in the field.
pub(crate) fn movement(
    path: &str,
    bytes: Vec<u8>,
    selection: &Selection,
) -> Result<Recording, RecordingError> {
    let wrong = |reason| RecordingError::Messages { path: path.to_string(), reason: Box::new(reason) };
    let log = MessageLog::new(bytes).map_err(wrong)?;
    let field = selection.field.as_deref().unwrap_or("position");
    let channel = match &selection.topic {
        Some(topic) => log.channel(topic).map_err(wrong)?.0,
        None => usual(&log, field).map_err(wrong)?,
    };
    let Samples { names, rows } = samples(path, &log, channel, field, &selection.channels)?;
    let first = rows.first().map_or(0, |(time_ns, _)| *time_ns);
    let times = rows.iter().map(|(time_ns, _)| (time_ns - first) as f64 * 1e-9).collect();
    let values = DMatrix::from_fn(rows.len(), names.len(), |k, c| rows[k].1[c]);
    Recording::new(names, times, values)
}

/// Returns the names and numbers in a field of a message. The field is an array of numbers, a table of
/// numbers, or a number in each table of an array.
fn numbers(message: &Value, field: &str) -> Option<Vec<(String, f64)>> {
    if let Some(value) = message.get(field) {
        if let Value::Record(fields) = value {
            let number = |(name, value): &(std::sync::Arc<str>, Value)| match value {
                Value::Number(number) => Some((name.to_string(), number.as_f64())),
                _ => None,
            };
            return fields.iter().map(number).collect();
        }
        let numbers = value.numbers().filter(|numbers| !numbers.is_empty())?;
        let names: Vec<String> = match message.names_of(field) {
            Some(names) => names.into_iter().map(str::to_string).collect(),
            None => (0..numbers.len()).map(|entry| format!("{field}[{entry}]")).collect(),
        };
        return Some(names.into_iter().zip(numbers).collect());
    }
    let Value::Record(fields) = message else { return None };
    fields.iter().find_map(|(name, value)| {
        let Value::List(entries) = value else { return None };
        let number = |(index, entry): (usize, &Value)| {
            let Value::Number(number) = entry.get(field)? else { return None };
            let label = match entry.get("name") {
                Some(Value::Text(text)) => text.clone(),
                _ => format!("{name}[{index}].{field}"),
            };
            Some((label, number.as_f64()))
        };
        let found: Option<Vec<_>> = entries.iter().enumerate().map(number).collect();
        found.filter(|found| !found.is_empty())
    })
}

/// Returns the index of the only channel whose first message has numbers in the field. If there are several,
/// returns the only one with joint states.
fn usual<B: AsRef<[u8]>>(log: &MessageLog<B>, field: &str) -> Result<usize, LogError> {
    let mut is_seen = vec![false; log.channels().len()];
    let mut found = Vec::new();
    for message in log.messages() {
        if std::mem::replace(&mut is_seen[message.channel], true) {
            continue;
        }
        let channel = &log.channels()[message.channel];
        // Visualisations of a topic repeat its numbers.
        let is_drawing = channel.metadata.contains_key(metadata::TOPIC)
            && !channel.metadata.contains_key(metadata::LAYOUT);
        let Some(decoder) = channel.decoder.as_ref().ok().filter(|_| !is_drawing) else { continue };
        if decoder.decode(&message.data).is_ok_and(|value| numbers(&value, field).is_some()) {
            found.push(message.channel);
        }
    }
    let is_state = |index: &&usize| Joints::held_by(&log.channels()[**index]).is_some();
    let states: Vec<usize> = found.iter().filter(is_state).copied().collect();
    match (states.as_slice(), found.as_slice()) {
        ([only], _) | ([], [only]) => Ok(*only),
        (states, found) => {
            let found = if states.is_empty() { found } else { states };
            Err(LogError::Choice {
                field: field.to_string(),
                found: found.iter().map(|index| format!("`{}`", log.channels()[*index].topic)).collect(),
                known: log.described(),
            })
        }
    }
}

/// Samples of a movement, ordered by time.
struct Samples {
    names: Vec<String>,
    rows: Vec<(u64, Vec<f64>)>,
}

fn samples<B: AsRef<[u8]>>(
    path: &str,
    log: &MessageLog<B>,
    channel: usize,
    field: &str,
    selected: &[String],
) -> Result<Samples, RecordingError> {
    let wrong = |reason| RecordingError::Messages { path: path.to_string(), reason: Box::new(reason) };
    let decoder = log.decoder(channel).map_err(wrong)?;
    let topic = &log.channels()[channel].topic;
    let labels = labels(log, channel);
    let mut names: Option<Vec<String>> = None;
    let mut unmatched = None;
    let mut rows = Vec::new();
    let of_channel = log.messages().filter(|message| message.channel == channel);
    for (message, number) in of_channel.zip(1..) {
        let value = decoder.decode(&message.data).map_err(|reason| {
            wrong(LogError::Damaged { topic: topic.clone(), number, reason: reason.to_string() })
        })?;
        let mut found = numbers(&value, field).unwrap_or_default();
        if let Some(labels) = labels.as_ref().filter(|labels| labels.len() == found.len()) {
            found.iter_mut().zip(labels).for_each(|((name, _), label)| name.clone_from(label));
        }
        let known = match &names {
            Some(names) => names,
            None => {
                let all: Vec<_> = found.iter().map(|(name, _)| name.clone()).enumerate().collect();
                let wanted =
                    if selected.is_empty() { Ok(all) } else { chosen(&Place::file(path), &all, selected) };
                match wanted {
                    Ok(wanted) => names.insert(wanted.into_iter().map(|(_, name)| name).collect()),
                    Err(error) => {
                        unmatched = Some(error);
                        continue;
                    }
                }
            }
        };
        let row: Option<Vec<f64>> = known
            .iter()
            .map(|name| found.iter().find(|(known, _)| known == name).map(|(_, number)| *number))
            .collect();
        let is_complete = row.as_ref().is_some_and(|row| row.len() == found.len() && !row.is_empty());
        match row {
            Some(row) if is_complete || !selected.is_empty() => rows.push((message.time_ns, row)),
            // Several robots may publish parts of the joints on one channel.
            None if !selected.is_empty() => {}
            _ => {
                let listed = |names: Vec<&str>| match names.is_empty() {
                    true => format!("no numbers `{field}`"),
                    false => names.join(", "),
                };
                return Err(wrong(LogError::Uneven {
                    topic: topic.clone(),
                    number,
                    found: listed(found.iter().map(|(name, _)| name.as_str()).collect()),
                    expected: listed(known.iter().map(String::as_str).collect()),
                }));
            }
        }
    }
    match (names, unmatched) {
        (None, Some(error)) => Err(error),
        (names, _) => {
            rows.sort_by_key(|(time_ns, _)| *time_ns);
            Ok(Samples { names: names.unwrap_or_default(), rows })
        }
    }
}

/// Returns the joint names of a motorium topic, from the visualisation of its joints.
fn labels<B: AsRef<[u8]>>(log: &MessageLog<B>, channel: usize) -> Option<Vec<String>> {
    let exact = &log.channels()[channel];
    exact.metadata.get(metadata::LAYOUT)?;
    let drawing = log.channels().iter().position(|known| {
        Joints::held_by(known) == Some(Joints::Tables)
            && known.metadata.get(metadata::TOPIC) == Some(&exact.topic)
    })?;
    let message = log.messages().find(|message| message.channel == drawing)?;
    let value = log.decoder(drawing).ok()?.decode(&message.data).ok()?;
    let joints = numbers(&value, "position")?;
    Some(joints.into_iter().map(|(name, _)| name).collect())
}
