//! A discrete-event simulation of fixed-priority scheduling, first come first served among equals.

use core::cmp::Reverse;
use std::collections::BinaryHeap;

use super::lane::{Lane, Segment};
use crate::plan::{Activation, OnOverrun, Plan};
use crate::schedule::analysis::tasks::{self, Place, StaticPlan};
use crate::schedule::{Activity, Overheads};

/// Maximum number of segments.
const MOST_SEGMENTS: usize = 20_000;

/// An event at a known time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Event {
    /// A time-triggered component begins to wait for its release.
    Wait { component: usize, release: i64 },
    /// A component is triggered.
    Trigger { component: usize },
    /// A descriptor is readable, as often as it may be.
    Arrive { component: usize },
    /// A step of a component that is not drawn ends.
    End { component: usize, release: i64 },
}

/// A step that waits for the core or runs on it.
#[derive(Debug, Clone, Copy)]
struct Job {
    /// Position in the queue of its priority.
    order: u64,
    /// Time at which it was due.
    release: i64,
    /// End of its spinning.
    spin_until: i64,
    /// Time left of the step.
    left: i64,
    /// True if it waits for the clock, and has not yet yielded to components of equal priority.
    to_yield: bool,
}

/// One component.
#[derive(Debug)]
struct Thread {
    /// Core and priority; without contention if `None`.
    place: Option<(usize, u8)>,
    cost: i64,
    job: Option<Job>,
    /// True if it was triggered again before its step ended.
    again: Option<i64>,
}

/// The state of the simulation at one moment.
#[derive(Debug)]
pub(super) struct Simulation<'p> {
    plan: &'p Plan,
    overheads: &'p Overheads,
    threads: Vec<Thread>,
    lanes: Vec<Lane>,
    events: BinaryHeap<Reverse<(i64, u64, Event)>>,
    cores: Vec<usize>,
    now: i64,
    counter: u64,
    segments: usize,
}

impl<'p> Simulation<'p> {
    /// Creates a simulation before its start.
    pub(super) fn new(plan: &'p Plan, made: &StaticPlan, overheads: &'p Overheads) -> Self {
        let threads: Vec<Thread> = plan
            .components
            .iter()
            .zip(&made.places)
            .enumerate()
            .map(|(index, (component, place))| match place {
                Some(Place { task, stage }) => {
                    let task = &made.tasks[*task];
                    let step = task.stages[*stage].steps.iter().find(|step| step.component == index);
                    let cost = step.map_or(0, |step| step.cost_ns()) as i64;
                    let priority = tasks::priority(component).unwrap_or(task.priority);
                    Thread { place: Some((task.core, priority)), cost, job: None, again: None }
                }
                None => {
                    let cost = component.budget_ns.unwrap_or(0) as i64;
                    Thread { place: None, cost, job: None, again: None }
                }
            })
            .collect();
        let lanes = plan
            .components
            .iter()
            .zip(&threads)
            .map(|(component, thread)| Lane {
                component: component.name.clone(),
                priority: thread.place.map_or(0, |(_, priority)| priority),
                ..Lane::default()
            })
            .collect();
        Self {
            plan,
            overheads,
            threads,
            lanes,
            events: BinaryHeap::new(),
            cores: made.cores(),
            now: 0,
            counter: 0,
            segments: 0,
        }
    }

    /// Simulates from 0 to `length`, after a warm-up. Returns the time reached, and the activity of every
    /// component.
    pub(super) fn run(mut self, length: i64) -> (u64, Vec<Lane>) {
        let slowest = self.plan.components.iter().map(|c| c.period_ns() as i64).max().unwrap_or(0);
        // all have been released at least twice by then
        let spin = (0..self.threads.len()).map(|component| self.spin(component)).max().unwrap_or(0);
        self.now = -(2 * slowest).min(2 * length) - spin;
        for (index, component) in self.plan.components.iter().enumerate() {
            if let Activation::Periodic { period_ns, phase_ns } = component.activation {
                let (period, phase) = (period_ns as i64, phase_ns as i64);
                let awake = self.now + self.spin(index);
                let since = (awake - phase).rem_euclid(period);
                let release = awake + (period - since) % period;
                self.wait(index, release);
            }
        }
        for (index, component) in self.plan.components.iter().enumerate() {
            if let Activation::Descriptor { min_interval_ns } = component.activation {
                let before = (-self.now).div_euclid(min_interval_ns as i64) * min_interval_ns as i64;
                self.schedule(-before, Event::Arrive { component: index });
            }
        }
        while self.now < length && self.segments < MOST_SEGMENTS {
            self.deliver();
            self.let_others_run();
            let running = self.running();
            let next = self.next(&running).min(length);
            for index in running.into_iter().flatten() {
                self.advance(index, next);
            }
            self.now = next;
            self.complete();
        }
        (self.now.max(0) as u64, self.lanes)
    }

    fn order(&mut self) -> u64 {
        self.counter += 1;
        self.counter
    }

    fn schedule(&mut self, time: i64, event: Event) {
        let order = self.order();
        self.events.push(Reverse((time, order, event)));
    }

    /// Returns the spin time of a component before a release; one period for a component that always spins.
    fn spin(&self, component: usize) -> i64 {
        let component = &self.plan.components[component];
        component.spin.at_most_ns().min(component.period_ns()) as i64
    }

    /// Makes a time-triggered component wait for its next release, first asleep, then spinning.
    fn wait(&mut self, component: usize, release: i64) {
        let time = self.now.max(release - self.spin(component));
        self.schedule(time, Event::Wait { component, release });
    }

    /// Handles all events up to now.
    fn deliver(&mut self) {
        while let Some(Reverse((time, _, event))) = self.events.peek().copied()
            && time <= self.now
        {
            self.events.pop();
            match event {
                Event::Wait { component, release } => {
                    if release >= 0 {
                        self.lanes[component].releases_ns.push(release as u64);
                    }
                    self.queue(component, release, release);
                }
                Event::Trigger { component } => self.release(component),
                Event::Arrive { component } => {
                    self.release(component);
                    let interval = self.plan.components[component].period_ns() as i64;
                    self.schedule(time + interval, Event::Arrive { component });
                }
                Event::End { component, release } => self.end(component, release),
            }
        }
    }

    /// Releases a component that does not wait for the clock.
    fn release(&mut self, component: usize) {
        if self.now >= 0 {
            self.lanes[component].releases_ns.push(self.now as u64);
        }
        if self.threads[component].job.is_some() {
            self.threads[component].again = Some(self.now);
        } else {
            self.queue(component, self.now, self.now);
        }
    }

    /// Adds a step to the end of the queue of its priority.
    fn queue(&mut self, component: usize, release: i64, spin_until: i64) {
        let order = self.order();
        let thread = &mut self.threads[component];
        let to_yield = matches!(self.plan.components[component].activation, Activation::Periodic { .. });
        thread.job = Some(Job { order, release, spin_until, left: thread.cost, to_yield });
        if thread.place.is_none() {
            let end = self.now.max(spin_until) + thread.cost;
            self.schedule(end, Event::End { component, release });
        }
    }

    /// Moves a job that waited for the clock to the end of the queue of its priority again when it first gets
    /// the core.
    fn let_others_run(&mut self) {
        loop {
            let yielding = |job: &mut Job| core::mem::take(&mut job.to_yield);
            let first = self.running().into_iter().flatten();
            let Some(index) = first.into_iter().find(|index| {
                let job = self.threads[*index].job.as_mut();
                job.is_some_and(yielding)
            }) else {
                return;
            };
            let order = self.order();
            if let Some(job) = &mut self.threads[index].job {
                job.order = order;
            }
        }
    }

    /// Returns the job on each core.
    fn running(&self) -> Vec<Option<usize>> {
        let on = |core: usize| {
            let waiting = self.threads.iter().enumerate().filter_map(|(index, thread)| {
                let (_, priority) = thread.place.filter(|(at, _)| *at == core)?;
                Some((Reverse(priority), thread.job?.order, index))
            });
            waiting.min().map(|(_, _, index)| index)
        };
        self.cores.iter().map(|core| on(*core)).collect()
    }

    /// Returns the time of the next event.
    fn next(&self, running: &[Option<usize>]) -> i64 {
        let events = self.events.peek().map(|Reverse((time, _, _))| *time);
        let ends = running.iter().flatten().filter_map(|index| {
            let job = self.threads[*index].job?;
            Some(if job.spin_until > self.now { job.spin_until } else { self.now + job.left })
        });
        ends.chain(events).min().unwrap_or(i64::MAX).max(self.now)
    }

    /// Runs a component on the core until `next`.
    fn advance(&mut self, index: usize, next: i64) {
        let Some(job) = &mut self.threads[index].job else { return };
        let spinning = job.spin_until > self.now;
        if !spinning {
            job.left -= next - self.now;
        }
        let (start, end) = (self.now.max(0) as u64, next.max(0) as u64);
        if end <= start {
            return;
        }
        let activity = if spinning { Activity::Spin } else { Activity::Step };
        let segments = &mut self.lanes[index].segments;
        match segments.last_mut() {
            Some(last) if last.end_ns == start && last.activity == activity => last.end_ns = end,
            _ => {
                segments.push(Segment { start_ns: start, end_ns: end, activity });
                self.segments += 1;
            }
        }
    }

    /// Ends the steps that have finished.
    fn complete(&mut self) {
        for core in self.running().into_iter().flatten() {
            if let Some(job) =
                self.threads[core].job.filter(|job| job.left == 0 && job.spin_until <= self.now)
            {
                self.end(core, job.release);
            }
        }
    }

    fn end(&mut self, index: usize, release: i64) {
        let component = &self.plan.components[index];
        let period = component.period_ns() as i64;
        if self.now > release + period && self.now >= 0 {
            self.lanes[index].late_ns.push(self.now as u64);
        }
        let job = self.threads[index].job.take();
        for topic in component.outputs.iter().filter_map(|port| port.topic) {
            for reader in &self.plan.topics[topic].triggers {
                self.trigger(index, *reader);
            }
        }
        match component.activation {
            Activation::Periodic { .. } => {
                let next = after(release, self.now, period, component.on_overrun);
                self.wait(index, next);
            }
            Activation::Triggered { .. } | Activation::Descriptor { .. } => {
                if let Some(release) = self.threads[index].again.take() {
                    // a component that need not wait does not go to the end of the queue
                    self.queue(index, release, self.now);
                    if let (Some(next), Some(job)) = (&mut self.threads[index].job, job) {
                        next.order = job.order;
                    }
                }
            }
        }
    }

    fn trigger(&mut self, writer: usize, reader: usize) {
        let core = |index: usize| self.threads[index].place.map(|(core, _)| core);
        let same = core(writer).is_some() && core(writer) == core(reader);
        let delay = if same { 0 } else { self.overheads.hop_cross_core_ns as i64 };
        self.schedule(self.now + delay, Event::Trigger { component: reader });
    }
}

/// Returns the release after a release whose step ended at `end`.
fn after(release: i64, end: i64, period: i64, policy: OnOverrun) -> i64 {
    let next = release + period;
    match policy {
        _ if end <= next => next,
        OnOverrun::CatchUp => next,
        OnOverrun::Rephase => end + period,
        _ => next + (end - next + period - 1) / period * period,
    }
}
