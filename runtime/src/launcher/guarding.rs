//! The launcher's supervision of its guard, which it starts, watches and replaces.

use std::sync::atomic::Ordering::Relaxed;

use super::child::Child;
use super::hang::SILENCE_NS;
use super::restart::History;
use super::run::Run;
use super::{Event, LaunchError};
use crate::os::monotonic_ns;
use crate::plan::{RestartPlan, RestartWhen};
use crate::region::End;

/// Consecutive failures after which a run counts as unguarded.
const FAILURES: u32 = 3;

/// Restarts of a guard: unlimited, with a back-off.
const POLICY: RestartPlan =
    RestartPlan { when: RestartWhen::Always, at_most: u32::MAX, window_ns: 1, within_ns: u64::MAX };

/// The guard of a run.
#[derive(Default)]
pub(super) struct Guard {
    child: Option<Child>,
    /// Time from which it is expected to be alive, ns.
    since_ns: u64,
    history: History,
    /// Time of its next start, ns.
    due_ns: Option<u64>,
    /// Failures in a row, each within a second of its start.
    failures: u32,
    /// Reason why it cannot be restarted.
    refused: Option<String>,
}

impl Guard {
    /// Returns the guard's process, if there is one.
    pub(super) fn child(&self) -> Option<&Child> {
        self.child.as_ref()
    }

    /// Kills the guard.
    pub(super) fn kill(&mut self) {
        if let Some(child) = &mut self.child {
            child.kill();
        }
    }

    /// Describes the loss of a guard that existed at the start of the run.
    pub(super) fn missing(&self) -> Option<String> {
        match &self.refused {
            Some(reason) => Some(format!("the run had no guard at its end: {reason}")),
            None if self.failures >= FAILURES => Some(format!(
                "the run had no guard at its end: it failed {} times in a row, each within a second",
                self.failures
            )),
            None => None,
        }
    }

    /// Starts the guard's process.
    pub(super) fn start(&mut self, run: &Run) -> Result<(), LaunchError> {
        let child = Child::guard(run.program.path(), &run.folder)?;
        run.region.header().guard.store(child.pid(), Relaxed);
        self.since_ns = monotonic_ns();
        self.child = Some(child);
        Ok(())
    }

    /// Monitors the guard, and replaces its process if it is dead or stopped. `late` is the delay of the
    /// launcher itself, ns.
    pub(super) fn monitor(&mut self, run: &Run, late: u64, observe: &mut dyn FnMut(Event<'_>)) {
        let header = run.region.header();
        let now = monotonic_ns();
        if let Some(due_ns) = self.due_ns {
            if now >= due_ns {
                self.due_ns = None;
                self.restart(run, observe);
            }
            return;
        }
        let alive_ns = header.guard_alive_ns.load(Relaxed).max(self.since_ns);
        let Some(child) = &mut self.child else { return };
        // After its own delay, the launcher restarts the time limit of the guard.
        if late > SILENCE_NS / 2 {
            self.since_ns = now;
        } else if now.saturating_sub(alive_ns) > SILENCE_NS {
            child.kill();
        }
        let Some(end) = child.ended() else {
            if now.saturating_sub(self.since_ns) >= SILENCE_NS {
                self.failures = 0;
            }
            return;
        };
        let reason = match end {
            End::KilledByLauncher => "it does not respond and was killed".to_string(),
            _ => end.to_string(),
        };
        // It was alive until then.
        let worked = header.guard_alive_ns.load(Relaxed) > self.since_ns;
        self.failures = if worked { 0 } else { self.failures + 1 };
        let delay_ns =
            self.history.grant(&POLICY, true, worked.then_some(self.since_ns), now).unwrap_or_default();
        self.due_ns = Some(now + delay_ns);
        self.child = None;
        let consequence = match delay_ns / 1_000_000 {
            0 => "started again".to_string(),
            delay_ms => format!("started again in {delay_ms} ms"),
        };
        let consequence = &consequence;
        observe(Event::Failed { component: "guard", tick: 0, reason: &reason, consequence, seen_ns: None });
        if delay_ns == 0 {
            self.due_ns = None;
            self.restart(run, observe);
        }
    }

    fn restart(&mut self, run: &Run, observe: &mut dyn FnMut(Event<'_>)) {
        let Err(error) = self.start(run) else { return };
        let reason = error.to_string();
        let consequence = "the run continues unguarded";
        observe(Event::Failed { component: "guard", tick: 0, reason: &reason, consequence, seen_ns: None });
        self.refused = Some(reason);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeatedly_failing_guard_counts_as_missing() {
        let mut guard = Guard::default();
        assert_eq!(guard.missing(), None);
        guard.failures = FAILURES;
        assert!(guard.missing().unwrap().contains("3 times in a row"));
        guard.refused = Some("no processes left".to_string());
        assert_eq!(guard.missing().unwrap(), "the run had no guard at its end: no processes left");
    }
}
