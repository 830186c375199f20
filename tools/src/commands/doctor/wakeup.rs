//! Lateness of wake-ups on this machine: the lower bound for every time-triggered component.

use std::time::Duration;

use motorium::os::IdleLimit;
use motorium::os::machine::online_cores;
use motorium::run_folder::RunFolder;
use motorium::telemetry::{Histogram, Percentiles};
use motorium_benches::timer::{PERIOD_NS, timer};
use serde::Serialize;

use super::finding::Finding;
use super::privileges;
use crate::report::microseconds;

/// Permitted lateness of a wake-up as a fraction of the period.
const SHARE: f64 = 0.1;

/// Measured wake-ups.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Measured {
    /// Time from the deadline to the thread's first clock reading, ns.
    pub(super) lateness_ns: Percentiles,
    pub(super) count: u64,
    /// `SCHED_FIFO` priority read back during the measurement; 0 for normal time sharing.
    pub(super) fifo_priority: u8,
    pub(super) core: Option<usize>,
}

/// Measures for this time on the core that graphs choose for real-time components, at real-time priority if
/// granted, with the idle states limited as in graphs. Every component of a running graph preempts the
/// measurement.
pub(super) fn measure(time: Duration) -> Option<Measured> {
    let beside = RunFolder::list().iter().any(RunFolder::is_alive);
    let priority = if beside { 1 } else { privileges::PRIORITY };
    let core = *online_cores().last()?;
    let count = (time.as_nanos() / u128::from(PERIOD_NS)).max(1);
    let _idle_limit = IdleLimit::hold(Duration::ZERO);
    let measured = timer(core, priority, usize::try_from(count).ok()?).ok()?;
    let late = Histogram::default();
    measured.late_ns.iter().for_each(|ns| late.record(*ns));
    Some(Measured {
        lateness_ns: late.percentiles(),
        count: late.count(),
        fifo_priority: measured.fifo,
        core: measured.pinned.then_some(core),
    })
}

pub(super) fn check(measured: &Measured) -> Finding {
    let name = "wake-up";
    let late = measured.lateness_ns;
    let how = match measured.fifo_priority {
        0 => "without real-time priority".to_string(),
        1 => "at SCHED_FIFO 1, with a running graph".to_string(),
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
    let fix =
        "fix the findings above, stop other programs, and measure longer: motorium doctor --measure 60s";
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
    fn limit_is_a_tenth_of_the_period() {
        assert_eq!(check(&measured(38_000, 99_000)).verdict, Verdict::Pass);
        assert_eq!(check(&measured(38_000, 101_000)).verdict, Verdict::Warn);
        assert_eq!(check(&measured(101_000, 300_000)).verdict, Verdict::Fail);
    }

    #[test]
    fn every_sleep_is_counted_and_none_ends_early() {
        let measured = measure(Duration::from_millis(50)).unwrap();
        assert_eq!(measured.count, 50);
        let late = measured.lateness_ns;
        assert!(late.p50 <= late.p99 && late.p99 <= late.p999 && late.p999 <= late.max);
        assert!(late.p50 > 0, "a wake-up takes time");
    }
}
