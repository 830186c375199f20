//! Tables of samples, and their conversion to recordings.

use nalgebra::DMatrix;

use crate::Recording;
use crate::error::{Place, RecordingError};
use crate::names::Columns;
use crate::time::timed;

/// Samples of a file: position in the file, number in the time column if present, and channels.
pub(crate) struct Table {
    pub(crate) columns: Columns,
    pub(crate) rows: Vec<(Place, Option<f64>, Vec<f64>)>,
}

impl Table {
    pub(crate) fn recording(self, path: &str) -> Result<Recording, RecordingError> {
        let Self { columns, rows } = self;
        if rows.len() < 2 {
            return Err(RecordingError::Malformed {
                place: Box::new(Place::file(path)),
                found: format!("{} samples", rows.len()),
                expected: "at least 2".into(),
                advice: None,
            });
        }
        let clock = columns.clock.ok_or_else(|| RecordingError::NoTime { path: path.to_string() })?;
        let times = timed(clock, rows.iter().map(|(place, time, _)| (place.clone(), *time)))?;
        let values = DMatrix::from_fn(rows.len(), columns.channels.len(), |k, c| rows[k].2[c]);
        Recording::new(columns.channels.into_iter().map(|(_, name)| name).collect(), times, values)
    }
}
