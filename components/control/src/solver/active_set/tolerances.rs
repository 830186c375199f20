//! The tolerances of the method, and the failure that each guards against.
//!
//! `tests/all/tolerances.rs` has problems that fail without one of them.
//!
//! All are relative: a share of the numbers that they are compared with. Rows are scaled before, so that
//! their entries are near one.
//!
//! - The Hessian is singular, flat or badly conditioned: `singular`, `poor`, `first_shift`,
//!   `rounds_per_shift`, `lower_shift`, `rounds`, `close`, `no_force`, `little_force`.
//! - The cost falls for ever: `recession`.
//! - A constraint depends on members of the working set: `dependent`, `weak`, `repeat`, `conflict`,
//!   `no_rate`.
//! - Constraints are added and dropped by turns, by rounding: `sign`, `noise`, `unsure`, `tie`, `sum`,
//!   `degenerate_steps`.
//! - The minimum has lost its digits: `refinements`, `converged`, `exact`, `gross`.
//! - Rounding looks like infeasibility: `conflict`, `far`, `out_of_reach`, `nearly`.

with_defaults! {
    /// Tolerances of the active-set method.
    pub(super) struct Tolerances;

    /// The tolerances of double precision.
    pub(super) const TOLERANCES;

    /// Smallest share of a diagonal entry that is left of it in the factorisation of a positive definite
    /// Hessian. A smaller one makes the Hessian singular, and it is shifted.
    pub(super) singular: f64 = 1e-12;
    /// Ratio of the smallest to the largest entry of the factor up to which an outcome without a solution is
    /// not believed: a second attempt in well-conditioned steps decides.
    pub(super) poor: f64 = 1e-3;
    /// Initial shift of a singular Hessian, as a share of the largest diagonal entry.
    pub(super) first_shift: f64 = 1e-4;
    /// Rounds with one shift.
    pub(super) rounds_per_shift: usize = 10;
    /// Factor of the next shift.
    pub(super) lower_shift: f64 = 0.1;
    /// Rounds in all.
    pub(super) rounds: usize = 60;
    /// Change of the solution between rounds at which they end.
    pub(super) close: f64 = 1e-10;
    /// Force of the proximal term, as a share of the numbers of the cost's slope, that is rounding. It ends
    /// rounds that drift along a nearly flat cost.
    pub(super) no_force: f64 = 1e-12;
    /// Force at which the last round is a solution of reduced accuracy.
    pub(super) little_force: f64 = 1e-10;
    /// Rate of change along a direction that counts as zero: in the search for a direction along which the
    /// cost falls for ever.
    pub(super) recession: f64 = 1e-9;
    /// Length of the remainder of a projection below which a constraint depends on the members.
    pub(super) dependent: f64 = 1e-10;
    /// Squared pivot of the Gram matrix below which the bulk adoption ends and the rest is examined one by
    /// one.
    pub(super) weak: f64 = 1e-7;
    /// Share of its length below which the projection of a constraint is repeated.
    pub(super) repeat: f64 = 0.3;
    /// Disagreement of a constraint with the members on which it depends that exceeds rounding: they
    /// contradict each other.
    pub(super) conflict: f64 = 1e-9;
    /// Share of a member in a combination of members that is rounding.
    pub(super) no_rate: f64 = 1e-8;
    /// Wrong sign of a multiplier, as a share of the largest, that is rounding: the member stays.
    pub(super) sign: f64 = 1e-13;
    /// Wrong sign of a multiplier that may be rounding if its constraint was added and dropped twice in a
    /// row: the member is pinned.
    pub(super) noise: f64 = 1e-9;
    /// Violation up to which the minimum is refined before it counts.
    pub(super) unsure: f64 = 1e-6;
    /// Violation that may be rounding: a constraint that was added for it and leaves without a step counts as
    /// implied.
    pub(super) tie: f64 = 1e-8;
    /// Share of the terms of a sum that is rounding: a row violated by less is satisfied.
    pub(super) sum: f64 = 1e-14;
    /// Number of constraints that may be added and dropped without a step before the arithmetic counts as
    /// broken down.
    pub(super) degenerate_steps: u32 = 8;
    /// Largest number of refinements of a candidate.
    pub(super) refinements: usize = 4;
    /// Correction, as a share of the solution, that is the last.
    pub(super) converged: f64 = 1e-7;
    /// Residual above which a minimum whose refinement did not converge is rejected.
    pub(super) exact: f64 = 1e-9;
    /// Violation that only a breakdown of the arithmetic leaves.
    pub(super) gross: f64 = 1e-6;
    /// Multiple of the magnitude of the first minimum (at least one) within which a certificate of
    /// infeasibility must exclude every `x` for unbounded variables.
    pub(super) far: f64 = 1e6;
    /// Multiple of the same magnitude beyond which no minimum is sought if a constraint is `nearly` a
    /// combination of members.
    pub(super) out_of_reach: f64 = 1e4;
    /// Squared remainder of a constraint that is nearly a combination of members.
    pub(super) nearly: f64 = 1e-6;
}
