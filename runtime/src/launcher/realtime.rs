//! The launcher's side of real time: periodic checks, and waits between them.

use std::rc::Rc;
use std::sync::atomic::Ordering::Relaxed;

use super::run::Run;
use super::safe_stop::SafeStop;
use super::supervisor::{AfterEnd, LOOK_NS, Supervisor};
use super::{Event, Exit, stop_reason};
use crate::os::monotonic_ns;
use crate::region::Command;

/// The launcher's checks of a real-time run.
pub(super) struct Realtime {
    run: Rc<Run>,
    /// Time of the next check, `CLOCK_MONOTONIC` ns.
    due_ns: u64,
}

impl Realtime {
    /// Creates the checks of a run. The checks start with the run.
    pub(super) fn new(run: &Rc<Run>) -> Self {
        Self { run: run.clone(), due_ns: 0 }
    }

    /// Starts the checks at the start of the run, ns.
    pub(super) fn begin(&mut self, start_ns: u64) {
        self.due_ns = start_ns;
    }

    /// Supervises a run until a time after its start, ns, or until a component ends the episode. Returns the
    /// exit if the run ended earlier by a signal or a permanent failure.
    pub(super) fn supervise(
        &mut self,
        until_ns: u64,
        supervisor: &mut Supervisor,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Option<Exit> {
        crate::os::wake_soon();
        let end = self.run.start_ns().saturating_add(until_ns);
        let was_over = self.run.region.header().is_episode_over();
        loop {
            if let Some(outcome) = self.look(end, supervisor, observe) {
                return outcome;
            }
            if !was_over && self.run.region.header().is_episode_over() {
                return None;
            }
            supervisor.wait_for_something(self.due_ns);
        }
    }

    /// Performs one round of all checks. Returns `None` while supervision continues. When it is over, returns
    /// the exit, or `Some(None)` at the time `end`.
    fn look(
        &mut self,
        end: u64,
        supervisor: &mut Supervisor,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Option<Option<Exit>> {
        let Run { plan, region, signals, .. } = &*self.run;
        let now = monotonic_ns();
        region.header().launcher_alive_ns.store(now, Relaxed);
        let late = now.saturating_sub(self.due_ns);
        supervisor.disregard_own_delay(late, now);
        if signals.is_raised() {
            return Some(Some(Exit::Interrupted));
        }
        if now >= end {
            self.due_ns = now;
            return Some(None);
        }
        supervisor.workers.relay_output(observe);
        let command = region.header().command();
        if command == Command::SafeStop || (command as u32) < Command::Run as u32 {
            let reason = match command {
                Command::SafeStop => stop_reason::reason(plan, region),
                // Commands only increase.
                _ => {
                    "the control block of the run was damaged: its command is a start-up command".to_string()
                }
            };
            return Some(Some(self.safe_stop(reason, supervisor, observe)));
        }
        self.due_ns = end.min(now + LOOK_NS).min(supervisor.reporter.next_status_ns);
        for index in 0..plan.components.len() {
            if let Some(AfterEnd::Fatal(reason)) = supervisor.monitor(index, observe) {
                if signals.is_raised() {
                    break;
                }
                return Some(Some(self.safe_stop(reason, supervisor, observe)));
            }
            self.due_ns = self.due_ns.min(supervisor.next_check(index, now));
            supervisor.count_lost_steps(index, now, observe);
        }
        if !signals.is_raised() && supervisor.are_all_gone() {
            return Some(Some(Exit::Finished));
        }
        supervisor.look_around(late, now, observe);
        supervisor.reporter.report_status(&self.run, now, observe);
        None
    }

    fn safe_stop(
        &self,
        reason: String,
        supervisor: &mut Supervisor,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Exit {
        SafeStop::order(&self.run, &mut supervisor.workers).settle_after(&reason, observe);
        Exit::SafeStop { reason }
    }
}
