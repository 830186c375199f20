//! A dense dual active-set [`QpSolver`], the default for control loops.
//!
//! The solver keeps a working set: constraints held as equalities, with multipliers of the right sign. While
//! the minimum on the working set violates a constraint, that constraint joins. A member whose multiplier
//! would change its sign leaves. Every change raises the dual cost, so no working set recurs. If rounding
//! errors prevent this increase, ties are broken by constraint index (Bland's rule) until the iteration
//! limit. A constraint that repeatedly joins and leaves is violated within rounding, with a multiplier within
//! rounding; it stays in the set.
//!
//! Let `P = L L'`, let `N` hold the normals of the members, and let `B = L^-1 N`. The minimum on the working
//! set is
//!
//! ```text
//! B'B mu = -(b + B'g),   g = L^-1 q,   L'x = -(g + B mu)
//! ```
//!
//! The Cholesky factor of `B'B` is updated one row at a time. A row is computed by repeated projection, as
//! accurately as by an orthogonal factorisation. A solve starts with the previous working set and
//! multipliers; along a smooth motion most solves change nothing. The result is refined with the residuals of
//! the original problem. Rows and bounds with equal sides are treated as equalities, and a zero equality is
//! ignored. When a contact lifts off, its motion becomes free and its force zero, and the rest of the working
//! set is kept.
//!
//! A problem with a singular or very badly conditioned Hessian is solved as a sequence of well-conditioned
//! problems (proximal point method). The certificates of these problems distinguish *infeasible* from
//! *unbounded*.
//!
//! Goldfarb and Idnani, *A numerically stable dual method for solving strictly convex quadratic programs*,
//! 1983; Arnström, Bemporad and Axehill, *A dual active-set solver for embedded quadratic programming using
//! recursive LDL' updates*, 2022; Daniel, Gragg, Kaufman and Stewart, *Reorthogonalization and stable
//! algorithms for updating the Gram-Schmidt QR factorization*, 1976.

mod certificate;
mod constraints;
mod iterate;
mod kernels;
mod progress;
mod refine;
mod rounds;
mod row_scales;
mod run;
mod settings;
mod tolerances;
mod work;
mod working_set;

use super::{Constraint, Problem, QpSolver, Side, Solution, SolveError, Structure, UpdateError};
use row_scales::RowScales;
use run::Run;
pub use settings::ActiveSetSettings;
use work::Work;
use working_set::Member;

/// A [`QpSolver`] with a dual active-set method that keeps its working set between solves.
#[derive(Debug)]
pub struct ActiveSetSolver {
    structure: Structure,
    settings: ActiveSetSettings,
    instructions: pulp::Arch,
    /// The problem with its rows scaled.
    problem: Problem,
    scales: RowScales,
    updated: bool,
    work: Work,
    solution: Solution,
}

impl ActiveSetSolver {
    /// Builds a solver for `structure` and allocates all memory.
    pub fn new(structure: Structure, settings: ActiveSetSettings) -> Self {
        Self {
            work: Work::new(&structure),
            problem: Problem::new(&structure),
            scales: RowScales::new(structure.equality_count(), structure.row_sides().len()),
            solution: Solution::new(&structure),
            structure,
            settings,
            instructions: pulp::Arch::new(),
            updated: false,
        }
    }
}

impl ActiveSetSolver {
    /// Returns the last solution found by [`solve`](QpSolver::solve).
    pub fn solution(&self) -> &Solution {
        &self.solution
    }

    /// Sets the iteration limit from the next solve on, see [`ActiveSetSettings::max_iterations`].
    pub fn set_max_iterations(&mut self, most: Option<u32>) {
        self.settings.max_iterations = most;
    }

    /// Returns the rows and bounds of the working set with their multipliers after the last solve, even if
    /// that solve failed.
    pub fn working_set(&self) -> impl Iterator<Item = (Constraint, f64)> {
        let (m, p) = (self.problem.equality_value.len(), self.problem.row_lower.len());
        self.work.working.members.iter().filter(move |member| member.constraint >= m).map(move |member| {
            let presses = if member.sign == 0.0 { member.multiplier } else { member.sign };
            let multiplier = member.multiplier * self.scales.get(member.constraint);
            (constraints::name(m, p, member.constraint, presses), multiplier)
        })
    }

    /// Sets the initial working set of the next solve: rows and bounds with their multipliers, such as from a
    /// similar problem. The initial working set affects the number of iterations but not the solution.
    ///
    /// ```
    /// use motorium_qp::{ActiveSetSettings, ActiveSetSolver, Problem};
    /// use motorium_qp::{QpSolver, Sides, Structure};
    ///
    /// let structure = Structure::new(2).bounds(Sides::Both);
    /// let mut problem = Problem::new(&structure);
    /// problem.hessian.fill_with_identity();
    /// problem.gradient.copy_from_slice(&[-2.0, -3.0]);
    /// problem.lower.fill(0.0);
    /// problem.upper.fill(1.0);
    /// let new = || ActiveSetSolver::new(structure.clone(), ActiveSetSettings::default());
    /// let (mut one, mut other) = (new(), new());
    /// one.update(&problem)?;
    /// assert_eq!(one.solve()?.iterations, 2);
    /// other.warm_start(one.working_set());
    /// other.update(&problem)?;
    /// assert_eq!(other.solve()?.iterations, 0);
    /// # Ok::<_, Box<dyn std::error::Error>>(())
    /// ```
    pub fn warm_start(&mut self, constraints: impl IntoIterator<Item = (Constraint, f64)>) {
        let (m, p) = (self.structure.equality_count(), self.structure.row_sides().len());
        let working = &mut self.work.working;
        working.clear();
        for (constraint, multiplier) in constraints.into_iter().take(self.structure.variables()) {
            let (constraint, side) = match constraint {
                Constraint::Row(row, side) if row < p => (m + row, side),
                Constraint::Bound(variable, side) if variable < self.structure.variables() => {
                    (m + p + variable, side)
                }
                _ => continue,
            };
            let sign = if side == Side::Upper { 1.0 } else { -1.0 };
            let multiplier = multiplier / self.scales.get(constraint);
            working.members.push(Member { constraint, sign, value: 0.0, multiplier, pinned: false });
        }
    }
}

impl QpSolver for ActiveSetSolver {
    fn structure(&self) -> &Structure {
        &self.structure
    }

    fn update(&mut self, problem: &Problem) -> Result<(), UpdateError> {
        self.updated = false;
        problem.check(&self.structure)?;
        self.problem.copy_from(problem);
        self.scales.apply(&mut self.problem, &mut self.work.working);
        self.updated = true;
        Ok(())
    }

    fn solve(&mut self) -> Result<&Solution, SolveError> {
        if !self.updated {
            return Err(SolveError::NotUpdated);
        }
        let (problem, settings) = (&self.problem, self.settings);
        let run = Run { problem, settings, work: &mut self.work, solution: &mut self.solution };
        self.instructions.dispatch(run)?;
        self.scales.restore(&mut self.solution);
        Ok(&self.solution)
    }

    fn iterations(&self) -> u32 {
        self.work.progress.iterations
    }

    fn reset(&mut self) {
        self.work.working.clear();
    }
}
