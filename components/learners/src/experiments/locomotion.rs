//! Bayesian optimisation of the gait of a quadruped, compared with random search and a hand-set gait.
//!
//! A pattern generator swings the legs in an open-loop trot. Six of its parameters are optimised for forward
//! speed. The search is repeated with several seeds. The caller provides the evaluation, for example a graph
//! in a session.
//!
//! Source: Delhaisse's thesis, 2019, section 2.4.3, figures 2.30 and 2.31: a Gaussian process with an RBF
//! kernel, expected improvement, 5 initial points. The thesis does not state the robot, the parameters or
//! their ranges.

use std::f64::consts::PI;

use serde::Serialize;

use super::trials::{over_seeds, run_jobs};
use crate::search::{
    BayesianOptimisation, BayesianSettings, Evaluation, RandomSearch, Search, Smoothness, StartError,
    TellError,
};

/// Number of parameters of a gait.
pub const DIMENSIONS: usize = 6;

/// An optimised parameter of the gait.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GaitParameter {
    /// Name of the parameter with its unit.
    pub name: &'static str,
    /// Range in which the parameter is searched.
    pub range: [f64; 2],
    /// Value of the hand-set gait, `graphs/quadruped-trot.toml`.
    pub hand_set: f64,
}

/// The optimised parameters. Phases refer to the front legs; the hind legs mirror the front legs. The knee
/// bends by twice the hip angle, so that the foot stays below the hip.
pub const PARAMETERS: [GaitParameter; DIMENSIONS] = [
    GaitParameter { name: "frequency, Hz", range: [1.0, 4.0], hand_set: 2.0 },
    GaitParameter { name: "hip amplitude, rad", range: [0.05, 0.4], hand_set: 0.1875 },
    GaitParameter { name: "knee amplitude, rad", range: [0.05, 0.5], hand_set: 0.261 },
    GaitParameter { name: "hip phase, rad", range: [0.0, PI], hand_set: 2.371 },
    GaitParameter { name: "knee phase, rad", range: [-PI, 0.0], hand_set: -1.571 },
    GaitParameter { name: "hip angle, rad", range: [0.6, 1.0], hand_set: 0.8 },
];

/// Returns the parameters of the hand-set gait.
pub fn hand_set() -> [f64; DIMENSIONS] {
    PARAMETERS.map(|parameter| parameter.hand_set)
}

/// Returns the configuration of a gait for a `policy.cpg` component named `policy`, as pairs of key and
/// value.
pub fn keys(gait: &[f64; DIMENSIONS]) -> Vec<(String, f64)> {
    let [frequency, hip_amplitude, knee_amplitude, hip_phase, knee_phase, hip_angle] = *gait;
    let mut keys = vec![("policy.config.frequency".to_owned(), frequency)];
    for leg in 0..4 {
        // front left, front right, hind left, hind right
        let side = if leg < 2 { 1.0 } else { -1.0 };
        let hip = [("offset", side * hip_angle), ("amplitude", hip_amplitude), ("phase", side * hip_phase)];
        let knee = [
            ("offset", -2.0 * side * hip_angle),
            ("amplitude", knee_amplitude),
            ("phase", side * knee_phase),
        ];
        for (joint, values) in [hip, knee].into_iter().enumerate() {
            let key = |(name, value)| (format!("policy.config.legs.{leg}.joints.{joint}.{name}"), value);
            keys.extend(values.map(key));
        }
    }
    keys
}

/// A search method of the study.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Searcher {
    /// Bayesian optimisation as in the thesis: RBF kernel, expected improvement, 5 initial points.
    BayesianRbf,
    /// Bayesian optimisation with a Matern 5/2 kernel.
    BayesianMatern,
    /// Random search: uniformly distributed candidates. Serves as the baseline.
    Random,
}

impl Searcher {
    /// All search methods.
    pub const ALL: [Self; 3] = [Self::BayesianRbf, Self::BayesianMatern, Self::Random];

    /// Returns the name of the method in figures.
    pub fn name(self) -> &'static str {
        match self {
            Self::BayesianRbf => "Bayesian optimisation; RBF",
            Self::BayesianMatern => "Bayesian optimisation; Matern 5/2",
            Self::Random => "random search",
        }
    }

    /// Creates a search with a seed.
    ///
    /// # Errors
    ///
    /// [`StartError`] if the settings are invalid, which does not occur with the ranges of [`PARAMETERS`].
    pub fn search(self, seed: u64) -> Result<Box<dyn Search>, StartError> {
        let bounds = PARAMETERS.map(|parameter| parameter.range).to_vec();
        let bayesian = |smoothness| {
            // the thesis fits the model after every evaluation
            let settings =
                BayesianSettings { smoothness, initial: 5, refit: 1, ..BayesianSettings::default() };
            BayesianOptimisation::new(bounds.clone(), settings, seed)
        };
        Ok(match self {
            Self::BayesianRbf => Box::new(bayesian(Smoothness::Rbf)?),
            Self::BayesianMatern => Box::new(bayesian(Smoothness::Matern52)?),
            Self::Random => Box::new(RandomSearch::new(bounds, seed)?),
        })
    }
}

/// Settings of a study of gaits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct StudySettings {
    /// First seed of the searches and of the evaluations.
    pub first_seed: u64,
    /// Number of seeds, at least 1.
    pub seeds: u64,
    /// Number of evaluations of each search, at least 1.
    pub evaluations: usize,
}

/// Result of one search.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// Search method.
    pub searcher: Searcher,
    /// Seed of the search and of its evaluations.
    pub seed: u64,
    /// Gaits in the order of evaluation, each with its evaluation, whose reward is the speed \[m/s\].
    pub gaits: Vec<([f64; DIMENSIONS], Evaluation)>,
}

impl Trial {
    /// Returns the best speed after each evaluation \[m/s\]; 0 before the first gait without a fall.
    pub fn best_speeds(&self) -> Vec<f64> {
        let mut best: Option<f64> = None;
        let speed = |(_, found): &(_, Evaluation)| {
            if found.reward.is_finite() {
                best = Some(best.map_or(found.reward, |best| best.max(found.reward)));
            }
            best.unwrap_or(0.0)
        };
        self.gaits.iter().map(speed).collect()
    }

    /// Returns the distance between each gait and the previous gait. Each parameter is scaled by its range.
    pub fn distances(&self) -> Vec<f64> {
        let distance = |pair: &[([f64; DIMENSIONS], Evaluation)]| {
            let moved = |k: usize| {
                let [low, high] = PARAMETERS[k].range;
                (pair[1].0[k] - pair[0].0[k]) / (high - low)
            };
            (0..DIMENSIONS).map(|k| moved(k).powi(2)).sum::<f64>().sqrt()
        };
        self.gaits.windows(2).map(distance).collect()
    }

    /// Returns the fastest gait and its speed \[m/s\]; `None` if every gait failed.
    pub fn fastest(&self) -> Option<([f64; DIMENSIONS], f64)> {
        let finished = self.gaits.iter().filter(|(_, found)| found.reward.is_finite());
        // of equal speeds, the first
        let faster = |a: ([f64; DIMENSIONS], f64), b: ([f64; DIMENSIONS], f64)| if b.1 > a.1 { b } else { a };
        finished.map(|(gait, found)| (*gait, found.reward)).reduce(faster)
    }
}

/// Results of searches with several methods and seeds.
#[derive(Clone, Debug, PartialEq)]
pub struct Study {
    /// All searches, ordered by method and seed.
    pub trials: Vec<Trial>,
    /// Speed of the hand-set gait with each seed \[m/s\]; NaN if the robot fell.
    pub hand_set: Vec<f64>,
}

/// A job of a study.
enum Job {
    Search(Searcher, u64),
    HandSet(u64),
}

/// Result of a job.
enum Done {
    Search(Trial),
    HandSet(f64),
}

impl Study {
    /// Runs all searches on several threads. `build` creates the worker of a thread. `evaluate` returns the
    /// speed of a gait \[m/s\] with the random numbers of a seed. `observe` is called after each evaluation.
    /// Each search evaluates one gait at a time. The result does not depend on the number of threads.
    ///
    /// # Errors
    ///
    /// Returns the first error of `build` or `evaluate`.
    pub fn run<W, E>(
        settings: &StudySettings,
        threads: usize,
        build: impl Fn(usize) -> Result<W, E> + Sync,
        evaluate: impl Fn(&mut W, &[f64; DIMENSIONS], u64) -> Result<Evaluation, E> + Sync,
        observe: impl Fn() + Sync,
    ) -> Result<Self, E>
    where
        E: From<StartError> + From<TellError> + Send,
    {
        let seeds = settings.first_seed..settings.first_seed.saturating_add(settings.seeds);
        let mut jobs: Vec<Job> = seeds.clone().map(Job::HandSet).collect();
        for searcher in Searcher::ALL {
            jobs.extend(seeds.clone().map(|seed| Job::Search(searcher, seed)));
        }
        let work = |worker: &mut W, job: &Job| -> Result<Done, E> {
            let (searcher, seed) = match *job {
                Job::HandSet(seed) => {
                    let found = evaluate(worker, &hand_set(), seed)?;
                    observe();
                    return Ok(Done::HandSet(found.reward));
                }
                Job::Search(searcher, seed) => (searcher, seed),
            };
            let mut search = searcher.search(seed)?;
            let mut gaits = Vec::with_capacity(settings.evaluations);
            while gaits.len() < settings.evaluations {
                for candidate in search.ask(1) {
                    let gait = core::array::from_fn(|k| candidate.parameters[k]);
                    let found = evaluate(worker, &gait, seed)?;
                    search.tell(&[(candidate.id, found.reward)])?;
                    gaits.push((gait, found));
                    observe();
                }
            }
            Ok(Done::Search(Trial { searcher, seed, gaits }))
        };
        let done = run_jobs(threads, &jobs, build, work)?;
        let (mut trials, mut hand_set) = (Vec::new(), Vec::new());
        for done in done {
            match done {
                Done::Search(trial) => trials.push(trial),
                Done::HandSet(speed) => hand_set.push(speed),
            }
        }
        Ok(Self { trials, hand_set })
    }

    /// Returns the searches of a method.
    pub fn trials(&self, searcher: Searcher) -> impl Iterator<Item = &Trial> {
        self.trials.iter().filter(move |trial| trial.searcher == searcher)
    }

    /// Returns, for each evaluation of a search, the number of the evaluation, the mean over seeds of the
    /// best speed so far \[m/s\], and the standard error of this mean.
    pub fn speeds(&self, searcher: Searcher) -> Vec<[f64; 3]> {
        over_seeds(&self.trials(searcher).map(Trial::best_speeds).collect::<Vec<_>>(), 1)
    }

    /// Returns, for each evaluation of a search, the number of the evaluation, the mean over seeds of the
    /// distance from the previous gait, and the standard error of this mean.
    pub fn distances(&self, searcher: Searcher) -> Vec<[f64; 3]> {
        over_seeds(&self.trials(searcher).map(Trial::distances).collect::<Vec<_>>(), 2)
    }

    /// Returns the final best speed of each seed \[m/s\].
    pub fn finals(&self, searcher: Searcher) -> Vec<f64> {
        self.trials(searcher).map(|trial| trial.best_speeds().last().copied().unwrap_or(0.0)).collect()
    }

    /// Returns the fraction of failed gaits, 0 to 1.
    pub fn failures(&self, searcher: Searcher) -> f64 {
        let gaits = || self.trials(searcher).flat_map(|trial| &trial.gaits);
        let failed = gaits().filter(|(_, found)| !found.reward.is_finite()).count();
        failed as f64 / gaits().count().max(1) as f64
    }

    /// Returns the fastest gait of all searches, its speed \[m/s\] and its seed.
    pub fn fastest(&self) -> Option<([f64; DIMENSIONS], f64, u64)> {
        let fastest = self.trials.iter().filter_map(|trial| {
            let (gait, speed) = trial.fastest()?;
            Some((gait, speed, trial.seed))
        });
        fastest.reduce(|a, b| if b.1 > a.1 { b } else { a })
    }
}

#[cfg(test)]
mod tests {
    use super::super::trials::median;
    use super::*;
    use crate::search::Outcome;

    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    enum Failure {
        Start,
        Tell,
        Evaluation,
    }

    impl From<StartError> for Failure {
        fn from(_: StartError) -> Self {
            Self::Start
        }
    }

    impl From<TellError> for Failure {
        fn from(_: TellError) -> Self {
            Self::Tell
        }
    }

    /// Returns a smooth speed that is largest in a corner region, with falls at high frequencies.
    fn walk(gait: &[f64; DIMENSIONS], seed: u64) -> Evaluation {
        if gait[0] > 3.7 {
            return Evaluation::failed(Outcome::Unmet, "fell");
        }
        let unit = |k: usize| {
            let [low, high] = PARAMETERS[k].range;
            (gait[k] - low) / (high - low)
        };
        let away: f64 = (0..DIMENSIONS).map(|k| (unit(k) - 0.7).powi(2)).sum();
        Evaluation::finished((-2.0 * away).exp() + 1e-3 * (seed % 3) as f64)
    }

    fn study(threads: usize) -> Study {
        let settings = StudySettings { first_seed: 1, seeds: 4, evaluations: 25 };
        let evaluate = |(): &mut (), gait: &[f64; DIMENSIONS], seed| Ok(walk(gait, seed));
        Study::run::<_, Failure>(&settings, threads, |_| Ok(()), evaluate, || {}).expect("a study")
    }

    #[test]
    fn bayesian_optimisation_beats_random_search_on_a_smooth_speed() {
        let found = study(2);
        // rewards of failed gaits are NaN, which equals nothing
        assert_eq!(format!("{found:?}"), format!("{:?}", study(1)), "threads change no bit");
        assert_eq!((found.trials.len(), found.hand_set.len()), (12, 4));
        let [rbf, matern, random] = Searcher::ALL.map(|searcher| median(&found.finals(searcher)));
        assert!(rbf > random + 0.1 && matern > random + 0.1, "{rbf} {matern} {random}");
        let curve = found.speeds(Searcher::BayesianRbf);
        assert_eq!((curve.len(), curve[0][0], curve[24][0]), (25, 1.0, 25.0));
        assert!(curve.windows(2).all(|pair| pair[1][1] >= pair[0][1]), "best speeds do not fall");
        let distances = found.distances(Searcher::Random);
        assert_eq!((distances.len(), distances[0][0]), (24, 2.0));
        // the mean distance of two uniform points in the unit box of six dimensions is 0.97
        let mean = distances.iter().map(|point| point[1]).sum::<f64>() / 24.0;
        assert!((mean - 0.97).abs() < 0.1, "{mean}");
        assert!(found.failures(Searcher::Random) > 0.0);
        let (gait, speed, seed) = found.fastest().expect("a gait");
        assert_eq!(walk(&gait, seed).reward, speed);
        assert!(
            Searcher::ALL.iter().all(|searcher| found.finals(*searcher).iter().all(|best| *best <= speed))
        );
    }

    #[test]
    fn hand_set_gait_has_the_keys_of_the_graph() {
        let keys = keys(&hand_set());
        assert_eq!(keys.len(), 25);
        let value = |key: &str| keys.iter().find(|(name, _)| name == key).expect(key).1;
        assert_eq!(value("policy.config.frequency"), 2.0);
        assert_eq!(value("policy.config.legs.0.joints.1.offset"), -1.6);
        assert_eq!(value("policy.config.legs.3.joints.0.phase"), -2.371);
        assert_eq!(value("policy.config.legs.2.joints.1.phase"), 1.571);
    }

    #[test]
    fn errors_of_evaluations_end_a_study() {
        let settings = StudySettings { first_seed: 1, seeds: 3, evaluations: 5 };
        let evaluate = |(): &mut (), _: &[f64; DIMENSIONS], _| Err(Failure::Evaluation);
        let ended = Study::run::<(), _>(&settings, 2, |_| Ok(()), evaluate, || {});
        assert_eq!(ended.err(), Some(Failure::Evaluation));
    }
}
