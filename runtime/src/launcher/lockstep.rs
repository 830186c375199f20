//! The launcher's side of lockstep: ticks of simulated time, one component at a time, in a fixed order.

use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::time::Duration;

use super::event_log::logging;
use super::supervise::{AfterEnd, Supervision};
use super::{Event, Exit, Hosting, Launch};
use crate::os::{futex_wait, futex_wake, monotonic_ns};
use crate::region::{Command, Phase};

/// Time of a tick from which on it is told, ns.
const TELL_AFTER_NS: u64 = 1_000_000_000;
/// Time between two looks at what is printed, and two states for the display, ns.
const STATUS_NS: u64 = 50_000_000;

/// The outcome of a tick.
enum Ticked {
    /// It is done, or its component is no longer there.
    Done,
    /// The graph cannot go on.
    Fatal(String),
    /// A signal came.
    Interrupted,
}

/// The work that a tick hands out.
#[derive(Debug, Clone, Copy)]
enum Work {
    /// A step for this time, ns.
    Step(u64),
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
    /// Runs rounds of simulated time up to a limit. The exit, if the run ended before: by a signal, or a failure.
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
        for _ in 0..limit.rounds {
            let time = self.rounds.round_from(self.reached_ns);
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
            let mut place = 0;
            while stop.is_none()
                && let Some((due, index)) = self.rounds.next_due(&self.region, time, place)
            {
                match self.tick((index, time), &mut now_ns, &mut supervision[index], observe) {
                    Ticked::Done => place = due + 1,
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
            let header = self.region.header();
            header.reached_ns.store(self.reached_ns, Relaxed);
            let is_over = header.is_episode_over();
            self.tell_accounts_at(time, observe);
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

    /// Resets all components for an episode, one after the other: a barrier, after which simulated time begins anew. The
    /// exit if one of them cannot go on.
    pub(crate) fn reset(
        &mut self,
        index: u64,
        seed: u64,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Option<Exit> {
        let observe = &mut logging(&self.log, observe);
        self.tell_last_accounts(observe);
        self.region.header().begin_episode(index, seed);
        let mut supervision = core::mem::take(&mut self.supervision);
        let mut exit = None;
        for (component, supervision) in supervision.iter_mut().enumerate() {
            exit = exit.or(match self.reset_one((component, index, seed), supervision, observe) {
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
        self.next_account_ns = 0;
        observe(Event::Reset { episode: index, seed });
        exit
    }

    fn reset_one(
        &mut self,
        (component, index, seed): (usize, u64, u64),
        supervision: &mut Supervision,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Ticked {
        let is_running = self.region.components()[component].phase() == Phase::Running;
        if !is_running && !self.await_running(component, supervision, observe) {
            return self.after_wait();
        }
        if self.options.hosting != Hosting::Inline && !self.children[component].is_played() {
            return self.hand_out(component, Work::Reset, supervision, observe);
        }
        if self.children[component].reset(&self.region.components()[component], index, seed) {
            return Ticked::Done;
        }
        match self.monitor(component, supervision, observe) {
            Some(AfterEnd::Fatal(reason)) => Ticked::Fatal(reason),
            Some(AfterEnd::Restarted | AfterEnd::Ignored) | None => self.after_wait(),
        }
    }

    /// Time of the next round, ns; `u64::MAX` if there is none.
    pub(crate) fn next_round_ns(&self) -> u64 {
        self.rounds.round_from(self.reached_ns)
    }

    /// Looks at everything that no tick tells, if it is time to, and waits: for a signal, the end of a process, or a time on
    /// `CLOCK_MONOTONIC`, ns. The exit, if a signal came.
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

    /// Looks at everything that no tick tells.
    fn look_around(&mut self, supervision: &mut [Supervision], observe: &mut dyn FnMut(Event<'_>)) {
        self.relay_output(observe);
        self.monitor_guard(0, observe);
        self.look_at_places(observe);
        self.tell_stops(observe);
        for (index, supervision) in supervision.iter_mut().enumerate() {
            self.tell_tolerated(index, supervision, observe);
        }
        observe(Event::Status(&self.status()));
    }

    /// After a safe stop only the actuators go on, in their safe state, for the settling time. Returns when it is over.
    fn settle_lockstep(
        &mut self,
        time: u64,
        supervision: &mut [Supervision],
        observe: &mut dyn FnMut(Event<'_>),
    ) -> u64 {
        // A second signal ends the settling too.
        self.signals.forget();
        self.region.header().order(Command::SafeStop);
        let end = time + self.plan.safety.settle_ns;
        let mut now_ns = monotonic_ns();
        for (index, supervision) in supervision.iter_mut().enumerate() {
            let component = &self.plan.components[index];
            let (period, actuator) = (component.period_ns(), component.actuator);
            let mut next = time + period;
            while actuator && !supervision.is_gone() && next <= end {
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

    /// Has one component step for a time. `now_ns` is the present on `CLOCK_MONOTONIC`, before and after.
    #[inline]
    fn tick(
        &mut self,
        (index, time): (usize, u64),
        now_ns: &mut u64,
        supervision: &mut Supervision,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Ticked {
        if self.region.components()[index].phase() != Phase::Running
            && !self.await_running(index, supervision, observe)
        {
            return self.after_wait();
        }
        if self.options.hosting != Hosting::Inline {
            let ticked = self.hand_out(index, Work::Step(time), supervision, observe);
            *now_ns = monotonic_ns();
            return ticked;
        }
        if self.children[index].step(&self.region.components()[index], time, now_ns) {
            return Ticked::Done;
        }
        match self.monitor(index, supervision, observe) {
            Some(AfterEnd::Fatal(reason)) => return Ticked::Fatal(reason),
            // The tick in which it failed is lost; its successor starts with the next one.
            Some(AfterEnd::Restarted) => {
                self.await_running(index, supervision, observe);
            }
            Some(AfterEnd::Ignored) | None => {}
        }
        *now_ns = monotonic_ns();
        self.after_wait()
    }

    /// Hands out one tick, to a component and for a time, and waits for it to be done, however long that takes: a tick takes
    /// no simulated time. A signal ends the wait.
    fn hand_out(
        &mut self,
        index: usize,
        work: Work,
        supervision: &mut Supervision,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Ticked {
        let block = &self.region.components()[index];
        let given = block.tick_given.load(Relaxed).wrapping_add(1);
        if let Work::Step(time) = work {
            block.tick_time_ns.store(time, Relaxed);
        }
        block.tick_resets.store(u32::from(matches!(work, Work::Reset)), Relaxed);
        block.tick_given.store(given, Release);
        futex_wake(&block.tick_given);
        let began = monotonic_ns();
        let mut told = false;
        loop {
            let block = &self.region.components()[index];
            let done = block.tick_done.load(Acquire);
            if done == given {
                return Ticked::Done;
            }
            futex_wait(&block.tick_done, done, Some(Duration::from_millis(20)));
            if block.tick_done.load(Acquire) == given {
                return Ticked::Done;
            }
            if self.signals.is_raised() {
                return Ticked::Interrupted;
            }
            let for_ns = monotonic_ns() - began;
            if !told && for_ns > TELL_AFTER_NS {
                told = true;
                let component = &self.plan.components[index].name;
                observe(Event::Waiting { component, tick: block.steps.load(Relaxed), for_ns });
            }
            if told {
                self.relay_output(observe);
            }
            match self.monitor(index, supervision, observe) {
                // The tick in which it died is lost; its successor starts with the next one.
                Some(AfterEnd::Restarted) => {
                    let block = &self.region.components()[index];
                    block.tick_done.store(given, Release);
                    self.await_running(index, supervision, observe);
                    return self.after_wait();
                }
                Some(AfterEnd::Ignored) => return Ticked::Done,
                Some(AfterEnd::Fatal(reason)) => return Ticked::Fatal(reason),
                None if supervision.is_gone() => return self.after_wait(),
                None => {}
            }
        }
    }

    /// Waits while a component starts; simulated time stands still. False if it has ended for good.
    fn await_running(
        &mut self,
        index: usize,
        supervision: &mut Supervision,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> bool {
        while !supervision.is_gone() && !self.signals.is_raised() {
            let block = &self.region.components()[index];
            let phase = block.phase();
            if phase == Phase::Running {
                self.monitor(index, supervision, observe);
                return true;
            }
            futex_wait(block.phase_word(), phase as u32, Some(Duration::from_millis(20)));
            self.monitor(index, supervision, observe);
        }
        false
    }
}
