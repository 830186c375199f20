//! How late this machine wakes a thread: the floor under every time-triggered component.

use std::time::Duration;

use motorium::os::{IdleLimit, Request, apply, monotonic_ns, prefault_stack, sleep_until};
use motorium::plan::SchedulingClass;
use motorium::run_folder::RunFolder;
use motorium::telemetry::{Histogram, Percentiles};
use serde::Serialize;

use super::finding::Finding;
use super::{machine, privileges};
use crate::report::microseconds;

/// The period that is measured at, ns: 1 kHz.
const PERIOD_NS: u64 = 1_000_000;
/// A wake-up may be late by this share of the period.
const SHARE: f64 = 0.1;

/// Measured wake-ups.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Measured {
    /// Time from the deadline to the thread looking at the clock, ns.
    pub(super) lateness_ns: Percentiles,
    pub(super) count: u64,
    /// `SCHED_FIFO` priority it was measured at, read back; 0 for normal time sharing.
    pub(super) fifo_priority: u8,
    pub(super) core: Option<usize>,
}

/// Sleeps to absolute deadlines a millisecond apart, at real-time priority if that is granted, on the core that
/// graphs choose for real-time components, with idle states limited as they do where that is granted. Beside a running graph it gives way to all of its components.
pub(super) fn measure(time: Duration) -> Option<Measured> {
    let beside = RunFolder::list().iter().any(RunFolder::is_alive);
    let priority = if beside { 1 } else { privileges::PRIORITY };
    std::thread::scope(|scope| scope.spawn(|| measure_here(time, priority)).join().ok())
}

fn measure_here(time: Duration, priority: u8) -> Measured {
    let core = machine::online().last().copied();
    let class = SchedulingClass::Fifo(priority);
    let _idle_limit = IdleLimit::hold(Duration::ZERO);
    let (applied, _) = apply(&Request { class, cores: core.into_iter().collect(), lock_memory: false });
    prefault_stack();
    let late = Histogram::default();
    let periods = (time.as_nanos() / u128::from(PERIOD_NS)).max(1);
    let mut deadline = monotonic_ns() + PERIOD_NS;
    for _ in 0..periods {
        sleep_until(deadline);
        let now = monotonic_ns();
        late.record(now.saturating_sub(deadline));
        // After a delay of several periods the missed ones are not waited for: they would count as on time.
        let passed = now.saturating_sub(deadline) / PERIOD_NS + 1;
        deadline += passed * PERIOD_NS;
    }
    Measured {
        lateness_ns: late.percentiles(),
        count: late.count(),
        fifo_priority: applied.fifo_priority,
        core: core.filter(|core| applied.cores == [*core]),
    }
}

pub(super) fn judge(measured: &Measured) -> Finding {
    let name = "wake-up";
    let late = measured.lateness_ns;
    let how = match measured.fifo_priority {
        0 => "without real-time priority".to_string(),
        1 => "at SCHED_FIFO 1, beside a running graph".to_string(),
        priority => format!("at SCHED_FIFO {priority}"),
    };
    let allowed = (PERIOD_NS as f64 * SHARE) as u64;
    let found = format!(
        "late by p50 {} / p99 {} / p99.9 {} / max {} us ({} sleeps at 1 kHz {how}); {} us allowed, 10 % of the period",
        microseconds(late.p50),
        microseconds(late.p99),
        microseconds(late.p999),
        microseconds(late.max),
        measured.count,
        microseconds(allowed),
    );
    let fix = "see to what is listed above, stop what else runs on this machine, and measure longer: \
               motorium doctor --measure 60s";
    if late.p999 <= allowed {
        Finding::pass(name, found)
    } else if late.p99 <= allowed {
        Finding::warn(name, format!("{found}, which 1 in 1000 exceeds"), fix)
    } else {
        Finding::fail(name, format!("{found}, which 1 in 100 exceeds"), fix)
    }
}

#[cfg(test)]
mod tests {
    use super::super::finding::Verdict;
    use super::*;

    fn measured(p99: u64, p999: u64) -> Measured {
        let lateness_ns = Percentiles { p50: 20_000, p99, p999, max: 900_000 };
        Measured { lateness_ns, count: 5000, fifo_priority: 80, core: Some(1) }
    }

    #[test]
    fn a_tenth_of_the_period_is_the_measure() {
        assert_eq!(judge(&measured(38_000, 99_000)).verdict, Verdict::Pass);
        assert_eq!(judge(&measured(38_000, 101_000)).verdict, Verdict::Warn);
        assert_eq!(judge(&measured(101_000, 300_000)).verdict, Verdict::Fail);
    }

    #[test]
    fn every_sleep_is_counted_and_none_ends_before_its_deadline() {
        let measured = measure(Duration::from_millis(50)).unwrap();
        assert_eq!(measured.count, 50);
        let late = measured.lateness_ns;
        assert!(late.p50 <= late.p99 && late.p99 <= late.p999 && late.p999 <= late.max);
        assert!(late.p50 > 0, "a wake-up takes time");
    }
}
