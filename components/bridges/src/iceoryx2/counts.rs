//! Counters for the values of an inbound topic, one for each outcome.

use motorium::raw::RawError;
use motorium::state::ContentDefect;
use serde::Serialize;

/// Counts of values that were not published, by reason.
#[derive(Debug, Default, Serialize)]
pub(super) struct Refused {
    pub(super) above_max_rate: u64,
    pub(super) too_old: u64,
    not_finite: u64,
    count_too_large: u64,
    too_late: u64,
    /// Slices only.
    #[serde(skip_serializing_if = "Option::is_none")]
    too_long: Option<u64>,
}

impl Refused {
    /// Counts for slices, which may be too long.
    pub(super) fn of_slices() -> Self {
        Self { too_long: Some(0), ..Self::default() }
    }

    /// Counts a value with invalid content, which must not reach a reader.
    pub(super) fn defective(&mut self, defect: ContentDefect) {
        match defect {
            ContentDefect::NotFinite { .. } => self.not_finite += 1,
            // the size equals the service's type size, which iceoryx2 compares when a program opens it
            ContentDefect::Count { .. } | ContentDefect::Size { .. } => self.count_too_large += 1,
        }
    }

    /// Counts a slice that is longer than declared.
    pub(super) fn too_long(&mut self) {
        *self.too_long.get_or_insert(0) += 1;
    }

    /// Counts a value that an output did not publish.
    pub(super) fn unpublished(&mut self, error: RawError) {
        match error {
            RawError::Content(defect) => self.defective(defect),
            RawError::Length { .. } => self.too_long(),
            // The time of a step is never in the future. If readers hold all samples of a stream, the value
            // counts as too late.
            RawError::Late | RawError::SourceInFuture { .. } | RawError::NotSent => self.too_late += 1,
        }
    }
}
