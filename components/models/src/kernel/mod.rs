//! Covariance functions of Gaussian processes.
//!
//! With `r^2 = sum_d (x_d - z_d)^2 / l_d^2` and variance `s`:
//!
//! | kernel | value |
//! |---|---|
//! | RBF | `s exp(-r^2 / 2)` |
//! | Matern 3/2 | `s (1 + sqrt(3) r) exp(-sqrt(3) r)` |
//! | Matern 5/2 | `s (1 + sqrt(5) r + 5/3 r^2) exp(-sqrt(5) r)` |
//! | periodic | `s exp(-1/2 sum_d sin^2(pi (x_d - z_d) / p) / l_d^2)` |
//! | linear | `sum_d s_d x_d z_d` |
//! | bias | `s` |
//! | white | `s` if both points are the same point, otherwise 0 |
//!
//! Parameters are the logarithms of variances, length scales and periods, in this order; the parameters of a
//! sum or product are the parameters of its parts, one part after the other. Reference: Rasmussen, Williams,
//! *Gaussian Processes for Machine Learning*, chapter 4.

mod gradient;
mod points;
mod stationary;

pub use points::Points;
use serde::{Deserialize, Serialize};
use stationary::Profile;
pub use stationary::Stationary;

/// A covariance function of a Gaussian process.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kernel {
    /// Radial basis function; samples are infinitely differentiable.
    Rbf(Stationary),
    /// Matern function with `nu = 3/2`; samples are once differentiable.
    Matern32(Stationary),
    /// Matern function with `nu = 5/2`; samples are twice differentiable.
    Matern52(Stationary),
    /// Function that is periodic in each dimension.
    Periodic {
        /// Variance and length scales.
        scales: Stationary,
        /// Period in units of the input.
        period: f64,
    },
    /// Linear function, with one variance for each dimension.
    Linear(Vec<f64>),
    /// Constant with this variance.
    Bias(f64),
    /// Independent noise with this variance.
    White(f64),
    /// Sum of several kernels.
    Sum(Vec<Kernel>),
    /// Product of several kernels.
    Product(Vec<Kernel>),
}

impl Kernel {
    /// Creates an RBF kernel of variance 1 with one length scale for each dimension.
    pub fn rbf(dimensions: usize, length: f64) -> Self {
        Self::Rbf(Stationary::new(1.0, &vec![length; dimensions]))
    }

    /// Creates a Matern 5/2 kernel of variance 1 with one length scale for each dimension.
    pub fn matern52(dimensions: usize, length: f64) -> Self {
        Self::Matern52(Stationary::new(1.0, &vec![length; dimensions]))
    }

    /// Returns `true` if the kernel matches the number of input dimensions and every parameter is positive
    /// and finite.
    pub fn is_valid(&self, dimensions: usize) -> bool {
        let good = |value: &f64| *value > 0.0 && value.is_finite();
        let scales = |s: &Stationary| {
            good(&s.variance)
                && s.lengths.iter().all(good)
                && (s.lengths.len() == 1 || s.lengths.len() == dimensions)
        };
        match self {
            Self::Rbf(s) | Self::Matern32(s) | Self::Matern52(s) => scales(s),
            Self::Periodic { scales: s, period } => scales(s) && good(period),
            Self::Linear(variances) => variances.len() == dimensions && variances.iter().all(good),
            Self::Bias(variance) | Self::White(variance) => good(variance),
            Self::Sum(parts) | Self::Product(parts) => {
                !parts.is_empty() && parts.iter().all(|part| part.is_valid(dimensions))
            }
        }
    }

    /// Calls a function with each parameter in order.
    fn each(&mut self, visit: &mut impl FnMut(&mut f64)) {
        match self {
            Self::Rbf(s) | Self::Matern32(s) | Self::Matern52(s) => {
                visit(&mut s.variance);
                s.lengths.iter_mut().for_each(visit);
            }
            Self::Periodic { scales: s, period } => {
                visit(&mut s.variance);
                s.lengths.iter_mut().for_each(&mut *visit);
                visit(period);
            }
            Self::Linear(variances) => variances.iter_mut().for_each(visit),
            Self::Bias(variance) | Self::White(variance) => visit(variance),
            Self::Sum(parts) | Self::Product(parts) => parts.iter_mut().for_each(|part| part.each(visit)),
        }
    }

    /// Returns the number of parameters.
    pub fn parameter_count(&self) -> usize {
        match self {
            Self::Rbf(s) | Self::Matern32(s) | Self::Matern52(s) => 1 + s.lengths.len(),
            Self::Periodic { scales: s, .. } => 2 + s.lengths.len(),
            Self::Linear(variances) => variances.len(),
            Self::Bias(_) | Self::White(_) => 1,
            Self::Sum(parts) | Self::Product(parts) => parts.iter().map(Self::parameter_count).sum(),
        }
    }

    /// Returns the logarithms of all parameters.
    pub fn parameters(&self) -> Vec<f64> {
        let mut found = Vec::with_capacity(self.parameter_count());
        self.clone().each(&mut |value| found.push(value.ln()));
        found
    }

    /// Sets the logarithms of all parameters.
    ///
    /// # Panics
    /// If `logarithms` has fewer entries than [`parameter_count`](Self::parameter_count).
    pub fn set_parameters(&mut self, logarithms: &[f64]) {
        let mut next = logarithms.iter();
        self.each(&mut |value| *value = next.next().expect("a parameter").exp());
    }

    /// Returns the number of scratch rows required by [`row`](Self::row).
    pub fn scratch_rows(&self) -> usize {
        match self {
            Self::Sum(parts) | Self::Product(parts) => {
                1 + parts.iter().map(Self::scratch_rows).max().unwrap_or(0)
            }
            _ => 0,
        }
    }

    /// Writes to `out` the covariances of `query` with the points from index `first` on. `own` is the index
    /// of the query if the query is one of the points. Does not allocate.
    ///
    /// # Panics
    /// If `scratch` has fewer than [`scratch_rows`](Self::scratch_rows) rows of the length of `out`.
    pub fn row(
        &self,
        (query, own): (&[f64], Option<usize>),
        (points, first): (&Points, usize),
        out: &mut [f64],
        scratch: &mut [f64],
    ) {
        match self {
            Self::Rbf(s) => stationary::row(Profile::Rbf, s, query, points, first, out),
            Self::Matern32(s) => stationary::row(Profile::Matern32, s, query, points, first, out),
            Self::Matern52(s) => stationary::row(Profile::Matern52, s, query, points, first, out),
            Self::Periodic { scales, period } => {
                out.fill(0.0);
                for (d, x) in query.iter().enumerate() {
                    let (rate, length) = (std::f64::consts::PI / period, scales.length(d));
                    for (out, z) in out.iter_mut().zip(&points.coordinate(d)[first..]) {
                        let sine = (rate * (x - z)).sin() / length;
                        *out -= 0.5 * sine * sine;
                    }
                }
                out.iter_mut().for_each(|out| *out = scales.variance * out.exp());
            }
            Self::Linear(variances) => {
                out.fill(0.0);
                for (d, (x, variance)) in query.iter().zip(variances).enumerate() {
                    for (out, z) in out.iter_mut().zip(&points.coordinate(d)[first..]) {
                        *out += variance * x * z;
                    }
                }
            }
            Self::Bias(variance) => out.fill(*variance),
            Self::White(variance) => {
                out.fill(0.0);
                if let Some(own) = own.and_then(|own| own.checked_sub(first)).and_then(|own| out.get_mut(own))
                {
                    *own = *variance;
                }
            }
            Self::Sum(parts) => {
                let (row, rest) = scratch.split_at_mut(out.len());
                out.fill(0.0);
                for part in parts {
                    part.row((query, own), (points, first), row, rest);
                    out.iter_mut().zip(&*row).for_each(|(out, row)| *out += row);
                }
            }
            Self::Product(parts) => {
                let (row, rest) = scratch.split_at_mut(out.len());
                out.fill(1.0);
                for part in parts {
                    part.row((query, own), (points, first), row, rest);
                    out.iter_mut().zip(&*row).for_each(|(out, row)| *out *= row);
                }
            }
        }
    }

    /// Writes covariances like [`row`](Self::row) and, for an RBF or Matern kernel, their derivatives with
    /// respect to `r^2 / 2`. Other kernels leave `slopes` unchanged.
    ///
    /// # Panics
    /// Same as [`row`](Self::row). Also if `slopes` is shorter than `out`.
    pub fn row_with_slopes(
        &self,
        (query, own): (&[f64], Option<usize>),
        (points, first): (&Points, usize),
        (out, slopes): (&mut [f64], &mut [f64]),
        scratch: &mut [f64],
    ) {
        let (profile, s) = match self {
            Self::Rbf(s) => (Profile::Rbf, s),
            Self::Matern32(s) => (Profile::Matern32, s),
            Self::Matern52(s) => (Profile::Matern52, s),
            _ => return self.row((query, own), (points, first), out, scratch),
        };
        let slopes = &mut slopes[..out.len()];
        stationary::row_with_slopes(profile, s, query, points, first, (out, slopes));
    }

    /// Returns the variance at the point `x`. If `own` is `true`, the variance includes independent noise.
    pub fn variance(&self, x: &[f64], own: bool) -> f64 {
        match self {
            Self::Rbf(s) | Self::Matern32(s) | Self::Matern52(s) | Self::Periodic { scales: s, .. } => {
                s.variance
            }
            Self::Linear(variances) => variances.iter().zip(x).map(|(v, x)| v * x * x).sum(),
            Self::Bias(variance) => *variance,
            Self::White(variance) => {
                if own {
                    *variance
                } else {
                    0.0
                }
            }
            Self::Sum(parts) => parts.iter().map(|part| part.variance(x, own)).sum(),
            Self::Product(parts) => parts.iter().map(|part| part.variance(x, own)).product(),
        }
    }
}

/// Writes the RBF covariances of a query with all points.
pub(crate) fn stationary_row(s: &Stationary, query: &[f64], points: &Points, out: &mut [f64]) {
    stationary::row(Profile::Rbf, s, query, points, 0, out);
}
