//! Pairs of colliders that may touch.

use super::parties::Parties;

/// Distances beyond the margin are measured up to this value \[m\], so that they need no new measurement for
/// a while.
pub(super) const AHEAD: f64 = 0.05;

/// Two colliders that may touch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair {
    /// Index in the pairs of the collision model.
    pub(super) index: usize,
    pub(super) first: usize,
    pub(super) second: usize,
    /// Origins farther apart than this distance are not near each other \[m\]; infinite for a half-space.
    pub(super) reach: f64,
    pub(super) half_space: bool,
    /// The kinds of parties.
    pub(super) parties: Parties,
    /// Index of the applicable motion bound.
    pub(super) part: usize,
    /// The pair needs no measurement until the sum of both travelled distances reaches this \[m\].
    pub(super) until: f64,
}
