//! Times of one step.

/// Release, start and deadline of a step, ns on the clock of stamps.
#[derive(Debug, Clone, Copy)]
pub(super) struct Timing {
    pub(super) release_ns: u64,
    pub(super) wake_ns: u64,
    pub(super) deadline_ns: u64,
    /// True if the previous step ended after this release.
    pub(super) behind: bool,
}

impl Timing {
    /// Creates the timing of a step in lockstep, which takes no simulated time.
    pub(super) fn lockstep(time_ns: u64, period_ns: u64) -> Self {
        let deadline_ns = time_ns.saturating_add(period_ns);
        Self { release_ns: time_ns, wake_ns: time_ns, deadline_ns, behind: false }
    }
}
