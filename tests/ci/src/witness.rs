//! Observation of the host while real-time checks run.

use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use crate::clock;
use crate::evidence::{Gap, Record, Sample, Span};
use crate::proc;

/// Period of the threads that look for gaps.
const PERIOD: Duration = Duration::from_millis(1);
/// Shortest gap that is recorded.
const RECORDED_GAP: Duration = Duration::from_millis(5);
/// Period at which the counters of the kernel are read.
const SAMPLING: Duration = Duration::from_millis(50);
/// Real-time priority above every component.
const PRIORITY: &str = "98";

/// Observed quantities.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Watch {
    /// Steal, and gaps of a thread on each core.
    Gaps,
    /// Steal only: measurements of microseconds must not be disturbed.
    Steal,
}

/// Running observation. Stop it with [`stop`](Self::stop).
pub(crate) struct Witness {
    stop: Arc<AtomicBool>,
    sampler: JoinHandle<Vec<Sample>>,
    cores: Vec<JoinHandle<(bool, Vec<Gap>)>>,
}

impl Witness {
    pub(crate) fn start(watch: Watch) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let first = sample();
        let cores: Vec<usize> = match watch {
            Watch::Gaps => first.cores.iter().map(|ticks| ticks.core).collect(),
            Watch::Steal => Vec::new(),
        };
        let (sampler_stop, core_stop) = (stop.clone(), stop.clone());
        let sampler = thread::spawn(move || samples(first, &sampler_stop));
        let on_core = |core: usize| {
            let stop = core_stop.clone();
            thread::spawn(move || gaps(core, &stop))
        };
        Self { stop, sampler, cores: cores.into_iter().map(on_core).collect() }
    }

    /// Ends the observation. A thread that panicked contributes nothing.
    pub(crate) fn stop(self) -> Record {
        // an observed check may end just after a stop of the machine
        thread::sleep(SAMPLING);
        self.stop.store(true, Ordering::Relaxed);
        let mut record = Record { is_real_time: !self.cores.is_empty(), ..Record::default() };
        for core in self.cores {
            let (is_real_time, gaps) = core.join().unwrap_or_default();
            record.is_real_time &= is_real_time;
            record.gaps.extend(gaps);
        }
        record.samples = self.sampler.join().unwrap_or_default();
        record
    }
}

fn sample() -> Sample {
    let stat = std::fs::read_to_string("/proc/stat").unwrap_or_default();
    Sample { time: clock::now(), cores: proc::cores(&stat) }
}

fn samples(first: Sample, stop: &AtomicBool) -> Vec<Sample> {
    let mut samples = vec![first];
    loop {
        let is_last = stop.load(Ordering::Relaxed);
        samples.push(sample());
        if is_last {
            return samples;
        }
        thread::sleep(SAMPLING);
    }
}

/// Returns `true` if this thread is bound to the core at real-time priority, and its gaps.
fn gaps(core: usize, stop: &AtomicBool) -> (bool, Vec<Gap>) {
    let is_real_time = take_core(core);
    let mut gaps = Vec::new();
    let mut before = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        thread::sleep(PERIOD);
        let now = Instant::now();
        let gap = (now - before).saturating_sub(PERIOD);
        if gap >= RECORDED_GAP {
            let end = clock::now();
            gaps.push(Gap { core, span: Span { start: end - gap.as_secs_f64(), end } });
        }
        before = now;
    }
    (is_real_time, gaps)
}

/// Binds this thread to a core at real-time priority. Returns `false` if that is not permitted.
fn take_core(core: usize) -> bool {
    let Ok(thread) = std::fs::read_link("/proc/thread-self") else { return false };
    let Some(thread) = thread.file_name().and_then(|name| name.to_str()) else { return false };
    let succeeds = |program: &str, arguments: &[&str]| {
        let mut command = Command::new(program);
        command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        command.status().is_ok_and(|status| status.success())
    };
    // the priority comes last: programs started afterwards would inherit it
    succeeds("taskset", &["-c", "-p", &core.to_string(), thread])
        && succeeds("chrt", &["--fifo", "-p", PRIORITY, thread])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn record_covers_the_observation() {
        let began = clock::now();
        let witness = Witness::start(Watch::Gaps);
        let busy = Instant::now();
        while busy.elapsed() < Duration::from_millis(100) {
            std::hint::spin_loop();
        }
        let record = witness.stop();
        let ended = clock::now();
        let (first, last) = (&record.samples[0], &record.samples[record.samples.len() - 1]);
        assert!(began <= first.time && first.time < last.time && last.time <= ended);
        assert!(record.samples.len() >= 3 && !first.cores.is_empty(), "{record:?}");
        assert!(record.gaps.iter().all(|gap| gap.span.seconds() >= 0.004), "{:?}", record.gaps);
        assert!(record.description().starts_with("the host took "), "{}", record.description());
    }

    #[test]
    fn steal_alone_starts_no_gap_threads() {
        let record = Witness::start(Watch::Steal).stop();
        assert!(!record.is_real_time && record.gaps.is_empty() && record.samples.len() >= 2);
    }
}
