//! The launcher's side of lockstep: ticks of simulated time, with one component at a time in a fixed order.
//!
//! The launcher starts a round and passes the turn to its first component. Processes and threads pass it
//! among themselves for as many rounds as permitted. They return it at the end of the requested interval, or
//! when they cannot continue. The launcher steps components hosted inline one after the other.

use std::rc::Rc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use super::run::Run;
use super::supervisor::{AfterEnd, Supervisor};
use super::{Event, Exit, Hosting, Status};
use crate::os::{futex_wait, monotonic_ns};
use crate::region::{Command, Phase};
use crate::worker::Rounds;

/// Duration of a tick above which it is reported, ns.
const TELL_AFTER_NS: u64 = 1_000_000_000;
/// Maximum wait for the turn between checks of signals and of the component that holds it.
const LOOK: Duration = Duration::from_millis(20);

/// The outcome of a tick.
enum Ticked {
    /// The work is done, or its component no longer exists.
    Done,
    /// The graph cannot continue.
    Fatal(String),
    /// A signal arrived.
    Interrupted,
}

/// Work assigned to a component with the turn.
#[derive(Debug, Clone, Copy)]
enum Work {
    /// A step, and the following ones.
    Step,
    /// The reset for the episode in the header.
    Reset,
}

/// The interval of simulated time to run.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limit {
    /// End of the interval, exclusive, ns.
    pub(crate) until_ns: u64,
    /// Maximum number of rounds.
    pub(crate) rounds: u64,
}

/// The simulated time of a run, and the order of its components.
pub(super) struct Lockstep {
    run: Rc<Run>,
    rounds: Rounds,
    /// Simulated time of the next tick, ns.
    reached_ns: u64,
    /// Simulated time of the previous episodes, ns.
    before_ns: u64,
}

impl Lockstep {
    /// Creates the state at time zero.
    pub(super) fn new(run: &Rc<Run>) -> Self {
        let plays = |index: usize| !run.is_played(&run.plan.components[index].name);
        Self { run: run.clone(), rounds: Rounds::new(&run.plan, plays), reached_ns: 0, before_ns: 0 }
    }

    /// Returns the simulated time of the current episode, ns.
    pub(super) fn reached_ns(&self) -> u64 {
        self.reached_ns
    }

    /// Returns the simulated time of all episodes, ns.
    pub(super) fn simulated_ns(&self) -> u64 {
        self.before_ns + self.reached_ns
    }

    /// Runs rounds of simulated time up to a limit. Returns the exit if the run ended earlier by a signal or
    /// a failure.
    pub(super) fn run_rounds(
        &mut self,
        limit: Limit,
        supervisor: &mut Supervisor,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Option<Exit> {
        let mut now_ns = monotonic_ns();
        let mut rounds = limit.rounds;
        while rounds > 0 {
            let mut time = self.rounds.round_from(self.reached_ns);
            if time >= limit.until_ns {
                self.reached_ns = self.reached_ns.max(limit.until_ns);
                return None;
            }
            if self.run.signals.is_raised() {
                self.reached_ns = time;
                return Some(Exit::Interrupted);
            }
            let mut stop = (self.run.region.header().command() == Command::SafeStop)
                .then(|| super::stop_reason::reason(&self.run.plan, &self.run.region));
            rounds -= 1;
            // Statistics are read after the same rounds, whether the launcher or components run them.
            let look_ns =
                self.rounds.round_from(supervisor.reporter.accounts.next_look_ns()).saturating_add(1);
            self.run.region.header().turn.allow_rounds(limit.until_ns.min(look_ns), rounds);
            let mut place = 0;
            while stop.is_none()
                && let Some(index) = self.rounds.next_due(&self.run.region, time, place)
            {
                let ticked = self.tick((index, time), &mut now_ns, supervisor, observe);
                // Components that pass the turn may have advanced to later rounds.
                let last = self.last_tick(index);
                (time, place) = (last.1, self.rounds.place_after(last.0));
                match ticked {
                    Ticked::Done => {}
                    Ticked::Fatal(reason) => stop = Some(reason),
                    Ticked::Interrupted => {
                        self.reached_ns = time;
                        return Some(Exit::Interrupted);
                    }
                }
            }
            if let Some(reason) = stop {
                observe(Event::SafeStop { reason: &reason });
                self.reached_ns = self.settle(time, supervisor, observe);
                return Some(Exit::SafeStop { reason });
            }
            self.reached_ns = time + 1;
            rounds = self.run.region.header().turn.rounds_left();
            let header = self.run.region.header();
            header.reached_ns.store(self.reached_ns, Relaxed);
            let is_over = header.is_episode_over();
            supervisor.reporter.accounts.report_at((&self.run.plan, &self.run.region), time, observe);
            if is_over {
                return None;
            }
            self.look_around(now_ns, supervisor, observe);
        }
        None
    }

    /// Returns the component and time of the last tick, after the turn was passed to the component `first`.
    fn last_tick(&self, first: usize) -> (usize, u64) {
        let last = self.run.region.header().turn.now().giver.unwrap_or(first);
        let block = self.run.region.components().get(last);
        block.map_or((first, 0), |block| (last, block.tick_time_ns.load(Relaxed)))
    }

    /// Resets all components for an episode, one after the other, and restarts simulated time. Returns the
    /// exit if one of them cannot continue.
    pub(super) fn reset(
        &mut self,
        (index, seed): (u64, u64),
        supervisor: &mut Supervisor,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Option<Exit> {
        self.run.region.header().begin_episode(index, seed);
        let mut exit = None;
        for component in 0..self.run.plan.components.len() {
            exit = exit.or(match self.reset_one((component, index, seed), supervisor, observe) {
                Ticked::Done => None,
                Ticked::Interrupted => Some(Exit::Interrupted),
                Ticked::Fatal(reason) => Some(Exit::SafeStop { reason }),
            });
        }
        supervisor.memory.clear();
        self.run.region.topics().iter().for_each(|topic| topic.begin_episode());
        self.run.region.components().iter().for_each(|block| block.begin_episode());
        self.before_ns += core::mem::take(&mut self.reached_ns);
        supervisor.reporter.accounts.begin_episode();
        observe(Event::Reset { episode: index, seed });
        exit
    }

    fn reset_one(
        &self,
        (component, index, seed): (usize, u64, u64),
        supervisor: &mut Supervisor,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Ticked {
        let is_running = self.run.region.components()[component].phase() == Phase::Running;
        if !is_running && let Some(ticked) = self.await_running(component, supervisor, observe) {
            return ticked;
        }
        if self.run.options.hosting != Hosting::Inline && !supervisor.workers.child(component).is_played() {
            return self.give_turn(component, Work::Reset, supervisor, observe);
        }
        if supervisor.workers.child(component).reset(&self.run.region.components()[component], index, seed) {
            return Ticked::Done;
        }
        match supervisor.monitor(component, observe) {
            Some(AfterEnd::Fatal(reason)) => Ticked::Fatal(reason),
            Some(AfterEnd::Restarted | AfterEnd::Ignored) | None => self.after_wait(),
        }
    }

    /// Returns the time of the next round, ns; `u64::MAX` for none.
    pub(super) fn next_round_ns(&self) -> u64 {
        self.rounds.round_from(self.reached_ns)
    }

    /// Performs due checks, and waits for a signal, the end of a process, or a time on `CLOCK_MONOTONIC`, ns.
    /// Returns the exit if a signal arrived.
    pub(super) fn wait(
        &self,
        until_ns: u64,
        supervisor: &mut Supervisor,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Option<Exit> {
        self.look_around(monotonic_ns(), supervisor, observe);
        if !self.run.signals.is_raised() && monotonic_ns() < until_ns {
            supervisor.wait_for_something(until_ns);
        }
        self.run.signals.is_raised().then_some(Exit::Interrupted)
    }

    /// Checks everything that ticks do not report, whenever a status is due.
    #[inline]
    fn look_around(&self, now_ns: u64, supervisor: &mut Supervisor, observe: &mut dyn FnMut(Event<'_>)) {
        if !supervisor.reporter.take_status(now_ns) {
            return;
        }
        supervisor.workers.relay_output(observe);
        supervisor.look_around(0, now_ns, observe);
        for index in 0..self.run.plan.components.len() {
            supervisor.report_tolerated(index, observe);
        }
        observe(Event::Status(&Status::read(&self.run.plan, &self.run.region)));
    }

    /// Runs only the actuators, in their safe state, for the settling time after a safe stop. Returns the
    /// simulated time at the end, ns.
    fn settle(&self, time: u64, supervisor: &mut Supervisor, observe: &mut dyn FnMut(Event<'_>)) -> u64 {
        // A second signal ends the settling, too.
        self.run.signals.forget();
        self.run.region.header().order(Command::SafeStop);
        let end = time + self.run.plan.settle_ns();
        let mut now_ns = monotonic_ns();
        for index in 0..self.run.plan.components.len() {
            let component = &self.run.plan.components[index];
            let (period, actuator) = (component.period_ns(), component.actuator);
            let mut next = time + period;
            while actuator && !supervisor.is_gone(index) && next <= end {
                let ticked = self.tick((index, next), &mut now_ns, supervisor, observe);
                if !matches!(ticked, Ticked::Done) {
                    break;
                }
                next += period;
            }
        }
        end
    }

    fn after_wait(&self) -> Ticked {
        if self.run.signals.is_raised() { Ticked::Interrupted } else { Ticked::Done }
    }

    /// Runs the tick of a component for a time; a process or thread then passes the turn. `now_ns` is the
    /// current time on `CLOCK_MONOTONIC`, updated by the call.
    #[inline]
    fn tick(
        &self,
        (index, time): (usize, u64),
        now_ns: &mut u64,
        supervisor: &mut Supervisor,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Ticked {
        self.rounds.note(&self.run.region, index, time);
        let inline = self.run.options.hosting == Hosting::Inline;
        if !inline {
            self.run.region.header().turn.pass(None, None);
        }
        if self.run.region.components()[index].phase() != Phase::Running
            && let Some(ticked) = self.await_running(index, supervisor, observe)
        {
            return ticked;
        }
        if !inline {
            let ticked = self.give_turn(index, Work::Step, supervisor, observe);
            *now_ns = monotonic_ns();
            return ticked;
        }
        if supervisor.workers.child(index).step(&self.run.region.components()[index], time, now_ns) {
            return Ticked::Done;
        }
        match supervisor.monitor(index, observe) {
            Some(AfterEnd::Fatal(reason)) => return Ticked::Fatal(reason),
            // The failed tick is lost; the restarted component starts with the next one.
            Some(AfterEnd::Restarted) => {
                let ticked = self.await_running(index, supervisor, observe);
                *now_ns = monotonic_ns();
                return ticked.unwrap_or(Ticked::Done);
            }
            Some(AfterEnd::Ignored) | None => {}
        }
        *now_ns = monotonic_ns();
        self.after_wait()
    }

    /// Passes the turn to a component and waits until any component returns it. There is no time limit,
    /// because a tick takes no simulated time. A signal ends the wait.
    fn give_turn(
        &self,
        index: usize,
        work: Work,
        supervisor: &mut Supervisor,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Ticked {
        let (block, turn) = (&self.run.region.components()[index], &self.run.region.header().turn);
        if matches!(work, Work::Reset) {
            block.tick_resets.store(1, Relaxed);
        }
        turn.pass(None, Some(index));
        block.call();
        let mut last = turn.now();
        let mut since_ns = monotonic_ns();
        let mut reported = false;
        loop {
            self.run.region.header().turn.await_call(LOOK);
            let now = self.run.region.header().turn.now();
            let Some(holder) = now.holder.filter(|holder| *holder < self.run.plan.components.len()) else {
                return Ticked::Done;
            };
            if self.run.signals.is_raised() {
                return Ticked::Interrupted;
            }
            let now_ns = monotonic_ns();
            if now != last {
                (last, since_ns, reported) = (now, now_ns, false);
            }
            let block = &self.run.region.components()[holder];
            // The giver may have died between giving the turn and calling.
            block.call();
            if !reported && now_ns - since_ns > TELL_AFTER_NS {
                reported = true;
                let (component, tick) = (&self.run.plan.components[holder].name, block.steps.load(Relaxed));
                observe(Event::Waiting { component, tick, for_ns: now_ns - since_ns });
            }
            self.look_around(now_ns, supervisor, observe);
            let ended = supervisor.monitor(holder, observe);
            if ended.is_none() && !supervisor.is_gone(holder) {
                continue;
            }
            // The tick of its death is lost; the restarted component starts with the next one.
            self.run.region.header().turn.pass(Some(holder), None);
            return match ended {
                Some(AfterEnd::Fatal(reason)) => Ticked::Fatal(reason),
                Some(AfterEnd::Ignored) => Ticked::Done,
                Some(AfterEnd::Restarted) => {
                    let ticked = self.await_running(holder, supervisor, observe);
                    ticked.unwrap_or_else(|| self.after_wait())
                }
                None => self.after_wait(),
            };
        }
    }

    /// Waits while a component starts, without advancing simulated time. Returns the outcome of its tick if
    /// the component has ended permanently or a signal arrived.
    fn await_running(
        &self,
        index: usize,
        supervisor: &mut Supervisor,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Option<Ticked> {
        while !supervisor.is_gone(index) && !self.run.signals.is_raised() {
            let block = &self.run.region.components()[index];
            let phase = block.phase();
            if phase != Phase::Running {
                futex_wait(block.phase_word(), phase as u32, Some(Duration::from_millis(20)));
            }
            if let Some(AfterEnd::Fatal(reason)) = supervisor.monitor(index, observe) {
                return Some(Ticked::Fatal(reason));
            }
            if phase == Phase::Running {
                return None;
            }
        }
        Some(self.after_wait())
    }
}
