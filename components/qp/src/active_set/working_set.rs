//! The working set: constraints held as equalities, with the factor of their Schur complement.

use super::kernels::{Arithmetic, Lower, add_scaled, dot, gram, padded};
use super::tolerances::TOLERANCES;

/// A constraint of the working set: its number and its side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Member {
    /// Number of the constraint: equalities first, then rows, then bounds.
    pub(super) constraint: usize,
    /// Required sign of the multiplier: 1 on the upper side, -1 on the lower, 0 for an equality.
    pub(super) sign: f64,
    /// Value at which the constraint is held.
    pub(super) value: f64,
    /// Multiplier of the constraint.
    pub(super) multiplier: f64,
    /// `true` if the member stays although rounding gives its multiplier the wrong sign.
    pub(super) pinned: bool,
}

/// The members with their normals `N`, with `B = L^-1 N` where `P = L L'`, and with the Cholesky factor of
/// `B' B`.
#[derive(Clone, Debug)]
pub(super) struct WorkingSet {
    pub(super) members: Vec<Member>,
    pub(super) factor: Lower,
    capacity: usize,
    stride: usize,
    /// `N`, with a row per variable and a column per member.
    normals: Vec<f64>,
    /// `B` in the same layout.
    scaled: Vec<f64>,
    /// Multipliers at the minimum with all members held.
    pub(super) solved: Vec<f64>,
    /// Right-hand side of the equations of the multipliers, and its forward substitution.
    right: Vec<f64>,
    forward: Vec<f64>,
    /// The candidate: its normal `a`, `L^-1 a`, the projection on the members and the remainder.
    pub(super) normal: Vec<f64>,
    candidate: Vec<f64>,
    pub(super) projection: Vec<f64>,
    below: Vec<f64>,
    pub(super) left: Vec<f64>,
    /// Squared length of the remainder, absolute and relative to the candidate.
    pub(super) left_squared: f64,
    pub(super) left_share: f64,
}

impl WorkingSet {
    pub(super) fn new(variables: usize) -> Self {
        let stride = padded(variables);
        let row = || vec![0.0; stride];
        Self {
            members: Vec::with_capacity(variables),
            factor: Lower::new(variables),
            capacity: variables,
            stride,
            normals: vec![0.0; stride * variables],
            scaled: vec![0.0; stride * variables],
            solved: row(),
            right: row(),
            forward: row(),
            normal: row(),
            candidate: row(),
            projection: row(),
            below: row(),
            left: row(),
            left_squared: 0.0,
            left_share: 0.0,
        }
    }

    #[inline(always)]
    pub(super) fn len(&self) -> usize {
        self.members.len()
    }

    #[inline(always)]
    fn width(&self) -> usize {
        padded(self.members.len())
    }

    #[inline(always)]
    fn rows<'a>(&self, matrix: &'a [f64]) -> std::slice::ChunksExact<'a, f64> {
        matrix.chunks_exact(self.stride.max(1))
    }

    /// Empties the set.
    #[inline(always)]
    pub(super) fn clear(&mut self) {
        let width = self.width();
        for row in self.normals.chunks_exact_mut(self.stride.max(1)) {
            row[..width].fill(0.0);
        }
        for row in self.scaled.chunks_exact_mut(self.stride.max(1)) {
            row[..width].fill(0.0);
        }
        self.members.clear();
        self.factor.size = 0;
    }

    /// Writes one entry of a member's normal for [`adopt`](Self::adopt).
    #[inline(always)]
    pub(super) fn set_normal(&mut self, variable: usize, member: usize, value: f64) {
        self.normals[variable * self.stride + member] = value;
    }

    /// Adopts the members whose normals have been written. Returns the number of leading independent members;
    /// later ones are not adopted.
    #[inline(always)]
    pub(super) fn adopt<F: Arithmetic>(&mut self, hessian: &Lower, g: &[f64]) -> usize {
        let (count, width) = (self.members.len(), self.width());
        for (scaled, normal) in self
            .scaled
            .chunks_exact_mut(self.stride.max(1))
            .zip(self.normals.chunks_exact(self.stride.max(1)))
        {
            scaled[..width].copy_from_slice(&normal[..width]);
        }
        hessian.solve_many::<F>(&mut self.scaled, self.stride, width);
        gram::<F>(&self.scaled, self.stride, count, &mut self.factor);
        let taken = self.factor.factorize::<F>(count, TOLERANCES.weak);
        self.factor.size = taken;
        // Columns that are not adopted are cleared: entries beyond the members must be zero.
        for matrix in [&mut self.scaled, &mut self.normals] {
            for row in matrix.chunks_exact_mut(self.stride.max(1)) {
                row[taken..width].fill(0.0);
            }
        }
        self.members.truncate(taken);
        self.right[..width].fill(0.0);
        for (row, g) in self.scaled.chunks_exact(self.stride.max(1)).zip(g) {
            add_scaled::<F>(-*g, &row[..width], &mut self.right[..width]);
        }
        for (right, member) in self.right.iter_mut().zip(&self.members) {
            *right -= member.value;
        }
        self.substitute::<F>(0);
        taken
    }

    /// Performs forward substitution from member `first` on.
    #[inline(always)]
    fn substitute<F: Arithmetic>(&mut self, first: usize) {
        let (count, width) = (self.len(), self.width());
        self.forward[first..count].copy_from_slice(&self.right[first..count]);
        self.forward[count..width].fill(0.0);
        self.factor.solve::<F>(&mut self.forward, first);
    }

    /// Computes the multipliers at the minimum with all members held.
    #[inline(always)]
    pub(super) fn solve<F: Arithmetic>(&mut self) {
        let width = self.width();
        self.solved[..width].copy_from_slice(&self.forward[..width]);
        self.factor.solve_transposed::<F>(&mut self.solved);
    }

    /// Stores the multipliers of the last [`solve`](Self::solve) in the members.
    #[inline(always)]
    pub(super) fn keep_multipliers(&mut self) {
        for (member, solved) in self.members.iter_mut().zip(&self.solved) {
            member.multiplier = *solved;
        }
    }

    /// Computes `y -= B v`, where `v` has one number per member.
    #[inline(always)]
    fn subtract<F: Arithmetic>(&self, v: &[f64], y: &mut [f64]) {
        let width = self.width();
        for (row, y) in self.rows(&self.scaled).zip(y) {
            *y -= dot::<F>(&row[..width], &v[..width]);
        }
    }

    /// Writes the scaled minimum `t = -g - B multipliers`.
    #[inline(always)]
    pub(super) fn scaled_minimum<F: Arithmetic>(&self, g: &[f64], t: &mut [f64]) {
        let width = self.width();
        for ((row, t), g) in self.rows(&self.scaled).zip(t).zip(g) {
            *t = -g - dot::<F>(&row[..width], &self.solved[..width]);
        }
    }

    /// Writes `B' v` into `out`.
    #[inline(always)]
    fn project<F: Arithmetic>(matrix: &[f64], stride: usize, width: usize, v: &[f64], out: &mut [f64]) {
        out[..width].fill(0.0);
        for (row, v) in matrix.chunks_exact(stride.max(1)).zip(v) {
            add_scaled::<F>(*v, &row[..width], &mut out[..width]);
        }
    }

    /// Projects the constraint in `normal` on the members. Returns `true` if it is independent;
    /// [`projection`](Self::projection) is its combination of the members.
    #[inline(always)]
    pub(super) fn examine<F: Arithmetic>(&mut self, hessian: &Lower) -> bool {
        let (count, width) = (self.len(), self.width());
        self.candidate.copy_from_slice(&self.normal);
        hessian.solve::<F>(&mut self.candidate, 0);
        let size = dot::<F>(&self.candidate, &self.candidate);
        self.left.copy_from_slice(&self.candidate);
        self.projection[..width].fill(0.0);
        self.below[..width].fill(0.0);
        // Projected again if little remains, because the first projection has lost the corresponding digits.
        for _ in 0..3 {
            let mut part = std::mem::take(&mut self.solved);
            Self::project::<F>(&self.scaled, self.stride, width, &self.left, &mut part);
            self.factor.solve::<F>(&mut part, 0);
            add_scaled::<F>(1.0, &part[..width], &mut self.below[..width]);
            self.factor.solve_transposed::<F>(&mut part);
            add_scaled::<F>(1.0, &part[..width], &mut self.projection[..width]);
            let mut left = std::mem::take(&mut self.left);
            let before = dot::<F>(&left, &left);
            self.subtract::<F>(&part, &mut left);
            let after = dot::<F>(&left, &left);
            self.left = left;
            self.solved = part;
            if after > TOLERANCES.repeat * TOLERANCES.repeat * before {
                break;
            }
        }
        let left = dot::<F>(&self.left, &self.left);
        (self.left_squared, self.left_share) = (left, left / size);
        left > TOLERANCES.dependent * TOLERANCES.dependent * size && left > 0.0 && count < self.capacity
    }

    /// Returns an entry of `a - N r`, the remainder of the normal examined last.
    #[inline(always)]
    pub(super) fn left_of_normal<F: Arithmetic>(&self, variable: usize) -> f64 {
        let width = self.width();
        let row = &self.normals[variable * self.stride..][..width];
        self.normal[variable] - dot::<F>(row, &self.projection[..width])
    }

    /// Returns `true` if the members contradict the last examined constraint, which is a combination of them:
    /// they keep it above `value` (`sign` 1) or below it.
    #[inline(always)]
    pub(super) fn contradicts(&self, sign: f64, value: f64) -> bool {
        let (mut implied, mut size) = (0.0, value.abs());
        for (member, r) in self.members.iter().zip(&self.projection) {
            implied += r * member.value;
            size += (r * member.value).abs();
        }
        sign * (implied - value) > TOLERANCES.conflict * (1.0 + size)
    }

    /// Adds the constraint examined last, which must be independent of the members.
    #[inline(always)]
    pub(super) fn push<F: Arithmetic>(&mut self, member: Member, g: &[f64]) {
        let i = self.members.len();
        let diagonal = dot::<F>(&self.left, &self.left).sqrt();
        self.factor.push(&self.below, diagonal);
        for (row, value) in self.normals.chunks_exact_mut(self.stride.max(1)).zip(&self.normal) {
            row[i] = *value;
        }
        for (row, value) in self.scaled.chunks_exact_mut(self.stride.max(1)).zip(&self.candidate) {
            row[i] = *value;
        }
        self.members.push(member);
        self.right[i] = -member.value - dot::<F>(&self.candidate, g);
        self.substitute::<F>(i);
    }

    /// Removes a member.
    #[inline(always)]
    pub(super) fn remove<F: Arithmetic>(&mut self, j: usize) {
        let count = self.members.len();
        self.members.remove(j);
        self.factor.remove(j);
        for matrix in [&mut self.normals, &mut self.scaled] {
            for row in matrix.chunks_exact_mut(self.stride.max(1)) {
                row.copy_within(j + 1..count, j);
                row[count - 1] = 0.0;
            }
        }
        self.right.copy_within(j + 1..count, j);
        self.right[count - 1] = 0.0;
        self.forward[count - 1] = 0.0;
        self.substitute::<F>(j);
    }

    /// Computes the residuals of stationarity and of the members at `x` and the multipliers `solved`:
    /// subtracts `N multipliers` from `r` and writes `value - N' x` into `gaps`.
    #[inline(always)]
    pub(super) fn residuals<F: Arithmetic>(&self, x: &[f64], r: &mut [f64], gaps: &mut [f64]) {
        let width = self.width();
        gaps[..width].fill(0.0);
        for ((row, x), r) in self.rows(&self.normals).zip(x).zip(r) {
            let row = &row[..width];
            *r -= dot::<F>(row, &self.solved[..width]);
            add_scaled::<F>(-*x, row, &mut gaps[..width]);
        }
        for (gap, member) in gaps.iter_mut().zip(&self.members) {
            *gap += member.value;
        }
    }

    /// Corrects the multipliers, from the scaled residual `g1 = L^-1 r` and the gaps of the members.
    /// Overwrites `g1` with the scaled correction of the minimum.
    #[inline(always)]
    pub(super) fn correct<F: Arithmetic>(&mut self, g1: &mut [f64], gaps: &[f64]) {
        let width = self.width();
        let mut part = std::mem::take(&mut self.projection);
        Self::project::<F>(&self.scaled, self.stride, width, g1, &mut part);
        for (part, gap) in part[..width].iter_mut().zip(gaps) {
            *part -= gap;
        }
        self.factor.solve::<F>(&mut part, 0);
        self.factor.solve_transposed::<F>(&mut part);
        add_scaled::<F>(1.0, &part[..width], &mut self.solved[..width]);
        self.subtract::<F>(&part, g1);
        self.projection = part;
    }
}
