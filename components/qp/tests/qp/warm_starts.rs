//! Working sets carried from one solve to the next: a solve only has to find the changes.

use motorium_qp::{
    ActiveSetSettings, ActiveSetSolver, Constraint, KktResidual, Problem, QpSolver, Sides, SolveError,
    Structure,
};

use crate::random::Random;

/// Solves to the optimum and returns the number of iterations.
fn solve(solver: &mut ActiveSetSolver, problem: &Problem) -> u32 {
    solver.update(problem).unwrap();
    let solution = solver.solve().unwrap();
    let residual = KktResidual::from_solution(problem, solution);
    assert!(residual.worst() < 1e-9, "{residual:?}");
    solution.iterations
}

/// Returns a problem with forty unknowns, most of them at a bound, and eight equalities.
fn pressed() -> (Structure, Problem) {
    let structure = Structure::new(40).equalities(8).bounds(Sides::Both);
    let (mut problem, mut random) = (Problem::new(&structure), Random(3));
    problem.hessian.fill_with_identity();
    problem.gradient.iter_mut().for_each(|q| *q = random.within(2.0));
    problem.equality_matrix.iter_mut().for_each(|entry| *entry = random.within(1.0));
    problem.lower.fill(-0.3);
    problem.upper.fill(0.3);
    (structure, problem)
}

#[test]
fn emptied_equality_keeps_other_constraints() {
    let (structure, mut problem) = pressed();
    let mut solver = ActiveSetSolver::new(structure, ActiveSetSettings::default());
    let cold = solve(&mut solver, &problem);
    assert!(cold > 10, "cold: {cold}");
    assert_eq!(solve(&mut solver, &problem), 0, "the same problem again");
    problem.equality_matrix.row_mut(2).fill(0.0);
    let changed = solve(&mut solver, &problem);
    assert!(changed < 8, "one equality fewer: {changed}");
    assert_eq!(solve(&mut solver, &problem), 0, "the same problem again");
    // a combination of others that agrees with them
    let other = problem.equality_matrix.row(0) - problem.equality_matrix.row(1);
    problem.equality_matrix.set_row(2, &other);
    assert!(solve(&mut solver, &problem) <= 1, "it adds no condition");
    assert_eq!(solve(&mut solver, &problem), 0, "the same problem again");
}

#[test]
fn empty_equality_with_a_target_is_infeasible() {
    let (structure, mut problem) = pressed();
    problem.equality_matrix.row_mut(2).fill(0.0);
    problem.equality_value[2] = 1e-3;
    let mut solver = ActiveSetSolver::new(structure, ActiveSetSettings::default());
    solver.update(&problem).unwrap();
    let error = solver.solve().unwrap_err();
    let SolveError::Infeasible { conflict } = error else { panic!("{error}") };
    assert_eq!(conflict.constraints().next(), Some(Constraint::Equality(2)));
}

#[test]
fn equal_bounds_are_held_and_released() {
    let (structure, open) = pressed();
    let mut closed = open.clone();
    closed.lower.rows_mut(0, 20).fill(0.02);
    closed.upper.rows_mut(0, 20).fill(0.02);
    let (mut one, mut two) = (
        ActiveSetSolver::new(structure.clone(), ActiveSetSettings::default()),
        ActiveSetSolver::new(structure, ActiveSetSettings::default()),
    );
    let free = solve(&mut one, &open);
    let held = solve(&mut two, &closed);
    assert!(held < free, "{held} of {free}");
    // bounds open again: like a cold solve
    solve(&mut two, &open);
    let (x, expected) = (&two.solution().x, &one.solution().x);
    assert!((x - expected).amax() < 1e-9);
    assert_eq!(solve(&mut two, &open), 0);
}
