//! Settings of the active-set solver.

/// Settings of [`ActiveSetSolver`](super::ActiveSetSolver).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActiveSetSettings {
    /// Maximum violation of a row or bound, in its own unit; relative if the bound's magnitude exceeds one. A
    /// row whose largest entry is outside 1/32 to 32 is first scaled to bring that entry between 1 and 2.
    /// Default 1e-10.
    pub feasibility: f64,
    /// Iteration limit of one solve, which bounds its duration. Each change of the working set counts as an
    /// iteration. Each factorisation of the Hessian or the working set after the first also counts, over all
    /// attempts. Default: `None`, which means ten times the number of constraints and variables, plus 50.
    pub max_iterations: Option<u32>,
    /// `true` starts each solve with the previous working set. Default true.
    pub warm_start: bool,
}

impl Default for ActiveSetSettings {
    fn default() -> Self {
        Self { feasibility: 1e-10, max_iterations: None, warm_start: true }
    }
}
