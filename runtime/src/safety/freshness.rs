//! The age of a command since its publication and since its measurement, on a clock that includes suspend.

use crate::region::Refusal;
use crate::state::{FUTURE_TOLERANCE_NS, Stamp};

/// Minimum growth of the difference between the clocks that indicates a suspend, ns.
const SUSPENDED_NS: u64 = 1_000_000;

/// The clock of message stamps, corrected for the time that the machine was suspended.
///
/// Stamps use `CLOCK_MONOTONIC`, which stops while the machine is suspended, so a command from before a
/// suspend would look fresh after it. The current time is therefore computed from `CLOCK_BOOTTIME`, minus the
/// difference between the two clocks, which only a suspend changes. In this way only one clock is read per
/// step. When a command looks stale, the difference is measured again. If the difference has grown, the
/// machine was suspended, and all commands from before the suspend are permanently stale.
#[derive(Debug, Clone, Copy)]
pub struct SuspendClock {
    /// `CLOCK_BOOTTIME` minus `CLOCK_MONOTONIC`, ns.
    ahead_ns: u64,
    /// Time at which the end of a suspend was detected, ns on `CLOCK_MONOTONIC`; commands from before are
    /// stale.
    resumed_ns: u64,
}

impl SuspendClock {
    /// Creates a clock from simultaneous readings of `CLOCK_MONOTONIC` and `CLOCK_BOOTTIME`.
    pub fn new(monotonic_ns: u64, boottime_ns: u64) -> Self {
        Self { ahead_ns: boottime_ns.saturating_sub(monotonic_ns), resumed_ns: 0 }
    }

    /// Returns the current time on the clock of stamps, plus the duration of suspends since the last
    /// [`compare`](Self::compare), ns.
    #[inline]
    pub fn now_ns(&self, boottime_ns: u64) -> u64 {
        boottime_ns.saturating_sub(self.ahead_ns)
    }

    /// Measures the difference between the clocks again. Returns `true` if the machine was suspended since
    /// the last comparison.
    pub fn compare(&mut self, monotonic_ns: u64, boottime_ns: u64) -> bool {
        let ahead_ns = boottime_ns.saturating_sub(monotonic_ns);
        let suspended = ahead_ns > self.ahead_ns + SUSPENDED_NS;
        if suspended {
            (self.ahead_ns, self.resumed_ns) = (ahead_ns, monotonic_ns);
        }
        suspended
    }

    /// Returns `true` if a stamp is from before the last suspend.
    #[inline]
    pub fn is_from_before(&self, publish_ns: u64) -> bool {
        publish_ns < self.resumed_ns
    }
}

/// Result of checking the stamp of a command.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Age {
    /// The command is recent enough to apply.
    Fresh,
    /// The command was published too long ago.
    Stale,
    /// The command must not be applied, regardless of its age.
    Refused(Refusal),
}

/// Checks the stamps of commands: their age, their order, and that their times are not in the future.
#[derive(Debug, Clone, Copy)]
pub struct Freshness {
    /// Maximum time since a command's publication, ns. Older commands are stale.
    pub stale_after_ns: u64,
    /// Maximum age of the measurement from which a command was computed, ns. Commands from older measurements
    /// are refused.
    pub source_stale_after_ns: u64,
    last: Option<(u32, u32, u64)>,
}

impl Freshness {
    /// Creates a check that has not seen any command yet.
    pub fn new(stale_after_ns: u64, source_stale_after_ns: u64) -> Self {
        Self { stale_after_ns, source_stale_after_ns, last: None }
    }

    /// Clears the state for a new episode.
    pub fn reset(&mut self) {
        self.last = None;
    }

    /// Checks a stamp at `now_ns`.
    ///
    /// The age since publication detects a dead controller. The age of the source detects a live controller
    /// that computes from a dead sensor's data.
    #[inline]
    pub fn check(&mut self, stamp: &Stamp, now_ns: u64) -> Age {
        let latest = now_ns.saturating_add(FUTURE_TOLERANCE_NS);
        if stamp.publish_time > latest || stamp.source_time > latest {
            return Age::Refused(Refusal::Future);
        }
        let (publisher, restart_count, sequence) = (stamp.publisher, stamp.restart_count, stamp.sequence);
        let in_order = match self.last {
            Some((same, life, number)) if same == publisher => {
                restart_count > life || (restart_count == life && sequence >= number)
            }
            _ => true,
        };
        if sequence == 0 || !in_order {
            return Age::Refused(Refusal::Sequence);
        }
        self.last = Some((publisher, restart_count, sequence));
        if now_ns.saturating_sub(stamp.publish_time) > self.stale_after_ns {
            return Age::Stale;
        }
        if now_ns.saturating_sub(stamp.source_time) > self.source_stale_after_ns {
            return Age::Refused(Refusal::StaleSource);
        }
        Age::Fresh
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn published(at: u64, source: u64, sequence: u64) -> Stamp {
        Stamp {
            sequence,
            source_time: source,
            publish_time: at,
            state_time: source,
            episode: 0,
            publisher: 3,
            restart_count: 0,
        }
    }

    fn check() -> Freshness {
        Freshness::new(5 * MS, 20 * MS)
    }

    #[test]
    fn command_is_fresh_until_it_is_older_than_stale_after() {
        let mut check = check();
        let stamp = published(100 * MS, 100 * MS, 1);
        assert_eq!(check.check(&stamp, 105 * MS), Age::Fresh);
        assert_eq!(check.check(&stamp, 105 * MS + 1), Age::Stale);
    }

    #[test]
    fn live_controller_on_a_dead_sensor_is_refused() {
        let mut check = check();
        assert_eq!(check.check(&published(120 * MS, 100 * MS, 1), 120 * MS), Age::Fresh);
        let verdict = check.check(&published(121 * MS, 100 * MS, 2), 121 * MS);
        assert_eq!(verdict, Age::Refused(Refusal::StaleSource));
    }

    #[test]
    fn a_future_stamp_is_never_fresh() {
        let mut check = check();
        assert_eq!(
            check.check(&published(101 * MS, 101 * MS, 1), 100 * MS),
            Age::Fresh,
            "within the tolerance"
        );
        for ahead in [2 * MS, 10_000 * MS, u64::MAX - 100 * MS] {
            let stamp = published(100 * MS + ahead, 100 * MS, 2);
            assert_eq!(check.check(&stamp, 100 * MS), Age::Refused(Refusal::Future), "{ahead} ns ahead");
            let stamp = published(100 * MS, 100 * MS + ahead, 2);
            assert_eq!(
                check.check(&stamp, 100 * MS),
                Age::Refused(Refusal::Future),
                "source {ahead} ns ahead"
            );
        }
    }

    #[test]
    fn older_commands_of_a_running_publisher_are_refused() {
        let mut check = check();
        let now = 100 * MS;
        assert_eq!(check.check(&published(now, now, 7), now), Age::Fresh);
        assert_eq!(check.check(&published(now, now, 7), now), Age::Fresh, "the same again");
        assert_eq!(check.check(&published(now, now, 6), now), Age::Refused(Refusal::Sequence));
        assert_eq!(check.check(&published(now, now, 0), now), Age::Refused(Refusal::Sequence));
        let restarted = Stamp { restart_count: 1, ..published(now, now, 1) };
        assert_eq!(check.check(&restarted, now), Age::Fresh);
        assert_eq!(
            check.check(&published(now, now, 8), now),
            Age::Refused(Refusal::Sequence),
            "its dead process"
        );
    }

    #[test]
    fn suspend_ages_earlier_commands_only() {
        // Monotonic 100 ms, boot time 7 s ahead; the machine is suspended for an hour between the steps.
        let (before, hour) = (100 * MS, 3_600_000 * MS);
        let mut clock = SuspendClock::new(before, 7_000 * MS);
        assert_eq!(clock.now_ns(7_000 * MS + 2 * MS), 102 * MS);
        let (monotonic, boottime) = (103 * MS, 7_003 * MS + hour);
        let stamp = published(102 * MS, 102 * MS, 1);
        assert_eq!(check().check(&stamp, clock.now_ns(boottime)), Age::Stale);
        assert!(clock.compare(monotonic, boottime));
        assert!(clock.is_from_before(102 * MS), "although it is 1 ms old on the monotonic clock");
        assert_eq!(clock.now_ns(boottime + MS), 104 * MS);
        assert!(!clock.is_from_before(104 * MS));
        assert!(!clock.compare(monotonic + MS, boottime + MS), "no second suspend");
    }
}
