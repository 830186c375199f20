//! Limits of combinations of velocities.

use nalgebra::Isometry3;

use crate::{RobotState, solver::Problem};

/// Bounds on combinations of the velocities, `lower <= G v <= upper`, that always admit `v = 0`.
pub trait RowLimit {
    /// Number of rows of `G`, the most that it ever has.
    fn rows(&self) -> usize;

    /// Writes its rows for a tick of `dt` seconds; rows that are not written do not bound.
    fn write(&mut self, state: &RobotState<'_>, dt: f64, rows: &mut LimitRows<'_>);

    /// Takes the pose of an object of the world that moves, given by its index among the objects. A limit that has nothing to do with
    /// it ignores it.
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

    /// Appends the row `lower <= row v <= upper`, where `row` has an entry for each velocity. Zero is kept within the bounds.
    ///
    /// # Panics
    /// If the limit has no more rows.
    pub fn push(&mut self, row: impl IntoIterator<Item = f64>, lower: f64, upper: f64) {
        assert!(self.next < self.end, "a limit writes more rows than it has");
        for (entry, value) in self.problem.row_matrix.row_mut(self.next).iter_mut().zip(row) {
            *entry = value;
        }
        self.problem.row_lower[self.next] = lower.min(0.0);
        self.problem.row_upper[self.next] = upper.max(0.0);
        self.next += 1;
    }
}
