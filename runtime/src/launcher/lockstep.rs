//! The launcher's side of lockstep: ticks of simulated time, one component at a time, in a fixed order.
//!
//! The launcher starts a round and passes the turn to its first component. Processes and threads pass it on
//! among themselves, through as many rounds as permitted, and return it at the end of the requested part, or
//! when they cannot continue. Components hosted inline are stepped by the launcher, one after the other.

use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;

use super::event_log::logging;
use super::supervise::AfterEnd;
use super::supervision::Supervision;
use super::{Event, Exit, Hosting, Launch};
use crate::os::{futex_wait, monotonic_ns};
use crate::region::{Command, Phase};

/// Duration of a tick above which it is reported, ns.
const TELL_AFTER_NS: u64 = 1_000_000_000;
/// Interval of checks for printed lines, and of status updates, ns.
const STATUS_NS: u64 = 50_000_000;

/// Maximum wait for the turn between checks of signals and of the component that holds it.
const LOOK: Duration = Duration::from_millis(20);

/// The outcome of a tick.
enum Ticked {
    /// The work is done, or its component no longer exists.
    Done,
    /// The graph cannot go on.
    Fatal(String),
    /// A signal came.
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

/// The part of simulated time to run.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limit {
    /// The rounds before this time, ns.
    pub(crate) until_ns: u64,
    /// At most so many rounds.
    pub(crate) rounds: u64,
}

impl Launch {
    /// Runs rounds of simulated time up to a limit. The exit, if the run ended before: by a signal, or a
    /// failure.
    pub(crate) fn run_rounds(&mut self, limit: Limit, observe: &mut dyn FnMut(Event<'_>)) -> Option<Exit> {
        let observe = &mut logging(&self.log, observe);
        let mut supervision = core::mem::take(&mut self.supervision);
        let exit = self.rounds(limit, &mut supervision, observe);
        self.supervision = supervision;
        exit
    }

    fn rounds(
        &mut self,
        limit: Limit,
        supervision: &mut [Supervision],
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
            if self.signals.is_raised() {
                self.reached_ns = time;
                return Some(Exit::Interrupted);
            }
            let mut stop = (self.region.header().command() == Command::SafeStop)
                .then(|| super::stop_reason::reason(&self.plan, &self.region));
            rounds -= 1;
            // The accounts are read after the same rounds, by the launcher or by components.
            let look_ns = self.rounds.round_from(self.accounts.next_look_ns()).saturating_add(1);
            self.region.header().turn.allow_rounds(limit.until_ns.min(look_ns), rounds);
            let mut place = 0;
            while stop.is_none()
                && let Some(index) = self.rounds.next_due(&self.region, time, place)
            {
                let ticked = self.tick((index, time), &mut now_ns, supervision, observe);
                // Components that pass the turn on may have advanced to other rounds.
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
                self.reached_ns = self.settle_lockstep(time, supervision, observe);
                return Some(Exit::SafeStop { reason });
            }
            self.reached_ns = time + 1;
            rounds = self.region.header().turn.rounds_left();
            let header = self.region.header();
            header.reached_ns.store(self.reached_ns, Relaxed);
            let is_over = header.is_episode_over();
            self.accounts.report_at((&self.plan, &self.region), time, observe);
            if is_over {
                return None;
            }
            if now_ns >= self.next_status_ns {
                self.next_status_ns = now_ns + STATUS_NS;
                self.look_around(supervision, observe);
            }
        }
        None
    }

    /// Returns the component of the last tick and its time, after the turn was passed to the component
    /// `first`.
    fn last_tick(&self, first: usize) -> (usize, u64) {
        let last = self.region.header().turn.now().giver.unwrap_or(first);
        let block = self.region.components().get(last);
        block.map_or((first, 0), |block| (last, block.tick_time_ns.load(Relaxed)))
    }

    /// Resets all components for an episode, one after the other: a barrier after which simulated time
    /// restarts. Returns the exit if one of them cannot continue.
    pub(crate) fn reset(
        &mut self,
        index: u64,
        seed: u64,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Option<Exit> {
        let observe = &mut logging(&self.log, observe);
        self.report_last_accounts(observe);
        self.region.header().begin_episode(index, seed);
        let mut supervision = core::mem::take(&mut self.supervision);
        let mut exit = None;
        for component in 0..supervision.len() {
            exit = exit.or(match self.reset_one((component, index, seed), &mut supervision, observe) {
                Ticked::Done => None,
                Ticked::Interrupted => Some(Exit::Interrupted),
                Ticked::Fatal(reason) => Some(Exit::SafeStop { reason }),
            });
        }
        self.supervision = supervision;
        self.services.clear();
        self.region.topics().iter().for_each(|topic| topic.begin_episode());
        self.region.components().iter().for_each(|block| block.begin_episode());
        self.before_ns += core::mem::take(&mut self.reached_ns);
        self.accounts.begin_episode();
        observe(Event::Reset { episode: index, seed });
        exit
    }

    fn reset_one(
        &mut self,
        (component, index, seed): (usize, u64, u64),
        supervision: &mut [Supervision],
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Ticked {
        let is_running = self.region.components()[component].phase() == Phase::Running;
        if !is_running
            && let Some(ticked) = self.await_running(component, &mut supervision[component], observe)
        {
            return ticked;
        }
        if self.options.hosting != Hosting::Inline && !self.children[component].is_played() {
            return self.give_turn(component, Work::Reset, supervision, observe);
        }
        if self.children[component].reset(&self.region.components()[component], index, seed) {
            return Ticked::Done;
        }
        match self.monitor(component, &mut supervision[component], observe) {
            Some(AfterEnd::Fatal(reason)) => Ticked::Fatal(reason),
            Some(AfterEnd::Restarted | AfterEnd::Ignored) | None => self.after_wait(),
        }
    }

    /// Time of the next round, ns; `u64::MAX` for none.
    pub(crate) fn next_round_ns(&self) -> u64 {
        self.rounds.round_from(self.reached_ns)
    }

    /// Performs due checks, and waits for a signal, the end of a process, or a time on `CLOCK_MONOTONIC`, ns.
    /// Returns the exit if a signal arrived.
    pub(crate) fn wait(&mut self, until_ns: u64, observe: &mut dyn FnMut(Event<'_>)) -> Option<Exit> {
        let observe = &mut logging(&self.log, observe);
        let now_ns = monotonic_ns();
        if now_ns >= self.next_status_ns {
            self.next_status_ns = now_ns + STATUS_NS;
            let mut supervision = core::mem::take(&mut self.supervision);
            self.look_around(&mut supervision, observe);
            self.supervision = supervision;
        }
        if !self.signals.is_raised() && monotonic_ns() < until_ns {
            self.wait_for_something(until_ns);
        }
        self.signals.is_raised().then_some(Exit::Interrupted)
    }

    /// Checks everything that ticks do not report.
    fn look_around(&mut self, supervision: &mut [Supervision], observe: &mut dyn FnMut(Event<'_>)) {
        self.relay_output(observe);
        self.guard.monitor(&self.program, (&self.folder, &self.region), 0, observe);
        self.places.look(&self.options, &self.folder, observe);
        self.stops.report(&self.plan, &self.region, observe);
        for (index, supervision) in supervision.iter_mut().enumerate() {
            self.report_tolerated(index, supervision, observe);
        }
        observe(Event::Status(&self.status()));
    }

    /// After a safe stop only the actuators continue, in their safe state, for the settling time. Returns
    /// when it is over.
    fn settle_lockstep(
        &mut self,
        time: u64,
        supervision: &mut [Supervision],
        observe: &mut dyn FnMut(Event<'_>),
    ) -> u64 {
        // A second signal ends the settling too.
        self.signals.forget();
        self.region.header().order(Command::SafeStop);
        let end = time + self.plan.settle_ns();
        let mut now_ns = monotonic_ns();
        for index in 0..supervision.len() {
            let component = &self.plan.components[index];
            let (period, actuator) = (component.period_ns(), component.actuator);
            let mut next = time + period;
            while actuator && !supervision[index].is_gone() && next <= end {
                let ticked = self.tick((index, next), &mut now_ns, supervision, observe);
                if !matches!(ticked, Ticked::Done) {
                    break;
                }
                next += period;
            }
        }
        end
    }

    fn after_wait(&self) -> Ticked {
        if self.signals.is_raised() { Ticked::Interrupted } else { Ticked::Done }
    }

    /// Has one component step for a time; a process or thread then passes the turn on. `now_ns` is the
    /// present on `CLOCK_MONOTONIC`, before and after.
    #[inline]
    fn tick(
        &mut self,
        (index, time): (usize, u64),
        now_ns: &mut u64,
        supervision: &mut [Supervision],
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Ticked {
        self.rounds.note(&self.region, index, time);
        let inline = self.options.hosting == Hosting::Inline;
        if !inline {
            self.region.header().turn.pass(None, None);
        }
        if self.region.components()[index].phase() != Phase::Running
            && let Some(ticked) = self.await_running(index, &mut supervision[index], observe)
        {
            return ticked;
        }
        if !inline {
            let ticked = self.give_turn(index, Work::Step, supervision, observe);
            *now_ns = monotonic_ns();
            return ticked;
        }
        if self.children[index].step(&self.region.components()[index], time, now_ns) {
            return Ticked::Done;
        }
        match self.monitor(index, &mut supervision[index], observe) {
            Some(AfterEnd::Fatal(reason)) => return Ticked::Fatal(reason),
            // The failed tick is lost; the restarted component starts with the next one.
            Some(AfterEnd::Restarted) => {
                let ticked = self.await_running(index, &mut supervision[index], observe);
                *now_ns = monotonic_ns();
                return ticked.unwrap_or(Ticked::Done);
            }
            Some(AfterEnd::Ignored) | None => {}
        }
        *now_ns = monotonic_ns();
        self.after_wait()
    }

    /// Passes the turn to a component and waits until it returns, from that or another one, for as long as
    /// needed: a tick takes no simulated time. A signal ends the wait.
    fn give_turn(
        &mut self,
        index: usize,
        work: Work,
        supervision: &mut [Supervision],
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Ticked {
        let (block, turn) = (&self.region.components()[index], &self.region.header().turn);
        if matches!(work, Work::Reset) {
            block.tick_resets.store(1, Relaxed);
        }
        turn.pass(None, Some(index));
        block.call();
        let mut last = turn.now();
        let mut since_ns = monotonic_ns();
        let mut reported = false;
        loop {
            self.region.header().turn.await_call(LOOK);
            let now = self.region.header().turn.now();
            let Some(holder) = now.holder.filter(|holder| *holder < supervision.len()) else {
                return Ticked::Done;
            };
            if self.signals.is_raised() {
                return Ticked::Interrupted;
            }
            let now_ns = monotonic_ns();
            if now != last {
                (last, since_ns, reported) = (now, now_ns, false);
            }
            let block = &self.region.components()[holder];
            // The giver may have died between giving the turn and calling.
            block.call();
            if !reported && now_ns - since_ns > TELL_AFTER_NS {
                reported = true;
                let (component, tick) = (&self.plan.components[holder].name, block.steps.load(Relaxed));
                observe(Event::Waiting { component, tick, for_ns: now_ns - since_ns });
            }
            if now_ns >= self.next_status_ns {
                self.next_status_ns = now_ns + STATUS_NS;
                self.look_around(supervision, observe);
            }
            let ended = self.monitor(holder, &mut supervision[holder], observe);
            if ended.is_none() && !supervision[holder].is_gone() {
                continue;
            }
            // The tick of its death is lost; the restarted component starts with the next one.
            self.region.header().turn.pass(Some(holder), None);
            return match ended {
                Some(AfterEnd::Fatal(reason)) => Ticked::Fatal(reason),
                Some(AfterEnd::Ignored) => Ticked::Done,
                Some(AfterEnd::Restarted) => {
                    let ticked = self.await_running(holder, &mut supervision[holder], observe);
                    ticked.unwrap_or_else(|| self.after_wait())
                }
                None => self.after_wait(),
            };
        }
    }

    /// Waits while a component starts; simulated time stands still. Returns the outcome of its tick if it
    /// does not run: it has ended permanently, or a signal arrived.
    fn await_running(
        &mut self,
        index: usize,
        supervision: &mut Supervision,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Option<Ticked> {
        while !supervision.is_gone() && !self.signals.is_raised() {
            let block = &self.region.components()[index];
            let phase = block.phase();
            if phase != Phase::Running {
                futex_wait(block.phase_word(), phase as u32, Some(Duration::from_millis(20)));
            }
            if let Some(AfterEnd::Fatal(reason)) = self.monitor(index, supervision, observe) {
                return Some(Ticked::Fatal(reason));
            }
            if phase == Phase::Running {
                return None;
            }
        }
        Some(self.after_wait())
    }
}
