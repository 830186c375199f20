//! The progress of one solve, and the flags by which it detects rounding errors.

/// Counters and flags of one solve; see the [tolerances](super::tolerances) that act on them.
#[derive(Debug, Default)]
pub(super) struct Progress {
    /// Iterations so far: changes of the working set plus factorisations after the first.
    pub(super) iterations: u32,
    /// Number of iterations at which this attempt ends.
    pub(super) limit: u32,
    /// Constraint added last, if its violation may be rounding. If it leaves without a step, it counts as
    /// implied by the members.
    pub(super) last_added_in_doubt: Option<usize>,
    /// Constraint added last, if no member has left since.
    pub(super) last_added: Option<usize>,
    /// Constraint dropped last, if it had just been added. If this happens twice in a row, it is pinned.
    pub(super) last_dropped: Option<usize>,
    /// Number of violated constraints that were added and dropped without a step.
    pub(super) degenerate_steps: u32,
    /// `true` if a constraint counts as satisfied although `x` violates it by more than the tolerance, within
    /// rounding. The accuracy is then reduced.
    pub(super) within_rounding: bool,
    /// `true` if the last refinement converged.
    pub(super) refined: bool,
    /// Largest magnitude in the last minimum.
    pub(super) size: f64,
    /// One plus the magnitude of the first minimum of this solve; 0 before it.
    pub(super) first_size: f64,
    /// `true` if the problem data prove infeasibility.
    pub(super) is_certain: bool,
}
