//! Supervision of a run's components, its guard and its shared memory.

use std::rc::Rc;
use std::sync::atomic::Ordering::{Relaxed, Release};

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use super::child::Child;
use super::guarding::Guard;
use super::hang::diagnose;
use super::reporter::Reporter;
use super::run::Run;
use super::shared_memory::SharedMemory;
use super::supervision::{Action, Down, Ended, Facts, Loss, State, Supervision, decide};
use super::watchdog::{Counters, Overdue};
use super::workers::Workers;
use super::{Event, Hosting, LaunchError};
use crate::os::monotonic_ns;
use crate::region::{Command, End, Failure, Phase};
use crate::worker::Registry;

/// Maximum interval between checks for events without a descriptor, such as printed lines and orders of
/// components, ns.
pub(super) const LOOK_NS: u64 = 20_000_000;
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

/// Description of the end of a component.
struct Account {
    tick: u64,
    reason: String,
    /// Time at which the end was read, ns.
    now_ns: u64,
    /// Time of the detection, ns.
    seen_ns: Option<u64>,
}

/// The components of a run with their supervision, its guard, its shared memory, and its reports.
pub(super) struct Supervisor {
    run: Rc<Run>,
    pub(super) workers: Workers,
    supervision: Vec<Supervision>,
    guard: Guard,
    pub(super) memory: SharedMemory,
    pub(super) reporter: Reporter,
}

impl Supervisor {
    /// Creates a supervisor without running components.
    pub(super) fn new(run: &Rc<Run>, registry: &Registry) -> Self {
        Self {
            run: run.clone(),
            workers: Workers::new(run, registry),
            supervision: Vec::new(),
            guard: Guard::default(),
            memory: SharedMemory::none(),
            reporter: Reporter::new(run),
        }
    }

    /// Starts the guard of separate processes, and creates the shared memory of the run.
    ///
    /// # Errors
    /// The guard does not start, or shared memory is full.
    pub(super) fn create(&mut self) -> Result<(), LaunchError> {
        if self.run.options.hosting == Hosting::Processes {
            self.guard.start(&self.run)?;
        }
        self.memory = SharedMemory::create(&self.run)?;
        Ok(())
    }

    /// Begins the run at a time, ns, from which components step and are supervised.
    pub(super) fn begin(&mut self, start_ns: u64) {
        let header = self.run.region.header();
        header.start_ns.store(start_ns, Release);
        header.order(Command::Run);
        self.workers.begin();
        let indices = 0..self.run.plan.components.len();
        let supervise = |index| Supervision::new(&self.run.plan, &self.run.region, index, start_ns);
        self.supervision = indices.map(supervise).collect();
    }

    /// Returns the supervision of each component; empty before the start.
    pub(super) fn supervision(&self) -> &[Supervision] {
        &self.supervision
    }

    /// Returns `true` if a component has ended permanently.
    pub(super) fn is_gone(&self, index: usize) -> bool {
        self.supervision[index].is_gone()
    }

    /// Returns `true` if all components have ended permanently.
    pub(super) fn are_all_gone(&self) -> bool {
        self.supervision.iter().all(Supervision::is_gone)
    }

    /// Describes the loss of a guard that existed at the start of the run.
    pub(super) fn missing_guard(&self) -> Option<String> {
        self.guard.missing()
    }

    /// Checks the guard, the slots of dead processes, and all reports that do not belong to a component.
    /// `late` is the delay of the launcher itself, ns.
    pub(super) fn look_around(&mut self, late: u64, now_ns: u64, observe: &mut dyn FnMut(Event<'_>)) {
        self.guard.monitor(&self.run, late, observe);
        self.memory.look(&self.run, observe);
        self.reporter.look(&self.run, now_ns, observe);
    }

    /// Restarts the watchdogs after a long delay of the launcher, because components may have been delayed
    /// with it.
    pub(super) fn disregard_own_delay(&mut self, late: u64, now: u64) {
        for supervision in &mut self.supervision {
            if late > supervision.watchdog.hang_after_ns() / 2 {
                supervision.watchdog.watch_from(now);
                supervision.lost_steps.count_from(now);
            }
        }
    }

    /// Warns about a component that loses too many steps.
    pub(super) fn count_lost_steps(&mut self, index: usize, now: u64, observe: &mut dyn FnMut(Event<'_>)) {
        let block = &self.run.region.components()[index];
        let (steps, skipped) = (block.steps.load(Relaxed), block.skipped.load(Relaxed));
        if let Some(share) = self.supervision[index].lost_steps.check(steps, skipped, now) {
            observe(Event::LosesSteps { component: &self.run.plan.components[index].name, share });
        }
    }

    /// Waits until a process ends, a signal arrives, or the next check is due.
    pub(super) fn wait_for_something(&self, due_ns: u64) {
        let wait = due_ns.saturating_sub(monotonic_ns()).min(LOOK_NS);
        let timeout = Timespec { tv_sec: 0, tv_nsec: wait as _ };
        let mut polled = vec![PollFd::new(self.run.signals.stream(), PollFlags::IN)];
        let guard = self.guard.child().into_iter().flat_map(Child::descriptors);
        for descriptor in self.workers.descriptors().chain(guard) {
            polled.push(PollFd::from_borrowed_fd(descriptor, PollFlags::IN));
        }
        let _ = poll(&mut polled, Some(&timeout));
    }

    /// Checks whether a component ended, hung or recovered, and applies its policy.
    pub(super) fn monitor(&mut self, index: usize, observe: &mut dyn FnMut(Event<'_>)) -> Option<AfterEnd> {
        if self.supervision[index].is_gone() {
            self.workers.child(index).is_gone();
            return None;
        }
        self.report_tolerated(index, observe);
        loop {
            let (facts, account) = self.facts(index);
            match (decide(&self.supervision[index].state, &facts), account) {
                // These may be followed immediately by the next action.
                (action @ (Action::Clear | Action::Start), _) => {
                    if let Some(error) = self.bring_back(index, action) {
                        return Some(AfterEnd::Fatal(error));
                    }
                }
                (Action::KillHung(overdue), _) => return self.end_hung(index, overdue, observe),
                (action, Some(account)) => {
                    return self.apply_policy(index, action, account, observe);
                }
                (action, None) => {
                    self.act(index, action, facts.now_ns, observe);
                    return None;
                }
            }
        }
    }

    /// Reads the facts about a component that matter in its state, and the description of its end.
    fn facts(&mut self, index: usize) -> (Facts, Option<Account>) {
        let now_ns = monotonic_ns();
        let within_ns = self.run.plan.components[index].restart.within_ns;
        let mut facts =
            Facts { now_ns, overdue: None, is_cleared: false, steps_again: false, within_ns, ended: None };
        match self.supervision[index].state {
            State::Stepping { .. } => {
                let counters = Counters::read(&self.run.plan, &self.run.region, index);
                facts.overdue = self.supervision[index].watchdog.check(&counters, now_ns);
            }
            State::Clearing(_) => facts.is_cleared = self.workers.child(index).is_gone(),
            State::Starting(down) | State::Late(down) => {
                let block = &self.run.region.components()[index];
                facts.steps_again = block.phase() == Phase::Running
                    && (self.run.is_lockstep()
                        || block.steps.load(Relaxed) > down.steps
                        || self.supervision[index].watchdog.may_stay_silent());
            }
            State::Hung { .. } | State::Due(_) | State::Lost { .. } | State::Gone => {}
        }
        let end =
            self.supervision[index].state.has_process().then(|| self.workers.child(index).ended()).flatten();
        let Some(end) = end else { return (facts, None) };
        let is_failure = self.run.region.components()[index].phase() != Phase::Stopped;
        let (failure, account) = self.account(index, (end, is_failure), now_ns);
        let component = &self.run.plan.components[index];
        let since_ns = self.supervision[index].state.stepping_since_ns();
        facts.ended = Some(Ended {
            end: failure.end,
            is_failure,
            // Everything received the request to end, and this component was the first to end.
            is_requested: !is_failure && self.run.signals.arrives_within(SIGNAL_NS),
            delay_ns: self.supervision[index].history.grant(&component.restart, is_failure, since_ns, now_ns),
            on_failure: component.on_failure,
        });
        (facts, Some(account))
    }

    /// Returns the facts of a process's end, and its description.
    fn account(&mut self, index: usize, (end, is_failure): (End, bool), now_ns: u64) -> (Failure, Account) {
        let block = &self.run.region.components()[index];
        let (failure, reason) = match block.failure() {
            // The kernel keeps a crashed process while it writes the core dump. The process looks hung, but
            // was not killed for that.
            Some(Failure { tick, end: End::Hung(_), .. }) if end.suggests_damage() => {
                (Failure::without_text(tick, end), end.to_string())
            }
            Some(failure) if is_failure => {
                let reason = failure.to_string();
                (failure, reason)
            }
            _ => {
                let reason = crate::os::with_shortage(end.to_string(), self.run.folder.path());
                (Failure::without_text(block.steps.load(Relaxed), end), reason)
            }
        };
        let seen_ns = match self.supervision[index].state {
            State::Hung { noticed_ns, .. } => Some(noticed_ns),
            _ => self.workers.child(index).seen_ns(),
        };
        let account = Account { tick: failure.tick, reason, now_ns, seen_ns };
        (failure, account)
    }

    /// Frees the slots of a component that ended, or starts its new process. Returns the error of a failed
    /// start.
    fn bring_back(&mut self, index: usize, action: Action) -> Option<String> {
        let down = self.supervision[index].state.down()?;
        if action == Action::Clear {
            // The dead process occupies its slots in the topics until they are cleaned up.
            self.memory.free_slots(&self.run);
            self.supervision[index].state = State::Due(down);
            return None;
        }
        if let Err(error) = self.workers.replace(index) {
            return Some(error.to_string());
        }
        self.supervision[index].state = State::Starting(down);
        None
    }

    /// Reports a recovery, or kills a component that does not recover in time.
    fn act(&mut self, index: usize, action: Action, now_ns: u64, observe: &mut dyn FnMut(Event<'_>)) {
        let Some(down) = self.supervision[index].state.down() else { return };
        match action {
            Action::Recover => {
                let component = &self.run.plan.components[index].name;
                observe(Event::Restarted { component, after_ns: now_ns - down.since_ns });
                self.memory.refill();
                self.supervision[index].state = State::Stepping { since_ns: now_ns };
                self.supervision[index].watchdog.watch_from(now_ns);
                self.supervision[index].lost_steps.count_from(now_ns);
            }
            Action::KillLate => {
                let block = &self.run.region.components()[index];
                let within_ns = self.run.plan.components[index].restart.within_ns;
                let tick = block.steps.load(Relaxed);
                block.set_failure(&Failure::without_text(tick, End::NotStepping { within_ns }));
                self.workers.child(index).end();
                self.supervision[index].state = State::Late(down);
            }
            _ => {}
        }
    }

    /// Kills the process of a component that has hung; its end then follows its policy. A thread cannot be
    /// killed, so the graph cannot continue.
    fn end_hung(
        &mut self,
        index: usize,
        overdue: Overdue,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Option<AfterEnd> {
        let hang = diagnose(&self.run.plan, &self.run.region, index, overdue);
        let block = &self.run.region.components()[index];
        let failure = Failure::without_text(block.steps.load(Relaxed), End::Hung(hang));
        if self.workers.child(index).end() {
            block.set_failure(&failure);
            if let State::Stepping { since_ns } = self.supervision[index].state {
                self.supervision[index].state = State::Hung { since_ns, noticed_ns: monotonic_ns() };
            }
            return None;
        }
        let (component, tick) = (&self.run.plan.components[index].name, failure.tick);
        let reason = failure.to_string();
        observe(Event::Failed { component, tick, reason: &reason, consequence: "safe stop", seen_ns: None });
        Some(AfterEnd::Fatal(format!("component `{component}` failed at tick {tick}: {reason}")))
    }

    /// Applies the policy of a component that ended.
    fn apply_policy(
        &mut self,
        index: usize,
        action: Action,
        account: Account,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Option<AfterEnd> {
        if action == Action::Leave {
            self.supervision[index].state = State::Gone;
            return None;
        }
        self.workers.relay_output(observe);
        let Account { tick, now_ns, seen_ns, .. } = account;
        let name = self.run.plan.components[index].name.clone();
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
                let block = &self.run.region.components()[index];
                block.restarts.fetch_add(1, Relaxed);
                block.forget_failure();
                block.enter(Phase::Created);
                // Recovery time counts from its first end.
                let since_ns = self.supervision[index].state.down().map_or(now_ns, |down| down.since_ns);
                let (steps, start_ns) = (block.steps.load(Relaxed), now_ns + delay_ns);
                self.supervision[index].state = State::Clearing(Down { since_ns, steps, start_ns, crashes });
                self.bring_back_at_once(index)
            }
            Action::Abandon(loss) => {
                let reason = reason(loss);
                failed(&reason, "the graph continues without it");
                self.supervision[index].state = State::Lost { reason };
                Some(AfterEnd::Ignored)
            }
            Action::Stop(loss) => {
                let reason = reason(loss);
                failed(&reason, "safe stop");
                self.supervision[index].state = State::Gone;
                Some(AfterEnd::Fatal(format!("component `{name}` failed at tick {tick}: {reason}")))
            }
            _ => None,
        }
    }

    /// Clears and restarts a component that has just ended, as far as possible without waiting.
    fn bring_back_at_once(&mut self, index: usize) -> Option<AfterEnd> {
        loop {
            let (facts, _) = match self.supervision[index].state {
                State::Clearing(_) | State::Due(_) => self.facts(index),
                _ => return Some(AfterEnd::Restarted),
            };
            match decide(&self.supervision[index].state, &facts) {
                action @ (Action::Clear | Action::Start) => {
                    if let Some(error) = self.bring_back(index, action) {
                        return Some(AfterEnd::Fatal(error));
                    }
                }
                _ => return Some(AfterEnd::Restarted),
            }
        }
    }

    /// Returns the time of the next check of a component without events, ns.
    pub(super) fn next_check(&self, index: usize, now: u64) -> u64 {
        let within_ns = self.run.plan.components[index].restart.within_ns;
        match &self.supervision[index].state {
            State::Stepping { .. } => self.supervision[index].watchdog.due_ns(),
            State::Due(down) => down.start_ns,
            // Until it steps again, only its counters show progress.
            State::Starting(down) => (now + 1_000_000).min(down.start_ns.saturating_add(within_ns)),
            // The end of the process wakes the launcher.
            State::Hung { .. } | State::Clearing(_) | State::Late(_) | State::Lost { .. } | State::Gone => {
                u64::MAX
            }
        }
    }

    /// Reports the first error of a component that its policy tolerates.
    pub(super) fn report_tolerated(&mut self, index: usize, observe: &mut dyn FnMut(Event<'_>)) {
        let block = &self.run.region.components()[index];
        let errors = block.errors.load(Relaxed);
        if errors > 0 && !self.supervision[index].reported_tolerated {
            self.supervision[index].reported_tolerated = true;
            if let Some(failure) = block.failure() {
                let component = &self.run.plan.components[index].name;
                let consequence = "tolerated, as configured; later errors are only counted";
                let (tick, reason) = (failure.tick, failure.to_string());
                observe(Event::Failed { component, tick, reason: &reason, consequence, seen_ns: None });
            }
            block.forget_failure();
        }
    }
}

impl Drop for Supervisor {
    /// Ends the remaining processes and removes everything from shared memory.
    fn drop(&mut self) {
        self.run.region.header().order(Command::Stop);
        self.workers.kill_all();
        self.memory.remove();
        self.run.folder.remove();
        self.guard.kill();
    }
}
