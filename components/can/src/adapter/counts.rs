//! The counts of one drive.

/// Counts of one drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Frames that were not answered before its first answer: it was waited for.
    pub awaited: u64,
    /// Frames since then that were not answered before the next one was sent.
    pub missing: u64,
    /// Answers to an earlier frame than the last.
    pub late: u64,
    /// Answers beyond the first to one frame.
    pub duplicate: u64,
    /// Frames of it that could not be decoded.
    pub refused: u64,
    /// Frames with a position or velocity that the joint cannot have: they are refused, too.
    pub implausible: u64,
    /// Emergency messages with an error code.
    pub emergencies: u64,
    /// Commands of which a field lay beyond its range.
    pub clamped: u64,
    /// Times that it was lost.
    pub lost: u64,
    /// The cycle in which it was lost last, from 1.
    pub lost_in: Option<u64>,
    /// Times that it reported a fault.
    pub faults: u64,
}
