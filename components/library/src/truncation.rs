//! Truncation of the eigenforces.

use motorium_algebra::Wanted;

/// Rule for the number of eigenforces that a library keeps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Truncation {
    /// All eigenforces above rounding.
    All,
    /// At most this number of eigenforces.
    Rank(usize),
    /// The smallest number of eigenforces that leaves at most this fraction of the root mean square of the
    /// forces (of the responses, in [`Metric::Position`](super::Metric::Position)). For example, 0.05 leaves
    /// at most 5 %.
    Error(f64),
    /// The largest number of eigenforces that fits into this number of bytes, with `8 (rows + 1)` bytes each.
    Bytes(usize),
}

impl Truncation {
    pub(super) fn wanted(self, rows: usize) -> Wanted {
        match self {
            Self::All => Wanted::All,
            Self::Rank(rank) => Wanted::Rank(rank.max(1)),
            Self::Error(error) => Wanted::Residual(error * error),
            Self::Bytes(bytes) => Wanted::Rank((bytes / (8 * (rows + 1))).max(1)),
        }
    }
}
