//! The header of every sample.

#[cfg(doc)]
use super::StateBuffer;

/// Maximum time that a stamp may be ahead of the clock, ns, because clock readings of two cores differ
/// slightly.
pub const FUTURE_TOLERANCE_NS: u64 = 1_000_000;

crate::state_buffer! {
    /// The header of a sample: its number, its times and its publisher. The user header of every
    /// [`StateBuffer`] sample.
    ///
    /// Times are nanoseconds on `CLOCK_MONOTONIC`, or simulated nanoseconds since the start in lockstep.
    pub struct Stamp as "motorium.Stamp" {
        /// Sequence number of the sample within its publisher, from 1; 0 is never published.
        pub sequence: u64,
        /// Time of publication of the sample at the head of the chain, or the time passed to
        /// `Loan::publish_from`. A sample computed from an input has the input's source time, so
        /// `publish_time - source_time` is the latency of the whole chain so far.
        pub source_time: u64,
        /// Publication time of this sample, read after it was filled and before its content was checked.
        pub publish_time: u64,
        /// Time of the state: the scheduled release of the time-triggered step that produced it, or of the
        /// head of its trigger chain. It is on the grid of the rate, regardless of how late the step was.
        pub state_time: u64,
        /// Index of the episode of its publication, from 0.
        pub episode: u64,
        /// Index of the publishing component in the plan.
        pub publisher: u32,
        /// Restarts of the publishing component before this sample.
        pub restart_count: u32,
    }
}
