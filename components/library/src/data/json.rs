//! Recordings as JSON.

use std::path::Path;

use serde_json::{Map, Value};

use super::{DataError, Named, Options, assemble};

/// One recording a line.
pub(super) fn lines(path: &Path, text: &str, options: &Options) -> Result<Vec<Named>, DataError> {
    let mut all = Vec::new();
    for (number, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let at = |found: String| DataError::Line { path: path.to_path_buf(), line: number + 1, found };
        let value: Value = serde_json::from_str(line).map_err(|error| at(error.to_string()))?;
        all.push(recording(&value, number, options).map_err(at)?);
    }
    Ok(all)
}

/// A whole file.
pub(super) fn recordings(path: &Path, text: &str, options: &Options) -> Result<Vec<Named>, DataError> {
    let at = |line: usize, found: String| DataError::Line { path: path.to_path_buf(), line, found };
    let value: Value = serde_json::from_str(text).map_err(|error| at(error.line(), error.to_string()))?;
    let list = value.get("recordings").unwrap_or(&value);
    let one = std::slice::from_ref(list);
    let list = list.as_array().map_or(one, Vec::as_slice);
    let read = |(number, value)| {
        recording(value, number, options).map_err(|found| at(1, format!("recording {number}: {found}")))
    };
    list.iter().enumerate().map(read).collect()
}

fn recording(value: &Value, number: usize, options: &Options) -> Result<Named, String> {
    let object = value.as_object().ok_or("expected an object with arrays of numbers")?;
    let label = ["label", "letter"].iter().find_map(|key| object.get(*key)).map(text);
    let id = match (object.get("id"), object.get("demo"), &label) {
        (Some(id), _, _) => text(id),
        (None, Some(demo), Some(label)) => format!("{label}-{}", text(demo)),
        (None, Some(demo), None) => text(demo),
        (None, None, _) => number.to_string(),
    };
    let rate = object.get("rate").and_then(Value::as_f64).unwrap_or(options.rate);
    let mut columns = columns(object)?;
    if columns.len() > 1 && columns.iter().all(|(name, _)| name.len() > 1 && name.starts_with('v')) {
        for (name, values) in &mut columns {
            name.remove(0);
            let mut sum = 0.0;
            values.iter_mut().for_each(|value| {
                sum += *value / rate;
                *value = sum;
            });
        }
    }
    let samples = columns.first().map_or(0, |(_, values)| values.len());
    let duration = object.get("duration").and_then(Value::as_f64);
    let duration = duration.or((samples > 1).then(|| (samples - 1) as f64 / rate));
    assemble(columns, (id, label), duration, options)
}

fn columns(object: &Map<String, Value>) -> Result<Vec<(String, Vec<f64>)>, String> {
    if let Some(rows) = object.get("positions") {
        let rows = rows.as_array().ok_or("`positions` is no array of samples")?;
        let rows: Vec<Vec<f64>> =
            rows.iter().map(numbers).collect::<Option<_>>().ok_or("`positions` holds what is no number")?;
        let names = object.get("names").and_then(Value::as_array);
        let names: Vec<String> = names.map(|names| names.iter().map(text).collect()).unwrap_or_default();
        let width = rows.first().map_or(0, Vec::len);
        if let Some(k) = rows.iter().position(|row| row.len() != width) {
            return Err(format!("sample {k} has {} numbers, the first {width}", rows[k].len()));
        }
        if !names.is_empty() && names.len() != width {
            return Err(format!("{} names for samples of {width} numbers", names.len()));
        }
        let name = |d: usize| names.get(d).cloned().unwrap_or_else(|| format!("q{d}"));
        return Ok((0..width).map(|d| (name(d), rows.iter().map(|row| row[d]).collect())).collect());
    }
    let arrays = object.iter().filter(|(_, value)| value.is_array());
    arrays
        .map(|(name, value)| {
            let values = numbers(value).ok_or_else(|| format!("`{name}` holds what is no number"))?;
            Ok((name.clone(), values))
        })
        .collect()
}

fn numbers(value: &Value) -> Option<Vec<f64>> {
    value.as_array()?.iter().map(Value::as_f64).collect()
}

fn text(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_string)
}
