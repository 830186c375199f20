//! Supervision of a graph in real time.

use std::sync::atomic::Ordering::Relaxed;

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::event_log::logging;
use super::hang::is_hang;
use super::lost_steps::LostSteps;
use super::restart::History;
use super::watchdog::Watchdog;
use super::{Event, Exit, Launch, stop_reason};
use crate::os::monotonic_ns;
use crate::plan::{ClockKind, OnFailure, Plan};
use crate::region::{Command, Phase, Region};

/// Maximum interval between checks of events without a descriptor: printed lines, orders of components, ns.
const LOOK_NS: u64 = 20_000_000;
/// Time between two states for the display, ns.
const STATUS_NS: u64 = 50_000_000;
/// Time within which a signal to the launcher may follow a signal to a component, ns.
const SIGNAL_NS: u64 = 50_000_000;

/// Consecutive restarts that crash before the first step after which the run's shared memory counts as
/// damaged.
const CRASHES: u32 = 2;

/// Returns `true` if a component ended as if it had found damaged shared memory.
fn is_crash(reason: &str) -> bool {
    let of_iceoryx2 = reason.starts_with("panicked") && reason.contains("iceoryx2");
    of_iceoryx2 || ["SIGSEGV", "SIGBUS", "SIGABRT"].iter().any(|signal| reason.contains(signal))
}

/// The consequence of a component's end.
pub(super) enum AfterEnd {
    /// It is restarted.
    Restarted,
    /// The graph continues without it.
    Ignored,
    /// The graph cannot go on.
    Fatal(String),
}

/// The supervision state of one component.
pub(super) struct Supervision {
    pub(super) watchdog: Watchdog,
    pub(super) lost_steps: LostSteps,
    history: History,
    /// Its last end, during a restart.
    down: Option<Down>,
    /// Time at which it started stepping, ns.
    stepping_since_ns: u64,
    /// It hung, and its process was killed.
    was_ended: bool,
    /// Time at which its hang was detected, ns, until its process has ended.
    pub(super) hung_ns: Option<u64>,
    /// Consecutive restarts that crashed before the component stepped again.
    crashes: u32,
    gone: bool,
    /// Reason of its end, if the graph continues without it.
    pub(super) lost: Option<String>,
    tolerated: u64,
}

/// A component between its end and its next step.
struct Down {
    since_ns: u64,
    /// Steps done until then.
    steps: u64,
    /// Start of the new process, ns: now, or later after failures in a row.
    start_ns: u64,
    /// The memory of the old process is gone, and its places in the topics are being freed.
    is_cleared: bool,
    is_started: bool,
}

impl Supervision {
    /// Supervises a component from `now_ns` on.
    fn new(plan: &Plan, region: &Region, index: usize, now_ns: u64) -> Self {
        Self {
            watchdog: Watchdog::new(plan, region, index, now_ns),
            lost_steps: LostSteps::new(plan.components[index].liveness.lost_steps, now_ns),
            history: History::default(),
            down: None,
            stepping_since_ns: now_ns,
            was_ended: false,
            hung_ns: None,
            crashes: 0,
            gone: false,
            lost: None,
            tolerated: 0,
        }
    }

    /// True if it has ended for good.
    pub(super) fn is_gone(&self) -> bool {
        self.gone
    }

    /// Returns `true` if it has ended and not stepped since; `steps` is its step count.
    pub(super) fn is_down(&self, steps: u64) -> bool {
        self.down.as_ref().is_some_and(|down| steps <= down.steps)
    }
}

impl Launch {
    /// Supervises a run in real time until a time after its start, ns, or until a component ends the episode.
    /// The exit, if the run ended before: by a signal, or because something failed permanently.
    pub(crate) fn supervise(&mut self, until_ns: u64, observe: &mut dyn FnMut(Event<'_>)) -> Option<Exit> {
        crate::os::wake_soon();
        let observe = &mut logging(&self.log, observe);
        let end = self.region.header().start_ns.load(Relaxed).saturating_add(until_ns);
        let was_over = self.region.header().is_episode_over();
        let mut supervision = core::mem::take(&mut self.supervision);
        let exit = loop {
            if let Some(outcome) = self.look(end, &mut supervision, observe) {
                break outcome;
            }
            if !was_over && self.region.header().is_episode_over() {
                break None;
            }
            self.wait_for_something(self.due_ns);
        };
        self.supervision = supervision;
        exit
    }

    /// One check of everything. Returns `Some` when supervision is over: with the exit, or without one at
    /// `end`.
    fn look(
        &mut self,
        end: u64,
        supervision: &mut [Supervision],
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Option<Option<Exit>> {
        let now = monotonic_ns();
        self.region.header().launcher_alive_ns.store(now, Relaxed);
        let late = now.saturating_sub(self.due_ns);
        self.disregard_own_delay(supervision, late, now);
        if self.signals.is_raised() {
            return Some(Some(Exit::Interrupted));
        }
        if now >= end {
            self.due_ns = now;
            return Some(None);
        }
        self.relay_output(observe);
        let command = self.region.header().command();
        if command == Command::SafeStop || (command as u32) < Command::Run as u32 {
            let reason = match command {
                Command::SafeStop => stop_reason::reason(&self.plan, &self.region),
                // Commands only rise.
                _ => "the control block of the run was damaged: its command is one of the start".to_string(),
            };
            self.safe_stop(&reason, observe);
            return Some(Some(Exit::SafeStop { reason }));
        }
        self.due_ns = end.min(now + LOOK_NS).min(self.next_status_ns);
        for (index, supervision) in supervision.iter_mut().enumerate() {
            let verdict = self.monitor(index, supervision, observe);
            if let Some(AfterEnd::Fatal(reason)) = verdict {
                if self.signals.is_raised() {
                    break;
                }
                self.safe_stop(&reason, observe);
                return Some(Some(Exit::SafeStop { reason }));
            }
            self.due_ns = self.due_ns.min(self.next_check(index, supervision, now));
            self.count_lost_steps(index, supervision, now, observe);
        }
        if !self.signals.is_raised() && supervision.iter().all(|supervision| supervision.gone) {
            return Some(Some(Exit::Finished));
        }
        self.monitor_guard(late, observe);
        self.look_at_places(observe);
        self.tell_stops(observe);
        self.tell_accounts(now, observe);
        self.note_episodes(observe);
        if now >= self.next_status_ns {
            self.next_status_ns = now + STATUS_NS;
            observe(Event::Status(&self.status()));
        }
        None
    }

    /// The state of supervision of every component at the start.
    pub(super) fn supervision(&self, start_ns: u64) -> Vec<Supervision> {
        let indices = 0..self.plan.components.len();
        indices.map(|index| Supervision::new(&self.plan, &self.region, index, start_ns)).collect()
    }

    /// Waits until a process ends, a signal arrives, or the next check is due.
    pub(super) fn wait_for_something(&self, due_ns: u64) {
        let wait = due_ns.saturating_sub(monotonic_ns()).min(LOOK_NS);
        let timeout = Timespec { tv_sec: 0, tv_nsec: wait as _ };
        let mut polled = vec![PollFd::new(self.signals.stream(), PollFlags::IN)];
        for child in self.children.iter().chain(self.guard.child()) {
            for descriptor in child.descriptors() {
                polled.push(PollFd::from_borrowed_fd(descriptor, PollFlags::IN));
            }
        }
        let _ = poll(&mut polled, Some(&timeout));
    }

    /// Checks whether a component ended, hung or recovered, and applies its policy.
    pub(super) fn monitor(
        &mut self,
        index: usize,
        supervision: &mut Supervision,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Option<AfterEnd> {
        if supervision.gone {
            self.children[index].is_gone();
            return None;
        }
        self.tell_tolerated(index, supervision, observe);
        let now = monotonic_ns();
        if supervision.down.is_some() {
            if let Some(error) = self.bring_back(index, supervision, now, observe) {
                return Some(AfterEnd::Fatal(error));
            }
        } else if let Some(reason) = self.end_if_hung(index, supervision, now, observe) {
            return Some(AfterEnd::Fatal(reason));
        }
        if supervision.down.as_ref().is_some_and(|down| !down.is_started) {
            return None;
        }
        let how = self.children[index].ended()?.to_string();
        let seen_ns = supervision.hung_ns.take().or(self.children[index].seen_ns());
        let block = &self.region.components()[index];
        let failed = block.phase() != Phase::Stopped;
        if !failed && self.signals.arrives_within(SIGNAL_NS) {
            // Everything received the request to end, and this component was the first to end.
            supervision.gone = true;
            return None;
        }
        let (tick, reason) = match block.failure() {
            // The kernel keeps a crashed process while it writes its core dump: it looks hung, but was not
            // killed for that.
            Some((tick, message)) if is_hang(&message) && is_crash(&how) => (tick, how),
            Some((tick, message)) if failed => (tick, message),
            _ => (block.steps.load(Relaxed), crate::os::with_shortage(how, self.folder.path())),
        };
        let steps = block.steps.load(Relaxed);
        self.relay_output(observe);
        let name = self.plan.components[index].name.clone();
        let policy = self.plan.components[index].restart;
        supervision.crashes =
            if supervision.down.is_some() && is_crash(&reason) { supervision.crashes + 1 } else { 0 };
        let is_damaged = supervision.crashes >= CRASHES;
        let stepping_since = supervision.down.is_none().then_some(supervision.stepping_since_ns);
        let granted = supervision.history.grant(&policy, failed, stepping_since, now);
        if let Some(delay_ns) = granted.filter(|_| !is_damaged) {
            let consequence = match delay_ns / 1_000_000 {
                0 => "restarting".to_string(),
                delay_ms => format!("restarting in {delay_ms} ms"),
            };
            let consequence = &consequence;
            observe(Event::Failed { component: &name, tick, reason: &reason, consequence, seen_ns });
            let block = &self.region.components()[index];
            block.restarts.fetch_add(1, Relaxed);
            block.forget_failure();
            block.enter(Phase::Created);
            supervision.was_ended = false;
            // Recovery time counts from its first end.
            let since_ns = supervision.down.as_ref().map_or(now, |down| down.since_ns);
            let start_ns = now + delay_ns;
            supervision.down = Some(Down { since_ns, steps, start_ns, is_cleared: false, is_started: false });
            return match self.bring_back(index, supervision, now, observe) {
                None => Some(AfterEnd::Restarted),
                Some(error) => Some(AfterEnd::Fatal(error)),
            };
        }
        supervision.gone = true;
        // No stop was requested: even a component that ended normally is missing.
        let reason = match failed {
            true if is_damaged => {
                format!(
                    "{reason}; it crashes whenever it joins its topics: the shared memory of the run is damaged"
                )
            }
            true => reason,
            false => "it ended while the graph runs".to_string(),
        };
        if self.plan.components[index].on_failure == OnFailure::Ignore {
            let consequence = "the graph goes on without it";
            supervision.lost = Some(reason.clone());
            observe(Event::Failed { component: &name, tick, reason: &reason, consequence, seen_ns });
            return Some(AfterEnd::Ignored);
        }
        let consequence = "safe stop";
        observe(Event::Failed { component: &name, tick, reason: &reason, consequence, seen_ns });
        Some(AfterEnd::Fatal(format!("component `{name}` failed at tick {tick}: {reason}")))
    }

    /// Starts the new process of a component when due, and checks whether it steps again. Returns the error
    /// of a failed start.
    fn bring_back(
        &mut self,
        index: usize,
        supervision: &mut Supervision,
        now: u64,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Option<String> {
        let down = supervision.down.as_mut()?;
        if !down.is_started {
            if !down.is_cleared && self.children[index].is_gone() {
                // The dead process occupies its slots in the topics until they are cleaned up.
                self.free_places();
                self.spare.release();
                down.is_cleared = true;
            }
            if down.is_cleared && now >= down.start_ns {
                match self.start_child(index) {
                    Ok(child) => self.children[index] = child,
                    Err(error) => return Some(error.to_string()),
                }
                down.is_started = true;
            }
            return None;
        }
        let component = &self.plan.components[index];
        let block = &self.region.components()[index];
        let within = component.restart.within_ns;
        let is_alive = self.children[index].ended().is_none();
        let steps_again = block.phase() == Phase::Running
            && (self.plan.clock == ClockKind::Lockstep
                || block.steps.load(Relaxed) > down.steps
                || supervision.watchdog.may_stay_silent());
        if steps_again && is_alive {
            observe(Event::Restarted { component: &component.name, after_ns: now - down.since_ns });
            // On failure the next restart uses the remaining memory.
            let _ = self.spare.take_back();
            supervision.down = None;
            supervision.stepping_since_ns = now;
            supervision.watchdog.watch_from(now);
            supervision.lost_steps.count_from(now);
        } else if is_alive && now.saturating_sub(down.start_ns) > within && !supervision.was_ended {
            supervision.was_ended = true;
            let took = within / 1_000_000;
            let steps = block.steps.load(Relaxed);
            block.set_failure(steps, &format!("not stepping {took} ms after its restart"));
            self.children[index].end();
        }
        None
    }

    /// Time of the next check of a component without events, ns.
    fn next_check(&self, index: usize, supervision: &Supervision, now: u64) -> u64 {
        match &supervision.down {
            _ if supervision.gone => u64::MAX,
            None => supervision.watchdog.due_ns(),
            // The end of the old process wakes the launcher.
            Some(down) if !down.is_cleared => u64::MAX,
            Some(down) if !down.is_started => down.start_ns,
            // Until it steps again only its counters are informative.
            Some(down) => (now + 1_000_000)
                .min(down.start_ns.saturating_add(self.plan.components[index].restart.within_ns)),
        }
    }

    /// Reports the first error of a component that its policy tolerates.
    pub(super) fn tell_tolerated(
        &self,
        index: usize,
        supervision: &mut Supervision,
        observe: &mut dyn FnMut(Event<'_>),
    ) {
        let block = &self.region.components()[index];
        let errors = block.errors.load(Relaxed);
        if errors > 0 && supervision.tolerated == 0 {
            supervision.tolerated = errors;
            if let Some((tick, reason)) = block.failure() {
                let component = &self.plan.components[index].name;
                let consequence = "tolerated, as the graph says; later ones are only counted";
                observe(Event::Failed { component, tick, reason: &reason, consequence, seen_ns: None });
            }
            block.forget_failure();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crash_in_shared_memory_is_distinguished() {
        for crash in [
            "killed by signal 11 (SIGSEGV)",
            "panicked at /registry/iceoryx2-bb-lock-free-0.10.0/src/mpmc/robust_unique_index_set.rs:229: not initialized",
        ] {
            assert!(is_crash(crash), "{crash}");
        }
        for other in
            ["killed by signal 9 (SIGKILL)", "panicked at src/main.rs:7: no camera", "ended with exit code 1"]
        {
            assert!(!is_crash(other), "{other}");
        }
    }

    #[test]
    fn slow_core_dump_is_distinguished_from_a_hang() {
        assert!(is_hang("hung: no step for 200 ms (`hang_after` is 200 ms): it waits for a device"));
        assert!(!is_hang("killed by signal 11 (SIGSEGV)"));
    }
}
