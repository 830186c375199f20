//! Analytical derivatives compared with finite differences along the configuration manifold.

use std::path::Path;

use approx::assert_relative_eq;
use motorium_robots::{
    BaseMode, Derivatives, Dynamics, LoadOptions, MimicMode, Model, load, parse_urdf_with,
};
use nalgebra::{DMatrix, DVector, Vector3};
use proptest::prelude::*;

const GRAVITY: Vector3<f64> = Vector3::new(0.3, -0.2, -9.81);

/// The Panda with its coupled fingers, and a tree with skew axes on a fixed and on a floating base.
fn robots() -> Vec<Model> {
    let branching = |base, mimic| {
        let options = LoadOptions { base, mimic, ..LoadOptions::default() };
        parse_urdf_with(include_str!("fixtures/branching.urdf"), None, &options).unwrap().model
    };
    vec![
        load("panda", Path::new(".")).unwrap().model,
        branching(BaseMode::AsFile, MimicMode::Independent),
        branching(BaseMode::Floating, MimicMode::Independent),
        branching(BaseMode::Floating, MimicMode::Follow),
    ]
}

fn vector(model: &Model, numbers: &[f64], scale: f64) -> DVector<f64> {
    DVector::from_iterator(model.nv(), numbers.iter().cycle().take(model.nv()).map(|x| x * scale))
}

fn configuration(model: &Model, numbers: &[f64]) -> DVector<f64> {
    moved(model, &DVector::from_vec(model.neutral()), &vector(model, numbers, 1.5))
}

fn moved(model: &Model, q: &DVector<f64>, v: &DVector<f64>) -> DVector<f64> {
    let mut out = DVector::zeros(model.nq());
    model.integrate(q.as_slice(), v.as_slice(), out.as_mut_slice());
    out
}

/// Returns central differences of `f` with respect to the nv entries of its argument.
fn differences(n: usize, f: impl Fn(&DVector<f64>) -> DVector<f64>) -> DMatrix<f64> {
    let h = 1e-5;
    let columns: Vec<_> = (0..n)
        .map(|column| {
            let mut step = DVector::zeros(n);
            step[column] = h;
            (f(&step) - f(&-step)) / (2.0 * h)
        })
        .collect();
    DMatrix::from_columns(&columns)
}

fn numbers() -> impl Strategy<Value = Vec<f64>> {
    proptest::collection::vec(-1.0..1.0, 23)
}

fn close(ours: &DMatrix<f64>, expected: &DMatrix<f64>) {
    let scale = expected.amax().max(1.0);
    assert_relative_eq!(ours, expected, epsilon = 2e-7 * scale);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn inverse_dynamics_derivatives_match_differences(q in numbers(), v in numbers(), a in numbers()) {
        for model in robots() {
            let n = model.nv();
            let (q, v, a) = (configuration(&model, &q), vector(&model, &v, 2.0), vector(&model, &a, 4.0));
            let rnea = |q: &DVector<f64>, v: &DVector<f64>, a: &DVector<f64>| {
                let mut tau = DVector::zeros(n);
                Dynamics::new(&model).rnea(&model, q.as_slice(), v.as_slice(), a.as_slice(), GRAVITY, tau.as_mut_slice());
                tau
            };
            let mut out = Derivatives::new(&model);
            Dynamics::new(&model).rnea_derivatives(&model, q.as_slice(), v.as_slice(), a.as_slice(), GRAVITY, &mut out);
            close(&out.q, &differences(n, |step| rnea(&moved(&model, &q, step), &v, &a)));
            close(&out.v, &differences(n, |step| rnea(&q, &(&v + step), &a)));
            let mut mass = DMatrix::zeros(n, n);
            Dynamics::new(&model).crba(&model, q.as_slice(), &mut mass);
            assert_relative_eq!(out.input, mass, epsilon = 1e-12 * mass.amax());
        }
    }

    #[test]
    fn forward_dynamics_derivatives_match_differences(q in numbers(), v in numbers(), tau in numbers()) {
        for model in robots() {
            let n = model.nv();
            let (q, v, tau) = (configuration(&model, &q), vector(&model, &v, 2.0), vector(&model, &tau, 4.0));
            let forward = |q: &DVector<f64>, v: &DVector<f64>| {
                let mut a = DVector::zeros(n);
                Dynamics::new(&model)
                    .forward(&model, q.as_slice(), v.as_slice(), tau.as_slice(), GRAVITY, a.as_mut_slice())
                    .unwrap();
                a
            };
            let (mut a, mut out) = (DVector::zeros(n), Derivatives::new(&model));
            Dynamics::new(&model)
                .forward_derivatives(
                    &model, q.as_slice(), v.as_slice(), tau.as_slice(), GRAVITY, a.as_mut_slice(), &mut out,
                )
                .unwrap();
            assert_eq!(a, forward(&q, &v));
            close(&out.q, &differences(n, |step| forward(&moved(&model, &q, step), &v)));
            close(&out.v, &differences(n, |step| forward(&q, &(&v + step))));
            let mut mass = DMatrix::zeros(n, n);
            Dynamics::new(&model).crba(&model, q.as_slice(), &mut mass);
            assert_relative_eq!(&out.input * mass, DMatrix::identity(n, n), epsilon = 1e-8);
        }
    }
}
