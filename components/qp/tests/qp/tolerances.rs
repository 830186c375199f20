//! Random problems that each need one tolerance of the active-set method: without it they are refused, or their
//! answer is wrong. Each test is named after the failure that the tolerance guards against.

use motorium_qp::{ActiveSetSettings, ActiveSetSolver, QpSolver};

use crate::random_problems::{trial, wrong};

/// Asserts that these problems are solved or refused rightly, from an empty working set and from their own.
#[track_caller]
fn assert_decided(seeds: &[u64]) {
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
fn rounds_end_when_the_solution_rests() {
    assert_decided(&[2500]);
}

/// Guarded by `no_force`: with 0.01 these fail.
#[test]
fn moving_solutions_do_not_end_the_rounds() {
    assert_decided(&[18, 35, 46]);
}

/// Guarded by `recession`: with 0 these fail.
#[test]
fn costs_that_fall_for_ever_are_detected() {
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
fn members_with_a_share_make_room() {
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
