//! The pace of simulated time, as a pure function of the machine's clock.

/// Maximum delay that is caught up, ns of the machine's clock.
const BEHIND_NS: u64 = 100_000_000;

/// A pace of simulated time as a multiple of real time, from an anchor on both clocks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pace {
    factor: f64,
    wall_ns: u64,
    simulated_ns: u64,
}

impl Pace {
    /// Creates a pace that starts now. Returns `None` unless the factor is finite and above zero.
    pub(super) fn new(factor: f64, wall_ns: u64, simulated_ns: u64) -> Option<Self> {
        (factor > 0.0 && factor.is_finite()).then_some(Self { factor, wall_ns, simulated_ns })
    }

    /// Returns the same pace with another anchor.
    pub(super) fn anchored(self, wall_ns: u64, simulated_ns: u64) -> Self {
        Self { wall_ns, simulated_ns, ..self }
    }

    /// Returns the time on the machine's clock at which a simulated time is due, ns.
    pub(super) fn due_ns(&self, simulated_ns: u64) -> u64 {
        let since = simulated_ns.saturating_sub(self.simulated_ns) as f64 / self.factor;
        self.wall_ns.saturating_add(since as u64)
    }

    /// Returns `true` if a time due at `due_ns` is too late to be caught up. The run then continues at its
    /// pace from the current time.
    pub(super) fn has_fallen_behind(&self, due_ns: u64, wall_ns: u64) -> bool {
        wall_ns > due_ns.saturating_add(BEHIND_NS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn simulated_time_is_due_at_its_share_of_real_time() {
        let pace = Pace::new(2.0, 1_000, 500).unwrap();
        assert_eq!(pace.due_ns(500), 1_000);
        assert_eq!(pace.due_ns(2_500), 2_000);
        assert_eq!(Pace::new(0.5, 0, 0).unwrap().due_ns(1_000), 2_000);
        assert_eq!(pace.anchored(9_000, 2_500).due_ns(2_700), 9_100);
    }

    #[test]
    fn factor_at_which_time_would_not_pass_is_rejected() {
        assert!([0.0, -1.0, f64::NAN, f64::INFINITY].iter().all(|factor| Pace::new(*factor, 0, 0).is_none()));
    }

    #[test]
    fn short_delay_is_caught_up_and_a_long_one_is_not() {
        let pace = Pace::new(1.0, 0, 0).unwrap();
        assert!(!pace.has_fallen_behind(1_000, 50_001_000));
        assert!(pace.has_fallen_behind(1_000, 200_000_000));
    }
}
