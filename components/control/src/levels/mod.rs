//! Strict priorities: a level of tasks never changes the solution of the levels above.
//!
//! Each level minimises its cost over the motions that leave all levels above unchanged, within the same
//! limits. This is the lexicographic optimum; a hard stack of tasks is the special case without active
//! limits. Kanoun, Lamiraux and Wieber, *Kinematic control of redundant manipulators: generalizing the
//! task-priority framework to inequality task*, 2011.

mod freedom;
mod level;

pub(crate) use freedom::Freedom;
pub use freedom::Rows;
pub(crate) use level::{Level, LevelError, LevelSolver, SolveLevel};

use motorium_qp::{Problem, SolveError, UpdateError};
use nalgebra::DMatrix;

/// The levels below the first, with their solvers.
#[derive(Debug)]
pub(crate) struct LowerLevels<S> {
    /// Rows determined by the first level: exact rows and its tasks.
    pub(crate) first: Rows,
    levels: Vec<Level>,
    solvers: Vec<S>,
    freedom: Freedom,
}

impl<S: SolveLevel> LowerLevels<S> {
    /// Creates levels whose tasks have at most `rows` rows each, highest first. The first level has `exact`
    /// rows in addition. Returns `None` if there is only one level.
    pub(crate) fn new(
        variables: usize,
        exact: usize,
        rows: &[usize],
        damping: f64,
        solver: impl Fn() -> S,
    ) -> Option<Self> {
        let (first, below) = rows.split_first().filter(|(_, below)| !below.is_empty())?;
        let first = first + exact;
        Some(Self {
            first: Rows::new(variables, first),
            levels: below.iter().map(|rows| Level::new(variables, *rows, damping)).collect(),
            solvers: below.iter().map(|_| solver()).collect(),
            freedom: Freedom::new(variables, below.iter().copied().fold(first, usize::max)),
        })
    }

    /// Starts a tick without tasks.
    pub(crate) fn begin(&mut self) {
        self.first.clear();
        self.levels.iter_mut().for_each(Level::begin);
    }

    /// Returns the costs of the levels for writing.
    pub(crate) fn costs_mut(&mut self) -> impl Iterator<Item = &mut Problem> {
        self.levels.iter_mut().map(|level| &mut level.cost)
    }

    /// Solves the levels in order with `solve`, which adds the motion of a level to the solution. The columns
    /// of `open` span the motions that are free initially; `None` for all. Returns the number of levels
    /// without a solution; the levels above them keep theirs.
    ///
    /// # Errors
    /// If the numbers of a level are invalid.
    pub(crate) fn solve(
        &mut self,
        open: Option<&DMatrix<f64>>,
        mut solve: impl FnMut(&mut S, &mut Level, &Freedom) -> Result<(), LevelError>,
    ) -> Result<u32, UpdateError> {
        let Self { first, levels, solvers, freedom } = self;
        match open {
            Some(map) => freedom.open_to(map),
            None => freedom.open(),
        }
        let (mut above, mut undecided) = (&*first, 0);
        for (level, solver) in levels.iter_mut().zip(solvers) {
            freedom.close(above);
            match solve(solver, level, freedom) {
                Ok(()) => {}
                Err(LevelError::Pose(error)) => return Err(error),
                Err(LevelError::Solve(error)) => {
                    // at its iteration limit the solver continues in the next tick
                    if !matches!(error, SolveError::MaxIterations { .. }) {
                        solver.reset();
                    }
                    undecided += 1;
                }
            }
            above = &level.rows;
        }
        Ok(undecided)
    }

    /// Discards the previous solutions.
    pub(crate) fn reset(&mut self) {
        self.solvers.iter_mut().for_each(S::reset);
    }
}

/// Sets a regularisation per level, highest first, and returns the first one's.
///
/// # Panics
/// If the number of entries differs from the number of levels.
pub(crate) fn set_damping<S>(below: &mut Option<LowerLevels<S>>, damping: &[f64]) -> f64 {
    let below = below.as_mut().map_or(&mut [][..], |below| &mut below.levels);
    assert_eq!(damping.len(), 1 + below.len(), "one regularisation for each level");
    for (level, damping) in below.iter_mut().zip(&damping[1..]) {
        level.damping = *damping;
    }
    damping[0]
}

/// Returns the cost of a level, 0 for the highest, and its rows if there are levels below the first.
///
/// # Panics
/// If the level does not exist.
pub(crate) fn level<'a, S>(
    below: &'a mut Option<LowerLevels<S>>,
    first: &'a mut Problem,
    level: usize,
) -> (&'a mut Problem, Option<&'a mut Rows>) {
    match (below, level) {
        (None, 0) => (first, None),
        (Some(below), 0) => (first, Some(&mut below.first)),
        (Some(below), level) => {
            let Level { cost, rows, .. } = &mut below.levels[level - 1];
            (cost, Some(rows))
        }
        (None, level) => panic!("level {level} of a controller that has only the first"),
    }
}

/// Writes exact rows of a task as equalities of `problem` from row `first` on, above all levels.
pub(crate) fn write_exact<S>(
    rows: &Rows,
    problem: &mut Problem,
    first: usize,
    below: &mut Option<LowerLevels<S>>,
) {
    for (row, (entries, desired)) in rows.iter().enumerate() {
        problem.equality_value[first + row] = desired;
        for (column, entry) in entries.iter().enumerate() {
            problem.equality_matrix[(first + row, column)] = *entry;
        }
        if let Some(below) = below {
            below.first.push(0.0).copy_from_slice(entries);
        }
    }
}
