//! Running means and variances.

use core::ops::Range;

use serde::{Deserialize, Serialize};

/// Running mean and variance of vectors, accumulated in double precision in order of arrival.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Normaliser {
    count: f64,
    mean: Vec<f64>,
    /// Sums of squared differences from the mean.
    squares: Vec<f64>,
    /// Entries that have one standard deviation, the root mean square of their own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    shared: Vec<Range<usize>>,
}

/// Added to variances.
const LEAST: f64 = 1e-8;

impl Normaliser {
    /// Creates a normaliser for vectors of `width` numbers. Mean 0 and variance 1 apply until the first
    /// vector arrives.
    pub fn new(width: usize) -> Self {
        Self { count: 0.0, mean: vec![0.0; width], squares: vec![0.0; width], shared: vec![] }
    }

    /// Gives all entries of each range one standard deviation: the root mean square of their own. Each entry
    /// keeps its own mean.
    #[must_use]
    pub fn with_shared_deviations(self, shared: Vec<Range<usize>>) -> Self {
        Self { shared, ..self }
    }

    /// Adds vectors to the mean and variance by Welford's method (1962). `rows` contains one vector per row.
    pub fn update(&mut self, rows: &[f32]) {
        for row in rows.chunks_exact(self.mean.len()) {
            self.count += 1.0;
            for ((mean, squares), x) in self.mean.iter_mut().zip(&mut self.squares).zip(row) {
                let away = f64::from(*x) - *mean;
                *mean += away / self.count;
                *squares += away * (f64::from(*x) - *mean);
            }
        }
    }

    /// Returns the mean of each entry.
    pub fn mean(&self) -> &[f64] {
        &self.mean
    }

    /// Returns the standard deviation of entry `index`.
    pub fn deviation(&self, index: usize) -> f64 {
        if self.count < 2.0 {
            return 1.0;
        }
        let squares = match self.shared.iter().find(|range| range.contains(&index)) {
            Some(range) => self.squares[range.clone()].iter().sum::<f64>() / range.len() as f64,
            None => self.squares[index],
        };
        (squares / self.count + LEAST).sqrt()
    }

    /// Returns the standard deviations of all entries.
    pub fn deviations(&self) -> Vec<f64> {
        let own = |squares: &f64| if self.count < 2.0 { 1.0 } else { (squares / self.count + LEAST).sqrt() };
        let mut deviations: Vec<f64> = self.squares.iter().map(own).collect();
        for range in &self.shared {
            let shared = self.deviation(range.start);
            deviations[range.clone()].fill(shared);
        }
        deviations
    }

    /// Writes `(x - mean) / deviation` for each number. Vectors are stored row by row.
    pub fn apply(&self, rows: &[f32], out: &mut [f32]) {
        let width = self.mean.len();
        let inverse = self.deviations().into_iter().map(f64::recip);
        let factors: Vec<(f64, f64)> = self.mean.iter().copied().zip(inverse).collect();
        for (row, out) in rows.chunks_exact(width).zip(out.chunks_exact_mut(width)) {
            for ((x, out), (mean, factor)) in row.iter().zip(out).zip(&factors) {
                *out = ((f64::from(*x) - mean) * factor) as f32;
            }
        }
    }

    /// Folds the normalisation into the first layer of a network by changing the layer's `weights` (outputs x
    /// inputs, row by row) and `bias`.
    pub fn fold(&self, weights: &mut [f32], bias: &mut [f32]) {
        let deviations = self.deviations();
        for (row, bias) in weights.chunks_exact_mut(self.mean.len()).zip(bias) {
            let mut shift = 0.0;
            for (k, weight) in row.iter_mut().enumerate() {
                let scaled = f64::from(*weight) / deviations[k];
                shift += scaled * self.mean[k];
                *weight = scaled as f32;
            }
            *bias = (f64::from(*bias) - shift) as f32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_normalised_to_their_statistics() {
        let mut normaliser = Normaliser::new(2);
        let rows: Vec<f32> =
            (0..400).flat_map(|k| [3.0 + (k as f32).sin(), 1e3 * (k as f32).cos()]).collect();
        normaliser.update(&rows[..200]);
        normaliser.update(&rows[200..]);
        let mut out = vec![0.0; rows.len()];
        normaliser.apply(&rows, &mut out);
        for column in 0..2 {
            let values = || out.iter().skip(column).step_by(2).map(|x| f64::from(*x));
            let mean = values().sum::<f64>() / 400.0;
            let square = values().map(|x| x * x).sum::<f64>() / 400.0;
            assert!(mean.abs() < 1e-6 && (square - 1.0).abs() < 1e-5, "{column}: {mean} {square}");
        }
    }

    #[test]
    fn entries_of_a_range_share_one_deviation() {
        let ranges = core::iter::once(1..3).collect();
        let mut normaliser = Normaliser::new(3).with_shared_deviations(ranges);
        assert_eq!(normaliser.deviations(), [1.0; 3]);
        normaliser.update(&[1.0, 2.0, 5.0, 3.0, 4.0, 5.0]);
        let root = 0.5_f64.sqrt();
        for (index, expected) in [1.0, root, root].into_iter().enumerate() {
            assert!((normaliser.deviation(index) - expected).abs() < 1e-7, "{index}");
            assert_eq!(normaliser.deviation(index), normaliser.deviations()[index]);
        }
        // each entry keeps its mean
        assert_eq!(normaliser.mean(), [2.0, 3.0, 5.0]);
    }

    #[test]
    fn folding_into_a_layer_keeps_its_output() {
        let mut normaliser = Normaliser::new(2);
        normaliser.update(&[1.0, -4.0, 2.0, 6.0, 5.0, 1.0]);
        let layer = (vec![0.5, -1.5, 2.0, 0.25], vec![0.1, -0.2]);
        let mut folded = layer.clone();
        normaliser.fold(&mut folded.0, &mut folded.1);
        let raw = [3.0, 2.0];
        let mut scaled = [0.0; 2];
        normaliser.apply(&raw, &mut scaled);
        let output = |(weights, bias): &(Vec<f32>, Vec<f32>), x: &[f32; 2]| {
            [0, 1].map(|o| weights[2 * o] * x[0] + weights[2 * o + 1] * x[1] + bias[o])
        };
        for (a, b) in output(&layer, &scaled).iter().zip(output(&folded, &raw)) {
            assert!((a - b).abs() < 1e-5, "{a} {b}");
        }
    }
}
