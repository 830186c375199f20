//! Recordings as comma-separated values.

use std::path::Path;

use super::{DataError, Named, Options, assemble};

pub(super) fn recording(path: &Path, text: &str, options: &Options) -> Result<Named, DataError> {
    let at = |line: usize, found: String| DataError::Line { path: path.to_path_buf(), line: line + 1, found };
    let plain = |(_, line): &(usize, &str)| !line.trim().is_empty() && !line.starts_with('#');
    let mut lines = text.lines().enumerate().filter(plain);
    let (_, header) = lines.next().ok_or_else(|| DataError::Empty(path.to_path_buf()))?;
    let names: Vec<&str> = header.split(',').map(str::trim).collect();
    let mut columns: Vec<(String, Vec<f64>)> =
        names.iter().map(|name| ((*name).to_string(), Vec::new())).collect();
    for (number, line) in lines {
        let fields: Vec<&str> = line.split(',').map(str::trim).collect();
        if fields.len() != names.len() {
            return Err(at(number, format!("{} fields, the header has {}", fields.len(), names.len())));
        }
        for ((name, values), field) in columns.iter_mut().zip(fields) {
            let value =
                field.parse().map_err(|_| at(number, format!("`{name}` is `{field}`, expected a number")))?;
            values.push(value);
        }
    }
    let mut duration = None;
    columns.retain(|(name, values)| match name.as_str() {
        "t" | "time" => {
            duration = values.last().zip(values.first()).map(|(last, first)| last - first);
            false
        }
        "frame_dt" | "dt" => {
            duration = Some(values[..values.len().saturating_sub(1)].iter().sum());
            false
        }
        _ => true,
    });
    let id = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    assemble(columns, (id, None), duration, options).map_err(|found| at(0, found))
}
