//! Files that store movement primitives.

use std::path::{Path, PathBuf};

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use crate::dmp::{Demonstration, DmpModel, RhythmicModel};
use crate::kmp::{KernelisedMovement, KmpError};
use crate::mean::MeanMovement;
use crate::promp::{ProMp, ProMpMean};
use crate::regression::PolynomialMovement;

/// Content of a primitive file, stored as one JSON object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PrimitiveFile {
    /// Version of the file format, [`PrimitiveFile::VERSION`].
    pub version: u32,
    /// Name of every dimension.
    pub names: Vec<String>,
    /// Duration of the demonstration, or period of a rhythm, s.
    pub duration: f64,
    /// Start of the demonstration, one entry per dimension.
    pub start: Vec<f64>,
    /// Velocity at the start, per second.
    pub start_velocity: Vec<f64>,
    /// End of the demonstration, or centre of a rhythm.
    pub goal: Vec<f64>,
    /// Velocity at the goal, per second.
    pub final_velocity: Vec<f64>,
    /// The primitive itself.
    pub primitive: Primitive,
}

/// Primitive of any kind that a file can contain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Primitive {
    /// A discrete dynamic movement primitive.
    Discrete(DmpModel),
    /// A rhythmic dynamic movement primitive.
    Rhythmic(RhythmicModel),
    /// A probabilistic movement primitive.
    Probabilistic(ProMp),
    /// A kernelised movement primitive.
    Kernelised(KernelisedMovement),
    /// A movement whose dimensions are polynomials of the phase.
    Polynomial(PolynomialMovement),
}

impl Primitive {
    /// Returns the name of the kind.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Discrete(_) => "discrete",
            Self::Rhythmic(_) => "rhythmic",
            Self::Probabilistic(_) => "probabilistic",
            Self::Kernelised(_) => "kernelised",
            Self::Polynomial(_) => "polynomial",
        }
    }

    /// Returns the number of dimensions.
    pub fn dimensions(&self) -> usize {
        match self {
            Self::Discrete(model) => model.dimensions(),
            Self::Rhythmic(model) => model.dimensions(),
            Self::Probabilistic(promp) => promp.dimensions(),
            Self::Kernelised(movement) => movement.dimensions(),
            Self::Polynomial(movement) => movement.dimensions(),
        }
    }

    /// Returns the mean of the primitive as a function of the phase; `None` for primitives that are
    /// differential equations.
    pub fn mean(&self) -> Option<Box<dyn MeanMovement + Send>> {
        match self {
            Self::Discrete(_) | Self::Rhythmic(_) => None,
            Self::Probabilistic(promp) => Some(Box::new(ProMpMean::from(promp.clone()))),
            // Factorised at construction.
            Self::Kernelised(movement) => Some(Box::new(movement.running().ok()?)),
            Self::Polynomial(movement) => Some(Box::new(movement.clone())),
        }
    }
}

/// Error returned when a primitive file cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum PrimitiveFileError {
    /// The file cannot be read or written.
    #[error("{}: {source}", path.display())]
    System {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file is not a movement primitive.
    #[error("{}: the file is not a movement primitive; `motorium primitive fit` creates primitives from recordings", path.display())]
    Foreign {
        /// Path of the file.
        path: PathBuf,
    },
    /// The primitive does not parse.
    #[error("{}: {source}", path.display())]
    Text {
        /// Path of the file.
        path: PathBuf,
        /// Syntax error with its location.
        source: serde_json::Error,
    },
    /// The file has an unsupported version.
    #[error("{}: version {found}, but this program reads version {}: fit the primitive again", path.display(), PrimitiveFile::VERSION)]
    Version {
        /// Path of the file.
        path: PathBuf,
        /// Version found.
        found: u32,
    },
    /// Lists differ in length, or a number is invalid.
    #[error("{}: {message}", path.display())]
    Content {
        /// Path of the file.
        path: PathBuf,
        /// Description of the contradiction.
        message: String,
    },
}

impl PrimitiveFile {
    /// Version of the file format that this program reads and writes.
    pub const VERSION: u32 = 1;

    /// Creates the file of a discrete primitive. Start, goal, velocities and duration are means over the
    /// demonstrations, of which there must be at least one.
    pub fn discrete(names: Vec<String>, demonstrations: &[Demonstration], model: DmpModel) -> Self {
        let count = demonstrations.len().max(1) as f64;
        let mean = |value: &dyn Fn(&Demonstration, usize) -> f64| -> Vec<f64> {
            let of = |d: usize| demonstrations.iter().map(|shown| value(shown, d)).sum::<f64>() / count;
            (0..model.dimensions()).map(of).collect()
        };
        Self {
            version: Self::VERSION,
            names,
            duration: demonstrations.iter().map(Demonstration::duration).sum::<f64>() / count,
            start: mean(&|shown, d| shown.start(d)),
            start_velocity: mean(&|shown, d| shown.velocities()[(0, d)]),
            goal: mean(&|shown, d| shown.goal(d)),
            final_velocity: mean(&|shown, d| shown.velocities()[(shown.samples() - 1, d)]),
            primitive: Primitive::Discrete(model),
        }
    }

    /// Creates the file of a rhythm of `period` seconds. Start and start velocity are means over `periods`,
    /// to which the model was fitted. `periods` must not be empty; each entry is a matrix of samples x
    /// dimensions, without the closing sample.
    pub fn rhythmic(names: Vec<String>, period: f64, periods: &[DMatrix<f64>], model: RhythmicModel) -> Self {
        let count = periods.len().max(1) as f64;
        let mean = |value: &dyn Fn(&DMatrix<f64>, usize) -> f64| -> Vec<f64> {
            (0..model.dimensions())
                .map(|d| periods.iter().map(|shown| value(shown, d)).sum::<f64>() / count)
                .collect()
        };
        // central difference across the period boundary
        let slope = |shown: &DMatrix<f64>, d: usize| {
            let samples = shown.nrows();
            (shown[(1, d)] - shown[(samples - 1, d)]) * samples as f64 / (2.0 * period)
        };
        Self {
            version: Self::VERSION,
            names,
            duration: period,
            start: mean(&|shown, d| shown[(0, d)]),
            start_velocity: mean(&slope),
            goal: model.baseline().as_slice().to_vec(),
            final_velocity: vec![0.0; model.dimensions()],
            primitive: Primitive::Rhythmic(model),
        }
    }

    /// Creates the file of a probabilistic primitive, with the start, goal and velocities of the primitive's
    /// mean.
    pub fn probabilistic(names: Vec<String>, promp: ProMp) -> Self {
        let mean = ProMpMean::from(promp.clone());
        Self::of_mean(names, mean, Primitive::Probabilistic(promp))
    }

    /// Creates the file of a kernelised primitive, with the start, goal and velocities of the primitive's
    /// mean.
    ///
    /// # Errors
    /// [`KmpError`] if a matrix is not positive definite.
    pub fn kernelised(names: Vec<String>, movement: KernelisedMovement) -> Result<Self, KmpError> {
        Ok(Self::of_mean(names, movement.running()?, Primitive::Kernelised(movement)))
    }

    /// Creates the file of a polynomial primitive, with the start, goal and velocities of the primitive's
    /// polynomials.
    pub fn polynomial(names: Vec<String>, movement: PolynomialMovement) -> Self {
        Self::of_mean(names, movement.clone(), Primitive::Polynomial(movement))
    }

    fn of_mean(names: Vec<String>, mut mean: impl MeanMovement, primitive: Primitive) -> Self {
        let duration = mean.duration();
        let mut at = |phase: f64| {
            let mut ends = [vec![0.0; mean.dimensions()], vec![0.0; mean.dimensions()]];
            let [position, slope] = &mut ends;
            mean.mean_into(phase, position, slope);
            slope.iter_mut().for_each(|slope| *slope /= duration);
            ends
        };
        let ([start, start_velocity], [goal, final_velocity]) = (at(0.0), at(1.0));
        Self {
            version: Self::VERSION,
            names,
            duration,
            start,
            start_velocity,
            goal,
            final_velocity,
            primitive,
        }
    }

    /// Reads a file and checks its consistency.
    ///
    /// # Errors
    /// [`PrimitiveFileError`] if the file cannot be read, is truncated or malformed, has an unsupported
    /// version, or contradicts itself.
    pub fn read(path: &Path) -> Result<Self, PrimitiveFileError> {
        let system = |source| PrimitiveFileError::System { path: path.into(), source };
        // Devices and pipes are rejected: they may never end.
        if !std::fs::metadata(path).map_err(system)?.is_file() {
            return Err(system(std::io::Error::other("not a regular file")));
        }
        let foreign = || PrimitiveFileError::Foreign { path: path.into() };
        let text = String::from_utf8(std::fs::read(path).map_err(system)?).map_err(|_| foreign())?;
        let file: Self =
            serde_json::from_str(&text).map_err(|source| match text.contains("\"primitive\"") {
                true => PrimitiveFileError::Text { path: path.into(), source },
                false => foreign(),
            })?;
        if file.version != Self::VERSION {
            return Err(PrimitiveFileError::Version { path: path.into(), found: file.version });
        }
        let content = |message| PrimitiveFileError::Content { path: path.into(), message };
        let expected = file.primitive.dimensions();
        for (name, values) in [
            ("start", &file.start),
            ("start_velocity", &file.start_velocity),
            ("goal", &file.goal),
            ("final_velocity", &file.final_velocity),
        ] {
            if values.len() != expected {
                let found = values.len();
                return Err(content(format!(
                    "`{name}` has {found} entries, expected {expected}, one per dimension of the primitive"
                )));
            }
        }
        if file.names.len() != expected {
            let found = file.names.len();
            return Err(content(format!("{found} names for {expected} dimensions")));
        }
        if !(file.duration > 0.0 && file.duration.is_finite()) {
            return Err(content(format!("a duration of {} s, expected a positive time", file.duration)));
        }
        Ok(file)
    }

    /// Writes the file atomically.
    ///
    /// # Errors
    /// [`PrimitiveFileError`] if the operating system rejects the operation.
    pub fn write(&self, path: &Path) -> Result<(), PrimitiveFileError> {
        let text = serde_json::to_string(self)
            .map_err(|source| PrimitiveFileError::Text { path: path.into(), source })?;
        let refused = |source| PrimitiveFileError::System { path: path.into(), source };
        let mut unfinished = path.as_os_str().to_owned();
        unfinished.push(format!(".{}.part", std::process::id()));
        std::fs::write(&unfinished, text + "\n").map_err(refused)?;
        std::fs::rename(&unfinished, path).map_err(refused)
    }
}
