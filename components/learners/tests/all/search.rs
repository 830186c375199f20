//! Policy search in spaces of eigenforces and of kernels.

use motorium_learners::experiments::search::{
    Goal, KernelPrior, REPORTED, Search, SearchSpace, is_clearly_larger,
};
use motorium_library::letters::{Variation, letters};
use motorium_library::{
    DAMPING, Entry, Frame, Layout, LibraryParts, Metric, MotionLibrary, SampledSpring, Truncation,
    kernel_functions,
};
use nalgebra::DMatrix;

fn spring() -> SampledSpring {
    SampledSpring::new(60, DAMPING).unwrap()
}

fn library() -> MotionLibrary {
    MotionLibrary::build(&letters(4, Variation::default(), 1), spring(), Metric::Force, Truncation::All)
        .unwrap()
}

#[test]
fn library_weights_are_explored_with_their_spread() {
    let library = library();
    let space = SearchSpace::library(&library, 6);
    let movements = library.entries().len() as f64;
    for k in 0..6 {
        let varied = library.weights().row(k).norm_squared() / movements;
        assert!((space.variance[k] / (0.36 * varied) - 1.0).abs() < 1e-9, "weight {k}");
    }
    assert_eq!(SearchSpace::library(&library, 100_000).variance.len(), library.rank());
    let twice = space.scaled(2.0);
    assert!(twice.variance.iter().zip(&space.variance).all(|(a, b)| (a / b - 4.0).abs() < 1e-12));
}

#[test]
fn kernels_share_the_squared_force_equally() {
    let library = library();
    let space = SearchSpace::kernels(&library, 10, KernelPrior::EqualForce);
    let movements = library.entries().len() as f64;
    let forces = (library.eigenforces() * library.weights()).norm_squared() / movements;
    let shares: Vec<f64> =
        (0..10).map(|k| space.variance[k] * space.functions.column(k).norm_squared() / 0.36).collect();
    assert!(shares.iter().all(|share| (share * 10.0 / forces - 1.0).abs() < 1e-9), "{shares:?}");
}

#[test]
fn fitted_kernels_have_the_variance_of_the_true_weights() {
    // a library of one degree of freedom whose movements are sums of four kernels with known weights
    let spring = spring();
    let weights = DMatrix::from_fn(4, 30, |i, k| ((i + 1) as f64) * (1.7 * (k * 4 + i) as f64).sin());
    let (q, r) = kernel_functions(&spring, 4).qr().unpack();
    let frame = Frame { start: vec![0.0], goal: vec![0.0], velocity: vec![0.0], duration: 1.0 };
    let library = MotionLibrary::from_parts(LibraryParts {
        layout: Layout::new(vec!["x".into()]).unwrap(),
        spring,
        metric: Metric::Force,
        basis: q,
        singular: vec![1.0; 4],
        spectrum: vec![1.0; 4],
        energy: 4.0,
        weights: r * &weights,
        entries: (0..30).map(|k| Entry { id: k.to_string(), label: None, frame: frame.clone() }).collect(),
    })
    .unwrap();
    let space = SearchSpace::kernels(&library, 4, KernelPrior::Fitted);
    for i in 0..4 {
        let expected = 0.36 * weights.row(i).norm_squared() / 30.0;
        // the ridge, a millionth of the mean diagonal, shifts the weights of nearly parallel responses by a
        // few percent
        assert!((space.variance[i] / expected - 1.0).abs() < 0.03, "{i}: {} {expected}", space.variance[i]);
    }
}

#[test]
fn search_improves_reproducibly() {
    let library = library();
    let goal = Goal::new(&letters(1, Variation::default(), 7).trajectories[0], &spring());
    let space = SearchSpace::library(&library, 8);
    let rewards = space.search(&goal, &spring(), 3);
    assert!(rewards.windows(2).all(|pair| pair[1] >= pair[0]), "{rewards:?}");
    assert!(rewards[0] >= 0.0 && rewards[REPORTED.len() - 1] <= 1.0);
    assert!(rewards[REPORTED.len() - 1] > rewards[0] + 0.2, "{rewards:?}");
    assert_eq!(space.search(&goal, &spring(), 3), rewards);
    assert_ne!(space.search(&goal, &spring(), 4), rewards);
}

#[test]
fn library_search_beats_equally_many_kernels() {
    let library = library();
    let held = letters(1, Variation::default(), 9);
    let goals: Vec<Goal> = held.trajectories.iter().take(3).map(|t| Goal::new(t, &spring())).collect();
    let known = Search::best_scale(&SearchSpace::library(&library, 8), &goals, &spring());
    let kernels = SearchSpace::kernels(&library, 8, KernelPrior::EqualForce);
    let kernels = Search::best_scale(&kernels, &goals, &spring());
    assert!(
        is_clearly_larger(known.reward(), kernels.reward()),
        "{:?} {:?}",
        known.reward(),
        kernels.reward()
    );
    assert_eq!(known.rewards.len(), 9);
    let curve = known.curve();
    assert_eq!((curve[0][0], curve[6][0]), (1.0, 300.0));
    assert_eq!((curve[6][1], curve[6][2]), known.reward());
}

#[test]
fn clearly_larger_means_exceed_the_combined_error() {
    assert!(is_clearly_larger((1.0, 0.3), (0.4, 0.4)));
    assert!(!is_clearly_larger((1.0, 0.3), (0.5, 0.4)));
}
