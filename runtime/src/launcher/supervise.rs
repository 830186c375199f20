//! Supervision of a graph in real time.

use std::sync::atomic::Ordering::Relaxed;

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::event_log::logging;
use super::hang::diagnose;
use super::supervision::{Action, Down, Ended, Facts, Loss, State, Supervision, decide};
use super::watchdog::{Counters, Overdue};
use super::{Event, Exit, Launch, stop_reason};
use crate::os::monotonic_ns;
use crate::plan::ClockKind;
use crate::region::{Command, End, Failure, Phase};

/// Maximum interval between checks of events without a descriptor: printed lines, orders of components, ns.
const LOOK_NS: u64 = 20_000_000;
/// Time between two states for the display, ns.
const STATUS_NS: u64 = 50_000_000;
/// Time within which a signal to the launcher may follow a signal to a component, ns.
const SIGNAL_NS: u64 = 50_000_000;

/// The consequence of a component's end.
pub(super) enum AfterEnd {
    /// The component is restarted.
    Restarted,
    /// The graph continues without it.
    Ignored,
    /// The graph cannot continue.
    Fatal(String),
}

/// The end of a component, as text.
struct Account {
    tick: u64,
    reason: String,
    /// Time at which its end was read, ns.
    now_ns: u64,
    /// Time of the detection, ns.
    seen_ns: Option<u64>,
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
        if !self.signals.is_raised() && supervision.iter().all(Supervision::is_gone) {
            return Some(Some(Exit::Finished));
        }
        self.guard.monitor(&self.program, (&self.folder, &self.region), late, observe);
        self.places.look(&self.options, &self.folder, observe);
        self.stops.report(&self.plan, &self.region, observe);
        self.accounts.report((&self.plan, &self.region), now, false, observe);
        self.episodes.note(&self.region, observe);
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
        if supervision.is_gone() {
            self.children[index].is_gone();
            return None;
        }
        self.report_tolerated(index, supervision, observe);
        loop {
            let (facts, account) = self.facts(index, supervision);
            match (decide(&supervision.state, &facts), account) {
                // These may be followed immediately by the next action.
                (action @ (Action::Clear | Action::Start), _) => {
                    if let Some(error) = self.bring_back(index, supervision, action) {
                        return Some(AfterEnd::Fatal(error));
                    }
                }
                (Action::KillHung(overdue), _) => return self.end_hung(index, supervision, overdue, observe),
                (action, Some(account)) => {
                    return self.apply_policy(index, supervision, action, account, observe);
                }
                (action, None) => {
                    self.act(index, supervision, action, facts.now_ns, observe);
                    return None;
                }
            }
        }
    }

    /// Reads the facts about a component that count in its state, and the account of its end.
    fn facts(&mut self, index: usize, supervision: &mut Supervision) -> (Facts, Option<Account>) {
        let now_ns = monotonic_ns();
        let within_ns = self.plan.components[index].restart.within_ns;
        let mut facts =
            Facts { now_ns, overdue: None, is_cleared: false, steps_again: false, within_ns, ended: None };
        match supervision.state {
            State::Stepping { .. } => {
                let counters = Counters::read(&self.plan, &self.region, index);
                facts.overdue = supervision.watchdog.check(&counters, now_ns);
            }
            State::Clearing(_) => facts.is_cleared = self.children[index].is_gone(),
            State::Starting(down) | State::Late(down) => {
                let block = &self.region.components()[index];
                facts.steps_again = block.phase() == Phase::Running
                    && (self.plan.clock == ClockKind::Lockstep
                        || block.steps.load(Relaxed) > down.steps
                        || supervision.watchdog.may_stay_silent());
            }
            State::Hung { .. } | State::Due(_) | State::Lost { .. } | State::Gone => {}
        }
        let end = supervision.state.has_process().then(|| self.children[index].ended()).flatten();
        let Some(end) = end else { return (facts, None) };
        let is_failure = self.region.components()[index].phase() != Phase::Stopped;
        let (failure, account) = self.account(index, supervision, (end, is_failure), now_ns);
        let component = &self.plan.components[index];
        let since_ns = supervision.state.stepping_since_ns();
        facts.ended = Some(Ended {
            end: failure.end,
            is_failure,
            // Everything received the request to end, and this component was the first to end.
            is_requested: !is_failure && self.signals.arrives_within(SIGNAL_NS),
            delay_ns: supervision.history.grant(&component.restart, is_failure, since_ns, now_ns),
            on_failure: component.on_failure,
        });
        (facts, Some(account))
    }

    /// The failure behind the end of a component's process, and its account.
    fn account(
        &self,
        index: usize,
        supervision: &Supervision,
        (end, is_failure): (End, bool),
        now_ns: u64,
    ) -> (Failure, Account) {
        let block = &self.region.components()[index];
        let (failure, reason) = match block.failure() {
            // The kernel keeps a crashed process while it writes its core dump: it looks hung, but was not
            // killed for that.
            Some(Failure { tick, end: End::Hung(_), .. }) if end.suggests_damage() => {
                (Failure::without_text(tick, end), end.to_string())
            }
            Some(failure) if is_failure => {
                let reason = failure.to_string();
                (failure, reason)
            }
            _ => {
                let reason = crate::os::with_shortage(end.to_string(), self.folder.path());
                (Failure::without_text(block.steps.load(Relaxed), end), reason)
            }
        };
        let seen_ns = match supervision.state {
            State::Hung { noticed_ns, .. } => Some(noticed_ns),
            _ => self.children[index].seen_ns(),
        };
        let account = Account { tick: failure.tick, reason, now_ns, seen_ns };
        (failure, account)
    }

    /// Frees the slots of a component that ended, or starts its new process. Returns the error of a failed
    /// start.
    fn bring_back(&mut self, index: usize, supervision: &mut Supervision, action: Action) -> Option<String> {
        let down = supervision.state.down()?;
        if action == Action::Clear {
            // The dead process occupies its slots in the topics until they are cleaned up.
            self.places.free(&self.options, &self.folder, &self.services);
            self.spare.release();
            supervision.state = State::Due(down);
            return None;
        }
        match self.start_child(index) {
            Ok(child) => self.children[index] = child,
            Err(error) => return Some(error.to_string()),
        }
        supervision.state = State::Starting(down);
        None
    }

    /// Reports a recovery, or kills a component that does not recover in time.
    fn act(
        &mut self,
        index: usize,
        supervision: &mut Supervision,
        action: Action,
        now_ns: u64,
        observe: &mut dyn FnMut(Event<'_>),
    ) {
        let Some(down) = supervision.state.down() else { return };
        match action {
            Action::Recover => {
                let component = &self.plan.components[index].name;
                observe(Event::Restarted { component, after_ns: now_ns - down.since_ns });
                // On failure the next restart uses the remaining memory.
                let _ = self.spare.take_back();
                supervision.state = State::Stepping { since_ns: now_ns };
                supervision.watchdog.watch_from(now_ns);
                supervision.lost_steps.count_from(now_ns);
            }
            Action::KillLate => {
                let block = &self.region.components()[index];
                let within_ns = self.plan.components[index].restart.within_ns;
                let tick = block.steps.load(Relaxed);
                block.set_failure(&Failure::without_text(tick, End::NotStepping { within_ns }));
                self.children[index].end();
                supervision.state = State::Late(down);
            }
            _ => {}
        }
    }

    /// Kills the process of a component that has hung; its end then follows its policy. A thread cannot be
    /// killed, so the graph cannot continue.
    fn end_hung(
        &mut self,
        index: usize,
        supervision: &mut Supervision,
        overdue: Overdue,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Option<AfterEnd> {
        let hang = diagnose(&self.plan, &self.region, index, overdue);
        let block = &self.region.components()[index];
        let failure = Failure::without_text(block.steps.load(Relaxed), End::Hung(hang));
        if self.children[index].end() {
            block.set_failure(&failure);
            if let State::Stepping { since_ns } = supervision.state {
                supervision.state = State::Hung { since_ns, noticed_ns: monotonic_ns() };
            }
            return None;
        }
        let (component, tick) = (&self.plan.components[index].name, failure.tick);
        let reason = failure.to_string();
        observe(Event::Failed { component, tick, reason: &reason, consequence: "safe stop", seen_ns: None });
        Some(AfterEnd::Fatal(format!("component `{component}` failed at tick {tick}: {reason}")))
    }

    /// Applies the policy of a component that ended.
    fn apply_policy(
        &mut self,
        index: usize,
        supervision: &mut Supervision,
        action: Action,
        account: Account,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Option<AfterEnd> {
        if action == Action::Leave {
            supervision.state = State::Gone;
            return None;
        }
        self.relay_output(observe);
        let Account { tick, now_ns, seen_ns, .. } = account;
        let name = self.plan.components[index].name.clone();
        let mut failed = |reason: &str, consequence: &str| {
            observe(Event::Failed { component: &name, tick, reason, consequence, seen_ns });
        };
        let reason = |loss: Loss| match loss {
            Loss::Failed => account.reason.clone(),
            Loss::Damaged => format!(
                "{}; it crashes whenever it joins its topics: the shared memory of the run is damaged",
                account.reason
            ),
            Loss::Early => "it ended while the graph runs".to_string(),
        };
        match action {
            Action::Restart { delay_ns, crashes } => {
                let consequence = match delay_ns / 1_000_000 {
                    0 => "restarting".to_string(),
                    delay_ms => format!("restarting in {delay_ms} ms"),
                };
                failed(&account.reason, &consequence);
                let block = &self.region.components()[index];
                block.restarts.fetch_add(1, Relaxed);
                block.forget_failure();
                block.enter(Phase::Created);
                // Recovery time counts from its first end.
                let since_ns = supervision.state.down().map_or(now_ns, |down| down.since_ns);
                let (steps, start_ns) = (block.steps.load(Relaxed), now_ns + delay_ns);
                supervision.state = State::Clearing(Down { since_ns, steps, start_ns, crashes });
                self.bring_back_at_once(index, supervision)
            }
            Action::Abandon(loss) => {
                let reason = reason(loss);
                failed(&reason, "the graph continues without it");
                supervision.state = State::Lost { reason };
                Some(AfterEnd::Ignored)
            }
            Action::Stop(loss) => {
                let reason = reason(loss);
                failed(&reason, "safe stop");
                supervision.state = State::Gone;
                Some(AfterEnd::Fatal(format!("component `{name}` failed at tick {tick}: {reason}")))
            }
            _ => None,
        }
    }

    /// Clears and starts a component that has just ended, as far as possible without waiting.
    fn bring_back_at_once(&mut self, index: usize, supervision: &mut Supervision) -> Option<AfterEnd> {
        loop {
            let (facts, _) = match supervision.state {
                State::Clearing(_) | State::Due(_) => self.facts(index, supervision),
                _ => return Some(AfterEnd::Restarted),
            };
            match decide(&supervision.state, &facts) {
                action @ (Action::Clear | Action::Start) => {
                    if let Some(error) = self.bring_back(index, supervision, action) {
                        return Some(AfterEnd::Fatal(error));
                    }
                }
                _ => return Some(AfterEnd::Restarted),
            }
        }
    }

    /// Time of the next check of a component without events, ns.
    fn next_check(&self, index: usize, supervision: &Supervision, now: u64) -> u64 {
        let within_ns = self.plan.components[index].restart.within_ns;
        match &supervision.state {
            State::Stepping { .. } => supervision.watchdog.due_ns(),
            State::Due(down) => down.start_ns,
            // Until it steps again only its counters are informative.
            State::Starting(down) => (now + 1_000_000).min(down.start_ns.saturating_add(within_ns)),
            // The end of the process wakes the launcher.
            State::Hung { .. } | State::Clearing(_) | State::Late(_) | State::Lost { .. } | State::Gone => {
                u64::MAX
            }
        }
    }

    /// Reports the first error of a component that its policy tolerates.
    pub(super) fn report_tolerated(
        &self,
        index: usize,
        supervision: &mut Supervision,
        observe: &mut dyn FnMut(Event<'_>),
    ) {
        let block = &self.region.components()[index];
        let errors = block.errors.load(Relaxed);
        if errors > 0 && !supervision.reported_tolerated {
            supervision.reported_tolerated = true;
            if let Some(failure) = block.failure() {
                let component = &self.plan.components[index].name;
                let consequence = "tolerated, as the graph says; later ones are only counted";
                let (tick, reason) = (failure.tick, failure.to_string());
                observe(Event::Failed { component, tick, reason: &reason, consequence, seen_ns: None });
            }
            block.forget_failure();
        }
    }
}
