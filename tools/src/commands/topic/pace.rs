//! Rate and intervals of samples, from their stamps.

use motorium::state::Stamp;
use motorium::telemetry::Percentiles;

/// Statistics of the stamps of received samples, independent of the time of reading: a sample overwritten
/// before it was read is included in the rate, by its missing sequence number.
#[derive(Debug, Default)]
pub(super) struct Pace {
    last: Option<Stamp>,
    received: u64,
    lost: u64,
    /// Publications from the first to the last received sample, and their duration, ns, summed over restarts
    /// of the publisher.
    publications: u64,
    span_ns: u64,
}

impl Pace {
    /// Records the stamp of the next received sample. Returns the time since the previous publication, ns, if
    /// that sample was received as well: across a gap only the sum of several intervals is known.
    pub(super) fn see(&mut self, stamp: &Stamp) -> Option<u64> {
        self.received += 1;
        let last = self.last.replace(*stamp)?;
        let same_publisher = (last.publisher, last.restart_count) == (stamp.publisher, stamp.restart_count);
        if !same_publisher || stamp.sequence <= last.sequence {
            return None;
        }
        let steps = stamp.sequence - last.sequence;
        let interval = stamp.publish_time.saturating_sub(last.publish_time);
        self.lost += steps - 1;
        self.publications += steps;
        self.span_ns += interval;
        (steps == 1).then_some(interval)
    }

    /// Returns the samples received.
    pub(super) fn received(&self) -> u64 {
        self.received
    }

    /// Returns the number of samples published but not received between received ones.
    pub(super) fn lost(&self) -> u64 {
        self.lost
    }

    /// Publications per second; `None` before two samples were received.
    pub(super) fn rate_hz(&self) -> Option<f64> {
        (self.span_ns > 0).then(|| self.publications as f64 * 1e9 / self.span_ns as f64)
    }

    /// Returns the time from the first to the last received sample, ns.
    pub(super) fn span_ns(&self) -> u64 {
        self.span_ns
    }
}

/// Returns exact percentiles of durations, ns, and sorts them; `None` without durations.
pub(super) fn percentiles(durations: &mut [u64]) -> Option<Percentiles> {
    durations.sort_unstable();
    let max = *durations.last()?;
    let quantile = |share: f64| {
        let rank = (share * durations.len() as f64).ceil() as usize;
        durations[rank.clamp(1, durations.len()) - 1]
    };
    Some(Percentiles { p50: quantile(0.5), p99: quantile(0.99), p999: quantile(0.999), max })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stamp(sequence: u64, publish_time: u64, restart_count: u32) -> Stamp {
        Stamp {
            sequence,
            source_time: publish_time,
            publish_time,
            publisher: 3,
            restart_count,
            ..Stamp::default()
        }
    }

    fn pace(stamps: &[(u64, u64, u32)]) -> (Pace, Vec<u64>) {
        let mut pace = Pace::default();
        let see = |&(sequence, time, life): &(u64, u64, u32)| pace.see(&stamp(sequence, time, life));
        let intervals = stamps.iter().filter_map(see).collect();
        (pace, intervals)
    }

    #[test]
    fn lost_samples_do_not_change_the_measured_rate() {
        // 1 kHz, of which every third sample is caught
        let stamps: Vec<_> = (0..100).map(|i| (1 + 3 * i, 5_000_000 + 3_000_000 * i, 0)).collect();
        let (pace, intervals) = pace(&stamps);
        assert!(intervals.is_empty());
        assert_eq!(pace.received(), 100);
        assert_eq!(pace.lost(), 2 * 99);
        assert_eq!(pace.rate_hz(), Some(1000.0));
        assert_eq!(pace.span_ns(), 297_000_000);
    }

    #[test]
    fn intervals_need_consecutive_samples() {
        let (pace, intervals) = pace(&[(1, 0, 0), (2, 1_000, 0), (5, 9_000, 0), (6, 10_100, 0)]);
        assert_eq!(intervals, [1_000, 1_100], "the gap of 8000 ns is no interval");
        assert_eq!(pace.lost(), 2);
    }

    #[test]
    fn publisher_restart_is_neither_a_gap_nor_an_interval() {
        let (pace, intervals) = pace(&[(98, 0, 0), (99, 1_000, 0), (1, 700_000, 1), (2, 701_000, 1)]);
        assert_eq!((pace.lost(), pace.rate_hz()), (0, Some(1e6)));
        assert_eq!(intervals, [1_000, 1_000]);
    }

    #[test]
    fn one_sample_has_no_rate() {
        let (pace, intervals) = pace(&[(7, 1_000, 0)]);
        assert_eq!((pace.received(), pace.rate_hz()), (1, None));
        assert!(intervals.is_empty());
    }

    #[test]
    fn percentiles_are_values_that_occurred() {
        let mut durations: Vec<u64> = (1..=2000).rev().collect();
        let found = percentiles(&mut durations).unwrap();
        assert_eq!(found, Percentiles { p50: 1000, p99: 1980, p999: 1998, max: 2000 });
        assert_eq!(percentiles(&mut [5]).unwrap(), Percentiles { p50: 5, p99: 5, p999: 5, max: 5 });
        assert_eq!(percentiles(&mut []), None);
    }
}
