//! The time before a release at which a component stops sleeping and starts spinning.

use crate::plan::Spin;

/// Number of sleeps in a window. The second largest error of a window is about its 99.6th percentile.
const WINDOW: u32 = 256;
/// Number of windows kept.
const WINDOWS: usize = 8;
/// Initial value of a tuned margin, ns: enough on most machines.
const BEGIN_NS: u64 = 100_000;
/// Margin above the measured wake errors, ns: for reading the clock and entering the loop.
const ROOM_NS: u64 = 2_000;

/// The spin margin of one component, which is tuned to the measured wake errors if the plan requires it.
///
/// A tuned margin covers the second largest wake error of each of the last windows plus an eighth, so single
/// stalls do not widen it. It never exceeds its share of the period.
#[derive(Debug, Clone)]
pub(super) struct Margin {
    spin: Spin,
    margin_ns: u64,
    largest: [u64; 2],
    sleeps: u32,
    windows: [u64; WINDOWS],
    next: usize,
}

impl Margin {
    pub(super) fn new(spin: Spin) -> Self {
        let margin_ns = match spin {
            Spin::Fixed { ns } => ns,
            Spin::Tuned { at_most_ns } => at_most_ns.min(BEGIN_NS),
        };
        Self { spin, margin_ns, largest: [0; 2], sleeps: 0, windows: [0; WINDOWS], next: 0 }
    }

    /// Returns the current margin, ns.
    pub(super) fn ns(&self) -> u64 {
        self.margin_ns
    }

    /// Adds a wake error, ns.
    pub(super) fn woke(&mut self, error_ns: u64) {
        let Spin::Tuned { at_most_ns } = self.spin else { return };
        let [first, second] = self.largest;
        self.largest = if error_ns > first { [error_ns, first] } else { [first, second.max(error_ns)] };
        self.sleeps += 1;
        if self.sleeps < WINDOW {
            return;
        }
        self.windows[self.next % WINDOWS] = self.largest[1];
        self.next += 1;
        (self.largest, self.sleeps) = ([0; 2], 0);
        let seen = self.windows.iter().copied().max().unwrap_or(0);
        self.margin_ns = (seen + seen / 8 + ROOM_NS).min(at_most_ns);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AT_MOST: u64 = 100_000;

    fn after(errors: impl Iterator<Item = u64>) -> u64 {
        let mut margin = Margin::new(Spin::Tuned { at_most_ns: AT_MOST });
        errors.for_each(|error| margin.woke(error));
        margin.ns()
    }

    #[test]
    fn margin_starts_at_the_maximum_and_shrinks_as_possible() {
        assert_eq!(Margin::new(Spin::Tuned { at_most_ns: AT_MOST }).ns(), AT_MOST);
        let usual = (0..256).map(|n| 20_000 + n * 40);
        assert_eq!(after(usual), 30_160 + 30_160 / 8 + ROOM_NS);
    }

    #[test]
    fn single_stall_does_not_widen_the_margin() {
        assert_eq!(after((0..256).map(|n| if n == 77 { 9_000_000 } else { 20_000 })), 24_500);
    }

    #[test]
    fn frequent_late_wake_ups_give_a_bounded_margin() {
        assert_eq!(after((0..256).map(|n| if n % 10 == 0 { 500_000 } else { 20_000 })), AT_MOST);
    }

    #[test]
    fn margin_grows_immediately_and_decays_after_eight_windows() {
        let mut margin = Margin::new(Spin::Tuned { at_most_ns: AT_MOST });
        (0..256).for_each(|_| margin.woke(60_000));
        assert_eq!(margin.ns(), 69_500);
        (0..7 * 256).for_each(|_| margin.woke(16_000));
        assert_eq!(margin.ns(), 69_500);
        (0..256).for_each(|_| margin.woke(16_000));
        assert_eq!(margin.ns(), 20_000);
    }

    #[test]
    fn fixed_margin_does_not_change() {
        let mut margin = Margin::new(Spin::Fixed { ns: 7 });
        (0..10_000).for_each(|_| margin.woke(50_000));
        assert_eq!(margin.ns(), 7);
    }
}
