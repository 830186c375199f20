//! Simulation of one hyperperiod of a graph, in which every component uses up its budget and nothing disturbs
//! the machine.
//!
//! A timeline shows one possible execution, which need not be the worst case of each component. The bounds of
//! [`admit`](super::admit) hold for all executions.

mod lane;
mod simulation;

pub use lane::{Lane, Segment};

use schemars::JsonSchema;
use serde::Serialize;

use super::Overheads;
use super::analysis::tasks::StaticPlan;
use super::explain::words;
use crate::plan::{Activation, Plan};
use simulation::Simulation;

/// Simulated schedule of one hyperperiod, for every core with real-time components.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct Timeline {
    /// Simulated time, ns.
    pub length_ns: u64,
    /// Hyperperiod of the graph (the time after which its releases repeat), ns; `None` if it exceeds 64 bits.
    pub hyperperiod_ns: Option<u64>,
    /// Timelines of the cores, in ascending order.
    pub cores: Vec<CoreTimeline>,
    /// Omissions and assumptions of the simulation, as text.
    pub notes: Vec<String>,
}

/// Timeline of one core.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, JsonSchema)]
pub struct CoreTimeline {
    /// Index of the core.
    pub core: usize,
    /// Timelines of the core's components. Chains with more urgent heads come first; within a chain,
    /// components are in trigger order.
    pub lanes: Vec<Lane>,
}

impl CoreTimeline {
    /// Returns the time for which no real-time component runs on the core, ns. `length_ns` is the length of
    /// the timeline.
    pub fn idle_ns(&self, length_ns: u64) -> u64 {
        let busy: u64 = self
            .lanes
            .iter()
            .flat_map(|lane| &lane.segments)
            .map(|segment| segment.end_ns - segment.start_ns)
            .sum();
        length_ns.saturating_sub(busy)
    }
}

/// Simulates one hyperperiod of a graph (the time after which its releases repeat), but at most `longest_ns`.
pub fn timeline(plan: &Plan, overheads: &Overheads, longest_ns: u64) -> Timeline {
    let tasks = StaticPlan::from_plan(plan, overheads);
    let hyperperiod_ns = hyperperiod(tasks.tasks.iter().map(|task| task.period_ns));
    let wanted = hyperperiod_ns.unwrap_or(u64::MAX).min(longest_ns).min(i64::MAX as u64 / 4);
    let (length_ns, mut lanes) = Simulation::new(plan, &tasks, overheads).run(wanted as i64);
    let cores = tasks
        .cores()
        .into_iter()
        .map(|core| {
            let mut members: Vec<usize> = (0..plan.components.len())
                .filter(|index| {
                    tasks.places[*index].is_some_and(|place| tasks.tasks[place.task].core == core)
                })
                .collect();
            let priority = |index: &usize| tasks.places[*index].map(|place| tasks.tasks[place.task].priority);
            members.sort_by_key(|index| (core::cmp::Reverse(priority(index)), plan.components[*index].order));
            let lanes = members.iter().map(|index| core::mem::take(&mut lanes[*index])).collect();
            CoreTimeline { core, lanes }
        })
        .collect();
    let notes = notes(plan, &tasks, hyperperiod_ns, length_ns);
    Timeline { length_ns, hyperperiod_ns, cores, notes }
}

fn notes(plan: &Plan, tasks: &StaticPlan, hyperperiod_ns: Option<u64>, length_ns: u64) -> Vec<String> {
    let mut notes = Vec::new();
    match hyperperiod_ns {
        None => notes.push(format!(
            "only the first {} are shown: the periods have no common multiple of a usable length",
            words::time(length_ns)
        )),
        Some(whole) if whole > length_ns => notes.push(format!(
            "only the first {} of a hyperperiod of {} are shown",
            words::time(length_ns),
            words::time(whole)
        )),
        Some(_) => {}
    }
    for core in tasks.cores() {
        let here = tasks.on_core(core).into_iter().map(|task| &tasks.tasks[task]);
        let load: f64 = here.map(|task| task.cost_ns() as f64 / task.period_ns as f64).sum();
        if load > 1.0 + 1e-9 {
            notes
                .push(format!("core {core} cannot keep up: it falls further behind than the timeline shows"));
        }
    }
    let all = 0..plan.components.len();
    let guessed: Vec<usize> = all
        .clone()
        .filter(|index| tasks.places[*index].is_some() && plan.components[*index].budget_ns.is_none())
        .collect();
    if !guessed.is_empty() {
        notes.push(format!("no budget, drawn with zero length: {}", words::names(plan, &guessed)));
    }
    let by_events =
        |index: &usize| matches!(plan.components[*index].activation, Activation::Descriptor { .. });
    let sporadic: Vec<usize> =
        all.clone().filter(|index| by_events(index) && tasks.places[*index].is_some()).collect();
    if !sporadic.is_empty() {
        notes.push(format!(
            "released by events, drawn as if they came as often as `min_interval` allows: {}",
            words::names(plan, &sporadic)
        ));
    }
    let reserved: Vec<usize> = all.clone().filter(|index| tasks.reservation(*index).is_some()).collect();
    if !reserved.is_empty() {
        notes.push(format!(
            "scheduled by deadline, on any core ahead of all drawn components, not drawn: {}",
            words::names(plan, &reserved)
        ));
    }
    let left_out: Vec<usize> = all.filter(|index| !tasks.knows(*index)).collect();
    if !left_out.is_empty() {
        notes.push(format!("not real-time, not drawn: {}", words::names(plan, &left_out)));
    }
    notes
}

/// Returns the least common multiple of all periods.
fn hyperperiod(periods_ns: impl Iterator<Item = u64>) -> Option<u64> {
    periods_ns
        .map(|period| i64::try_from(period).ok())
        .try_fold(1, |lcm, period| crate::schedule::analysis::phases::least_common_multiple(lcm, period?))
        .and_then(|lcm| u64::try_from(lcm).ok())
}
