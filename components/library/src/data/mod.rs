//! Recordings from files.
//!
//! - **JSONL** (one object a line) and **JSON** (one object, an array of them, or `{"recordings": [...]}`). In an object,
//!   each array of numbers is a degree of freedom under its key; or `positions` is an array of samples, with `names`.
//!   Arrays whose keys all begin with `v` (`vx`, `vy`) are velocities and are summed up. `label` or `letter` is the
//!   kind of movement, `id` or `demo` its name. `duration` (s), or `rate` (Hz), says how long it takes.
//! - **CSV**: one recording a file; a header line with the names, then numbers. Lines that begin with `#` are skipped. A
//!   column `t` or `time` (s), or `frame_dt` or `dt` (s, from row to row), says when; the name of the file is the id.
//!
//! Where nothing says how long a recording takes, [`Options::rate`] does.

mod csv;
mod json;

use std::path::{Path, PathBuf};

use crate::{Recordings, Trajectory};

/// How files are read.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Samples per second where a recording does not say.
    pub rate: f64,
    /// The degrees of freedom to take, by name (or beginning and `*`), in their order in the file; all if empty.
    pub columns: Vec<String>,
}

impl Default for Options {
    fn default() -> Self {
        Self { rate: 100.0, columns: Vec::new() }
    }
}

/// A file that holds no recordings.
#[derive(Debug, thiserror::Error)]
pub enum DataError {
    /// The file system refused.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What it said.
        source: std::io::Error,
    },
    /// Something in the file is not right.
    #[error("{path}, line {line}: {found}")]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What was found, what was expected.
        found: String,
    },
    /// No known ending.
    #[error("{0}: expected a .jsonl, .json or .csv file, or a folder with some")]
    Kind(PathBuf),
    /// Nothing in it.
    #[error("{0}: no recording in it")]
    Empty(PathBuf),
    /// Recordings of other degrees of freedom than the first.
    #[error(
        "recording `{id}` has the degrees of freedom {found}, the first {expected}: choose common ones by name"
    )]
    Names {
        /// Which.
        id: String,
        /// Its names.
        found: String,
        /// Those of the first.
        expected: String,
    },
}

/// One recording as it was read, with the names of its degrees of freedom.
type Named = (Vec<String>, Trajectory);

/// Reads all recordings of a file, or of the files in a folder, in the order of their names.
///
/// # Errors
/// The first thing that is not right, with its file and line.
pub fn read(path: &Path, options: &Options) -> Result<Recordings, DataError> {
    let io = |source| DataError::Io { path: path.to_path_buf(), source };
    let mut files = vec![path.to_path_buf()];
    if path.is_dir() {
        files = Vec::new();
        for entry in std::fs::read_dir(path).map_err(io)? {
            let file = entry.map_err(io)?.path();
            if kind(&file).is_some() {
                files.push(file);
            }
        }
        files.sort();
    }
    let mut all: Option<Recordings> = None;
    for file in &files {
        let text =
            std::fs::read_to_string(file).map_err(|source| DataError::Io { path: file.clone(), source })?;
        let found = match kind(file) {
            Some("csv") => vec![csv::recording(file, &text, options)?],
            Some("json") => json::recordings(file, &text, options)?,
            Some(_) => json::lines(file, &text, options)?,
            None => return Err(DataError::Kind(file.clone())),
        };
        for (names, trajectory) in found {
            let all =
                all.get_or_insert_with(|| Recordings { names: names.clone(), trajectories: Vec::new() });
            if all.names != names {
                let (found, expected) = (names.join(", "), all.names.join(", "));
                return Err(DataError::Names { id: trajectory.id, found, expected });
            }
            all.trajectories.push(trajectory);
        }
    }
    all.ok_or_else(|| DataError::Empty(path.to_path_buf()))
}

fn kind(path: &Path) -> Option<&'static str> {
    let ending = path.extension()?.to_str()?;
    ["csv", "json", "jsonl"].into_iter().find(|known| *known == ending)
}

/// Keeps the columns that are asked for.
fn choose(columns: Vec<(String, Vec<f64>)>, options: &Options) -> Vec<(String, Vec<f64>)> {
    let asked = |name: &str| {
        options.columns.iter().any(|pattern| match pattern.strip_suffix('*') {
            Some(beginning) => name.starts_with(beginning),
            None => name == pattern,
        })
    };
    columns.into_iter().filter(|(name, _)| options.columns.is_empty() || asked(name)).collect()
}

/// A recording out of its columns, or what is wrong with them.
fn assemble(
    columns: Vec<(String, Vec<f64>)>,
    (id, label): (String, Option<String>),
    duration: Option<f64>,
    options: &Options,
) -> Result<Named, String> {
    let columns = choose(columns, options);
    let Some((first, rest)) = columns.split_first() else {
        return Err("no degree of freedom, expected arrays of numbers (or other names in the choice)".into());
    };
    let samples = first.1.len();
    if let Some((name, values)) = rest.iter().find(|(_, values)| values.len() != samples) {
        return Err(format!("`{name}` has {} samples, `{}` {samples}", values.len(), first.0));
    }
    if samples < 2 {
        return Err(format!("{samples} samples, expected at least 2"));
    }
    let duration = duration.unwrap_or((samples - 1) as f64 / options.rate);
    let names: Vec<String> = columns.iter().map(|(name, _)| name.clone()).collect();
    let values = columns.into_iter().flat_map(|(_, values)| values);
    let positions = nalgebra::DMatrix::from_iterator(samples, names.len(), values);
    Ok((names, Trajectory { id, label, duration, positions }))
}
