//! The structure of a quadratic program, constant between ticks: its dimensions and the sides that may have
//! bounds.

use std::fmt;

/// One side of a two-sided constraint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Side {
    /// Lower side, `l <= ...`.
    Lower,
    /// Upper side, `... <= u`.
    Upper,
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if *self == Self::Lower { "lower" } else { "upper" })
    }
}

/// Sides on which a row of `G` or a variable can be bounded.
///
/// A declared side may be infinite at some ticks. An undeclared side is not passed to the solver, and a
/// finite bound on it is an error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Sides {
    /// Never bounded.
    Neither,
    /// Only from below.
    Lower,
    /// Only from above.
    Upper,
    /// From both sides.
    #[default]
    Both,
}

impl Sides {
    /// Returns `true` if `side` is declared.
    pub fn has(self, side: Side) -> bool {
        matches!((self, side), (Self::Both, _) | (Self::Lower, Side::Lower) | (Self::Upper, Side::Upper))
    }
}

/// Dimensions of a quadratic program and the declared sides of its bounds.
///
/// ```
/// use motorium_qp::{Sides, Structure};
/// // 7 joint velocities, each bounded on both sides, and one equality
/// let structure = Structure::new(7).equalities(1).bounds(Sides::Both);
/// assert_eq!(structure.variables(), 7);
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Structure {
    variables: usize,
    equalities: usize,
    rows: Vec<Sides>,
    bounds: Vec<Sides>,
}

impl Structure {
    /// Creates a structure with `variables` unknowns and no constraints.
    pub fn new(variables: usize) -> Self {
        Self { variables, equalities: 0, rows: Vec::new(), bounds: vec![Sides::Neither; variables] }
    }

    /// Sets the number of equalities (rows of `A`).
    #[must_use]
    pub fn equalities(mut self, count: usize) -> Self {
        self.equalities = count;
        self
    }

    /// Appends `count` rows to `G`, all bounded on `sides`.
    #[must_use]
    pub fn rows(mut self, count: usize, sides: Sides) -> Self {
        self.rows.extend(std::iter::repeat_n(sides, count));
        self
    }

    /// Declares `sides` for all variables.
    #[must_use]
    pub fn bounds(mut self, sides: Sides) -> Self {
        self.bounds.fill(sides);
        self
    }

    /// Declares `sides` for one variable.
    ///
    /// # Panics
    /// If `variable` is not less than the number of variables.
    #[must_use]
    pub fn bound(mut self, variable: usize, sides: Sides) -> Self {
        self.bounds[variable] = sides;
        self
    }

    /// Returns the number of unknowns.
    pub fn variables(&self) -> usize {
        self.variables
    }

    /// Returns the number of rows of `A`.
    pub fn equality_count(&self) -> usize {
        self.equalities
    }

    /// Returns the declared sides of each row of `G`.
    pub fn row_sides(&self) -> &[Sides] {
        &self.rows
    }

    /// Returns the declared sides of each variable.
    pub fn bound_sides(&self) -> &[Sides] {
        &self.bounds
    }
}
