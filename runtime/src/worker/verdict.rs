//! The cause of a missed deadline and the limit on such steps, as pure functions of measured times.

use crate::region::MissCause;

/// The measured times of a finished step, ns on the clock of stamps.
#[derive(Debug, Clone, Copy)]
pub(super) struct Evidence {
    pub(super) release_ns: u64,
    pub(super) wake_ns: u64,
    pub(super) end_ns: u64,
    pub(super) deadline_ns: u64,
    /// CPU time of the step.
    pub(super) cpu_ns: u64,
    /// Time that the component was ready to run while another thread of this system had its core; `None` if
    /// the kernel does not measure it.
    pub(super) waited_ns: Option<u64>,
    /// True if the step slept, on a lock, a file or a clock.
    pub(super) blocked: bool,
    /// Longest declared wait for an answer; sleep up to this time is intended.
    pub(super) waits_ns: u64,
    /// Cause of the previous step's overrun, if that step ended after this release.
    pub(super) behind: Option<MissCause>,
}

impl Evidence {
    /// Returns the wall-clock duration of the step, ns.
    pub(super) fn execution_ns(&self) -> u64 {
        self.end_ns.saturating_sub(self.wake_ns)
    }

    /// Returns the duration of the step excluding the time in which other threads had the core or the host
    /// had the machine, ns. The step's own sleep is included, for a component that may wait for an answer
    /// only up to the declared time.
    pub(super) fn own_ns(&self) -> u64 {
        match (self.blocked, self.waits_ns) {
            (false, _) => self.execution_ns().min(self.cpu_ns),
            (true, 0) => self.execution_ns(),
            (true, waits) => self.execution_ns().min(self.cpu_ns.saturating_add(waits)),
        }
    }

    /// Returns the cause of a missed deadline; `None` if it was met.
    ///
    /// Between its release and its end a step either runs, or waits for the core while other threads of this
    /// system have it, or does not run although the core is free. In the last case the host has the core or
    /// wakes the step late. If the step would have been late without any waiting, it was too long. Otherwise
    /// the larger share of the waiting is the cause.
    pub(super) fn cause(&self) -> Option<MissCause> {
        let over = self.end_ns.checked_sub(self.deadline_ns).filter(|over| *over > 0)?;
        if self.behind.is_some() {
            return self.behind;
        }
        let late = self.wake_ns.saturating_sub(self.release_ns);
        let lost = (late + self.execution_ns()).saturating_sub(self.own_ns());
        if lost < over {
            return Some(MissCause::LongStep);
        }
        // The kernel does not measure waiting: a late start counts as waiting, and a gap within the step as
        // time taken by the host.
        let waited = self.waited_ns.unwrap_or(late).min(lost);
        Some(if waited >= lost - waited { MissCause::LateWake } else { MissCause::Stolen })
    }
}

/// A counter of overruns that decreases again: each late step adds one, each step in time subtracts one.
///
/// This is how the overrun counter of Orocos RTT works: a component that is occasionally late keeps running,
/// and a component that is late more often than not is stopped.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct LeakyCounter(u32);

impl LeakyCounter {
    /// Counts a step. Returns `true` if there are now more overruns than tolerated.
    pub(super) fn count(&mut self, overrun: bool, tolerated: Option<u32>) -> bool {
        self.0 = if overrun { self.0.saturating_add(1) } else { self.0.saturating_sub(1) };
        overrun && tolerated.is_some_and(|tolerated| self.0 > tolerated)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a step released at 1000 with a deadline of 2000 and 100 of work.
    fn in_time() -> Evidence {
        Evidence {
            release_ns: 1_000,
            wake_ns: 1_000,
            end_ns: 1_100,
            deadline_ns: 2_000,
            cpu_ns: 100,
            waited_ns: Some(0),
            blocked: false,
            waits_ns: 0,
            behind: None,
        }
    }

    #[test]
    fn declared_wait_does_not_cover_other_idle_time() {
        let answered = Evidence { end_ns: 1_900, blocked: true, waits_ns: 800, ..in_time() };
        assert_eq!((answered.cause(), answered.own_ns()), (None, 900));
        let stolen = Evidence { end_ns: 9_100, ..answered };
        assert_eq!((stolen.cause(), stolen.own_ns()), (Some(MissCause::Stolen), 900));
        let long = Evidence { end_ns: 2_300, waits_ns: 1_200, ..answered };
        assert_eq!(long.cause(), Some(MissCause::LongStep));
    }

    #[test]
    fn step_that_ends_at_its_deadline_misses_nothing() {
        assert_eq!(in_time().cause(), None);
        assert_eq!(Evidence { end_ns: 2_000, cpu_ns: 1_000, ..in_time() }.cause(), None);
    }

    #[test]
    fn step_that_works_past_its_deadline_is_too_long() {
        let long = Evidence { end_ns: 2_300, cpu_ns: 1_300, ..in_time() };
        assert_eq!(long.cause(), Some(MissCause::LongStep));
        assert_eq!(long.own_ns(), 1_300);
        // also woken a little late, which alone would not have mattered
        let both = Evidence { wake_ns: 1_050, end_ns: 2_350, cpu_ns: 1_300, ..in_time() };
        assert_eq!(both.cause(), Some(MissCause::LongStep));
    }

    #[test]
    fn step_that_sleeps_past_its_deadline_is_too_long() {
        let asleep = Evidence { end_ns: 9_100, cpu_ns: 100, blocked: true, ..in_time() };
        assert_eq!((asleep.cause(), asleep.own_ns()), (Some(MissCause::LongStep), 8_100));
    }

    #[test]
    fn step_that_had_to_wait_for_its_core_was_woken_late() {
        let late = Evidence { wake_ns: 1_950, end_ns: 2_050, waited_ns: Some(940), ..in_time() };
        assert_eq!(late.cause(), Some(MissCause::LateWake));
    }

    #[test]
    fn late_wake_up_on_a_free_core_is_caused_by_the_host() {
        let late = Evidence { wake_ns: 1_950, end_ns: 2_050, waited_ns: Some(10), ..in_time() };
        assert_eq!(late.cause(), Some(MissCause::Stolen));
    }

    #[test]
    fn time_stolen_within_a_step_is_caused_by_the_host() {
        let stolen = Evidence { end_ns: 9_100, cpu_ns: 100, waited_ns: Some(0), ..in_time() };
        assert_eq!(stolen.cause(), Some(MissCause::Stolen));
        assert_eq!(stolen.own_ns(), 100);
        // another thread of this system had the core in the meantime
        let interrupted = Evidence { waited_ns: Some(8_000), ..stolen };
        assert_eq!(interrupted.cause(), Some(MissCause::LateWake));
    }

    #[test]
    fn late_starts_count_as_waiting_without_scheduler_data() {
        let late = Evidence { wake_ns: 1_950, end_ns: 2_050, waited_ns: None, ..in_time() };
        assert_eq!(late.cause(), Some(MissCause::LateWake));
        let gap = Evidence { end_ns: 2_100, cpu_ns: 100, waited_ns: None, ..in_time() };
        assert_eq!(gap.cause(), Some(MissCause::Stolen));
    }

    #[test]
    fn step_late_due_to_the_previous_one_inherits_its_cause() {
        let behind = Evidence { end_ns: 2_050, behind: Some(MissCause::Stolen), ..in_time() };
        assert_eq!(behind.cause(), Some(MissCause::Stolen));
        let recovered = Evidence { behind: Some(MissCause::LongStep), ..in_time() };
        assert_eq!(recovered.cause(), None);
    }

    #[test]
    fn overruns_decay_with_punctual_steps() {
        let mut counter = LeakyCounter::default();
        let steps = [true, true, false, true, false, false, false, true, true];
        assert!(steps.iter().all(|overrun| !counter.count(*overrun, Some(2))));
        assert!(counter.count(true, Some(2)), "a third one in a row");
    }

    #[test]
    fn zero_stops_at_the_first_overrun_and_no_limit_never_stops() {
        assert!(LeakyCounter::default().count(true, Some(0)));
        let mut counter = LeakyCounter::default();
        assert!((0..1_000).all(|_| !counter.count(true, None)));
    }
}
