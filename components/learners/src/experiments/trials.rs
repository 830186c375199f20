//! Trials with several seeds, on several threads, and their statistics.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};

use motorium_library::statistics::mean_and_error;
use motorium_physics::Articulated;

use crate::environment::{Environment, EnvironmentError, Scene};
use crate::search::{Power, PowerSettings, Search as _, Start, StartError, TellError};
use crate::task::Task;

/// Episodes of an evaluation.
pub(super) const EPISODES: u64 = 10;
/// World of the evaluations; training uses the worlds from 0.
pub(super) const EVALUATION_WORLD: u64 = 1_000;

/// A task and its scene, from which every trial creates environments.
#[derive(Clone, Copy)]
pub(super) struct Setting<'a> {
    pub(super) task: &'a Task,
    pub(super) scene: &'a Scene,
}

impl Setting<'_> {
    pub(super) fn environment(
        self,
        seed: u64,
        world: u64,
    ) -> Result<Environment<Articulated>, EnvironmentError> {
        Environment::new(self.task, self.scene.simulation()?, seed, world)
    }
}

/// Runs PoWER for `rollouts` episodes, one at a time, and returns a learning curve. `rollout` returns the
/// reward of the tried weights. `evaluate` returns a point of the curve for the mean weights: before the
/// first rollout, every `interval` rollouts, and after the last rollout.
pub(super) fn power_curve<P, E: From<StartError> + From<TellError>>(
    start: Start,
    (rollouts, interval): (u64, u64),
    mut rollout: impl FnMut(&[f64]) -> Result<f64, E>,
    evaluate: impl Fn(&[f64], u64) -> Result<P, E>,
) -> Result<Vec<P>, E> {
    let mut search = Power::new(start, PowerSettings::default())?;
    let mut curve = vec![evaluate(&search.mean(), 0)?];
    for done in 1..=rollouts {
        for candidate in search.ask(1) {
            let reward = rollout(&candidate.parameters)?;
            search.tell(&[(candidate.id, reward)])?;
        }
        if done.is_multiple_of(interval) || done == rollouts {
            curve.push(evaluate(&search.mean(), done)?);
        }
    }
    Ok(curve)
}

/// Runs jobs on several threads and returns their results in the order of the jobs. `build` creates the
/// worker of a thread, and `work` runs a job with this worker. After a failure no further job starts.
///
/// # Errors
///
/// Returns the first error of `build` or `work`.
pub fn run_jobs<J: Sync, W, T: Send, E: Send>(
    threads: usize,
    jobs: &[J],
    build: impl Fn(usize) -> Result<W, E> + Sync,
    work: impl Fn(&mut W, &J) -> Result<T, E> + Sync,
) -> Result<Vec<T>, E> {
    let (next, has_failed) = (AtomicUsize::new(0), AtomicBool::new(false));
    let run = |thread: usize| -> Result<Vec<(usize, T)>, E> {
        let mut worker = build(thread)?;
        let mut done = Vec::new();
        while !has_failed.load(Relaxed) {
            let index = next.fetch_add(1, Relaxed);
            let Some(job) = jobs.get(index) else { break };
            done.push((index, work(&mut worker, job)?));
        }
        Ok(done)
    };
    let (run, has_failed) = (&run, &has_failed);
    let parts: Vec<Result<Vec<(usize, T)>, E>> = std::thread::scope(|scope| {
        let threads = (0..threads.max(1))
            .map(|thread| scope.spawn(move || run(thread).inspect_err(|_| has_failed.store(true, Relaxed))));
        let threads: Vec<_> = threads.collect();
        let joined = threads.into_iter().map(|thread| thread.join());
        joined.map(|part| part.unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
    });
    let mut done: Vec<(usize, T)> = Vec::with_capacity(jobs.len());
    for part in parts {
        done.extend(part?);
    }
    done.sort_by_key(|(index, _)| *index);
    Ok(done.into_iter().map(|(_, result)| result).collect())
}

/// Returns, for every column, the number of the column, the mean over all rows, and the standard error of
/// this mean. There is one row per seed. Columns are numbered from `first`.
pub fn over_seeds(rows: &[Vec<f64>], first: usize) -> Vec<[f64; 3]> {
    let columns = rows.iter().map(Vec::len).min().unwrap_or(0);
    let column = |k: usize| {
        let values: Vec<f64> = rows.iter().map(|row| row[k]).collect();
        let (mean, error) = mean_and_error(&values);
        [(k + first) as f64, mean, error]
    };
    (0..columns).map(column).collect()
}

/// Returns the median of `values`; NaN if there are no values.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    match sorted.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => sorted[n / 2],
        n => 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_have_the_order_of_their_jobs() {
        let jobs: Vec<u32> = (0..100).collect();
        for threads in [0, 1, 2, 7] {
            let double = |(): &mut (), job: &u32| Ok::<u32, ()>(2 * job);
            let found = run_jobs(threads, &jobs, |_| Ok(()), double).expect("no job fails");
            assert!(found.iter().zip(&jobs).all(|(found, job)| *found == 2 * job), "{threads} threads");
            assert_eq!(found.len(), 100);
        }
    }

    #[test]
    fn no_job_starts_after_a_failure() {
        let started = AtomicUsize::new(0);
        let work = |(): &mut (), job: &u32| {
            started.fetch_add(1, Relaxed);
            if *job == 3 { Err(*job) } else { Ok(()) }
        };
        let jobs: Vec<u32> = (0..100).collect();
        assert_eq!(run_jobs(1, &jobs, |_| Ok(()), work), Err(3));
        assert_eq!(started.load(Relaxed), 4);
    }

    #[test]
    fn medians_of_even_and_odd_counts() {
        assert_eq!(median(&[3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), 2.5);
        assert!(median(&[]).is_nan());
    }
}
