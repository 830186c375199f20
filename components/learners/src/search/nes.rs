//! Natural evolution strategies.

use motorium_algebra::symmetric_eigen;
use nalgebra::{DMatrix, DVector};
use rand_distr::{Distribution as _, StandardNormal};
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};

use super::cma::default_population;
use super::{Distribution, Generations, Samples, Start, StartError};

/// Settings of [`SeparableNes`] and [`ExponentialNes`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NesSettings {
    /// Number of candidates per generation, at least 2. Default `4 + floor(3 ln n)` for `n` parameters.
    pub population: Option<usize>,
    /// Learning rate of the deviations, more than 0. Default `(3 + ln n) / (5 sqrt n)` for SNES and `(9 + 3
    /// ln n) / (5 n sqrt n)` for xNES, at most 1.
    pub rate: Option<f64>,
}

impl NesSettings {
    fn check(self) -> Result<(), StartError> {
        let (population, rate) = (self.population.unwrap_or(2), self.rate.unwrap_or(1.0));
        StartError::check("population", population as f64, population >= 2, "at least 2")?;
        StartError::check("rate", rate, rate > 0.0 && rate.is_finite(), "above 0")
    }
}

/// Natural gradient ascent on the mean and on one standard deviation per parameter (SNES).
///
/// With utilities `u_i` by rank and `s_i = (x_i - mean) / deviation`, element by element:
///
/// ```text
/// mean'      = mean + deviation sum_i u_i s_i
/// deviation' = deviation exp(rate / 2 sum_i u_i (s_i^2 - 1))
/// u_i        = max(0, ln(lambda / 2 + 1) - ln i) / sum_j max(0, ln(lambda / 2 + 1) - ln j) - 1 / lambda
/// ```
///
/// Source: Wierstra, Schaul, Glasmachers, Sun, Peters, Schmidhuber, *Natural evolution strategies*, Journal
/// of Machine Learning Research 15, 2014, algorithm 6 and table 1.
pub type SeparableNes = Generations<NaturalSeparable>;

/// Natural gradient ascent on the mean and the full covariance `A A^T` (xNES), with `A = sigma B`.
///
/// With `s_i = A^-1 (x_i - mean)`, utilities as for [`SeparableNes`], and the learning rate `r`:
///
/// ```text
/// G_d    = sum_i u_i s_i
/// G_M    = sum_i u_i (s_i s_i^T - I),  g = tr(G_M) / n,  G_B = G_M - g I
/// mean'  = mean + sigma B G_d
/// sigma' = sigma exp(r g / 2)
/// B'     = B exp(r G_B / 2)
/// ```
///
/// Source: Wierstra et al. 2014, algorithm 5 and table 1.
pub type ExponentialNes = Generations<Natural>;

/// Search distribution of [`SeparableNes`].
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct NaturalSeparable {
    utilities: Vec<f64>,
    rate: f64,
    mean: Vec<f64>,
    deviation: Vec<f64>,
}

/// Search distribution of [`ExponentialNes`].
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Natural {
    utilities: Vec<f64>,
    rate: f64,
    mean: Vec<f64>,
    sigma: f64,
    /// `B` and its inverse, column by column.
    shape: Vec<f64>,
    inverse: Vec<f64>,
}

/// Returns the utilities of the ranks of a generation, best first.
fn utilities(population: usize) -> Vec<f64> {
    let count = population as f64;
    let raw: Vec<f64> =
        (1..=population).map(|i| ((count / 2.0 + 1.0).ln() - (i as f64).ln()).max(0.0)).collect();
    let sum: f64 = raw.iter().sum();
    raw.iter().map(|u| u / sum - 1.0 / count).collect()
}

impl SeparableNes {
    /// Creates a search from `start`.
    ///
    /// # Errors
    ///
    /// [`StartError`] if the start or a setting is invalid.
    pub fn new(start: Start, settings: NesSettings) -> Result<Self, StartError> {
        settings.check()?;
        Self::build(start, |start| {
            let n = start.dimensions();
            let size = n as f64;
            let rate = settings.rate.unwrap_or_else(|| (3.0 + size.ln()) / (5.0 * size.sqrt()));
            let utilities = utilities(settings.population.unwrap_or_else(|| default_population(n)));
            Ok(NaturalSeparable { utilities, rate, mean: vec![0.0; n], deviation: vec![1.0; n] })
        })
    }
}

impl ExponentialNes {
    /// Creates a search from `start`.
    ///
    /// # Errors
    ///
    /// [`StartError`] if the start or a setting is invalid.
    pub fn new(start: Start, settings: NesSettings) -> Result<Self, StartError> {
        settings.check()?;
        Self::build(start, |start| {
            let n = start.dimensions();
            let size = n as f64;
            let default = || ((9.0 + 3.0 * size.ln()) / (5.0 * size * size.sqrt())).min(1.0);
            let utilities = utilities(settings.population.unwrap_or_else(|| default_population(n)));
            let identity = DMatrix::<f64>::identity(n, n).as_slice().to_vec();
            Ok(Natural {
                utilities,
                rate: settings.rate.unwrap_or_else(default),
                mean: vec![0.0; n],
                sigma: 1.0,
                shape: identity.clone(),
                inverse: identity,
            })
        })
    }
}

impl Distribution for NaturalSeparable {
    const METHOD: &'static str = "snes";

    fn dimensions(&self) -> usize {
        self.mean.len()
    }

    fn population(&self) -> usize {
        self.utilities.len()
    }

    fn sample(&mut self, _: usize, random: &mut Pcg64, point: &mut [f64]) {
        for (x, (mean, deviation)) in point.iter_mut().zip(self.mean.iter().zip(&self.deviation)) {
            let noise: f64 = StandardNormal.sample(random);
            *x = mean + deviation * noise;
        }
    }

    fn update(&mut self, samples: &Samples<'_>, _: &mut Pcg64) {
        for (i, (mean, deviation)) in self.mean.iter_mut().zip(&mut self.deviation).enumerate() {
            let (mut first, mut second) = (0.0, 0.0);
            for (index, utility) in samples.order.iter().zip(&self.utilities) {
                let s = (samples.point(*index)[i] - *mean) / *deviation;
                first += utility * s;
                second += utility * (s * s - 1.0);
            }
            *mean += *deviation * first;
            *deviation = (*deviation * (0.5 * self.rate * second).exp()).clamp(1e-150, 1e150);
        }
    }

    fn mean(&self, mean: &mut [f64]) {
        mean.copy_from_slice(&self.mean);
    }
}

impl Distribution for Natural {
    const METHOD: &'static str = "xnes";

    fn dimensions(&self) -> usize {
        self.mean.len()
    }

    fn population(&self) -> usize {
        self.utilities.len()
    }

    fn sample(&mut self, _: usize, random: &mut Pcg64, point: &mut [f64]) {
        point.copy_from_slice(&self.mean);
        for column in self.shape.chunks_exact(self.mean.len()) {
            let noise: f64 = StandardNormal.sample(random);
            let length = self.sigma * noise;
            point.iter_mut().zip(column).for_each(|(x, entry)| *x += length * entry);
        }
    }

    fn update(&mut self, samples: &Samples<'_>, _: &mut Pcg64) {
        let n = self.mean.len();
        let shape = DMatrix::from_column_slice(n, n, &self.shape);
        let inverse = DMatrix::from_column_slice(n, n, &self.inverse);
        let mut direction = DVector::zeros(n);
        let mut curvature = DMatrix::<f64>::zeros(n, n);
        let mean = DVector::from_column_slice(&self.mean);
        for (index, utility) in samples.order.iter().zip(&self.utilities) {
            let away = DVector::from_column_slice(samples.point(*index)) - &mean;
            let s = &inverse * away / self.sigma;
            direction.axpy(*utility, &s, 1.0);
            curvature.ger(*utility, &s, &s, 1.0);
        }
        // the utilities add up to 0, so the identity matrices cancel
        let trace = curvature.trace() / n as f64;
        (0..n).for_each(|i| curvature[(i, i)] -= trace);
        let step = &shape * direction * self.sigma;
        self.mean.iter_mut().zip(step.iter()).for_each(|(mean, step)| *mean += step);
        self.sigma = (self.sigma * (0.5 * self.rate * trace).exp()).clamp(1e-150, 1e150);
        let eigen = symmetric_eigen(curvature);
        let power = |sign: f64| {
            let mut scaled = eigen.vectors.clone();
            for (mut column, value) in scaled.column_iter_mut().zip(&eigen.values) {
                column *= (sign * 0.5 * self.rate * value).exp();
            }
            scaled * eigen.vectors.transpose()
        };
        self.shape.copy_from_slice((shape * power(1.0)).as_slice());
        self.inverse.copy_from_slice((power(-1.0) * inverse).as_slice());
    }

    fn mean(&self, mean: &mut [f64]) {
        mean.copy_from_slice(&self.mean);
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Search as _, tests::rollouts};
    use super::*;
    use rand::SeedableRng as _;

    #[test]
    fn utilities_sum_to_zero_and_decrease_with_rank() {
        let found = utilities(10);
        assert!(found.iter().sum::<f64>().abs() < 1e-15);
        assert!(found.is_sorted_by(|a, b| a >= b));
        assert!((found[9] + 0.1).abs() < 1e-15);
    }

    #[test]
    fn one_separable_update_equals_the_equations() {
        let start = Start::new(vec![0.0], vec![1.0], 0);
        let settings = NesSettings { population: Some(2), rate: Some(0.5) };
        let mut found = SeparableNes::new(start, settings).expect("a search").distribution().clone();
        let samples = Samples { points: &[2.0, -1.0], rewards: &[1.0, 0.0], order: &[0, 1] };
        found.update(&samples, &mut Pcg64::seed_from_u64(0));
        // utilities 1/2 and -1/2
        assert!((found.mean[0] - 1.5).abs() < 1e-15);
        assert!((found.deviation[0] - (0.25_f64 * 1.5).exp()).abs() < 1e-15);
    }

    #[test]
    fn rotated_ellipsoid_is_descended_by_xnes() {
        // condition number 1e4, along the diagonal of the plane
        let value = |x: &[f64]| -(x[0] + x[1] - 1.0).powi(2) - 1e4 * (x[0] - x[1] + 2.0).powi(2);
        let start = Start::new(vec![0.0; 2], vec![1.0; 2], 1);
        let mut search = ExponentialNes::new(start, NesSettings::default()).expect("a search");
        rollouts(&mut search, 3000, value);
        assert!(search.best().expect("rewards").1 > -1e-9, "{:?}", search.best());
    }

    #[test]
    fn scaled_sphere_is_descended_by_snes() {
        let value =
            |x: &[f64]| -x.iter().enumerate().map(|(i, x)| 10.0_f64.powi(i as i32) * x * x).sum::<f64>();
        let start = Start::new(vec![1.0; 6], vec![1.0; 6], 1);
        let mut search = SeparableNes::new(start, NesSettings::default()).expect("a search");
        rollouts(&mut search, 6000, value);
        assert!(search.best().expect("rewards").1 > -1e-8, "{:?}", search.best());
    }
}
