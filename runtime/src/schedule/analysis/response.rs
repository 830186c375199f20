//! Bounds of all tasks of all cores.
//!
//! Tasks that trigger one another across cores or priorities depend on one another through their release
//! jitter: a triggered task is released as late as the bound of the publishing component. Starting without
//! jitter, bounds and jitters are iterated until nothing changes (K. Tindell, J. Clark, *Holistic
//! schedulability analysis for distributed hard real-time systems*, 1994).

use super::global::{Global, Reserved};
use super::overheads::Overheads;
use super::phases;
use super::tasks::{Release, Reservation, StaticPlan, Task};
use super::window::{self, Bound, Demand};

/// Number of rounds after which bounds that still grow count as unbounded.
const MOST_ROUNDS: usize = 100;

/// All tasks as the analysis models them, with the bounds found so far.
#[derive(Debug)]
pub(in crate::schedule) struct Responses {
    /// Tasks of the static plan, as modelled by the analysis.
    pub demands: Vec<Demand>,
    /// Bounds of the stages of each task; `None` for a task without a bound.
    pub bounds: Vec<Option<Vec<Bound>>>,
    /// Load of each reservation of the static plan on any core.
    pub reserved: Vec<Demand>,
    /// Maximum time from the wake-up of each reservation to the end of its step, ns; `None` without a bound.
    pub reserved_response: Vec<Option<i64>>,
    /// Maximum lateness of the reservations' wake-ups, ns.
    pub reserved_late: i64,
}

impl Responses {
    /// Returns the tasks on the core of a task followed by all reservations, and the index of the task among
    /// them.
    pub(in crate::schedule) fn on_core_of(&self, plan: &StaticPlan, task: usize) -> (Vec<Demand>, usize) {
        let core = plan.on_core(plan.tasks[task].core);
        let index = core.iter().position(|other| *other == task).expect("a task is on its core");
        let tasks = core.into_iter().map(|task| self.demands[task].clone());
        (tasks.chain(self.reserved.iter().cloned()).collect(), index)
    }

    /// Returns the longest time from the release of a reservation to the end of its step, ns.
    pub(in crate::schedule) fn reserved_finish(&self, reservation: usize) -> Option<i64> {
        Some(self.reserved_response[reservation]? + self.reserved_late)
    }
}

/// Finds the bounds of all tasks.
pub(in crate::schedule) fn responses(plan: &StaticPlan, overheads: &Overheads) -> Responses {
    let late = overheads.wake_ns as i64;
    let global =
        Global::analyse(plan.reservations.iter().map(reserved).collect(), plan.available_cores, late);
    let all = || plan.reservations.iter().enumerate();
    let reserved: Vec<Demand> = all().map(|(index, one)| above_all(one, &global, index, late)).collect();
    let reserved_response: Vec<Option<i64>> =
        all().map(|(index, one)| global.response(index, one.step.cost_ns() as i64)).collect();
    let mut demands: Vec<Demand> = plan.tasks.iter().map(|task| demand(task, plan, overheads)).collect();
    let cores: Vec<Vec<usize>> = plan.cores().into_iter().map(|core| plan.on_core(core)).collect();
    let mut bounds = vec![None; demands.len()];
    for round in 0.. {
        for core in &cores {
            let tasks =
                core.iter().map(|task| demands[*task].clone()).chain(reserved.iter().cloned()).collect();
            for (task, found) in core.iter().zip(on_core(tasks)) {
                bounds[*task] = found;
            }
        }
        let mut changed = false;
        for (index, task) in plan.tasks.iter().enumerate() {
            let finish = |reservation: usize| Some(reserved_response.get(reservation).copied()?? + late);
            let jitter = jitter(task, plan, &bounds, &finish, overheads);
            // an unbounded task stays unbounded
            if demands[index].jitter.is_some() && jitter != demands[index].jitter {
                changed = true;
                demands[index].jitter = jitter.filter(|_| round < MOST_ROUNDS);
                demands[index].queue = demands[index].queue.max(jitter.unwrap_or(0));
            }
            if demands[index].suspends() && demands[index].deferral.is_some() {
                let deferral = deferral(&demands[index], bounds[index].as_deref());
                if deferral != demands[index].deferral {
                    changed = true;
                    demands[index].deferral = deferral.filter(|_| round < MOST_ROUNDS);
                }
            }
        }
        if !changed {
            break;
        }
    }
    Responses { demands, bounds, reserved, reserved_response, reserved_late: late }
}

/// Returns the time by which the work of a suspending task may be later than its release: until the end of
/// its job, minus the work.
fn deferral(demand: &Demand, bounds: Option<&[Bound]>) -> Option<i64> {
    let finish = bounds?.iter().map(|bound| bound.finish.total).max()?;
    Some((finish - demand.cost() - demand.jitter?).max(demand.deferral?))
}

fn reserved(reservation: &Reservation) -> Reserved {
    Reserved { runtime: reservation.runtime_ns as i64, period: reservation.period_ns as i64 }
}

/// Returns the load of a reservation on every core it may run on: its whole run time, ahead of all
/// priorities, at any time from its release to its latest end.
fn above_all(reservation: &Reservation, global: &Global, index: usize, late: i64) -> Demand {
    let Reserved { runtime, period } = reserved(reservation);
    let jitter = global.response(index, runtime).map(|response| late + response - runtime);
    Demand {
        priority: u8::MAX,
        period,
        offset: reservation.fixed.then_some(reservation.phase_ns as i64),
        jitter,
        queue: jitter.unwrap_or(0),
        stages: vec![runtime],
        waits: vec![0],
        deferral: Some(0),
        yields: false,
        orderly: false,
    }
}

fn demand(task: &Task, plan: &StaticPlan, overheads: &Overheads) -> Demand {
    let mut stages: Vec<i64> = task.stages.iter().map(|stage| stage.cost_ns() as i64).collect();
    stages[0] += task.spin_ns() as i64;
    let waits: Vec<i64> = task.stages.iter().map(|stage| stage.waits_ns() as i64).collect();
    let period = task.period_ns as i64;
    // the jitter of a triggered task grows during the iteration
    let (offset, jitter, queue) = match task.release {
        // It needs the core from the start of its spinning; a late wake-up shortens the spinning.
        Release::Timer { phase_ns, spin_ns, tuned, fixed } => {
            let offset = (phase_ns as i64 - spin_ns as i64).rem_euclid(period);
            // a self-tuning margin covers the wake-up error of the machine, so the component is awake by its
            // release
            let queue = if tuned { overheads.wake_ns.max(spin_ns) } else { overheads.wake_ns };
            (fixed.then_some(offset), late_wake(spin_ns, overheads), queue as i64)
        }
        Release::Event => (None, late_wake(0, overheads), late_wake(0, overheads)),
        Release::Trigger { delay_ns, .. } => (offset(task, plan), delay_ns as i64, delay_ns as i64),
    };
    let yields = matches!(task.release, Release::Timer { .. });
    Demand {
        priority: task.priority,
        period,
        offset,
        jitter: Some(jitter),
        queue,
        stages,
        deferral: Some(waits.iter().sum()),
        waits,
        yields,
        orderly: false,
    }
}

/// Returns the offset of a triggered task, which is the offset of the releases at the head of its chain.
fn offset(task: &Task, plan: &StaticPlan) -> Option<i64> {
    match task.release {
        Release::Timer { phase_ns, fixed, .. } => fixed.then_some(phase_ns as i64),
        Release::Event => None,
        Release::Trigger { by, .. } => match plan.reservation(by) {
            Some((_, reservation)) => reservation.fixed.then_some(reservation.phase_ns as i64),
            None => offset(&plan.tasks[plan.places[by]?.task], plan),
        },
    }
}

/// Returns the lateness of a component's wake-up for its release, after spinning.
fn late_wake(spin_ns: u64, overheads: &Overheads) -> i64 {
    overheads.wake_ns.saturating_sub(spin_ns) as i64
}

/// Returns the release jitter of a task, ns. A triggered task is due when the head of its chain is released.
fn jitter(
    task: &Task,
    plan: &StaticPlan,
    bounds: &[Option<Vec<Bound>>],
    reserved_finish: &dyn Fn(usize) -> Option<i64>,
    overheads: &Overheads,
) -> Option<i64> {
    match task.release {
        Release::Timer { spin_ns, .. } => Some(late_wake(spin_ns, overheads)),
        Release::Event => Some(late_wake(0, overheads)),
        Release::Trigger { by, delay_ns } => {
            if let Some((reservation, _)) = plan.reservation(by) {
                return Some(reserved_finish(reservation)? + delay_ns as i64);
            }
            let Some(place) = plan.places[by] else {
                // A component that is not real-time is assumed to be in time; dependent bounds are reported
                // as not provable.
                return Some(delay_ns as i64);
            };
            let writer = bounds[place.task].as_ref()?.get(place.stage)?;
            Some(writer.finish.total - plan.tasks[place.task].spin_ns() as i64 + delay_ns as i64)
        }
    }
}

/// Returns the bounds of the tasks of one core, and determines the tasks that always go to the end of the
/// queue.
pub(in crate::schedule) fn on_core(mut tasks: Vec<Demand>) -> Vec<Option<Vec<Bound>>> {
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

/// Returns the lower of the bounds of two analyses, both of which are valid.
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
