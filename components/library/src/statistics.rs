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

/// A mean and its error in words, to two digits of the error: `0.3004 +- 0.0041`. An error of 0, as of a single value, is
/// left out.
///
/// ```
/// use motorium_library::statistics::with_error;
///
/// assert_eq!(with_error(0.000_300_41, 0.000_004_1), "0.0003004 +- 0.0000041");
/// assert_eq!(with_error(12.34, 5.6), "12.3 +- 5.6");
/// assert_eq!(with_error(0.5, 0.0), "0.5");
/// ```
pub fn with_error(mean: f64, error: f64) -> String {
    if !(error.is_finite() && error > 0.0) {
        return mean.to_string();
    }
    let digits = (1.0 - error.log10().floor()).clamp(0.0, 12.0) as usize;
    format!("{mean:.digits$} +- {error:.digits$}")
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
