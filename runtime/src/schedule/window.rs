//! Response times on one core under fixed priorities, first come first served among equals (`SCHED_FIFO`).
//!
//! The response time of a job is found from the *busy window* it falls into: a time in which the core is never without
//! work of its priority or above. Whatever finishes in the window was released in it, so that
//!
//! ```text
//! finish = own work + sum over higher priorities of (releases before finish) * cost
//!                   + sum over equals of (releases up to the time at which the job joined the queue) * cost
//! ```
//!
//! whose smallest solution is found by iteration (M. Joseph, P. Pandya, *Finding response times in a real-time system*,
//! 1986). A job may be the first of its task in the window or a later one, for deadlines beyond the period (J. Lehoczky
//! 1990); releases may come late by a jitter (N. Audsley, A. Burns, M. Richardson, K. Tindell, A. Wellings 1993); among
//! equals, the job may join the queue at any time that makes a difference (L. George, N. Rivierre, M. Spuri 1996).
//!
//! All times are in ns, and signed: a job whose release comes late by its whole jitter as the window opens was due before.

/// A task on a core, as this analysis sees it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Demand {
    /// Higher is more urgent.
    pub priority: u8,
    /// Time between two releases.
    pub period: i64,
    /// When releases are due: `offset + n * period` on a clock that all tasks share; any time if `None`.
    pub offset: Option<i64>,
    /// How late after it is due a release may come; `None` if there is no end to it.
    pub jitter: Option<i64>,
    /// How late after it is due it may join the queue of its priority: not less than the jitter.
    pub queue: i64,
    /// Cost of each stage.
    pub stages: Vec<i64>,
    /// Whether every job is known to finish before the next one is due, so that jobs join the queue in the order of
    /// their releases.
    pub orderly: bool,
}

/// Bounds of one stage of a task.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Bound {
    /// From the time a release is due to the end of the stage.
    pub finish: Sum,
    /// From the actual release to the end of the stage.
    pub response: Sum,
}

/// What a bound is made of: the stages of the job up to its own, other jobs, less what ran before.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Sum {
    /// The bound.
    pub total: i64,
    /// By task of the core: jobs that run in the window before the stage ends, besides the job itself.
    pub jobs: Vec<i64>,
    /// Time from the opening of the window to the beginning of the measurement; negative if that came first.
    pub elapsed: i64,
}

/// More jobs, or candidates, than this in one window are not followed.
const MOST: usize = 100_000;

/// Where the window opens.
#[derive(Debug, Clone, Copy)]
pub(super) enum Opening {
    /// At time 0, with every other task released as late as it can be, so that the next release follows soonest.
    Worst,
    /// At this time, with releases as their offsets say.
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

pub(super) fn floor_div(a: i64, b: i64) -> i64 {
    a.div_euclid(b)
}

pub(super) fn ceil_div(a: i64, b: i64) -> i64 {
    -((-a).div_euclid(b))
}

impl Demand {
    /// Cost of one job.
    pub(super) fn cost(&self) -> i64 {
        self.stages.iter().sum()
    }

    fn late(&self) -> i64 {
        self.jitter.unwrap_or(0)
    }

    /// Releases in the window before `until`; with `closed`, also those at that time.
    pub(super) fn releases(&self, opening: Opening, until: i64, closed: bool) -> i64 {
        let count = |from: i64| {
            let length = until - from;
            match closed {
                true => floor_div(length, self.period) + 1,
                false => ceil_div(length, self.period),
            }
        };
        match (opening, self.offset) {
            (Opening::At(time), Some(offset)) => {
                let first = ceil_div(time - self.late() - offset, self.period);
                count(offset + first * self.period).max(0)
            }
            _ if until < opening.time() || (until == opening.time() && !closed) => 0,
            _ => count(opening.time() - self.late()).max(0),
        }
    }
}

/// The tasks of a core that can hold up one of them, told apart by how they do.
#[derive(Debug)]
pub(super) struct Level<'a> {
    pub tasks: &'a [Demand],
    pub index: usize,
    /// Interrupt it.
    pub higher: Vec<usize>,
    /// Wait in one queue with it.
    pub equal: Vec<usize>,
}

impl<'a> Level<'a> {
    /// What can hold up a task; `None` if there is no bound to that.
    pub(super) fn of(tasks: &'a [Demand], index: usize) -> Option<Self> {
        let own = &tasks[index];
        let others = |test: &dyn Fn(&Demand) -> bool| -> Vec<usize> {
            (0..tasks.len()).filter(|other| *other != index && test(&tasks[*other])).collect()
        };
        let overtakes = |other: &Demand| other.priority == own.priority && !other.orderly;
        let level = Self {
            tasks,
            index,
            // who does not come back to the queue in order can be anywhere in it: as if it could interrupt
            higher: others(&|other| other.priority > own.priority || overtakes(other)),
            equal: others(&|other| other.priority == own.priority && other.orderly),
        };
        let utilisation: f64 = level.all().map(|task| task.cost() as f64 / task.period as f64).sum();
        let bounded = level.all().all(|task| task.jitter.is_some());
        (bounded && utilisation <= 1.0 + 1e-12).then_some(level)
    }

    pub(super) fn own(&self) -> &'a Demand {
        &self.tasks[self.index]
    }

    /// The task and all that can hold it up.
    pub(super) fn all(&self) -> impl Iterator<Item = &'a Demand> + '_ {
        let others = self.higher.iter().chain(&self.equal);
        others.chain(core::iter::once(&self.index)).map(|task| &self.tasks[*task])
    }

    /// Length of the longest busy window.
    pub(super) fn longest(&self) -> Option<i64> {
        let work = |until: i64| -> i64 {
            self.all().map(|task| task.releases(Opening::Worst, until, false) * task.cost()).sum()
        };
        let length = settle(1, work)?;
        let shortest = self.all().map(|task| task.period).min()?;
        (length / shortest < MOST as i64).then_some(length)
    }

    /// When the stages of a job end that is due at `due`, in a window in which `before` jobs of its own task run first.
    /// By stage: the time, and the jobs that ran before it, by task.
    pub(super) fn run(&self, opening: Opening, due: i64, before: i64) -> Option<Vec<(i64, Vec<i64>)>> {
        let own = self.own();
        let cost = |task: &usize| self.tasks[*task].cost();
        let start = opening.time();
        let mut joins = (due + own.queue).max(start);
        let mut work = 0;
        let mut ends = Vec::with_capacity(own.stages.len());
        for (stage, stage_cost) in own.stages.iter().enumerate() {
            work += stage_cost;
            // The next job's first stages may run between the stages of this one.
            let following = |until: i64| match stage {
                0 => 0,
                _ if own.orderly => floor_div(until - due, own.period).max(0),
                _ => (ceil_div(until - due, own.period) - 1).max(0),
            };
            let ahead: i64 = self
                .equal
                .iter()
                .map(|task| self.tasks[*task].releases(opening, joins, true) * cost(task))
                .sum();
            let own_jobs = |until: i64| before + following(if own.orderly { joins } else { until });
            let end = settle(start + 1, |until| {
                let above: i64 = self
                    .higher
                    .iter()
                    .map(|task| self.tasks[*task].releases(opening, until, false) * cost(task))
                    .sum();
                start + work + ahead + above + own_jobs(until) * own.cost()
            })?;
            let mut jobs = vec![0; self.tasks.len()];
            for task in &self.higher {
                jobs[*task] = self.tasks[*task].releases(opening, end.max(start + 1), false);
            }
            for task in &self.equal {
                jobs[*task] = self.tasks[*task].releases(opening, joins, true);
            }
            jobs[self.index] = own_jobs(end);
            ends.push((end, jobs));
            joins = joins.max(end);
        }
        Some(ends)
    }
}

/// The smallest fixed point of a function that never falls, not below `from`; where the function is below `from`
/// itself, its value there.
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

/// Keeps the worst of each stage, with what was found for a job that is due at `due`.
pub(super) fn keep_worst(
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

/// Bounds of all stages of a task, whatever the offsets of the tasks are. `None` if there is no bound.
pub(super) fn bounds(tasks: &[Demand], index: usize) -> Option<Vec<Bound>> {
    let level = Level::of(tasks, index)?;
    let own = level.own();
    let longest = level.longest()?;
    // the times at which the job may be due that can be worst: as the window opens or a number of periods later, or so
    // that it joins the queue just behind one of its equals
    let mut due: Vec<i64> = multiples(-own.late(), own.period, longest)?;
    for task in &level.equal {
        let other = &tasks[*task];
        due.extend(multiples(-other.late() - own.queue, other.period, longest)?);
    }
    due.retain(|due| *due >= -own.late());
    due.sort_unstable();
    due.dedup();
    if due.len() > MOST {
        return None;
    }
    let mut bounds = vec![None; own.stages.len()];
    for due in due {
        let before = floor_div(due + own.late(), own.period);
        let ends = level.run(Opening::Worst, due, before)?;
        keep_worst(&mut bounds, Opening::Worst, due, ends);
    }
    bounds.into_iter().collect()
}

/// `first + n * step` before `end`, for n from 0.
fn multiples(first: i64, step: i64, end: i64) -> Option<Vec<i64>> {
    let count = ceil_div(end - first, step).max(0);
    (count <= MOST as i64).then(|| (0..count).map(|n| first + n * step).collect())
}

/// Bound of the time from the end of the first stage of a job to the end of each of its stages.
///
/// As the first stage ends nobody more urgent is waiting. Equals that are still ahead joined the queue after the job
/// did: `queued` is the longest time from then to the end of the first stage.
pub(super) fn after_first_stage(tasks: &[Demand], index: usize, queued: i64) -> Option<Vec<Sum>> {
    let level = Level::of(tasks, index)?;
    let own = level.own();
    if !own.orderly {
        return None;
    }
    let mut bounds = vec![Sum { total: 0, jobs: vec![0; tasks.len()], elapsed: 0 }];
    let (mut joins, mut work) = (0, 0);
    for cost in own.stages.iter().skip(1) {
        work += cost;
        let releases = |task: &usize, until: i64| {
            let task = &tasks[*task];
            match (task.priority > own.priority, task.orderly) {
                (true, _) => task.releases(Opening::Worst, until, false),
                (false, true) => task.releases(Opening::Worst, queued + joins, true),
                (false, false) => task.releases(Opening::Worst, queued + until, true),
            }
        };
        let others = || level.higher.iter().chain(&level.equal);
        let end = settle(1, |until| {
            work + others().map(|task| releases(task, until) * tasks[*task].cost()).sum::<i64>()
        })?;
        let mut jobs = vec![0; tasks.len()];
        others().for_each(|task| jobs[*task] = releases(task, end.max(1)));
        bounds.push(Sum { total: end, jobs, elapsed: 0 });
        joins = end;
    }
    Some(bounds)
}
