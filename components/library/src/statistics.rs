//! Means with their spread.

/// Mean and sample standard deviation (with `n - 1` in the denominator; 0 of a single value) of `values`.
pub fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (squares / (n - 1.0).max(1.0)).sqrt())
}

/// Mean of `values` and its standard error, `s / sqrt(n)`.
pub fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let (mean, deviation) = mean_and_deviation(values);
    (mean, deviation / (values.len().max(1) as f64).sqrt())
}

/// Standard error of a proportion `rate` found in `count` trials, `sqrt(p (1 - p) / n)`.
pub fn proportion_error(rate: f64, count: usize) -> f64 {
    (rate * (1.0 - rate) / count.max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_statistics_of_a_few_numbers_are_those_computed_by_hand() {
        let (mean, deviation) = mean_and_deviation(&[2.0, 4.0, 4.0, 6.0]);
        assert_eq!(mean, 4.0);
        assert!((deviation - (8.0_f64 / 3.0).sqrt()).abs() < 1e-15);
        let (mean, error) = mean_and_error(&[2.0, 4.0, 4.0, 6.0]);
        assert!(mean == 4.0 && (error - (8.0_f64 / 3.0).sqrt() / 2.0).abs() < 1e-15);
        assert_eq!(mean_and_deviation(&[3.0]), (3.0, 0.0));
        assert!((proportion_error(0.9, 100) - 0.03).abs() < 1e-15);
    }
}
