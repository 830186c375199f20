//! Hidden Markov models against hmmlearn.

use motorium_models::hmm::{Hmm, HmmError, Shape};

use crate::golden::{assert_close, numbers, read};

fn start() -> (Vec<f64>, Vec<f64>, Vec<f64>, Vec<f64>) {
    let means = [0.4, -0.3, 2.4, 0.7, -0.6, 2.7];
    let covariances = [1.0, 0.0, 0.0, 1.0].repeat(3);
    (vec![0.5, 0.3, 0.2], vec![0.8, 0.1, 0.1, 0.2, 0.7, 0.1, 0.1, 0.2, 0.7], means.to_vec(), covariances)
}

#[test]
fn likelihoods_paths_and_training_equal_hmmlearn() {
    let golden = read("hmm.json");
    let y = numbers(&golden["y"]);
    let (first, second) = y.split_at(140);
    for (name, shape) in [("diag", Shape::Diagonal), ("full", Shape::Full)] {
        let case = &golden[name];
        let (pi, a, m, c) = start();
        let mut model = Hmm::new(&pi, &a, &m, &c, shape).expect("a model");
        let score = |model: &Hmm| {
            model.log_likelihood(first).expect("a likelihood")
                + model.log_likelihood(second).expect("a likelihood")
        };
        let path = |model: &Hmm| {
            let mut path = model.viterbi(first).expect("a path").1;
            path.extend(model.viterbi(second).expect("a path").1);
            path.iter().map(|state| *state as f64).collect::<Vec<_>>()
        };
        assert_close(&[score(&model)], &numbers(&case["score"]), 1e-8, name);
        assert_eq!(path(&model), numbers(&case["path"]));
        let history = model.train(&[first, second], 15, f64::NEG_INFINITY).expect("training");
        assert_eq!(history.len(), 15);
        assert!(history.is_sorted(), "{history:?}");
        assert_close(&[score(&model)], &numbers(&case["fitted_score"]), 1e-8, name);
        assert_eq!(path(&model), numbers(&case["fitted_path"]));
        let means = (0..3).flat_map(|state| model.mean(state).to_vec()).collect::<Vec<_>>();
        assert_close(&means, &numbers(&case["fitted_means"]), 1e-8, "means");
        let covariances = (0..3).flat_map(|state| model.covariance(state).to_vec()).collect::<Vec<_>>();
        assert_close(&covariances, &numbers(&case["fitted_covariances"]), 1e-8, "covariances");
        assert_close(model.transitions(), &numbers(&case["fitted_transitions"]), 1e-8, "transitions");
        assert_close(model.start(), &numbers(&case["fitted_start"]), 1e-8, "start");
    }
}

#[test]
fn left_right_models_never_move_back() {
    let movement: Vec<f64> =
        (0..100).flat_map(|t| [0.05 * f64::from(t), (0.1 * f64::from(t)).sin()]).collect();
    let mut model = Hmm::left_right(5, &[&movement], 2, Shape::Full).expect("a model");
    model.train(&[&movement], 30, 1e-6).expect("training");
    let path = model.viterbi(&movement).expect("a path").1;
    assert!(path.is_sorted() && path[0] == 0 && path[99] == 4, "{path:?}");
    for i in 0..5 {
        let row = &model.transitions()[5 * i..5 * i + 5];
        assert!(row.iter().enumerate().all(|(j, p)| j == i || j == i + 1 || *p == 0.0), "{row:?}");
    }
}

#[test]
fn mistakes_are_named() {
    let (pi, a, m, c) = start();
    let error = Hmm::new(&[0.5, 0.3, 0.3], &a, &m, &c, Shape::Full).expect_err("sum");
    assert!(matches!(error, HmmError::Probability { .. }), "{error}");
    let error = Hmm::new(&pi, &a, &m, &[0.0; 12], Shape::Full).expect_err("singular");
    assert_eq!(error, HmmError::Covariance { state: 0 });
    let model = Hmm::new(&pi, &a, &m, &c, Shape::Full).expect("a model");
    assert_eq!(model.viterbi(&[0.0, 1.0, f64::NAN, 0.0]).expect_err("NaN"), HmmError::Impossible { row: 1 });
    let error = model.log_likelihood(&[0.0; 3]).expect_err("odd");
    assert_eq!(error, HmmError::Shape { what: "values of a sequence", found: 3, expected: 2 });
}
