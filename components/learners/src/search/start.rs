//! The start of a search.

use serde::{Deserialize, Serialize};

/// Start of a search: initial mean, initial exploration, and bounds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Start {
    /// Initial mean of each parameter.
    pub mean: Vec<f64>,
    /// Initial standard deviation of each parameter, at least 0. A parameter with deviation 0 keeps its
    /// value.
    pub deviation: Vec<f64>,
    /// Lower and upper bound of each parameter; `None` means unbounded.
    pub bounds: Option<Vec<[f64; 2]>>,
    /// Seed of the random numbers.
    pub seed: u64,
}

/// Error of an invalid start or setting of a search.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StartError {
    /// The number of entries differs from the number of parameters.
    #[error("found {found} {what}, expected {expected}, one for each parameter")]
    Count {
        /// Name of the counted entries.
        what: &'static str,
        /// Number of entries found.
        found: usize,
        /// Number of parameters.
        expected: usize,
    },
    /// There are no parameters.
    #[error("found no parameter, expected at least one")]
    Empty,
    /// A number is out of range.
    #[error("{what} of parameter {index} is {found}, expected {expected}")]
    Value {
        /// Name of the quantity.
        what: &'static str,
        /// Index of the parameter.
        index: usize,
        /// Value found.
        found: f64,
        /// Description of the valid range.
        expected: &'static str,
    },
    /// A setting of the method is out of range.
    #[error("setting `{key}` is {found}, expected {expected}")]
    Setting {
        /// Name of the setting.
        key: &'static str,
        /// Value found.
        found: f64,
        /// Description of the valid range.
        expected: &'static str,
    },
}

impl StartError {
    /// Checks a setting.
    pub(super) fn check(
        key: &'static str,
        found: f64,
        valid: bool,
        expected: &'static str,
    ) -> Result<(), Self> {
        if valid { Ok(()) } else { Err(Self::Setting { key, found, expected }) }
    }
}

impl Start {
    /// Creates a start without bounds.
    pub fn new(mean: Vec<f64>, deviation: Vec<f64>, seed: u64) -> Self {
        Self { mean, deviation, bounds: None, seed }
    }

    /// Returns the same start with bounds. There is one pair of bounds per parameter.
    #[must_use]
    pub fn within(mut self, bounds: Vec<[f64; 2]>) -> Self {
        self.bounds = Some(bounds);
        self
    }

    /// Returns the number of parameters.
    pub fn dimensions(&self) -> usize {
        self.mean.len()
    }

    pub(super) fn check(&self) -> Result<(), StartError> {
        let expected = self.dimensions();
        if expected == 0 {
            return Err(StartError::Empty);
        }
        let bounds = self.bounds.as_deref();
        for (what, found) in
            [("deviations", self.deviation.len()), ("bounds", bounds.map_or(expected, <[_]>::len))]
        {
            if found != expected {
                return Err(StartError::Count { what, found, expected });
            }
        }
        for index in 0..expected {
            let value = |what, found: f64, expected| StartError::Value { what, index, found, expected };
            let (mean, deviation) = (self.mean[index], self.deviation[index]);
            if !mean.is_finite() {
                return Err(value("the mean", mean, "a finite number"));
            }
            if !(deviation >= 0.0 && deviation.is_finite()) {
                return Err(value("the deviation", deviation, "a finite number of at least 0"));
            }
            if let Some([low, high]) = bounds.map(|bounds| bounds[index]) {
                if low.is_nan() || high.is_nan() || low >= high {
                    return Err(value("the upper bound", high, "more than the lower bound"));
                }
                if !(low..=high).contains(&mean) {
                    return Err(value("the mean", mean, "a number within the bounds"));
                }
            }
        }
        Ok(())
    }

    /// Returns the parameters of a point given in initial deviations from the initial mean. A point outside
    /// the bounds is reflected into them.
    pub(super) fn parameters(&self, unit: &[f64]) -> Vec<f64> {
        let scaled = self.mean.iter().zip(&self.deviation).zip(unit).map(|((m, d), u)| m + d * u);
        match &self.bounds {
            None => scaled.collect(),
            Some(bounds) => scaled.zip(bounds).map(|(x, bounds)| reflect(x, *bounds)).collect(),
        }
    }

    /// Returns the bounds of parameter `index` in initial deviations.
    pub(super) fn unit_bounds(&self, index: usize) -> [f64; 2] {
        let unbounded = [f64::NEG_INFINITY, f64::INFINITY];
        let bounds = self.bounds.as_ref().map_or(unbounded, |bounds| bounds[index]);
        if self.deviation[index] == 0.0 {
            return unbounded;
        }
        bounds.map(|bound| (bound - self.mean[index]) / self.deviation[index])
    }
}

/// Checks that bounds are present, finite and in order.
pub(super) fn check_bounds(bounds: &[[f64; 2]]) -> Result<(), StartError> {
    if bounds.is_empty() {
        return Err(StartError::Empty);
    }
    for (index, [low, high]) in bounds.iter().copied().enumerate() {
        let value = |what, found, expected| StartError::Value { what, index, found, expected };
        if !low.is_finite() {
            return Err(value("the lower bound", low, "a finite number"));
        }
        if !(high > low && high.is_finite()) {
            return Err(value("the upper bound", high, "a finite number above the lower bound"));
        }
    }
    Ok(())
}

/// Reflects a number into its bounds.
fn reflect(x: f64, [low, high]: [f64; 2]) -> f64 {
    if (low..=high).contains(&x) || x.is_nan() {
        return x;
    }
    if !(high - low).is_finite() {
        // at most one bound is finite
        let mirrored = if x < low { 2.0 * low - x } else { 2.0 * high - x };
        return mirrored.clamp(low, high);
    }
    let width = high - low;
    let offset = (x - low).rem_euclid(2.0 * width);
    let offset = if offset > width { 2.0 * width - offset } else { offset };
    (low + offset).clamp(low, high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_beyond_bounds_are_reflected() {
        let pairs = [(0.5, 0.5), (1.25, 0.75), (-0.25, 0.25), (2.25, 0.25), (-1.25, 0.75), (7.0, 1.0)];
        for (x, expected) in pairs {
            assert!((reflect(x, [0.0, 1.0]) - expected).abs() < 1e-15, "{x}");
        }
        assert_eq!(reflect(-3.0, [-1.0, f64::INFINITY]), 1.0);
        assert_eq!(reflect(3.0, [f64::NEG_INFINITY, 1.0]), -1.0);
    }

    #[test]
    fn mistakes_in_a_start_are_named() {
        let start = Start::new(vec![0.0, 1.0], vec![1.0, 2.0], 0);
        assert_eq!(start.check(), Ok(()));
        let refused = [
            (Start::new(vec![], vec![], 0), "found no parameter, expected at least one"),
            (
                Start { deviation: vec![1.0], ..start.clone() },
                "found 1 deviations, expected 2, one for each parameter",
            ),
            (
                Start { deviation: vec![1.0, -1.0], ..start.clone() },
                "the deviation of parameter 1 is -1, expected a finite number of at least 0",
            ),
            (
                start.clone().within(vec![[-1.0, 1.0], [2.0, 3.0]]),
                "the mean of parameter 1 is 1, expected a number within the bounds",
            ),
            (
                start.clone().within(vec![[-1.0, 1.0], [3.0, f64::NAN]]),
                "the upper bound of parameter 1 is NaN, expected more than the lower bound",
            ),
        ];
        for (start, message) in refused {
            assert_eq!(start.check().expect_err(message).to_string(), message);
        }
    }
}
