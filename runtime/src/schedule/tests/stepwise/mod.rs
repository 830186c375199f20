//! A machine simulated in unit steps of time, with steps, wake-ups and publications that vary randomly within
//! the limits of the graph and the overheads.

mod properties;

use std::collections::HashMap;

use super::graphs::{Node, When};
use crate::plan::{OnOverrun, SchedulingClass};
use crate::schedule::Overheads;

/// Times that vary randomly.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Chance {
    /// Every step uses its budget and publishes at its end; no wake-up is late.
    None,
    /// Steps use up to their budgets and publish at their ends; wake-ups are late up to their limits.
    Times,
    /// Like `Times`, and steps publish at any time before their ends.
    TimesAndPublications,
}

/// Longest observed times, by component.
#[derive(Debug, Clone, Default)]
pub(super) struct Seen {
    /// Response time of each component, from the release of its task, ns.
    pub response: Vec<i64>,
    /// Response time of each component, from the release at the head of its chain, ns.
    pub chain: Vec<i64>,
    /// Latency from the source time of a component's data to its publication, ns. The key contains the
    /// component at which the data originated.
    pub latency: HashMap<(usize, usize), i64>,
    /// Fraction of time in which each core was busy.
    pub busy: HashMap<usize, f64>,
}

/// Origin of data and of a release.
#[derive(Debug, Clone, Copy)]
struct Token {
    /// Release of the task.
    task: i64,
    /// Release at the head of the chain.
    chain: i64,
    /// Time and component at which the data originated.
    source: Option<(i64, usize)>,
}

#[derive(Debug, Clone)]
struct Running {
    order: u64,
    /// Deadline of a `SCHED_DEADLINE` component.
    deadline: i64,
    token: Token,
    /// End of spinning.
    spin_until: i64,
    started: bool,
    left: i64,
    publish_when_left: i64,
    published: bool,
    /// Work of the worker after the step.
    tail: i64,
    ended: bool,
    /// True if it waits for the clock and has not yielded to others yet.
    to_yield: bool,
}

#[derive(Debug, Clone, Default)]
struct Thread {
    job: Option<Running>,
    again: Option<Token>,
    /// Time-triggered: the next release, and the time at which it joins the queue.
    next: Option<(i64, i64)>,
    /// Triggers in transit, with their times of arrival.
    coming: Vec<(i64, Token)>,
    newest: Option<(i64, usize)>,
    /// A wake-up that waits for the end of the triggering step.
    owed: Option<Token>,
}

/// The simulated machine.
pub(super) struct Machine<'g> {
    nodes: &'g [Node],
    overheads: Overheads,
    spin: i64,
    /// True if it spins for less time when wake-ups allow it.
    tuned: bool,
    chance: Chance,
    random: u64,
    threads: Vec<Thread>,
    counter: u64,
    now: i64,
    seen: Seen,
}

impl<'g> Machine<'g> {
    pub(super) fn new(
        nodes: &'g [Node],
        spin_ns: u64,
        overheads: Overheads,
        chance: Chance,
        seed: u64,
    ) -> Self {
        let count = nodes.len();
        Self {
            nodes,
            overheads,
            spin: spin_ns as i64,
            tuned: false,
            chance,
            random: seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1,
            threads: vec![Thread::default(); count],
            counter: 0,
            now: 0,
            seen: Seen { response: vec![0; count], chain: vec![0; count], ..Seen::default() },
        }
    }

    /// Enables self-tuning margins.
    pub(super) fn tuned(mut self, tuned: bool) -> Self {
        self.tuned = tuned;
        self
    }

    /// Returns a random number from 0 to `most`, often one of the ends.
    fn up_to(&mut self, most: i64) -> i64 {
        if self.chance == Chance::None || most <= 0 {
            return 0;
        }
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        match (self.random >> 40) % 4 {
            0 => 0,
            1 => most,
            _ => ((self.random >> 20) % (most as u64 + 1)) as i64,
        }
    }

    /// Returns the `SCHED_DEADLINE` component on each core. The earliest deadlines get one core each, in any
    /// order.
    fn earliest(&mut self, cores: &[usize]) -> HashMap<usize, usize> {
        let mut waiting: Vec<(i64, usize)> = (0..self.nodes.len())
            .filter(|index| self.by_deadline(*index))
            .filter_map(|index| Some((self.threads[index].job.as_ref()?.deadline, index)))
            .collect();
        waiting.sort_unstable();
        waiting.truncate(cores.len());
        let shift = self.up_to(cores.len() as i64 - 1) as usize;
        waiting
            .iter()
            .enumerate()
            .map(|(at, (_, index))| (cores[(at + shift) % cores.len()], *index))
            .collect()
    }

    pub(super) fn run(mut self, length: i64) -> Seen {
        for index in 0..self.nodes.len() {
            if let When::Every(_, phase) = self.nodes[index].when {
                let spin = self.spin(index);
                self.await_release(index, spin + phase as i64);
            }
            if let When::OnEvents(interval) = self.nodes[index].when {
                self.await_event(index, 0, interval);
            }
        }
        // the shared core of these graphs, and the cores of their components
        let mut cores: Vec<usize> = self.nodes.iter().filter_map(|node| node.core).chain([0]).collect();
        cores.sort_unstable();
        cores.dedup();
        let mut busy = vec![0; cores.len()];
        while self.now < length {
            self.arrivals();
            let taken = self.earliest(&cores);
            for (core, busy) in cores.iter().zip(&mut busy) {
                *busy += i64::from(self.unit(*core, taken.get(core).copied()));
            }
            self.now += 1;
        }
        for (core, busy) in cores.into_iter().zip(busy) {
            self.seen.busy.insert(core, busy as f64 / length as f64);
        }
        self.seen
    }

    fn await_release(&mut self, index: usize, release: i64) {
        let mut margin = self.spin(index);
        if self.tuned {
            margin -= self.up_to(margin - margin.min(self.overheads.wake_ns as i64));
        }
        let asleep_until = release - margin;
        // a component behind schedule goes to the end of the queue immediately
        let joins = if self.now < asleep_until {
            asleep_until + self.up_to(self.overheads.wake_ns as i64)
        } else {
            self.now
        };
        self.threads[index].next = Some((release, joins));
    }

    /// Schedules an event at `earliest` or up to an interval later.
    fn await_event(&mut self, index: usize, earliest: i64, interval: u64) {
        let release = earliest + self.up_to(interval as i64);
        let late = self.up_to(self.overheads.wake_ns as i64);
        let joins = if self.now < release { release + late } else { self.now };
        self.threads[index].next = Some((release, joins));
    }

    fn arrivals(&mut self) {
        for index in 0..self.nodes.len() {
            if let Some((release, joins)) = self.threads[index].next
                && joins <= self.now
            {
                self.threads[index].next = None;
                let token = Token { task: release, chain: release, source: None };
                self.start(index, token, release, None);
            }
            let due: Vec<(i64, Token)> =
                self.threads[index].coming.iter().copied().filter(|(at, _)| *at <= self.now).collect();
            self.threads[index].coming.retain(|(at, _)| *at > self.now);
            for (at, mut token) in due {
                let When::After(writer) = self.nodes[index].when else { unreachable!() };
                if !self.one_task(writer, index) {
                    token.task = at;
                }
                if self.threads[index].job.is_some() {
                    self.threads[index].again = Some(token);
                } else {
                    self.start(index, token, self.now, None);
                }
            }
        }
    }

    fn start(&mut self, index: usize, token: Token, spin_until: i64, order: Option<u64>) {
        self.counter += 1;
        let (mut body, mut tail) = (self.body(index), self.tail(index));
        if self.chance != Chance::None {
            (body, tail) = (1 + self.up_to(body - 1), self.up_to(tail));
        }
        let early = if self.chance == Chance::TimesAndPublications { self.up_to(body - 1) } else { 0 };
        let by_clock = matches!(self.nodes[index].when, When::Every(..));
        self.threads[index].job = Some(Running {
            order: order.unwrap_or(self.counter),
            deadline: match self.nodes[index].class {
                SchedulingClass::Deadline { period_ns, .. } => self.now + period_ns as i64,
                _ => 0,
            },
            token,
            spin_until,
            started: false,
            left: body + tail,
            publish_when_left: tail + early,
            published: false,
            tail,
            ended: false,
            to_yield: by_clock && !self.by_deadline(index),
        });
    }

    /// Returns the first component in the queue of a core.
    fn first(&mut self, core: usize) -> Option<usize> {
        loop {
            let ready = (0..self.nodes.len()).filter(|index| self.nodes[*index].core == Some(core));
            let (_, _, index) = ready
                .filter(|index| !self.by_deadline(*index))
                .filter_map(|index| {
                    let order = self.threads[index].job.as_ref()?.order;
                    Some((core::cmp::Reverse(self.priority(index)), order, index))
                })
                .min()?;
            let job = self.threads[index].job.as_mut()?;
            if !core::mem::take(&mut job.to_yield) {
                return Some(index);
            }
            self.counter += 1;
            job.order = self.counter;
        }
    }

    /// Simulates one unit of time on a core, which a deadline component may have taken. Returns `true` if it
    /// was used.
    fn unit(&mut self, core: usize, taken: Option<usize>) -> bool {
        let Some(index) = taken.or_else(|| self.first(core)) else { return false };
        let reads = match self.nodes[index].when {
            When::After(writer) => self.threads[writer].newest,
            When::Every(..) | When::OnEvents(_) => {
                self.nodes[index].reads.and_then(|writer| self.threads[writer].newest)
            }
        };
        let now = self.now;
        let job = self.threads[index].job.as_mut().unwrap();
        if now < job.spin_until {
            return true;
        }
        if !job.started {
            job.started = true;
            job.token.source = reads;
        }
        job.left -= 1;
        let (left, token) = (job.left, job.token);
        let publishes = left <= job.publish_when_left && !core::mem::replace(&mut job.published, true);
        let ends = left <= job.tail && !core::mem::replace(&mut job.ended, true);
        if publishes {
            self.publish(index, token);
        }
        if ends {
            self.wake_here(index);
            let end = self.now + 1;
            self.seen.response[index] = self.seen.response[index].max(end - token.task);
            self.seen.chain[index] = self.seen.chain[index].max(end - token.chain);
        }
        if left == 0 {
            self.finish(index, token);
        }
        true
    }

    /// Publishes at the end of the current unit.
    fn publish(&mut self, index: usize, mut token: Token) {
        let time = self.now + 1;
        let has_cause = self.nodes[index].reads.is_some() || matches!(self.nodes[index].when, When::After(_));
        if !has_cause {
            token.source = Some((time, index));
        }
        if let Some((source, origin)) = token.source {
            let longest = self.seen.latency.entry((origin, index)).or_default();
            *longest = (*longest).max(time - source);
        }
        self.threads[index].newest = token.source;
        for reader in 0..self.nodes.len() {
            if !matches!(self.nodes[reader].when, When::After(writer) if writer == index) {
                continue;
            }
            if self.stays(index) {
                self.threads[reader].owed = Some(token);
                continue;
            }
            let delay = if self.nodes[reader].core == self.nodes[index].core {
                0
            } else if self.chance == Chance::None {
                self.overheads.hop_cross_core_ns as i64
            } else {
                self.up_to(self.overheads.hop_cross_core_ns as i64)
            };
            self.threads[reader].coming.push((time + delay, token));
        }
    }

    /// Wakes the components on the same core that a finished step has triggered.
    fn wake_here(&mut self, index: usize) {
        for reader in 0..self.nodes.len() {
            if matches!(self.nodes[reader].when, When::After(writer) if writer == index)
                && let Some(token) = self.threads[reader].owed.take()
            {
                self.threads[reader].coming.push((self.now + 1, token));
            }
        }
    }

    fn finish(&mut self, index: usize, token: Token) {
        let end = self.now + 1;
        let order = self.threads[index].job.take().map(|job| job.order);
        match self.nodes[index].when {
            When::Every(period, _) => {
                let period = period as i64;
                let next = token.task + period;
                let next = if end <= next || self.nodes[index].on_overrun == OnOverrun::CatchUp {
                    next
                } else if self.nodes[index].on_overrun == OnOverrun::Rephase {
                    end + period
                } else {
                    next + (end - next + period - 1) / period * period
                };
                self.now += 1;
                self.await_release(index, next);
                self.now -= 1;
            }
            When::OnEvents(interval) => {
                self.now += 1;
                self.await_event(index, token.task + interval as i64, interval);
                self.now -= 1;
            }
            When::After(_) => {
                if let Some(token) = self.threads[index].again.take() {
                    self.start(index, token, end, order);
                }
            }
        }
    }
}
