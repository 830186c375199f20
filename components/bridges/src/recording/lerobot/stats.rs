//! Statistics of a column, which policies use for normalisation.

use std::ops::Range;

use serde_json::{Value, json};

use crate::parquet::Values;

/// Names and fractions of the quantiles.
pub(super) const QUANTILES: [(&str, f64); 5] =
    [("q01", 0.01), ("q10", 0.1), ("q50", 0.5), ("q90", 0.9), ("q99", 0.99)];

/// Numbers of a column, extracted once for the statistics of all row ranges.
pub(super) struct Numbers {
    flat: Vec<f64>,
    /// Number of values per row.
    width: usize,
}

impl Numbers {
    /// Computes the statistics of a column; empty for columns without numbers.
    pub(super) fn from_values(values: &Values) -> Self {
        let flat = numbers(values);
        let width = flat.len().checked_div(values.len()).unwrap_or(0);
        Self { flat, width }
    }
}

/// Statistics of each entry of a column.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stats {
    rows: usize,
    /// Values of each entry, ascending.
    rising: Vec<Vec<f64>>,
}

impl Stats {
    /// Computes the statistics of some rows of a column.
    pub(super) fn from_rows(Numbers { flat, width }: &Numbers, rows: Range<usize>) -> Self {
        let width = *width;
        let flat = &flat[rows.start * width..rows.end * width];
        let mut rising: Vec<Vec<f64>> =
            (0..width).map(|entry| flat.iter().skip(entry).step_by(width).copied().collect()).collect();
        rising.iter_mut().for_each(|values| values.sort_by(f64::total_cmp));
        Self { rows: rows.len(), rising }
    }

    /// Number of rows.
    pub(super) fn count(&self) -> usize {
        self.rows
    }

    /// Statistics by name, each with one value per entry of the column.
    pub(super) fn named(&self) -> Vec<(&'static str, Vec<f64>)> {
        let each =
            |of: &dyn Fn(&[f64]) -> f64| self.rising.iter().map(|values| of(values)).collect::<Vec<f64>>();
        let mut named = vec![
            ("min", each(&|values| values.first().copied().unwrap_or(0.0))),
            ("max", each(&|values| values.last().copied().unwrap_or(0.0))),
            ("mean", each(&mean)),
            ("std", each(&deviation)),
        ];
        named.extend(QUANTILES.map(|(name, part)| (name, each(&|values| quantile(values, part)))));
        named
    }

    pub(super) fn json(&self) -> Value {
        let named = self.named().into_iter().map(|(name, values)| (name.to_string(), json!(values)));
        named.chain([("count".to_string(), json!([self.rows]))]).collect()
    }
}

fn numbers(values: &Values) -> Vec<f64> {
    match values {
        Values::Int64(values) => values.iter().map(|value| *value as f64).collect(),
        Values::UInt64(values) => values.iter().map(|value| *value as f64).collect(),
        Values::Float(values) => values.iter().map(|value| f64::from(*value)).collect(),
        Values::Double(values) => values.clone(),
        Values::Text(_) | Values::Bytes(_) | Values::Group(_) => Vec::new(),
        Values::List { entries, .. } => numbers(entries),
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Population standard deviation (`ddof = 0`).
fn deviation(values: &[f64]) -> f64 {
    let mean = mean(values);
    (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// Interpolates linearly between the neighbouring values.
fn quantile(rising: &[f64], part: f64) -> f64 {
    let place = part * rising.len().saturating_sub(1) as f64;
    let below = place.floor() as usize;
    let (Some(low), Some(high)) =
        (rising.get(below), rising.get((below + 1).min(rising.len().saturating_sub(1))))
    else {
        return 0.0;
    };
    low + (place - below as f64) * (high - low)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Expected figures from numpy: `numpy.quantile`, `numpy.std`.
    #[test]
    fn statistics_match_numpy() {
        let values = [3.0, 1.0, 2.0, 10.0];
        let entries = values.iter().flat_map(|value| [*value, 1.0]).collect();
        let column = Values::List { lengths: vec![2; 4], entries: Box::new(Values::Float(entries)) };
        let read = Numbers::from_values(&column);
        let stats = Stats::from_rows(&read, 0..4).json();
        assert_eq!(stats["min"], json!([1.0, 1.0]));
        assert_eq!(stats["max"], json!([10.0, 1.0]));
        assert_eq!(stats["mean"], json!([4.0, 1.0]));
        assert_eq!(stats["q50"], json!([2.5, 1.0]));
        assert_eq!(stats["count"], json!([4]));
        let near = |name: &str, expected: f64| {
            let found = stats[name][0].as_f64().expect("a number");
            assert!((found - expected).abs() < 1e-12, "{name}: {found}");
        };
        near("std", 3.535_533_905_932_737_8);
        near("q90", 7.9);
        near("q01", 1.03);
        let last = Stats::from_rows(&read, 2..4).json();
        assert_eq!(
            (&last["min"], &last["max"], &last["count"]),
            (&json!([2.0, 1.0]), &json!([10.0, 1.0]), &json!([2]))
        );
    }
}
