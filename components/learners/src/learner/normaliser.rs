//! Running means and variances.

use serde::{Deserialize, Serialize};

/// Running mean and variance of vectors, accumulated in double precision in order of arrival.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Normaliser {
    count: f64,
    mean: Vec<f64>,
    /// Sums of squared differences from the mean.
    squares: Vec<f64>,
}

/// Added to variances.
const LEAST: f64 = 1e-8;

impl Normaliser {
    /// Creates a normaliser for vectors of `width` numbers. Mean 0 and variance 1 apply until the first
    /// vector arrives.
    pub fn new(width: usize) -> Self {
        Self { count: 0.0, mean: vec![0.0; width], squares: vec![0.0; width] }
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
        if self.count < 2.0 { 1.0 } else { (self.squares[index] / self.count + LEAST).sqrt() }
    }

    /// Writes `(x - mean) / deviation` for each number. Vectors are stored row by row.
    pub fn apply(&self, rows: &[f32], out: &mut [f32]) {
        let width = self.mean.len();
        let factors: Vec<(f64, f64)> = (0..width).map(|k| (self.mean[k], 1.0 / self.deviation(k))).collect();
        for (row, out) in rows.chunks_exact(width).zip(out.chunks_exact_mut(width)) {
            for ((x, out), (mean, factor)) in row.iter().zip(out).zip(&factors) {
                *out = ((f64::from(*x) - mean) * factor) as f32;
            }
        }
    }

    /// Folds the normalisation into the first layer of a network by changing the layer's `weights` (outputs x
    /// inputs, row by row) and `bias`.
    pub fn fold(&self, weights: &mut [f32], bias: &mut [f32]) {
        for (row, bias) in weights.chunks_exact_mut(self.mean.len()).zip(bias) {
            let mut shift = 0.0;
            for (k, weight) in row.iter_mut().enumerate() {
                let scaled = f64::from(*weight) / self.deviation(k);
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
