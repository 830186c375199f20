//! Settings of the active-set solver.

/// Settings of [`ActiveSetSolver`](super::ActiveSetSolver).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActiveSetSettings {
    /// Largest violation of a row or a bound, in its own unit; relative for bounds above one. A row with a
    /// largest entry outside 1/32 to 32 is scaled first, so that this entry is from 1 to 2. Default 1e-10.
    pub feasibility: f64,
    /// Largest number of iterations of one solve, the bound of its time: of changes of the working set, and
    /// of factorisations of the problem and its working set after the first. All that a solve tries counts.
    /// Default: `None`, ten times the number of constraints and variables, and 50.
    pub max_iterations: Option<u32>,
    /// Warm start: a solve starts with the previous working set. Default true.
    pub warm_start: bool,
}

impl Default for ActiveSetSettings {
    fn default() -> Self {
        Self { feasibility: 1e-10, max_iterations: None, warm_start: true }
    }
}
