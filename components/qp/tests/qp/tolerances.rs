//! Problems that each need one tolerance of the active-set method: without it they fail or have a wrong
//! solution. Each test is named after the failure that the tolerance prevents.

use motorium_qp::{
    Accuracy, ActiveSetSettings, ActiveSetSolver, Problem, QpSolver, Solution, SolveError, Structure,
};

use crate::random_problems::{Trial, nearly_dependent, trial, wrong};

/// Asserts that these problems are solved or rejected correctly, cold and from their own working set.
#[track_caller]
fn assert_decided(seeds: &[u64]) {
    assert_all_decided(trial, seeds);
}

/// Like [`assert_decided`], for problems with [nearly dependent](nearly_dependent) constraints.
#[track_caller]
fn assert_dependent_decided(seeds: &[u64]) {
    assert_all_decided(nearly_dependent, seeds);
}

#[track_caller]
fn assert_all_decided(trial: impl Fn(u64) -> Trial, seeds: &[u64]) {
    for seed in seeds {
        let trial = trial(*seed);
        let mut solver = ActiveSetSolver::new(trial.structure.clone(), ActiveSetSettings::default());
        solver.update(&trial.problem).unwrap();
        for pass in ["cold", "warm"] {
            let error = wrong(&trial, solver.solve());
            assert_eq!(error, None, "problem {seed}, {pass}");
        }
    }
}

/// Minimises `1/2 x^2 - x + 1/2 curvature y^2 + slope y` with six more variables without cost, which make the
/// Hessian singular.
#[track_caller]
fn flat(curvature: f64, slope: f64) -> Solution {
    let structure = Structure::new(8);
    let mut problem = Problem::new(&structure);
    (problem.hessian[(0, 0)], problem.hessian[(1, 1)]) = (1.0, curvature);
    (problem.gradient[0], problem.gradient[1]) = (-1.0, slope);
    let mut solver = ActiveSetSolver::new(structure, ActiveSetSettings::default());
    solver.update(&problem).unwrap();
    solver.solve().unwrap().clone()
}

/// Guarded by `singular`: with 1 these fail.
#[test]
fn definite_hessians_are_factored() {
    assert_decided(&[0, 1, 2]);
}

/// Guarded by `first_shift`: with 0 these fail.
#[test]
fn singular_hessians_are_shifted() {
    assert_decided(&[18, 35, 46]);
}

/// Guarded by `rounds`: with 0 these fail.
#[test]
fn flat_costs_converge_within_the_rounds() {
    assert_decided(&[18, 35, 46]);
}

/// Guarded by `close`: with 0 these fail.
#[test]
fn rounds_end_when_the_solution_converges() {
    assert_decided(&[2500]);
}

/// Guarded by `no_force`: with 0.01 these fail.
#[test]
fn rounds_continue_while_the_solution_moves() {
    assert_decided(&[18, 35, 46]);
}

/// Guarded by `recession`: with 0 these fail.
#[test]
fn unbounded_costs_are_detected() {
    assert_decided(&[718, 724, 1434]);
}

/// Guarded by `dependent`: with 0 these fail.
#[test]
fn dependent_constraints_are_not_added() {
    assert_decided(&[3, 21, 43]);
}

/// Guarded by `weak`: with 0 these fail.
#[test]
fn weak_members_are_examined_one_by_one() {
    assert_decided(&[3, 21, 125]);
}

/// Guarded by `conflict`: with 0 these fail.
#[test]
fn agreeing_dependent_constraints_do_not_contradict() {
    assert_decided(&[21, 43, 87]);
}

/// Guarded by `no_rate`: with 0.01 these fail.
#[test]
fn members_with_a_share_leave() {
    assert_decided(&[2729]);
}

/// Guarded by `sign`: with 0.01 these fail.
#[test]
fn members_with_the_wrong_sign_are_dropped() {
    assert_decided(&[120, 130, 159]);
}

/// Guarded by `sum`: with 0.01 these fail.
#[test]
fn violations_beyond_rounding_are_found() {
    assert_decided(&[15, 45, 46]);
}

/// Guarded by `gross`: with 0 these fail.
#[test]
fn rounding_is_not_a_gross_violation() {
    assert_decided(&[0, 1, 3]);
}

/// Guarded by `rounds_per_shift` and `lower_shift`: with a million, or with 1, this is not solved in 60
/// rounds, each of which covers a thousandth of the distance.
#[test]
fn lower_shifts_reach_minima_along_flat_costs() {
    let solution = flat(1e-7, 1e-7);
    assert_eq!(solution.accuracy, Accuracy::Full);
    assert!((solution.x[1] + 1.0).abs() < 1e-5, "{}", solution.x[1]);
}

/// Guarded by `little_force`: with 0 this fails after the last round.
#[test]
fn drift_along_a_flat_cost_ends_with_reduced_accuracy() {
    let solution = flat(1e-11, 5e-11);
    assert_eq!(solution.accuracy, Accuracy::Reduced);
    assert!((solution.x[0] - 1.0).abs() < 1e-9, "{}", solution.x[0]);
}

/// Guarded by `poor`: with 0 these fail.
#[test]
fn ill_conditioned_problems_get_a_second_attempt() {
    assert_decided(&[1_928_778]);
    assert_dependent_decided(&[248, 330]);
}

/// Guarded by `repeat`: with 0 these fail.
#[test]
fn projection_remainders_keep_their_digits() {
    assert_dependent_decided(&[12, 36, 43]);
}

/// Guarded by `noise`: with 0 these fail.
#[test]
fn multipliers_within_rounding_do_not_recur() {
    assert_dependent_decided(&[637, 5922]);
}

/// Guarded by `unsure`: with 0 these fail.
#[test]
fn small_violations_of_unrefined_minima_are_ignored() {
    assert_dependent_decided(&[637, 2642, 3821]);
}

/// Guarded by `degenerate_steps`: with a million this fails.
#[test]
fn degenerate_steps_end_a_failed_attempt() {
    assert_dependent_decided(&[214]);
}

/// Guarded by `refinements`: with 0 these fail.
#[test]
fn minima_on_dependent_constraints_are_refined() {
    assert_dependent_decided(&[12, 17, 26]);
}

/// Guarded by `converged`: with a million, which is one refinement, this fails.
#[test]
fn refinement_repeats_until_it_converges() {
    assert_dependent_decided(&[142]);
}

/// Guarded by `exact`: with a million these are answered, with errors of 3e-8.
#[test]
fn minima_without_converged_refinement_are_rejected() {
    for seed in [4297, 4363] {
        let trial = nearly_dependent(seed);
        let mut solver = ActiveSetSolver::new(trial.structure.clone(), ActiveSetSettings::default());
        solver.update(&trial.problem).unwrap();
        for pass in ["cold", "warm"] {
            let refused = matches!(
                solver.solve(),
                Err(SolveError::Numerical { .. } | SolveError::MaxIterations { .. })
            );
            assert!(refused, "problem {seed}, {pass}");
        }
    }
}

/// Guarded by `far`: with 0 these fail.
#[test]
fn certificate_remainders_are_no_proof_at_large_distance() {
    assert_dependent_decided(&[248, 972, 3481]);
}

/// Guarded by `out_of_reach` and `nearly`: with infinity, or with 0, this fails.
#[test]
fn constraints_that_hold_only_far_away_are_not_added() {
    assert_dependent_decided(&[330]);
}
