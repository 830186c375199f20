//! Merging of several libraries into one.

use nalgebra::DMatrix;

use motorium_algebra::{LeftSingular, left_singular};

use crate::{BuildError, Entry, Frame, Layout, LayoutError, LibraryParts, Metric, MotionLibrary, Truncation};

/// Error returned when libraries cannot be merged.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MergeError {
    /// There are fewer than two libraries.
    #[error("found {0} libraries, expected at least two")]
    TooFew(usize),
    /// The libraries use different springs. Contains the index of the library that differs, from 1.
    #[error(
        "library {0} differs from the first in its spring, number of samples or interpolation: build both with the same settings"
    )]
    Spring(usize),
    /// The libraries use different metrics.
    #[error(
        "library {index} has the metric {found}, expected {expected} as in the first library: build both in the same metric"
    )]
    Metric {
        /// Index of the library, from 1.
        index: usize,
        /// Metric of that library.
        found: Metric,
        /// Metric of the first library.
        expected: Metric,
    },
    /// Names of DoFs are invalid, for example because two parts share a name.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// The movements do not form a common library, for example because all are at rest.
    #[error(transparent)]
    Build(#[from] BuildError),
    /// The libraries have different DoFs.
    #[error(
        "library {index} has the degrees of freedom {found}, expected {expected} as in the first library"
    )]
    Dofs {
        /// Index of the library, from 1.
        index: usize,
        /// DoFs of that library.
        found: String,
        /// DoFs of the first library.
        expected: String,
    },
}

/// Merges libraries of body parts into a library of the whole body.
///
/// If all libraries were built from the same movements (the same ids in the same order), their weights
/// contain the correlation between the parts. With the stacked weights `C = Q S R^T`, `diag(U_A, U_B, ...) Q`
/// are exactly the eigenforces of the whole body (for libraries that are not truncated). Otherwise the result
/// equals [`merge_independent`]. `truncation` sets the number of eigenforces of the result.
///
/// # Errors
/// [`MergeError`] if there are fewer than two libraries, or the libraries do not match.
pub fn merge_parts(
    libraries: &[&MotionLibrary],
    truncation: Truncation,
) -> Result<MotionLibrary, MergeError> {
    let first = same_kind(libraries)?;
    let ids = |library: &MotionLibrary| library.entries().iter().map(|e| e.id.clone()).collect::<Vec<_>>();
    let together = !first.entries().is_empty() && libraries.iter().all(|library| ids(library) == ids(first));
    if !together {
        return merge_independent(libraries, truncation);
    }
    let (layout, basis) = (joined_layout(libraries)?, joined_basis(libraries));
    let mut stacked = DMatrix::zeros(basis.ncols(), first.entries().len());
    let mut row = 0;
    for library in libraries {
        stacked.rows_mut(row, library.rank()).copy_from(library.weights());
        row += library.rank();
    }
    let inner = left_singular(&stacked, truncation.wanted(basis.nrows()));
    let weights = inner.vectors.transpose() * &stacked;
    let entries = (0..first.entries().len()).map(|k| joined(libraries, k)).collect();
    let found = LeftSingular { vectors: basis * &inner.vectors, ..inner };
    assemble(first, layout, found, weights, entries)
}

/// Merges libraries of body parts that move independently of each other.
///
/// The result contains the eigenforces of all parts, ordered by singular value, and the movements of all
/// parts. During the movement of one part, the other parts are at rest.
///
/// # Errors
/// [`MergeError`] if there are fewer than two libraries, or the libraries do not match.
pub fn merge_independent(
    libraries: &[&MotionLibrary],
    truncation: Truncation,
) -> Result<MotionLibrary, MergeError> {
    let first = same_kind(libraries)?;
    let (layout, basis) = (joined_layout(libraries)?, joined_basis(libraries));
    let (found, weights, entries) = independent(libraries, &basis, truncation);
    assemble(first, layout, found, weights, entries)
}

fn joined_layout(libraries: &[&MotionLibrary]) -> Result<Layout, LayoutError> {
    Layout::new(libraries.iter().flat_map(|library| library.layout().names().to_vec()).collect())
}

/// Returns the bases of the parts as a block-diagonal matrix.
fn joined_basis(libraries: &[&MotionLibrary]) -> DMatrix<f64> {
    let rows: usize = libraries.iter().map(|library| library.rows()).sum();
    let rank: usize = libraries.iter().map(|library| library.rank()).sum();
    let mut basis = DMatrix::zeros(rows, rank);
    let (mut row, mut column) = (0, 0);
    for library in libraries {
        let shape = (library.rows(), library.rank());
        basis.view_mut((row, column), shape).copy_from(&library.parts().basis);
        (row, column) = (row + shape.0, column + shape.1);
    }
    basis
}

/// Merges the movements of several libraries of the same DoFs.
///
/// `[F_1, F_2, ...]` has the left singular vectors of `[U_1 S_1, U_2 S_2, ...]`. The result is exact for
/// libraries that are not truncated. For truncated libraries, the leading eigenforces are nearly exact; the
/// last eigenforces lack the discarded components.
///
/// # Errors
/// [`MergeError`] if there are fewer than two libraries, or the libraries do not match.
pub fn merge_movements(
    libraries: &[&MotionLibrary],
    truncation: Truncation,
) -> Result<MotionLibrary, MergeError> {
    let first = same_kind(libraries)?;
    for (k, library) in libraries.iter().enumerate() {
        if library.layout() != first.layout() {
            let names = |library: &MotionLibrary| library.layout().names().join(", ");
            return Err(MergeError::Dofs { index: k + 1, found: names(library), expected: names(first) });
        }
    }
    let rank: usize = libraries.iter().map(|library| library.rank()).sum();
    let movements: usize = libraries.iter().map(|library| library.entries().len()).sum();
    let mut scaled = DMatrix::zeros(first.rows(), rank);
    let mut column = 0;
    for library in libraries {
        for (k, singular) in library.parts().singular.iter().enumerate() {
            scaled.set_column(column, &(library.parts().basis.column(k) * *singular));
            column += 1;
        }
    }
    let found = left_singular(&scaled, truncation.wanted(first.rows()));
    let mut weights = DMatrix::zeros(found.values.len(), movements);
    let (mut column, mut entries) = (0, Vec::new());
    for library in libraries {
        let turned = found.vectors.transpose() * &library.parts().basis * library.weights();
        weights.columns_mut(column, turned.ncols()).copy_from(&turned);
        column += turned.ncols();
        entries.extend_from_slice(library.entries());
    }
    assemble(first, first.layout().clone(), found, weights, entries)
}

fn same_kind<'a>(libraries: &[&'a MotionLibrary]) -> Result<&'a MotionLibrary, MergeError> {
    let [first, _, ..] = libraries else { return Err(MergeError::TooFew(libraries.len())) };
    for (k, library) in libraries.iter().enumerate() {
        if library.spring() != first.spring() {
            return Err(MergeError::Spring(k + 1));
        }
        if library.metric() != first.metric() {
            let (found, expected) = (library.metric(), first.metric());
            return Err(MergeError::Metric { index: k + 1, found, expected });
        }
    }
    Ok(first)
}

fn assemble(
    first: &MotionLibrary,
    layout: Layout,
    found: LeftSingular,
    weights: DMatrix<f64>,
    entries: Vec<Entry>,
) -> Result<MotionLibrary, MergeError> {
    if found.values.is_empty() {
        return Err(BuildError::Resting { names: layout.names().join(", ") }.into());
    }
    let merged = MotionLibrary::from_parts(LibraryParts {
        layout,
        spring: *first.spring(),
        metric: first.metric(),
        basis: found.vectors,
        singular: found.values,
        spectrum: found.spectrum,
        energy: found.energy,
        weights,
        entries,
    })?;
    Ok(merged)
}

/// Returns the block-diagonal basis, sorted by singular values. Every movement moves one part; the others
/// rest.
fn independent(
    libraries: &[&MotionLibrary],
    basis: &DMatrix<f64>,
    truncation: Truncation,
) -> (LeftSingular, DMatrix<f64>, Vec<Entry>) {
    let energy: f64 = libraries.iter().map(|library| library.parts().energy).sum();
    let values: Vec<f64> = libraries.iter().flat_map(|library| library.parts().singular.clone()).collect();
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*b].total_cmp(&values[*a]));
    let sorted: Vec<f64> = order.iter().map(|k| values[*k]).collect();
    let kept = motorium_algebra::count_wanted(&sorted, energy, truncation.wanted(basis.nrows()));
    let order = &order[..kept];
    let movements: usize = libraries.iter().map(|library| library.entries().len()).sum();
    let mut block = DMatrix::zeros(values.len(), movements);
    let (mut row, mut column, mut entries) = (0, 0, Vec::new());
    let dofs: usize = libraries.iter().map(|library| library.layout().dofs()).sum();
    let mut before = 0;
    for library in libraries {
        let weights = library.weights();
        block.view_mut((row, column), weights.shape()).copy_from(weights);
        (row, column) = (row + weights.nrows(), column + weights.ncols());
        entries.extend(library.entries().iter().map(|entry| resting(entry, before, dofs)));
        before += library.layout().dofs();
    }
    let vectors = DMatrix::from_fn(basis.nrows(), kept, |i, k| basis[(i, order[k])]);
    let weights = DMatrix::from_fn(kept, movements, |k, j| block[(order[k], j)]);
    let mut spectrum: Vec<f64> =
        libraries.iter().flat_map(|library| library.parts().spectrum.clone()).collect();
    spectrum.sort_by(|a, b| b.total_cmp(a));
    let values = order.iter().map(|k| values[*k]).collect();
    (LeftSingular { vectors, values, spectrum, energy }, weights, entries)
}

/// Extends a movement of one part to the whole body, with the other parts at rest at 0.
fn resting(entry: &Entry, before: usize, dofs: usize) -> Entry {
    let place = |values: &[f64]| {
        let mut all = vec![0.0; dofs];
        all[before..before + values.len()].copy_from_slice(values);
        all
    };
    let frame = &entry.frame;
    Entry {
        frame: Frame {
            start: place(&frame.start),
            goal: place(&frame.goal),
            velocity: place(&frame.velocity),
            duration: frame.duration,
        },
        ..entry.clone()
    }
}

/// Returns movement `k` of all parts together.
fn joined(libraries: &[&MotionLibrary], k: usize) -> Entry {
    let mut entry = libraries[0].entries()[k].clone();
    for library in &libraries[1..] {
        let frame = &library.entries()[k].frame;
        entry.frame.start.extend_from_slice(&frame.start);
        entry.frame.goal.extend_from_slice(&frame.goal);
        entry.frame.velocity.extend_from_slice(&frame.velocity);
    }
    entry
}
