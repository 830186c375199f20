//! The launcher's side of lockstep: ticks of simulated time, one component at a time, in a fixed order.

use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::time::Duration;

use super::shutdown::Signals;
use super::supervise::{AfterEnd, Supervision};
use super::{Event, Exit, Launch, Services};
use crate::os::{futex_wait, futex_wake, monotonic_ns};
use crate::plan::Activation;
use crate::region::{Command, Phase};

/// Time of a tick from which on it is told, ns.
const TELL_AFTER_NS: u64 = 1_000_000_000;

/// The outcome of a tick.
enum Ticked {
    /// It is done, or its component is no longer there.
    Done,
    /// The graph cannot go on.
    Fatal(String),
    /// A signal came.
    Interrupted,
}

impl Ticked {
    fn after_wait(signals: &Signals) -> Self {
        if signals.is_raised() { Self::Interrupted } else { Self::Done }
    }
}

impl Launch<'_> {
    /// Runs simulated time to the end of the run, a signal, or a failure. Returns the exit and the simulated time, ns.
    pub(super) fn run_lockstep(
        &mut self,
        services: &Services,
        signals: &Signals,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> (Exit, u64) {
        let mut order: Vec<usize> = (0..self.plan.components.len()).collect();
        order.sort_by_key(|index| self.plan.components[*index].order);
        let mut next: Vec<u64> = self
            .plan
            .components
            .iter()
            .map(|component| match component.activation {
                Activation::Periodic { phase_ns, .. } => phase_ns,
                Activation::Triggered { .. } => u64::MAX,
            })
            .collect();
        let mut seen = vec![0; next.len()];
        let mut supervision = self.supervision(monotonic_ns());
        let end = self.plan.duration_ns.unwrap_or(u64::MAX);
        let mut next_status = 0;
        loop {
            let time = next.iter().copied().min().unwrap_or(u64::MAX);
            if time >= end {
                return (Exit::Finished, end);
            }
            if signals.is_raised() {
                return (Exit::Interrupted, time);
            }
            let mut stop = (self.region.header().command() == Command::SafeStop)
                .then(|| super::stop_reason::reason(&self.plan, &self.region));
            for &index in &order {
                if stop.is_none() && self.is_due(index, time, &mut next, &mut seen) {
                    match self.tick((index, time), &mut supervision[index], services, signals, observe) {
                        Ticked::Done => {}
                        Ticked::Fatal(reason) => stop = Some(reason),
                        Ticked::Interrupted => return (Exit::Interrupted, time),
                    }
                }
            }
            if let Some(reason) = stop {
                observe(Event::SafeStop { reason: &reason });
                let time = self.settle_lockstep(time, &mut supervision, services, signals, observe);
                return (Exit::SafeStop { reason }, time);
            }
            let now = monotonic_ns();
            if now >= next_status {
                next_status = now + 50_000_000;
                self.relay_output(observe);
                self.monitor_guard(0, observe);
                self.look_at_places(observe);
                self.tell_stops(observe);
                for (index, supervision) in supervision.iter_mut().enumerate() {
                    self.tell_tolerated(index, supervision, observe);
                }
                observe(Event::Status(&self.status()));
            }
        }
    }

    fn is_due(&self, index: usize, time: u64, next: &mut [u64], seen: &mut [u64]) -> bool {
        match self.plan.components[index].activation {
            Activation::Periodic { period_ns, .. } => {
                let due = next[index] == time;
                if due {
                    next[index] += period_ns;
                }
                due
            }
            Activation::Triggered { topic, .. } => {
                let published = self.region.topics()[topic].published.load(Acquire);
                let due = published != seen[index];
                seen[index] = published;
                due
            }
        }
    }

    /// After a safe stop only the actuators go on, in their safe state, for the settling time. Returns when it is over.
    fn settle_lockstep(
        &mut self,
        time: u64,
        supervision: &mut [Supervision],
        services: &Services,
        signals: &Signals,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> u64 {
        // A second signal ends the settling too.
        signals.forget();
        self.region.header().order(Command::SafeStop);
        let end = time + self.plan.safety.settle_ns;
        for (index, supervision) in supervision.iter_mut().enumerate() {
            let component = &self.plan.components[index];
            let (period, actuator) = (component.period_ns(), component.actuator);
            let mut next = time + period;
            while actuator && !supervision.is_gone() && next <= end {
                let ticked = self.tick((index, next), supervision, services, signals, observe);
                if !matches!(ticked, Ticked::Done) {
                    break;
                }
                next += period;
            }
        }
        end
    }

    /// Hands out one tick, to a component and for a time, and waits for it to be done, however long that takes: a tick takes no simulated time. A signal
    /// ends the wait.
    fn tick(
        &mut self,
        (index, time): (usize, u64),
        supervision: &mut Supervision,
        services: &Services,
        signals: &Signals,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> Ticked {
        let block = &self.region.components()[index];
        if block.phase() != Phase::Running
            && !self.await_running(index, supervision, services, signals, observe)
        {
            return Ticked::after_wait(signals);
        }
        let block = &self.region.components()[index];
        let given = block.tick_given.load(Relaxed).wrapping_add(1);
        block.tick_time_ns.store(time, Relaxed);
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
            if signals.is_raised() {
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
            match self.monitor(index, supervision, services, signals, observe) {
                // The tick in which it died is lost; its successor starts with the next one.
                Some(AfterEnd::Restarted) => {
                    let block = &self.region.components()[index];
                    block.tick_done.store(given, Release);
                    self.await_running(index, supervision, services, signals, observe);
                    return Ticked::after_wait(signals);
                }
                Some(AfterEnd::Ignored) => return Ticked::Done,
                Some(AfterEnd::Fatal(reason)) => return Ticked::Fatal(reason),
                None if supervision.is_gone() => return Ticked::after_wait(signals),
                None => {}
            }
        }
    }

    /// Waits while a component starts; simulated time stands still. False if it has ended for good.
    fn await_running(
        &mut self,
        index: usize,
        supervision: &mut Supervision,
        services: &Services,
        signals: &Signals,
        observe: &mut dyn FnMut(Event<'_>),
    ) -> bool {
        while !supervision.is_gone() && !signals.is_raised() {
            let block = &self.region.components()[index];
            let phase = block.phase();
            if phase == Phase::Running {
                self.monitor(index, supervision, services, signals, observe);
                return true;
            }
            futex_wait(block.phase_word(), phase as u32, Some(Duration::from_millis(20)));
            self.monitor(index, supervision, services, signals, observe);
        }
        false
    }
}
