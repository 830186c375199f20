//! Truncation of the eigenforces.

use motorium_algebra::Wanted;

/// Number of eigenforces that a library keeps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Truncation {
    /// All that are not rounding.
    All,
    /// A number of eigenforces at most.
    Rank(usize),
    /// The fewest that leave at most this part of the root mean square of the forces (of the responses, in
    /// [`Metric::Position`](super::Metric::Position)): 0.05 keeps all but 5 %.
    Error(f64),
    /// As many as fit into a number of bytes, `8 (rows + 1)` each.
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
