//! Models of a movement that was demonstrated several times, and their generalisation to other start
//! positions.

use std::path::Path;

use motorium_library::{
    BuildError, DAMPING, Frame, Metric, MotionLibrary, Movement, Recordings, SampledSpring, SpringError,
    Trajectory, Truncation, file,
};
use motorium_primitives::dmp::{Demonstration, DemonstrationError, DmpModel, FitError, Regression, Settings};
use motorium_primitives::file::{PrimitiveFile, PrimitiveFileError};
use motorium_primitives::promp::{ProMp, ProMpBasis, ProMpError, ProMpFit};
use motorium_primitives::rollout::{Override, RolloutError, roll_out};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use crate::files::FileError;

/// Number of kernels of the primitives per dimension.
const KERNELS: usize = 40;
/// Overlap of neighbouring kernels of the probabilistic primitive.
const OVERLAP: f64 = 0.7;
/// Penalty of the regression of library weights on the start, relative to the variance of the starts.
const RIDGE: f64 = 1e-3;
/// Number of evenly spaced samples of every movement.
const SAMPLES: usize = 301;

/// A model of a movement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Model {
    /// A discrete dynamic movement primitive from the start to the mean end of the demonstrations.
    Dmp,
    /// A probabilistic movement primitive that is conditioned on the start.
    ProMp,
    /// A motion library with weights that depend linearly on the start. Its movements end at the mean end of
    /// the demonstrations.
    Library,
    /// A replay of the first demonstration, which ignores the start.
    Replay,
}

impl Model {
    /// All models. The last model is the baseline.
    pub const ALL: [Self; 4] = [Self::Dmp, Self::ProMp, Self::Library, Self::Replay];

    /// Returns the name of the model in figures.
    pub fn name(self) -> &'static str {
        match self {
            Self::Dmp => "DMP",
            Self::ProMp => "ProMP",
            Self::Library => "library",
            Self::Replay => "first demonstration",
        }
    }
}

/// Error of fitting or executing a model of a movement.
#[derive(Debug, thiserror::Error)]
pub enum MovementError {
    /// A demonstration is too short or not finite.
    #[error(transparent)]
    Demonstration(#[from] DemonstrationError),
    /// The dynamic primitive cannot be fitted.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// The probabilistic primitive cannot be fitted.
    #[error(transparent)]
    ProMp(#[from] ProMpError),
    /// The spring of the library is unstable.
    #[error(transparent)]
    Spring(#[from] SpringError),
    /// The library cannot be built.
    #[error(transparent)]
    Library(#[from] BuildError),
    /// A primitive cannot start at this position.
    #[error(transparent)]
    RollOut(#[from] RolloutError),
    /// A primitive cannot be written.
    #[error(transparent)]
    PrimitiveFile(#[from] PrimitiveFileError),
    /// The library cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
}

/// All models of one movement.
#[derive(Clone, Debug)]
pub struct Movements {
    dmp: PrimitiveFile,
    promp: PrimitiveFile,
    library: MotionLibrary,
    first: DMatrix<f64>,
}

impl Movements {
    /// Fits all models to at least two demonstrations of `duration` seconds, each a matrix of evenly spaced
    /// samples x dimensions.
    ///
    /// # Errors
    ///
    /// [`MovementError`] if a demonstration is invalid or a model cannot be fitted.
    pub fn fit(
        names: &[String],
        duration: f64,
        demonstrations: &[DMatrix<f64>],
    ) -> Result<Self, MovementError> {
        let trajectory = |(k, positions): (usize, &DMatrix<f64>)| {
            let (id, positions) = (k.to_string(), positions.clone());
            Trajectory { id, label: None, duration, positions }.splined(SAMPLES)
        };
        let trajectories: Vec<Trajectory> = demonstrations.iter().enumerate().map(trajectory).collect();
        let even: Vec<DMatrix<f64>> = trajectories.iter().map(|shown| shown.positions.clone()).collect();
        let shown = even.iter().map(|positions| Demonstration::from_positions(duration, positions.clone()));
        let shown: Vec<Demonstration> = shown.collect::<Result<_, _>>()?;
        let settings = Settings { kernels: KERNELS, ..Settings::default() };
        let dmp = DmpModel::fit(settings, &shown, Regression::default())?;
        let basis = ProMpBasis::gaussian(KERNELS, OVERLAP)?;
        let mut promp = ProMp::fit(basis, &even, &ProMpFit::default())?;
        promp.set_duration(duration)?;
        let spring = SampledSpring::new(SAMPLES, DAMPING)?;
        let recordings = Recordings { names: names.to_vec(), trajectories };
        Ok(Self {
            dmp: PrimitiveFile::discrete(names.to_vec(), &shown, dmp),
            promp: PrimitiveFile::probabilistic(names.to_vec(), promp),
            library: MotionLibrary::build(&recordings, spring, Metric::Force, Truncation::All)?,
            first: even.into_iter().next().unwrap_or_default(),
        })
    }

    /// Returns the path that a model generates from a start position, as a matrix of evenly spaced samples x
    /// dimensions.
    ///
    /// # Errors
    ///
    /// [`MovementError::RollOut`] if a primitive cannot start at this position.
    pub fn path(&self, model: Model, start: &[f64]) -> Result<DMatrix<f64>, MovementError> {
        let file = match model {
            Model::Replay => return Ok(self.first.clone()),
            Model::Library => return Ok(self.library_path(start)),
            Model::Dmp => &self.dmp,
            Model::ProMp => &self.promp,
        };
        let interval = file.duration / (SAMPLES - 1) as f64;
        let from = Override { start: Some(start.to_vec()), ..Override::default() };
        let rows = roll_out(file, &from, interval)?.position;
        Ok(DMatrix::from_fn(rows.len(), start.len(), |k, d| rows[k][d]))
    }

    fn library_path(&self, start: &[f64]) -> DMatrix<f64> {
        let (library, dimensions) = (&self.library, start.len());
        let count = library.entries().len() as f64;
        let mean = |value: &dyn Fn(&Frame, usize) -> f64| -> Vec<f64> {
            let sum = |d: usize| library.entries().iter().map(|entry| value(&entry.frame, d)).sum::<f64>();
            (0..dimensions).map(|d| sum(d) / count).collect()
        };
        let frame = Frame {
            start: start.to_vec(),
            goal: mean(&|frame, d| frame.goal[d]),
            velocity: mean(&|frame, d| frame.velocity[d]),
            duration: self.dmp.duration,
        };
        let weights = self.library_weights(start);
        Movement { frame, forces: library.forces(weights.as_slice()) }.path(library.spring())
    }

    /// Returns the weights for a start: their mean plus a ridge regression on the displacement from the mean
    /// start.
    fn library_weights(&self, start: &[f64]) -> DVector<f64> {
        let (weights, entries) = (self.library.weights(), self.library.entries());
        let starts = DMatrix::from_fn(start.len(), entries.len(), |d, k| entries[k].frame.start[d]);
        let (mean, mean_start) = (weights.column_mean(), starts.column_mean());
        let centred = |matrix: &DMatrix<f64>, mean: &DVector<f64>| {
            let mut centred = matrix.clone();
            centred.column_iter_mut().for_each(|mut column| column -= mean);
            centred
        };
        let (away, changes) = (centred(&starts, &mean_start), centred(weights, &mean));
        let mut gram = &away * away.transpose();
        let ridge = RIDGE * gram.trace() / start.len() as f64;
        (0..start.len()).for_each(|d| gram[(d, d)] += ridge);
        let displacement = DVector::from_column_slice(start) - mean_start;
        match gram.cholesky() {
            Some(factor) => mean + changes * (away.transpose() * factor.solve(&displacement)),
            // all demonstrations have the same start
            None => mean,
        }
    }

    /// The files that [`write`](Self::write) writes.
    pub const FILES: [&'static str; 3] = ["dmp.json", "promp.json", "movement.library"];

    /// Writes the models to a folder: `dmp.json` and `promp.json`, which `motorium primitive` reads, and
    /// `movement.library`, which `motorium library` reads.
    ///
    /// # Errors
    ///
    /// [`MovementError`] if a file cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), MovementError> {
        let [dmp, promp, library] = Self::FILES.map(|name| folder.join(name));
        self.dmp.write(&dmp)?;
        self.promp.write(&promp)?;
        Ok(crate::files::write(&library, &file::to_bytes(&self.library))?)
    }
}

/// Returns the root mean square distance and the maximum distance between two paths, in the unit of the
/// paths. Paths are evenly spaced samples x dimensions.
pub fn distances(path: &DMatrix<f64>, other: &DMatrix<f64>) -> [f64; 2] {
    let squares = path.row_iter().zip(other.row_iter()).map(|(a, b)| (a - b).norm_squared());
    let (sum, largest) = squares.fold((0.0, 0.0_f64), |(sum, largest), x| (sum + x, largest.max(x)));
    [(sum / path.nrows().max(1) as f64).sqrt(), largest.sqrt()]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a curved stroke from a start to a fixed goal. The effect of the start fades.
    fn stroke(start: f64) -> DMatrix<f64> {
        DMatrix::from_fn(200, 1, |k, _| {
            let p = k as f64 / 199.0;
            let ease = p * p * p * (10.0 - 15.0 * p + 6.0 * p * p);
            start * (1.0 - ease) + ease + 0.3 * (std::f64::consts::PI * ease).sin()
        })
    }

    #[test]
    fn models_adapt_to_an_unseen_start() {
        let shown: Vec<DMatrix<f64>> = [-0.1, 0.05, 0.1, 0.0, -0.05].map(stroke).to_vec();
        let movements = Movements::fit(&["x".to_owned()], 2.0, &shown).expect("a fit");
        let expected = Trajectory { id: String::new(), label: None, duration: 2.0, positions: stroke(0.07) }
            .splined(SAMPLES)
            .positions;
        let errors = Model::ALL.map(|model| {
            let path = movements.path(model, &[0.07]).expect("a movement");
            assert_eq!(path.shape(), (SAMPLES, 1), "{model:?}");
            distances(&path, &expected)[0]
        });
        let [dmp, promp, library, replay] = errors;
        assert!(dmp < 0.02 && promp < 0.02 && library < 0.02, "{errors:?}");
        assert!(replay > 0.05, "{errors:?}");
    }

    #[test]
    fn distances_are_euclidean() {
        let path = DMatrix::from_row_slice(2, 2, &[0.0, 0.0, 3.0, 4.0]);
        assert_eq!(distances(&path, &DMatrix::zeros(2, 2)), [12.5_f64.sqrt(), 5.0]);
    }
}
