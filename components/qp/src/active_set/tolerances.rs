//! The tolerances of the method, and the failure that each guards against.
//!
//! `tests/qp/tolerances.rs` has problems that fail without each of them, except `tie`.
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

/// Defines [`Tolerances`] with the value of each next to its description.
macro_rules! tolerances {
    ( $( $(#[$doc:meta])* $name:ident: $type:ty = $value:expr; )* ) => {
        /// Tolerances of the active-set method.
        pub(super) struct Tolerances {
            $( $(#[$doc])* pub(super) $name: $type, )*
        }

        /// The tolerances of double precision.
        pub(super) const TOLERANCES: Tolerances = Tolerances { $( $name: $value, )* };
    };
}

tolerances! {
    /// Smallest share of a diagonal entry that is left of it in the factorisation of a positive definite
    /// Hessian. A smaller one makes the Hessian singular, and it is shifted.
    singular: f64 = 1e-12;
    /// Ratio of the smallest to the largest entry of the factor up to which an outcome without a solution is
    /// not believed: a second attempt in well-conditioned steps decides.
    poor: f64 = 1e-3;
    /// Initial shift of a singular Hessian, as a share of the largest diagonal entry.
    first_shift: f64 = 1e-4;
    /// Rounds with one shift.
    rounds_per_shift: usize = 10;
    /// Factor of the next shift.
    lower_shift: f64 = 0.1;
    /// Rounds in all.
    rounds: usize = 60;
    /// Change of the solution between rounds at which they end.
    close: f64 = 1e-10;
    /// Force of the proximal term, as a share of the numbers of the cost's slope, that is rounding. It ends
    /// rounds that drift along a nearly flat cost.
    no_force: f64 = 1e-12;
    /// Force at which the last round is a solution of reduced accuracy.
    little_force: f64 = 1e-10;
    /// Rate of change along a direction that counts as zero: in the search for a direction along which the
    /// cost falls for ever.
    recession: f64 = 1e-9;
    /// Length of the remainder of a projection below which a constraint depends on the members.
    dependent: f64 = 1e-10;
    /// Squared pivot of the Gram matrix below which the bulk adoption ends and the rest is examined one by
    /// one.
    weak: f64 = 1e-7;
    /// Share of its length below which the projection of a constraint is repeated.
    repeat: f64 = 0.3;
    /// Disagreement of a constraint with the members on which it depends that exceeds rounding: they
    /// contradict each other.
    conflict: f64 = 1e-9;
    /// Share of a member in a combination of members that is rounding.
    no_rate: f64 = 1e-8;
    /// Wrong sign of a multiplier, as a share of the largest, that is rounding: the member stays.
    sign: f64 = 1e-13;
    /// Wrong sign of a multiplier that may be rounding if its constraint was added and dropped twice in a
    /// row: the member is pinned.
    noise: f64 = 1e-9;
    /// Violation up to which the minimum is refined before it counts.
    unsure: f64 = 1e-6;
    /// Violation that may be rounding: a constraint that was added for it and leaves without a step counts as
    /// implied.
    tie: f64 = 1e-8;
    /// Fraction of the terms of a sum that is rounding: a row violated by less is satisfied.
    sum: f64 = 1e-14;
    /// Number of constraints that may be added and dropped without a step before the arithmetic counts as
    /// broken down.
    degenerate_steps: u32 = 8;
    /// Largest number of refinements of a candidate.
    refinements: usize = 4;
    /// Correction, as a share of the solution, that is the last.
    converged: f64 = 1e-7;
    /// Residual above which a minimum whose refinement did not converge is rejected.
    exact: f64 = 1e-9;
    /// Violation that only a breakdown of the arithmetic leaves.
    gross: f64 = 1e-6;
    /// Multiple of the magnitude of the first minimum (at least one) within which a certificate of
    /// infeasibility must exclude every `x` for unbounded variables.
    far: f64 = 1e6;
    /// Multiple of the same magnitude beyond which no minimum is sought if a constraint is `nearly` a
    /// combination of members.
    out_of_reach: f64 = 1e4;
    /// Squared remainder of a constraint that is nearly a combination of members.
    nearly: f64 = 1e-6;
}
