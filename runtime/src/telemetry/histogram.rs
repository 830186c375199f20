//! A lock-free histogram of durations in shared memory, with one writer and any number of readers.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use super::snapshot::{Percentiles, Snapshot};

/// Bits of precision within a power of two: buckets are at most 1/32 wide.
const SUB_BITS: u32 = 5;
/// Durations of 2^40 ns (18 minutes) or more share the last bucket.
const MAX_BITS: u32 = 40;
const BUCKETS: usize = ((MAX_BITS - SUB_BITS + 1) << SUB_BITS) as usize;

/// A histogram of durations, ns. Buckets are 3 % wide; the maximum is exact.
///
/// Zero bytes are a valid empty histogram, so a histogram can be used in freshly mapped shared memory. A
/// histogram has one writer. Readers may miss the record that is being written.
#[derive(Debug)]
#[repr(C)]
pub struct Histogram {
    count: AtomicU64,
    sum: AtomicU64,
    max: AtomicU64,
    buckets: [AtomicU64; BUCKETS],
}

impl Default for Histogram {
    fn default() -> Self {
        Self {
            count: AtomicU64::new(0),
            sum: AtomicU64::new(0),
            max: AtomicU64::new(0),
            buckets: [const { AtomicU64::new(0) }; BUCKETS],
        }
    }
}

impl Histogram {
    /// Records one duration, ns.
    #[inline]
    pub fn record(&self, nanoseconds: u64) {
        // With one writer, loads and stores suffice, at a fraction of the cost of atomic read-modify-writes.
        let add = |cell: &AtomicU64, value: u64| cell.store(cell.load(Relaxed).wrapping_add(value), Relaxed);
        add(&self.buckets[bucket(nanoseconds)], 1);
        add(&self.sum, nanoseconds);
        if nanoseconds > self.max.load(Relaxed) {
            self.max.store(nanoseconds, Relaxed);
        }
        add(&self.count, 1);
    }

    /// Returns the number of recorded durations.
    pub fn count(&self) -> u64 {
        self.count.load(Relaxed)
    }

    /// Returns the mean of the recorded durations, ns.
    pub fn mean(&self) -> f64 {
        self.sum.load(Relaxed) as f64 / self.count().max(1) as f64
    }

    /// Returns the median, the 99 % and 99.9 % quantiles and the maximum, ns.
    pub fn percentiles(&self) -> Percentiles {
        Percentiles {
            p50: self.quantile(0.5),
            p99: self.quantile(0.99),
            p999: self.quantile(0.999),
            max: self.max.load(Relaxed),
        }
    }

    /// Returns the nonempty buckets in ascending order, as pairs of upper bound (ns) and number of durations.
    pub fn buckets(&self) -> impl Iterator<Item = (u64, u64)> + '_ {
        let counts = self.buckets.iter().map(|bucket| bucket.load(Relaxed)).enumerate();
        counts.filter(|(_, count)| *count > 0).map(|(i, count)| (upper_bound(i), count))
    }

    /// Returns a copy of the histogram. [`Snapshot::since`] computes the difference of two copies.
    pub fn snapshot(&self) -> Snapshot {
        // The maximum is written after its bucket, so if it is read after the buckets, it is never below
        // them.
        let buckets = self.buckets().collect();
        Snapshot { buckets, sum: self.sum.load(Relaxed), max: self.max.load(Relaxed) }
    }

    /// Returns the upper bound of the bucket that contains the quantile `share` (0 to 1), ns.
    pub fn quantile(&self, share: f64) -> u64 {
        // Saturating, because damaged shared memory must not crash a reader.
        let total =
            self.buckets.iter().fold(0_u64, |total, bucket| total.saturating_add(bucket.load(Relaxed)));
        let wanted = (share * total as f64).ceil() as u64;
        let mut seen = 0_u64;
        for (i, bucket) in self.buckets.iter().enumerate() {
            seen = seen.saturating_add(bucket.load(Relaxed));
            if seen >= wanted && seen > 0 {
                return upper_bound(i).min(self.max.load(Relaxed));
            }
        }
        0
    }
}

#[inline]
fn bucket(value: u64) -> usize {
    if value < 1 << SUB_BITS {
        return value as usize;
    }
    let exponent = (63 - value.leading_zeros()).min(MAX_BITS - 1);
    let mantissa = (value.min((1 << MAX_BITS) - 1) >> (exponent - SUB_BITS)) & ((1 << SUB_BITS) - 1);
    (((exponent - SUB_BITS + 1) << SUB_BITS) as u64 + mantissa) as usize
}

fn upper_bound(bucket: usize) -> u64 {
    let (block, mantissa) = (bucket >> SUB_BITS, bucket as u64 & ((1 << SUB_BITS) - 1));
    if block == 0 { mantissa } else { (((1 << SUB_BITS) + mantissa + 1) << (block - 1)) - 1 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buckets_are_at_most_a_thirty_second_wide() {
        for value in
            (0..10_000).chain((10..40).map(|bits| 1 << bits)).chain((10..40).map(|bits| (1 << bits) - 1))
        {
            let upper = upper_bound(bucket(value));
            assert!(upper >= value, "{value} above its bucket's bound {upper}");
            assert!(upper - value <= value / 32, "{value} in a bucket up to {upper}");
        }
    }

    #[test]
    fn percentiles_match_sorted_values() {
        let histogram = Histogram::default();
        (1..=10_000u64).for_each(|value| histogram.record(value));
        let got = histogram.percentiles();
        for (got, expected) in [(got.p50, 5_000), (got.p99, 9_900), (got.p999, 9_990)] {
            assert!(got >= expected && got - expected <= expected / 32, "{got} instead of {expected}");
        }
        assert_eq!(got.max, 10_000);
        assert_eq!(histogram.count(), 10_000);
    }

    #[test]
    fn huge_value_is_exact_as_the_maximum() {
        let histogram = Histogram::default();
        histogram.record(u64::MAX);
        assert_eq!(bucket(u64::MAX), BUCKETS - 1);
        assert_eq!(histogram.percentiles().max, u64::MAX);
    }
}
