//! Problems recorded in single precision: errors within rounding are accepted, larger ones rejected.

use motorium_qp::{
    ActiveSetSettings, ActiveSetSolver, ClarabelSettings, ClarabelSolver, QpSolver,
    recorded::{self, RecordedError},
};
use nalgebra::{DMatrix, DVector};

use crate::random::Random;

/// Formats in which programs write single-precision numbers.
#[derive(Clone, Copy, Debug)]
enum Written {
    /// As few digits as single precision needs.
    Short,
    /// All digits after conversion to double precision.
    Wide,
}

impl Written {
    fn list(self, numbers: impl IntoIterator<Item = f64>) -> String {
        let words = numbers.into_iter().map(|number| match self {
            Self::Short => (number as f32).to_string(),
            Self::Wide => f64::from(number as f32).to_string(),
        });
        format!("[{}]", words.collect::<Vec<_>>().join(", "))
    }

    fn matrix(self, matrix: &DMatrix<f64>) -> String {
        let rows = matrix.row_iter().map(|row| self.list(row.iter().copied()));
        format!("[{}]", rows.collect::<Vec<_>>().join(", "))
    }
}

const BOTH: [Written; 2] = [Written::Short, Written::Wide];

/// Solves the single problem of a file with our solver, warm and cold, and with the reference.
fn solve(text: &str) -> Vec<recorded::Each> {
    let (structure, problems) = recorded::read(text).unwrap();
    let settings = |warm_start| ActiveSetSettings { warm_start, ..ActiveSetSettings::default() };
    let mut solvers: [Box<dyn QpSolver>; 3] = [
        Box::new(ActiveSetSolver::new(structure.clone(), settings(true))),
        Box::new(ActiveSetSolver::new(structure.clone(), settings(false))),
        Box::new(ClarabelSolver::new(structure.clone(), ClarabelSettings::default())),
    ];
    let outcome = |solver: &mut Box<dyn QpSolver>| {
        recorded::replay(&structure, &problems, solver.as_mut(), 2).each.unwrap()[0].clone()
    };
    solvers.iter_mut().map(outcome).collect()
}

fn random(rows: usize, columns: usize, random: &mut Random) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns, |_, _| random.within(3.0))
}

/// Returns the smallest eigenvalue of a matrix after rounding to single precision, relative to its largest
/// entry.
fn lowest(matrix: &DMatrix<f64>) -> f64 {
    let single = matrix.map(|number| f64::from(number as f32));
    single.symmetric_eigenvalues().min() / matrix.amax()
}

#[test]
fn least_squares_tolerate_single_precision_rounding() {
    let mut downwards = 0;
    for seed in 0..20 {
        let mut numbers = Random(seed);
        let (rows, columns) = (2 + seed as usize % 5, 8);
        let a = random(rows, columns, &mut numbers);
        let wanted = DVector::from_fn(rows, |_, _| numbers.within(1.0));
        let (hessian, gradient) = (a.tr_mul(&a), -a.tr_mul(&wanted));
        downwards += usize::from(lowest(&hessian) < -1e-8);
        for (written, bounds) in BOTH.into_iter().flat_map(|written| [(written, ""), (written, "9")]) {
            let bound = |sign: &str| format!("[{}]", vec![format!("{sign}{bounds}"); columns].join(", "));
            let bounds = match bounds.is_empty() {
                true => String::new(),
                false => format!(", \"lb\": {}, \"ub\": {}", bound("-"), bound("")),
            };
            let (p, q) = (written.matrix(&hessian), written.list(gradient.iter().copied()));
            for each in solve(&format!("{{ \"P\": {p}, \"q\": {q}{bounds} }}")) {
                assert_eq!(each.status, recorded::Status::Solved, "{seed} {written:?}: {each:?}");
                // more columns than rows: the target is reached within rounding
                let missed = (&a * DVector::from_vec(each.x) - &wanted).amax();
                assert!(missed < 1e-4, "{seed} {written:?}: {missed}");
            }
        }
    }
    assert!(downwards > 10, "rounding made {downwards} of 20 problems non-convex");
}

#[test]
fn negative_curvature_beyond_rounding_is_rejected() {
    for seed in 0..10 {
        let mut numbers = Random(seed);
        let a = random(3, 6, &mut numbers);
        let mut hessian = a.tr_mul(&a);
        let less = 1e-5 * hessian.amax();
        (0..6).for_each(|i| hessian[(i, i)] -= less);
        assert!(lowest(&hessian) < -5e-6);
        for written in BOTH {
            let p = written.matrix(&hessian);
            let (one, ten) = (written.list([1.0; 6]), written.list([10.0; 6]));
            let text = format!(
                "{{ \"P\": {p}, \"q\": {one}, \"lb\": {}, \"ub\": {ten} }}",
                written.list([-10.0; 6])
            );
            for each in solve(&text) {
                assert_eq!(each.status, recorded::Status::NotConvex, "{seed} {written:?}: {each:?}");
            }
        }
    }
}

#[test]
fn double_precision_tolerance_is_unchanged() {
    // the same small negative curvature, next to a number that single precision cannot represent
    let with = |corner: &str| {
        format!("{{ \"P\": [[1, 0], [0, -1e-7]], \"q\": [{corner}, 0], \"lb\": [-1, -1], \"ub\": [1, 1] }}")
    };
    for each in solve(&with("0.5")) {
        assert_eq!(each.status, recorded::Status::Solved, "{each:?}");
    }
    let double = with("0.5").replace("[[1,", "[[1.000000000001,");
    for each in solve(&double) {
        assert_eq!(each.status, recorded::Status::NotConvex, "{each:?}");
    }
    let read = |text: &str| recorded::read(text).map(|_| ());
    let sides =
        |upper: &str, lower: &str| format!("{{ \"P\": [[1, {upper}], [{lower}, 1]], \"q\": [0, 0] }}");
    let (one, near) = (f64::from(0.3_f32), f64::from(0.3_f32) + 3.0 * 0.25 * f64::from(f32::EPSILON));
    read(&sides(&one.to_string(), &near.to_string())).expect("three spacings apart");
    for apart in [sides(&(one + 1e-14).to_string(), &near.to_string()), sides("0.3", "0.30001")] {
        let error = read(&apart).unwrap_err();
        assert!(matches!(error, RecordedError::Asymmetric { row: 0, column: 1, .. }), "{error}");
    }
}

#[test]
fn unbounded_cost_is_not_treated_as_rounding() {
    let a = DMatrix::from_row_slice(1, 3, &[1.0, 0.7, 0.3]);
    for written in BOTH {
        let p = written.matrix(&a.tr_mul(&a));
        for each in solve(&format!("{{ \"P\": {p}, \"q\": [0.7, -1, 0] }}")) {
            assert_eq!(each.status, recorded::Status::Unbounded, "{written:?}: {each:?}");
        }
    }
}

#[test]
fn dependent_equalities_agree_or_contradict_by_value() {
    for seed in 0..10 {
        let mut numbers = Random(seed);
        let two = random(2, 5, &mut numbers);
        let mut rows = DMatrix::zeros(3, 5);
        rows.rows_mut(0, 2).copy_from(&two);
        rows.set_row(2, &(two.row(0) * 0.37 - two.row(1) * 1.9));
        let mut value = &rows * DVector::from_fn(5, |_, _| numbers.within(1.0));
        // the smallest x that satisfies two of them satisfies all
        let expected = two.clone().svd(true, true).solve(&value.rows(0, 2), 1e-12).unwrap();
        let text = |value: &DVector<f64>, written: Written| {
            let (a, b) = (written.matrix(&rows), written.list(value.iter().copied()));
            let p = written.matrix(&DMatrix::identity(5, 5));
            format!("{{ \"P\": {p}, \"q\": [0, 0, 0, 0, 0], \"A\": {a}, \"b\": {b} }}")
        };
        for each in BOTH.into_iter().flat_map(|written| solve(&text(&value, written))) {
            assert_eq!(each.status, recorded::Status::Solved, "{seed}: {each:?}");
            let far = (DVector::from_vec(each.x) - &expected).amax();
            assert!(far < 1e-5, "{seed}: {far}");
        }
        value[2] += 0.01;
        for each in BOTH.into_iter().flat_map(|written| solve(&text(&value, written))) {
            assert_eq!(each.status, recorded::Status::Infeasible, "{seed}: {each:?}");
        }
    }
}
