//! Bounds of all tasks of all cores.
//!
//! Tasks on different cores, or of different priorities, that trigger one another depend on one another through their
//! release jitter: what triggers a task may come as late as the bound of the one that publishes. Starting from no jitter,
//! bounds and jitters are found in turn until nothing changes (K. Tindell, J. Clark, *Holistic schedulability analysis
//! for distributed hard real-time systems*, 1994).

use super::Overheads;
use super::phases;
use super::tasks::{Release, StaticPlan, Task};
use super::window::{self, Bound, Demand};

/// Rounds after which bounds that still grow count as growing for ever.
const MOST_ROUNDS: usize = 100;

/// All tasks as the analysis sees them, with what was found.
#[derive(Debug)]
pub(super) struct Responses {
    /// By task of the static plan.
    pub demands: Vec<Demand>,
    /// By task: the bound of each stage; `None` if there is no bound.
    pub bounds: Vec<Option<Vec<Bound>>>,
}

impl Responses {
    /// The tasks on the core of one of them, and its index among them.
    pub(super) fn on_core_of(&self, plan: &StaticPlan, task: usize) -> (Vec<Demand>, usize) {
        let core = plan.on_core(plan.tasks[task].core);
        let index = core.iter().position(|other| *other == task).expect("a task is on its core");
        (core.into_iter().map(|task| self.demands[task].clone()).collect(), index)
    }
}

/// Finds the bounds of all tasks.
pub(super) fn responses(plan: &StaticPlan, overheads: &Overheads) -> Responses {
    let mut demands: Vec<Demand> = plan.tasks.iter().map(|task| demand(task, plan, overheads)).collect();
    let cores: Vec<Vec<usize>> = plan.cores().into_iter().map(|core| plan.on_core(core)).collect();
    let mut bounds = vec![None; demands.len()];
    for round in 0.. {
        for core in &cores {
            let tasks = core.iter().map(|task| demands[*task].clone()).collect();
            for (task, found) in core.iter().zip(on_core(tasks)) {
                bounds[*task] = found;
            }
        }
        let mut changed = false;
        for (index, task) in plan.tasks.iter().enumerate() {
            let jitter = jitter(task, plan, &bounds, overheads);
            // once without end, it stays so
            if demands[index].jitter.is_some() && jitter != demands[index].jitter {
                changed = true;
                demands[index].jitter = jitter.filter(|_| round < MOST_ROUNDS);
                demands[index].queue = demands[index].queue.max(jitter.unwrap_or(0));
            }
        }
        if !changed {
            break;
        }
    }
    Responses { demands, bounds }
}

fn demand(task: &Task, plan: &StaticPlan, overheads: &Overheads) -> Demand {
    let mut stages: Vec<i64> = task.stages.iter().map(|stage| stage.cost_ns() as i64).collect();
    stages[0] += task.spin_ns() as i64;
    let period = task.period_ns as i64;
    // that of a triggered task grows with what is found
    let (offset, jitter, queue) = match task.release {
        // It wants the core from the moment it begins to spin; being woken late shortens the spinning.
        Release::Timer { phase_ns, spin_ns, fixed } => {
            let offset = (phase_ns as i64 - spin_ns as i64).rem_euclid(period);
            (fixed.then_some(offset), late_wake(spin_ns, overheads), overheads.wake_ns as i64)
        }
        Release::Trigger { delay_ns, .. } => (offset(task, plan), delay_ns as i64, delay_ns as i64),
    };
    Demand { priority: task.priority, period, offset, jitter: Some(jitter), queue, stages, orderly: false }
}

/// Offset of a triggered task: that of the releases at the head of its chain.
fn offset(task: &Task, plan: &StaticPlan) -> Option<i64> {
    match task.release {
        Release::Timer { phase_ns, fixed, .. } => fixed.then_some(phase_ns as i64),
        Release::Trigger { by, .. } => offset(&plan.tasks[plan.places[by]?.task], plan),
    }
}

/// How late a component may be woken for its release, in spite of spinning.
fn late_wake(spin_ns: u64, overheads: &Overheads) -> i64 {
    overheads.wake_ns.saturating_sub(spin_ns) as i64
}

/// How late a task may be released after it is due: a triggered one is due as the head of its chain is released.
fn jitter(
    task: &Task,
    plan: &StaticPlan,
    bounds: &[Option<Vec<Bound>>],
    overheads: &Overheads,
) -> Option<i64> {
    match task.release {
        Release::Timer { spin_ns, .. } => Some(late_wake(spin_ns, overheads)),
        Release::Trigger { by, delay_ns } => {
            let Some(place) = plan.places[by] else {
                // Not real-time: taken to be in time. What follows from that is told apart as not provable.
                return Some(delay_ns as i64);
            };
            let writer = bounds[place.task].as_ref()?.get(place.stage)?;
            Some(writer.finish.total - plan.tasks[place.task].spin_ns() as i64 + delay_ns as i64)
        }
    }
}

/// Bounds of the tasks of one core. On the way it finds out which of them always go to the end of the queue.
pub(super) fn on_core(mut tasks: Vec<Demand>) -> Vec<Option<Vec<Bound>>> {
    loop {
        let bounds: Vec<Option<Vec<Bound>>> = (0..tasks.len()).map(|index| best(&tasks, index)).collect();
        let mut changed = false;
        for (task, bounds) in tasks.iter_mut().zip(&bounds) {
            let in_time = |bounds: &Vec<Bound>| bounds.iter().all(|bound| bound.finish.total <= task.period);
            let orderly = bounds.as_ref().is_some_and(in_time);
            changed |= orderly && !task.orderly;
            task.orderly |= orderly;
        }
        if !changed {
            return bounds;
        }
    }
}

/// Each of two analyses gives a bound; the lower of both holds.
fn best(tasks: &[Demand], index: usize) -> Option<Vec<Bound>> {
    let mut bounds = window::bounds(tasks, index)?;
    for (bound, other) in bounds.iter_mut().zip(phases::bounds(tasks, index).into_iter().flatten()) {
        if other.finish.total < bound.finish.total {
            bound.finish = other.finish;
        }
        if other.response.total < bound.response.total {
            bound.response = other.response;
        }
    }
    Some(bounds)
}
