//! Contradictory constraints of inverse kinematics: they are named, and the graph's policy applies.

use motorium::launcher::Report;
use motorium_control::{
    DifferentialIk, IkError, IkRows, IkSettings, RobotState,
    inverse_dynamics::ConstraintName,
    limits::VelocityLimit,
    tasks::{CartesianSettings, CartesianTask, PostureSettings, PostureTask, VelocityTask},
};
use motorium_qp::SolveError;
use motorium_robots::Kinematics;
use nalgebra::DVector;

use crate::component::number;
use crate::graph::{Targets, controller, graph, run};
use crate::robot::Panda;

/// Result of a step, its conflict, and its distance from the least-squares solution.
type Contradiction = (Result<DVector<f64>, IkError>, Option<(f64, Vec<ConstraintName>)>, f64);

/// The hand is to stay in place while all joints move at 0.1 rad/s: no velocity satisfies both.
fn contradiction(relaxation: Option<f64>) -> Contradiction {
    let panda = Panda::new();
    let model = &panda.model;
    let mut kinematics = Kinematics::new(model);
    kinematics.update(model, panda.home.as_slice());
    let state = RobotState { model, kinematics: &kinematics, q: panda.home.as_slice() };
    let mut hand = CartesianTask::new(model, panda.hand);
    hand.set_settings(CartesianSettings { orientation_weight: 1.0, ..CartesianSettings::default() });
    hand.set_target(kinematics.pose(model, panda.hand));
    let away: Vec<f64> = panda.home.iter().map(|q| q + 0.1).collect();
    let firm = PostureSettings { gain: 1.0, weight: 1.0 };
    let mut moving = PostureTask::new(model, &away).with(firm);
    let rows = IkRows { held: hand.rows() + moving.rows(), ..IkRows::default() };
    let settings = IkSettings { relaxation, ..IkSettings::default() };
    let mut ik = DifferentialIk::with_room(model, rows, settings);
    ik.begin();
    ik.constrain(&state, &mut hand);
    ik.constrain(&state, &mut moving);
    ik.add_limit(&state, &VelocityLimit::default(), 1e-3);
    let solved = ik.solve().map(DVector::from_column_slice);
    let conflict = ik.conflict().map(|conflict| (conflict.slack, conflict.constraints().collect()));
    // least squares of all rows, by an independent factorisation
    let mut stacked = nalgebra::DMatrix::zeros(6 + model.nv(), model.nv());
    stacked.rows_mut(0, 6).copy_from(&hand.jacobian());
    stacked.rows_mut(6, model.nv()).fill_with_identity();
    let mut wanted = DVector::zeros(6 + model.nv());
    wanted.rows_mut(6, model.nv()).fill(0.1);
    let least = stacked.clone().svd(true, true).solve(&wanted, 1e-12).unwrap();
    let far = solved.as_ref().map_or(0.0, |v| (v - least).norm());
    (solved, conflict, far)
}

#[test]
fn contradictions_without_relaxation_have_no_solution() {
    let (solved, conflict, _) = contradiction(None);
    assert!(matches!(solved, Err(IkError::Solve(SolveError::Infeasible { .. }))), "{solved:?}");
    let (slack, named) = conflict.unwrap();
    assert_eq!(slack, 0.0);
    assert!(
        !named.is_empty() && named.iter().all(|found| matches!(found, ConstraintName::Task { .. })),
        "{named:?}"
    );
    assert!(named.iter().any(|found| matches!(found, ConstraintName::Task { row } if *row < 6)), "{named:?}");
}

#[test]
fn relaxed_contradictions_are_missed_by_least_squares() {
    let (solved, conflict, far) = contradiction(Some(100.0));
    let v = solved.unwrap();
    assert!(far < 1e-6, "{far}");
    let missed = v.iter().map(|v| (v - 0.1).abs()).fold(0.0, f64::max);
    let (slack, named) = conflict.unwrap();
    assert!(slack >= missed - 1e-12 && slack < 1.0 && !named.is_empty(), "{slack} {missed}");
}

/// Runs a hand that must follow its target exactly, faster than its joints can move.
fn rushed(policy: &str) -> Report {
    let config = format!(
        "{{ {policy} limits = {{ velocity = {{ fraction = 0.1 }} }}, tasks = [{{ constraint = {{ task = {{ cartesian = {{ name = \"hand\", gain = 20.0 }} }} }} }}, {{ posture = {{}} }}] }}"
    );
    run(graph("{}", Targets::default(), controller(&config)))
}

#[test]
fn policy_applies_and_the_result_names_the_conflict() {
    let (hold, named, relax, stop) = (
        rushed(""),
        rushed("on_infeasible = \"hold\","),
        rushed("on_infeasible = \"relax\","),
        rushed("on_infeasible = \"safe_stop\","),
    );
    assert_eq!(hold.state_hash, named.state_hash, "this is the default policy");
    let result = |report: &Report| report.results["controller"].clone();
    let unsolved = |report: &Report| result(report)["steps_without_solution"].as_u64().unwrap();
    for report in [&hold, &relax, &stop] {
        let words = result(report)["solver"]["first_conflict"].as_str().unwrap().to_owned();
        assert!(words.contains("task `hand`, row "), "{words}");
        assert!(words.contains("position or velocity limit of joint `panda_joint"), "{words}");
    }
    assert!(unsolved(&hold) > 100 && unsolved(&stop) > 100, "{} {}", unsolved(&hold), unsolved(&stop));
    assert_eq!(result(&hold)["solver"]["steps_relaxed"], 0);
    assert_eq!(unsolved(&relax), 0);
    assert!(result(&relax)["solver"]["steps_relaxed"].as_u64().unwrap() > 100);
    assert!(number(&result(&relax)["solver"]["largest_slack"]["task"]) > 1e-3);
    // moving as fast as the joints can brings it nearer to its goal than standing still
    let last = |report: &Report| number(&result(report)["tasks"]["hand"]["last_position_error_m"]);
    assert!(last(&relax) < 0.5 * last(&hold), "{} {}", last(&relax), last(&hold));
    // the joint limits hold under each policy
    for report in [&hold, &relax, &stop] {
        assert_eq!(report.results["plant"]["broken_limits"], 0, "{}", report.results["plant"]);
    }
    let commands = |report: &Report| report.results["plant"]["commands"].as_u64().unwrap();
    assert!(commands(&stop) + 100 < commands(&hold), "{} {}", commands(&stop), commands(&hold));
}

#[test]
fn a_lone_constraint_uses_the_smallest_velocities() {
    let config = "{ tasks = [{ constraint = { task = { cartesian = { name = \"hand\", gain = 3.0 } } } }] }";
    let report = run(graph("{}", Targets::default(), controller(config)));
    let result = &report.results["controller"];
    assert_eq!(result["steps_without_solution"], 0, "{result}");
    assert!(number(&result["tasks"]["hand"]["last_position_error_m"]) < 1e-3, "{result}");
}

#[test]
fn torque_policy_is_configured_in_inverse_dynamics() {
    let config = "{ on_infeasible = \"hold\", inverse_dynamics = {} }";
    let error = graph("{}", Targets::default(), controller(config)).check().expect_err("it must be refused");
    let error = error.render(false);
    assert!(
        error.contains("on_infeasible") && error.contains("inverse_dynamics = { on_infeasible"),
        "{error}"
    );
}
