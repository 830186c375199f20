//! Policy search on library weights and on kernel weights.

use motorium_learners::experiments::search::{Goal, KernelPrior, Search, SearchSpace, is_clearly_larger};
use motorium_library::statistics::with_error;
use motorium_library::{MotionLibrary, Recordings};
use motorium_pictures::chart::Series;

use super::letters::chart;
use super::writer::FigureWriter;

/// Mean final reward and its standard error, by a number of weights.
struct Found {
    n: usize,
    library: (f64, f64),
    kernels: (f64, f64),
    /// The exploration of these kernels.
    prior: &'static str,
}

impl Found {
    fn library_wins(&self) -> bool {
        is_clearly_larger(self.library, self.kernels)
    }

    fn describe(&self) -> String {
        let Self { n, library: l, kernels: k, prior } = self;
        format!("n = {n}: library {}, {prior} {}", with_error(l.0, l.1), with_error(k.0, k.1))
    }
}

const PRIORS: [(&str, KernelPrior); 3] = [
    ("kernels, equal force", KernelPrior::EqualForce),
    ("kernels, equal response", KernelPrior::EqualResponse),
    ("kernels, as fitted", KernelPrior::Fitted),
];

pub(super) fn figure(
    writer: &mut FigureWriter,
    library: &MotionLibrary,
    held: &Recordings,
    searched: usize,
) -> anyhow::Result<()> {
    let spring = *library.spring();
    let stride = (held.trajectories.len() / searched.max(1)).max(1);
    let letters = held.trajectories.iter().step_by(stride).take(searched);
    let goals: Vec<Goal> = letters.map(|letter| Goal::new(letter, &spring)).collect();
    let mut series = Vec::new();
    let mut finals = Vec::new();
    for n in [4, 8, 16, 32, 64] {
        let mut searched = |name: &str, space: SearchSpace| {
            let search = Search::best_scale(&space, &goals, &spring);
            series.push(Series { name: format!("{name}, n = {n}"), points: search.curve() });
            search.reward()
        };
        let of_library = searched("library", SearchSpace::library(library, n));
        let of_kernels =
            PRIORS.map(|(name, prior)| (name, searched(name, SearchSpace::kernels(library, n, prior))));
        let best = of_kernels.into_iter().max_by(|a, b| a.1.0.total_cmp(&b.1.0));
        let (prior, kernels) = best.unwrap_or(of_kernels[0]);
        finals.push(Found { n, library: of_library, kernels, prior });
        writer.bar.inc(1);
    }
    let title = "Policy search (PoWER) for held-out letters";
    writer.chart("power-letters", &chart(title, ["rollouts", "best reward"], [true, false], series))?;
    let of = |n: &[usize]| finals.iter().filter(|f| n.contains(&f.n)).collect::<Vec<_>>();
    let wins = |n: &[usize]| of(n).iter().all(|found| found.library_wins());
    let words = |n: &[usize]| of(n).iter().map(|found| found.describe()).collect::<Vec<_>>().join("; ");
    let claim = "with few weights, search in the library finds better movements than in kernels";
    writer.claim("policy search", claim, wins(&[4, 8, 16]), words(&[4, 8, 16]));
    let claim = "with many weights, search in the library finds better movements than in kernels";
    let how = "the best of three priors for kernels and of five scales for each";
    writer.claim("policy search", claim, wins(&[32, 64]), format!("{}; {how}", words(&[32, 64])));
    Ok(())
}
