//! The header that travels with every sample.

#[cfg(doc)]
use super::StateBuffer;

crate::state_buffer! {
    /// When and by whom a sample was made. Carried as the user header of every [`StateBuffer`] sample.
    ///
    /// Times are nanoseconds on `CLOCK_MONOTONIC`, or simulated nanoseconds since the start in lockstep.
    pub struct Stamp as "motorium.Stamp" {
        /// Counts the samples of one publisher from 1; 0 is never published.
        pub sequence: u64,
        /// When the data at the head of the chain came into being: a sample made from an input inherits the
        /// input's source time, so `publish_time - source_time` is the latency of the whole chain so far.
        pub source_time: u64,
        /// When this sample was published.
        pub publish_time: u64,
        /// Index of the publishing component in the plan.
        pub origin: u32,
        /// How often the publishing component had been restarted.
        pub incarnation: u32,
    }
}
