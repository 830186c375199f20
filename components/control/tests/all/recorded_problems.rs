//! Consecutive problems of real controllers, from `../shared/qps` where that folder is present.

use motorium_control::solver::{
    Accuracy, ClarabelSettings, ClarabelSolver, KktResidual, Problem, QpSolver, Sides, Structure,
};
use nalgebra::{DMatrix, DVector};
use serde_json::Value;

fn load(file: &str) -> Vec<Problem> {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/qps").join(file);
    let Ok(text) = std::fs::read_to_string(path) else {
        eprintln!("skipped: no recorded problems here");
        return Vec::new();
    };
    let list: Vec<Value> = serde_json::from_str(&text).unwrap();
    list.iter().map(parse).collect()
}

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        number => vec![number.as_f64().unwrap()],
    }
}

fn parse(value: &Value) -> Problem {
    let vector = |key: &str| DVector::from_vec(numbers(&value[key]));
    let n = vector("q").len();
    let matrix = |key: &str, rows| DMatrix::from_row_slice(rows, n, &numbers(&value[key]));
    Problem {
        hessian: matrix("P", n),
        gradient: vector("q"),
        equality_matrix: matrix("A", vector("b").len()),
        equality_value: vector("b"),
        row_matrix: matrix("G", vector("lg").len()),
        row_lower: vector("lg"),
        row_upper: vector("ug"),
        lower: vector("lb"),
        upper: vector("ub"),
    }
}

/// The sides that are finite in any of the problems.
fn structure(problems: &[Problem]) -> Structure {
    let sides = |lower: &dyn Fn(&Problem) -> f64, upper: &dyn Fn(&Problem) -> f64| {
        let below = problems.iter().any(|p| lower(p) > -Problem::INFINITE);
        let above = problems.iter().any(|p| upper(p) < Problem::INFINITE);
        match (below, above) {
            (true, true) => Sides::Both,
            (true, false) => Sides::Lower,
            (false, true) => Sides::Upper,
            (false, false) => Sides::Neither,
        }
    };
    let first = &problems[0];
    let mut structure = Structure::new(first.gradient.len()).equalities(first.equality_value.len());
    for row in 0..first.row_lower.len() {
        structure = structure.rows(1, sides(&|p| p.row_lower[row], &|p| p.row_upper[row]));
    }
    for variable in 0..first.gradient.len() {
        structure = structure.bound(variable, sides(&|p| p.lower[variable], &|p| p.upper[variable]));
    }
    structure
}

/// Residuals of the whole sequence are within `stationarity`, `feasibility` and `complementarity` (each in the
/// problem's own units), with one solver kept and its numbers updated in place.
fn assert_sequence_is_optimal(file: &str, stationarity: f64, feasibility: f64, complementarity: f64) {
    let problems = load(file);
    if problems.is_empty() {
        return;
    }
    let mut solver = ClarabelSolver::new(structure(&problems), ClarabelSettings::default());
    for (tick, problem) in problems.iter().enumerate() {
        solver.update(problem).unwrap();
        let solution = solver.solve().unwrap_or_else(|e| panic!("{file}[{tick}]: {e}"));
        assert_eq!(solution.accuracy, Accuracy::Full, "{file}[{tick}]");
        let residual = KktResidual::of(problem, solution);
        assert!(
            residual.stationarity < stationarity
                && residual.feasibility < feasibility
                && residual.complementarity < complementarity,
            "{file}[{tick}]: {residual:?}"
        );
    }
}

#[test]
fn panda_inverse_kinematics_is_solved_to_optimality() {
    assert_sequence_is_optimal("panda_ik.json", 1e-12, 1e-12, 1e-13);
}

#[test]
fn talos_inverse_kinematics_is_solved_to_optimality() {
    assert_sequence_is_optimal("talos_ik.json", 1e-12, 1e-11, 1e-13);
}

// forces of hundreds of newtons and a cost of tens of thousands: the same relative accuracy, larger numbers
#[test]
fn talos_inverse_dynamics_is_solved_to_optimality() {
    assert_sequence_is_optimal("talos_id.json", 1e-9, 1e-7, 1e-5);
}

#[test]
fn a_kept_solver_returns_what_a_new_one_returns() {
    let problems = load("panda_ik.json");
    if problems.is_empty() {
        return;
    }
    let structure = structure(&problems);
    let mut kept = ClarabelSolver::new(structure.clone(), ClarabelSettings::default());
    for problem in &problems {
        kept.update(problem).unwrap();
        let kept = kept.solve().unwrap().clone();
        let mut new = ClarabelSolver::new(structure.clone(), ClarabelSettings::default());
        new.update(problem).unwrap();
        assert_eq!(new.solve().unwrap(), &kept);
    }
}
