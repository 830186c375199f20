//! Movements over the phase, fitted to demonstrations: kernelised and polynomial.

use motorium_primitives::file::{Primitive, PrimitiveFile};
use motorium_primitives::kmp::{KernelisedFit, KernelisedMovement};
use motorium_primitives::mean::{MeanMovement, MeanRunner};
use motorium_primitives::regression::PolynomialMovement;
use motorium_primitives::rollout::{Override, RolloutError, ViaPoint, roll_out};
use nalgebra::{DMatrix, DVector};

/// Returns five waves in a plane with different amplitudes.
fn shown() -> Vec<DMatrix<f64>> {
    let wave = |amplitude: f64| {
        DMatrix::from_fn(100, 2, |k, d| {
            let p = k as f64 / 99.0;
            if d == 0 { amplitude * (6.0 * p).sin() } else { p * p }
        })
    };
    [0.9, 0.95, 1.0, 1.05, 1.1].map(wave).to_vec()
}

#[test]
fn kernelised_mean_matches_the_demonstrations() {
    let movement = KernelisedMovement::fit(&shown(), 2.0, &KernelisedFit::default()).unwrap();
    let mut kmp = movement.kmp().unwrap();
    for k in 0..=40 {
        let p = f64::from(k) / 40.0;
        let mean = kmp.mean(&[p]).unwrap();
        let expected = [(6.0 * p).sin(), p * p];
        let error = (mean[0] - expected[0]).abs().max((mean[1] - expected[1]).abs());
        assert!(error < 0.03, "{error} at phase {p}");
    }
    // The covariance is larger where the waves differ.
    let sure = |p: f64| kmp.covariance(&[p]).unwrap()[(0, 0)];
    assert!(sure(std::f64::consts::FRAC_PI_2 / 6.0) > 1.5 * sure(std::f64::consts::PI / 6.0));
}

#[test]
fn slopes_of_means_match_their_derivatives() {
    let kernelised = KernelisedMovement::fit(&shown(), 2.0, &KernelisedFit::default()).unwrap();
    let polynomial = PolynomialMovement::fit(&shown(), 2.0, 7, 1e-12).unwrap();
    let means: [Box<dyn MeanMovement>; 2] = [Box::new(kernelised.running().unwrap()), Box::new(polynomial)];
    for mut mean in means {
        let mut at = |p: f64| {
            let mut values = ([0.0; 2], [0.0; 2]);
            mean.mean_into(p, &mut values.0, &mut values.1);
            values
        };
        let h = 1e-6;
        for k in 1..20 {
            let p = f64::from(k) / 20.0;
            let (before, (_, slope), after) = (at(p - h), at(p), at(p + h));
            for d in 0..2 {
                let difference = (after.0[d] - before.0[d]) / (2.0 * h);
                assert!(
                    (difference - slope[d]).abs() < 1e-4 * (1.0 + slope[d].abs()),
                    "{difference} {slope:?}"
                );
            }
        }
    }
}

#[test]
fn polynomial_movement_recovers_the_polynomial() {
    let shown = DMatrix::from_fn(60, 1, |k, _| {
        let p = k as f64 / 59.0;
        1.0 - 3.0 * p + 2.0 * p.powi(3)
    });
    let movement = PolynomialMovement::fit(&[shown], 1.5, 3, 0.0).unwrap();
    let expected = [1.0, -3.0, 0.0, 2.0];
    let found = movement.weights();
    assert!(found.iter().zip(expected).all(|(w, e)| (w - e).abs() < 1e-9), "{found}");
    let file = PrimitiveFile::polynomial(vec!["x".into()], movement);
    assert!((file.start_velocity[0] + 3.0 / 1.5).abs() < 1e-9 && (file.goal[0]).abs() < 1e-9);
    let refused = roll_out(&file, &Override { goal: Some(vec![1.0]), ..Override::default() }, 0.1);
    assert!(matches!(refused, Err(RolloutError::Override { kind: "polynomial", .. })));
}

#[test]
fn movements_survive_files_and_pass_via_points() {
    let path = std::env::temp_dir().join(format!("motorium-means-{}.json", std::process::id()));
    let movement = KernelisedMovement::fit(&shown(), 2.0, &KernelisedFit::default()).unwrap();
    let names = vec!["x".to_string(), "y".to_string()];
    PrimitiveFile::kernelised(names.clone(), movement).unwrap().write(&path).unwrap();
    let file = PrimitiveFile::read(&path).unwrap();
    assert_eq!(file.primitive.kind(), "kernelised");
    let via = ViaPoint { phase: 0.4, position: vec![0.75, 0.16], deviation: 1e-3 };
    let bent = Override { goal: Some(vec![-0.3, 1.0]), via: vec![via], ..Override::default() };
    let trajectory = roll_out(&file, &bent, 0.01).unwrap();
    let at = |k: usize, place: [f64; 2]| {
        (0..2).map(|d| (trajectory.position[k][d] - place[d]).abs()).fold(0.0, f64::max)
    };
    assert!(
        at(80, [0.75, 0.16]) < 5e-3 && at(200, [-0.3, 1.0]) < 5e-3,
        "{} {}",
        at(80, [0.75, 0.16]),
        at(200, [-0.3, 1.0])
    );
    assert!(trajectory.deviation.unwrap()[80][0] < 0.02);

    let polynomial = PolynomialMovement::fit(&shown(), 2.0, 6, 1e-9).unwrap();
    PrimitiveFile::polynomial(names, polynomial.clone()).write(&path).unwrap();
    let Primitive::Polynomial(read) = PrimitiveFile::read(&path).unwrap().primitive else { panic!() };
    assert_eq!(read, polynomial);
    let broken = std::fs::read_to_string(&path).unwrap().replacen("\"weights\":[[", "\"weights\":[[0.0,", 1);
    std::fs::write(&path, broken).unwrap();
    let error = PrimitiveFile::read(&path).unwrap_err().to_string();
    assert!(error.contains("a dimension of weights has 7 entries, expected 8"), "{error}");
    std::fs::remove_file(&path).unwrap();
}

#[test]
fn mean_runner_joins_the_mean_without_a_jump() {
    let movement = KernelisedMovement::fit(&shown(), 2.0, &KernelisedFit::default()).unwrap();
    let mut kmp = movement.kmp().unwrap();
    let mut runner = MeanRunner::new(movement.running().unwrap());
    runner.start(&[0.5, -0.2], &[0.0, 0.0], 4.0).unwrap();
    let mut before = [0.5, -0.2];
    while !runner.is_over() {
        runner.step(1e-3);
        for (d, before) in before.iter_mut().enumerate() {
            let step = runner.position()[d] - *before;
            assert!((step - 1e-3 * runner.velocity()[d]).abs() < 1e-5, "a jump of {step}");
            *before = runner.position()[d];
        }
        if runner.progress() > 0.31 {
            let mean: &DVector<f64> = kmp.mean(&[runner.progress().min(1.0)]).unwrap();
            assert!((runner.position()[0] - mean[0]).abs() < 1e-9);
        }
    }
}
