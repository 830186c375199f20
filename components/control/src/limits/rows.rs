//! Limits of combinations of velocities.

use nalgebra::{DMatrix, Isometry3};

use crate::{RobotState, solver::Problem};

/// Bounds on combinations of the velocities, `lower <= G v <= upper`. They admit `v = 0`, but where something
/// beyond its limit is to [come back](LimitRows::push_barrier).
pub trait RowLimit {
    /// Number of rows of `G`, the most that it ever has.
    fn rows(&self) -> usize;

    /// Writes its rows for a tick of `dt` seconds; rows that are not written do not bound.
    fn write(&mut self, state: &RobotState<'_>, dt: f64, rows: &mut LimitRows<'_>);

    /// Takes the pose of an object of the world that moves, given by its index among the objects. A limit
    /// that has nothing to do with it ignores it.
    fn move_object(&mut self, _object: usize, _pose: &Isometry3<f64>) {}

    /// The smallest distance at the last tick \[m\], of a limit of distances that had one in its range.
    fn smallest_distance(&self) -> Option<f64> {
        None
    }
}

/// Rows of a problem that a [`RowLimit`] may write.
#[derive(Debug)]
pub struct LimitRows<'a> {
    problem: &'a mut Problem,
    next: usize,
    end: usize,
}

impl<'a> LimitRows<'a> {
    pub(crate) fn new(problem: &'a mut Problem, first: usize, count: usize) -> Self {
        Self { problem, next: first, end: first + count }
    }

    /// Appends the row `lower <= row v <= upper`, where `row` has an entry for each velocity. Zero is kept
    /// within the bounds.
    ///
    /// # Panics
    /// If the limit has no more rows.
    pub fn push(&mut self, row: impl IntoIterator<Item = f64>, lower: f64, upper: f64) {
        self.write(row, lower.min(0.0), upper.max(0.0));
    }

    /// Appends a control barrier: `row` is the slope of what is left of a way, now `left` \[m\], of which a
    /// share of `rate` may be covered per second.
    ///
    /// ```text
    /// row v >= -rate left                              if left >= 0
    /// row v >=  min(-rate left, recovery)              else: it comes back, no faster than `recovery` [m/s]
    /// ```
    ///
    /// A step along the tangent of a curved way leaves it by its square, and the limit of the next step
    /// begins where it ended: without the way back such steps add up. Where no velocity fulfils all limits,
    /// what is beyond its limit stays where it is. What is left that is no number counts as 0.
    ///
    /// # Panics
    /// If the limit has no more rows.
    pub fn push_barrier(&mut self, row: impl IntoIterator<Item = f64>, left: f64, rate: f64, recovery: f64) {
        let left = if left.is_nan() { 0.0 } else { left };
        self.write(row, (-rate * left).min(recovery), f64::INFINITY);
    }

    /// The same for a `row` along which the way shrinks: `row v <= max(rate left, -recovery)`.
    ///
    /// # Panics
    /// If the limit has no more rows.
    pub fn push_upper_barrier(
        &mut self,
        row: impl IntoIterator<Item = f64>,
        left: f64,
        rate: f64,
        recovery: f64,
    ) {
        let left = if left.is_nan() { 0.0 } else { left };
        self.write(row, f64::NEG_INFINITY, (rate * left).max(-recovery));
    }

    fn write(&mut self, row: impl IntoIterator<Item = f64>, lower: f64, upper: f64) {
        assert!(self.next < self.end, "a limit writes more rows than it has");
        for (entry, value) in self.problem.row_matrix.row_mut(self.next).iter_mut().zip(row) {
            *entry = value;
        }
        self.problem.row_lower[self.next] = lower;
        self.problem.row_upper[self.next] = upper;
        self.next += 1;
    }
}

/// Cosine of the angle between rows that are nearly the same.
const ALIKE: f64 = 0.9;

/// True if two rows move by nearly the same motions, as those of one pair of solids do.
pub(crate) fn are_alike(rows: &DMatrix<f64>, row: usize, other: usize) -> bool {
    let (row, other) = (rows.row(row), rows.row(other));
    row.dot(&other) >= ALIKE * row.norm() * other.norm()
}
