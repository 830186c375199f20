//! Limits on linear combinations of the velocities of a robot.

use motorium_qp::Problem;
use nalgebra::{DMatrix, Isometry3};

use crate::RobotState;

/// A limit as bounds on linear combinations of the velocities, `lower <= G v <= upper`. The bounds admit `v =
/// 0`, except for a row beyond its limit that must [return](LimitRows::push_barrier).
pub trait RowLimit {
    /// Returns the maximum number of rows of `G`.
    fn rows(&self) -> usize;

    /// Writes the rows for a tick of `dt` seconds. Rows that are not written are unbounded.
    fn write(&mut self, state: &RobotState<'_>, dt: f64, rows: &mut LimitRows<'_>);

    /// Updates the pose of a moving object of the world, given by its index. The default implementation does
    /// nothing.
    fn move_object(&mut self, _object: usize, _pose: &Isometry3<f64>) {}

    /// Returns the smallest distance at the last tick \[m\]. Returns `None` if no pair was in range or this
    /// is not a distance limit.
    fn smallest_distance(&self) -> Option<f64> {
        None
    }
}

/// Writer for the rows of a [`RowLimit`].
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

    /// Appends the row `lower <= row v <= upper`, where `row` has an entry for each velocity. The bounds are
    /// widened if they exclude zero.
    ///
    /// # Panics
    /// If the limit has already written all its rows.
    pub fn push(&mut self, row: impl IntoIterator<Item = f64>, lower: f64, upper: f64) {
        self.write(row, lower.min(0.0), upper.max(0.0));
    }

    /// Appends a control barrier: `row` is the gradient of a remaining distance, currently `left` \[m\]. At
    /// most the fraction `rate` \[1/s\] of this distance may be covered per second.
    ///
    /// ```text
    /// row v >= -rate left                              if left >= 0
    /// row v >=  min(-rate left, recovery)              else: it comes back, no faster than `recovery` [m/s]
    /// ```
    ///
    /// A step along the tangent of a curved constraint violates it in second order. Without the return, these
    /// violations would accumulate. If no velocity satisfies all limits, a row beyond its limit stays in
    /// place. A distance that is NaN counts as 0.
    ///
    /// # Panics
    /// If the limit has already written all its rows.
    pub fn push_barrier(&mut self, row: impl IntoIterator<Item = f64>, left: f64, rate: f64, recovery: f64) {
        let left = if left.is_nan() { 0.0 } else { left };
        self.write(row, (-rate * left).min(recovery), f64::INFINITY);
    }

    /// Appends the control barrier of [`push_barrier`](Self::push_barrier) as an upper bound, where `row` is
    /// the negative gradient of the remaining distance `left`: `row v <= max(rate left, -recovery)`.
    ///
    /// # Panics
    /// If the limit has already written all its rows.
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
        assert!(self.next < self.end, "limit writes more rows than its capacity");
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

/// Returns `true` if two rows involve nearly the same motions, like rows of one pair of solids.
pub(crate) fn are_alike(rows: &DMatrix<f64>, row: usize, other: usize) -> bool {
    let (row, other) = (rows.row(row), rows.row(other));
    row.dot(&other) >= ALIKE * row.norm() * other.norm()
}
