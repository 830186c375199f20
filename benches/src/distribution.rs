//! Distribution of measured durations, without removing outliers.

use std::collections::BTreeMap;

use motorium::telemetry::Histogram;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Bits of precision of the buckets of single samples: exact below 2^14 ns, no wider than 1/8192 of a
/// duration beyond.
const FINE_BITS: u32 = 14;

/// A distribution of durations, ns. Outliers are not removed: `max` is the longest sample.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Distribution {
    /// Number of samples.
    pub count: u64,
    /// Mean, ns.
    pub mean: f64,
    /// Median, ns.
    pub p50: u64,
    /// 99th percentile, ns.
    pub p99: u64,
    /// 99.9th percentile, ns.
    pub p99_9: u64,
    /// Longest sample, ns.
    pub max: u64,
    /// The raw histogram: upper bound (ns) and number of samples of each non-empty bucket. Buckets of raw
    /// samples are exact below 16 us; above, they are no wider than 1/8192 of their durations. Buckets of
    /// histograms kept by a graph are no wider than 1/32 of their durations.
    pub buckets: Vec<(u64, u64)>,
}

impl Distribution {
    /// Computes the distribution of single samples. Percentiles are exact.
    pub fn from_samples(mut samples: Vec<u64>) -> Self {
        samples.sort_unstable();
        let rank =
            |share: f64| samples.get(rank(share, samples.len() as u64) as usize - 1).copied().unwrap_or(0);
        let mut buckets: Vec<(u64, u64)> = Vec::new();
        for bound in samples.iter().map(|sample| fine_bound(*sample)) {
            match buckets.last_mut() {
                Some((last, count)) if *last == bound => *count += 1,
                _ => buckets.push((bound, 1)),
            }
        }
        let sum: f64 = samples.iter().map(|sample| *sample as f64).sum();
        Self {
            count: samples.len() as u64,
            mean: sum / samples.len().max(1) as f64,
            p50: rank(0.5),
            p99: rank(0.99),
            p99_9: rank(0.999),
            max: samples.last().copied().unwrap_or(0),
            buckets,
        }
    }

    /// Computes the distribution of a histogram. Percentiles are upper bounds of their buckets, so they are
    /// never too low and up to 3 % too high.
    pub fn from_histogram(histogram: &Histogram) -> Self {
        let percentiles = histogram.percentiles();
        Self {
            count: histogram.count(),
            mean: histogram.mean(),
            p50: percentiles.p50,
            p99: percentiles.p99,
            p99_9: percentiles.p999,
            max: percentiles.max,
            buckets: histogram.buckets().collect(),
        }
    }

    /// Adds the samples of `other` to this distribution. Afterwards, percentiles are upper bounds of their
    /// buckets.
    pub fn add(&mut self, other: &Self) {
        let mut buckets: BTreeMap<u64, u64> = self.buckets.iter().copied().collect();
        other.buckets.iter().for_each(|(bound, count)| *buckets.entry(*bound).or_default() += count);
        let count = self.count + other.count;
        if count > 0 {
            self.mean = (self.mean * self.count as f64 + other.mean * other.count as f64) / count as f64;
        }
        (self.count, self.max) = (count, self.max.max(other.max));
        self.buckets = buckets.into_iter().collect();
        (self.p50, self.p99, self.p99_9) = (self.quantile(0.5), self.quantile(0.99), self.quantile(0.999));
    }

    /// Returns the quantile `share` (0 to 1) as the upper bound of its bucket, ns: at least this share of all
    /// samples does not exceed the result. The results agree with the percentile fields up to the width of a
    /// bucket.
    pub fn quantile(&self, share: f64) -> u64 {
        let rank = rank(share, self.count);
        let mut seen = 0;
        let bucket = self.buckets.iter().find(|(_, count)| {
            seen += count;
            seen >= rank
        });
        bucket.map_or(0, |(bound, _)| (*bound).min(self.max))
    }

    /// Returns the cumulative distribution as a curve. Each point is a pair: the share of all samples that do
    /// not exceed the upper bound of a bucket, and this upper bound, ns.
    pub fn curve(&self) -> Vec<(f64, u64)> {
        let mut seen = 0;
        self.buckets
            .iter()
            .map(|(bound, count)| {
                seen += count;
                (seen as f64 / self.count.max(1) as f64, (*bound).min(self.max))
            })
            .collect()
    }
}

/// Returns the rank, counted from 1, of a percentile among `count` sorted samples; at least this share of
/// them does not exceed it.
fn rank(share: f64, count: u64) -> u64 {
    ((share * count as f64).ceil() as u64).max(1)
}

/// Returns the upper bound of the fine bucket of this duration, ns.
fn fine_bound(nanoseconds: u64) -> u64 {
    let shift = (u64::BITS - nanoseconds.leading_zeros()).saturating_sub(FINE_BITS);
    nanoseconds | ((1 << shift) - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_of_samples_are_exact_and_the_maximum_stays() {
        let mut samples: Vec<u64> = (1..=100_000).rev().collect();
        samples[17] = 9_000_000;
        let seen = Distribution::from_samples(samples);
        assert_eq!((seen.p50, seen.p99, seen.p99_9, seen.max), (50_000, 99_000, 99_900, 9_000_000));
        assert_eq!(seen.count, 100_000);
    }

    #[test]
    fn buckets_count_every_sample() {
        let samples = vec![5, 5, 70, 1_000, 16_383, 16_384, 1_000_000, u64::MAX];
        let seen = Distribution::from_samples(samples.clone());
        assert_eq!(seen.buckets.iter().map(|(_, count)| count).sum::<u64>(), 8);
        for sample in samples {
            let (bound, _) = seen.buckets.iter().find(|(bound, _)| *bound >= sample).unwrap();
            let width = if sample < 16_384 { 0 } else { sample / 8_192 };
            assert!(bound - sample <= width, "{sample} in the bucket up to {bound}");
        }
    }

    #[test]
    fn percentiles_can_be_computed_again_from_the_buckets() {
        // Three distributions: uniform, over many decades, and constant.
        let spreads: [fn(u64) -> u64; 3] = [|n| 200 + n, |n| 900 + n * n * n / 7_000, |_| 55_555];
        for spread in spreads {
            let seen = Distribution::from_samples((1..=10_007).map(spread).collect());
            for (share, stored) in [(0.5, seen.p50), (0.99, seen.p99), (0.999, seen.p99_9), (1.0, seen.max)] {
                let again = seen.quantile(share);
                assert!(again >= stored && again - stored <= stored / 8_192, "{share}: {again} for {stored}");
                assert!(stored >= 16_384 || again == stored, "{share}: {again} for {stored}");
            }
        }
    }

    #[test]
    fn merged_distribution_matches_all_samples() {
        let histogram = |samples: core::ops::Range<u64>| {
            let histogram = Histogram::default();
            samples.for_each(|sample| histogram.record(sample * sample));
            Distribution::from_histogram(&histogram)
        };
        let mut both = histogram(0..300);
        both.add(&histogram(300..1_000));
        let all = histogram(0..1_000);
        assert_eq!((both.count, both.max, &both.buckets), (all.count, all.max, &all.buckets));
        assert!((both.mean - all.mean).abs() < 1e-6 * all.mean);
        for (one, other) in [(both.p50, all.p50), (both.p99, all.p99), (both.p99_9, all.p99_9)] {
            assert!(one.abs_diff(other) <= other / 16, "{one} and {other}");
        }
        let mut none = Distribution::default();
        none.add(&all);
        assert_eq!(none.count, 1_000);
    }

    #[test]
    fn distribution_without_samples_is_zero() {
        assert_eq!(Distribution::from_samples(Vec::new()), Distribution::default());
    }

    #[test]
    fn the_curve_ends_with_all_samples_at_the_maximum() {
        let seen = Distribution::from_samples((1..=1_000).collect());
        assert_eq!(seen.curve().last(), Some(&(1.0, 1_000)));
    }
}
