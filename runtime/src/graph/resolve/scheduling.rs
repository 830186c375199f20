//! Cores, scheduling classes and priorities.

use super::Draft;
use super::timing::Timing;
use crate::graph::defaults;
use crate::graph::diagnostic::Report;
use crate::graph::machine::Machine;
use crate::graph::model::GraphTable;
use crate::graph::read::{At, good, good_or};
use crate::graph::units::TimeSpan;
use crate::graph::values::Schedule;
use crate::plan::{SchedulingClass, SchedulingPlan};

/// Where and how each component runs.
#[derive(Debug)]
pub(super) struct Scheduling {
    pub plan: SchedulingPlan,
    /// By component.
    pub classes: Vec<SchedulingClass>,
    /// By component; `None` for any of the shared cores.
    pub cores: Vec<Option<usize>>,
}

/// Highest priority of a component: 99 is left to the kernel's own threads.
const HIGHEST_PRIORITY: u8 = 98;

/// The cores of the graph.
struct Cores {
    realtime: Vec<usize>,
    shared: Vec<usize>,
}

/// Finds cores, classes and priorities.
pub(super) fn resolve(
    graph: &GraphTable<'_>,
    drafts: &[Draft<'_, '_>],
    timing: &Timing,
    machine: &Machine,
    report: &mut Report,
) -> Scheduling {
    let cores = cores(graph, machine, report);
    let schedules: Vec<Schedule> =
        drafts.iter().map(|draft| good_or(&draft.table.schedule, defaults::SCHEDULE)).collect();
    let classes = classes(drafts, &schedules, timing, report);
    let pinned = pin(drafts, &schedules, timing, &cores, machine, report);
    unused_core(graph, &cores, &pinned, report);
    let realtime = good(&graph.realtime);
    let spin = realtime.map_or(defaults::SPIN, |table| good_or(&table.spin, defaults::SPIN));
    if let Some(at) = realtime.and_then(|table| table.spin.as_ref()) {
        let fastest = (0..drafts.len())
            .filter_map(|component| Some((timing.period_ns(component)?, component)))
            .filter(|(_, component)| timing.head[*component] == Some(*component))
            .min();
        if let Some((period_ns, component)) = fastest.filter(|(period_ns, _)| spin.ns >= *period_ns) {
            report
                .warning(format!(
                    "component `{}` never sleeps: it spins until its next step",
                    drafts[component].name
                ))
                .at(&at.span, format!("not shorter than its period of {}", TimeSpan { ns: period_ns }))
                .advise("a shorter `spin` leaves time to others; 100 us is enough on most machines");
        }
    }
    let plan = SchedulingPlan {
        shared_cores: cores.shared,
        on_denied: realtime
            .map_or(defaults::ON_DENIED, |table| good_or(&table.on_denied, defaults::ON_DENIED)),
        spin_ns: spin.ns,
    };
    Scheduling { plan, classes, cores: pinned }
}

fn cores(graph: &GraphTable<'_>, machine: &Machine, report: &mut Report) -> Cores {
    let table = good(&graph.cores);
    let mut list = |name: &str, key: Option<&Option<At<Vec<At<usize>>>>>| {
        let at = key?.as_ref()?;
        let listed = at.get()?;
        if listed.is_empty() {
            report
                .error(format!("`{name}` names no core"))
                .at(&at.span, "an empty list")
                .advise(format!("name at least one of {}, or leave `{name}` out", names(machine.cores())));
            return None;
        }
        let mut cores: Vec<usize> = Vec::new();
        for core in listed {
            let Some(number) = core.get() else { continue };
            if cores.contains(number) {
                report
                    .error(format!("core {number} is listed twice"))
                    .at(&core.span, "once is enough")
                    .advise("leave one of them out");
            } else if exists(*number, machine, core, report) {
                cores.push(*number);
            }
        }
        (!cores.is_empty()).then_some(cores)
    };
    let realtime = list("realtime", table.map(|table| &table.realtime));
    let shared = list("shared", table.map(|table| &table.shared));
    let all = machine.cores();
    let without = |taken: &[usize]| -> Vec<usize> {
        let rest: Vec<usize> = all.iter().copied().filter(|core| !taken.contains(core)).collect();
        // on a machine with too few cores the same ones do both
        if rest.is_empty() { all.to_vec() } else { rest }
    };
    let realtime = realtime.unwrap_or_else(|| {
        let free = without(shared.as_deref().unwrap_or_default());
        free[free.len() - 1..].to_vec()
    });
    let shared = shared.unwrap_or_else(|| without(&realtime));
    Cores { realtime, shared }
}

/// Whether a core exists; reports if not.
fn exists(core: usize, machine: &Machine, at: &At<usize>, report: &mut Report) -> bool {
    let there = machine.cores().contains(&core);
    if !there {
        report
            .error(format!("core {core} does not exist on this machine"))
            .at(&at.span, "no such core")
            .advise(format!("cores this process may use: {}", names(machine.cores())));
    }
    there
}

fn names(cores: &[usize]) -> String {
    cores.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")
}

/// Core of each component: as the file says, else that of its trigger chain, else the first of its class.
fn pin(
    drafts: &[Draft<'_, '_>],
    schedules: &[Schedule],
    timing: &Timing,
    cores: &Cores,
    machine: &Machine,
    report: &mut Report,
) -> Vec<Option<usize>> {
    let given: Vec<Option<usize>> = drafts
        .iter()
        .map(|draft| {
            let at = draft.table.core.as_ref()?;
            let core = *at.get()?;
            if !exists(core, machine, at, report) {
                return None;
            }
            if !cores.realtime.contains(&core) && !cores.shared.contains(&core) {
                report
                    .error(format!("core {core} is not one of the graph's cores"))
                    .at(&at.span, "not listed in `[cores]`")
                    .advise(format!(
                        "real-time cores are {}, shared cores {}; add it to one of them",
                        names(&cores.realtime),
                        names(&cores.shared)
                    ));
            }
            Some(core)
        })
        .collect();
    (0..drafts.len())
        .map(|component| match schedules[component] {
            Schedule::Normal => given[component],
            Schedule::Fifo => {
                let head = timing.head[component].filter(|head| schedules[*head] == Schedule::Fifo);
                given[component].or_else(|| given[head?]).or_else(|| cores.realtime.first().copied())
            }
        })
        .collect()
}

/// A core that is set apart for real time but used by nobody.
fn unused_core(graph: &GraphTable<'_>, cores: &Cores, pinned: &[Option<usize>], report: &mut Report) {
    let listed = good(&graph.cores).and_then(|table| good(&table.realtime));
    for at in listed.into_iter().flatten() {
        let Some(core) = at.get().filter(|core| cores.realtime.contains(core)) else { continue };
        if !cores.shared.contains(core) && !pinned.contains(&Some(*core)) && !pinned.is_empty() {
            report
                .warning(format!("no component runs on the real-time core {core}"))
                .at(&at.span, "idle")
                .advise(format!("pin a component there with `core = {core}`, or leave the core out"));
        }
    }
}

fn classes(
    drafts: &[Draft<'_, '_>],
    schedules: &[Schedule],
    timing: &Timing,
    report: &mut Report,
) -> Vec<SchedulingClass> {
    let given: Vec<Option<u8>> =
        drafts.iter().zip(schedules).map(|(draft, schedule)| priority(draft, *schedule, report)).collect();
    // a component whose chain has no real-time head stands for itself
    let leader = |component: usize| {
        timing.head[component].filter(|head| schedules[*head] == Schedule::Fifo).unwrap_or(component)
    };
    for (component, draft) in drafts.iter().enumerate() {
        let Some(head) = timing.head[component] else { continue };
        if schedules[component] == Schedule::Fifo && schedules[head] == Schedule::Normal {
            report
                .warning(format!(
                    "component `{}` is real-time, but waits for `{}`, which is not",
                    draft.name, drafts[head].name
                ))
                .at(&draft.place, "its trigger chain can be held up by any other program")
                .and(&drafts[head].place, "scheduled as `normal`")
                .advise("schedule both in the same way");
        }
    }
    // rate-monotonic: the shorter the period, the higher the priority
    let mut periods: Vec<u64> = (0..drafts.len())
        .filter(|component| schedules[*component] == Schedule::Fifo)
        .filter(|component| leader(*component) == *component && given[*component].is_none())
        .filter_map(|component| timing.period_ns(component))
        .collect();
    periods.sort_unstable();
    periods.dedup();
    let by_rate = |component: usize| {
        let rank = timing.period_ns(component).and_then(|period| periods.binary_search(&period).ok());
        let below = rank.unwrap_or(0).saturating_mul(usize::from(defaults::PRIORITY_STEP));
        u8::try_from(usize::from(defaults::FASTEST_PRIORITY).saturating_sub(below)).unwrap_or(1).max(1)
    };
    (0..drafts.len())
        .map(|component| match schedules[component] {
            Schedule::Normal => SchedulingClass::Normal,
            Schedule::Fifo => {
                let leader = leader(component);
                SchedulingClass::Fifo(given[component].or(given[leader]).unwrap_or_else(|| by_rate(leader)))
            }
        })
        .collect()
}

/// The priority that the file gives.
fn priority(draft: &Draft<'_, '_>, schedule: Schedule, report: &mut Report) -> Option<u8> {
    let at = draft.table.priority.as_ref()?;
    let number = *at.get()?;
    let priority = u8::try_from(number).ok().filter(|priority| (1..=HIGHEST_PRIORITY).contains(priority));
    if priority.is_none() {
        report
            .error(format!("the priority of component `{}` is {number}", draft.name))
            .at(&at.span, format!("expected 1 to {HIGHEST_PRIORITY}"))
            .advise("higher is more urgent; leave it out to have priorities follow the rates");
    }
    if schedule == Schedule::Normal {
        let diagnostic = report
            .error(format!("component `{}` has a priority but is not real-time", draft.name))
            .at(&at.key, "has no meaning for `schedule = \"normal\"`")
            .advise("leave `priority` out, or schedule the component as `fifo`");
        if let Some(schedule) = &draft.table.schedule {
            diagnostic.and(&schedule.span, "not real-time");
        }
        return None;
    }
    priority
}
