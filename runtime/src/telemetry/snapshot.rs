//! Snapshots of histograms, and differences of two snapshots.

use serde::{Deserialize, Serialize};

/// Percentiles of a histogram, ns. `max` is exact; all other fields are accurate to 3 %.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct Percentiles {
    /// Median: half of all values do not exceed it.
    pub p50: u64,
    /// 99th percentile: 99 % of all values do not exceed it.
    pub p99: u64,
    /// 99.9th percentile: 99.9 % of all values do not exceed it.
    pub p999: u64,
    /// Largest value.
    pub max: u64,
}

/// Copy of a [`Histogram`](super::Histogram) at one moment, without empty buckets.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Snapshot {
    pub(super) sum: u64,
    pub(super) max: u64,
    /// Nonempty buckets in ascending order, as pairs of upper bound (ns) and number of values.
    pub(super) buckets: Vec<(u64, u64)>,
}

impl Snapshot {
    /// Returns the total number of values in the buckets.
    pub fn count(&self) -> u64 {
        self.buckets.iter().fold(0, |total, (_, count)| total.saturating_add(*count))
    }

    /// Returns the sum of all values, ns.
    pub fn sum(&self) -> u64 {
        self.sum
    }

    /// Returns the nonempty buckets in ascending order, as pairs of upper bound (ns) and number of values.
    pub fn buckets(&self) -> &[(u64, u64)] {
        &self.buckets
    }

    /// Returns the median, the 99 % and 99.9 % quantiles and the maximum, ns.
    pub fn percentiles(&self) -> Percentiles {
        Percentiles {
            p50: self.quantile(0.5),
            p99: self.quantile(0.99),
            p999: self.quantile(0.999),
            max: self.max,
        }
    }

    /// Returns the upper bound of the bucket that contains the quantile `share` (0 to 1), ns.
    pub fn quantile(&self, share: f64) -> u64 {
        let wanted = (share * self.count() as f64).ceil() as u64;
        let mut seen = 0_u64;
        let reached = self.buckets.iter().find(|(_, count)| {
            seen = seen.saturating_add(*count);
            seen >= wanted
        });
        reached.map_or(0, |(bound, _)| (*bound).min(self.max))
    }

    /// Returns the values that were recorded after an earlier snapshot of the same histogram.
    ///
    /// The maximum of the result is exact if it is also the maximum of the whole histogram. Otherwise the
    /// result contains the upper bound of the highest nonempty bucket, which is at most 1/32 too high.
    pub fn since(&self, earlier: &Self) -> Self {
        let mut before = earlier.buckets.iter().copied().peekable();
        let mut buckets = Vec::new();
        for &(bound, count) in &self.buckets {
            while before.next_if(|(earlier_bound, _)| *earlier_bound < bound).is_some() {}
            let had = before.next_if(|(earlier_bound, _)| *earlier_bound == bound).map_or(0, |(_, had)| had);
            if count > had {
                buckets.push((bound, count - had));
            }
        }
        let largest = buckets.last().map_or(0, |(bound, _)| *bound);
        let max = if self.max > earlier.max && largest > 0 { self.max } else { largest.min(self.max) };
        Self { sum: self.sum.wrapping_sub(earlier.sum), max, buckets }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::telemetry::Histogram;

    #[test]
    fn snapshot_matches_its_histogram() {
        let histogram = Histogram::default();
        (1..=10_000u64).for_each(|value| histogram.record(value * 37));
        let snapshot = histogram.snapshot();
        assert_eq!(snapshot.percentiles(), histogram.percentiles());
        assert_eq!((snapshot.count(), snapshot.sum()), (10_000, 37 * 10_000 * 10_001 / 2));
        assert_eq!(Snapshot::default().percentiles(), Percentiles::default());
    }

    #[test]
    fn difference_contains_only_newer_values() {
        let (whole, between) = (Histogram::default(), Histogram::default());
        (0..5_000u64).for_each(|value| whole.record(value * 1_000));
        let before = whole.snapshot();
        for value in (0..3_000u64).map(|value| 200 + value * value % 70_001) {
            whole.record(value);
            between.record(value);
        }
        let (got, expected) = (whole.snapshot().since(&before), between.snapshot());
        assert_eq!(got.buckets(), expected.buckets());
        assert_eq!((got.count(), got.sum()), (expected.count(), expected.sum()));
        let (got, expected) = (got.percentiles(), expected.percentiles());
        assert_eq!((got.p50, got.p99), (expected.p50, expected.p99));
        // The overall maximum is older; only the bucket of the newer maximum is known.
        assert!(
            got.max >= expected.max && got.max - expected.max <= expected.max / 32,
            "{got:?} {expected:?}"
        );
    }

    #[test]
    fn new_maximum_is_exact_between_snapshots() {
        let histogram = Histogram::default();
        histogram.record(1_000);
        let before = histogram.snapshot();
        histogram.record(1_000_003);
        assert_eq!(histogram.snapshot().since(&before).percentiles().max, 1_000_003);
    }

    #[test]
    fn unchanged_histogram_has_an_empty_difference() {
        let histogram = Histogram::default();
        histogram.record(5);
        let snapshot = histogram.snapshot();
        assert_eq!(snapshot.since(&snapshot), Snapshot::default());
    }
}
