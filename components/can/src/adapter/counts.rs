//! Per-drive counters.

/// Counters of one drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Number of unanswered frames before the first answer, while the adapter waits for the drive.
    pub awaited: u64,
    /// Number of frames after the first answer that were not answered before the next frame was sent.
    pub missing: u64,
    /// Number of late answers: the drive answered a frame that was no longer the latest one sent to it.
    pub late: u64,
    /// Number of additional answers to a frame that has already been answered.
    pub duplicate: u64,
    /// Number of frames from the drive that could not be decoded.
    pub refused: u64,
    /// Number of frames with an implausible position or velocity of the joint; also counted in `refused`.
    pub implausible: u64,
    /// Number of emergency messages with an error code.
    pub emergencies: u64,
    /// Number of commands with a field beyond its range.
    pub clamped: u64,
    /// Number of times that the drive was lost.
    pub lost: u64,
    /// Cycle in which the drive was last lost, counted from 1; `None` if it was never lost.
    pub lost_in: Option<u64>,
    /// Number of times that the drive reported a fault.
    pub faults: u64,
}
