//! Levels of strict priority, compared with projections and with a solver that fixes the results of higher
//! levels by equalities.

use motorium_control::{
    DifferentialIk, RobotState,
    limits::Limit,
    tasks::{
        CartesianTask, CentreOfMassSettings, CentreOfMassTask, ContactTask, PostureSettings, PostureTask,
        Rows, VelocityTask,
    },
};
use motorium_qp::{ClarabelSettings, ClarabelSolver, Problem, QpSolver, Sides, Structure};
use motorium_robots::{Kinematics, Model, load};
use nalgebra::{DMatrix, DVector, Isometry3, Vector3};

use crate::robot::Random;

/// A task with arbitrary rows and an arbitrary right-hand side.
struct Numbers {
    a: DMatrix<f64>,
    b: DVector<f64>,
}

impl VelocityTask for Numbers {
    fn rows(&self) -> usize {
        self.a.nrows()
    }

    fn update(&mut self, _: &RobotState<'_>) {}

    fn residual(&self, velocity: &[f64]) -> f64 {
        (&self.a * DVector::from_column_slice(velocity) - &self.b).norm()
    }

    fn add_to(&self, problem: &mut Problem) {
        problem.hessian += self.a.transpose() * &self.a;
        problem.gradient -= self.a.transpose() * &self.b;
    }

    fn write_rows(&self, rows: &mut Rows) {
        for (row, desired) in self.a.row_iter().zip(&self.b) {
            rows.push(*desired).iter_mut().zip(row.iter()).for_each(|(to, from)| *to = *from);
        }
    }
}

/// Bounds of each joint.
struct Box {
    lower: DVector<f64>,
    upper: DVector<f64>,
}

impl Limit for Box {
    fn intersect(&self, _: &RobotState<'_>, _: f64, problem: &mut Problem) {
        problem.lower.copy_from(&self.lower);
        problem.upper.copy_from(&self.upper);
    }
}

/// The same bounds for every joint.
struct Bounds(f64);

impl Limit for Bounds {
    fn intersect(&self, _: &RobotState<'_>, _: f64, problem: &mut Problem) {
        problem.lower.fill(-self.0);
        problem.upper.fill(self.0);
    }
}

fn panda() -> (Model, DVector<f64>) {
    let panda = load("panda", std::path::Path::new(".")).unwrap();
    let home = panda.profile.unwrap().home(&panda.model).unwrap();
    (panda.model, home)
}

fn numbers(rows: usize, columns: usize, random: &mut Random) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns, |_, _| random.within(1.0))
}

/// A hand with an offset from its target, and its Jacobian and desired velocity.
fn hand(model: &Model, state: &RobotState<'_>, off: Vector3<f64>) -> CartesianTask {
    let mut hand = CartesianTask::new(model, model.frame("panda_hand_tcp").unwrap());
    let mut settings = *hand.settings();
    settings.damping = 0.0;
    hand.set_settings(settings);
    let pose = state.kinematics.pose(model, hand.frame());
    hand.set_target(Isometry3::from_parts((pose.translation.vector + off).into(), pose.rotation));
    hand
}

#[test]
fn a_posture_below_a_hand_moves_in_the_null_space_of_the_hand() {
    let (model, home) = panda();
    let mut random = Random(7);
    for _ in 0..50 {
        let q = home.map(|q| q + random.within(0.2));
        let mut kinematics = Kinematics::new(&model);
        kinematics.update(&model, q.as_slice());
        let state = RobotState { model: &model, kinematics: &kinematics, q: q.as_slice() };
        let mut hand = hand(&model, &state, Vector3::new(0.05, -0.02, 0.01));
        let mut posture =
            PostureTask::new(&model, home.as_slice()).with(PostureSettings { gain: 2.0, weight: 1.0 });
        let mut ik = DifferentialIk::new(&model).levels(&[hand.rows(), posture.rows()]);
        ik.begin();
        ik.add_task(&state, 0, &mut hand);
        ik.add_task(&state, 1, &mut posture);
        let velocity = DVector::from_column_slice(ik.solve().unwrap());
        let jacobian = DMatrix::from_fn(6, model.nv(), |i, j| hand.jacobian()[(i, j)]);
        let inverse = jacobian.clone().pseudo_inverse(1e-9).unwrap();
        let open = DMatrix::identity(model.nv(), model.nv()) - &inverse * &jacobian;
        let expected = &inverse * hand.desired() + open * (&home - &q) * 2.0;
        assert!((&velocity - &expected).amax() < 1e-4, "{velocity} {expected}");
    }
}

#[test]
fn lower_levels_do_not_change_higher_ones() {
    let (model, home) = panda();
    let mut kinematics = Kinematics::new(&model);
    kinematics.update(&model, home.as_slice());
    let state = RobotState { model: &model, kinematics: &kinematics, q: home.as_slice() };
    let mut above = hand(&model, &state, Vector3::new(0.05, 0.0, 0.0));
    let mut against = hand(&model, &state, Vector3::new(-0.05, 0.1, 0.0));
    let mut posture = PostureTask::new(&model, &vec![0.0; model.nv()]);
    let solve = |levels: &[usize], tasks: &mut [&mut dyn VelocityTask]| {
        let mut ik = DifferentialIk::new(&model).levels(levels);
        ik.begin();
        for (level, task) in tasks.iter_mut().enumerate() {
            ik.add_task(&state, level, *task);
        }
        DVector::from_column_slice(ik.solve().unwrap())
    };
    let alone = solve(&[6], &mut [&mut above]);
    let all = solve(&[6, 6, model.nv()], &mut [&mut above, &mut against, &mut posture]);
    assert!((above.jacobian() * (&all - &alone)).amax() < 1e-9);
    assert!((&all - &alone).amax() > 1e-2, "the posture moves the elbow");
    let posture_only = solve(&[6, model.nv()], &mut [&mut above, &mut posture]);
    assert!((&all - &posture_only).amax() < 1e-6, "a level without free motions changes nothing");
}

#[test]
fn levels_within_limits_match_a_sequence_of_equalities() {
    let (model, home) = panda();
    let n = model.nv();
    let kinematics = Kinematics::new(&model);
    let state = RobotState { model: &model, kinematics: &kinematics, q: home.as_slice() };
    let mut random = Random(3);
    let mut active = 0;
    for case in 0..300 {
        let rows = [[2, 3, n], [1, n, n], [3, 2, 2]][case % 3];
        let mut tasks = rows.map(|rows| Numbers {
            a: numbers(rows, n, &mut random),
            b: DVector::from_column_slice(numbers(rows, 1, &mut random).as_slice()) * 2.0,
        });
        if case % 4 == 0 {
            // a task that repeats a part of the task above it
            let row = tasks[0].a.row(0).into_owned();
            tasks[1].a.set_row(0, &row);
        }
        let bound = [0.3, 1.0, 100.0][case / 3 % 3];
        let mut ik = DifferentialIk::new(&model).levels(&rows);
        ik.begin();
        for (level, task) in tasks.iter_mut().enumerate() {
            ik.add_task(&state, level, task);
        }
        ik.add_limit(&state, &Bounds(bound), 1e-3);
        let found = DVector::from_column_slice(ik.solve().unwrap());
        assert!(found.amax() <= bound);
        active += found.iter().filter(|v| v.abs() == bound).count();

        // level by level: the costs of higher levels stay the same
        let mut held: Option<(DMatrix<f64>, DVector<f64>)> = None;
        for task in &tasks {
            let (matrix, value) = held.take().unwrap_or((DMatrix::zeros(0, n), DVector::zeros(0)));
            let structure = Structure::new(n).equalities(value.len()).bounds(Sides::Both);
            let mut problem = Problem::new(&structure);
            problem.hessian.fill_diagonal(1e-7);
            task.add_to(&mut problem);
            problem.equality_matrix.copy_from(&matrix);
            problem.equality_value.copy_from(&value);
            problem.lower.fill(-bound);
            problem.upper.fill(bound);
            let mut solver = ClarabelSolver::new(structure, ClarabelSettings::default());
            solver.update(&problem).unwrap();
            let Ok(solution) = solver.solve() else { break };
            let seen = &task.a * &solution.x;
            let error = (&seen - &task.a * &found).amax();
            assert!(error < 2e-4, "case {case}: {seen} {found} {error}");
            // dependent rows are omitted: equalities must be independent
            let mut matrix = matrix;
            let mut value = value.as_slice().to_vec();
            for (row, seen) in task.a.row_iter().zip(&seen) {
                let mut longer = matrix.clone().insert_row(matrix.nrows(), 0.0);
                longer.row_mut(matrix.nrows()).copy_from(&row);
                if longer.nrows() <= n && longer.singular_values().min() > 1e-6 {
                    matrix = longer;
                    value.push(*seen);
                }
            }
            held = Some((matrix, DVector::from_vec(value)));
        }
    }
    assert!(active > 300, "{active} active limits");
}

/// Random levels and bounds. Rows are whole numbers or not, differ in scale by up to 10^6, and may repeat;
/// some bounds are zero.
fn random_levels(n: usize, random: &mut Random) -> (Vec<Numbers>, Box) {
    let below = |count: usize, random: &mut Random| ((random.within(0.5) + 0.5) * count as f64) as usize;
    let whole = below(3, random) == 0;
    let entry = |scale: f64, random: &mut Random| {
        scale * if whole { (random.within(2.5)).round() } else { random.within(1.0) }
    };
    let mut tasks = Vec::new();
    for _ in 0..2 + below(3, random) {
        let rows = 1 + below(n, random);
        let scale = [1.0, 1.0, 1e-3, 1e3][below(4, random)];
        let a = DMatrix::from_fn(rows, n, |_, _| entry(scale, random));
        let b = DVector::from_fn(rows, |_, _| entry(3.0 * scale, random));
        tasks.push(Numbers { a, b });
    }
    if below(3, random) == 0 {
        let row = tasks[0].a.row(0).into_owned();
        tasks[1].a.set_row(0, &row);
    }
    let bound = [0.3, 1.0, 100.0][below(3, random)];
    let side = |random: &mut Random| if below(6, random) == 0 { 0.0 } else { bound };
    let lower = DVector::from_fn(n, |_, _| -side(random));
    let upper = DVector::from_fn(n, |_, _| side(random));
    (tasks, Box { lower, upper })
}

#[test]
fn levels_of_any_scale_preserve_higher_ones() {
    let (model, home) = panda();
    let n = model.nv();
    let kinematics = Kinematics::new(&model);
    let state = RobotState { model: &model, kinematics: &kinematics, q: home.as_slice() };
    let count = std::env::var("MOTORIUM_QP_PROBLEMS").map_or(3000, |count| count.parse().unwrap());
    for seed in 0..count {
        let (mut tasks, limits) = random_levels(n, &mut Random(seed));
        let rows: Vec<usize> = tasks.iter().map(VelocityTask::rows).collect();
        let mut solve = |levels: usize| {
            let mut ik = DifferentialIk::new(&model).levels(&rows[..levels]);
            ik.begin();
            for (level, task) in tasks.iter_mut().take(levels).enumerate() {
                ik.add_task(&state, level, task);
            }
            ik.add_limit(&state, &limits, 1e-3);
            let found = ik.solve().unwrap_or_else(|error| panic!("case {seed}, {levels} levels: {error}"));
            DVector::from_column_slice(found)
        };
        let (first, all) = (solve(1), solve(rows.len()));
        assert!(all.iter().zip(&limits.lower).all(|(v, lower)| v >= lower), "case {seed}");
        assert!(all.iter().zip(&limits.upper).all(|(v, upper)| v <= upper), "case {seed}");
        let a = &tasks[0].a;
        let change = (a * (&all - &first)).amax() / (a.amax() * (1.0 + all.amax()));
        assert!(change < 1e-6, "case {seed}: the first level changes by {change}");
    }
}

#[test]
fn held_feet_stay_at_rest_in_sums_and_in_levels() {
    let humanoid = load("humanoid", std::path::Path::new(".")).unwrap();
    let (model, profile) = (&humanoid.model, humanoid.profile.unwrap());
    let q = profile.configuration(model, "standing").unwrap();
    let mut kinematics = Kinematics::new(model);
    kinematics.update(model, q.as_slice());
    let state = RobotState { model, kinematics: &kinematics, q: q.as_slice() };
    let mut feet =
        ["left_sole", "right_sole"].map(|sole| ContactTask::surface(model, model.frame(sole).unwrap()));
    let settings = CentreOfMassSettings { damping: 0.0, ..CentreOfMassSettings::default() };
    let mut balance = CentreOfMassTask::new(model).with(settings);
    balance.set_target(kinematics.centre_of_mass(model).position + Vector3::new(0.02, 0.03, -0.05));
    let mut posture = PostureTask::new(model, &vec![0.0; model.joint_count()]);
    let mut solve = |levels: &[usize], below: usize| {
        let mut ik = DifferentialIk::with_contacts(model, 12, 0).levels(levels);
        ik.begin();
        feet.iter_mut().for_each(|foot| ik.hold(&state, foot));
        ik.add_task(&state, 0, &mut balance);
        ik.add_task(&state, below, &mut posture);
        let velocity = DVector::from_column_slice(ik.solve().unwrap());
        for foot in &feet {
            assert!(foot.cost().residual(velocity.as_slice()) < 1e-10);
        }
        (balance.jacobian() * &velocity - balance.desired()).amax()
    };
    let (sum, hard) = (solve(&[], 0), solve(&[3, model.joint_count()], 1));
    assert!(hard < 1e-3 && sum < 1e-2, "the centre of mass must move: {sum}, {hard}");
}

#[test]
fn levels_allocate_nothing() {
    let (model, home) = panda();
    let mut kinematics = Kinematics::new(&model);
    kinematics.update(&model, home.as_slice());
    let state = RobotState { model: &model, kinematics: &kinematics, q: home.as_slice() };
    let mut hand = hand(&model, &state, Vector3::new(0.5, 0.0, 0.0));
    let mut posture = PostureTask::new(&model, &vec![0.0; model.nv()]);
    let mut ik = DifferentialIk::new(&model).levels(&[hand.rows(), posture.rows()]);
    let allocations = motorium::testing::allocations(|| {
        for _ in 0..3 {
            ik.begin();
            ik.add_task(&state, 0, &mut hand);
            ik.add_task(&state, 1, &mut posture);
            ik.add_limit(&state, &Bounds(0.1), 1e-3);
            ik.solve().unwrap();
        }
    });
    assert_eq!(allocations, 0);
}

/// A task with a concave cost, which no solver can solve.
struct Saddle;

impl VelocityTask for Saddle {
    fn rows(&self) -> usize {
        1
    }

    fn update(&mut self, _: &RobotState<'_>) {}

    fn residual(&self, _: &[f64]) -> f64 {
        0.0
    }

    fn add_to(&self, problem: &mut Problem) {
        problem.hessian[(0, 0)] -= 1.0;
    }

    fn write_rows(&self, rows: &mut Rows) {
        rows.push(0.0)[0] = 1.0;
    }
}

#[test]
fn a_level_without_a_solution_leaves_higher_ones_unchanged() {
    let (model, home) = panda();
    let mut kinematics = Kinematics::new(&model);
    kinematics.update(&model, home.as_slice());
    let state = RobotState { model: &model, kinematics: &kinematics, q: home.as_slice() };
    let mut ik = DifferentialIk::new(&model).levels(&[6, 1, model.nv()]);
    let mut velocity = |with_saddle: bool| {
        let mut hand = hand(&model, &state, Vector3::new(0.05, -0.02, 0.01));
        let mut posture = PostureTask::new(&model, &vec![0.1; model.nv()]);
        ik.begin();
        ik.add_task(&state, 0, &mut hand);
        if with_saddle {
            ik.add_task(&state, 1, &mut Saddle);
        } else {
            ik.add_task(&state, 2, &mut posture);
        }
        let velocity = DVector::from_column_slice(ik.solve().expect("the hand has a solution"));
        let jacobian = DMatrix::from_fn(6, model.nv(), |i, j| hand.jacobian()[(i, j)]);
        (jacobian * velocity, ik.undecided())
    };
    let (whole, undecided) = velocity(false);
    assert!(whole.norm() > 0.1 && undecided == 0, "{whole} {undecided}");
    let (above, undecided) = velocity(true);
    assert!((above - &whole).norm() < 1e-6, "the hand moves as before");
    assert_eq!(undecided, 1);
    assert_eq!(velocity(false).1, 0, "the next tick has a solution for all levels");
}
