//! Reading CSV, JSON and JSON lines.

use std::path::Path;

use nalgebra::DMatrix;
use serde_json::Value;

use super::{Recording, RecordingError};

/// What of a file is wanted; [`Default`] takes what is likely.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Selection {
    /// Field of a state buffer whose numbers are the channels, such as `velocity`. Without it, `position` if there is one,
    /// else all numbers.
    pub field: Option<String>,
    /// Names of the channels to keep, in this order. Empty keeps all.
    pub channels: Vec<String>,
    /// Samples a second, when the file has no time.
    pub rate: Option<f64>,
}

const TIMES: [&str; 4] = ["time_s", "time", "t", "timestamp"];

/// One sample: its time, if it has one, and its numbers by name.
type Sample = (Option<f64>, Vec<(String, f64)>);

/// Reads a file by the ending of its name.
///
/// # Errors
/// [`RecordingError`] names the file and the line.
pub fn read(path: &Path, selection: &Selection) -> Result<Recording, RecordingError> {
    let name = path.display().to_string();
    let text = std::fs::read_to_string(path)
        .map_err(|source| RecordingError::System { path: name.clone(), source })?;
    read_text(&name, &text, selection)
}

/// Reads a text that stands in a file called `name`.
///
/// # Errors
/// As [`read`].
pub fn read_text(name: &str, text: &str, selection: &Selection) -> Result<Recording, RecordingError> {
    let ending = Path::new(name).extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    let samples = match ending {
        "csv" => csv(name, text)?,
        "json" => json(name, text, selection)?,
        "jsonl" | "ndjson" => json_lines(name, text, selection)?,
        _ => return Err(RecordingError::Format { path: name.to_string() }),
    };
    recording(name, samples, selection)
}

fn csv(name: &str, text: &str) -> Result<Vec<Sample>, RecordingError> {
    let mut lines = text.lines().enumerate().filter(|(_, line)| {
        let line = line.trim();
        !line.is_empty() && !line.starts_with('#')
    });
    let Some((_, header)) = lines.next() else {
        return Err(RecordingError::TooShort { found: 0, expected: 2 });
    };
    let separator = [',', ';', '\t'].into_iter().find(|mark| header.contains(*mark)).unwrap_or(',');
    let names: Vec<String> = header.split(separator).map(|cell| cell.trim().to_string()).collect();
    if names.iter().all(|cell| cell.parse::<f64>().is_ok()) {
        let message = "the first line holds numbers, expected the names of the columns".to_string();
        return Err(RecordingError::Malformed { place: format!("{name}: line 1"), message });
    }
    let mut samples = Vec::new();
    for (index, line) in lines {
        let place = || format!("{name}: line {}", index + 1);
        let cells: Vec<&str> = line.split(separator).map(str::trim).collect();
        if cells.len() != names.len() {
            let message = format!("{} cells, the header has {}", cells.len(), names.len());
            return Err(RecordingError::Malformed { place: place(), message });
        }
        let (mut time, mut numbers) = (None, Vec::new());
        for (column, cell) in names.iter().zip(cells) {
            let value: f64 = cell.parse().map_err(|_| {
                let message = format!("`{cell}` in column `{column}` is no number");
                RecordingError::Malformed { place: place(), message }
            })?;
            if time.is_none() && TIMES.contains(&column.as_str()) {
                time = Some(value);
            } else {
                numbers.push((column.clone(), value));
            }
        }
        samples.push((time, numbers));
    }
    Ok(samples)
}

fn json(name: &str, text: &str, selection: &Selection) -> Result<Vec<Sample>, RecordingError> {
    let malformed = |place: String, message: String| RecordingError::Malformed {
        place: format!("{name}: {place}"),
        message,
    };
    let value: Value = serde_json::from_str(text)
        .map_err(|error| malformed(format!("line {}", error.line()), error.to_string()))?;
    let Value::Array(list) = value else {
        return Err(malformed("line 1".into(), "expected a list of samples".into()));
    };
    let sample = |(index, value): (usize, &Value)| {
        sample(value, selection).map_err(|message| malformed(format!("sample {}", index + 1), message))
    };
    list.iter().enumerate().map(sample).collect()
}

fn json_lines(name: &str, text: &str, selection: &Selection) -> Result<Vec<Sample>, RecordingError> {
    let mut samples = Vec::new();
    for (index, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let malformed =
            |message| RecordingError::Malformed { place: format!("{name}: line {}", index + 1), message };
        let value = serde_json::from_str(line).map_err(|error| malformed(error.to_string()))?;
        samples.push(sample(&value, selection).map_err(malformed)?);
    }
    Ok(samples)
}

/// A sample of JSON: a list of numbers, an object, or an object with its numbers under `value` as topics are printed.
fn sample(value: &Value, selection: &Selection) -> Result<Sample, String> {
    if let Value::Array(numbers) = value {
        let numbers = numbers.iter().enumerate().map(|(i, value)| Ok((i.to_string(), number(value)?)));
        return Ok((None, numbers.collect::<Result<_, String>>()?));
    }
    let Value::Object(outer) = value else {
        return Err("expected a list of numbers or an object".into());
    };
    let time = TIMES.iter().find_map(|key| outer.get(*key)).map(number).transpose()?;
    let inner = match outer.get("value") {
        Some(Value::Object(inner)) => inner,
        _ => outer,
    };
    let fields: Vec<(&String, &Value)> = match &selection.field {
        Some(field) => match inner.get_key_value(field) {
            Some(entry) => vec![entry],
            None => {
                let known: Vec<&str> = inner.keys().map(String::as_str).collect();
                return Err(format!("no field `{field}`; there are {}", known.join(", ")));
            }
        },
        None => match inner.get_key_value("position") {
            Some(entry) => vec![entry],
            None => inner.iter().filter(|(key, _)| !TIMES.contains(&key.as_str())).collect(),
        },
    };
    let alone = fields.len() == 1;
    let mut numbers = Vec::new();
    for (key, value) in fields {
        match value {
            Value::Array(list) => {
                for (i, value) in list.iter().enumerate() {
                    let name = if alone { i.to_string() } else { format!("{key}[{i}]") };
                    numbers.push((name, number(value)?));
                }
            }
            value if value.is_number() => numbers.push((key.clone(), number(value)?)),
            // words and the like say nothing of a movement, unless they were asked for
            _ if alone => return Err(format!("`{key}` holds no numbers")),
            _ => {}
        }
    }
    Ok((time, numbers))
}

fn number(value: &Value) -> Result<f64, String> {
    value.as_f64().ok_or_else(|| format!("{value} is no number"))
}

fn recording(path: &str, samples: Vec<Sample>, selection: &Selection) -> Result<Recording, RecordingError> {
    let Some((first_time, first)) = samples.first() else {
        return Err(RecordingError::TooShort { found: 0, expected: 2 });
    };
    let names: Vec<String> = first.iter().map(|(name, _)| name.clone()).collect();
    let places: Vec<usize> = if selection.channels.is_empty() {
        (0..names.len()).collect()
    } else {
        let find = |name: &String| {
            names.iter().position(|known| known == name).ok_or_else(|| RecordingError::NoChannel {
                path: path.to_string(),
                name: name.clone(),
                known: names.join(", "),
            })
        };
        selection.channels.iter().map(find).collect::<Result<_, _>>()?
    };
    for (index, (time, numbers)) in samples.iter().enumerate() {
        let differs = numbers.len() != names.len() || numbers.iter().zip(&names).any(|((a, _), b)| a != b);
        if differs || time.is_some() != first_time.is_some() {
            let place = format!("{path}: sample {}", index + 1);
            let message =
                format!("{} channels unlike the {} of the first sample", numbers.len(), names.len());
            return Err(RecordingError::Malformed { place, message });
        }
    }
    let times: Vec<f64> = match (first_time, selection.rate) {
        (Some(_), _) => samples.iter().filter_map(|(time, _)| *time).collect(),
        (None, Some(rate)) if rate > 0.0 && rate.is_finite() => {
            (0..samples.len()).map(|k| k as f64 / rate).collect()
        }
        (None, Some(value)) => {
            let expected = "a positive number of samples a second";
            return Err(RecordingError::OutOfRange { name: "rate", value, expected });
        }
        (None, None) => return Err(RecordingError::NoTime { path: path.to_string() }),
    };
    let values = DMatrix::from_fn(samples.len(), places.len(), |k, c| samples[k].1[places[c]].1);
    Recording::new(places.into_iter().map(|place| names[place].clone()).collect(), times, values)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all() -> Selection {
        Selection::default()
    }

    #[test]
    fn a_table_is_read_by_its_header_in_any_of_the_usual_separators() {
        for mark in [",", ";", "\t"] {
            let text = "# by hand\ntime_s,a,b\n0.0,1,2\n0.5,3,4e-1\n\n".replace(',', mark);
            let recording = read_text("x.csv", &text, &all()).unwrap();
            assert_eq!(recording.names(), ["a", "b"]);
            assert_eq!(recording.times(), [0.0, 0.5]);
            assert_eq!(recording.values()[(1, 1)], 0.4);
        }
        let chosen = Selection { channels: vec!["b".into()], ..all() };
        let recording = read_text("x.csv", "t,a,b\n0,1,2\n1,3,4\n", &chosen).unwrap();
        assert_eq!(
            (recording.names(), recording.values().as_slice()),
            (&["b".to_string()][..], &[2.0, 4.0][..])
        );
    }

    #[test]
    fn a_topic_as_it_is_printed_is_read_with_the_field_that_is_wanted() {
        let line = |t: f64, x: f64| {
            format!(
                r#"{{"topic":"arm/joint_state","sequence":7,"time_s":{t},"origin":"encoder","value":{{"count":2,"position":[{x},2.0],"velocity":[9.0,{x}]}}}}"#
            )
        };
        let text = format!("{}\n{}\n", line(1.5, 0.25), line(1.75, 0.5));
        let recording = read_text("x.jsonl", &text, &all()).unwrap();
        assert_eq!((recording.times(), recording.names().len()), (&[1.5, 1.75][..], 2));
        assert_eq!(recording.values()[(1, 0)], 0.5);
        let velocity = Selection { field: Some("velocity".into()), ..all() };
        assert_eq!(read_text("x.jsonl", &text, &velocity).unwrap().values()[(0, 0)], 9.0);
        let wrong = Selection { field: Some("torque".into()), ..all() };
        let error = read_text("x.jsonl", &text, &wrong).unwrap_err().to_string();
        assert_eq!(error, "x.jsonl: line 1: no field `torque`; there are count, position, velocity");
    }

    #[test]
    fn lists_without_time_need_a_rate() {
        let text = "[[1, 2], [3, 4], [5, 6]]";
        assert!(matches!(read_text("x.json", text, &all()), Err(RecordingError::NoTime { .. })));
        let timed = Selection { rate: Some(50.0), ..all() };
        assert_eq!(read_text("x.json", text, &timed).unwrap().times(), [0.0, 0.02, 0.04]);
    }

    #[test]
    fn a_torn_line_is_refused_with_its_number() {
        let text = "{\"t\": 0, \"x\": 1}\n{\"t\": 1, \"x\":";
        let error = read_text("x.jsonl", text, &all()).unwrap_err().to_string();
        assert!(error.starts_with("x.jsonl: line 2: EOF"), "{error}");
        let error = read_text("x.csv", "t,a\n0,1\n1\n", &all()).unwrap_err().to_string();
        assert_eq!(error, "x.csv: line 3: 1 cells, the header has 2");
        let error = read_text("x.csv", "t,a\n0,1\n1,one\n", &all()).unwrap_err().to_string();
        assert_eq!(error, "x.csv: line 3: `one` in column `a` is no number");
    }
}
