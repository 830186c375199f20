//! Evaluation of candidates on several threads.

use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Mutex, mpsc};

use serde::{Deserialize, Deserializer, Serialize};

use super::{Candidate, Search, TellError};

/// Outcome of an evaluation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// The evaluation has a reward.
    Finished,
    /// A condition of success is not met. For example, the robot fell below a minimum height of its base.
    Unmet,
    /// The evaluation ended early: a component failed, or the robot was stopped.
    Stopped,
    /// The parameters were rejected before the start.
    Refused,
    /// The evaluation finished, but its reward is not a finite number.
    NoValue,
    /// The operator of the robot refused to run the parameters.
    Skipped,
    /// The evaluation finished, and the operator of the robot has yet to enter its reward.
    Unscored,
}

impl Outcome {
    /// All outcomes.
    pub const ALL: [Self; 7] = [
        Self::Finished,
        Self::Unmet,
        Self::Stopped,
        Self::Refused,
        Self::NoValue,
        Self::Skipped,
        Self::Unscored,
    ];

    /// Returns the name of the outcome in tables and in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Finished => "finished",
            Self::Unmet => "unmet",
            Self::Stopped => "stopped",
            Self::Refused => "refused",
            Self::NoValue => "no_value",
            Self::Skipped => "skipped",
            Self::Unscored => "unscored",
        }
    }
}

/// Result of evaluating a candidate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// Outcome of the evaluation.
    pub outcome: Outcome,
    /// Reward; NaN (`null` in JSON) unless the outcome is [`Outcome::Finished`]. A search ranks NaN below
    /// every number.
    #[serde(deserialize_with = "number_or_nan")]
    pub reward: f64,
    /// Reason for a failed outcome.
    pub reason: Option<String>,
}

/// Reads a number; `null` is NaN.
fn number_or_nan<'de, D: Deserializer<'de>>(source: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(source)?.unwrap_or(f64::NAN))
}

impl Evaluation {
    /// Creates an evaluation with a reward. The outcome is [`Outcome::NoValue`] if the reward is not finite.
    pub fn finished(reward: f64) -> Self {
        if reward.is_finite() {
            return Self { outcome: Outcome::Finished, reward, reason: None };
        }
        Self::failed(Outcome::NoValue, format!("the reward is {reward}, expected a finite number"))
    }

    /// Creates a failed evaluation with an outcome and a reason.
    pub fn failed(outcome: Outcome, reason: impl Into<String>) -> Self {
        Self { outcome, reward: f64::NAN, reason: Some(reason.into()) }
    }

    /// Creates an evaluation whose reward the operator has yet to enter.
    pub fn unscored() -> Self {
        Self { outcome: Outcome::Unscored, reward: f64::NAN, reason: None }
    }
}

/// Number of threads and limits of [`maximise`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Workers {
    /// Number of threads, at least 1. This number does not affect results.
    pub threads: usize,
    /// Maximum number of candidates without rewards, at least 1. A search with a model proposes each
    /// candidate from the rewards of all earlier candidates except the last `ahead`. `usize::MAX` evaluates
    /// whole generations.
    pub ahead: usize,
    /// Total number of candidates to evaluate.
    pub evaluations: u64,
}

/// Sends `None` when the thread of a worker panics, so that the search does not wait for its result.
struct PanicGuard<'a, T>(&'a mpsc::Sender<Option<T>>);

impl<T> Drop for PanicGuard<'_, T> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let _ = self.0.send(None);
        }
    }
}

/// Evaluates candidates of a search on several threads. Stops when the given number of candidates have
/// rewards, or when the search proposes no more candidates.
///
/// `build` is called on each thread and creates the thread's worker. `evaluate` evaluates a candidate with
/// the worker, and `report` is called after a reward has been accepted. Rewards are accepted one at a time,
/// in the order of the candidates, and new candidates are proposed after each reward. If the evaluations do
/// not depend on the number of threads, neither does the search, bit for bit. Candidates without rewards at
/// the start are evaluated first, so a restored search continues where it stopped.
///
/// ```
/// use motorium_learners::search::{
///     CmaEs, CmaEsSettings, Evaluation, Search as _, Start, TellError, Workers, maximise,
/// };
///
/// let start = Start::new(vec![0.0; 2], vec![1.0; 2], 7);
/// let mut search = CmaEs::new(start, CmaEsSettings::default())?;
/// let workers = Workers { threads: 2, ahead: usize::MAX, evaluations: 600 };
/// maximise::<_, _, TellError>(
///     &mut search,
///     workers,
///     |_| Ok(()),
///     |(), candidate| Ok(Evaluation::finished(-(candidate.parameters[0] - 1.0).powi(2))),
///     |_, _, _| Ok(()),
/// )?;
/// assert!(search.best().expect("rewards").1 > -1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// Returns the first error of `build`, `evaluate` or `report`. The search keeps its state after the last
/// accepted reward.
///
/// # Panics
///
/// If a worker panics.
pub fn maximise<S, W, E>(
    search: &mut S,
    workers: Workers,
    build: impl Fn(usize) -> Result<W, E> + Sync,
    evaluate: impl Fn(&mut W, &Candidate) -> Result<Evaluation, E> + Sync,
    report: impl FnMut(&S, &Candidate, &Evaluation) -> Result<(), E>,
) -> Result<(), E>
where
    S: Search + ?Sized,
    E: From<TellError> + Send,
{
    let (request, requests) = mpsc::channel::<Candidate>();
    let (requests, is_over) = (Mutex::new(requests), AtomicBool::new(false));
    std::thread::scope(|scope| {
        let (answer, answers) = mpsc::channel();
        for index in 0..workers.threads.max(1) {
            let answer = answer.clone();
            let (requests, is_over, build, evaluate) = (&requests, &is_over, &build, &evaluate);
            scope.spawn(move || {
                let _guard = PanicGuard(&answer);
                let mut worker = match build(index) {
                    Ok(worker) => worker,
                    Err(error) => {
                        let _ = answer.send(Some(Err(error)));
                        return;
                    }
                };
                loop {
                    // the next free worker evaluates the next candidate
                    let next = requests.lock().ok().and_then(|requests| requests.recv().ok());
                    let Some(candidate) = next.filter(|_| !is_over.load(Relaxed)) else { return };
                    let found = evaluate(&mut worker, &candidate).map(|found| (candidate.id, found));
                    if answer.send(Some(found)).is_err() {
                        return;
                    }
                }
            });
        }
        drop(answer);
        let result = drive(search, workers, &request, &answers, report);
        // candidates that no worker has started are not evaluated
        is_over.store(true, Relaxed);
        drop(request);
        result
    })
}

/// Sends candidates, and accepts their rewards in the order of the candidates.
fn drive<S, E>(
    search: &mut S,
    workers: Workers,
    request: &mpsc::Sender<Candidate>,
    answers: &mpsc::Receiver<Option<Result<(u64, Evaluation), E>>>,
    mut report: impl FnMut(&S, &Candidate, &Evaluation) -> Result<(), E>,
) -> Result<(), E>
where
    S: Search + ?Sized,
    E: From<TellError>,
{
    let mut left = workers.evaluations;
    let mut open: VecDeque<Candidate> = search.pending().into();
    open.truncate(usize::try_from(left).unwrap_or(usize::MAX));
    for candidate in &open {
        let _ = request.send(candidate.clone());
    }
    let mut finished: BTreeMap<u64, Evaluation> = BTreeMap::new();
    loop {
        let most = workers.ahead.max(1).min(usize::try_from(left).unwrap_or(usize::MAX));
        for candidate in search.ask(most.saturating_sub(open.len())) {
            // a worker that has exited has sent its reason
            let _ = request.send(candidate.clone());
            open.push_back(candidate);
        }
        let Some(first) = open.front() else { return Ok(()) };
        while !finished.contains_key(&first.id) {
            match answers.recv() {
                Ok(Some(answer)) => {
                    let (id, evaluation) = answer?;
                    finished.insert(id, evaluation);
                }
                // the panic of a worker ends the scope of its thread
                Ok(None) | Err(mpsc::RecvError) => return Ok(()),
            }
        }
        let Some(candidate) = open.pop_front() else { return Ok(()) };
        if let Some(evaluation) = finished.remove(&candidate.id) {
            search.tell(&[(candidate.id, evaluation.reward)])?;
            left -= 1;
            report(search, &candidate, &evaluation)?;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{
        BayesianOptimisation, BayesianSettings, CmaEs, CmaEsSettings, CrossEntropy, CrossEntropySettings,
        RandomSearch, Start,
    };
    use super::*;

    /// An unrecoverable failure of a test evaluation.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    enum Failure {
        Interrupted,
        NoWorker(usize),
        Tell(TellError),
    }

    impl From<TellError> for Failure {
        fn from(error: TellError) -> Self {
            Self::Tell(error)
        }
    }

    fn searches() -> Vec<(Box<dyn Search>, usize)> {
        let bounds = || vec![[-2.0, 3.0], [-1.0, 4.0]];
        let start = || Start::new(vec![0.5, 1.5], vec![1.0; 2], 3).within(bounds());
        let settings = BayesianSettings { points: 100, ..BayesianSettings::default() };
        let ahead = CrossEntropy::new(start(), CrossEntropySettings::default()).expect("a search");
        vec![
            (Box::new(CmaEs::new(start(), CmaEsSettings::default()).expect("a search")), usize::MAX),
            (Box::new(ahead.with_open_generations(2)), usize::MAX),
            (Box::new(BayesianOptimisation::new(bounds(), settings, 3).expect("a search")), 3),
            (Box::new(RandomSearch::new(bounds(), 3).expect("a search")), 4),
        ]
    }

    /// Returns a reward after an amount of work that depends on the candidate. A quarter of the evaluations
    /// fail.
    fn reward(candidate: &Candidate) -> Evaluation {
        let [x, y] = [candidate.parameters[0], candidate.parameters[1]];
        let work = (0..(candidate.seed % 7) * 2000).fold(0.0, |sum: f64, k| sum + (k as f64).sqrt());
        if x < -0.75 && work >= 0.0 {
            return Evaluation::failed(Outcome::Unmet, "fell");
        }
        Evaluation::finished(-(x - 1.0).powi(2) - (y - 2.0).powi(2))
    }

    /// Returns the bits of all parameters and rewards in the order of the reports.
    fn run(
        search: &mut dyn Search,
        workers: Workers,
        stop_after: usize,
    ) -> (Vec<Vec<u64>>, Result<(), Failure>) {
        let mut seen = vec![];
        let result = maximise(
            search,
            workers,
            |_| Ok(()),
            |(), candidate| Ok(reward(candidate)),
            |_, candidate, evaluation| {
                let numbers = candidate.parameters.iter().chain([&evaluation.reward]);
                seen.push(numbers.map(|x| x.to_bits()).collect());
                if seen.len() == stop_after { Err(Failure::Interrupted) } else { Ok(()) }
            },
        );
        (seen, result)
    }

    #[test]
    fn threads_do_not_change_results() {
        for ((mut one, ahead), (mut two, _)) in searches().into_iter().zip(searches()) {
            let workers = Workers { threads: 1, ahead, evaluations: 75 };
            let (expected, result) = run(one.as_mut(), workers, usize::MAX);
            assert_eq!((expected.len(), result), (75, Ok(())));
            let (found, _) = run(two.as_mut(), Workers { threads: 3, ..workers }, usize::MAX);
            assert_eq!(found, expected);
            assert_eq!(one.save(), two.save());
        }
    }

    #[test]
    fn interrupted_search_continues_bit_for_bit() {
        let pairs = searches().into_iter().zip(searches()).zip(searches());
        for (((mut straight, ahead), (mut first, _)), (mut second, _)) in pairs {
            let workers = Workers { threads: 2, ahead, evaluations: 50 };
            let (expected, _) = run(straight.as_mut(), workers, usize::MAX);
            let (mut found, result) = run(first.as_mut(), workers, 17);
            assert_eq!((found.len(), result), (17, Err(Failure::Interrupted)));
            second.restore(&first.save()).expect("a saved state");
            let rest = Workers { threads: 1, ahead, evaluations: 33 };
            found.extend(run(second.as_mut(), rest, usize::MAX).0);
            assert_eq!(found, expected);
        }
    }

    #[test]
    fn failures_of_workers_end_the_search() {
        let search = || RandomSearch::new(vec![[0.0, 1.0]], 1).expect("a search");
        let workers = Workers { threads: 2, ahead: 4, evaluations: 40 };
        let refused = maximise::<_, (), Failure>(
            &mut search(),
            workers,
            |index| Err(Failure::NoWorker(index)),
            |(), _| Ok(Evaluation::finished(0.0)),
            |_, _, _| Ok(()),
        );
        assert!(matches!(refused, Err(Failure::NoWorker(0 | 1))), "{refused:?}");
        let mut reported = 0;
        let interrupted = maximise(
            &mut search(),
            workers,
            |_| Ok(()),
            |(), candidate| if candidate.id == 9 { Err(Failure::Interrupted) } else { Ok(reward_of_one()) },
            |_, _, _| {
                reported += 1;
                Ok(())
            },
        );
        assert_eq!(interrupted, Err(Failure::Interrupted));
        assert!(reported <= 9, "{reported}");
    }

    fn reward_of_one() -> Evaluation {
        Evaluation::finished(1.0)
    }

    #[test]
    #[should_panic(expected = "scoped thread panicked")]
    fn panic_of_a_worker_is_not_swallowed() {
        let mut search = RandomSearch::new(vec![[0.0, 1.0]], 1).expect("a search");
        let workers = Workers { threads: 2, ahead: 4, evaluations: 40 };
        let _ = maximise::<_, _, Failure>(
            &mut search,
            workers,
            |_| Ok(()),
            |(), candidate| {
                assert!(candidate.id != 5, "a defect");
                Ok(reward_of_one())
            },
            |_, _, _| Ok(()),
        );
    }
}
