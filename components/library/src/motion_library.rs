//! A motion library: eigenforces, their singular values, and movements as weights.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use crate::{Frame, Layout, LayoutError, Movement, Recordings, SampledSpring, SpringError, Truncation};
use motorium_algebra::left_singular;

/// Quantity whose residual the eigenforces minimise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Metric {
    /// Force: the eigenforces are the singular vectors of the forces.
    #[default]
    Force,
    /// Position: the eigenforces are the forces that produce the singular vectors of the responses.
    Position,
}

impl core::fmt::Display for Metric {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Force => "force",
            Self::Position => "position",
        })
    }
}

/// A movement from which a library was built.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// Name of the movement.
    pub id: String,
    /// Label of the kind of movement, if known.
    pub label: Option<String>,
    /// Start, goal, initial velocity and duration.
    pub frame: Frame,
}

/// Parts of a library, checked by [`MotionLibrary::from_parts`].
#[derive(Clone, Debug, PartialEq)]
pub struct LibraryParts {
    /// Layout of the degrees of freedom.
    pub layout: Layout,
    /// Spring that converts forces to paths.
    pub spring: SampledSpring,
    /// Metric in which `basis` is orthonormal.
    pub metric: Metric,
    /// Orthonormal columns in the space of the metric: `dofs (samples - 1)` rows, one column per eigenforce.
    pub basis: DMatrix<f64>,
    /// Singular value of each eigenforce.
    pub singular: Vec<f64>,
    /// All known singular values of the data.
    pub spectrum: Vec<f64>,
    /// Sum of squares of the data. Equal to the sum of squares of the spectrum if all singular values are
    /// known.
    pub energy: f64,
    /// Weights of the movements from which the library was built, eigenforces x movements.
    pub weights: DMatrix<f64>,
    /// The movements from which the library was built.
    pub entries: Vec<Entry>,
}

/// An immutable library of movements: eigenforces, their singular values, and the weights of the movements
/// from which they were computed.
///
/// ```
/// use motorium_library::letters::{Variation, letters};
/// use motorium_library::{DAMPING, Metric, MotionLibrary, Recogniser, SampledSpring, Superposition, Truncation};
///
/// let spring = SampledSpring::new(60, DAMPING)?;
/// let library = MotionLibrary::build(&letters(2, Variation::default(), 1), spring, Metric::Position, Truncation::Rank(8))?;
///
/// // A movement half way between the first two, in 2 s.
/// let [first, second] = [0, 1].map(|entry| Superposition::from_entry(&library, entry, 8));
/// let blend = first.blend(&second, 0.5).placed(None, None, Some(2.0));
/// assert_eq!(blend.path(&library).shape(), (60, 2));
///
/// // A newly written letter is recognised.
/// let written = letters(1, Variation { points: 0.0, shape: 0.0, pace: 0.0 }, 9);
/// let found = Recogniser::new(&library, 8).recognise(&written.trajectories[0]);
/// let (nearest, _) = found.nearest.unwrap();
/// assert_eq!(library.entries()[nearest].label, written.trajectories[0].label);
/// # Ok::<(), motorium_library::BuildError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct MotionLibrary {
    parts: LibraryParts,
    /// Forces of the eigenforces; empty in the metric of force, where the basis already contains them.
    forces: DMatrix<f64>,
    /// Weights are the transpose of this matrix times forces; empty in the metric of force.
    analysis: DMatrix<f64>,
}

/// Error returned when a library cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BuildError {
    /// There are no recordings.
    #[error("no recording, expected at least one")]
    NoRecordings,
    /// The DoFs are invalid.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// The spring is invalid.
    #[error(transparent)]
    Spring(#[from] SpringError),
    /// A recording does not match the names.
    #[error("recording `{id}`: {found}")]
    Recording {
        /// Id of the recording.
        id: String,
        /// Reason why the recording does not match.
        found: String,
    },
    /// All recordings are at rest.
    #[error("all forces are zero: nothing moves in these recordings")]
    Still,
    /// Some degrees of freedom are at rest in every recording.
    #[error(
        "{names}: at rest in all recordings, so eigenforces cannot be computed; use recordings in which these degrees of freedom move"
    )]
    Resting {
        /// Names of these degrees of freedom.
        names: String,
    },
    /// Parts of a library do not match each other.
    #[error("{what} is {found}, expected {expected}")]
    Shape {
        /// Name of the part that does not match.
        what: &'static str,
        /// Value found.
        found: String,
        /// Value expected.
        expected: String,
    },
}

impl MotionLibrary {
    /// Builds a library from recordings.
    ///
    /// # Errors
    /// [`BuildError`] if there is no recording, a value is not finite, or a recording does not match the
    /// names.
    pub fn build(
        recordings: &Recordings,
        spring: SampledSpring,
        metric: Metric,
        truncation: Truncation,
    ) -> Result<Self, BuildError> {
        let layout = Layout::new(recordings.names.clone())?;
        if recordings.trajectories.is_empty() {
            return Err(BuildError::NoRecordings);
        }
        let mut entries = Vec::with_capacity(recordings.trajectories.len());
        let mut data = DMatrix::zeros(layout.dofs() * spring.forces(), recordings.trajectories.len());
        for (k, trajectory) in recordings.trajectories.iter().enumerate() {
            check(trajectory, layout.dofs())?;
            let movement = Movement::from_trajectory(trajectory, &spring);
            data.column_mut(k).copy_from_slice(&movement.forces);
            let (id, label) = (trajectory.id.clone(), trajectory.label.clone());
            entries.push(Entry { id, label, frame: movement.frame });
        }
        Self::from_forces(data, entries, (layout, spring), metric, truncation)
    }

    /// Builds a library from forces: `dofs (samples - 1)` rows, one column per movement.
    ///
    /// # Errors
    /// [`BuildError`] if sizes do not match, or all forces are zero.
    pub fn from_forces(
        mut data: DMatrix<f64>,
        entries: Vec<Entry>,
        (layout, spring): (Layout, SampledSpring),
        metric: Metric,
        truncation: Truncation,
    ) -> Result<Self, BuildError> {
        metric.into_space(&spring, &mut data);
        let found = left_singular(&data, truncation.wanted(data.nrows()));
        if found.values.is_empty() {
            return Err(BuildError::Still);
        }
        let weights = found.vectors.transpose() * &data;
        Self::from_parts(LibraryParts {
            layout,
            spring,
            metric,
            basis: found.vectors,
            singular: found.values,
            spectrum: found.spectrum,
            energy: found.energy,
            weights,
            entries,
        })
    }

    /// Builds a library from existing parts.
    ///
    /// # Errors
    /// [`BuildError`] if sizes do not match.
    pub fn from_parts(parts: LibraryParts) -> Result<Self, BuildError> {
        let rows = parts.layout.dofs() * parts.spring.forces();
        let rank = parts.basis.ncols();
        let shape = |what, found: String, expected: String| BuildError::Shape { what, found, expected };
        let size = |(a, b): (usize, usize)| format!("{a} x {b}");
        if parts.basis.nrows() != rows || rank == 0 {
            let expected = format!("{rows} x 1 or more");
            return Err(shape("the basis (forces x eigenforces)", size(parts.basis.shape()), expected));
        }
        if parts.singular.len() != rank {
            let found = parts.singular.len().to_string();
            return Err(shape("the number of singular values", found, rank.to_string()));
        }
        if parts.weights.shape() != (rank, parts.entries.len()) {
            let expected = size((rank, parts.entries.len()));
            return Err(shape(
                "the weights (eigenforces x movements)",
                size(parts.weights.shape()),
                expected,
            ));
        }
        if let Some(entry) = parts.entries.iter().find(|entry| {
            let frame = &entry.frame;
            [&frame.start, &frame.goal, &frame.velocity].iter().any(|v| v.len() != parts.layout.dofs())
        }) {
            let found = format!("of another size in `{}`", entry.id);
            return Err(shape("a frame", found, format!("{} numbers in each vector", parts.layout.dofs())));
        }
        let (mut forces, mut analysis) = (DMatrix::zeros(0, 0), DMatrix::zeros(0, 0));
        if parts.metric == Metric::Position {
            forces = parts.basis.clone();
            analysis = parts.basis.clone();
            blocks(&parts.spring, &mut forces, |spring, block| spring.force_of(block));
            blocks(&parts.spring, &mut analysis, |spring, block| spring.respond_transposed(block));
        }
        Ok(Self { parts, forces, analysis })
    }

    /// Returns the parts of the library.
    pub fn parts(&self) -> &LibraryParts {
        &self.parts
    }

    /// Converts the library into its parts.
    pub fn into_parts(self) -> LibraryParts {
        self.parts
    }

    /// Returns the degrees of freedom.
    pub fn layout(&self) -> &Layout {
        &self.parts.layout
    }

    /// Returns the spring that converts forces to paths.
    pub fn spring(&self) -> &SampledSpring {
        &self.parts.spring
    }

    /// Returns the metric in which the eigenforces are orthonormal.
    pub fn metric(&self) -> Metric {
        self.parts.metric
    }

    /// Returns the number of eigenforces.
    pub fn rank(&self) -> usize {
        self.parts.singular.len()
    }

    /// Returns the number of rows of an eigenforce, which is the length of a force vector:
    /// `dofs (samples - 1)`.
    pub fn rows(&self) -> usize {
        self.parts.basis.nrows()
    }

    /// Returns the movements from which the library was built.
    pub fn entries(&self) -> &[Entry] {
        &self.parts.entries
    }

    /// Returns the weights of the movements, eigenforces x movements.
    pub fn weights(&self) -> &DMatrix<f64> {
        &self.parts.weights
    }

    /// Returns the eigenforces as forces, one per column.
    pub fn eigenforces(&self) -> &DMatrix<f64> {
        if self.parts.metric == Metric::Force { &self.parts.basis } else { &self.forces }
    }

    /// Returns the matrix whose transpose converts forces to weights, one column per eigenforce.
    pub fn analysis(&self) -> &DMatrix<f64> {
        if self.parts.metric == Metric::Force { &self.parts.basis } else { &self.analysis }
    }

    /// Returns the fraction of the variance (in the metric) that each eigenforce explains, in descending
    /// order.
    pub fn explained(&self) -> Vec<f64> {
        self.parts.singular.iter().map(|s| s * s / self.parts.energy).collect()
    }

    /// Returns the cumulative fraction of the variance that the first 1, 2, ... eigenforces explain.
    pub fn explained_together(&self) -> Vec<f64> {
        let mut sum = 0.0;
        let add = |part: f64| {
            sum += part;
            sum
        };
        self.explained().into_iter().map(add).collect()
    }

    /// Returns the number of eigenforces required to explain the fraction `part` of the variance, 0 to 1; 0
    /// if all eigenforces together explain less.
    pub fn rank_explaining(&self, part: f64) -> usize {
        self.explained_together().iter().position(|sum| *sum >= part).map_or(0, |k| k + 1)
    }

    /// Returns a library with only the first `n` eigenforces.
    #[must_use]
    pub fn truncated(&self, n: usize) -> Self {
        let n = n.clamp(1, self.rank());
        let mut parts = self.parts.clone();
        parts.basis = parts.basis.columns(0, n).into_owned();
        parts.singular.truncate(n);
        parts.weights = parts.weights.rows(0, n).into_owned();
        Self::from_parts(parts).expect("a truncated library is consistent")
    }

    /// Returns the weights of forces: `w = U^T f`, or `U^T G f` in the metric of position.
    pub fn project(&self, forces: &[f64]) -> DVector<f64> {
        let mut weights = DVector::zeros(self.rank());
        motorium_algebra::Simd::new().project(self.analysis().as_slice(), forces, weights.as_mut_slice());
        weights
    }

    /// Returns the forces of a movement from its weights. If there are fewer weights than eigenforces, only
    /// the first eigenforces are used.
    pub fn forces(&self, weights: &[f64]) -> Vec<f64> {
        let mut forces = vec![0.0; self.rows()];
        let n = weights.len().min(self.rank());
        let columns = &self.eigenforces().as_slice()[..n * self.rows()];
        motorium_algebra::Simd::new().superpose(columns, &weights[..n], &mut forces);
        forces
    }

    /// Returns the index of the movement with the id `name`, or else of the first movement with the label
    /// `name`.
    pub fn find(&self, name: &str) -> Option<usize> {
        let entries = &self.parts.entries;
        entries
            .iter()
            .position(|entry| entry.id == name)
            .or_else(|| entries.iter().position(|entry| entry.label.as_deref() == Some(name)))
    }
}

impl Metric {
    /// Maps forces, one movement per column, to the space of the metric.
    pub(super) fn into_space(self, spring: &SampledSpring, forces: &mut DMatrix<f64>) {
        if self == Self::Position {
            blocks(spring, forces, |spring, block| spring.respond(block));
        }
    }

    /// Returns the norm of forces in this metric. `scratch` has the length of the forces.
    pub(super) fn norm(self, spring: &SampledSpring, forces: &[f64], scratch: &mut [f64]) -> f64 {
        scratch.copy_from_slice(forces);
        if self == Self::Position {
            scratch.chunks_exact_mut(spring.forces()).for_each(|block| spring.respond(block));
        }
        scratch.iter().map(|x| x * x).sum::<f64>().sqrt()
    }
}

fn blocks(
    spring: &SampledSpring,
    matrix: &mut DMatrix<f64>,
    mut change: impl FnMut(&SampledSpring, &mut [f64]),
) {
    matrix.as_mut_slice().chunks_exact_mut(spring.forces()).for_each(|block| change(spring, block));
}

/// Checks a recording against the number of DoFs.
pub(super) fn check(trajectory: &super::Trajectory, dofs: usize) -> Result<(), BuildError> {
    let refuse = |found: String| BuildError::Recording { id: trajectory.id.clone(), found };
    let (samples, columns) = trajectory.positions.shape();
    if columns != dofs {
        return Err(refuse(format!("{columns} degrees of freedom, expected {dofs}")));
    }
    if samples < 4 {
        return Err(refuse(format!("{samples} samples, expected at least 4: forces are second differences")));
    }
    if !(trajectory.duration > 0.0 && trajectory.duration.is_finite()) {
        return Err(refuse(format!("a duration of {} s, expected a positive time", trajectory.duration)));
    }
    if let Some(k) = trajectory.positions.iter().position(|y| !y.is_finite()) {
        let (sample, dof) = (k % samples, k / samples);
        return Err(refuse(format!(
            "sample {sample} of degree of freedom {dof} is not a finite number: fill the gap"
        )));
    }
    Ok(())
}
