//! Tolerances of the active-set method, and the failure that each prevents.
//!
//! `tests/qp/tolerances.rs` has problems that fail without these tolerances, one for each tolerance except
//! `tie`.
//!
//! All tolerances are relative to the numbers with which they are compared. Rows are scaled first, so that
//! their entries are near one.
//!
//! - The Hessian is singular, flat or badly conditioned: `singular`, `poor`, `first_shift`,
//!   `rounds_per_shift`, `lower_shift`, `rounds`, `close`, `no_force`, `little_force`.
//! - The cost decreases forever: `recession`.
//! - A constraint depends on members of the working set: `dependent`, `weak`, `repeat`, `conflict`,
//!   `no_rate`.
//! - Rounding makes constraints join and leave alternately: `sign`, `noise`, `unsure`, `tie`, `sum`,
//!   `degenerate_steps`.
//! - The minimum has lost its significant digits: `refinements`, `converged`, `exact`, `gross`.
//! - Rounding looks like infeasibility: `conflict`, `far`, `out_of_reach`, `nearly`.

/// Defines [`Tolerances`] from a list of fields with their values.
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
    /// Minimum pivot of the factorisation of a positive definite Hessian, as a fraction of its diagonal
    /// entry. A Hessian with a smaller pivot counts as singular and is shifted.
    singular: f64 = 1e-12;
    /// Ratio of the smallest to the largest entry of the factor below which a failure is not trusted. A
    /// second attempt in well-conditioned steps then decides.
    poor: f64 = 1e-3;
    /// Initial shift of a singular Hessian, as a fraction of the largest diagonal entry.
    first_shift: f64 = 1e-4;
    /// Number of rounds with the same shift.
    rounds_per_shift: usize = 10;
    /// Ratio of each shift to the previous shift.
    lower_shift: f64 = 0.1;
    /// Maximum number of rounds.
    rounds: usize = 60;
    /// Change of the solution between rounds below which the rounds end.
    close: f64 = 1e-10;
    /// Force of the proximal term that counts as rounding, relative to the terms of the cost gradient. It
    /// ends rounds that drift along a nearly flat cost.
    no_force: f64 = 1e-12;
    /// Force below which the last round is a solution of reduced accuracy.
    little_force: f64 = 1e-10;
    /// Rate of change that counts as zero in the search for a direction along which the cost decreases
    /// forever.
    recession: f64 = 1e-9;
    /// Length of the remainder of a projection below which a constraint depends on the members.
    dependent: f64 = 1e-10;
    /// Squared pivot of the Gram matrix below which the bulk adoption ends; the remaining members are
    /// examined one by one.
    weak: f64 = 1e-7;
    /// Length of the remainder relative to the length of the constraint, below which the projection is
    /// repeated.
    repeat: f64 = 0.3;
    /// Disagreement between a constraint and the members on which it depends, above which they contradict
    /// each other.
    conflict: f64 = 1e-9;
    /// Coefficient of a member in a combination of members that counts as rounding.
    no_rate: f64 = 1e-8;
    /// Wrong sign of a multiplier, relative to the largest one, that counts as rounding: the member stays.
    sign: f64 = 1e-13;
    /// Wrong sign of a multiplier that may be rounding if its constraint was added and dropped twice in a
    /// row: the member is pinned.
    noise: f64 = 1e-9;
    /// Violation up to which the minimum is refined before the constraint is added.
    unsure: f64 = 1e-6;
    /// Violation that may be rounding: a constraint that was added because of it and leaves without a step
    /// counts as implied.
    tie: f64 = 1e-8;
    /// Fraction of the terms of a sum that counts as rounding. A row violated by less counts as satisfied.
    sum: f64 = 1e-14;
    /// Number of constraints that may be added and dropped without a step. Beyond this number the arithmetic
    /// counts as broken down.
    degenerate_steps: u32 = 8;
    /// Maximum number of refinements of a candidate.
    refinements: usize = 4;
    /// Correction, relative to the solution, at which the refinement ends.
    converged: f64 = 1e-7;
    /// Residual above which a minimum whose refinement did not converge is rejected.
    exact: f64 = 1e-9;
    /// Violation that indicates a breakdown of the arithmetic.
    gross: f64 = 1e-6;
    /// Multiple of the magnitude of the first minimum (at least one) up to which a certificate of
    /// infeasibility must exclude every `x` along unbounded variables.
    far: f64 = 1e6;
    /// Multiple of the magnitude of the first minimum (at least one) beyond which no minimum is sought if a
    /// constraint is `nearly` a combination of members.
    out_of_reach: f64 = 1e4;
    /// Squared remainder below which a constraint is nearly a combination of members.
    nearly: f64 = 1e-6;
}
