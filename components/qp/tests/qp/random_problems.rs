//! Random quadratic programs, many of them degenerate, singular, redundant or infeasible. Every solution is
//! checked against the numbers of the problem, every failure against another solver.

use motorium_qp::{
    ActiveSetSettings, ActiveSetSolver, ClarabelSettings, ClarabelSolver, KktResidual, Problem, QpSolver,
    Sides, Solution, SolveError, Structure,
};
use nalgebra::{DMatrix, DVector};

/// Number of problems; the environment variables `MOTORIUM_QP_PROBLEMS` and `MOTORIUM_QP_FIRST` override it
/// and the first seed.
const PROBLEMS: u64 = 5_000;

/// Reads a number from an environment variable.
fn number(variable: &str) -> Option<u64> {
    std::env::var(variable).ok().map(|number| number.parse().unwrap())
}

/// A generator of small random numbers (splitmix64).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }

    fn one_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    /// Returns a number in [-1, 1), or an integer from -2 to 2 if `whole` is set.
    fn entry(&mut self, whole: bool) -> f64 {
        if whole {
            self.below(5) as f64 - 2.0
        } else {
            (self.next() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        }
    }
}

pub(crate) struct Trial {
    pub(crate) structure: Structure,
    pub(crate) problem: Problem,
    /// `true` if a point that satisfies all constraints is known.
    feasible: bool,
}

/// Generates a problem with up to 12 variables. Its Hessian may have any rank, its rows may repeat, and its
/// constraints may meet in one point. Integers make ties and exact dependencies frequent.
pub(crate) fn trial(seed: u64) -> Trial {
    let r = &mut Random(seed);
    let n = 1 + r.below(12);
    let m = if r.one_in(2) { 0 } else { r.below(n.min(5) + 1) };
    let p = r.below(2 * n + 1);
    let whole = r.one_in(2);
    let rank = if r.one_in(3) { r.below(n + 1) } else { n };
    let task = DMatrix::from_fn(rank, n, |_, _| r.entry(whole));
    let damping = [0.0, 0.0, 1e-8, 1e-3, 1.0][r.below(5)];
    let structure = Structure::new(n).equalities(m).rows(p, Sides::Both).bounds(Sides::Both);
    let mut problem = Problem::new(&structure);
    problem.hessian = task.transpose() * &task + DMatrix::identity(n, n) * damping;
    if !r.one_in(4) {
        problem.gradient = DVector::from_fn(n, |_, _| r.entry(whole));
    }
    problem.equality_matrix = DMatrix::from_fn(m, n, |_, _| r.entry(whole));
    if m > 1 && r.one_in(3) {
        let row = problem.equality_matrix.row(0).clone_owned() * r.entry(whole);
        problem.equality_matrix.set_row(m - 1, &row);
    }
    problem.row_matrix = DMatrix::from_fn(p, n, |_, _| r.entry(whole));
    for i in 1..p {
        if r.one_in(4) {
            let sign = if r.one_in(2) { 1.0 } else { -1.0 };
            let row = problem.row_matrix.row(r.below(i)).clone_owned() * sign;
            problem.row_matrix.set_row(i, &row);
        }
    }
    let point = DVector::from_fn(n, |_, _| r.entry(whole));
    let feasible = !r.one_in(4);
    problem.equality_value =
        if feasible { &problem.equality_matrix * &point } else { DVector::from_fn(m, |_, _| r.entry(whole)) };
    let mut interval = |value: f64| {
        if !feasible {
            let (a, b) = (r.entry(whole), r.entry(whole));
            return (a.min(b), a.max(b));
        }
        let mut side = |infinite: f64| match r.below(4) {
            0 => infinite,
            1 => value,
            _ => value + infinite.signum() * r.entry(false).abs(),
        };
        (side(f64::NEG_INFINITY), side(f64::INFINITY))
    };
    let at_point = &problem.row_matrix * &point;
    for i in 0..p {
        (problem.row_lower[i], problem.row_upper[i]) = interval(at_point[i]);
    }
    if !p.is_multiple_of(3) {
        for i in 0..n {
            (problem.lower[i], problem.upper[i]) = interval(point[i]);
        }
    }
    Trial { structure, problem, feasible }
}

/// Like [`trial`], with nearly dependent constraints: each equality after the first, and every other row,
/// becomes an earlier equality plus a small fraction of itself. Feasible points stay feasible.
pub(crate) fn nearly_dependent(seed: u64) -> Trial {
    let mut trial = trial(seed);
    let problem = &mut trial.problem;
    let (m, p) = (problem.equality_value.len(), problem.row_lower.len());
    let r = &mut Random(seed ^ 0x00ab_cdef);
    let share = 10_f64.powi(-(3 + r.below(8) as i32));
    for i in 1..m {
        let j = r.below(i);
        let row = problem.equality_matrix.row(j) + problem.equality_matrix.row(i) * share;
        problem.equality_matrix.set_row(i, &row);
        problem.equality_value[i] = problem.equality_value[j] + share * problem.equality_value[i];
    }
    for i in 0..p {
        if r.one_in(2) && m > 0 {
            let j = r.below(m);
            let row = problem.equality_matrix.row(j) + problem.row_matrix.row(i) * share;
            problem.row_matrix.set_row(i, &row);
            let value = problem.equality_value[j];
            problem.row_lower[i] = value + share * problem.row_lower[i];
            problem.row_upper[i] = value + share * problem.row_upper[i];
        }
    }
    trial
}

/// Returns the largest residual of the optimality conditions, relative to the numbers in them.
fn residual(problem: &Problem, solution: &Solution) -> f64 {
    let multipliers = [&solution.equality_dual, &solution.row_dual, &solution.bound_dual];
    let size = multipliers.iter().fold(1.0 + solution.x.amax(), |size, dual| size + dual.amax());
    KktResidual::from_solution(problem, solution).worst() / size
}

/// Returns the reference solver's optimal cost. With `nearest`, the cost is the distance to the origin
/// instead, whose minimum exists if and only if the constraints can be satisfied.
fn reference(trial: &Trial, nearest: bool) -> Result<f64, SolveError> {
    let mut problem = trial.problem.clone();
    if nearest {
        problem.hessian.fill_with_identity();
        problem.gradient.fill(0.0);
    }
    let mut solver = ClarabelSolver::new(trial.structure.clone(), ClarabelSettings::default());
    solver.update(&problem).unwrap();
    solver.solve().map(|solution| residual(&problem, solution))
}

/// Describes the error of a solver's result; `None` if the result is right.
pub(crate) fn wrong(trial: &Trial, answer: Result<&Solution, SolveError>) -> Option<String> {
    match answer {
        Ok(solution) => {
            let residual = residual(&trial.problem, solution);
            // NaN is wrong too
            let right = residual < 1e-8;
            (!right).then(|| {
                let of = KktResidual::from_solution(&trial.problem, solution);
                let (accuracy, iterations) = (solution.accuracy, solution.iterations);
                format!("residual {residual:e}, {of:?}, accuracy {accuracy:?}, {iterations} iterations")
            })
        }
        Err(SolveError::Infeasible { .. }) => {
            let possible = trial.feasible || reference(trial, true).is_ok();
            possible.then(|| "called infeasible, but a point is known".to_owned())
        }
        // The reference's optimum is trusted only if its numbers are small: some runs end at 10^10 and still
        // move.
        Err(SolveError::Unbounded { .. }) => {
            let bounded = matches!(reference(trial, false), Ok(residual) if residual < 1e-8);
            bounded.then(|| "called unbounded, but an optimum is known".to_owned())
        }
        Err(other) => Some(other.to_string()),
    }
}

#[test]
fn random_problems_are_solved_or_rejected_cold_and_warm() {
    let count = number("MOTORIUM_QP_PROBLEMS").unwrap_or(PROBLEMS);
    let first = number("MOTORIUM_QP_FIRST").unwrap_or(0);
    let (mut solved, mut refused, mut given_up) = (0, 0, Vec::new());
    for seed in first..first + count {
        let trial = trial(seed);
        let mut solver = ActiveSetSolver::new(trial.structure.clone(), ActiveSetSettings::default());
        solver.update(&trial.problem).unwrap();
        for pass in ["cold", "warm"] {
            let made = motorium::testing::allocations(|| _ = solver.solve());
            assert_eq!(made, 0, "problem {seed}, {pass}: a solve allocates");
            if pass == "cold" {
                solver.reset();
            }
            let answer = solver.solve();
            match &answer {
                Ok(_) => solved += 1,
                Err(_) => refused += 1,
            }
            let gave_up =
                matches!(answer, Err(SolveError::MaxIterations { .. } | SolveError::Numerical { .. }));
            if let Some(words) = wrong(&trial, answer) {
                // "No solution found" is not a wrong result, but must stay rare.
                assert!(gave_up, "problem {seed}, {pass}: {words}");
                given_up.push((seed, pass, words));
            }
        }
    }
    println!("{solved} solved, {refused} rejected or given up: {given_up:?}");
    assert!(given_up.len() as u64 <= 2 + count / 20_000, "{given_up:?}");
    assert!(solved > count && refused > count / 10, "{solved} solved, {refused} rejected: unbalanced sample");
}

#[test]
fn hessian_definite_only_by_rounding_is_treated_as_singular() {
    // rank 8 of 9; the smallest pivot of its factor is 4e-12 of the largest, and corrections computed with it
    // introduce errors
    let trial = trial(1_928_778);
    let mut solver = ActiveSetSolver::new(trial.structure.clone(), ActiveSetSettings::default());
    solver.update(&trial.problem).unwrap();
    for _ in 0..2 {
        let residual = residual(&trial.problem, solver.solve().unwrap());
        assert!(residual < 1e-10, "{residual:e}");
    }
}

#[test]
fn warm_start_from_another_problem_reaches_the_optimum() {
    for seed in 0..200 {
        let first = trial(seed);
        let mut solver = ActiveSetSolver::new(first.structure.clone(), ActiveSetSettings::default());
        for other in 0..300 {
            let next = trial(1_000 + 300 * seed + other);
            if next.structure != first.structure {
                continue;
            }
            solver.update(&next.problem).unwrap();
            if let Ok(solution) = solver.solve() {
                assert!(residual(&next.problem, solution) < 1e-8, "problem {other} after {seed}");
            }
        }
    }
}

#[test]
fn solving_random_problems_does_not_allocate() {
    for seed in 0..300 {
        let trial = trial(seed);
        let mut solver = ActiveSetSolver::new(trial.structure.clone(), ActiveSetSettings::default());
        let made = motorium::testing::allocations(|| {
            solver.update(&trial.problem).unwrap();
            let _ = solver.solve();
        });
        assert_eq!(made, 0, "problem {seed}");
    }
}
