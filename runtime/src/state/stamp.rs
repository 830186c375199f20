//! The header of every sample.

#[cfg(doc)]
use super::StateBuffer;

/// Maximum time by which a stamp may be ahead of the clock, ns. Needed because the clocks of two cores differ
/// slightly.
pub const FUTURE_TOLERANCE_NS: u64 = 1_000_000;

crate::state_buffer! {
    /// Header of a sample: its sequence number, its times and its publisher. Every [`StateBuffer`] sample has
    /// a stamp as its user header.
    ///
    /// In real time, times are nanoseconds on `CLOCK_MONOTONIC`. In lockstep, they are simulated nanoseconds
    /// since the start.
    pub struct Stamp as "motorium.Stamp" {
        /// Sequence number of the sample within its publisher, counted from 1; 0 is never published.
        pub sequence: u64,
        /// Time of the source data: the time passed to `Loan::publish_from` or, without such a call, the
        /// publication time of the first sample in the processing chain. A sample computed from an input
        /// inherits the input's source time. Therefore `publish_time - source_time` is the latency of the
        /// whole chain so far.
        pub source_time: u64,
        /// Publication time of this sample: the time after the sample was filled and before its content is
        /// checked.
        pub publish_time: u64,
        /// Time of the state: the scheduled release of the time-triggered step that produced the sample. For
        /// a triggered step, this is the scheduled release of the first step in the trigger chain. A late
        /// step does not change this time.
        pub state_time: u64,
        /// Index of the episode in which the sample was published, counted from 0.
        pub episode: u64,
        /// Index of the publishing component in the plan.
        pub publisher: u32,
        /// Number of times that the publishing component was restarted before this sample.
        pub restart_count: u32,
    }
}
