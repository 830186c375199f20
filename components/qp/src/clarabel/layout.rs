//! Positions of the numbers of a [`Problem`] in Clarabel's form `A x + s = b`, `s` in a cone.
//!
//! Rows in order: equalities (zero cone), one row per declared side (non-negative cone; sides of `G` before
//! bounds), three rows per friction cone (second-order cone; `mu n`, then the two tangents). A side that is
//! infinite at this tick keeps its position as the row `0 x + s = 1`, which has no effect. A disabled cone
//! keeps its position as `0 x + s = (1, 0, 0)`. The sparsity pattern is therefore the same at every tick.

use clarabel::{
    algebra::CscMatrix,
    solver::{DefaultSolution, SupportedConeT},
};

use crate::{Constraint, Problem, Side, Sides, Solution, Structure};

/// Three variables of a problem that form a contact force within its friction cone: `|(x_t, x_u)| <= mu x_n`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrictionCone {
    /// Indices of the variables `t` and `u` of the tangential force.
    pub tangents: [usize; 2],
    /// Index of the variable `n` of the normal force.
    pub normal: usize,
}

/// Factors between a problem and its scaled form.
#[derive(Debug)]
pub(super) struct Scaling {
    /// `D`, one per variable.
    pub(super) variable: Vec<f64>,
    /// One factor per row of the layout; zero for an infinite side and a disabled cone.
    pub(super) constraint: Vec<f64>,
    /// Coefficient of each friction cone; zero if disabled.
    pub(super) friction: Vec<f64>,
    /// Factor of the cost; `D` suffices if all variables have curvature.
    pub(super) cost: f64,
    /// Typical size of `D^-1 x`.
    pub(super) length: f64,
}

/// The fixed map from a problem to Clarabel's vectors.
#[derive(Debug)]
pub(super) struct Layout {
    variables: usize,
    equalities: usize,
    /// The inequality of each row after the equalities.
    inequalities: Vec<Constraint>,
    /// For each variable, the rows of its bounds, ascending.
    bounds_of: Vec<[Option<usize>; 2]>,
    /// Number of inequalities that are sides of `G`, which come first.
    row_sides: usize,
    cones: Vec<FrictionCone>,
    /// For each variable, its row in a cone, and `true` if it is the normal force.
    cone_row: Vec<Option<(usize, bool)>>,
}

impl Layout {
    pub(super) fn new(structure: &Structure, cones: Vec<FrictionCone>) -> Self {
        let sides = |declared: &[Sides], name: fn(usize, Side) -> Constraint| {
            let side_of = |side| {
                declared
                    .iter()
                    .enumerate()
                    .filter(move |(_, sides)| sides.has(side))
                    .map(move |(index, _)| name(index, side))
            };
            side_of(Side::Upper).chain(side_of(Side::Lower)).collect::<Vec<_>>()
        };
        let mut inequalities = sides(structure.row_sides(), Constraint::Row);
        let row_sides = inequalities.len();
        inequalities.extend(sides(structure.bound_sides(), Constraint::Bound));

        let mut bounds_of = vec![[None; 2]; structure.variables()];
        for (row, inequality) in inequalities.iter().enumerate() {
            match *inequality {
                Constraint::Bound(variable, Side::Upper) => bounds_of[variable][0] = Some(row),
                Constraint::Bound(variable, Side::Lower) => bounds_of[variable][1] = Some(row),
                Constraint::Row(..) | Constraint::Equality(_) | Constraint::Cone(_) => {}
            }
        }
        let (variables, equalities) = (structure.variables(), structure.equality_count());
        let mut cone_row = vec![None; variables];
        for (index, cone) in cones.iter().enumerate() {
            let first = equalities + inequalities.len() + 3 * index;
            for (place, variable) in [cone.normal, cone.tangents[0], cone.tangents[1]].into_iter().enumerate()
            {
                assert!(cone_row[variable].is_none(), "variable {variable} is in two cones");
                cone_row[variable] = Some((first + place, place == 0));
            }
        }
        Self { variables, equalities, inequalities, bounds_of, row_sides, cones, cone_row }
    }

    pub(super) fn variables(&self) -> usize {
        self.variables
    }

    /// Returns the number of rows of equalities and inequalities, which precede the rows of the cones.
    pub(super) fn linear_count(&self) -> usize {
        self.equalities + self.inequalities.len()
    }

    pub(super) fn constraint_count(&self) -> usize {
        self.linear_count() + 3 * self.cones.len()
    }

    /// Returns the friction cones.
    pub(super) fn friction_cones(&self) -> &[FrictionCone] {
        &self.cones
    }

    /// Returns the constraint in one of Clarabel's rows.
    pub(super) fn name(&self, row: usize) -> Constraint {
        match row.checked_sub(self.equalities) {
            None => Constraint::Equality(row),
            Some(side) if side < self.inequalities.len() => self.inequalities[side],
            Some(_) => Constraint::Cone((row - self.linear_count()) / 3),
        }
    }

    pub(super) fn cones(&self) -> Vec<SupportedConeT<f64>> {
        let mut cones = vec![
            SupportedConeT::ZeroConeT(self.equalities),
            SupportedConeT::NonnegativeConeT(self.inequalities.len()),
        ];
        cones.extend(self.cones.iter().map(|_| SupportedConeT::SecondOrderConeT(3)));
        cones
    }

    /// Returns the upper triangle of a dense matrix, with the values of the identity.
    pub(super) fn hessian_pattern(&self) -> CscMatrix<f64> {
        let n = self.variables;
        let mut pattern = CscMatrix { m: n, n, colptr: vec![0], rowval: Vec::new(), nzval: Vec::new() };
        for column in 0..n {
            pattern.rowval.extend(0..=column);
            pattern.nzval.extend((0..=column).map(|row| f64::from(u8::from(row == column))));
            pattern.colptr.push(pattern.rowval.len());
        }
        pattern
    }

    /// Returns the pattern with dense equalities and rows, one entry per bound and one per variable of a
    /// cone. All values are zero.
    pub(super) fn constraint_pattern(&self) -> CscMatrix<f64> {
        let mut pattern = CscMatrix {
            m: self.constraint_count(),
            n: self.variables,
            colptr: vec![0],
            rowval: Vec::new(),
            nzval: Vec::new(),
        };
        for (bounds, cone) in self.bounds_of.iter().zip(&self.cone_row) {
            pattern.rowval.extend(0..self.equalities + self.row_sides);
            pattern.rowval.extend(bounds.iter().flatten().map(|row| self.equalities + row));
            pattern.rowval.extend(cone.iter().map(|(row, _)| row));
            pattern.colptr.push(pattern.rowval.len());
        }
        pattern.nzval = vec![0.0; pattern.rowval.len()];
        pattern
    }

    pub(super) fn fill_hessian(&self, problem: &Problem, scaling: &Scaling, out: &mut [f64]) {
        let mut out = out.iter_mut();
        for column in 0..self.variables {
            for row in 0..=column {
                let slot = out.next().expect("the pattern has an entry for each pair");
                *slot = scaling.cost
                    * scaling.variable[row]
                    * problem.hessian[(row, column)]
                    * scaling.variable[column];
            }
        }
    }

    pub(super) fn fill_constraints(&self, problem: &Problem, scaling: &Scaling, out: &mut [f64]) {
        let mut out = out.iter_mut();
        let mut put = |value: f64| *out.next().expect("the pattern has an entry for each number") = value;
        for column in 0..self.variables {
            let d = scaling.variable[column];
            for row in 0..self.equalities {
                put(scaling.constraint[row] * problem.equality_matrix[(row, column)] * d);
            }
            for (side, inequality) in self.inequalities[..self.row_sides].iter().enumerate() {
                let e = scaling.constraint[self.equalities + side];
                match *inequality {
                    Constraint::Row(row, Side::Upper) => put(e * problem.row_matrix[(row, column)] * d),
                    Constraint::Row(row, Side::Lower) => put(-e * problem.row_matrix[(row, column)] * d),
                    Constraint::Bound(..) | Constraint::Equality(_) | Constraint::Cone(_) => {}
                }
            }
            let [upper, lower] = self.bounds_of[column];
            if let Some(side) = upper {
                put(scaling.constraint[self.equalities + side] * d);
            }
            if let Some(side) = lower {
                put(-scaling.constraint[self.equalities + side] * d);
            }
            if let Some((row, normal)) = self.cone_row[column] {
                let friction = scaling.friction[(row - self.linear_count()) / 3];
                put(-scaling.constraint[row] * if normal { friction } else { 1.0 } * d);
            }
        }
    }

    pub(super) fn fill_limits(&self, problem: &Problem, scaling: &Scaling, out: &mut [f64]) {
        let (linear, conic) = out.split_at_mut(self.linear_count());
        for (place, slot) in conic.iter_mut().enumerate() {
            let off = scaling.constraint[self.linear_count() + place] == 0.0;
            *slot = f64::from(u8::from(off && place % 3 == 0));
        }
        for (row, slot) in linear.iter_mut().enumerate() {
            let e = scaling.constraint[row];
            *slot = if e == 0.0 { 1.0 } else { e * signed_limit(problem, self.name(row)) / scaling.length };
        }
    }

    /// Undoes the scaling and maps the multipliers back to the problem.
    pub(super) fn read(&self, found: &DefaultSolution<f64>, scaling: &Scaling, solution: &mut Solution) {
        for (x, (found, d)) in solution.x.iter_mut().zip(found.x.iter().zip(&scaling.variable)) {
            *x = scaling.length * d * found;
        }
        solution.row_dual.fill(0.0);
        solution.bound_dual.fill(0.0);
        for (row, z) in found.z.iter().enumerate().take(self.linear_count()) {
            let dual = scaling.constraint[row] * z * scaling.length / scaling.cost;
            match self.name(row) {
                Constraint::Equality(index) => solution.equality_dual[index] = dual,
                Constraint::Row(index, Side::Upper) => solution.row_dual[index] += dual,
                Constraint::Row(index, Side::Lower) => solution.row_dual[index] -= dual,
                Constraint::Bound(index, Side::Upper) => solution.bound_dual[index] += dual,
                Constraint::Bound(index, Side::Lower) => solution.bound_dual[index] -= dual,
                Constraint::Cone(_) => {}
            }
        }
    }
}

/// Returns the right-hand side of the constraint written as `a x <= limit` (or `a x = limit`).
pub(super) fn signed_limit(problem: &Problem, constraint: Constraint) -> f64 {
    match constraint {
        Constraint::Equality(row) => problem.equality_value[row],
        Constraint::Row(row, Side::Upper) => problem.row_upper[row],
        Constraint::Row(row, Side::Lower) => -problem.row_lower[row],
        Constraint::Bound(variable, Side::Upper) => problem.upper[variable],
        Constraint::Bound(variable, Side::Lower) => -problem.lower[variable],
        Constraint::Cone(_) => 0.0,
    }
}
