//! Evidence that the host kept this machine from running.
//!
//! Two observations are combined. A thread on each core wakes every millisecond at the highest real-time
//! priority, so a long gap between two wake-ups means that its core did not run. The kernel also counts the
//! time that the host reports as stolen from each core. A gap alone is no evidence: the kernel throttles all
//! real-time threads of a core on which one of them spins. Therefore a gap only counts if the kernel reports
//! at least half of it as stolen, or if all cores show the gap at the same time on a machine with two or more
//! cores.

use core::fmt;

use crate::proc::{CoreTicks, TICKS_PER_SECOND};

/// Shortest gap [s] that makes a failed real-time check inconclusive, unless the check says what it endures.
pub(crate) const MIN_GAP_S: f64 = 0.020;
/// Smallest stolen share of the processor time that makes a failed real-time check inconclusive.
pub(crate) const MIN_STEAL_SHARE: f64 = 0.05;
/// Share of a gap that must be reported as stolen.
const CONFIRMED_SHARE: f64 = 0.5;

/// A period of Unix time [s].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Span {
    pub(crate) start: f64,
    pub(crate) end: f64,
}

impl Span {
    pub(crate) fn seconds(self) -> f64 {
        self.end - self.start
    }

    fn intersection(self, other: Self) -> Option<Self> {
        let span = Self { start: self.start.max(other.start), end: self.end.min(other.end) };
        (span.end > span.start).then_some(span)
    }
}

/// A period in which the witness thread of a core did not run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Gap {
    pub(crate) core: usize,
    pub(crate) span: Span,
}

/// The counters of all cores at one time.
#[derive(Debug, Clone)]
pub(crate) struct Sample {
    pub(crate) time: f64,
    pub(crate) cores: Vec<CoreTicks>,
}

/// Observations during one step.
#[derive(Debug, Clone, Default)]
pub(crate) struct Record {
    /// Every witness thread was bound to its core at real-time priority.
    pub(crate) is_real_time: bool,
    /// Gaps of all cores.
    pub(crate) gaps: Vec<Gap>,
    /// In order of time.
    pub(crate) samples: Vec<Sample>,
}

/// What the host did during a failed check.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Disturbance {
    /// A core, or the whole machine, did not run for this long.
    Stopped { ms: f64 },
    /// The host took this time from all cores together, in pieces.
    Stolen { ms: f64, share: f64 },
}

impl fmt::Display for Disturbance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stopped { ms } => write!(f, "the host took {ms:.0} ms in one piece"),
            Self::Stolen { ms, share } => {
                write!(f, "the host took {ms:.0} ms, {:.1} % of the processor time", 100.0 * share)
            }
        }
    }
}

impl Record {
    /// Returns the disturbance in a window, if it is large enough to explain a failed real-time check, which
    /// endures stops shorter than `endured_s`.
    pub(crate) fn disturbance(&self, window: Span, endured_s: f64) -> Option<Disturbance> {
        let inside = self.stops().into_iter().filter_map(|stop| stop.intersection(window));
        let longest = inside.map(Span::seconds).fold(0.0, f64::max);
        if longest >= endured_s {
            return Some(Disturbance::Stopped { ms: 1e3 * longest });
        }
        let (stolen, total) = self.stolen_s(window, None)?;
        let share = stolen / total;
        (share >= MIN_STEAL_SHARE).then_some(Disturbance::Stolen { ms: 1e3 * stolen, share })
    }

    /// Periods in which a core or the whole machine was stopped by the host.
    fn stops(&self) -> Vec<Span> {
        let is_confirmed = |gap: &&Gap| {
            let stolen = self.stolen_s(gap.span, Some(gap.core));
            stolen.is_some_and(|(stolen, _)| stolen >= CONFIRMED_SHARE * gap.span.seconds())
        };
        let confirmed = self.gaps.iter().filter(is_confirmed).map(|gap| gap.span);
        confirmed.chain(self.common_gaps()).collect()
    }

    /// Gaps that all cores show at the same time.
    fn common_gaps(&self) -> Vec<Span> {
        let cores: Vec<usize> = self
            .samples
            .first()
            .map_or_else(Vec::new, |sample| sample.cores.iter().map(|it| it.core).collect());
        // one thread that spins throttles the only core
        if !self.is_real_time || cores.len() < 2 {
            return Vec::new();
        }
        let of_core = |core: usize| self.gaps.iter().filter(move |gap| gap.core == core).map(|gap| gap.span);
        let first: Vec<Span> = of_core(cores[0]).collect();
        cores[1..].iter().fold(first, |common, core| {
            let with_core = |span: Span| of_core(*core).filter_map(move |gap| gap.intersection(span));
            common.into_iter().flat_map(with_core).collect()
        })
    }

    /// Stolen and total time [s] of a core, or of all cores, between the samples around a window.
    fn stolen_s(&self, window: Span, core: Option<usize>) -> Option<(f64, f64)> {
        let before = self.samples.iter().rev().find(|sample| sample.time <= window.start);
        let after = self.samples.iter().find(|sample| sample.time >= window.end);
        let (before, after) = (before.or(self.samples.first())?, after.or(self.samples.last())?);
        let sum = |sample: &Sample| {
            let cores = sample.cores.iter().filter(|ticks| core.is_none_or(|core| ticks.core == core));
            cores.fold((0, 0), |(stolen, total), ticks| (stolen + ticks.steal, total + ticks.total))
        };
        let ((stolen_0, total_0), (stolen_1, total_1)) = (sum(before), sum(after));
        let seconds = |from: u64, to: u64| to.saturating_sub(from) as f64 / TICKS_PER_SECOND;
        let (stolen, total) = (seconds(stolen_0, stolen_1), seconds(total_0, total_1));
        (total > 0.0).then_some((stolen, total))
    }

    /// Describes the whole record in one line.
    pub(crate) fn description(&self) -> String {
        let (Some(first), Some(last)) = (self.samples.first(), self.samples.last()) else {
            return "the host was not observed".to_string();
        };
        let whole = Span { start: first.time, end: last.time };
        let (stolen, total) = self.stolen_s(whole, None).unwrap_or((0.0, 1.0));
        let mut text = format!("the host took {:.0} ms ({:.2} %)", 1e3 * stolen, 100.0 * stolen / total);
        let mut stops = self.stops();
        stops.sort_by(|one, other| other.seconds().total_cmp(&one.seconds()));
        if stops.is_empty() {
            text += ", no stop seen";
        } else {
            let longest = stops
                .iter()
                .take(5)
                .map(|stop| format!("{:.0} ms at {:.2} s", 1e3 * stop.seconds(), stop.start - first.time));
            text += &format!(", longest stops: {}", longest.collect::<Vec<_>>().join(", "));
        }
        if !self.is_real_time {
            text += "; steal only, no gaps measured at real-time priority";
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two cores, sampled every 0.1 s for 10 s; `steal` has the ticks of each core at a time.
    fn record(gaps: &[(usize, f64, f64)], steal: impl Fn(f64) -> [u64; 2]) -> Record {
        let sample = |index: u32| {
            let time = f64::from(index) / 10.0;
            let ticks =
                |core: usize| CoreTicks { core, total: u64::from(index) * 10, steal: steal(time)[core] };
            Sample { time, cores: vec![ticks(0), ticks(1)] }
        };
        let gap = |&(core, start, end): &(usize, f64, f64)| Gap { core, span: Span { start, end } };
        Record {
            is_real_time: true,
            gaps: gaps.iter().map(gap).collect(),
            samples: (0..=100).map(sample).collect(),
        }
    }

    const WINDOW: Span = Span { start: 2.0, end: 6.0 };

    fn stopped_ms(record: &Record, window: Span) -> Option<i64> {
        match record.disturbance(window, MIN_GAP_S) {
            Some(Disturbance::Stopped { ms }) => Some(ms.round() as i64),
            Some(Disturbance::Stolen { .. }) | None => None,
        }
    }

    #[test]
    fn quiet_host_is_no_excuse() {
        assert_eq!(record(&[], |_| [7, 9]).disturbance(WINDOW, MIN_GAP_S), None);
        assert_eq!(Record::default().disturbance(WINDOW, MIN_GAP_S), None);
    }

    #[test]
    fn gap_of_one_core_needs_steal() {
        let gaps = [(1, 3.0, 3.05)];
        assert_eq!(record(&gaps, |_| [0, 0]).disturbance(WINDOW, MIN_GAP_S), None, "throttled by the kernel");
        let stolen = record(&gaps, |time| [0, if time > 3.0 { 3 } else { 0 }]);
        assert_eq!(stopped_ms(&stolen, WINDOW), Some(50));
        let from_other = record(&gaps, |time| [if time > 3.0 { 3 } else { 0 }, 0]);
        assert_eq!(from_other.disturbance(WINDOW, MIN_GAP_S), None, "stolen from the other core");
    }

    #[test]
    fn gap_of_all_cores_counts_where_they_overlap() {
        let gaps = [(0, 3.0, 3.060), (1, 3.020, 3.090)];
        assert_eq!(stopped_ms(&record(&gaps, |_| [0, 0]), WINDOW), Some(40));
        let mut without_priority = record(&gaps, |_| [0, 0]);
        without_priority.is_real_time = false;
        assert_eq!(without_priority.disturbance(WINDOW, MIN_GAP_S), None);
    }

    #[test]
    fn gaps_outside_the_window_do_not_count() {
        let gaps = [(0, 1.90, 2.010), (1, 1.90, 2.010)];
        assert_eq!(record(&gaps, |_| [0, 0]).disturbance(WINDOW, MIN_GAP_S), None, "10 ms are inside");
        let gaps = [(0, 1.90, 2.021), (1, 1.90, 2.021)];
        assert_eq!(stopped_ms(&record(&gaps, |_| [0, 0]), WINDOW), Some(21));
    }

    #[test]
    fn check_that_endures_less_is_disturbed_by_less() {
        let stopped = record(&[(0, 3.0, 3.015), (1, 3.0, 3.015)], |_| [0, 0]);
        assert_eq!(stopped.disturbance(WINDOW, MIN_GAP_S), None);
        assert!(matches!(stopped.disturbance(WINDOW, 0.012), Some(Disturbance::Stopped { .. })));
    }

    #[test]
    fn five_percent_steal_in_the_window_counts() {
        // 4 s of two cores are 800 ticks
        let until = |ticks: u64| move |time: f64| [if time > 4.0 { ticks } else { 0 }, 0];
        assert_eq!(record(&[], until(39)).disturbance(WINDOW, MIN_GAP_S), None);
        let found = record(&[], until(40)).disturbance(WINDOW, MIN_GAP_S);
        assert!(matches!(found, Some(Disturbance::Stolen { share, .. }) if (share - 0.05).abs() < 1e-9));
        let later = Span { start: 5.0, end: 9.0 };
        assert_eq!(record(&[], until(400)).disturbance(later, MIN_GAP_S), None, "stolen before the window");
    }

    #[test]
    fn description_names_the_longest_stops() {
        let gaps = [(0, 3.0, 3.060), (1, 3.020, 3.090)];
        let text = record(&gaps, |time| [if time > 4.0 { 2 } else { 0 }, 0]).description();
        assert_eq!(text, "the host took 20 ms (0.10 %), longest stops: 40 ms at 3.02 s");
    }
}
