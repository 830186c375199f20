//! Functions that read recordings from files and folders.

use std::path::{Path, PathBuf};

use motorium_robots::read_bounded;

use crate::error::{Place, RecordingError};
use crate::movement::movement;
use crate::{Recording, Selection, csv, json};

/// Maximum size of a file, bytes: about an hour of forty joints at 1 kHz as text.
const LONGEST: u64 = 2 * 1024 * 1024 * 1024;

/// Extension of MCAP files.
const MCAP: &str = "mcap";

/// Reads a file that contains a single recording.
///
/// # Errors
/// Returns a [`RecordingError`] with the file, the line and the column. A file with several recordings is an
/// error.
pub fn read(path: &Path, selection: &Selection) -> Result<Recording, RecordingError> {
    single(&path.display().to_string(), read_file(path, selection)?)
}

/// Parses `text` that contains a single recording. `name` is the file name, whose extension selects the
/// format.
///
/// # Errors
/// Same as [`read`].
pub fn read_text(name: &str, text: &str, selection: &Selection) -> Result<Recording, RecordingError> {
    single(name, parse(name, text, selection)?)
}

/// Reads all recordings of a file, or of the files in a folder in alphabetical order.
///
/// # Errors
/// Returns a [`RecordingError`] with the file, the line and the column. A file or folder without recordings
/// is an error.
pub fn read_all(path: &Path, selection: &Selection) -> Result<Vec<Recording>, RecordingError> {
    let system = |source| RecordingError::System { path: path.display().to_string(), source };
    let mut files = vec![path.to_path_buf()];
    if path.is_dir() {
        let entries = std::fs::read_dir(path).map_err(system)?;
        let all: Vec<PathBuf> =
            entries.map(|entry| Ok(entry.map_err(system)?.path())).collect::<Result<_, RecordingError>>()?;
        files = all.into_iter().filter(|file| is_recording(file)).collect();
        files.sort();
    }
    let mut recordings = Vec::new();
    for file in &files {
        recordings.extend(read_file(file, selection)?);
    }
    if recordings.is_empty() {
        let path = path.display().to_string();
        return Err(RecordingError::Count { path, found: 0, expected: "at least one" });
    }
    Ok(recordings)
}

/// Returns `true` if a file name has the extension of a recording.
pub fn is_recording(path: &Path) -> bool {
    matches!(ending(path), "csv" | "tsv" | "json" | "jsonl" | "ndjson" | MCAP)
}

fn ending(path: &Path) -> &str {
    path.extension().and_then(|ending| ending.to_str()).unwrap_or_default()
}

fn single(path: &str, mut recordings: Vec<Recording>) -> Result<Recording, RecordingError> {
    match (recordings.pop(), recordings.len()) {
        (Some(recording), 0) => Ok(recording),
        (None, _) => Err(RecordingError::TooShort { found: 0, expected: 2 }),
        (Some(_), others) => {
            Err(RecordingError::Count { path: path.into(), found: others + 1, expected: "one" })
        }
    }
}

fn read_file(path: &Path, selection: &Selection) -> Result<Vec<Recording>, RecordingError> {
    let name = path.display().to_string();
    let bytes = read_bounded(path, LONGEST)
        .map_err(|source| RecordingError::System { path: name.clone(), source })?;
    if ending(path) == MCAP {
        let mut recording = movement(&name, bytes, selection)?;
        recording.id = stem(path);
        return Ok(vec![recording]);
    }
    let text = String::from_utf8(bytes).map_err(|error| {
        let valid = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let line = 1 + valid.iter().filter(|byte| **byte == b'\n').count();
        RecordingError::Malformed {
            place: Box::new(Place::line(&name, line)),
            found: "invalid bytes".into(),
            expected: "UTF-8 text".into(),
            advice: None,
        }
    })?;
    parse(&name, &text, selection)
}

fn parse(name: &str, text: &str, selection: &Selection) -> Result<Vec<Recording>, RecordingError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let path = Path::new(name);
    let mut recordings = match ending(path) {
        "csv" => vec![csv::table(name, text, None, selection)?.recording(name)?],
        "tsv" => vec![csv::table(name, text, Some(b'\t'), selection)?.recording(name)?],
        "json" => json::recordings(name, &json::file(name, text)?, selection)?,
        "jsonl" | "ndjson" => json::recordings(name, &json::lines(name, text)?, selection)?,
        _ => return Err(RecordingError::Format { path: name.to_string() }),
    };
    for recording in &mut recordings {
        if recording.id.is_empty() {
            recording.id = stem(path);
        }
    }
    Ok(recordings)
}

/// Returns the name of a file without folder and extension.
fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned())
}
