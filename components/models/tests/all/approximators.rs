//! Tests of the common interface of models.

use motorium_models::approximator::{Approximator, CLASSES, LatentMap};
use motorium_models::gp::{GaussianProcess, GpError};
use motorium_models::gplvm::{LatentModel, Settings, SpaceData};
use motorium_models::kernel::Kernel;

fn rows(n: usize, d: usize, phase: f64) -> Vec<f64> {
    (0..n * d).map(|i| (0.4 * (i / d) as f64 + 1.1 * (i % d) as f64 + phase).sin()).collect()
}

/// Checks that new parameters change the prediction, and that the old parameters restore it.
fn check<M: Approximator>(model: &mut M)
where
    M::Error: std::fmt::Debug,
{
    let x = rows(1, model.inputs(), 0.77);
    let predict = |model: &mut M| {
        let (mut mean, mut variance) = (vec![0.0; model.outputs()], vec![0.0; model.outputs()]);
        assert!(model.predict_with_variance(&x, &mut mean, &mut variance));
        assert!(variance.iter().all(|v| *v > 0.0));
        let mut alone = vec![0.0; model.outputs()];
        model.predict(&x, &mut alone);
        assert_eq!(alone, mean);
        (mean, variance)
    };
    let (before, parameters) = (predict(model), model.parameters());
    let moved: Vec<f64> = parameters.iter().map(|p| p + 0.3).collect();
    model.set_parameters(&moved).expect("parameters");
    assert!(model.parameters().iter().zip(&moved).all(|(a, b)| (a - b).abs() < 1e-12));
    assert_ne!(predict(model), before);
    model.set_parameters(&parameters).expect("parameters");
    let after = predict(model);
    assert!(after.0.iter().zip(&before.0).all(|(a, b)| (a - b).abs() < 1e-9), "{after:?} {before:?}");
    assert!(model.set_parameters(&parameters[1..]).is_err());
    assert!(CLASSES.contains(&model.class()));
}

#[test]
fn models_accept_parameters_as_a_vector() {
    let mut process =
        GaussianProcess::new(Kernel::matern52(2, 1.0), 0.05, &rows(30, 2, 0.1), 2, &rows(30, 3, 0.6), 3)
            .expect("a process");
    check(&mut process);
    let error = Approximator::set_parameters(&mut process, &[0.0, f64::NAN, 0.0, 0.0]).expect_err("NaN");
    assert!(matches!(error, GpError::NotFinite { index: 1, .. }), "{error}");
    let names = |d: usize| (0..d).map(|c| format!("c{c}")).collect::<Vec<_>>();
    let (human, robot) = (rows(30, 4, 0.2), rows(30, 3, 0.9));
    let data = [
        SpaceData { name: "human", columns: names(4), values: &human },
        SpaceData { name: "robot", columns: names(3), values: &robot },
    ];
    let settings = Settings { iterations: 20, ..Settings::default() };
    let model = LatentModel::train(&data, &settings).expect("a model").0;
    assert!(LatentMap::new(model.clone(), "human", "centaur").is_err());
    check(&mut LatentMap::new(model, "human", "robot").expect("a map"));
}

#[test]
fn classes_have_different_names() {
    let mut names: Vec<&str> = CLASSES.iter().map(|class| class.name).collect();
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), CLASSES.len());
}
