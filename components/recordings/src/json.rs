//! JSON and JSON lines: samples or whole recordings.

use serde_json::{Map, Value};

use crate::Recording;
use crate::error::{Place, RecordingError};
use crate::names::{Columns, is_time};
use crate::selection::Selection;
use crate::table::Table;
use crate::time::{Clock, timed};

/// A JSON value with its position in the file.
type Item = (Place, Value);

/// Reads one value per line.
pub(crate) fn lines(path: &str, text: &str) -> Result<Vec<Item>, RecordingError> {
    let mut items = Vec::new();
    for (index, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let value = serde_json::from_str(line).map_err(|error| syntax(path, index, &error))?;
        items.push((Place::line(path, index + 1), value));
    }
    Ok(items)
}

/// Reads a file that contains a list, a recording, or an object with a list `recordings`.
pub(crate) fn file(path: &str, text: &str) -> Result<Vec<Item>, RecordingError> {
    let mut value: Value = serde_json::from_str(text).map_err(|error| syntax(path, 0, &error))?;
    if let Some(list) = value.get_mut("recordings") {
        value = list.take();
    }
    match value {
        Value::Array(list) => {
            let place = |index: usize| Place::item(path, "item", index + 1);
            Ok(list.into_iter().enumerate().map(|(index, value)| (place(index), value)).collect())
        }
        value => Ok(vec![(Place::file(path), value)]),
    }
}

fn syntax(path: &str, lines_before: usize, error: &serde_json::Error) -> RecordingError {
    let message = error.to_string();
    // `Place` already reports the position
    let said = message.split(" at line ").next().unwrap_or_default();
    RecordingError::Malformed {
        place: Box::new(Place::line(path, lines_before + error.line().max(1)).column(error.column(), "")),
        found: said.to_string(),
        expected: "JSON".into(),
        advice: error.is_eof().then_some("the text is truncated"),
    }
}

/// Converts JSON values to recordings: either each value is a recording, or each is a sample of a single one.
pub(crate) fn recordings(
    path: &str,
    items: &[Item],
    selection: &Selection,
) -> Result<Vec<Recording>, RecordingError> {
    let Some((_, first)) = items.first() else { return Ok(Vec::new()) };
    if is_sample(first, selection) {
        return Ok(vec![samples(path, items, selection)?]);
    }
    let recording = |(index, (place, value)): (usize, &Item)| match value {
        Value::Object(object) if !is_sample(value, selection) => whole(place, object, index, selection),
        _ => Err(malformed(place, "a sample among recordings".into(), "an object with arrays of numbers")),
    };
    items.iter().enumerate().map(recording).collect()
}

/// Returns `true` for a sample: a list, or an object with a time, a field `value` or `position`, or single
/// numbers only.
fn is_sample(value: &Value, selection: &Selection) -> bool {
    let Value::Object(object) = value else { return true };
    if object.get("positions").is_some_and(Value::is_array) {
        return false;
    }
    let has_time = object.iter().any(|(key, value)| is_time(key) && value.is_number());
    let is_topic = object.get("value").is_some_and(Value::is_object);
    has_time
        || is_topic
        || selection.field.is_some()
        || object.contains_key("position")
        || !object.values().any(Value::is_array)
}

fn malformed(place: &Place, found: String, expected: &str) -> RecordingError {
    RecordingError::Malformed {
        place: Box::new(place.clone()),
        found,
        expected: expected.into(),
        advice: None,
    }
}

/// Reads one recording whose samples are JSON values.
fn samples(path: &str, items: &[Item], selection: &Selection) -> Result<Recording, RecordingError> {
    let mut header: Option<(Vec<String>, Columns)> = None;
    let mut rows = Vec::new();
    for (place, value) in items {
        let fields = sample(place, value, selection)?;
        if header.is_none() {
            let names: Vec<String> = fields.iter().map(|(name, _)| name.clone()).collect();
            // the field has already been selected
            let rest = Selection { field: None, ..selection.clone() };
            let columns = Columns::select(place, &names, &rest)?;
            header = Some((names, columns));
        }
        let Some((names, columns)) = &header else { continue };
        if fields.len() != names.len() || fields.iter().zip(names).any(|((name, _), known)| name != known) {
            let found: Vec<&str> = fields.iter().map(|(name, _)| name.as_str()).collect();
            let expected = format!("{}, as in the first sample", names.join(", "));
            return Err(malformed(place, found.join(", "), &expected));
        }
        let time = match columns.clock {
            Some(Clock::Time(index, _) | Clock::Step(index, _)) => Some(fields[index].1),
            _ => None,
        };
        let values = columns.channels.iter().map(|(index, _)| fields[*index].1).collect();
        rows.push((place.clone(), time, values));
    }
    let Some((_, columns)) = header else {
        return Err(RecordingError::TooShort { found: 0, expected: 2 });
    };
    Table { columns, rows }.recording(path)
}

/// Returns the names and numbers of a sample. The sample is a list, an object, or an object under `value` as
/// `motorium topic echo` prints it.
fn sample(place: &Place, value: &Value, selection: &Selection) -> Result<Vec<(String, f64)>, RecordingError> {
    if let Value::Array(numbers) = value {
        let numbers = numbers.iter().enumerate();
        return numbers.map(|(i, value)| Ok((i.to_string(), number(place, value)?))).collect();
    }
    let Value::Object(outer) = value else {
        return Err(malformed(place, value.to_string(), "a list of numbers or an object"));
    };
    let mut fields = Vec::new();
    for (key, value) in outer.iter().filter(|(key, _)| is_time(key)) {
        fields.push((key.clone(), number(place, value)?));
    }
    let inner = match outer.get("value") {
        Some(Value::Object(inner)) => inner,
        _ => outer,
    };
    let chosen: Vec<(&String, &Value)> = match &selection.field {
        Some(field) => match inner.get_key_value(field) {
            Some(entry) => vec![entry],
            None => {
                let known: Vec<&str> = inner.keys().map(String::as_str).collect();
                return Err(RecordingError::NoChannel {
                    path: place.to_string(),
                    name: field.clone(),
                    known: known.join(", "),
                });
            }
        },
        None => match inner.get_key_value("position") {
            Some(entry) => vec![entry],
            None => inner.iter().filter(|(key, _)| !is_time(key)).collect(),
        },
    };
    let alone = chosen.len() == 1;
    for (key, value) in chosen {
        match value {
            Value::Array(list) => {
                for (i, value) in list.iter().enumerate() {
                    let name = if alone { i.to_string() } else { format!("{key}[{i}]") };
                    fields.push((name, number(place, value)?));
                }
            }
            value if value.is_number() => fields.push((key.clone(), number(place, value)?)),
            _ if alone => return Err(malformed(place, format!("no number in `{key}`"), "numbers")),
            // text next to numbers
            _ => {}
        }
    }
    Ok(fields)
}

fn number(place: &Place, value: &Value) -> Result<f64, RecordingError> {
    match value.as_f64() {
        Some(number) if number.is_finite() => Ok(number),
        _ => Err(malformed(place, format!("`{value}`"), "a finite number")),
    }
}

/// Reads a recording that is one object: arrays of numbers by name, or `positions` with `names`.
fn whole(
    place: &Place,
    object: &Map<String, Value>,
    index: usize,
    selection: &Selection,
) -> Result<Recording, RecordingError> {
    let label = ["label", "letter"].iter().find_map(|key| object.get(*key)).map(text);
    let id = match (object.get("id"), object.get("demo"), &label) {
        (Some(id), _, _) => text(id),
        (None, Some(demo), Some(label)) => format!("{label}-{}", text(demo)),
        (None, Some(demo), None) => text(demo),
        (None, None, _) => index.to_string(),
    };
    let all = arrays(place, object)?;
    let names: Vec<String> = all.iter().map(|(name, _)| name.clone()).collect();
    let columns = Columns::select(place, &names, &Selection { rate: None, ..selection.clone() })?;
    let samples = all[columns.channels[0].0].1.len();
    for (name, values) in &all {
        if values.len() != samples {
            let found = format!("{} samples of `{name}`", values.len());
            return Err(malformed(place, found, &format!("{samples}, as in `{}`", columns.channels[0].1)));
        }
    }
    if samples < 2 {
        return Err(malformed(place, format!("{samples} samples"), "at least 2"));
    }
    let scalar = |key: &str| object.get(key).map(|value| number(place, value)).transpose();
    let given = match (scalar("rate")?, scalar("duration")?) {
        (Some(rate), Some(duration)) if !agree(rate, samples, duration) => {
            let found = format!("{samples} samples, a `rate` of {rate} Hz and a `duration` of {duration} s");
            return Err(malformed(place, found, "a rate and a duration that agree, or one of them"));
        }
        (_, Some(duration)) => Some((samples - 1) as f64 / duration),
        (rate, None) => rate,
    };
    let (clock, times) = match columns.clock {
        Some(clock @ (Clock::Time(index, _) | Clock::Step(index, _))) => (clock, Some(&all[index].1)),
        _ => {
            let clock = match given {
                Some(rate) if rate > 0.0 && rate.is_finite() => Some(Clock::Rate(rate)),
                Some(rate) => {
                    let found = format!("{rate} samples a second");
                    return Err(malformed(place, found, "a positive `rate` or `duration`"));
                }
                None => selection.clock()?,
            };
            (clock.ok_or_else(|| RecordingError::NoTime { path: place.path.clone() })?, None)
        }
    };
    let places = (0..samples).map(|k| (place.clone(), times.map(|times| times[k])));
    let times = timed(clock, places)?;
    let mut channels: Vec<(String, Vec<f64>)> =
        columns.channels.iter().map(|(index, name)| (name.clone(), all[*index].1.clone())).collect();
    if channels.len() > 1 && channels.iter().all(|(name, _)| is_velocity(name)) {
        channels.iter_mut().for_each(|channel| integrate(channel, &times));
    }
    let (names, values): (Vec<String>, Vec<Vec<f64>>) = channels.into_iter().unzip();
    let values = nalgebra::DMatrix::from_iterator(samples, names.len(), values.into_iter().flatten());
    Ok(Recording { id, label, ..Recording::new(names, times, values)? })
}

/// Returns `true` if this number of samples lasts `duration` s at `rate` Hz, to within one sample and 1 %.
fn agree(rate: f64, samples: usize, duration: f64) -> bool {
    (rate * duration - (samples - 1) as f64).abs() <= 1.0 + 0.01 * samples as f64
}

/// Returns `true` for `vx`, `v1`, `v_x` and `vjoint1`. Words without a number, such as `voltage`, are not
/// velocities.
fn is_velocity(name: &str) -> bool {
    let Some(channel) = name.strip_prefix('v') else { return false };
    let channel = channel.strip_prefix('_').unwrap_or(channel);
    let number = channel.trim_start_matches(|letter: char| letter.is_ascii_alphabetic());
    let letters = channel.len() - number.len();
    let is_numbered = !number.is_empty() && number.bytes().all(|digit| digit.is_ascii_digit());
    is_numbered || (letters == 1 && number.is_empty())
}

/// Integrates a velocity `vNAME` to the position `NAME`: each sample adds its velocity times the time since
/// the previous sample.
fn integrate((name, values): &mut (String, Vec<f64>), times: &[f64]) {
    *name = name[1..].trim_start_matches('_').to_string();
    let mut sum = 0.0;
    for (k, value) in values.iter_mut().enumerate() {
        let step = if k == 0 { times[1] - times[0] } else { times[k] - times[k - 1] };
        sum += *value * step;
        *value = sum;
    }
}

fn arrays(place: &Place, object: &Map<String, Value>) -> Result<Vec<(String, Vec<f64>)>, RecordingError> {
    let numbers = |name: &str, value: &Value| -> Result<Vec<f64>, RecordingError> {
        let list =
            value.as_array().ok_or_else(|| malformed(place, format!("`{name}`: {value}"), "an array"))?;
        list.iter().map(|value| number(place, value)).collect()
    };
    let Some(rows) = object.get("positions") else {
        let arrays = object.iter().filter(|(_, value)| value.is_array());
        return arrays.map(|(name, value)| Ok((name.clone(), numbers(name, value)?))).collect();
    };
    let rows =
        rows.as_array().ok_or_else(|| malformed(place, "`positions`".into(), "an array of samples"))?;
    let rows: Vec<Vec<f64>> = rows.iter().map(|row| numbers("positions", row)).collect::<Result<_, _>>()?;
    let names = object.get("names").and_then(Value::as_array);
    let names: Vec<String> = names.map(|names| names.iter().map(text).collect()).unwrap_or_default();
    let width = rows.first().map_or(0, Vec::len);
    if let Some(k) = rows.iter().position(|row| row.len() != width) {
        let found = format!("{} numbers in sample {}", rows[k].len(), k + 1);
        return Err(malformed(place, found, &format!("{width}, as in the first sample")));
    }
    if !names.is_empty() && names.len() != width {
        let found = format!("{} names", names.len());
        return Err(malformed(place, found, &format!("{width}, one for each number of a sample")));
    }
    let name = |d: usize| names.get(d).cloned().unwrap_or_else(|| format!("q{d}"));
    let mut all: Vec<(String, Vec<f64>)> =
        (0..width).map(|d| (name(d), rows.iter().map(|row| row[d]).collect())).collect();
    for (key, value) in object.iter().filter(|(key, value)| is_time(key) && value.is_array()) {
        all.push((key.clone(), numbers(key, value)?));
    }
    Ok(all)
}

fn text(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_string)
}
