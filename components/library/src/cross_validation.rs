//! Cross-validation of libraries: errors and recognition rates on held-out recordings, over several splits.

use crate::statistics::mean_and_deviation;
use crate::{
    BALANCED, BuildError, Metric, MotionLibrary, Recordings, SampledSpring, Truncation, compare,
    nearest_neighbour_rate,
};

/// Basis name of the eigenforces in the metric of force.
pub const FORCE: &str = "eigenforces, force";
/// Basis name of the eigenforces in the metric of position.
pub const POSITION: &str = "eigenforces, position";
/// Names of the compared bases.
pub const BASES: [&str; 5] = [FORCE, POSITION, BALANCED, "fourier", "kernels"];

/// Number of eigenforces whose share of the variance is reported.
const EXPLAINED: usize = 10;

/// Errors of one basis with one number of weights, one entry per split.
#[derive(Clone, Debug)]
pub struct BasisErrors {
    /// Name of the basis, an entry of [`BASES`].
    pub basis: &'static str,
    /// Number of weights.
    pub n: usize,
    /// Relative error of the forces, one entry per split.
    pub force: Vec<f64>,
    /// Mean error of position over the movements, relative to the spread of the paths, one entry per split.
    pub position: Vec<f64>,
    /// Standard deviation of the position error over the movements, one entry per split.
    pub deviation: Vec<f64>,
    /// Largest error of position of any movement, one entry per split.
    pub worst: Vec<f64>,
}

/// A cross-validation that compares bases of forces.
///
/// ```
/// use motorium_library::letters::{Variation, letters};
/// use motorium_library::{CrossValidation, DAMPING, SampledSpring};
///
/// let all = letters(5, Variation::default(), 1);
/// let mut validation = CrossValidation::new(vec![4, 8]);
/// for seed in 1..=2 {
///     let (held, seen) = all.split(0.2, seed);
///     validation.add(&seen, &held, SampledSpring::new(60, DAMPING)?, || {})?;
/// }
/// let [coarse, fine] = [4, 8].map(|n| validation.position_error("eigenforces, force", n));
/// assert!(fine.unwrap().0 < coarse.unwrap().0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct CrossValidation {
    eigenforces: Vec<usize>,
    splits: usize,
    errors: Vec<BasisErrors>,
    explained: Vec<Vec<f64>>,
    /// Recognition rates in both metrics, one row per split, one entry for each number of weights.
    rates: Vec<Vec<[f64; 2]>>,
}

impl CrossValidation {
    /// Creates a cross-validation for these numbers of weights, without any split.
    pub fn new(eigenforces: Vec<usize>) -> Self {
        Self { eigenforces, splits: 0, errors: Vec::new(), explained: Vec::new(), rates: Vec::new() }
    }

    /// Returns the number of progress steps of a split: how often [`add`](Self::add) calls its argument
    /// `progress`.
    pub fn progress_of_split(&self) -> usize {
        self.eigenforces.len() + 2
    }

    /// Adds a split: builds libraries from the recordings `seen` and evaluates them on the recordings `held`.
    ///
    /// # Errors
    /// [`BuildError`] if no library can be built from the recordings.
    pub fn add(
        &mut self,
        seen: &Recordings,
        held: &Recordings,
        spring: SampledSpring,
        mut progress: impl FnMut(),
    ) -> Result<(), BuildError> {
        let mut build = |metric| {
            progress();
            MotionLibrary::build(seen, spring, metric, Truncation::All)
        };
        let (force, position) = (build(Metric::Force)?, build(Metric::Position)?);
        let libraries = [(FORCE, &force), (POSITION, &position)];
        for (basis, found) in compare(&libraries, held, &self.eigenforces, &mut progress) {
            let row = match self.errors.iter_mut().find(|row| row.basis == basis && row.n == found.n) {
                Some(row) => row,
                None => {
                    let empty = Vec::new;
                    let (force, position, deviation, worst) = (empty(), empty(), empty(), empty());
                    let row = BasisErrors { basis, n: found.n, force, position, deviation, worst };
                    self.errors.push(row);
                    let last = self.errors.len() - 1;
                    &mut self.errors[last]
                }
            };
            row.force.push(found.force);
            row.position.push(found.position.mean);
            row.deviation.push(found.position.deviation);
            row.worst.push(found.position.worst);
        }
        self.explained.push(force.explained().into_iter().take(EXPLAINED).collect());
        if held.trajectories.iter().any(|trajectory| trajectory.label.is_some()) {
            let rate =
                |n: &usize| [&force, &position].map(|library| nearest_neighbour_rate(library, held, *n));
            self.rates.push(self.eigenforces.iter().map(rate).collect());
        }
        self.splits += 1;
        Ok(())
    }

    /// Returns the numbers of weights that are compared.
    pub fn eigenforces(&self) -> &[usize] {
        &self.eigenforces
    }

    /// Returns the number of splits.
    pub fn splits(&self) -> usize {
        self.splits
    }

    /// Returns the errors of every basis with every number of weights.
    pub fn errors(&self) -> &[BasisErrors] {
        &self.errors
    }

    /// Returns the mean error of position over the splits and its standard deviation, for one basis with `n`
    /// weights; `None` if this combination was not evaluated.
    pub fn position_error(&self, basis: &str, n: usize) -> Option<(f64, f64)> {
        let row = self.errors.iter().find(|row| row.basis == basis && row.n == n)?;
        Some(mean_and_deviation(&row.position))
    }

    /// Returns the fraction of the force variance that each of the first ten eigenforces explains, as means
    /// over the splits.
    pub fn explained(&self) -> Vec<f64> {
        let first = self.explained.iter().map(Vec::len).min().unwrap_or(0);
        let mean = |k: usize| self.explained.iter().map(|e| e[k]).sum::<f64>() / self.explained.len() as f64;
        (0..first).map(mean).collect()
    }

    /// Returns the recognition rates, 0 to 1, with eigenforces in the metric of force and in the metric of
    /// position, for the number of weights with the index `k`. The rates are means over the splits. `None` if
    /// `k` is out of range or no recording has a label.
    pub fn recognition(&self, k: usize) -> Option<[f64; 2]> {
        if self.rates.is_empty() || k >= self.eigenforces.len() {
            return None;
        }
        let count = self.rates.len() as f64;
        Some([0, 1].map(|metric| self.rates.iter().map(|rates| rates[k][metric]).sum::<f64>() / count))
    }
}
