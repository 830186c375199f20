//! Measurements of one run, looked up by their names, and the ratios between them.

use super::Measurement;

/// Measurements of one run.
pub(super) struct Seen<'a>(pub(super) &'a [Measurement]);

impl Seen<'_> {
    /// Returns the measurement named `name`.
    pub(super) fn get(&self, name: &str) -> Option<&Measurement> {
        self.0.iter().find(|measurement| measurement.name == name)
    }

    /// Returns the median, us.
    pub(super) fn p50_us(&self, name: &str) -> Option<f64> {
        Some(self.get(name)?.ns.p50 as f64 * 1e-3)
    }

    /// Returns the 99.9th percentile, us.
    pub(super) fn p99_9_us(&self, name: &str) -> Option<f64> {
        Some(self.get(name)?.ns.p99_9 as f64 * 1e-3)
    }

    /// Returns the ratio of two 99.9th percentiles.
    pub(super) fn ratio_of_p99_9(&self, of: &str, to: &str) -> Option<f64> {
        Some(self.get(of)?.ns.p99_9 as f64 / self.get(to)?.ns.p99_9.max(1) as f64)
    }

    /// Returns the ratio of two 99th percentiles.
    pub(super) fn ratio_of_p99(&self, of: &str, to: &str) -> Option<f64> {
        Some(self.get(of)?.ns.p99 as f64 / self.get(to)?.ns.p99.max(1) as f64)
    }

    /// Returns the ratio of two medians: the median over their turns, if they took turns.
    pub(super) fn ratio(&self, of: &str, to: &str) -> Option<f64> {
        let (of, to) = (self.get(of)?, self.get(to)?);
        let ratio = |of: u64, to: u64| of as f64 / to.max(1) as f64;
        let turns = of.slices_p50.iter().zip(&to.slices_p50).map(|(of, to)| ratio(*of, *to));
        let mut turns: Vec<f64> = turns.collect();
        turns.sort_by(f64::total_cmp);
        Some(turns.get(turns.len() / 2).copied().unwrap_or_else(|| ratio(of.ns.p50, to.ns.p50)))
    }

    /// Returns the cost of a worker and its ports per hop, us: the difference between a chain of 8 components
    /// (7 hops) and a chain of processes that only write, wake and read, in the same slice of time.
    pub(super) fn worker_overhead(&self) -> Option<f64> {
        self.beyond("chain.8", "floor.chain.8", 7.0)
    }

    /// Returns the difference of two medians per part, us: the median over their turns, if they took turns.
    pub(super) fn beyond(&self, of: &str, floor: &str, parts: f64) -> Option<f64> {
        let (of, floor) = (self.get(of)?, self.get(floor)?);
        let beyond = |of: u64, floor: u64| (of as f64 - floor as f64) / parts * 1e-3;
        let turns = of.slices_p50.iter().zip(&floor.slices_p50);
        let mut turns: Vec<f64> = turns.map(|(of, floor)| beyond(*of, *floor)).collect();
        turns.sort_by(f64::total_cmp);
        Some(turns.get(turns.len() / 2).copied().unwrap_or_else(|| beyond(of.ns.p50, floor.ns.p50)))
    }
}
