//! Primitives learned from demonstrations reproduce them.

use motorium_primitives::dmp::{
    Demonstration, DiscreteDmp, DmpModel, FitError, OrientationDmp, Regression, Scaling, Settings, Variant,
    orientation_demonstration,
};
use nalgebra::{DMatrix, UnitQuaternion, Vector3};

const RIDGE: Regression = Regression::Ridge { lambda: 1e-12 };
const RESPONSE: Regression = Regression::Response { lambda: 1e-12 };

fn settings(variant: Variant) -> Settings {
    Settings { variant, ..Settings::default() }
}

/// A reach of `duration` seconds with a detour and a wiggle, moving at its start, at rest at its end.
fn curve(t: f64, duration: f64) -> [f64; 2] {
    let p = t / duration;
    let rest = (1.0 - p).powi(3);
    let x = 1.0 - rest - 0.4 * p * rest + 0.2 * (6.0 * p).sin() * rest;
    [x, 0.5 * (9.0 * p).sin() * p * rest - 0.3 * (1.0 - rest)]
}

fn recording(duration: f64, samples: usize) -> DMatrix<f64> {
    DMatrix::from_fn(samples, 2, |k, d| curve(duration * k as f64 / (samples - 1) as f64, duration)[d])
}

/// Root mean square of the distance between the movement of a model, started at the velocity of the curve,
/// and the curve.
fn reproduction_error(model: DmpModel, demonstration: &Demonstration) -> f64 {
    let duration = demonstration.duration();
    let row = |matrix: &DMatrix<f64>, k: usize| matrix.row(k).iter().copied().collect::<Vec<f64>>();
    let mut dmp = DiscreteDmp::new(model);
    dmp.start_at_velocity(
        [&row(demonstration.positions(), 0), &row(demonstration.velocities(), 0)],
        &row(demonstration.positions(), demonstration.samples() - 1),
        duration,
    )
    .unwrap();
    let mut squares = 0.0;
    for k in 1..=1000 {
        dmp.step(duration / 1000.0);
        let expected = curve(duration * f64::from(k) / 1000.0, duration);
        squares += (0..2).map(|d| (dmp.position()[d] - expected[d]).powi(2)).sum::<f64>();
    }
    (squares / 1000.0).sqrt()
}

#[test]
fn every_variant_and_fit_reproduces_the_demonstration() {
    let demonstration = Demonstration::from_positions(2.0, recording(2.0, 400)).unwrap();
    for variant in [Variant::Classic, Variant::GoalSafe, Variant::QuinticGoal] {
        for (regression, tolerance) in [(RIDGE, 1e-3), (RESPONSE, 3e-4), (Regression::LocallyWeighted, 0.1)] {
            let model =
                DmpModel::fit(settings(variant), std::slice::from_ref(&demonstration), regression).unwrap();
            let error = reproduction_error(model, &demonstration);
            assert!(error < tolerance, "{variant:?}, {regression:?}: {error}");
        }
    }
}

#[test]
fn ridge_and_more_kernels_reduce_the_fit_error() {
    let demonstration = Demonstration::from_positions(2.0, recording(2.0, 400)).unwrap();
    let error = |kernels, regression| {
        let settings = Settings { kernels, ..settings(Variant::Classic) };
        let model = DmpModel::fit(settings, std::slice::from_ref(&demonstration), regression).unwrap();
        reproduction_error(model, &demonstration)
    };
    assert!(error(20, RIDGE) < 0.3 * error(20, Regression::LocallyWeighted));
    assert!(error(40, RIDGE) < 0.3 * error(10, RIDGE));
}

#[test]
fn response_fit_tolerates_measurement_noise() {
    let clean = recording(2.0, 400);
    // +-0.5 mm from a linear congruential generator
    let mut state = 12_345_u64;
    let noisy = clean.map(|value| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        value + 1e-3 * ((state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5)
    });
    let demonstration = Demonstration::from_positions(2.0, noisy).unwrap();
    let fit = |regression| {
        let settings = settings(Variant::GoalSafe);
        let model = DmpModel::fit(settings, std::slice::from_ref(&demonstration), regression).unwrap();
        reproduction_error(model, &demonstration)
    };
    let (ridge, response) = (fit(RIDGE), fit(RESPONSE));
    assert!(response < 0.3 * ridge, "response {response}, ridge {ridge}");
}

#[test]
fn fitted_quintic_goal_arrives_on_time_and_settles() {
    let demonstration = Demonstration::from_positions(2.0, recording(2.0, 400)).unwrap();
    let model = DmpModel::fit(settings(Variant::QuinticGoal), &[demonstration], RIDGE).unwrap();
    let mut dmp = DiscreteDmp::new(model);
    dmp.start(&[0.3, 0.1], &[0.7, 0.9], 2.0).unwrap();
    let off = |dmp: &DiscreteDmp| (dmp.position()[0] - 0.7).abs().max((dmp.position()[1] - 0.9).abs());
    (0..2000).for_each(|_| dmp.step(1e-3));
    assert!(off(&dmp) < 1e-4, "{} at the end", off(&dmp));
    (0..1000).for_each(|_| dmp.step(1e-3));
    assert!(off(&dmp) < 1e-6, "{} half a duration later", off(&dmp));
}

/// Starts and ends accelerated: at `pi^2 / 2` per duration squared, and at its negative.
fn half_cosine(p: f64) -> f64 {
    0.5 * (1.0 - (std::f64::consts::PI * p).cos())
}

#[test]
fn demonstrated_half_cosine_is_followed_from_rest() {
    for variant in [Variant::QuinticGoal, Variant::FinalVelocity] {
        let shown = DMatrix::from_fn(401, 1, |k, _| half_cosine(k as f64 / 400.0));
        let demonstration = Demonstration::from_positions(2.0, shown).unwrap();
        for regression in [RIDGE, RESPONSE] {
            let model =
                DmpModel::fit(settings(variant), std::slice::from_ref(&demonstration), regression).unwrap();
            let mut dmp = DiscreteDmp::new(model);
            dmp.start(&[0.0], &[1.0], 2.0).unwrap();
            let mut worst = 0.0_f64;
            for k in 1..=2000 {
                dmp.step(1e-3);
                worst = worst.max((dmp.position()[0] - half_cosine(f64::from(k) / 2000.0)).abs());
            }
            assert!(worst < 1e-3, "{variant:?}, {regression:?}: {worst}");
        }
    }
}

#[test]
fn demonstrated_rotation_is_followed_from_rest() {
    let axis = Vector3::new(0.6, -0.3, 0.74).normalize();
    let turn = |p: f64| UnitQuaternion::from_scaled_axis(axis * (2.5 * half_cosine(p)));
    let shown: Vec<_> = (0..=400).map(|k| turn(f64::from(k) / 400.0)).collect();
    let demonstration = orientation_demonstration(2.0, &shown).unwrap();
    let model = DmpModel::fit(Settings::default(), &[demonstration], Regression::default()).unwrap();
    let mut dmp = OrientationDmp::new(model).unwrap();
    dmp.start(turn(0.0), turn(1.0), 2.0).unwrap();
    let mut worst = 0.0_f64;
    for k in 1..=2000 {
        dmp.step(1e-3);
        worst = worst.max(dmp.orientation().angle_to(&turn(f64::from(k) / 2000.0)));
    }
    assert!(worst < 3e-3, "{worst} rad");
}

#[test]
fn scaled_demonstrations_share_one_shape() {
    let scale = |factor: f64| {
        let positions = recording(2.0, 400).map(|value| factor * value);
        Demonstration::from_positions(2.0, positions).unwrap()
    };
    for scaling in [Scaling::Displacement { limit: 10.0 }, Scaling::Similarity { limit: 10.0 }] {
        let settings = Settings { scaling, ..settings(Variant::Classic) };
        let model = DmpModel::fit(settings, &[scale(0.5), scale(1.5), scale(2.5)], RIDGE).unwrap();
        // a reach that was not demonstrated
        let error = reproduction_error(model, &scale(1.0));
        assert!(error < 1e-3, "{scaling:?}: {error}");
    }
}

#[test]
fn rotated_demonstration_has_the_same_shape() {
    let positions = recording(2.0, 400);
    let turned = DMatrix::from_fn(400, 2, |k, d| [-positions[(k, 1)], positions[(k, 0)]][d]);
    let [straight, turned] =
        [positions, turned].map(|positions| Demonstration::from_positions(2.0, positions).unwrap());
    let settings =
        Settings { scaling: Scaling::Similarity { limit: 10.0 }, ..settings(Variant::QuinticGoal) };
    // the mean of two demonstrations a quarter turn apart lies between them, and is shorter
    let model = DmpModel::fit(settings, &[straight.clone(), turned.clone()], RIDGE).unwrap();
    assert!(reproduction_error(model, &straight) < 1e-3);
}

#[test]
fn invalid_fits_are_rejected() {
    let demonstration = Demonstration::from_positions(2.0, recording(2.0, 20)).unwrap();
    let one = [demonstration.clone()];
    let fit = |demonstrations: &[Demonstration], regression| {
        DmpModel::fit(settings(Variant::Classic), demonstrations, regression).unwrap_err()
    };
    assert_eq!(fit(&[], RIDGE), FitError::NoDemonstration);
    assert_eq!(fit(&one, Regression::Ridge { lambda: -1.0 }), FitError::Lambda { found: -1.0 });
    let error = fit(&one, Regression::Ridge { lambda: 0.0 });
    assert_eq!(error, FitError::Undetermined { samples: 20, kernels: 30 });
    let single = Demonstration::from_positions(1.0, DMatrix::zeros(5, 1)).unwrap();
    let error = fit(&[demonstration, single], RIDGE);
    assert_eq!(error, FitError::Dimensions { index: 1, found: 1, expected: 2 });
}
