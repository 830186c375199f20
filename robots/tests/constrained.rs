//! Constrained motion and the inertial regressor.

use approx::assert_relative_eq;
use motorium_robots::{
    BaseMode, ConstrainedDynamics, ConstrainedError, Constraint, Dynamics, Kinematics, LoadOptions,
    MimicMode, Model, Reference, parse_urdf_with,
};
use nalgebra::{DMatrix, DVector, Vector3};

const GRAVITY: Vector3<f64> = Vector3::new(0.3, -0.2, -9.81);

fn branching(base: BaseMode, mimic: MimicMode) -> Model {
    let options = LoadOptions { base, mimic, ..LoadOptions::default() };
    parse_urdf_with(include_str!("fixtures/branching.urdf"), None, &options).unwrap().model
}

/// Returns a generic state.
fn state(model: &Model) -> (DVector<f64>, DVector<f64>, DVector<f64>) {
    let n = model.nv();
    let wave = |scale: f64, shift: f64| DVector::from_fn(n, |i, _| scale * (1.7 * i as f64 + shift).sin());
    let mut q = DVector::zeros(model.nq());
    model.integrate(&model.neutral(), wave(0.8, 0.3).as_slice(), q.as_mut_slice());
    (q, wave(1.5, 1.1), wave(6.0, 2.2))
}

#[test]
fn regressor_times_parameters_is_inverse_dynamics() {
    for model in [
        branching(BaseMode::AsFile, MimicMode::Follow),
        branching(BaseMode::Floating, MimicMode::Follow),
        branching(BaseMode::Floating, MimicMode::Independent),
    ] {
        let (q, v, a) = state(&model);
        let mut tau = DVector::zeros(model.nv());
        let mut dynamics = Dynamics::new(&model);
        dynamics.rnea(&model, q.as_slice(), v.as_slice(), a.as_slice(), GRAVITY, tau.as_mut_slice());
        let mut regressor = DMatrix::from_element(model.nv(), model.parameter_count(), f64::NAN);
        dynamics.regressor(&model, q.as_slice(), v.as_slice(), a.as_slice(), GRAVITY, &mut regressor);
        assert_relative_eq!(regressor * model.inertial_parameters(), tau, epsilon = 1e-11);
    }
}

/// Returns Jacobian and drift of the tool's origin.
fn held_tool(model: &Model, q: &DVector<f64>, v: &DVector<f64>) -> (DMatrix<f64>, DVector<f64>) {
    let tool = model.frame("tool").unwrap();
    let mut kinematics = Kinematics::new(model);
    kinematics.update_with_velocity(model, q.as_slice(), v.as_slice());
    let mut jacobian = DMatrix::zeros(6, model.nv());
    kinematics.jacobian(model, tool, Reference::LocalWorldAligned, &mut jacobian);
    let drift = kinematics.acceleration(model, tool).linear;
    (jacobian.rows(0, 3).into_owned(), DVector::from_column_slice(drift.as_slice()))
}

#[test]
fn held_point_does_not_accelerate() {
    for mimic in [MimicMode::Follow, MimicMode::Independent] {
        let model = branching(BaseMode::Floating, mimic);
        let (q, v, tau) = state(&model);
        let (jacobian, drift) = held_tool(&model, &q, &v);
        let (mut a, mut lambda) = (DVector::zeros(model.nv()), DVector::zeros(3));
        ConstrainedDynamics::new(&model, 3)
            .forward(
                &model,
                q.as_slice(),
                v.as_slice(),
                tau.as_slice(),
                GRAVITY,
                Constraint { jacobian: &jacobian, drift: drift.as_slice(), damping: 0.0 },
                a.as_mut_slice(),
                lambda.as_mut_slice(),
            )
            .unwrap();
        assert_relative_eq!(&jacobian * &a + &drift, DVector::zeros(3), epsilon = 1e-9);
        let mut needed = DVector::zeros(model.nv());
        Dynamics::new(&model).rnea(
            &model,
            q.as_slice(),
            v.as_slice(),
            a.as_slice(),
            GRAVITY,
            needed.as_mut_slice(),
        );
        assert_relative_eq!(needed, tau + jacobian.transpose() * lambda, epsilon = 1e-8);
    }
}

#[test]
fn duplicate_constraint_requires_damping() {
    let model = branching(BaseMode::Floating, MimicMode::Independent);
    let (q, v, tau) = state(&model);
    let (once, drift) = held_tool(&model, &q, &v);
    let jacobian = DMatrix::from_fn(4, model.nv(), |row, column| once[(row % 3, column)]);
    let drift = DVector::from_fn(4, |row, _| drift[row % 3]);
    let mut dynamics = ConstrainedDynamics::new(&model, 4);
    let (mut a, mut lambda) = (DVector::zeros(model.nv()), DVector::zeros(4));
    let mut run = |damping| {
        let constraint = Constraint { jacobian: &jacobian, drift: drift.as_slice(), damping };
        let (q, v, tau) = (q.as_slice(), v.as_slice(), tau.as_slice());
        dynamics.forward(&model, q, v, tau, GRAVITY, constraint, a.as_mut_slice(), lambda.as_mut_slice())
    };
    assert_eq!(run(0.0), Err(ConstrainedError::Redundant { row: 3 }));
    run(1e-8).unwrap();
    assert_relative_eq!(lambda[0], lambda[3], max_relative = 1e-5);
    assert_relative_eq!(&jacobian * &a + &drift, DVector::zeros(4), epsilon = 1e-4);
}
