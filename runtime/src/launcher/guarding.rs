//! The launcher's care for its guard: started, watched, replaced.

use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering::Relaxed;

use std::os::unix::fs::MetadataExt as _;

use super::child::Child;
use super::hang::SILENCE_NS;
use super::restart::History;
use super::{Event, Launch, LaunchError};
use crate::os::monotonic_ns;
use crate::plan::{RestartPlan, RestartWhen};
use crate::region::End;

/// Program of this process, even if its file was replaced or removed.
const OWN_PROGRAM: &str = "/proc/self/exe";

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
    /// The process, while there is one.
    pub(super) fn child(&self) -> Option<&Child> {
        self.child.as_ref()
    }

    /// Ends it.
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
}

impl Launch {
    /// Starts the guard.
    pub(super) fn start_guard(&mut self) -> Result<(), LaunchError> {
        let child = Child::guard(&self.own_program(), &self.folder)?;
        self.region.header().guard.store(child.pid(), Relaxed);
        self.guard.since_ns = monotonic_ns();
        self.guard.child = Some(child);
        Ok(())
    }

    /// Program for workers and guards. If the file of this process was replaced, for example by an upgrade,
    /// the old program is used, because another version may have a different shared memory layout.
    pub(super) fn own_program(&self) -> PathBuf {
        let program = &self.options.program;
        let is_replaced = self.runs_own_program && !is_own(program);
        if is_replaced { PathBuf::from(OWN_PROGRAM) } else { program.clone() }
    }

    /// Replaces a dead or stopped guard. `late` is the delay of the launcher itself, ns.
    pub(super) fn monitor_guard(&mut self, late: u64, observe: &mut dyn FnMut(Event<'_>)) {
        let now = monotonic_ns();
        if let Some(due_ns) = self.guard.due_ns {
            if now >= due_ns {
                self.guard.due_ns = None;
                self.restart_guard(observe);
            }
            return;
        }
        let alive_ns = self.region.header().guard_alive_ns.load(Relaxed).max(self.guard.since_ns);
        let guard = &mut self.guard;
        let Some(child) = &mut guard.child else { return };
        // After its own delay, the launcher gives the guard time again.
        if late > SILENCE_NS / 2 {
            guard.since_ns = now;
        } else if now.saturating_sub(alive_ns) > SILENCE_NS {
            child.kill();
        }
        let Some(end) = child.ended() else {
            if now.saturating_sub(guard.since_ns) >= SILENCE_NS {
                guard.failures = 0;
            }
            return;
        };
        let reason = match end {
            End::KilledByLauncher => "it does not respond and was killed".to_string(),
            _ => end.to_string(),
        };
        // It reported being alive until then.
        let worked = self.region.header().guard_alive_ns.load(Relaxed) > guard.since_ns;
        guard.failures = if worked { 0 } else { guard.failures + 1 };
        let delay_ns =
            guard.history.grant(&POLICY, true, worked.then_some(guard.since_ns), now).unwrap_or_default();
        guard.due_ns = Some(now + delay_ns);
        guard.child = None;
        let consequence = match delay_ns / 1_000_000 {
            0 => "started again".to_string(),
            delay_ms => format!("started again in {delay_ms} ms"),
        };
        let consequence = &consequence;
        observe(Event::Failed { component: "guard", tick: 0, reason: &reason, consequence, seen_ns: None });
        if delay_ns == 0 {
            guard.due_ns = None;
            self.restart_guard(observe);
        }
    }

    fn restart_guard(&mut self, observe: &mut dyn FnMut(Event<'_>)) {
        let Err(error) = self.start_guard() else { return };
        let reason = error.to_string();
        let consequence = "the run continues unguarded";
        observe(Event::Failed { component: "guard", tick: 0, reason: &reason, consequence, seen_ns: None });
        self.guard.refused = Some(reason);
    }
}

/// True if a file is the program that this process runs.
pub(super) fn is_own(program: &Path) -> bool {
    let same = |path: &Path| std::fs::metadata(path).ok().map(|file| (file.dev(), file.ino()));
    same(program).is_some_and(|file| Some(file) == same(Path::new(OWN_PROGRAM)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_replaced_file_is_not_the_own_program() {
        assert!(is_own(&std::env::current_exe().unwrap()));
        assert!(!is_own(Path::new("/bin/sh")) && !is_own(Path::new("/nowhere")));
    }

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
