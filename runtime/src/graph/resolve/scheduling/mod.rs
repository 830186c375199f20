//! Cores, scheduling classes, priorities and spinning.

mod classes;
mod cores;
mod not_real_time;
mod rise;
mod spin;

use super::draft::Draft;
use super::timing::Timing;
use super::wiring::Wiring;
use crate::graph::defaults;
use crate::graph::diagnostic::Report;
use crate::graph::machine::Machine;
use crate::graph::model::GraphTable;
use crate::graph::read::{good, good_or};
use crate::graph::values::Schedule;
use crate::plan::{ClockKind, SchedulingClass, SchedulingPlan, Spin};

/// Class, core and spin time of each component.
#[derive(Debug)]
pub(super) struct Scheduling {
    pub plan: SchedulingPlan,
    /// Scheduling class of each component.
    pub classes: Vec<SchedulingClass>,
    /// For each component, the amount by which its priority exceeds the priority of the head of its trigger
    /// chain.
    pub rises: Vec<u8>,
    /// Core of each component; `None` if it may run on any of the shared cores.
    pub cores: Vec<Option<usize>>,
    /// Spinning of each component before its releases.
    pub spins: Vec<Spin>,
}

/// Resolves cores, classes, priorities and spin times.
pub(super) fn resolve(
    graph: &GraphTable<'_>,
    drafts: &[Draft<'_, '_>],
    (wiring, timing): (&Wiring, &Timing),
    machine: &Machine,
    report: &mut Report,
) -> Scheduling {
    let cores = cores::cores(graph, machine, report);
    let schedules: Vec<Schedule> = drafts.iter().map(Draft::schedule).collect();
    if good_or(&graph.clock, defaults::CLOCK) == ClockKind::Realtime {
        not_real_time::warn(drafts, &schedules, wiring, report);
    }
    let classes = classes::classes(drafts, &schedules, timing, report);
    let given: Vec<bool> = drafts.iter().map(|draft| draft.table.priority.is_some()).collect();
    let pinned = cores::pin(drafts, &schedules, timing, &cores, machine, report);
    cores::unused_core(graph, &cores, &pinned, report);
    let realtime = good(&graph.realtime);
    let (classes, rises) = rise::rise(&classes, &given, &pinned, &timing.triggered_by);
    let spins = spin::spins(realtime, drafts, &schedules, timing, report);
    let on_denied =
        realtime.map_or(defaults::ON_DENIED, |table| good_or(&table.on_denied, defaults::ON_DENIED));
    let idle_exit =
        realtime.map_or(defaults::IDLE_EXIT, |table| good_or(&table.idle_exit, defaults::IDLE_EXIT));
    Scheduling {
        plan: SchedulingPlan { shared_cores: cores.shared, on_denied, idle_exit_ns: idle_exit.ns },
        classes,
        rises,
        cores: pinned,
        spins,
    }
}
