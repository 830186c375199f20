//! Probabilistic models against scikit-learn, scipy and movement_primitives: see
//! `golden/generate_probabilistic.py`.

use motorium_primitives::ValueError;
use motorium_primitives::gmm::{Gmm, GmmError, GmmFit, Gmr};
use motorium_primitives::kmp::{Kmp, KmpError, KmpReference, KmpSettings, ReferencePoint};
use motorium_primitives::promp::{
    Learning, Observed, ProMp, ProMpBasis, ProMpError, ProMpFit, ProMpRunner, blend,
};
use motorium_primitives::regression::{PolynomialPolicy, RegressionError};
use nalgebra::{DMatrix, DVector};
use serde_json::Value as Json;

fn golden(part: &str) -> Json {
    serde_json::from_str::<Json>(include_str!("../golden/probabilistic.json")).unwrap()[part].take()
}

fn number(value: &Json) -> f64 {
    value.as_f64().unwrap()
}

fn numbers(value: &Json) -> Vec<f64> {
    value.as_array().unwrap().iter().map(number).collect()
}

fn vector(value: &Json) -> DVector<f64> {
    DVector::from_vec(numbers(value))
}

fn matrix(value: &Json) -> DMatrix<f64> {
    let rows: Vec<Vec<f64>> = value.as_array().unwrap().iter().map(numbers).collect();
    DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j])
}

fn matrices(value: &Json) -> Vec<DMatrix<f64>> {
    value.as_array().unwrap().iter().map(matrix).collect()
}

fn vectors(value: &Json) -> Vec<DVector<f64>> {
    value.as_array().unwrap().iter().map(vector).collect()
}

#[test]
fn mixture_fit_matches_scikit_learn() {
    let golden = golden("gmm");
    let samples = matrix(&golden["samples"]);
    let start =
        Gmm::new(vec![1.0; 3], vectors(&golden["start_means"]), vec![DMatrix::identity(3, 3); 3]).unwrap();
    let fit = GmmFit { iterations: 500, tolerance: 1e-12, ..GmmFit::default() };
    let fitted = start.improved(&samples, &fit).unwrap();
    assert!(fitted.converged);
    let gmm = &fitted.gmm;
    for k in 0..3 {
        assert!((gmm.weights()[k] - golden["weights"][k].as_f64().unwrap()).abs() < 1e-6);
        assert!((&gmm.means()[k] - vector(&golden["means"][k])).amax() < 1e-5);
        assert!((&gmm.covariances()[k] - matrix(&golden["covariances"][k])).amax() < 1e-5);
    }
    assert!((gmm.log_likelihood(&samples).unwrap() - number(&golden["log_likelihood"])).abs() < 1e-5);
    assert!((gmm.bic(&samples).unwrap() - number(&golden["bic"])).abs() < 1e-5);
}

#[test]
fn mixture_finds_three_clusters_and_bic_chooses_three() {
    let golden = golden("gmm");
    let samples = matrix(&golden["samples"]);
    let fitted = Gmm::choose(&samples, 1..=4, &GmmFit::default()).unwrap();
    assert_eq!(fitted.gmm.components(), 3);
    assert!((fitted.log_likelihood - number(&golden["log_likelihood"])).abs() < 1e-2);
    let again = Gmm::choose(&samples, 1..=4, &GmmFit::default()).unwrap();
    assert_eq!(again, fitted, "the same seed finds the same mixture");
}

#[test]
fn floor_prevents_collapse_onto_a_sample() {
    let mut samples = DMatrix::from_element(30, 2, 1.0);
    samples[(7, 0)] = 5.0;
    let fitted = Gmm::fit(&samples, 2, &GmmFit::default()).unwrap();
    for covariance in fitted.gmm.covariances() {
        assert!(covariance.determinant() > 0.0 && covariance.iter().all(|value| value.is_finite()));
    }
    let error = Gmm::fit(&samples.rows(0, 2).into_owned(), 3, &GmmFit::default()).unwrap_err();
    assert_eq!(error, GmmError::TooFew { samples: 2, components: 3 });
    samples[(3, 1)] = f64::NAN;
    assert!(
        Gmm::fit(&samples, 2, &GmmFit::default()).unwrap_err().to_string().contains("sample 3 contains NaN")
    );
}

#[test]
fn regression_matches_the_formula() {
    let golden = golden("gmm");
    let weights = numbers(&golden["weights"]);
    let gmm = Gmm::new(weights, vectors(&golden["means"]), matrices(&golden["covariances"])).unwrap();
    let mut gmr = Gmr::new(&gmm, 1).unwrap();
    for expected in golden["predictions"].as_array().unwrap() {
        let (mean, covariance) = gmr.predict(&[number(&expected["x"])]).unwrap();
        assert!((mean - vector(&expected["mean"])).amax() < 1e-10);
        assert!((covariance - matrix(&expected["covariance"])).amax() < 1e-10);
    }
    let (mean, _) = gmr.predict(&[1e3]).unwrap();
    assert!(mean.iter().all(|value| value.is_finite()), "far from all components the result is finite");
    assert!(Gmr::new(&gmm, 3).is_err() && Gmr::new(&gmm, 0).is_err());
}

fn reference() -> (KmpReference, f64, Json) {
    let golden = golden("kmp");
    let inputs = numbers(&golden["inputs"]);
    let points = inputs
        .iter()
        .zip(vectors(&golden["means"]))
        .zip(matrices(&golden["covariances"]))
        .map(|((input, mean), covariance)| ReferencePoint {
            input: DVector::from_element(1, *input),
            mean,
            covariance,
        })
        .collect();
    (KmpReference::new(points).unwrap(), number(&golden["length"]), golden)
}

#[test]
fn kernelised_primitive_matches_the_formula() {
    let (reference, length, golden) = reference();
    let mut kmp = Kmp::new(&reference, KmpSettings { length, ..KmpSettings::default() }).unwrap();
    for expected in golden["answers"].as_array().unwrap() {
        let s = [number(&expected["s"])];
        assert!((kmp.mean(&s).unwrap() - vector(&expected["mean"])).amax() < 1e-9);
        assert!((kmp.covariance(&s).unwrap() - matrix(&expected["covariance"])).amax() < 1e-9);
    }
}

#[test]
fn smaller_variance_passes_via_points_more_closely() {
    let (reference, length, _) = reference();
    let settings = KmpSettings { length, ..KmpSettings::default() };
    let wanted = DVector::from_vec(vec![0.2, 0.9]);
    let missed = |variance: f64| {
        let mut reference = reference.clone();
        let covariance = DMatrix::identity(2, 2) * variance;
        let input = DVector::from_element(1, 0.47);
        reference.insert(ReferencePoint { input, mean: wanted.clone(), covariance }, 1e-3).unwrap();
        assert_eq!(reference.points().len(), 13);
        (Kmp::new(&reference, settings).unwrap().mean(&[0.47]).unwrap() - &wanted).norm()
    };
    assert!(missed(1e-6) < 1e-3 && missed(1e-2) > missed(1e-6) && missed(1.0) > 0.3);
    let mut replaced = reference.clone();
    let point = ReferencePoint { input: DVector::from_element(1, 1e-4), ..reference.points()[0].clone() };
    replaced.insert(point, 1e-3).unwrap();
    assert_eq!(replaced.points().len(), 12, "it replaces a nearby point of the reference");
}

/// The product of two Gaussians of one dimension: precisions add up.
#[test]
fn references_superpose_by_their_priorities() {
    let point = |mean: f64, variance: f64| ReferencePoint {
        input: DVector::from_element(1, 0.0),
        mean: DVector::from_element(1, mean),
        covariance: DMatrix::from_element(1, 1, variance),
    };
    let (a, b) = (KmpReference::new(vec![point(1.0, 0.5)]), KmpReference::new(vec![point(4.0, 0.25)]));
    let (a, b) = (a.unwrap(), b.unwrap());
    let both = KmpReference::superposed(&[&a, &b], &DMatrix::from_column_slice(2, 1, &[0.5, 2.0])).unwrap();
    let precision = 0.5 / 0.5 + 2.0 / 0.25;
    assert!((both.points()[0].covariance[(0, 0)] - 1.0 / precision).abs() < 1e-14);
    assert!((both.points()[0].mean[0] - (1.0 * 1.0 + 8.0 * 4.0) / precision).abs() < 1e-14);
    let none = KmpReference::superposed(&[&a, &b], &DMatrix::zeros(2, 1)).unwrap_err();
    assert_eq!(none, KmpError::NotPositive { point: 0 });
}

fn primitive() -> (ProMp, Json) {
    let golden = golden("promp");
    let basis = ProMpBasis::gaussian(8, 0.7).unwrap();
    let promp =
        ProMp::from_weights(basis, 2, vector(&golden["mean"]), matrix(&golden["covariance"])).unwrap();
    (promp, golden)
}

#[test]
fn mean_and_variance_match_movement_primitives() {
    let (promp, golden) = primitive();
    for (k, phase) in numbers(&golden["phases"]).into_iter().enumerate() {
        assert!((promp.mean_at(phase) - vector(&golden["positions"][k])).amax() < 1e-12);
        let variances = promp.covariance_at(phase).diagonal();
        assert!((variances - vector(&golden["variances"][k])).amax() < 1e-12);
    }
}

#[test]
fn via_point_matches_movement_primitives() {
    let (promp, golden) = primitive();
    let place = DVector::from_vec(vec![0.4, -0.7]);
    let noise = DMatrix::from_diagonal(&DVector::from_vec(vec![1e-3, 2e-3]));
    let bent = promp.conditioned(0.35, &place, &noise).unwrap();
    // up to the jitter of 1e-8 of the variance
    assert!((bent.weight_mean() - vector(&golden["bent_mean"])).amax() < 1e-5);
    assert!((bent.weight_covariance() - matrix(&golden["bent_covariance"])).amax() < 1e-5);
}

#[test]
fn exact_conditions_leave_no_variance() {
    let (promp, _) = primitive();
    let (place, rate) = (DVector::from_vec(vec![1.0, 2.0]), DVector::from_vec(vec![-3.0, 0.5]));
    let exact = DMatrix::zeros(2, 2);
    let bent = promp
        .conditioned(0.5, &place, &exact)
        .and_then(|bent| bent.conditioned_on(Observed::Velocity, 0.5, &rate, &exact))
        .unwrap();
    assert!((bent.mean_at(0.5) - place).amax() < 1e-6);
    assert!((bent.mean_velocity_at(0.5) - rate).amax() < 1e-5);
    assert!(bent.covariance_at(0.5).amax() < 1e-6 * promp.covariance_at(0.5).amax());
    let wrong = promp.conditioned(0.5, &DVector::zeros(3), &exact);
    assert!(matches!(wrong, Err(ProMpError::Value(ValueError::Size { found: 3, expected: 2, .. }))));
}

#[test]
fn expectation_maximisation_matches_numpy() {
    let (_, golden) = primitive();
    let shown = matrices(&golden["shown"]);
    let basis = ProMpBasis::gaussian(8, 0.7).unwrap();
    let fit =
        ProMpFit { learning: Learning::Em { iterations: 20, tolerance: 0.0 }, jitter: 1e-6, shrinkage: 0.0 };
    let mut reported = Vec::new();
    let promp = ProMp::fit_with_progress(basis, &shown, &fit, |part| reported.push(part)).unwrap();
    assert!((promp.weight_mean() - vector(&golden["em_mean"])).amax() < 1e-6);
    assert!((promp.weight_covariance() - matrix(&golden["em_covariance"])).amax() < 1e-5);
    assert!((promp.noise() / number(&golden["em_noise"]) - 1.0).abs() < 1e-5);
    assert!(reported.windows(2).all(|pair| pair[0] <= pair[1]) && reported.last() == Some(&1.0));
    // the reference is evaluated by scipy: the likelihood never decreases
    let likelihood = numbers(&golden["em_likelihood"]);
    assert!(likelihood.windows(2).all(|pair| pair[1] > pair[0] - 1e-2), "{likelihood:?}");
    assert!((promp.noise().sqrt() - 0.05).abs() < 0.01, "the noise of the data: {}", promp.noise().sqrt());
}

#[test]
fn shrinkage_matches_numpy() {
    let (_, golden) = primitive();
    let basis = ProMpBasis::gaussian(8, 0.7).unwrap();
    let shown = matrices(&golden["shown"]);
    let learning = Learning::Em { iterations: 20, tolerance: 0.0 };
    let fit = ProMpFit { learning, jitter: 1e-6, shrinkage: 3.0 };
    let promp = ProMp::fit(basis, &shown, &fit).unwrap();
    assert!((promp.weight_mean() - vector(&golden["shrunk_mean"])).amax() < 1e-6);
    assert!((promp.weight_covariance() - matrix(&golden["shrunk_covariance"])).amax() < 1e-5);
    assert!((promp.noise() / number(&golden["shrunk_noise"]) - 1.0).abs() < 1e-5);
    let refused = ProMp::fit(basis, &shown, &ProMpFit { shrinkage: -1.0, ..fit }).unwrap_err();
    let ProMpError::Value(ValueError::OutOfRange { name, value, .. }) = refused else { panic!("{refused}") };
    assert_eq!((name, value), ("shrinkage", -1.0));
}

/// Returns a stroke with three dimensions. The starts nearly lie in a plane; all strokes share one goal.
fn stroke(start: [f64; 3]) -> DMatrix<f64> {
    DMatrix::from_fn(100, 3, |k, d| {
        let p = k as f64 / 99.0;
        let ease = p * p * p * (10.0 - 15.0 * p + 6.0 * p * p);
        start[d] * (1.0 - ease) + [0.5, 0.1, 0.3][d] * ease
    })
}

#[test]
fn shrinkage_reaches_starts_outside_the_shown_plane() {
    let shown = [[0.02, -0.03], [-0.03, -0.01], [0.01, 0.02], [0.03, 0.03], [-0.02, 0.01]];
    let shown: Vec<DMatrix<f64>> = shown
        .iter()
        .enumerate()
        .map(|(k, [x, y])| stroke([*x, *y, 0.5 * (x + y) + 5e-4 * (k as f64 - 2.0)]))
        .collect();
    let basis = ProMpBasis::gaussian(20, 0.7).unwrap();
    let start = [0.0, 0.01, 0.03];
    let noise = DMatrix::identity(3, 3) * 2e-3_f64.powi(2);
    let missed = |shrinkage: f64| {
        let promp = ProMp::fit(basis, &shown, &ProMpFit { shrinkage, ..ProMpFit::default() }).unwrap();
        let bent = promp.conditioned(0.0, &DVector::from_column_slice(&start), &noise).unwrap();
        let expected = stroke(start);
        let off = |k: usize| (bent.mean_at(k as f64 / 99.0) - expected.row(k).transpose()).norm();
        (off(0), (0..100).map(off).fold(0.0, f64::max))
    };
    let (likely, shrunk) = (missed(0.0), missed(ProMpFit::default().shrinkage));
    assert!(likely.0 > 0.01, "maximum likelihood misses by {likely:?} m");
    assert!(shrunk.0 < 2e-3 && shrunk.1 < 5e-3, "shrunk {shrunk:?} m, maximum likelihood {likely:?} m");
}

#[test]
fn both_estimators_reproduce_the_demonstrated_mean() {
    let curve = |p: f64, n: usize| (4.0 * p).sin() + 0.2 * n as f64 * p * (1.0 - p);
    let shown: Vec<DMatrix<f64>> = (0..5)
        .map(|n| {
            let samples = 40 + 10 * (n % 2);
            DMatrix::from_fn(samples, 1, |k, _| curve(k as f64 / (samples - 1) as f64, n))
        })
        .collect();
    for learning in [Learning::Ridge { lambda: 1e-8 }, ProMpFit::default().learning] {
        let basis = ProMpBasis::gaussian(12, 0.7).unwrap();
        let promp = ProMp::fit(basis, &shown, &ProMpFit { learning, ..ProMpFit::default() }).unwrap();
        for k in 0..=10 {
            let p = f64::from(k) / 10.0;
            assert!((promp.mean_at(p)[0] - curve(p, 2)).abs() < 0.03, "{learning:?} at {p}");
            // the sample variance of five is 0.04 * 2.5 (p (1 - p))^2, the population variance has a factor
            // of 2
            let spread = 0.04 * (p * (1.0 - p)).powi(2);
            let variance = promp.covariance_at(p)[(0, 0)];
            assert!(
                variance > 1.8 * spread - 1e-4 && variance < 2.7 * spread + 1e-3,
                "{learning:?} {variance}"
            );
        }
    }
    let one = ProMp::fit(ProMpBasis::gaussian(5, 0.7).unwrap(), &shown[..1], &ProMpFit::default());
    assert_eq!(one.unwrap_err(), ProMpError::TooFew { found: 1 });
}

#[test]
fn product_and_blend_combine_primitives() {
    let (promp, _) = primitive();
    let exact = DMatrix::identity(2, 2) * 1e-4;
    let (early, late) = (DVector::from_vec(vec![1.0, 1.0]), DVector::from_vec(vec![-1.0, 0.0]));
    let a = promp.conditioned(0.1, &early, &exact).unwrap();
    let b = promp.conditioned(0.9, &late, &exact).unwrap();
    let both = ProMp::product(&[(&a, 1.0), (&b, 1.0)]).unwrap();
    assert!((both.mean_at(0.1) - &early).amax() < 0.02 && (both.mean_at(0.9) - &late).amax() < 0.02);
    // the product of a primitive with itself has half its variance
    let twice = ProMp::product(&[(&promp, 1.0), (&promp, 1.0)]).unwrap();
    assert!((twice.weight_mean() - promp.weight_mean()).amax() < 1e-7);
    assert!((twice.weight_covariance() * 2.0 - promp.weight_covariance()).amax() < 1e-7);
    for (activation, expected) in [(1.0, a.mean_at(0.4)), (0.0, b.mean_at(0.4))] {
        let (mean, _) = blend(&[(&a, activation), (&b, 1.0 - activation)], 0.4).unwrap();
        assert!((mean - expected).amax() < 1e-6);
    }
    let other = ProMp::from_weights(
        ProMpBasis::gaussian(3, 0.7).unwrap(),
        2,
        DVector::zeros(6),
        DMatrix::identity(6, 6),
    )
    .unwrap();
    assert_eq!(ProMp::product(&[(&a, 1.0), (&other, 1.0)]).unwrap_err(), ProMpError::Different);
}

#[test]
fn sampled_movements_have_the_model_covariance() {
    let (promp, _) = primitive();
    // the mean over plus and minus each axis of the normal numbers gives the covariance exactly
    let n = promp.weight_mean().len();
    let mut covariance = DMatrix::zeros(n, n);
    for i in 0..n {
        let mut normal = DVector::zeros(n);
        normal[i] = 1.0;
        let off = promp.sample_weights(&normal).unwrap() - promp.weight_mean();
        covariance += &off * off.transpose();
    }
    assert!((covariance - promp.weight_covariance()).amax() < 1e-8);
}

#[test]
fn runner_starts_without_a_jump_and_ends_at_the_mean() {
    let (promp, _) = primitive();
    let mut runner = ProMpRunner::new(promp.clone().into());
    runner.start(&[5.0, -5.0], &[0.3, -0.2], 2.0).unwrap();
    assert!((runner.position()[0] - 5.0).abs() < 1e-12 && (runner.velocity()[1] + 0.2).abs() < 1e-12);
    let mut before = runner.position().to_vec();
    for k in 1..=2000 {
        runner.step(1e-3);
        for (now, (before, velocity)) in runner.position().iter().zip(before.iter().zip(runner.velocity())) {
            let slope = (now - before) / 1e-3;
            assert!((slope - velocity).abs() < 0.3, "step {k}: {slope} {velocity}");
        }
        before.copy_from_slice(runner.position());
        if k > 700 && k < 2000 {
            let expected = promp.mean_at(f64::from(k) / 2000.0);
            assert!((runner.position()[0] - expected[0]).abs() < 1e-9);
        }
    }
    assert!(runner.is_over());
    let text = serde_json::to_string(&promp).unwrap();
    let back: ProMp = serde_json::from_str(&text).unwrap();
    assert!((back.weight_covariance() - promp.weight_covariance()).amax() < 1e-14);
}

#[test]
fn polynomial_coefficients_match_scikit_learn() {
    let golden = golden("polynomial");
    let (x, y) = (matrix(&golden["x"]), matrix(&golden["y"]));
    let cubic = PolynomialPolicy::fit(&x, &y, 3, 0.0).unwrap();
    assert!((cubic.weights() - matrix(&golden["cubic"])).amax() < 1e-9);
    let linear = PolynomialPolicy::fit(&x, &y, 1, 0.1).unwrap();
    let expected = matrix(&golden["linear_ridge"]);
    assert!((linear.weights() - &expected).amax() < 1e-9, "{}", linear.weights() - expected);
    let mut action = [0.0; 2];
    let mut linear = linear;
    linear.act(&[0.5, -1.0], &mut action).unwrap();
    let w = linear.weights();
    assert!((action[0] - (w[(0, 0)] + 0.5 * w[(1, 0)] - w[(2, 0)])).abs() < 1e-15);
    let error = PolynomialPolicy::fit(&x.rows(0, 5).into_owned(), &y.rows(0, 5).into_owned(), 3, 0.0);
    assert_eq!(error.unwrap_err(), RegressionError::Undetermined { samples: 5, monomials: 10 });
}
