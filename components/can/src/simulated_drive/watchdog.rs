//! Watchdog of a simulated drive.

/// Watchdog that expires when it is not fed in time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Watchdog {
    pub(super) after_ns: Option<u64>,
    pub(super) fed_ns: u64,
}

impl Watchdog {
    pub(super) fn new(after_ns: Option<u64>) -> Self {
        Self { after_ns, fed_ns: 0 }
    }

    pub(super) fn has_expired(&self, now_ns: u64) -> bool {
        self.after_ns.is_some_and(|after_ns| now_ns.saturating_sub(self.fed_ns) >= after_ns)
    }
}
