//! Threads that stay alive between steps of a batch.

#![allow(unsafe_code)] // a borrowed job is run by threads that outlive the borrow; `run` waits for all of them

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle, Thread};

/// Polls of a waiting thread before it sleeps. The pause instruction determines the duration of a poll: 25 ns
/// on an AMD EPYC (measured), 140 cycles on recent processors of Intel and about 10 on older ones. Threads
/// thus poll for 0.03 to 0.5 ms, which covers most gaps between two calls, such as a step of an optimiser.
const SPINS: usize = 10_000;

/// Threads in addition to the caller's, each of which runs a part of every job.
pub(super) struct Workers {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

#[derive(Default)]
struct Shared {
    /// Number of jobs started so far; a worker runs a job whenever it changes.
    started: AtomicUsize,
    /// Workers that have not finished the current job.
    running: AtomicUsize,
    ends: AtomicBool,
    job: Mutex<Option<Job>>,
    /// The first panic of the current job.
    panic: Mutex<Option<Box<dyn Any + Send>>>,
}

/// The function that all threads run, and the thread that waits for them.
#[derive(Clone)]
struct Job {
    work: *const (dyn Fn(usize) + Sync),
    caller: Thread,
}

// SAFETY: the pointer is dereferenced only while `run` keeps the closure borrowed, and the closure is `Sync`.
unsafe impl Send for Job {}

impl Workers {
    /// Starts `count` threads.
    pub(super) fn new(count: usize) -> Self {
        let shared = Arc::new(Shared::default());
        let spawn = |index: usize| {
            let shared = Arc::clone(&shared);
            let thread = thread::Builder::new().name(format!("batch-{}", index + 1));
            thread.spawn(move || shared.serve(index + 1)).expect("the system starts a thread")
        };
        let threads = (0..count).map(spawn).collect();
        Self { shared, threads }
    }

    /// Returns the number of threads that run a job, including the caller's.
    pub(super) fn threads(&self) -> usize {
        self.threads.len() + 1
    }

    /// Calls `work` once on each thread with the thread's number, 0 on the caller's, and returns when all
    /// calls have returned.
    ///
    /// # Panics
    ///
    /// Continues the first panic of a call once all other calls have returned.
    pub(super) fn run(&mut self, work: &(dyn Fn(usize) + Sync)) {
        if self.threads.is_empty() {
            return work(0);
        }
        let shared = &*self.shared;
        let work_of_all: *const (dyn Fn(usize) + Sync) = work;
        // SAFETY: only the lifetime of the borrow is erased. No thread uses the pointer after this function
        // returns: it waits below until every worker has finished, also when its own call panics.
        let work_of_all = unsafe {
            core::mem::transmute::<*const (dyn Fn(usize) + Sync), *const (dyn Fn(usize) + Sync)>(work_of_all)
        };
        *lock(&shared.job) = Some(Job { work: work_of_all, caller: thread::current() });
        shared.running.store(self.threads.len(), Ordering::Relaxed);
        shared.started.fetch_add(1, Ordering::Release);
        self.threads.iter().for_each(|worker| worker.thread().unpark());
        let own = catch_unwind(AssertUnwindSafe(|| work(0)));
        wait_until(|| shared.running.load(Ordering::Acquire) == 0);
        *lock(&shared.job) = None;
        let of_workers = lock(&shared.panic).take();
        if let Some(panic) = own.err().or(of_workers) {
            resume_unwind(panic);
        }
    }
}

impl Shared {
    /// Runs every job as thread number `index` until the batch is dropped.
    fn serve(&self, index: usize) {
        let mut seen = 0;
        loop {
            wait_until(|| self.started.load(Ordering::Acquire) != seen || self.ends.load(Ordering::Acquire));
            if self.ends.load(Ordering::Acquire) {
                return;
            }
            seen = self.started.load(Ordering::Acquire);
            let Some(job) = lock(&self.job).clone() else { continue };
            // SAFETY: `run` keeps the closure borrowed until this worker has counted itself out below.
            let work = unsafe { &*job.work };
            if let Err(panic) = catch_unwind(AssertUnwindSafe(|| work(index))) {
                lock(&self.panic).get_or_insert(panic);
            }
            if self.running.fetch_sub(1, Ordering::AcqRel) == 1 {
                job.caller.unpark();
            }
        }
    }
}

impl Drop for Workers {
    fn drop(&mut self) {
        self.shared.ends.store(true, Ordering::Release);
        for worker in self.threads.drain(..) {
            worker.thread().unpark();
            // A worker catches the panics of its jobs.
            let _ = worker.join();
        }
    }
}

/// Waits until another thread makes `condition` true and unparks this one: spins briefly, then sleeps.
fn wait_until(condition: impl Fn() -> bool) {
    for _ in 0..SPINS {
        if condition() {
            return;
        }
        core::hint::spin_loop();
    }
    while !condition() {
        thread::park();
    }
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_thread_runs_each_job_once() {
        for count in [0, 1, 3] {
            let mut workers = Workers::new(count);
            let calls: Vec<AtomicUsize> = (0..workers.threads()).map(|_| AtomicUsize::new(0)).collect();
            for _ in 0..1000 {
                workers.run(&|index| {
                    calls[index].fetch_add(1, Ordering::Relaxed);
                });
            }
            assert!(calls.iter().all(|calls| calls.load(Ordering::Relaxed) == 1000), "{calls:?}");
        }
    }

    #[test]
    fn a_panicking_job_ends_after_all_threads() {
        let mut workers = Workers::new(2);
        for failing in 0..3 {
            let finished = AtomicUsize::new(0);
            let outcome = catch_unwind(AssertUnwindSafe(|| {
                workers.run(&|index| {
                    assert!(index != failing, "thread {index} fails");
                    finished.fetch_add(1, Ordering::Relaxed);
                });
            }));
            let message = outcome.expect_err("the panic continues");
            assert_eq!(
                message.downcast_ref::<String>().map(String::as_str),
                Some(&*format!("thread {failing} fails"))
            );
            assert_eq!(finished.load(Ordering::Relaxed), 2);
        }
        let after = AtomicUsize::new(0);
        workers.run(&|_| {
            after.fetch_add(1, Ordering::Relaxed);
        });
        assert_eq!(after.load(Ordering::Relaxed), 3, "the threads are still there");
    }

    #[test]
    fn sleeping_threads_wake_for_a_job_and_for_the_end() {
        let mut workers = Workers::new(1);
        let calls = AtomicUsize::new(0);
        let asleep = |worker: &JoinHandle<()>| !worker.is_finished();
        for _ in 0..5 {
            // Longer than the spin phase of a worker.
            let end = std::time::Instant::now() + std::time::Duration::from_millis(5);
            while std::time::Instant::now() < end {
                thread::yield_now();
            }
            assert!(workers.threads.iter().all(asleep));
            workers.run(&|_| {
                calls.fetch_add(1, Ordering::Relaxed);
            });
        }
        assert_eq!(calls.load(Ordering::Relaxed), 10);
    }
}
