//! The primitives against independent code: see `golden/generate.py`.

use motorium_primitives::dmp::{
    Demonstration, DiscreteDmp, DmpModel, OrientationDmp, Regression, Settings, Variant,
};
use nalgebra::{DMatrix, DVector, Quaternion, UnitQuaternion};
use serde::Deserialize;

#[derive(Deserialize)]
struct Golden {
    start: Vec<f64>,
    velocity: Vec<f64>,
    goal: Vec<f64>,
    duration: f64,
    movements: std::collections::BTreeMap<String, Movement>,
    features: Vec<Features>,
    fit: Fit,
    orientation: Orientation,
}

#[derive(Deserialize)]
struct Movement {
    weights: Vec<Vec<f64>>,
    samples: Vec<Sample>,
}

#[derive(Deserialize)]
struct Sample {
    t: f64,
    y: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
}

#[derive(Deserialize)]
struct Features {
    p: f64,
    values: Vec<f64>,
}

#[derive(Deserialize)]
struct Fit {
    lambda: f64,
    positions: Vec<Vec<f64>>,
    velocities: Vec<Vec<f64>>,
    accelerations: Vec<Vec<f64>>,
    classic: Vec<Vec<f64>>,
    goal_safe: Vec<Vec<f64>>,
    classic_locally_weighted: Vec<Vec<f64>>,
}

#[derive(Deserialize)]
struct Orientation {
    start_xyzw: [f64; 4],
    goal_xyzw: [f64; 4],
    duration: f64,
    weights: Vec<Vec<f64>>,
    samples: Vec<OrientationSample>,
}

#[derive(Deserialize)]
struct OrientationSample {
    t: f64,
    q_xyzw: [f64; 4],
    omega: [f64; 3],
}

fn golden() -> Golden {
    serde_json::from_str(include_str!("../golden/dmp.json")).unwrap()
}

fn matrix(rows: &[Vec<f64>]) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j])
}

fn quaternion([x, y, z, w]: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z))
}

fn settings(variant: Variant) -> Settings {
    Settings { variant, kernels: 8, ..Settings::default() }
}

fn model(variant: Variant, weights: &[Vec<f64>]) -> DmpModel {
    let weights = matrix(weights);
    let displacement = DVector::from_element(weights.ncols(), 1.0);
    DmpModel::with_weights(settings(variant), weights, displacement).unwrap()
}

fn largest_difference(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn features_match_movement_primitives() {
    let golden = golden();
    let model = DmpModel::new(1, settings(Variant::Classic)).unwrap();
    for features in golden.features {
        let mut found = vec![0.0; 8];
        model.kernels().features_into(features.p, &mut found);
        assert!(largest_difference(&found, &features.values) < 1e-14, "at progress {}", features.p);
    }
}

/// Largest error of position, velocity and acceleration over all samples, at steps of `dt` seconds.
fn errors(golden: &Golden, name: &str, variant: Variant, dt: f64) -> [f64; 3] {
    let movement = &golden.movements[name];
    let mut dmp = DiscreteDmp::new(model(variant, &movement.weights));
    dmp.start_at_velocity([&golden.start, &golden.velocity], &golden.goal, golden.duration).unwrap();
    let (mut steps, mut worst) = (0, [0.0_f64; 3]);
    for sample in &movement.samples {
        let until = (sample.t / dt).round() as usize;
        (steps..until).for_each(|_| dmp.step(dt));
        steps = until;
        for (worst, (found, expected)) in worst.iter_mut().zip([
            (dmp.position(), &sample.y),
            (dmp.velocity(), &sample.v),
            (dmp.acceleration(), &sample.a),
        ]) {
            *worst = worst.max(largest_difference(found, expected));
        }
    }
    worst
}

const VARIANTS: [(&str, Variant); 3] =
    [("classic", Variant::Classic), ("goal_safe", Variant::GoalSafe), ("quintic_goal", Variant::QuinticGoal)];

#[test]
fn every_variant_solves_its_equation() {
    let golden = golden();
    for (name, variant) in VARIANTS {
        let [position, velocity, acceleration] = errors(&golden, name, variant, 1e-3);
        assert!(position < 2e-6, "{name}: position off by {position}");
        assert!(velocity < 1e-5, "{name}: velocity off by {velocity}");
        assert!(acceleration < 2e-4, "{name}: acceleration off by {acceleration}");
    }
}

#[test]
fn integration_error_is_second_order() {
    let golden = golden();
    for (name, variant) in VARIANTS {
        let (coarse, fine) = (errors(&golden, name, variant, 1e-2), errors(&golden, name, variant, 1e-3));
        for (coarse, fine) in coarse.iter().zip(fine) {
            let ratio = coarse / fine;
            assert!(
                (80.0..125.0).contains(&ratio),
                "{name}: ten times the step gives {ratio} times the error"
            );
        }
    }
}

fn demonstration(fit: &Fit) -> Demonstration {
    Demonstration::with_derivatives(
        1.0,
        matrix(&fit.positions),
        matrix(&fit.velocities),
        matrix(&fit.accelerations),
    )
    .unwrap()
}

#[test]
fn ridge_weights_match_movement_primitives() {
    let fit = golden().fit;
    for (variant, expected) in [(Variant::Classic, &fit.classic), (Variant::GoalSafe, &fit.goal_safe)] {
        let ridge = Regression::Ridge { lambda: fit.lambda };
        let model = DmpModel::fit(settings(variant), &[demonstration(&fit)], ridge).unwrap();
        let expected = matrix(expected);
        let error = (model.weights() - &expected).amax() / expected.amax();
        assert!(error < 1e-9, "{variant:?}: relative error {error}");
    }
}

#[test]
fn locally_weighted_weights_match_the_formula() {
    let fit = golden().fit;
    let model =
        DmpModel::fit(settings(Variant::Classic), &[demonstration(&fit)], Regression::LocallyWeighted)
            .unwrap();
    let expected = matrix(&fit.classic_locally_weighted);
    assert!((model.weights() - &expected).amax() / expected.amax() < 1e-12);
}

#[test]
fn orientation_primitive_matches_the_reference() {
    let golden = golden().orientation;
    let mut dmp = OrientationDmp::new(model(Variant::Classic, &golden.weights)).unwrap();
    dmp.start(quaternion(golden.start_xyzw), quaternion(golden.goal_xyzw), golden.duration).unwrap();
    let mut steps = 0;
    for sample in golden.samples {
        let until = (sample.t * 1e4).round() as usize;
        (steps..until).for_each(|_| dmp.step(1e-4));
        steps = until;
        let expected = quaternion(sample.q_xyzw);
        let angle = (dmp.orientation() * expected.inverse()).imag().norm() * 2.0;
        assert!(angle < 1e-7, "at {} s the orientation is off by {angle} rad", sample.t);
        let omega = dmp.angular_velocity();
        assert!(largest_difference(omega.as_slice(), &sample.omega) < 1e-6, "at {} s: {omega}", sample.t);
    }
}
