//! Replay of recorded problems through a solver: accuracy, iterations and time.

use std::time::Instant;

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::Stream;
use crate::problem::ROUNDING;
use crate::{
    ClarabelSettings, ClarabelSolver, Constraint, KktResidual, Problem, QpSolver, Side, Solution, SolveError,
    Structure,
};

/// The outcome of one solve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// A solution was found.
    Solved,
    /// No `x` satisfies the constraints.
    Infeasible,
    /// The cost decreases forever.
    Unbounded,
    /// The Hessian is not positive semi-definite.
    NotConvex,
    /// The iteration limit was reached.
    MaxIterations,
    /// The arithmetic broke down.
    Numerical,
    /// The problem data are invalid.
    Refused,
}

/// Outcome of one problem of a replay.
#[derive(Clone, Debug, Serialize)]
pub struct Each {
    /// Outcome of the solve.
    pub status: Status,
    /// Solution; empty if the solve failed.
    pub x: Vec<f64>,
    /// Error message; `None` if the problem was solved.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

/// Median, 99th percentile and maximum of a figure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Record {
    /// The median.
    pub p50: f64,
    /// The 99th percentile.
    pub p99: f64,
    /// The maximum.
    pub max: f64,
}

impl Record {
    fn from_values(mut values: Vec<f64>) -> Self {
        values.sort_by(f64::total_cmp);
        let at = |share: f64| {
            let index = (values.len() as f64 * share).ceil() as usize;
            values.get(index.clamp(1, values.len().max(1)) - 1).copied().unwrap_or_default()
        };
        Self { p50: at(0.5), p99: at(0.99), max: at(1.0) }
    }
}

/// Summary of a replay.
#[derive(Clone, Debug, Serialize)]
pub struct Replay {
    /// Number of problems.
    pub problems: usize,
    /// Number of solved problems.
    pub solved: usize,
    /// Largest constraint violation of a solution, in the constraint's own unit.
    pub worst_violation: f64,
    /// Largest difference of any entry of a solution from the reference, which is Clarabel's solution,
    /// polished on its active constraints.
    pub worst_distance: f64,
    /// Iterations per solve.
    pub iterations: Record,
    /// Time to update and solve a problem \[us\].
    pub time_us: Record,
    /// Outcomes of the individual problems, if recorded.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub each: Option<Vec<Each>>,
}

/// Solves the problems in order, `rounds` times. With more than one round, the first round is a warm-up,
/// which the times exclude. The accuracy is measured in the last round.
pub fn replay(
    structure: &Structure,
    problems: &[Problem],
    solver: &mut dyn QpSolver,
    rounds: usize,
) -> Replay {
    let mut account = Account::default();
    let mut reference = ClarabelSolver::new(structure.clone(), ClarabelSettings::default());
    for phase in phases(rounds) {
        account.solve(problems, solver, &mut reference, phase);
    }
    account.finish()
}

/// Solves several streams in order, `rounds` times, and summarises them together, as [`replay`] does for one
/// stream. `build` creates a separate solver for each stream. With several streams, the first problem of each
/// stream is solved cold in every round.
pub fn replay_streams(
    streams: &[Stream],
    build: impl Fn(&Structure) -> Box<dyn QpSolver>,
    rounds: usize,
) -> Replay {
    let mut account = Account::default();
    let mut solvers: Vec<_> = streams
        .iter()
        .map(|Stream { structure, problems }| {
            let reference = ClarabelSolver::new(structure.clone(), ClarabelSettings::default());
            (problems, build(structure), reference)
        })
        .collect();
    for phase in phases(rounds) {
        for (problems, solver, reference) in &mut solvers {
            // a single stream continues from round to round
            if streams.len() > 1 {
                solver.reset();
            }
            account.solve(problems, solver.as_mut(), reference, phase);
        }
    }
    account.finish()
}

/// Purpose of a round.
#[derive(Clone, Copy)]
struct Phase {
    is_timed: bool,
    /// `true` for the last round, whose solutions are evaluated.
    is_last: bool,
}

fn phases(rounds: usize) -> impl Iterator<Item = Phase> {
    let rounds = rounds.max(1);
    (0..rounds).map(move |round| Phase { is_timed: round > 0 || rounds == 1, is_last: round + 1 == rounds })
}

/// Statistics of the problems solved so far.
#[derive(Default)]
struct Account {
    times: Vec<f64>,
    iterations: Vec<f64>,
    each: Vec<Each>,
    worst_violation: f64,
    worst_distance: f64,
}

impl Account {
    fn solve(
        &mut self,
        problems: &[Problem],
        solver: &mut dyn QpSolver,
        reference: &mut ClarabelSolver,
        phase: Phase,
    ) {
        for problem in problems {
            let began = Instant::now();
            let outcome = match solver.update(problem) {
                Ok(()) => solver.solve().map_err(|error| (status(&error), error.to_string())),
                Err(error) => Err((Status::Refused, error.to_string())),
            };
            let time = began.elapsed();
            if phase.is_timed {
                self.times.push(time.as_nanos() as f64 * 1e-3);
            }
            if phase.is_last {
                self.judge(problem, outcome, reference);
            }
        }
    }

    fn judge(
        &mut self,
        problem: &Problem,
        outcome: Result<&Solution, (Status, String)>,
        reference: &mut ClarabelSolver,
    ) {
        self.each.push(match outcome {
            // an interior-point method may end at a saddle point without an error
            Ok(_) | Err((Status::Numerical | Status::MaxIterations | Status::Unbounded, _))
                if !is_convex(problem) =>
            {
                let error = "not convex: P is not positive semi-definite; check the signs of its numbers";
                Each { status: Status::NotConvex, x: Vec::new(), error: Some(error.to_owned()) }
            }
            Ok(solution) => {
                self.iterations.push(f64::from(solution.iterations));
                let violation = KktResidual::from_solution(problem, solution).feasibility;
                self.worst_violation = self.worst_violation.max(violation);
                if let Some(exact) = exact(reference, problem) {
                    self.worst_distance = self.worst_distance.max((&solution.x - exact).amax());
                }
                Each { status: Status::Solved, x: solution.x.as_slice().to_vec(), error: None }
            }
            Err((status, error)) => Each { status, x: Vec::new(), error: Some(error) },
        });
    }

    fn finish(self) -> Replay {
        Replay {
            problems: self.each.len(),
            solved: self.each.iter().filter(|each| each.status == Status::Solved).count(),
            worst_violation: self.worst_violation,
            worst_distance: self.worst_distance,
            iterations: Record::from_values(self.iterations),
            time_us: Record::from_values(self.times),
            each: Some(self.each),
        }
    }
}

/// Returns `true` if the Hessian has no negative curvature beyond rounding.
fn is_convex(problem: &Problem) -> bool {
    let mut hessian = problem.hessian.clone();
    hessian.fill_lower_triangle_with_upper_triangle();
    let largest = hessian.amax();
    if largest == 0.0 || hessian.is_empty() {
        return true;
    }
    (hessian / largest).symmetric_eigenvalues().min() >= -ROUNDING
}

fn status(error: &SolveError) -> Status {
    match error {
        SolveError::Infeasible { .. } => Status::Infeasible,
        SolveError::Unbounded { .. } => Status::Unbounded,
        SolveError::NotConvex { .. } => Status::NotConvex,
        SolveError::MaxIterations { .. } => Status::MaxIterations,
        SolveError::Numerical { .. } | SolveError::NotUpdated => Status::Numerical,
    }
}

/// Ratios of multiplier to distance above which a side counts as active, in the order in which they are
/// tried.
const PRESSED: [f64; 7] = [1.0, 1e-2, 1e2, 1e-4, 1e4, 1e-6, 1e6];

/// Polishes the reference, because an interior-point solution stops close to the optimum. For a given active
/// set the optimality conditions are linear. Of several candidate sets, the one that satisfies all conditions
/// best is used.
fn exact(reference: &mut ClarabelSolver, problem: &Problem) -> Option<DVector<f64>> {
    reference.update(problem).ok()?;
    let near = reference.solve().ok()?.clone();
    let mut best = (KktResidual::from_solution(problem, &near).worst(), near.x.clone());
    for share in PRESSED {
        let Some(solution) = on_pressed(problem, &near, share) else { continue };
        let residual = KktResidual::from_solution(problem, &solution).worst();
        if residual < best.0 {
            best = (residual, solution.x);
        }
    }
    Some(best.1)
}

/// Returns the sides that are active at `near`, each with its constraint and value.
fn pressed(problem: &Problem, near: &Solution, share: f64) -> Vec<(Constraint, f64)> {
    let largest = near.row_dual.amax().max(near.bound_dual.amax());
    let rows = &problem.row_matrix * &near.x;
    let size = rows.amax().max(near.x.amax());
    let side = |dual: f64, value: f64, lower: f64, upper: f64| {
        let (distance, side, name) = if dual > 0.0 {
            (upper - value, upper, Side::Upper)
        } else {
            (value - lower, lower, Side::Lower)
        };
        let presses = share * dual.abs() * size > distance.abs() * largest && side.abs() < Problem::INFINITE;
        (presses || lower == upper).then_some((name, side))
    };
    let equalities = problem.equality_value.iter().enumerate().map(|(i, b)| (Constraint::Equality(i), *b));
    let mut all: Vec<_> = equalities.collect();
    for i in 0..rows.len() {
        let found = side(near.row_dual[i], rows[i], problem.row_lower[i], problem.row_upper[i]);
        all.extend(found.map(|(name, value)| (Constraint::Row(i, name), value)));
    }
    for i in 0..near.x.len() {
        let found = side(near.bound_dual[i], near.x[i], problem.lower[i], problem.upper[i]);
        all.extend(found.map(|(name, value)| (Constraint::Bound(i, name), value)));
    }
    all
}

/// Solves the optimality conditions with the sides held that are active at `near`.
fn on_pressed(problem: &Problem, near: &Solution, share: f64) -> Option<Solution> {
    let n = problem.gradient.len();
    let held = pressed(problem, near, share);
    let mut matrix = DMatrix::zeros(n + held.len(), n + held.len());
    let mut right = DVector::zeros(n + held.len());
    for i in 0..n {
        for j in 0..n {
            matrix[(i, j)] = problem.hessian[(i.min(j), i.max(j))];
        }
        right[i] = -problem.gradient[i];
    }
    for (r, (constraint, value)) in held.iter().enumerate() {
        for i in 0..n {
            let entry = match *constraint {
                Constraint::Equality(row) => problem.equality_matrix[(row, i)],
                Constraint::Row(row, _) => problem.row_matrix[(row, i)],
                Constraint::Bound(variable, _) => f64::from(u8::from(variable == i)),
                Constraint::Cone(_) => 0.0, // recorded problems have none
            };
            matrix[(n + r, i)] = entry;
            matrix[(i, n + r)] = entry;
        }
        right[n + r] = *value;
    }
    let factor = matrix.clone().full_piv_lu();
    let mut all = factor.solve(&right)?;
    for _ in 0..3 {
        all += factor.solve(&(&right - &matrix * &all))?;
    }
    let mut solution = near.clone();
    solution.x.copy_from(&all.rows(0, n));
    solution.row_dual.fill(0.0);
    solution.bound_dual.fill(0.0);
    for (r, (constraint, _)) in held.iter().enumerate() {
        match *constraint {
            Constraint::Equality(row) => solution.equality_dual[row] = all[n + r],
            Constraint::Row(row, _) => solution.row_dual[row] = all[n + r],
            Constraint::Bound(variable, _) => solution.bound_dual[variable] = all[n + r],
            Constraint::Cone(_) => {}
        }
    }
    Some(solution)
}
