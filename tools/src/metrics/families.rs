//! Families of metrics in the exposition format: a name, a type, a unit, and one series per set of
//! labels.

use std::fmt;
use std::sync::LazyLock;

use motorium::telemetry::Snapshot;
use prometheus_client::encoding::{
    DescriptorEncoder, EncodeCounterValue, EncodeGaugeValue, EncodeMetric as _, NoLabelSet,
};
use prometheus_client::metrics::MetricType;
use prometheus_client::metrics::counter::ConstCounter;
use prometheus_client::metrics::gauge::ConstGauge;
use prometheus_client::registry::Unit;

/// Labels of a series.
pub(super) type Labels<'a> = Vec<(&'static str, &'a str)>;

/// Writes families of metrics.
pub(super) struct Families<'a>(pub(super) DescriptorEncoder<'a>);

/// Name, unit and explanation of a family; the text format appends the unit, and `total` for a counter, to
/// the name.
pub(super) struct Family {
    pub(super) name: &'static str,
    pub(super) unit: Option<Unit>,
    pub(super) help: &'static str,
}

impl Family {
    pub(super) fn unitless(name: &'static str, help: &'static str) -> Self {
        Self { name, unit: None, help }
    }

    pub(super) fn seconds(name: &'static str, help: &'static str) -> Self {
        Self { name, unit: Some(Unit::Seconds), help }
    }

    pub(super) fn bytes(name: &'static str, help: &'static str) -> Self {
        Self { name, unit: Some(Unit::Bytes), help }
    }
}

impl Families<'_> {
    /// Adds a counter, which only grows.
    pub(super) fn counter<'l, N: EncodeCounterValue>(
        &mut self,
        family: &Family,
        series: impl IntoIterator<Item = (Labels<'l>, N)>,
    ) -> fmt::Result {
        let Family { name, unit, help } = family;
        let mut encoder = self.0.encode_descriptor(name, help, unit.as_ref(), MetricType::Counter)?;
        for (labels, value) in series {
            ConstCounter::new(value).encode(encoder.encode_family(&labels)?)?;
        }
        Ok(())
    }

    /// Adds a gauge, which may rise and fall.
    pub(super) fn gauge<'l, N: EncodeGaugeValue>(
        &mut self,
        family: &Family,
        series: impl IntoIterator<Item = (Labels<'l>, N)>,
    ) -> fmt::Result {
        let Family { name, unit, help } = family;
        let mut encoder = self.0.encode_descriptor(name, help, unit.as_ref(), MetricType::Gauge)?;
        for (labels, value) in series {
            ConstGauge::new(value).encode(encoder.encode_family(&labels)?)?;
        }
        Ok(())
    }

    /// Adds a histogram of durations, with the region's counts and the bounds of its buckets.
    pub(super) fn durations<'l, 's>(
        &mut self,
        family: &Family,
        series: impl IntoIterator<Item = (Labels<'l>, &'s Snapshot)>,
    ) -> fmt::Result {
        let Family { name, unit, help } = family;
        let mut encoder = self.0.encode_descriptor(name, help, unit.as_ref(), MetricType::Histogram)?;
        for (labels, snapshot) in series {
            let (sum, buckets) = (seconds(snapshot.sum()), buckets(snapshot));
            let mut encoder = encoder.encode_family(&labels)?;
            encoder.encode_histogram::<NoLabelSet>(sum, snapshot.count(), &buckets, None)?;
        }
        Ok(())
    }
}

/// Nanoseconds in the base unit.
pub(super) fn seconds(ns: u64) -> f64 {
    ns as f64 / 1e9
}

/// Bounds of the exposed buckets, ns: two per power of two from 255 ns to 1.6 s. Each is the largest value of
/// a bucket of [`Histogram`](motorium::telemetry::Histogram), so every value is counted on the correct side
/// of a bound.
static BOUNDS: LazyLock<Vec<u64>> =
    LazyLock::new(|| (8..=30).flat_map(|bits| [(1_u64 << bits) - 1, (3_u64 << (bits - 1)) - 1]).collect());

/// Bounds in seconds, and the number of values between each and the previous one.
fn buckets(snapshot: &Snapshot) -> Vec<(f64, u64)> {
    let mut rest = snapshot.buckets().iter().copied().peekable();
    let mut below = |bound: u64| {
        let mut count = 0;
        while let Some((_, more)) = rest.next_if(|(largest, _)| *largest <= bound) {
            count += more;
        }
        count
    };
    let mut buckets: Vec<(f64, u64)> = BOUNDS.iter().map(|bound| (seconds(*bound), below(*bound))).collect();
    buckets.push((f64::INFINITY, below(u64::MAX)));
    buckets
}

#[cfg(test)]
mod tests {
    use motorium::telemetry::Histogram;

    use super::*;

    #[test]
    fn each_value_is_counted_in_the_right_buckets() {
        let histogram = Histogram::default();
        let values: Vec<u64> = (0..4_000).map(|i: u64| i * i * i / 3).chain([1 << 30, 1 << 39]).collect();
        values.iter().for_each(|value| histogram.record(*value));
        let mut sum = 0;
        for (bound, count) in buckets(&histogram.snapshot()) {
            sum += count;
            let expected = values.iter().filter(|value| seconds(**value) <= bound).count() as u64;
            assert_eq!(sum, expected, "up to {bound} s");
        }
        assert_eq!(sum, values.len() as u64);
    }

    #[test]
    fn bounds_ascend_and_are_few() {
        assert!(BOUNDS.is_sorted() && BOUNDS.len() < 50, "{BOUNDS:?}");
        assert_eq!(BOUNDS[0], 255);
    }
}
