//! Response times on one core under fixed priorities.
//!
//! The response time of a job is found from the *busy window* that contains it: an interval in which the core
//! always has work of its priority or above. Every job that finishes in the window was released in it, so
//! that
//!
//! ```text
//! finish = own work + sum over others of the same or higher priority of (releases before finish) * cost
//! ```
//!
//! whose smallest solution is found by iteration (M. Joseph, P. Pandya, *Finding response times in a
//! real-time system*, 1986). A job may be the first of its task in the window or a later one, for response
//! times beyond the period (J. Lehoczky 1990); releases may be late by a jitter (N. Audsley, A. Burns, M.
//! Richardson, K. Tindell, A. Wellings 1993).
//!
//! Tasks of equal priority wait in one first-come-first-served queue and do not preempt each other. With
//! unknown phases they count like more urgent tasks, which is correct for any order in the queue. It is not
//! pessimistic: if all tasks of a priority finish within their periods, at most one job of each runs before a
//! job that waits with it. With known phases only jobs that joined the queue no later count.
//!
//! A job may *suspend itself*, that is, wait for an answer without the core. This counts as work in its own
//! response time. For other tasks, the job acts as if it were released later, by up to its response time
//! minus its work (G. Nelissen, J. Fonseca, G. Raravi, V. Nelis, *Timing analysis of fixed priority
//! self-suspending sporadic tasks*, 2015; J.-J. Chen et al., *Many suspensions, many problems*, 2019). After
//! a wait it goes to the end of the queue of its priority.
//!
//! All times are in ns, and signed, because a job whose release is late by its whole jitter when the window
//! opens was due earlier.

/// Model of a task on a core.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::schedule) struct Demand {
    /// Priority of the task; higher is more urgent.
    pub priority: u8,
    /// Time between two releases, ns.
    pub period: i64,
    /// Offset of the releases, ns: due at `offset + n * period` on a clock shared by all tasks, or at any
    /// time if `None`.
    pub offset: Option<i64>,
    /// Release jitter, ns: the longest time from the due time to the release; `None` if unbounded.
    pub jitter: Option<i64>,
    /// Maximum time from the due time until the task joins the queue of its priority, ns; not less than the
    /// jitter.
    pub queue: i64,
    /// True if the task goes to the end of the queue again when it first gets the core, because a component
    /// that waits for the clock yields to components that it has woken. The order among yielding tasks does
    /// not change.
    pub yields: bool,
    /// Cost of each stage, ns.
    pub stages: Vec<i64>,
    /// Maximum time for which each stage waits without using the core, ns.
    pub waits: Vec<i64>,
    /// Maximum delay of the task's work after its release because of its waiting, ns; `None` if unbounded.
    pub deferral: Option<i64>,
    /// True if every job is known to finish before the next one is due. Each job then goes to the end of the
    /// queue.
    pub orderly: bool,
}

/// Bounds of one stage of a task.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::schedule) struct Bound {
    /// Time from when a release is due to the end of the stage.
    pub finish: Sum,
    /// Time from the actual release to the end of the stage.
    pub response: Sum,
}

/// Terms of a bound: the stages of the job up to its own, plus other jobs, minus the time before the release.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(in crate::schedule) struct Sum {
    /// Value of the bound, ns.
    pub total: i64,
    /// For each task of the core, the number of its jobs that run in the window before the stage ends. The
    /// job of the stage is not counted.
    pub jobs: Vec<i64>,
    /// Time from the opening of the window to the start of the measurement; negative if the measurement
    /// starts first.
    pub elapsed: i64,
}

/// Maximum number of jobs followed in one window.
const MOST: usize = 100_000;

/// The start of the window.
#[derive(Debug, Clone, Copy)]
pub(in crate::schedule) enum Opening {
    /// At time 0, with every other task released as late as possible, so that its next release follows
    /// soonest.
    Worst,
    /// At this time, with releases at their offsets.
    At(i64),
}

impl Opening {
    fn time(self) -> i64 {
        match self {
            Self::Worst => 0,
            Self::At(time) => time,
        }
    }
}

pub(in crate::schedule) fn floor_div(a: i64, b: i64) -> i64 {
    a.div_euclid(b)
}

pub(in crate::schedule) fn ceil_div(a: i64, b: i64) -> i64 {
    -((-a).div_euclid(b))
}

impl Demand {
    /// Returns the cost of one job.
    pub(in crate::schedule) fn cost(&self) -> i64 {
        self.stages.iter().sum()
    }

    /// Returns the cost of one job including its waiting, by which it delays itself.
    fn length(&self) -> i64 {
        self.cost() + self.waits.iter().sum::<i64>()
    }

    /// Returns `true` if the task suspends itself, that is, waits without using the core.
    pub(in crate::schedule) fn suspends(&self) -> bool {
        self.waits.iter().any(|wait| *wait > 0)
    }

    fn late(&self) -> i64 {
        self.jitter.unwrap_or(0)
    }

    /// Returns the longest time from the due time of a job to the start of its work.
    fn latest(&self) -> i64 {
        self.late() + self.deferral.unwrap_or(0)
    }

    /// Returns the number of releases before `until` in the longest window of the task itself, in which its
    /// waiting counts as work.
    fn own_releases(&self, until: i64) -> i64 {
        ceil_div(until + self.late(), self.period).max(0)
    }

    /// Returns the number of releases in the window before `until`.
    fn releases(&self, opening: Opening, until: i64) -> i64 {
        let first = match (opening, self.offset) {
            _ if until <= opening.time() => return 0,
            (Opening::At(time), Some(offset)) => {
                offset + ceil_div(time - self.latest() - offset, self.period) * self.period
            }
            _ => opening.time() - self.latest(),
        };
        ceil_div(until - first, self.period).max(0)
    }
}

/// A task and the tasks on its core that can delay it, which have its priority or a higher one.
#[derive(Debug)]
pub(in crate::schedule) struct Level<'a> {
    tasks: &'a [Demand],
    index: usize,
    others: Vec<usize>,
}

impl<'a> Level<'a> {
    /// Returns the tasks that can delay a task; `None` if there is no bound.
    pub(in crate::schedule) fn for_task(tasks: &'a [Demand], index: usize) -> Option<Self> {
        let above = |other: &usize| *other != index && tasks[*other].priority >= tasks[index].priority;
        let level = Self { tasks, index, others: (0..tasks.len()).filter(above).collect() };
        let waiting = level.own().waits.iter().sum::<i64>() as f64 / level.own().period as f64;
        let share = |task: &Demand| task.cost() as f64 / task.period as f64;
        let utilisation: f64 = waiting + level.all().map(share).sum::<f64>();
        let bounded = level.all().all(|task| task.jitter.is_some() && task.deferral.is_some());
        (bounded && utilisation <= 1.0 + 1e-12).then_some(level)
    }

    pub(in crate::schedule) fn own(&self) -> &'a Demand {
        &self.tasks[self.index]
    }

    /// Returns the task and all tasks that can delay it.
    pub(in crate::schedule) fn all(&self) -> impl Iterator<Item = &'a Demand> + '_ {
        self.others.iter().chain(core::iter::once(&self.index)).map(|task| &self.tasks[*task])
    }

    /// Returns the length of the longest busy window.
    pub(in crate::schedule) fn longest(&self) -> Option<i64> {
        let length = settle(1, |until| {
            self.own().own_releases(until) * self.own().length()
                + self.work(|other| other.releases(Opening::Worst, until))
        })?;
        let shortest = self.all().map(|task| task.period).min()?;
        (length / shortest < MOST as i64).then_some(length)
    }

    /// Returns the number of jobs of every task of the core: `count` for tasks that can delay the task, zero
    /// for others.
    fn jobs(&self, own: i64, count: impl Fn(&Demand) -> i64) -> Vec<i64> {
        let mut jobs = vec![0; self.tasks.len()];
        for other in &self.others {
            jobs[*other] = count(&self.tasks[*other]);
        }
        jobs[self.index] = own;
        jobs
    }

    fn work(&self, count: impl Fn(&Demand) -> i64) -> i64 {
        self.others.iter().map(|other| &self.tasks[*other]).map(|other| count(other) * other.cost()).sum()
    }

    /// Returns the ends of the stages of a job that is due at `due`, in a window in which `before` jobs of
    /// its own task run first. By stage: the time, and the number of earlier jobs by task.
    pub(in crate::schedule) fn run(
        &self,
        opening: Opening,
        due: i64,
        before: i64,
    ) -> Option<Vec<(i64, Vec<i64>)>> {
        let own = self.own();
        let start = opening.time();
        let mut joins = due + own.queue;
        let mut turn = joins;
        if own.yields && matches!(opening, Opening::At(_)) {
            // it may have been late on a core that was idle before
            let there = joins.max(start);
            turn = settle(there + 1, |until| {
                there + self.work(|other| self.ahead(opening, other, until, joins)) + before * own.length()
            })?;
        }
        let mut work = 0;
        let mut ends = Vec::with_capacity(own.stages.len());
        for (stage, cost) in own.stages.iter().enumerate() {
            work += cost + own.waits[stage];
            // the first stages of later jobs may run between the stages of this one, if it has not finished
            // before them
            let later = |until: i64| match stage {
                0 => 0,
                _ => (ceil_div(until - due, own.period) - 1).max(0),
            };
            let count = |other: &Demand, until: i64| {
                let joins = if other.yields { joins } else { turn };
                self.ahead(opening, other, until, joins)
            };
            let end = settle(start + 1, |until| {
                let others = self.work(|other| count(other, until));
                start + work + others + (before + later(until)) * own.length()
            })?;
            let until = end.max(start + 1);
            ends.push((end, self.jobs(before + later(end), |other| count(other, until))));
            joins = joins.max(end);
            turn = joins;
        }
        Some(ends)
    }

    /// Returns the number of releases of another task before `until` that are ahead of a job that joins the
    /// queue at `joins`.
    fn ahead(&self, opening: Opening, other: &Demand, until: i64, joins: i64) -> i64 {
        let own = self.own();
        // a job that has waited is behind all others of its priority
        let waits = other.priority == own.priority && other.orderly && !own.suspends();
        match opening {
            Opening::At(_) if waits => other.releases(opening, until.min(joins + 1)),
            _ => other.releases(opening, until),
        }
    }
}

/// Returns the smallest fixed point at or above `from` of a function that never decreases; its value at
/// `from` if that is below `from`.
fn settle(from: i64, function: impl Fn(i64) -> i64) -> Option<i64> {
    let mut time = from;
    for _ in 0..MOST {
        let next = function(time);
        if next <= time {
            return Some(next);
        }
        time = next;
    }
    None
}

/// Keeps the worst result of each stage, among the results so far and the results of a job that is due at
/// `due`.
pub(in crate::schedule) fn keep_worst(
    bounds: &mut [Option<Bound>],
    opening: Opening,
    due: i64,
    ends: Vec<(i64, Vec<i64>)>,
) {
    let sum = |end: i64, jobs: &Vec<i64>, from: i64| Sum {
        total: end - from,
        jobs: jobs.clone(),
        elapsed: from - opening.time(),
    };
    for (bound, (end, jobs)) in bounds.iter_mut().zip(ends) {
        let finish = sum(end, &jobs, due);
        let response = sum(end, &jobs, due.max(opening.time()));
        let Some(bound) = bound else {
            *bound = Some(Bound { finish, response });
            continue;
        };
        if finish.total > bound.finish.total {
            bound.finish = finish;
        }
        if response.total > bound.response.total {
            bound.response = response;
        }
    }
}

/// Returns the bounds of all stages of a task for any offsets of the tasks; `None` if there is no bound.
pub(in crate::schedule) fn bounds(tasks: &[Demand], index: usize) -> Option<Vec<Bound>> {
    let level = Level::for_task(tasks, index)?;
    let own = level.own();
    let longest = level.longest()?;
    let mut bounds = vec![None; own.stages.len()];
    // every job of the task that may be released in the window
    for before in 0.. {
        let due = before * own.period - own.late();
        if due >= longest {
            break;
        }
        let ends = level.run(Opening::Worst, due, before)?;
        keep_worst(&mut bounds, Opening::Worst, due, ends);
    }
    bounds.into_iter().collect()
}

/// Returns bounds on the time from the end of the first stage of a job to the end of each of its stages, for
/// a task that always finishes before it is due again.
///
/// When the first stage ends (or runs its last part), no more urgent task is waiting. Tasks of equal priority
/// that are still ahead joined the queue after the job. `queued` is the longest time from then to the end of
/// the first stage. With `rest`, times count from that long before this end.
pub(in crate::schedule) fn after_first_stage(
    tasks: &[Demand],
    index: usize,
    queued: i64,
    rest: i64,
) -> Option<Vec<Sum>> {
    let level = Level::for_task(tasks, index)?;
    let own = level.own();
    let mut bounds = Vec::with_capacity(own.stages.len());
    let mut work = rest;
    let later = own.stages.iter().zip(&own.waits).skip(1).map(|(cost, wait)| cost + wait);
    for cost in core::iter::once(0).chain(later) {
        work += cost;
        if work == 0 {
            bounds.push(Sum { total: 0, jobs: vec![0; tasks.len()], elapsed: 0 });
            continue;
        }
        let count = |other: &Demand, until: i64| {
            let since = if other.priority > own.priority { 0 } else { queued };
            other.releases(Opening::Worst, since + until)
        };
        let end = settle(1, |until| work + level.work(|other| count(other, until)))?;
        bounds.push(Sum { total: end, jobs: level.jobs(0, |other| count(other, end.max(1))), elapsed: 0 });
    }
    Some(bounds)
}
