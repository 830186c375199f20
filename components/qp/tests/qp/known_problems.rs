//! Small quadratic programs with published or hand-computed solutions.

use approx::assert_abs_diff_eq;
use motorium_qp::{
    ActiveSetSettings, ActiveSetSolver, ClarabelSettings, ClarabelSolver, Constraint, KktResidual, Problem,
    QpSolver, Side, Sides, Solution, SolveError, Structure, UpdateError,
    recorded::{self, RecordedError},
};
use nalgebra::{DMatrix, DVector, dmatrix, dvector};

/// Returns one solver of each kind.
fn solvers(structure: &Structure) -> [Box<dyn QpSolver>; 2] {
    [
        Box::new(ClarabelSolver::new(structure.clone(), ClarabelSettings::default())),
        Box::new(ActiveSetSolver::new(structure.clone(), ActiveSetSettings::default())),
    ]
}

fn solve(structure: &Structure, problem: &Problem) -> [Result<Solution, SolveError>; 2] {
    solvers(structure).map(|mut solver| {
        solver.update(problem).unwrap();
        solver.solve().cloned()
    })
}

fn assert_solution(structure: &Structure, problem: &Problem, expected: &[f64]) -> [Solution; 2] {
    solve(structure, problem).map(|solution| {
        let solution = solution.unwrap();
        assert_abs_diff_eq!(solution.x.as_slice(), expected, epsilon = 1e-6);
        let residual = KktResidual::from_solution(problem, &solution);
        assert!(residual.worst() < 1e-7, "{residual:?}");
        solution
    })
}

/// Nocedal and Wright, Numerical Optimization, 2nd ed., example 16.2.
#[test]
fn equality_problem_matches_published_solution() {
    let structure = Structure::new(3).equalities(2);
    let mut problem = Problem::new(&structure);
    problem.hessian = dmatrix![6.0, 2.0, 1.0; 2.0, 5.0, 2.0; 1.0, 2.0, 4.0];
    problem.gradient = dvector![-8.0, -3.0, -3.0];
    problem.equality_matrix = dmatrix![1.0, 0.0, 1.0; 0.0, 1.0, 1.0];
    problem.equality_value = dvector![3.0, 0.0];
    for solution in assert_solution(&structure, &problem, &[2.0, -1.0, 1.0]) {
        // the book writes the Lagrangian with a minus sign
        assert_abs_diff_eq!(solution.equality_dual.as_slice(), [-3.0, 2.0].as_slice(), epsilon = 1e-6);
    }
}

/// Nocedal and Wright, example 16.4.
#[test]
fn rows_and_bounds_match_published_solution() {
    let structure = Structure::new(2).rows(3, Sides::Lower).bounds(Sides::Lower);
    let mut problem = Problem::new(&structure);
    problem.hessian = dmatrix![2.0, 0.0; 0.0, 2.0];
    problem.gradient = dvector![-2.0, -5.0];
    problem.row_matrix = dmatrix![1.0, -2.0; -1.0, -2.0; -1.0, 2.0];
    problem.row_lower = dvector![-2.0, -6.0, -2.0];
    problem.lower = dvector![0.0, 0.0];
    for solution in assert_solution(&structure, &problem, &[1.4, 1.7]) {
        assert_abs_diff_eq!(solution.row_dual.as_slice(), [-0.8, 0.0, 0.0].as_slice(), epsilon = 1e-6);
    }
}

/// Hock and Schittkowski, Test Examples for Nonlinear Programming Codes, problem 35.
#[test]
fn hock_schittkowski_35_is_solved() {
    let structure = Structure::new(3).rows(1, Sides::Upper).bounds(Sides::Lower);
    let mut problem = Problem::new(&structure);
    problem.hessian = dmatrix![4.0, 2.0, 2.0; 2.0, 4.0, 0.0; 2.0, 0.0, 2.0];
    problem.gradient = dvector![-8.0, -6.0, -4.0];
    problem.row_matrix = dmatrix![1.0, 1.0, 2.0];
    problem.row_upper = dvector![3.0];
    problem.lower.fill(0.0);
    assert_solution(&structure, &problem, &[4.0 / 3.0, 7.0 / 9.0, 4.0 / 9.0]);
}

/// Hock and Schittkowski, problem 76.
#[test]
fn hock_schittkowski_76_is_solved() {
    let structure = Structure::new(4).rows(2, Sides::Upper).rows(1, Sides::Lower).bounds(Sides::Lower);
    let mut problem = Problem::new(&structure);
    problem.hessian =
        dmatrix![2.0, 0.0, -1.0, 0.0; 0.0, 1.0, 0.0, 0.0; -1.0, 0.0, 2.0, 1.0; 0.0, 0.0, 1.0, 1.0];
    problem.gradient = dvector![-1.0, -3.0, 1.0, -1.0];
    problem.row_matrix = dmatrix![1.0, 2.0, 1.0, 1.0; 3.0, 1.0, 2.0, -1.0; 0.0, 1.0, 4.0, 0.0];
    problem.row_upper = dvector![5.0, 4.0, f64::INFINITY];
    problem.row_lower[2] = 1.5;
    problem.lower.fill(0.0);
    assert_solution(&structure, &problem, &[3.0 / 11.0, 23.0 / 11.0, 0.0, 6.0 / 11.0]);
}

#[test]
fn unconstrained_problem_is_a_linear_system() {
    let structure = Structure::new(2);
    let mut problem = Problem::new(&structure);
    problem.hessian = dmatrix![2.0, 1.0; 1.0, 3.0];
    problem.gradient = dvector![-1.0, -8.0];
    assert_solution(&structure, &problem, &[-1.0, 3.0]);
}

fn separable(curvature: f64) -> (Structure, Problem) {
    let structure = Structure::new(4).bounds(Sides::Both);
    let mut problem = Problem::new(&structure);
    problem.hessian = DMatrix::from_diagonal_element(4, 4, curvature);
    problem.gradient = DVector::from_column_slice(&[3.0, -0.5, -3.0, 0.25]) * curvature;
    problem.lower.fill(-1.0);
    problem.upper.fill(2.0);
    (structure, problem)
}

#[test]
fn separable_problem_is_solved_by_clipping() {
    let (structure, problem) = separable(1.0);
    for solution in assert_solution(&structure, &problem, &[-1.0, 0.5, 2.0, -0.25]) {
        assert_abs_diff_eq!(solution.bound_dual.as_slice(), [-2.0, 0.0, 1.0, 0.0].as_slice(), epsilon = 1e-6);
    }
}

#[test]
fn sides_may_become_infinite_and_finite_between_updates() {
    let (structure, mut problem) = separable(1.0);
    for mut solver in solvers(&structure) {
        for (upper, third) in [(2.0, 2.0), (f64::INFINITY, 3.0), (1e30, 3.0), (1.0, 1.0)] {
            problem.upper[2] = upper;
            solver.update(&problem).unwrap();
            let x = &solver.solve().unwrap().x;
            assert_abs_diff_eq!(x.as_slice(), [-1.0, 0.5, third, -0.25].as_slice(), epsilon = 1e-7);
        }
    }
}

#[test]
fn exact_zeros_do_not_shift_other_entries() {
    let structure = Structure::new(3).equalities(1).bounds(Sides::Both);
    for mut solver in solvers(&structure) {
        let mut problem = Problem::new(&structure);
        problem.equality_value[0] = 1.0;
        for zero in 0..3 {
            problem.hessian = dmatrix![3.0, 1.0, 0.5; 1.0, 4.0, 0.25; 0.5, 0.25, 5.0];
            let other = (zero + 1) % 3;
            problem.hessian[(zero, other)] = 0.0;
            problem.hessian[(other, zero)] = 0.0;
            problem.equality_matrix = dmatrix![1.0, 2.0, 3.0];
            problem.equality_matrix[(0, zero)] = 0.0;
            // min x'Px/2 subject to a'x = 1 has x = P^-1 a / (a'P^-1 a)
            let a = problem.equality_matrix.transpose();
            let direction = problem.hessian.clone().cholesky().unwrap().solve(&a);
            let expected = &direction / a.dot(&direction);
            solver.update(&problem).unwrap();
            assert_abs_diff_eq!(solver.solve().unwrap().x, expected.column(0).into_owned(), epsilon = 1e-8);
        }
    }
}

#[test]
fn solution_is_independent_of_units() {
    for curvature in [1e-6, 1.0, 1e6] {
        let (structure, mut problem) = separable(curvature);
        for length in [1e-4, 1.0, 1e4] {
            problem.gradient = DVector::from_column_slice(&[3.0, -0.5, -3.0, 0.25]) * curvature * length;
            problem.lower.fill(-length);
            problem.upper.fill(2.0 * length);
            for solution in solve(&structure, &problem) {
                let x = solution.unwrap().x / length;
                assert_abs_diff_eq!(x.as_slice(), [-1.0, 0.5, 2.0, -0.25].as_slice(), epsilon = 1e-8);
            }
        }
    }
}

#[test]
fn linear_cost_is_minimised_at_a_vertex() {
    let structure = Structure::new(2).bounds(Sides::Both);
    let mut problem = Problem::new(&structure);
    problem.gradient = dvector![1e-6, -2e-6];
    problem.lower.fill(-3.0);
    problem.upper.fill(3.0);
    for solution in solve(&structure, &problem) {
        assert_abs_diff_eq!(solution.unwrap().x.as_slice(), [-3.0, 3.0].as_slice(), epsilon = 1e-7);
    }
}

#[test]
fn infeasible_problem_names_conflicting_constraints() {
    let structure = Structure::new(3).equalities(1).rows(1, Sides::Both).bounds(Sides::Both);
    let mut problem = Problem::new(&structure);
    problem.hessian = DMatrix::identity(3, 3);
    problem.equality_matrix = dmatrix![1.0, 0.0, 1.0];
    problem.equality_value = dvector![5.0];
    problem.row_matrix = dmatrix![0.0, 1.0, 0.0];
    problem.row_upper = dvector![10.0];
    problem.upper = dvector![1.0, 1.0, 2.0];
    for outcome in solve(&structure, &problem) {
        let error = outcome.unwrap_err();
        let SolveError::Infeasible { conflict } = error else { panic!("{error}") };
        let mut named: Vec<_> = conflict.constraints().collect();
        named.sort_by_key(|c| c.to_string());
        assert_eq!(
            named,
            [Constraint::Equality(0), Constraint::Bound(0, Side::Upper), Constraint::Bound(2, Side::Upper)]
        );
    }
}

#[test]
fn unbounded_cost_names_its_variable() {
    let structure = Structure::new(2).bounds(Sides::Lower);
    let mut problem = Problem::new(&structure);
    problem.hessian[(0, 0)] = 1.0;
    problem.gradient = dvector![1.0, -1.0];
    problem.lower.fill(0.0);
    for outcome in solve(&structure, &problem) {
        assert_eq!(outcome.unwrap_err(), SolveError::Unbounded { variable: 1 });
    }
}

#[test]
fn distant_bounds_of_flat_costs_are_reached() {
    for distance in [1e3, 1e7, 1e10, 1e13] {
        let structure = Structure::new(2).bounds(Sides::Lower);
        let mut problem = Problem::new(&structure);
        problem.gradient = dvector![1.0, 2.0];
        problem.lower = dvector![-distance, -1e-3 * distance];
        let [_, outcome] = solve(&structure, &problem);
        assert_eq!(outcome.unwrap().x, problem.lower, "{distance:e}");
    }
}

#[test]
fn distant_rows_of_flat_costs_are_reached() {
    // x + y >= -1e9 and x = y
    let structure = Structure::new(2).equalities(1).rows(1, Sides::Lower);
    let mut problem = Problem::new(&structure);
    problem.gradient = dvector![1.0, 0.0];
    problem.equality_matrix = dmatrix![1.0, -1.0];
    problem.row_matrix = dmatrix![1.0, 1.0];
    problem.row_lower = dvector![-1e9];
    let [_, outcome] = solve(&structure, &problem);
    let x = outcome.unwrap().x;
    assert!((x[0] + 0.5e9).abs() < 1.0 && (x[1] + 0.5e9).abs() < 1.0, "{x}");
}

#[test]
fn slight_curvature_ends_the_descent_before_a_distant_bound() {
    // the minimum of 5e-12 y^2 + y is at -1e11, the bound at -1e14
    let structure = Structure::new(2).bounds(Sides::Lower);
    let mut problem = Problem::new(&structure);
    (problem.hessian[(0, 0)], problem.hessian[(1, 1)]) = (1.0, 1e-11);
    problem.gradient = dvector![0.0, 1.0];
    problem.lower.fill(-1e14);
    let [_, outcome] = solve(&structure, &problem);
    let y = outcome.unwrap().x[1];
    assert!((y / -1e11 - 1.0).abs() < 1e-3, "{y:e}");
}

#[test]
fn steep_costs_end_at_the_bounds_of_their_box() {
    // The descent is 1e9 to 1e25 times as steep as the curvature over the box.
    let corners: [[&[f64]; 3]; 4] = [
        [&[6.4e-19], &[2.9e-4], &[-666.4]],
        [&[2.2e-11, 1.0e-11], &[-0.025, -0.27], &[0.53, 0.95]],
        [&[1.3e-13, 1.8e-19, 2.9e-18], &[-1900.0, 544.0, -1.0e4], &[0.97, -1.5, 1090.0]],
        [&[1.0, 1.0], &[-1.0e12, 3.0e12], &[2.0, -0.5]],
    ];
    for [curvatures, gradient, bounds] in corners {
        let structure = Structure::new(gradient.len()).bounds(Sides::Both);
        let mut problem = Problem::new(&structure);
        for (i, bound) in bounds.iter().enumerate() {
            problem.hessian[(i, i)] = curvatures[i];
            problem.gradient[i] = gradient[i];
            // only the side towards which the cost descends is finite
            if gradient[i] > 0.0 { problem.lower[i] = *bound } else { problem.upper[i] = *bound }
        }
        for outcome in solve(&structure, &problem) {
            let solution = outcome.unwrap_or_else(|error| panic!("{gradient:?}: {error}"));
            for (found, expected) in solution.x.iter().zip(bounds) {
                assert!((found - expected).abs() < 1e-6 * expected.abs(), "{gradient:?}: {found}");
            }
        }
    }
}

#[test]
fn solver_stays_usable_after_reaching_iteration_limit() {
    let (structure, problem) = separable(1.0);
    let settings = ClarabelSettings { max_iterations: 2, ..ClarabelSettings::default() };
    let mut solver = ClarabelSolver::new(structure, settings);
    solver.update(&problem).unwrap();
    assert_eq!(solver.solve().unwrap_err(), SolveError::MaxIterations { iterations: 2 });
    assert_eq!(solver.solve().unwrap_err(), SolveError::MaxIterations { iterations: 2 });
    // a change of the working set for each of the two bounds
    let settings = ActiveSetSettings { max_iterations: Some(1), ..ActiveSetSettings::default() };
    let (structure, problem) = separable(1.0);
    let mut solver = ActiveSetSolver::new(structure, settings);
    solver.update(&problem).unwrap();
    assert_eq!(solver.solve().unwrap_err(), SolveError::MaxIterations { iterations: 1 });
    // the next solve continues where this one stopped
    assert_eq!(solver.solve().unwrap().x.as_slice(), [-1.0, 0.5, 2.0, -0.25]);
}

#[test]
fn solver_recovers_after_an_infeasible_tick() {
    let structure = Structure::new(1).rows(1, Sides::Lower).bounds(Sides::Both);
    let mut problem = Problem::new(&structure);
    problem.hessian[(0, 0)] = 1.0;
    problem.gradient[0] = -0.5;
    problem.row_matrix[(0, 0)] = 1.0;
    problem.upper[0] = 1.0;
    for mut solver in solvers(&structure) {
        for _ in 0..3 {
            problem.row_lower[0] = 2.0;
            solver.update(&problem).unwrap();
            assert!(matches!(solver.solve(), Err(SolveError::Infeasible { .. })));
            problem.row_lower[0] = f64::NEG_INFINITY;
            solver.update(&problem).unwrap();
            assert_abs_diff_eq!(solver.solve().unwrap().x[0], 0.5, epsilon = 1e-8);
        }
    }
}

#[test]
fn invalid_problem_data_are_rejected_by_name() {
    let structure = Structure::new(2).bounds(Sides::Upper);
    for mut solver in solvers(&structure) {
        let good = Problem::new(&structure);

        let mut problem = good.clone();
        problem.gradient[1] = f64::NAN;
        assert!(matches!(
            solver.update(&problem),
            Err(UpdateError::NotFinite { what: "q", row: 1, column: 0, .. })
        ));
        assert_eq!(solver.solve().unwrap_err(), SolveError::NotUpdated);

        let mut problem = good.clone();
        problem.lower[0] = 0.0;
        let constraint = Constraint::Bound(0, Side::Lower);
        assert_eq!(solver.update(&problem), Err(UpdateError::Undeclared { constraint, value: 0.0 }));

        let mut problem = good.clone();
        problem.lower[0] = 1.0;
        problem.upper[0] = -1.0;
        assert_eq!(
            solver.update(&problem),
            Err(UpdateError::Crossed { constraint, lower: 1.0, upper: -1.0 })
        );

        let other = Problem::new(&Structure::new(3));
        let shape = UpdateError::Shape { what: "P", found: (3, 3), expected: (2, 2) };
        assert_eq!(solver.update(&other), Err(shape));
    }
}

#[test]
fn kkt_residual_detects_wrong_solutions() {
    let (structure, problem) = separable(1.0);
    let [Ok(good), _] = solve(&structure, &problem) else { panic!("it has a solution") };
    let mut moved = good.clone();
    moved.x[1] += 0.01;
    assert!(KktResidual::from_solution(&problem, &moved).stationarity > 9e-3);
    let mut outside = good.clone();
    outside.x[2] += 0.01;
    assert!(KktResidual::from_solution(&problem, &outside).feasibility > 9e-3);
    // a multiplier on a side that the solution does not touch
    let mut pressing = good.clone();
    pressing.bound_dual[1] = 0.1;
    assert!(KktResidual::from_solution(&problem, &pressing).complementarity > 0.1);
    let mut nan = good;
    nan.x[0] = f64::NAN;
    assert!(KktResidual::from_solution(&problem, &nan).worst().is_nan());
}

/// The rows of the first problem range from 2e0 to 3e6, of the second from 7e-5 to 2e7. quadprog and Clarabel
/// solve both.
#[test]
fn badly_scaled_rows_are_solved() {
    for text in [ROWS_OF_SIX_DECADES, ROWS_OF_ELEVEN_DECADES] {
        let (structure, problems) = recorded::read(text).unwrap();
        let [interior, active] = solve(&structure, &problems[0]).map(Result::unwrap);
        let scale = 1.0 + interior.x.amax();
        assert_abs_diff_eq!(active.x, interior.x, epsilon = 1e-5 * scale);
    }
}

const ROWS_OF_SIX_DECADES: &str = r#"{"P":[[0.4718064759462406,0.5001114701011853,-0.13290595797598082],[0.5001114701011853,0.9852160829753535,0.2190977960661532],[-0.13290595797598082,0.2190977960661532,1.2877917195040247]],"q":[-0.44213397384627257,-13.411146104149555,-6.416099322877649],"A":[],"b":[],"G":[[-39.84135959720176,1335.626841168837,-1117.5316747312957],[3201924.1649763924,-2408781.7275868948,1736720.0786818722],[-2.347943236575612,-34.5152679417033,3.028021892494017],[-1.7925466288227226e-07,-5.1304593623961084e-08,9.033117300980689e-08]],"lg":[1847.4190211261173,-5387300.0315543655,-38.92367157877605,-3.187991712884967e-07],"ug":[2405.154617690701,-2116747.349566604,-19.990461505433082,-1.7744096606349567e-07],"lb":[-1.9586220036462882,-1.5671998522080797,-3.636413285117689],"ub":[2.0413779963537118,2.4328001477919203,0.36358671488231087]}"#;
const ROWS_OF_ELEVEN_DECADES: &str = r#"{"P":[[8.861492928633167,-6.145832090528106],[-6.145832090528106,4.706933184510699]],"q":[-6.657063242785543,-0.9427747759445124],"A":[],"b":[],"G":[[-0.027153289250896703,-0.03262395904656775],[-69.00097287192303,-82.24510326634781],[6.951989438215588e-05,6.267203282752492e-05],[-270755.8754818927,16858973.435054787]],"lg":[-0.04436704179661714,-73.73784401409151,3.831231009937935e-05,13810890.771194734],"ug":[-0.02229602162712683,-56.06580220005159,3.831231009937935e-05,16680763.225929283],"lb":[-2.2603700619905696,-1.099866291803718],"ub":[1.7396299380094304,2.900133708196282]}"#;

/// A problem with rows in other units has the same solution, with multipliers in these units.
#[test]
fn row_units_change_multipliers_but_not_the_solution() {
    let structure = Structure::new(2).equalities(1).rows(2, Sides::Both);
    let mut problem = Problem::new(&structure);
    problem.hessian = dmatrix![2.0, 0.5; 0.5, 1.0];
    problem.gradient = dvector![-3.0, 1.0];
    problem.equality_matrix = dmatrix![1.0, 2.0];
    problem.equality_value = dvector![0.5];
    problem.row_matrix = dmatrix![1.0, -1.0; 1.0, 1.0];
    problem.row_upper = dvector![0.25, 2.0];
    let mut solver = ActiveSetSolver::new(structure.clone(), ActiveSetSettings::default());
    solver.update(&problem).unwrap();
    let expected = solver.solve().unwrap().clone();
    for (equality, row) in [(1e8, 1e-8), (1e-6, 1e7), (1e-9, 1e-9), (1.0, 1e12), (1.0, 1.0)] {
        let mut scaled = problem.clone();
        scaled.equality_matrix *= equality;
        scaled.equality_value *= equality;
        scaled.row_matrix.row_mut(0).scale_mut(row);
        scaled.row_upper[0] *= row;
        // a cold solve and one that starts with the working set of other units
        for solver in
            [&mut ActiveSetSolver::new(structure.clone(), ActiveSetSettings::default()), &mut solver]
        {
            solver.update(&scaled).unwrap();
            let found = solver.solve().unwrap();
            assert_abs_diff_eq!(found.x, expected.x, epsilon = 1e-12);
            assert_abs_diff_eq!(
                found.equality_dual[0] * equality,
                expected.equality_dual[0],
                epsilon = 1e-11
            );
            assert_abs_diff_eq!(found.row_dual[0] * row, expected.row_dual[0], epsilon = 1e-11);
        }
        assert_eq!(solver.iterations(), 0, "the warm start survives other units");
    }
}

#[test]
fn contradicting_rows_of_any_scale_are_infeasible() {
    let structure = Structure::new(2).rows(2, Sides::Both);
    for (one, other) in [(1.0, 1.0), (1e-8, 1e8), (1e7, 1e-5)] {
        let mut problem = Problem::new(&structure);
        problem.hessian.fill_with_identity();
        problem.row_matrix = dmatrix![one, one; other, other];
        problem.row_lower = dvector![2.0 * one, f64::NEG_INFINITY];
        problem.row_upper = dvector![f64::INFINITY, 1.0 * other];
        for outcome in solve(&structure, &problem) {
            assert!(matches!(outcome, Err(SolveError::Infeasible { .. })), "{outcome:?}");
        }
    }
}

#[test]
fn problem_without_variables_is_rejected() {
    let error = recorded::read(r#"[{"P": [], "q": []}]"#).unwrap_err();
    assert!(matches!(error, RecordedError::NoVariables { problem: 0 }), "{error}");
}
