//! The basis functions of a probabilistic primitive.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::ProMpError;
use crate::ValueError;

/// Normalised basis functions over the phase, `phi_i(p) = b_i(p) / sum_j b_j(p)`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", tag = "kind", deny_unknown_fields)]
pub enum ProMpBasis {
    /// Gaussians for strokes: `b_i = exp(-(p - c_i)^2 / 2h)`, `c_i = i / (N - 1)`, `h = -1 / (8 N^2
    /// ln(overlap))`.
    Gaussian {
        /// Number of functions `N`, at least 2.
        count: usize,
        /// Overlap of neighbouring functions, in (0, 1).
        overlap: f64,
    },
    /// Von Mises functions for rhythms: `b_i = exp((cos(2 pi (p - c_i)) - 1) / h)`, `c_i = i / N`.
    Periodic {
        /// Number of functions `N`, at least 3.
        count: usize,
        /// Width `h`, more than 0.
        width: f64,
    },
}

impl ProMpBasis {
    /// Creates Gaussian functions. An overlap of 0.7 is usual.
    ///
    /// # Errors
    /// [`ProMpError`] if there are fewer than two functions, or the overlap is outside (0, 1).
    pub fn gaussian(count: usize, overlap: f64) -> Result<Self, ProMpError> {
        let basis = Self::Gaussian { count, overlap };
        basis.check()?;
        Ok(basis)
    }

    /// Creates `count` von Mises functions that are as wide as `count` Gaussians with an overlap of 0.7.
    ///
    /// # Errors
    /// [`ProMpError`] if there are fewer than three functions.
    pub fn periodic(count: usize) -> Result<Self, ProMpError> {
        let squared = -1.0 / (8.0 * (count * count) as f64 * 0.7_f64.ln());
        let basis = Self::Periodic { count, width: squared * std::f64::consts::TAU.powi(2) };
        basis.check()?;
        Ok(basis)
    }

    pub(super) fn check(&self) -> Result<(), ProMpError> {
        let out_of_range =
            |name, value, expected| Err(ProMpError::Value(ValueError::OutOfRange { name, value, expected }));
        match *self {
            Self::Gaussian { count, .. } if count < 2 => {
                out_of_range("the number of basis functions", count as f64, "at least 2")
            }
            Self::Gaussian { overlap, .. } if !(overlap > 0.0 && overlap < 1.0) => {
                out_of_range("overlap", overlap, "between 0 and 1, both excluded")
            }
            Self::Periodic { count, .. } if count < 3 => {
                out_of_range("the number of basis functions", count as f64, "at least 3")
            }
            Self::Periodic { width, .. } if !(width > 0.0 && width.is_finite()) => {
                out_of_range("width", width, "a positive number")
            }
            _ => Ok(()),
        }
    }

    /// Returns the number of functions.
    pub fn count(&self) -> usize {
        match *self {
            Self::Gaussian { count, .. } | Self::Periodic { count, .. } => count,
        }
    }

    /// Writes the value of every function and its derivative with respect to the phase.
    pub fn evaluate(&self, phase: f64, values: &mut [f64], slopes: &mut [f64]) {
        let exponent = |i: usize| match *self {
            Self::Gaussian { count, overlap } => {
                let h = -1.0 / (8.0 * (count * count) as f64 * overlap.ln());
                let d = phase - i as f64 / (count - 1) as f64;
                (-d * d / (2.0 * h), -d / h)
            }
            Self::Periodic { count, width } => {
                let turn = std::f64::consts::TAU;
                let (sine, cosine) = (turn * (phase - i as f64 / count as f64)).sin_cos();
                ((cosine - 1.0) / width, -turn * sine / width)
            }
        };
        let mut largest = f64::NEG_INFINITY;
        for (i, (value, slope)) in values.iter_mut().zip(slopes.iter_mut()).enumerate() {
            (*value, *slope) = exponent(i);
            largest = largest.max(*value);
        }
        let (mut sum, mut sum_slope) = (0.0, 0.0);
        for (value, slope) in values.iter_mut().zip(slopes.iter_mut()) {
            *value = (*value - largest).exp();
            *slope *= *value;
            sum += *value;
            sum_slope += *slope;
        }
        for (value, slope) in values.iter_mut().zip(slopes.iter_mut()) {
            *slope = (*slope - *value * sum_slope / sum) / sum;
            *value /= sum;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_sum_to_one_and_slopes_match_differences() {
        for basis in [ProMpBasis::gaussian(9, 0.7).unwrap(), ProMpBasis::periodic(9).unwrap()] {
            let at = |p: f64| {
                let (mut values, mut slopes) = ([0.0; 9], [0.0; 9]);
                basis.evaluate(p, &mut values, &mut slopes);
                (values, slopes)
            };
            for k in 0..=20 {
                let p = f64::from(k) / 20.0;
                let (values, slopes) = at(p);
                assert!((values.iter().sum::<f64>() - 1.0).abs() < 1e-14);
                let (before, after) = (at(p - 1e-6).0, at(p + 1e-6).0);
                for i in 0..9 {
                    assert!(((after[i] - before[i]) / 2e-6 - slopes[i]).abs() < 1e-7);
                }
            }
        }
    }
}
