//! Hidden Markov models compared with hmmlearn.

use motorium_models::hmm::{Hmm, HmmError, Hsmm, Regression, Shape, Tracker};

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

/// Iterates over all paths of length `n` through `k` states.
fn paths(k: usize, n: usize) -> impl Iterator<Item = Vec<usize>> {
    (0..k.pow(n as u32)).map(move |code| (0..n).map(|t| code / k.pow(t as u32) % k).collect())
}

#[test]
fn geometric_durations_give_the_hidden_markov_model() {
    let golden = read("hmm.json");
    let y = &numbers(&golden["y"])[..60];
    let (pi, a, m, c) = start();
    let model = Hmm::new(&pi, &a, &m, &c, Shape::Full).expect("a model");
    let stay = [0.8_f64, 0.7, 0.7];
    let durations: Vec<f64> =
        stay.iter().flat_map(|p| (1..=60).map(move |d| p.powi(d - 1) * (1.0 - p))).collect();
    let semi = Hsmm::new(&model, &durations).expect("a model");
    let (found, expected) =
        (semi.log_likelihood(y).expect("finite"), model.log_likelihood(y).expect("finite"));
    assert!((found - expected).abs() < 1e-8, "{found} and {expected}");
    let (found, expected) = (semi.viterbi(y).expect("a path"), model.viterbi(y).expect("a path"));
    assert!((found.0 - expected.0).abs() < 1e-8 && found.1 == expected.1, "{found:?} and {expected:?}");
}

#[test]
fn explicit_durations_equal_the_sum_over_all_paths() {
    let (pi, a, m, c) = start();
    let model = Hmm::new(&pi, &a, &m, &c, Shape::Full).expect("a model");
    let table = [0.1, 0.6, 0.3, 0.5, 0.2, 0.2, 0.0, 0.3, 0.7];
    let semi = Hsmm::new(&model, &table).expect("a model");
    let y = [0.3, -0.1, 0.6, -0.4, 2.2, 0.6, 2.6, 0.8, -0.4, 2.5, -0.7, 2.9];
    let n = 6;
    let density = |state: usize, t: usize| {
        let one =
            Hmm::new(&[1.0], &[1.0], &m[2 * state..2 * state + 2], &c[4 * state..4 * state + 4], Shape::Full);
        one.and_then(|one| one.log_likelihood(&y[2 * t..2 * t + 2])).expect("a density")
    };
    let densities: Vec<f64> =
        (0..n).flat_map(|t| (0..3).map(move |s| (s, t))).map(|(s, t)| density(s, t)).collect();
    let (mut sum, mut best) = (0.0, (f64::NEG_INFINITY, vec![]));
    for path in paths(3, n) {
        let mut value: f64 = path.iter().enumerate().map(|(t, s)| densities[3 * t + s]).sum();
        let runs: Vec<&[usize]> = path.chunk_by(|a, b| a == b).collect();
        for (index, run) in runs.iter().enumerate() {
            let state = run[0];
            let own = &table[3 * state..3 * state + 3];
            let probability = match (index + 1 == runs.len(), run.len()) {
                (_, 4..) => 0.0,
                (true, d) => 1.0 - own[..d - 1].iter().sum::<f64>(),
                (false, d) => own[d - 1],
            };
            let entry = match index {
                0 => pi[state],
                _ => {
                    let from = runs[index - 1][0];
                    a[3 * from + state] / (1.0 - a[4 * from])
                }
            };
            value += probability.max(0.0).ln() + entry.ln();
        }
        sum += value.exp();
        if value > best.0 {
            best = (value, path);
        }
    }
    let found = semi.log_likelihood(&y).expect("finite");
    assert!((found - sum.ln()).abs() < 1e-10, "{found} and {}", sum.ln());
    let path = semi.viterbi(&y).expect("a path");
    assert!((path.0 - best.0).abs() < 1e-10 && path.1 == best.1, "{path:?} and {best:?}");
}

/// A movement through three levels that last about 20, 10 and 30 samples, with a column of time.
fn levels(shift: usize) -> Vec<f64> {
    let ends = [20 + shift, 30 + shift, 60 + shift];
    let level = |t: usize| {
        if t < ends[0] {
            0.0
        } else if t < ends[1] {
            1.0
        } else {
            -0.5
        }
    };
    (0..ends[2]).flat_map(|t| [t as f64 * 0.01, level(t) + 0.02 * (t as f64 * 2.3).sin()]).collect()
}

#[test]
fn durations_are_learned_from_movements() {
    let movements: Vec<Vec<f64>> = (0..4).map(levels).collect();
    let movements: Vec<Vec<f64>> =
        movements.iter().map(|rows| rows.chunks(2).map(|row| row[1]).collect()).collect();
    let movements: Vec<&[f64]> = movements.iter().map(Vec::as_slice).collect();
    let model = Hmm::left_right(3, &movements, 1, Shape::Full).expect("a model");
    let mut semi = Hsmm::with_normal_durations(&model, &[20.0; 3], &[10.0; 3], 60).expect("a model");
    let history = semi.train(&movements, 20, 1e-6).expect("training");
    assert!(history[history.len() - 1] > history[0] + 10.0, "{history:?}");
    let mean = |state: usize| -> f64 {
        semi.durations(state).iter().enumerate().map(|(d, p)| (d + 1) as f64 * p).sum()
    };
    assert!((mean(0) - 21.5).abs() < 0.5 && (mean(1) - 10.0).abs() < 0.5, "{} {}", mean(0), mean(1));
    let path = semi.viterbi(movements[0]).expect("a path").1;
    assert_eq!((path[19], path[20], path[29], path[30]), (0, 1, 1, 2));
}

#[test]
fn movements_are_reproduced_by_regression_and_by_tracking() {
    // a line and a bend, over time
    let movement: Vec<f64> = (0..120)
        .flat_map(|t| {
            let s = f64::from(t) / 119.0;
            [s, (3.0 * s).sin(), s * s]
        })
        .collect();
    let mut model = Hmm::left_right(8, &[&movement], 3, Shape::Full).expect("a model");
    model.train(&[&movement], 20, 1e-6).expect("training");
    let regression = Regression::new(&model, &[0]).expect("a regression");
    assert_eq!(regression.outputs(), [1, 2]);
    let times: Vec<f64> = movement.chunks(3).map(|row| row[0]).collect();
    let found = regression.predict(&times).expect("outputs");
    for (found, truth) in found.chunks(2).zip(movement.chunks(3)) {
        assert!(
            (found[0] - truth[1]).abs() < 0.03 && (found[1] - truth[2]).abs() < 0.03,
            "{found:?} {truth:?}"
        );
    }
    let columns: Vec<f64> = movement.chunks(3).flat_map(|row| row[1..].to_vec()).collect();
    let mut model = Hmm::left_right(8, &[&columns], 2, Shape::Full).expect("a model");
    model.train(&[&columns], 20, 1e-6).expect("training");
    let path = model.viterbi(&columns).expect("a path").1;
    let follow = |effort: f64| {
        Tracker::new(&model, &path, 0.01, effort)
            .and_then(|tracker| tracker.movement(&columns[..2]))
            .expect("a movement")
    };
    let distance = |found: &[f64]| {
        (found.iter().zip(&columns).map(|(a, b)| (a - b) * (a - b)).sum::<f64>() / 120.0).sqrt()
    };
    let (tight, loose) = (follow(1e-2), follow(1e3));
    assert_eq!(tight.len(), columns.len());
    assert!(distance(&tight) < 0.1 && distance(&loose) > 2.0 * distance(&tight), "{}", distance(&tight));
    // it moves from one mean to the next without a discontinuity
    assert!(tight.chunks(2).zip(tight.chunks(2).skip(1)).all(|(a, b)| (a[0] - b[0]).abs() < 0.05));
    let error = Tracker::new(&model, &[0, 9], 0.01, 1.0).expect_err("a state");
    assert_eq!(error, HmmError::Shape { what: "states", found: 10, expected: 8 });
    let error = Regression::new(&model, &[0, 1]).expect_err("no output");
    assert!(matches!(error, HmmError::Shape { what: "different input columns", .. }), "{error}");
}
