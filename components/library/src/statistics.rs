//! Means with their spread.

/// Returns the mean and sample standard deviation of `values` (with `n - 1` in the denominator; 0 for a
/// single value).
pub fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let n = values.len().max(1) as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (squares / (n - 1.0).max(1.0)).sqrt())
}

/// Returns the mean of `values` and its standard error, `s / sqrt(n)`.
pub fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let (mean, deviation) = mean_and_deviation(values);
    (mean, deviation / (values.len().max(1) as f64).sqrt())
}

/// Returns the standard error of a proportion `rate` observed in `count` trials, `sqrt(p (1 - p) / n)`.
pub fn proportion_error(rate: f64, count: usize) -> f64 {
    (rate * (1.0 - rate) / count.max(1) as f64).sqrt()
}

/// Returns the ratio of the sums of `parts` and `wholes`, which are paired, and its standard error to first
/// order (the delta method).
///
/// ```
/// use motorium_library::statistics::ratio_and_error;
///
/// assert_eq!(ratio_and_error(&[1.0, 2.0, 3.0], &[2.0, 4.0, 6.0]), (0.5, 0.0));
/// ```
pub fn ratio_and_error(parts: &[f64], wholes: &[f64]) -> (f64, f64) {
    let whole = wholes.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let ratio = parts.iter().sum::<f64>() / whole;
    let squares: f64 = parts.iter().zip(wholes).map(|(part, whole)| (part - ratio * whole).powi(2)).sum();
    let n = parts.len().max(1) as f64;
    (ratio, (squares * n / (n - 1.0).max(1.0)).sqrt() / whole)
}

/// Returns the standard errors of the variance fractions of principal components of `count` samples, for each
/// component and cumulatively. `shares` are the fractions in descending order, with a sum of 1. The errors
/// follow from
///
/// ```text
/// var(sum of a set K of shares) = 2 / count ((1 - P)^2 sum_K p^2 + P^2 sum_others p^2),   P = sum_K p
/// ```
///
/// to first order in `1 / count`, for normal samples, whose eigenvalues are independent with the variance `2
/// lambda^2 / count` (Anderson, *Asymptotic theory for principal component analysis*, 1963).
pub fn share_errors(shares: &[f64], count: usize) -> Vec<(f64, f64)> {
    let all: f64 = shares.iter().map(|share| share * share).sum();
    let error = |sum: f64, squares: f64| {
        let variance = (1.0 - sum).powi(2) * squares + sum * sum * (all - squares).max(0.0);
        (2.0 / count.max(1) as f64 * variance).sqrt()
    };
    let (mut sum, mut squares) = (0.0, 0.0);
    let of = |share: &f64| {
        sum += share;
        squares += share * share;
        (error(*share, share * share), error(sum, squares))
    };
    shares.iter().map(of).collect()
}

/// Formats a mean with its error, to two digits of the error: `0.3004 +- 0.0041`. An error of 0, as for a
/// single value, is omitted, and the mean then has four digits.
///
/// ```
/// use motorium_library::statistics::with_error;
///
/// assert_eq!(with_error(0.000_300_41, 0.000_004_1), "0.0003004 +- 0.0000041");
/// assert_eq!(with_error(12.34, 5.6), "12.3 +- 5.6");
/// assert_eq!(with_error(0.5, 0.0), "0.5");
/// assert_eq!(with_error(2.0 / 3.0, 0.0), "0.6667");
/// ```
pub fn with_error(mean: f64, error: f64) -> String {
    if !(error.is_finite() && error > 0.0) {
        let digits = (3.0 - mean.abs().max(1e-9).log10().floor()).clamp(0.0, 12.0) as usize;
        let text = format!("{mean:.digits$}");
        return match text.contains('.') {
            true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
            false => text,
        };
    }
    let digits = (1.0 - error.log10().floor()).clamp(0.0, 12.0) as usize;
    format!("{mean:.digits$} +- {error:.digits$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_match_hand_computed_values() {
        let (mean, deviation) = mean_and_deviation(&[2.0, 4.0, 4.0, 6.0]);
        assert_eq!(mean, 4.0);
        assert!((deviation - (8.0_f64 / 3.0).sqrt()).abs() < 1e-15);
        let (mean, error) = mean_and_error(&[2.0, 4.0, 4.0, 6.0]);
        assert!(mean == 4.0 && (error - (8.0_f64 / 3.0).sqrt() / 2.0).abs() < 1e-15);
        assert_eq!(mean_and_deviation(&[3.0]), (3.0, 0.0));
        assert!((proportion_error(0.9, 100) - 0.03).abs() < 1e-15);
        // residuals of 3 / 8: 1 - 0.75, 2 - 2.25: 0.25 each
        let (ratio, error) = ratio_and_error(&[1.0, 2.0], &[2.0, 6.0]);
        assert!(ratio == 0.375 && (error - (2.0 * 2.0 * 0.25_f64.powi(2)).sqrt() / 8.0).abs() < 1e-15);
    }

    #[test]
    fn variance_share_errors_match_resampling() {
        // three independent normal numbers of the variances 4, 2, 1
        let (deviations, count, trials) = ([2.0, 2.0_f64.sqrt(), 1.0], 400, 400);
        let mut state = 7_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            ((state >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
        };
        let mut normal = || (-2.0 * uniform().ln()).sqrt() * (core::f64::consts::TAU * uniform()).cos();
        let (mut first, mut two) = (Vec::new(), Vec::new());
        for _ in 0..trials {
            let of = |deviation: f64| (0..count).map(|_| (deviation * normal()).powi(2)).sum::<f64>();
            let [a, b, c] = deviations.map(of);
            first.push(a / (a + b + c));
            two.push((a + b) / (a + b + c));
        }
        let errors = share_errors(&[4.0 / 7.0, 2.0 / 7.0, 1.0 / 7.0], count);
        let (of_first, of_two) = (mean_and_deviation(&first).1, mean_and_deviation(&two).1);
        assert!((errors[0].0 / of_first - 1.0).abs() < 0.12, "{} {of_first}", errors[0].0);
        assert!((errors[1].1 / of_two - 1.0).abs() < 0.12, "{} {of_two}", errors[1].1);
        assert!(errors[0].0 == errors[0].1 && errors[2].1 < 1e-9);
    }
}
