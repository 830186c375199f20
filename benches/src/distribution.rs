//! What was measured: all of it, nothing trimmed.

use std::collections::BTreeMap;

use motorium::telemetry::Histogram;
use serde::{Deserialize, Serialize};

/// A distribution of durations, ns. Nothing is trimmed: `max` is the longest there was.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Distribution {
    /// Number of samples.
    pub count: u64,
    /// Mean, ns.
    pub mean: f64,
    /// Half of all are at most this, ns.
    pub p50: u64,
    /// 99 % of all are at most this, ns.
    pub p99: u64,
    /// 99.9 % of all are at most this, ns.
    pub p99_9: u64,
    /// The longest, ns.
    pub max: u64,
    /// The raw histogram: the largest duration that each bucket takes (ns) and how many samples lie in it. Empty
    /// buckets are left out; no bucket is wider than 1/32 of its durations.
    pub buckets: Vec<(u64, u64)>,
}

impl Distribution {
    /// The distribution of single samples; percentiles are exact.
    pub fn of(mut samples: Vec<u64>) -> Self {
        let histogram = Histogram::default();
        samples.iter().for_each(|sample| histogram.record(*sample));
        samples.sort_unstable();
        let rank = |share: f64| {
            let rank = (share * samples.len() as f64).ceil() as usize;
            samples.get(rank.max(1) - 1).copied().unwrap_or(0)
        };
        Self {
            p50: rank(0.5),
            p99: rank(0.99),
            p99_9: rank(0.999),
            max: samples.last().copied().unwrap_or(0),
            ..Self::from_histogram(&histogram)
        }
    }

    /// The distribution a histogram holds; percentiles are exact to 3 %.
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

    /// Takes in another distribution; percentiles are then exact to 3 %.
    pub fn add(&mut self, other: &Self) {
        let mut buckets: BTreeMap<u64, u64> = self.buckets.iter().copied().collect();
        other.buckets.iter().for_each(|(bound, count)| *buckets.entry(*bound).or_default() += count);
        let count = self.count + other.count;
        if count > 0 {
            self.mean = (self.mean * self.count as f64 + other.mean * other.count as f64) / count as f64;
        }
        (self.count, self.max) = (count, self.max.max(other.max));
        self.buckets = buckets.into_iter().collect();
        let rank = |share: f64| {
            let at_least = (share * count as f64).ceil() as u64;
            let mut seen = 0;
            let bucket = self.buckets.iter().find(|(_, count)| {
                seen += count;
                seen >= at_least
            });
            bucket.map_or(0, |(bound, _)| (*bound).min(self.max))
        };
        (self.p50, self.p99, self.p99_9) = (rank(0.5), rank(0.99), rank(0.999));
    }

    /// The curve of latency against percentile: for each bucket the share of all samples that are at most its bound,
    /// and that bound (ns).
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_of_samples_are_exact_and_the_maximum_stays() {
        let mut samples: Vec<u64> = (1..=100_000).rev().collect();
        samples[17] = 9_000_000;
        let seen = Distribution::of(samples);
        assert_eq!((seen.p50, seen.p99, seen.p99_9, seen.max), (50_000, 99_000, 99_900, 9_000_000));
        assert_eq!(seen.count, 100_000);
    }

    #[test]
    fn the_buckets_hold_every_sample_in_its_place() {
        let samples = vec![5, 5, 70, 1_000, 1_000_000];
        let seen = Distribution::of(samples.clone());
        assert_eq!(seen.buckets.iter().map(|(_, count)| count).sum::<u64>(), 5);
        for sample in samples {
            let (bound, _) = seen.buckets.iter().find(|(bound, _)| *bound >= sample).unwrap();
            assert!(bound - sample <= sample / 32, "{sample} in the bucket up to {bound}");
        }
    }

    #[test]
    fn two_distributions_together_are_that_of_all_samples() {
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
    fn nothing_measured_is_all_zero_and_no_fault() {
        assert_eq!(Distribution::of(Vec::new()), Distribution::default());
    }

    #[test]
    fn the_curve_ends_with_all_samples_at_the_maximum() {
        let seen = Distribution::of((1..=1_000).collect());
        assert_eq!(seen.curve().last(), Some(&(1.0, 1_000)));
    }
}
