//! Progress and outcome of a recording.

use std::sync::{Mutex, PoisonError};

use super::settings::{Counts, RecordError};

/// Totals of a recording so far.
#[derive(Debug, Clone, Default)]
pub(super) struct Outcome {
    pub(super) counts: Counts,
    /// Processor time of the reader and the writer thread, ns; `None` in lockstep.
    pub(super) cpu_ns: [Option<u64>; 2],
    /// Reason why the recording ended before the run.
    pub(super) ended: Option<String>,
}

/// Updates the outcome of a recording, and reports a recording that ended before the run.
pub(super) fn note(outcome: &Mutex<Outcome>, counts: Option<Counts>, ended: Result<Counts, RecordError>) {
    let mut outcome = outcome.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(counts) = counts {
        outcome.counts = counts;
    }
    match ended {
        Ok(counts) => outcome.counts = counts,
        Err(error) => {
            eprintln!(
                "the recording has ended, but the run continues: {error}; `motorium recover` repairs its file"
            );
            outcome.ended = Some(error.to_string());
        }
    }
}
