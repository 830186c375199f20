//! How fast and how evenly samples come, from their stamps.

use motorium::state::Stamp;
use motorium::telemetry::{Histogram, Percentiles};

/// What the stamps of received samples tell. It does not depend on when the samples were looked at: a sample that
/// was overwritten unseen still counts for the rate, for its sequence number is missing.
#[derive(Debug, Default)]
pub(super) struct Pace {
    last: Option<Stamp>,
    received: u64,
    lost: u64,
    /// Publications from the first to the last received sample, and the time they took, ns: summed over the lives
    /// of a publisher that was restarted.
    publications: u64,
    span_ns: u64,
    intervals: Histogram,
}

impl Pace {
    /// Takes the stamp of the next received sample.
    pub(super) fn see(&mut self, stamp: &Stamp) {
        self.received += 1;
        let last = self.last.replace(*stamp);
        let Some(last) = last else { return };
        let same_publisher = (last.origin, last.incarnation) == (stamp.origin, stamp.incarnation);
        if !same_publisher || stamp.sequence <= last.sequence {
            return;
        }
        let steps = stamp.sequence - last.sequence;
        let interval = stamp.publish_time.saturating_sub(last.publish_time);
        self.lost += steps - 1;
        self.publications += steps;
        self.span_ns += interval;
        // Across a gap only the sum of several intervals is known.
        if steps == 1 {
            self.intervals.record(interval);
        }
    }

    /// Samples received.
    pub(super) fn received(&self) -> u64 {
        self.received
    }

    /// Samples published between two received ones, but not received.
    pub(super) fn lost(&self) -> u64 {
        self.lost
    }

    /// Publications a second; `None` before two samples were received.
    pub(super) fn rate_hz(&self) -> Option<f64> {
        (self.span_ns > 0).then(|| self.publications as f64 * 1e9 / self.span_ns as f64)
    }

    /// Time between publications that follow one another, ns; `None` when there are none.
    pub(super) fn intervals(&self) -> Option<Percentiles> {
        (self.intervals.count() > 0).then(|| self.intervals.percentiles())
    }

    /// From the first to the last received sample, ns.
    pub(super) fn span_ns(&self) -> u64 {
        self.span_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stamp(sequence: u64, publish_time: u64, incarnation: u32) -> Stamp {
        Stamp { sequence, source_time: publish_time, publish_time, origin: 3, incarnation }
    }

    fn pace(stamps: &[(u64, u64, u32)]) -> Pace {
        let mut pace = Pace::default();
        stamps.iter().for_each(|&(sequence, time, life)| pace.see(&stamp(sequence, time, life)));
        pace
    }

    #[test]
    fn the_rate_is_that_of_the_publisher_even_when_samples_are_lost() {
        // 1 kHz, of which every third sample is caught
        let stamps: Vec<_> = (0..100).map(|i| (1 + 3 * i, 5_000_000 + 3_000_000 * i, 0)).collect();
        let pace = pace(&stamps);
        assert_eq!(pace.received(), 100);
        assert_eq!(pace.lost(), 2 * 99);
        assert_eq!(pace.rate_hz(), Some(1000.0));
        assert_eq!(pace.span_ns(), 297_000_000);
    }

    #[test]
    fn intervals_are_measured_only_between_samples_that_follow_one_another() {
        let pace = pace(&[(1, 0, 0), (2, 1_000, 0), (5, 9_000, 0), (6, 10_000, 0)]);
        let intervals = pace.intervals().unwrap();
        assert_eq!(intervals.max, 1_000, "the gap of 8000 ns is no interval");
        assert_eq!(pace.lost(), 2);
    }

    #[test]
    fn a_restart_of_the_publisher_is_no_gap_and_no_interval() {
        let pace = pace(&[(98, 0, 0), (99, 1_000, 0), (1, 700_000, 1), (2, 701_000, 1)]);
        assert_eq!((pace.lost(), pace.rate_hz()), (0, Some(1e6)));
        assert_eq!(pace.intervals().unwrap().max, 1_000);
    }

    #[test]
    fn one_sample_tells_no_rate() {
        let pace = pace(&[(7, 1_000, 0)]);
        assert_eq!((pace.received(), pace.rate_hz(), pace.intervals()), (1, None, None));
    }
}
