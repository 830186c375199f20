//! Iterations of black-box searches.

use std::hint::black_box;

use motorium_benches::peers::Work;
use motorium_learners::search::{
    BayesianOptimisation, BayesianSettings, CmaEs, CmaEsSettings, Restarts, Search, Start,
};

/// Generations after which a search starts over, before it has converged.
const GENERATIONS: u32 = 200;
/// Points and parameters of the Bayesian search.
const POINTS: usize = 35;
const DIMENSIONS: usize = 6;

/// Returns every measured iteration. The peers run the same iterations.
pub(crate) fn all() -> Vec<Work> {
    let work = |name, run| Work { name, run };
    vec![work("cma_10", cma(10)), work("cma_50", cma(50)), work("bayesian_6_at_35", bayesian())]
}

/// Returns a generation of CMA-ES on an ellipsoid of condition 1e6: candidates, their rewards, and the
/// update.
fn cma(dimensions: usize) -> Box<dyn FnMut()> {
    let settings = CmaEsSettings { restarts: Restarts::Never, ..CmaEsSettings::default() };
    let start = move |seed| {
        let start = Start::new(vec![1.0; dimensions], vec![1.0; dimensions], seed);
        CmaEs::new(start, settings).expect("a search")
    };
    let scales: Vec<f64> =
        (0..dimensions).map(|i| 10.0_f64.powf(6.0 * i as f64 / (dimensions - 1) as f64)).collect();
    let (mut search, mut seed, mut generation) = (start(0), 0, 0);
    Box::new(move || {
        if generation == GENERATIONS {
            seed += 1;
            (search, generation) = (start(seed), 0);
        }
        generation += 1;
        let reward = |x: &[f64]| -x.iter().zip(&scales).map(|(x, scale)| scale * x * x).sum::<f64>();
        let asked = search.ask(usize::MAX);
        let rewards: Vec<(u64, f64)> = asked.iter().map(|c| (c.id, reward(&c.parameters))).collect();
        search.tell(black_box(&rewards)).expect("known candidates");
    })
}

/// Returns the proposal of the next point once 35 points have rewards: hyperparameters and the acquisition's
/// maximum.
fn bayesian() -> Box<dyn FnMut()> {
    let settings = BayesianSettings { refit: 1, ..BayesianSettings::default() };
    let mut search = BayesianOptimisation::new(vec![[-2.0, 2.0]; DIMENSIONS], settings, 1).expect("a search");
    let reward =
        |x: &[f64]| -x.windows(2).map(|p| (p[1] - p[0] * p[0]).powi(2) + (1.0 - p[0]).powi(2)).sum::<f64>();
    for _ in 0..POINTS {
        for candidate in search.ask(1) {
            search.tell(&[(candidate.id, reward(&candidate.parameters))]).expect("a known candidate");
        }
    }
    Box::new(move || {
        // the search as of its 35th reward, which the model does not have yet
        let mut search = search.clone();
        black_box(search.ask(1));
    })
}
