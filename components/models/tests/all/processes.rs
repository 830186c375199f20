//! Gaussian processes compared with GPy and scikit-learn.

use motorium_models::gp::{GaussianProcess, GpError};
use motorium_models::kernel::{Kernel, Stationary};
use motorium_models::optimise::Options;
use serde_json::Value;

use crate::golden::{assert_close, numbers, read};

fn kernel(name: &str) -> Kernel {
    let s = |variance, lengths: &[f64]| Stationary::new(variance, lengths);
    match name {
        "rbf" => Kernel::Rbf(s(1.7, &[0.8, 1.3])),
        "matern32" => Kernel::Matern32(s(1.7, &[0.8, 1.3])),
        "matern52" => Kernel::Matern52(s(1.7, &[0.8, 1.3])),
        "isotropic" => Kernel::Matern52(s(0.9, &[0.6])),
        "periodic" => Kernel::Periodic { scales: s(1.2, &[0.9, 1.1]), period: 2.3 },
        "linear" => Kernel::Sum(vec![Kernel::Linear(vec![0.5, 0.8]), Kernel::Bias(0.3)]),
        "white" => Kernel::Sum(vec![Kernel::Rbf(s(1.1, &[0.7])), Kernel::White(0.2)]),
        "product" => Kernel::Sum(vec![
            Kernel::Product(vec![Kernel::Rbf(s(1.1, &[0.7, 0.9])), Kernel::Linear(vec![0.5, 0.8])]),
            Kernel::Matern32(s(0.4, &[1.5])),
        ]),
        other => panic!("unknown case {other}"),
    }
}

fn process(golden: &Value, kernel: Kernel) -> GaussianProcess {
    let (x, y) = (numbers(&golden["x"]), numbers(&golden["y"]));
    GaussianProcess::new(kernel, 0.05, &x, 2, &y, 2).expect("a process")
}

#[test]
fn energies_gradients_and_predictions_equal_gpy() {
    let golden = read("gp.json");
    let cases = golden["cases"].as_object().expect("cases");
    assert_eq!(cases.len(), 8);
    for (name, case) in cases {
        let gp = process(&golden, kernel(name));
        let parameters = gp.parameters();
        assert_close(&parameters, &numbers(&case["parameters"]), 1e-12, name);
        let mut gradient = vec![0.0; parameters.len()];
        let energy = gp.energy(&parameters, &mut gradient).expect("an energy");
        assert_close(&[energy], &numbers(&case["energy"]), 1e-8, name);
        assert_close(&gradient, &numbers(&case["gradient"]), 1e-8, name);
        let query = numbers(&golden["query"]);
        let (mut scratch, mut means, mut variances) = (gp.scratch(), vec![], vec![]);
        for x in query.chunks(2) {
            let mut mean = [0.0; 2];
            variances.push(gp.predict(x, &mut mean, &mut scratch));
            means.extend(mean);
        }
        assert_close(&means, &numbers(&case["mean"]), 1e-8, name);
        assert_close(&variances, &numbers(&case["variance"]), 1e-8, name);
    }
}

#[test]
fn fitted_hyperparameters_equal_scikit_learn() {
    let golden = read("gp.json");
    let (x, y) = (numbers(&golden["x"]), numbers(&golden["y"]));
    let y: Vec<f64> = y.iter().step_by(2).copied().collect();
    let mut gp = GaussianProcess::new(Kernel::matern52(2, 1.0), 0.1, &x, 2, &y, 1).expect("a process");
    let options = Options { iterations: 300, improvement: 0.0, gradient: 1e-7, ..Options::default() };
    let found = gp.optimise(&options).expect("a fit");
    assert_close(&[found.value], &numbers(&golden["fitted"]["energy"]), 1e-6, "energy");
    let mut mean = [0.0];
    let mut scratch = gp.scratch();
    let query = numbers(&golden["query"]);
    for (i, x) in query.chunks(2).enumerate() {
        let variance = gp.predict(x, &mut mean, &mut scratch);
        assert_close(&mean, &[numbers(&golden["fitted"]["mean"])[i]], 1e-3, "mean");
        // scikit-learn's variance includes its noise
        assert_close(&[variance], &[numbers(&golden["fitted"]["variance"])[i]], 1e-3, "variance");
    }
}

#[test]
fn added_and_removed_points_equal_a_new_process() {
    let golden = read("gp.json");
    let (x, y) = (numbers(&golden["x"]), numbers(&golden["y"]));
    let mut grown = GaussianProcess::new(kernel("product"), 0.05, &x[..4], 2, &y[..4], 2).expect("a process");
    for (x, y) in x.chunks(2).zip(y.chunks(2)).skip(2) {
        grown.push(x, y).expect("a point");
    }
    let whole = process(&golden, kernel("product"));
    let predict = |gp: &GaussianProcess| {
        let mut mean = [0.0; 2];
        let variance = gp.predict(&[0.3, -0.2], &mut mean, &mut gp.scratch());
        [mean[0], mean[1], variance]
    };
    assert_close(&predict(&grown), &predict(&whole), 1e-11, "grown");
    grown.remove(7);
    let without = |values: &[f64]| [&values[..14], &values[16..]].concat();
    let less = GaussianProcess::new(kernel("product"), 0.05, &without(&x), 2, &without(&y), 2);
    assert_close(&predict(&grown), &predict(&less.expect("a process")), 1e-11, "shrunk");
}

#[test]
fn failures_report_the_jitter_and_the_value() {
    let rbf = || Kernel::rbf(1, 1.0);
    let error = GaussianProcess::new(rbf(), 0.1, &[0.0, f64::NAN], 1, &[0.0, 1.0], 1).expect_err("NaN");
    assert!(error.to_string().starts_with("input 1 is NaN"), "{error}");
    let error = GaussianProcess::new(rbf(), 0.1, &[0.0, 1.0], 1, &[0.0], 1).expect_err("short");
    assert_eq!(error, GpError::Shape { what: "outputs", found: 1, expected: 2 });
    let error = GaussianProcess::new(Kernel::rbf(1, -1.0), 0.1, &[0.0], 1, &[0.0], 1).expect_err("negative");
    assert_eq!(error, GpError::Kernel { dimensions: 1 });
    // entries overflow
    let steep = Kernel::Linear(vec![1e300]);
    let error = GaussianProcess::new(steep, 0.1, &[1e150, 2e150], 1, &[0.0, 1.0], 1).expect_err("overflow");
    let GpError::Factorisation { points: 2, tried } = &error else { panic!("{error}") };
    assert_eq!(tried.len(), 6);
    assert!(error.to_string().contains("tried jitters [0.0, "), "{error}");
}
