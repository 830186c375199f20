//! Adding movements to a library without its original recordings.

use nalgebra::DMatrix;

use crate::motion_library::check;
use crate::{BuildError, Entry, LibraryParts, MotionLibrary, Movement, Trajectory};
use motorium_algebra::{Simd, Wanted, eigen_of_rank_one_update, left_singular};

/// A library that is updated with movements one by one or in blocks.
///
/// With `p = U^T x`, `e = x - U p` and `rho = |e|`, the new matrix is
/// `[U, e/rho] [[g S, p], [0, rho]] [...]^T`. The left singular vectors of the small matrix are the
/// eigenvectors of `diag(g^2 S^2, 0) + [p; rho] [p; rho]^T`: a secular equation. `g <= 1` is a forgetting
/// factor: after `k` further movements, a movement has the weight `g^k`. At most `capacity` eigenforces are
/// kept. The last eigenforces are inexact, so set a capacity of about `2 n + 10` to use `n`. An update costs
/// `O(rows capacity^2)`.
///
/// Singular values below about 1e-7 times the largest value are not resolved, because the equation contains
/// their squares.
///
/// Source: Brand, *Fast low-rank modifications of the thin singular value decomposition*, Linear Algebra and
/// its Applications 415, 2006. [`RecursiveScatter`](super::RecursiveScatter) is the covariance form from
/// appendix A of Delhaisse (2019).
#[derive(Clone, Debug)]
pub struct RecursiveLibrary {
    origin: MotionLibrary,
    capacity: usize,
    forgetting: f64,
    simd: Simd,
    /// rows x rank, the smallest singular value first.
    basis: DMatrix<f64>,
    squares: Vec<f64>,
    energy: f64,
    added: Vec<Entry>,
    added_data: Vec<f64>,
}

impl RecursiveLibrary {
    /// Creates an updatable library that continues from `library` and keeps at most `capacity` eigenforces.
    /// `forgetting` is the factor `g`, more than 0, at most 1.
    ///
    /// # Panics
    /// If `forgetting` is out of range.
    pub fn new(library: MotionLibrary, capacity: usize, forgetting: f64) -> Self {
        assert!(forgetting > 0.0 && forgetting <= 1.0, "forgetting by {forgetting}, expected 0 to 1");
        let parts = library.parts();
        let rank = library.rank().min(capacity.max(1));
        let basis = DMatrix::from_fn(library.rows(), rank, |i, k| parts.basis[(i, rank - 1 - k)]);
        let squares = (0..rank).map(|k| parts.singular[rank - 1 - k].powi(2)).collect();
        let energy = parts.energy;
        let (added, added_data, simd) = (Vec::new(), Vec::new(), Simd::new());
        let capacity = capacity.max(1);
        Self { origin: library, capacity, forgetting, simd, basis, squares, energy, added, added_data }
    }

    /// Adds one movement, given as forces.
    ///
    /// # Panics
    /// If the length of `forces` differs from the number of rows of the library.
    pub fn add_forces(&mut self, forces: &[f64]) {
        let rows = self.basis.nrows();
        let mut x = DMatrix::from_column_slice(rows, 1, forces);
        self.origin.metric().into_space(self.origin.spring(), &mut x);
        self.add_data(x.as_slice());
    }

    /// Adds one column of data that is already in the space of the metric.
    fn add_data(&mut self, x: &[f64]) {
        let (rows, rank) = self.basis.shape();
        let mut rest = x.to_vec();
        let mut p = vec![0.0; rank];
        let mut correction = vec![0.0; rank];
        // twice: the second pass removes the component along the basis that rounding left in the residual
        for _ in 0..2 {
            self.simd.project(self.basis.as_slice(), &rest, &mut correction);
            correction.iter_mut().for_each(|c| *c = -*c);
            self.simd.superpose(self.basis.as_slice(), &correction, &mut rest);
            p.iter_mut().zip(&correction).for_each(|(p, c)| *p -= c);
        }
        let size = self.simd.dot(x, x);
        let rho = self.simd.dot(&rest, &rest).sqrt();
        let fade = self.forgetting * self.forgetting;
        self.energy = fade * self.energy + size;
        self.squares.iter_mut().for_each(|s| *s *= fade);
        let is_new = rho > 1e-12 * size.sqrt();
        let mut extended = DMatrix::zeros(rows, rank + usize::from(is_new));
        let (mut d, mut z) = (Vec::with_capacity(rank + 1), Vec::with_capacity(rank + 1));
        if is_new {
            rest.iter_mut().for_each(|e| *e /= rho);
            extended.as_mut_slice()[..rows].copy_from_slice(&rest);
            d.push(0.0);
            z.push(rho);
        }
        let begin = extended.len() - rows * rank;
        extended.as_mut_slice()[begin..].copy_from_slice(self.basis.as_slice());
        d.extend_from_slice(&self.squares);
        z.extend_from_slice(&p);
        let update = eigen_of_rank_one_update(&d, &z);
        let kept = d.len().min(self.capacity);
        let dropped = d.len() - kept;
        self.basis = &extended * update.vectors.columns(dropped, kept);
        self.squares = update.values[dropped..].iter().map(|value| value.max(0.0)).collect();
    }

    /// Adds a block of movements, given as forces, one per column. The forgetting factor applies once per
    /// block.
    pub fn add_block(&mut self, forces: &DMatrix<f64>) {
        let mut data = forces.clone();
        self.origin.metric().into_space(self.origin.spring(), &mut data);
        let rank = self.basis.ncols();
        let mut rest = data.clone();
        let mut p = DMatrix::zeros(rank, data.ncols());
        for _ in 0..2 {
            let correction = self.basis.transpose() * &rest;
            rest -= &self.basis * &correction;
            p += correction;
        }
        let qr = rest.qr();
        let (q, r) = (qr.q(), qr.r());
        let mut small = DMatrix::zeros(rank + q.ncols(), rank + data.ncols());
        for (k, square) in self.squares.iter().enumerate() {
            small[(k, k)] = self.forgetting * square.sqrt();
        }
        small.view_mut((0, rank), p.shape()).copy_from(&p);
        small.view_mut((rank, rank), r.shape()).copy_from(&r);
        let found = left_singular(&small, Wanted::Rank(self.capacity));
        let kept = found.values.len();
        let reversed = DMatrix::from_fn(small.nrows(), kept, |i, k| found.vectors[(i, kept - 1 - k)]);
        let mut extended = self.basis.clone().resize_horizontally(rank + q.ncols(), 0.0);
        extended.columns_mut(rank, q.ncols()).copy_from(&q);
        self.basis = extended * reversed;
        self.squares = found.values.iter().rev().map(|s| s * s).collect();
        self.energy = self.forgetting * self.forgetting * self.energy + data.norm_squared();
    }

    /// Adds a recording, which becomes a movement of the library.
    ///
    /// # Errors
    /// [`BuildError`] if the recording does not match the library.
    pub fn add(&mut self, trajectory: &Trajectory) -> Result<(), BuildError> {
        check(trajectory, self.origin.layout().dofs())?;
        let movement = Movement::from_trajectory(trajectory, self.origin.spring());
        self.add_forces(&movement.forces);
        self.added_data.extend_from_slice(&movement.forces);
        let (id, label) = (trajectory.id.clone(), trajectory.label.clone());
        self.added.push(Entry { id, label, frame: movement.frame });
        Ok(())
    }

    /// Returns the singular values in descending order.
    pub fn singular(&self) -> Vec<f64> {
        self.squares.iter().rev().map(|s| s.sqrt()).collect()
    }

    /// Converts to a library of the previous movements, as represented by the current eigenforces, and the
    /// added movements.
    pub fn into_library(self) -> MotionLibrary {
        let (rows, rank) = self.basis.shape();
        let basis = DMatrix::from_fn(rows, rank, |i, k| self.basis[(i, rank - 1 - k)]);
        let singular = self.singular();
        let parts = self.origin.into_parts();
        let mut data = DMatrix::from_vec(rows, self.added.len(), self.added_data);
        parts.metric.into_space(&parts.spring, &mut data);
        let old = basis.transpose() * &parts.basis * &parts.weights;
        let mut weights = old.resize_horizontally(parts.entries.len() + self.added.len(), 0.0);
        weights.columns_mut(parts.entries.len(), self.added.len()).copy_from(&(basis.transpose() * &data));
        let mut entries = parts.entries;
        entries.extend(self.added);
        MotionLibrary::from_parts(LibraryParts {
            spectrum: singular.clone(),
            energy: self.energy,
            basis,
            singular,
            weights,
            entries,
            ..parts_without_data(parts.layout, parts.spring, parts.metric)
        })
        .expect("an updated library is consistent")
    }
}

fn parts_without_data(
    layout: super::Layout,
    spring: super::SampledSpring,
    metric: super::Metric,
) -> LibraryParts {
    LibraryParts {
        layout,
        spring,
        metric,
        basis: DMatrix::zeros(0, 0),
        singular: Vec::new(),
        spectrum: Vec::new(),
        energy: 0.0,
        weights: DMatrix::zeros(0, 0),
        entries: Vec::new(),
    }
}
