//! Eigenforces that minimise the mean error, instead of the mean square error.

use crate::{BuildError, LibraryParts, MotionLibrary, Truncation};
use motorium_algebra::left_singular;

/// Number of rounds; the weights have converged by then.
const ROUNDS: usize = 8;
/// Lower bound of the error, relative to the median. It bounds the weight of a movement that is reproduced
/// exactly.
const FLOOR: f64 = 0.1;

impl MotionLibrary {
    /// Returns a library of the same movements whose first `n` eigenforces minimise the *mean* error instead
    /// of the mean square error, so that the eigenforces are less sensitive to outliers. This library must
    /// not be truncated; `truncation` sets the number of eigenforces of the result.
    ///
    /// The method is iterative reweighting. `r_k` is the error that `n` eigenforces leave in movement `k`, in
    /// the metric of the library. The next eigenforces are computed from the movements scaled by
    /// `c_k = (r_k / median + 0.1)^(-1/2)`. This makes `sum r_k^2 c_k^2` about `sum r_k`. As in any library,
    /// a singular value is the norm of its eigenforce's weights. The weights of different eigenforces are
    /// correlated, however, so splitting and merging a balanced library is approximate.
    ///
    /// # Errors
    /// [`BuildError`] if all movements are at rest.
    pub fn balanced(&self, n: usize, truncation: Truncation) -> Result<Self, BuildError> {
        let LibraryParts { basis, weights, .. } = self.parts();
        let data = basis * weights;
        let n = n.clamp(1, self.rank());
        let mut scaled = data.clone();
        let mut found = basis.columns(0, n).into_owned();
        for round in 0..ROUNDS {
            let mut errors: Vec<f64> = {
                let known = found.transpose() * &data;
                let left = data.column_iter().zip(known.column_iter());
                left.map(|(all, known)| (all.norm_squared() - known.norm_squared()).max(0.0).sqrt()).collect()
            };
            let median = {
                let mut sorted = errors.clone();
                sorted.sort_by(f64::total_cmp);
                sorted[sorted.len() / 2]
            };
            if median <= 0.0 {
                // n eigenforces reproduce at least half of the movements exactly
                break;
            }
            errors.iter_mut().for_each(|error| *error = (*error / median + FLOOR).sqrt().recip());
            scaled.copy_from(&data);
            scaled.column_iter_mut().zip(&errors).for_each(|(mut column, weight)| column *= *weight);
            let truncation = if round + 1 == ROUNDS { truncation } else { Truncation::Rank(n) };
            found = left_singular(&scaled, truncation.wanted(scaled.nrows())).vectors;
        }
        if found.ncols() == 0 {
            return Err(BuildError::Still);
        }
        let weights = found.transpose() * &data;
        let singular: Vec<f64> = weights.row_iter().map(|row| row.norm()).collect();
        Self::from_parts(LibraryParts {
            spectrum: singular.clone(),
            singular,
            basis: found,
            weights,
            ..self.parts().clone()
        })
    }
}
