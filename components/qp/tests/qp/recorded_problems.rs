//! Consecutive problems of real controllers, from `../shared/qps` if that folder is present.

use motorium_qp::{
    Accuracy, ActiveSetSettings, ActiveSetSolver, ClarabelSettings, ClarabelSolver, KktResidual, Problem,
    QpSolver, Structure,
    recorded::{self, RecordedError},
};

fn load(file: &str) -> Option<(Structure, Vec<Problem>)> {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/qps").join(file);
    let Ok(text) = std::fs::read_to_string(path) else {
        eprintln!("skipped: no recorded problems found");
        return None;
    };
    Some(recorded::read(&text).unwrap())
}

/// Asserts that the residuals of a whole sequence are within `stationarity`, `feasibility` and
/// `complementarity`, each in the problem's own units. One solver is kept and its numbers are updated in
/// place.
fn assert_sequence_is_optimal(file: &str, stationarity: f64, feasibility: f64, complementarity: f64) {
    let Some((structure, problems)) = load(file) else { return };
    let solvers: [Box<dyn QpSolver>; 2] = [
        Box::new(ClarabelSolver::new(structure.clone(), ClarabelSettings::default())),
        Box::new(ActiveSetSolver::new(structure, ActiveSetSettings::default())),
    ];
    for mut solver in solvers {
        for (tick, problem) in problems.iter().enumerate() {
            solver.update(problem).unwrap();
            let solution = solver.solve().unwrap_or_else(|e| panic!("{file}[{tick}]: {e}"));
            assert_eq!(solution.accuracy, Accuracy::Full, "{file}[{tick}]");
            let residual = KktResidual::from_solution(problem, solution);
            assert!(
                residual.stationarity < stationarity
                    && residual.feasibility < feasibility
                    && residual.complementarity < complementarity,
                "{file}[{tick}]: {residual:?}"
            );
        }
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
fn reused_solver_matches_a_new_one() {
    let Some((structure, problems)) = load("panda_ik.json") else { return };
    let mut kept = ClarabelSolver::new(structure.clone(), ClarabelSettings::default());
    for problem in &problems {
        kept.update(problem).unwrap();
        let kept = kept.solve().unwrap().clone();
        let mut new = ClarabelSolver::new(structure.clone(), ClarabelSettings::default());
        new.update(problem).unwrap();
        assert_eq!(new.solve().unwrap(), &kept);
    }
}

#[test]
fn the_active_set_solver_matches_the_exact_reference() {
    for file in ["panda_ik.json", "talos_ik.json", "talos_id.json"] {
        let Some((structure, problems)) = load(file) else { return };
        for warm_start in [true, false] {
            let settings = ActiveSetSettings { warm_start, ..ActiveSetSettings::default() };
            let mut solver = ActiveSetSolver::new(structure.clone(), settings);
            let replay = recorded::replay(&structure, &problems, &mut solver, 1);
            assert_eq!(replay.solved, problems.len(), "{file}");
            let (violation, distance) = (replay.worst_violation, replay.worst_distance);
            assert!(violation < 1e-9 && distance < 1e-6, "{file}: {violation} and {distance}");
            // A warm-started solve seldom changes a constraint.
            assert!(!warm_start || replay.iterations.p50 <= 2.0, "{file}: {:?}", replay.iterations);
        }
    }
}

#[test]
fn reset_solver_is_bitwise_equal_to_a_new_one() {
    let Some((structure, problems)) = load("talos_ik.json") else { return };
    let mut used = ActiveSetSolver::new(structure.clone(), ActiveSetSettings::default());
    for problem in &problems {
        used.update(problem).unwrap();
        used.solve().unwrap();
    }
    used.reset();
    let mut new = ActiveSetSolver::new(structure, ActiveSetSettings::default());
    for problem in &problems {
        used.update(problem).unwrap();
        new.update(problem).unwrap();
        assert_eq!(used.solve().unwrap(), new.solve().unwrap());
    }
}

/// Returns consecutive problems with `n` variables, all of which are at their bounds.
fn moving(n: usize) -> Vec<String> {
    let list = |entry: &dyn Fn(usize) -> String| (0..n).map(entry).collect::<Vec<_>>().join(", ");
    let row = |i: usize| list(&|j| if i == j { "1" } else { "0" }.to_owned());
    let hessian = list(&|i| format!("[{}]", row(i)));
    let problem = |tick: usize| {
        let slope = list(&|j| format!("-{}", 2.0 + 0.01 * (tick + j) as f64));
        let upper = list(&|_| "1".to_owned());
        format!("{{ \"P\": [{hessian}], \"q\": [{slope}], \"ub\": [{upper}] }}")
    };
    (0..4).map(problem).collect()
}

#[test]
fn streams_of_equal_size_start_warm_and_others_cold() {
    let text = format!("[{}]", [moving(3), moving(5), moving(3)].concat().join(", "));
    let streams = recorded::read_streams(&text).unwrap();
    let sizes: Vec<_> = streams.iter().map(|s| (s.structure.variables(), s.problems.len())).collect();
    assert_eq!(sizes, [(3, 4), (5, 4), (3, 4)]);
    assert!(recorded::read(&text).is_err(), "a single size is required");
    let solve = |warm_start: bool, rounds: usize| {
        let settings = ActiveSetSettings { warm_start, ..ActiveSetSettings::default() };
        let build = |structure: &Structure| -> Box<dyn QpSolver> {
            Box::new(ActiveSetSolver::new(structure.clone(), settings))
        };
        recorded::replay_streams(&streams, build, rounds)
    };
    for rounds in [1, 3] {
        let (warm, cold) = (solve(true, rounds), solve(false, rounds));
        assert_eq!((warm.problems, warm.solved, cold.solved), (12, 12, 12));
        assert!(warm.worst_distance < 1e-12 && warm.worst_violation < 1e-12, "{warm:?}");
        // every bound is active: one iteration each when cold, and no more when the previous problem's set is
        // known
        let (warm_most, cold_most) = (warm.iterations.max, cold.iterations.max);
        assert_eq!(warm_most, cold_most, "the first problem of each size is solved cold");
        assert!(warm.iterations.p50 < cold.iterations.p50, "{warm:?} {cold:?}");
    }
}

#[test]
fn recorded_problem_of_wrong_size_names_the_key() {
    let read = |text: &str| recorded::read(text).unwrap_err();
    let square = r#"[{ "P": [[1, 0], [0, 1]], "q": [0, 0] }, { "P": [[1, 0]], "q": [0, 0] }]"#;
    let ragged = r#"{ "P": [[1, 0], [0]], "q": [0, 0] }"#;
    let long = r#"{ "P": [[1]], "q": [0], "lb": [0, 1] }"#;
    for (text, place, name) in [(square, 1, "P"), (ragged, 0, "P"), (long, 0, "lb")] {
        let error = read(text);
        let RecordedError::Size { problem, key, .. } = error else { panic!("{error}") };
        assert_eq!((problem, key), (place, name));
    }
    assert!(matches!(read("[]"), RecordedError::Empty));
    for text in [r#"{ "P": [[1]], "q": [0], "H": [] }"#, "3"] {
        assert!(matches!(read(text), RecordedError::Syntax(_)), "{}", read(text));
    }
}

#[test]
fn non_finite_entries_and_asymmetry_report_their_position() {
    let read = |text: &str| recorded::read(text).unwrap_err();
    for entry in ["NaN", "Infinity", "-Infinity", "nan", "inf", "-inf"] {
        let error = read(&format!("{{ \"P\": [[1]],\n \"q\": [{entry}] }}"));
        let RecordedError::NoNumber { word, line: 2, column: 8 } = error else { panic!("{error}") };
        assert_eq!(word, entry);
    }
    let error = read(r#"{ "P": [[1, 0.5], [0.1, 1]], "q": [0, 0] }"#);
    let RecordedError::Asymmetric { problem: 0, row: 0, column: 1, upper, lower } = error else {
        panic!("{error}")
    };
    assert_eq!((upper, lower), (0.5, 0.1));
    for same in ["[[1, 0.5], [0.5, 1]]", "[[1, 0.5], [0, 1]]"] {
        let (_, problems) = recorded::read(&format!("{{ \"P\": {same}, \"q\": [0, 0] }}")).unwrap();
        assert_eq!(problems[0].hessian[(0, 1)], 0.5);
    }
}

#[test]
fn only_negative_curvature_beyond_rounding_is_rejected() {
    let solve = |text: &str, warm_start: bool| {
        let (structure, problems) = recorded::read(text).unwrap();
        let settings = ActiveSetSettings { warm_start, ..ActiveSetSettings::default() };
        let mut solver = ActiveSetSolver::new(structure.clone(), settings);
        let ours = recorded::replay(&structure, &problems, &mut solver, 1).each.unwrap()[0].clone();
        let mut reference = ClarabelSolver::new(structure.clone(), ClarabelSettings::default());
        let theirs = recorded::replay(&structure, &problems, &mut reference, 1).each.unwrap()[0].clone();
        [ours, theirs]
    };
    let bounded = |hessian: &str| {
        format!("{{ \"P\": {hessian}, \"q\": [0.5, 0.0], \"lb\": [-1, -1], \"ub\": [1, 1] }}")
    };
    // negative, of both signs, hidden off the diagonal, small compared with the rest
    for hessian in [
        "[[-1, 0], [0, -1]]",
        "[[1, 0], [0, -1]]",
        "[[1, 2], [2, 1]]",
        "[[0, 1], [1, 0]]",
        "[[1, 0], [0, -1e-6]]",
    ] {
        for each in [true, false].into_iter().flat_map(|warm| solve(&bounded(hessian), warm)) {
            assert_eq!(each.status, recorded::Status::NotConvex, "{hessian}: {each:?}");
            assert!(each.error.unwrap().contains("not positive semi-definite") && each.x.is_empty());
        }
    }
    for hessian in ["[[1, 0], [0, 0]]", "[[0, 0], [0, 0]]", "[[1, 1], [1, 1]]", "[[1, 0], [0, -1e-13]]"] {
        for each in solve(&bounded(hessian), true) {
            assert_eq!(each.status, recorded::Status::Solved, "{hessian}: {each:?}");
        }
    }
}
