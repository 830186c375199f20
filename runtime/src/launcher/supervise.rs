//! Supervision of a graph in real time.

use std::sync::atomic::Ordering::Relaxed;

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::restart::History;
use super::{Event, Exit, Launch, Services, shutdown::Signals, stop_reason};
use crate::os::monotonic_ns;
use crate::plan::OnFailure;
use crate::region::{Command, Phase};

/// The consequence of a component's end.
pub(super) enum AfterEnd {
    /// It is restarted.
    Restarted,
    /// The graph goes on without it.
    Ignored,
    /// The graph cannot go on.
    Fatal(String),
}

/// The supervision state of one component.
#[derive(Default)]
pub(super) struct Supervision {
    history: History,
    /// Time of its end while it restarts, ns.
    down_since_ns: Option<u64>,
    gone: bool,
    tolerated: u64,
}

impl Supervision {
    /// Whether it has ended for good.
    pub(super) fn is_gone(&self) -> bool {
        self.gone
    }
}

impl Launch<'_> {
    /// Supervises until the run's duration is over, a signal comes, or something fails for good.
    pub(super) fn supervise(
        &mut self,
        services: &Services,
        signals: &Signals,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Exit {
        let start = self.region.header().start_ns.load(Relaxed);
        let end = self.plan.duration_ns.map(|duration| start + duration);
        let mut supervision: Vec<Supervision> =
            self.children.iter().map(|_| Supervision::default()).collect();
        let mut next_status = start;
        loop {
            let now = monotonic_ns();
            if signals.raised() > 0 {
                return Exit::Interrupted;
            }
            if end.is_some_and(|end| now >= end) {
                return Exit::Finished;
            }
            self.relay_output(observe);
            if self.region.header().command() == Command::SafeStop {
                let reason = stop_reason::reason(&self.plan, &self.region);
                self.safe_stop(&reason, observe);
                return Exit::SafeStop { reason };
            }
            for (index, supervision) in supervision.iter_mut().enumerate() {
                let verdict = self.monitor(index, supervision, services, observe);
                if let Some(AfterEnd::Fatal(reason)) = verdict {
                    self.safe_stop(&reason, observe);
                    return Exit::SafeStop { reason };
                }
            }
            if supervision.iter().all(|supervision| supervision.gone) {
                return Exit::Finished;
            }
            self.monitor_guard(observe);
            self.look_at_places(observe);
            if now >= next_status {
                next_status = now + 50_000_000;
                observe(Event::Status(&self.status()));
            }
            self.wait_for_something(signals, end.map(|end| end.saturating_sub(now)));
        }
    }

    /// Waits until a process ends, a signal comes, or the next check is due.
    fn wait_for_something(&self, signals: &Signals, remaining_ns: Option<u64>) {
        let wait = remaining_ns.unwrap_or(u64::MAX).min(20_000_000);
        let timeout = Timespec { tv_sec: 0, tv_nsec: wait as _ };
        let mut polled = vec![PollFd::new(signals.stream(), PollFlags::IN)];
        for child in self.children.iter().chain(&self.guard) {
            if let Some(descriptor) = child.descriptor() {
                polled.push(PollFd::from_borrowed_fd(descriptor, PollFlags::IN));
            }
        }
        let _ = poll(&mut polled, Some(&timeout));
    }

    /// Checks whether a component ended or came back, and acts by its policy.
    pub(super) fn monitor(
        &mut self,
        index: usize,
        supervision: &mut Supervision,
        services: &Services,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Option<AfterEnd> {
        if supervision.gone {
            return None;
        }
        self.tell_tolerated(index, supervision, observe);
        let now = monotonic_ns();
        let component = &self.plan.components[index];
        let block = &self.region.components()[index];
        if let Some(down) = supervision.down_since_ns {
            if block.phase() == Phase::Running && self.children[index].ended().is_none() {
                supervision.down_since_ns = None;
                // Without it the next restart finds what others have left.
                let _ = self.spare.take_back();
                observe(Event::Restarted { component: &component.name, after_ns: now - down });
            } else if now - down > component.restart.within_ns && self.children[index].ended().is_none() {
                let took = component.restart.within_ns / 1_000_000;
                block.set_failure(
                    block.steps.load(Relaxed),
                    &format!("not stepping {took} ms after its restart"),
                );
                self.children[index].kill();
            }
        }
        let how = self.children[index].ended()?.to_string();
        supervision.down_since_ns = None;
        let block = &self.region.components()[index];
        let failed = block.phase() != Phase::Stopped;
        let (tick, reason) = match block.failure() {
            Some((tick, message)) if failed => (tick, message),
            _ => (block.steps.load(Relaxed), crate::os::with_shortage(how, self.folder.path())),
        };
        self.relay_output(observe);
        let name = self.plan.components[index].name.clone();
        let policy = self.plan.components[index].restart;
        if supervision.history.grant(&policy, failed, now) {
            observe(Event::Failed { component: &name, tick, reason: &reason, consequence: "restarting" });
            // The dead process holds its places in the topics until they are cleaned up.
            self.free_places(services);
            self.spare.release();
            let block = &self.region.components()[index];
            block.restarts.fetch_add(1, Relaxed);
            block.forget_failure();
            block.enter(Phase::Created);
            return match self.start(index) {
                Ok(child) => {
                    self.children[index] = child;
                    supervision.down_since_ns = Some(now);
                    Some(AfterEnd::Restarted)
                }
                Err(error) => Some(AfterEnd::Fatal(error.to_string())),
            };
        }
        supervision.gone = true;
        // It was not asked to end: a component that stopped in good order is missing all the same.
        let reason = if failed { reason } else { "it ended while the graph runs".to_string() };
        if self.plan.components[index].on_failure == OnFailure::Ignore {
            let consequence = "the graph goes on without it";
            observe(Event::Failed { component: &name, tick, reason: &reason, consequence });
            return Some(AfterEnd::Ignored);
        }
        observe(Event::Failed { component: &name, tick, reason: &reason, consequence: "safe stop" });
        Some(AfterEnd::Fatal(format!("component `{name}` failed at tick {tick}: {reason}")))
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
                observe(Event::Failed { component, tick, reason: &reason, consequence });
            }
            block.forget_failure();
        }
    }

    /// Replaces a guard that was killed.
    pub(super) fn monitor_guard(&mut self, observe: &mut dyn FnMut(Event<'_>)) {
        let Some(guard) = &mut self.guard else { return };
        let Some(how) = guard.ended().map(str::to_string) else { return };
        let consequence = match self.start_guard() {
            Ok(()) => "started again",
            Err(_) => "could not be started again: the run goes on unguarded",
        };
        observe(Event::Failed { component: "guard", tick: 0, reason: &how, consequence });
        if consequence != "started again" {
            self.guard = None;
        }
    }
}
