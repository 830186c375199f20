//! Names of columns: times, velocities, and the channels a caller selects.

use crate::error::{Place, RecordingError};
use crate::read::Selection;

/// Names of a column or field that holds the time, s; the first of them that exists is taken.
pub(crate) const TIME: [&str; 4] = ["time_s", "time", "t", "timestamp"];
/// Names of a column or field that holds the time from its sample to the next, s.
pub(crate) const STEP: [&str; 3] = ["dt_s", "dt", "frame_dt"];

/// The column that times come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Clock {
    /// Index of a column of times, s.
    Time(usize),
    /// Index of a column of time steps, s.
    Step(usize),
    /// A number of samples a second.
    Rate(f64),
}

/// The columns of a table that make a recording.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Columns {
    /// Source of the times; `None` if neither the table nor the selection has one.
    pub(crate) clock: Option<Clock>,
    /// Index and name of every channel.
    pub(crate) channels: Vec<(usize, String)>,
}

pub(crate) fn is_time(name: &str) -> bool {
    TIME.contains(&name) || STEP.contains(&name)
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
                    expected: "a name of its own for each column".into(),
                    advice: None,
                });
            }
        }
        let find =
            |known: &[&str]| known.iter().find_map(|wanted| names.iter().position(|name| name == wanted));
        let clock = match (find(&TIME), find(&STEP)) {
            (Some(index), _) => Some(Clock::Time(index)),
            (None, Some(index)) => Some(Clock::Step(index)),
            (None, None) => selection.clock()?,
        };
        let all: Vec<(usize, &String)> =
            names.iter().enumerate().filter(|(_, name)| !is_time(name)).collect();
        let usual = channels_of_field(place, &all, selection.field.as_deref())?;
        let channels = if selection.channels.is_empty() {
            usual
        } else {
            // a channel asked for by its full name need not be among the usual ones
            let every: Vec<(usize, String)> = match &selection.field {
                None => all.iter().map(|(index, name)| (*index, (*name).clone())).collect(),
                Some(_) => usual,
            };
            chosen(place, &every, &selection.channels)?
        };
        if channels.is_empty() {
            return Err(RecordingError::Malformed {
                place: Box::new(place.clone()),
                found: "no channel".into(),
                expected: "columns or fields of numbers beside the time".into(),
                advice: None,
            });
        }
        Ok(Self { clock, channels })
    }
}

/// The channels of a field: without one, all but the velocities of other channels.
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

/// The channels that match the patterns, in the order of the patterns; `*` ends a pattern that is a beginning.
fn chosen(
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
