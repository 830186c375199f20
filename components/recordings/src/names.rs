//! Recognition of column names: times, velocities, and the channels that a caller selects.

use crate::error::{Place, RecordingError};
use crate::selection::Selection;
use crate::time::{Clock, Unit};

/// Names of a column or field that contains the time, in s or in a unit recognised by magnitude. The first
/// existing one is used.
pub(crate) const TIME: [&str; 8] =
    ["time_s", "time", "t", "timestamp", "timestamp_s", "__time", "log_time", "%time"];
/// Prefixes of names that are followed by a unit.
const TIME_IN: [&str; 3] = ["time", "t", "timestamp"];
/// Suffixes of time names with their unit in s.
const UNITS: [(&str, f64); 4] = [("_s", 1.0), ("_ms", 1e-3), ("_us", 1e-6), ("_ns", 1e-9)];
/// Names of a column or field that contains the time from its sample to the next, s.
pub(crate) const STEP: [&str; 3] = ["dt_s", "dt", "frame_dt"];
/// Columns of a table written by `motorium export`, in addition to the time and the fields of the samples.
const EXPORTED: [&str; 4] = ["sequence", "publish_time_ns", "source_time_ns", "episode"];

/// Returns the unit of a time column with this name; `None` if it is not a time column.
fn time_unit(name: &str) -> Option<Unit> {
    let name = usual(name);
    if TIME.contains(&name.as_str()) {
        return Some(if name.ends_with("_s") { Unit::Named(1.0) } else { Unit::Recognised });
    }
    let (_, seconds) = UNITS
        .into_iter()
        .find(|(end, _)| name.strip_suffix(end).is_some_and(|beginning| TIME_IN.contains(&beginning)))?;
    Some(Unit::Named(seconds))
}

/// Returns the name in the usual spelling: `time_ms` for `Time [ms]`, `Time (ms)` and `Time ms`. A `T` is a
/// temperature or a torque.
fn usual(name: &str) -> String {
    let name = name.trim();
    let is_word = |rest: &str| rest.starts_with(|letter: char| letter.is_ascii_alphabetic());
    let is_symbol = name.strip_prefix('T').is_some_and(|rest| !is_word(rest));
    let name = if is_symbol { name.to_string() } else { name.to_lowercase() };
    let Some((beginning, unit)) = name.split_once([' ', '[', '(']) else { return name };
    let unit = unit.trim_matches([' ', '[', ']', '(', ')']);
    let unit = match unit {
        "sec" | "seconds" => "s",
        unit => unit,
    };
    format!("{}_{unit}", beginning.trim())
}

/// Returns the unit of a time-step column with this name; `None` if it is not one.
fn step_unit(name: &str) -> Option<Unit> {
    let name = usual(name);
    let named = if name == "dt_s" { Unit::Named(1.0) } else { Unit::Recognised };
    STEP.contains(&name.as_str()).then_some(named)
}

/// The columns of a table that form a recording.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Columns {
    /// Source of the times; `None` if neither the table nor the selection has one.
    pub(crate) clock: Option<Clock>,
    /// Index and name of every channel.
    pub(crate) channels: Vec<(usize, String)>,
}

pub(crate) fn is_time(name: &str) -> bool {
    time_unit(name).is_some() || step_unit(name).is_some()
}

impl Columns {
    /// Selects the columns of a table with these names.
    pub(crate) fn select(
        place: &Place,
        names: &[String],
        selection: &Selection,
    ) -> Result<Self, RecordingError> {
        for (index, name) in names.iter().enumerate() {
            if names[..index].contains(name) {
                return Err(RecordingError::Malformed {
                    place: Box::new(place.clone().column(index + 1, name)),
                    found: format!("a second column `{name}`"),
                    expected: "a distinct name for each column".into(),
                    advice: None,
                });
            }
        }
        let position = |wanted: &&str| names.iter().position(|name| name == wanted);
        let find = |unit: fn(&str) -> Option<Unit>| {
            names.iter().enumerate().find_map(|(index, name)| Some((index, unit(name)?)))
        };
        let exact = TIME.iter().find_map(position).and_then(|index| Some((index, time_unit(&names[index])?)));
        let clock = match (exact.or_else(|| find(time_unit)), find(step_unit)) {
            (Some((index, unit)), _) => Some(Clock::Time(index, unit)),
            (None, Some((index, unit))) => Some(Clock::Step(index, unit)),
            (None, None) => selection.clock()?,
        };
        let is_exported = EXPORTED.iter().all(|name| position(name).is_some());
        let is_other = |name: &str| is_time(name) || (is_exported && EXPORTED.contains(&name));
        let all: Vec<(usize, &String)> =
            names.iter().enumerate().filter(|(_, name)| !is_other(name)).collect();
        let usual = match entries_of_field(&all, selection.field.as_deref()) {
            Some(entries) => entries,
            None => channels_of_field(place, &all, selection.field.as_deref())?,
        };
        let channels = if selection.channels.is_empty() {
            usual
        } else {
            // a channel selected by its full name need not be among the default ones
            let every: Vec<(usize, String)> = match &selection.field {
                None => {
                    let full = all.iter().map(|(index, name)| (*index, (*name).clone()));
                    let others: Vec<_> = full.filter(|channel| !usual.contains(channel)).collect();
                    usual.into_iter().chain(others).collect()
                }
                Some(_) => usual,
            };
            chosen(place, &every, &selection.channels)?
        };
        if channels.is_empty() {
            return Err(RecordingError::Malformed {
                place: Box::new(place.clone()),
                found: "no channel".into(),
                expected: "columns or fields of numbers besides the time".into(),
                advice: None,
            });
        }
        Ok(Self { clock, channels })
    }
}

/// Returns the entries of a field of an exported topic, such as `position[0]` or `position[elbow]`. The
/// default field is the position. Named entries get their name.
fn entries_of_field(all: &[(usize, &String)], field: Option<&str>) -> Option<Vec<(usize, String)>> {
    let field = field.unwrap_or("position");
    let entries = all.iter().filter_map(|(index, name)| {
        let entry = name.strip_prefix(field)?.strip_prefix('[')?.strip_suffix(']')?;
        let is_number = entry.parse::<usize>().is_ok();
        Some((*index, if is_number { (*name).clone() } else { entry.to_string() }))
    });
    let entries: Vec<(usize, String)> = entries.collect();
    (!entries.is_empty()).then_some(entries)
}

/// Returns the channels of a field; without a field, all channels except velocities of other channels.
fn channels_of_field(
    place: &Place,
    all: &[(usize, &String)],
    field: Option<&str>,
) -> Result<Vec<(usize, String)>, RecordingError> {
    let is_there = |name: &str| all.iter().any(|(_, known)| *known == name);
    let velocity_of = |name: &str| name.strip_suffix("_velocity").is_some_and(is_there);
    let Some(field) = field.filter(|field| *field != "position") else {
        let positions = all.iter().filter(|(_, name)| !velocity_of(name));
        return Ok(positions.map(|(index, name)| (*index, (*name).clone())).collect());
    };
    let suffix = format!("_{field}");
    let found: Vec<(usize, String)> = all
        .iter()
        .filter_map(|(index, name)| name.strip_suffix(&suffix).map(|base| (*index, base.to_string())))
        .collect();
    if found.is_empty() {
        let known: Vec<&str> = all.iter().map(|(_, name)| name.as_str()).collect();
        return Err(RecordingError::NoChannel {
            path: place.to_string(),
            name: format!("NAME{suffix}"),
            known: known.join(", "),
        });
    }
    Ok(found)
}

/// Returns the channels that match the patterns, in the order of the patterns; a pattern may end in `*` to
/// match a prefix.
pub(crate) fn chosen(
    place: &Place,
    all: &[(usize, String)],
    patterns: &[String],
) -> Result<Vec<(usize, String)>, RecordingError> {
    let mut channels: Vec<(usize, String)> = Vec::new();
    for pattern in patterns {
        let matches = |name: &str| match pattern.strip_suffix('*') {
            Some(beginning) => name.starts_with(beginning),
            None => name == pattern,
        };
        let found: Vec<_> = all.iter().filter(|(_, name)| matches(name)).collect();
        if found.is_empty() {
            let known: Vec<&str> = all.iter().map(|(_, name)| name.as_str()).collect();
            return Err(RecordingError::NoChannel {
                path: place.path.clone(),
                name: pattern.clone(),
                known: known.join(", "),
            });
        }
        for channel in found {
            if !channels.contains(channel) {
                channels.push(channel.clone());
            }
        }
    }
    Ok(channels)
}
