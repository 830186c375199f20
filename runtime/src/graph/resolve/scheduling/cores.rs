//! The cores of the components.

use super::super::draft::Draft;
use super::super::timing::Timing;
use super::classes::leader;
use crate::graph::diagnostic::Report;
use crate::graph::machine::Machine;
use crate::graph::model::GraphTable;
use crate::graph::read::{At, good};
use crate::graph::values::Schedule;
use crate::schedule::assign::{self, ChainLoad};

/// The cores of the graph.
pub(super) struct Cores {
    pub(super) realtime: Vec<usize>,
    pub(super) shared: Vec<usize>,
}

/// Returns the reserved cores of the file or the machine.
pub(super) fn cores(graph: &GraphTable<'_>, machine: &Machine, report: &mut Report) -> Cores {
    let table = good(&graph.cores);
    let mut list = |name: &str, key: Option<&Option<At<Vec<At<usize>>>>>| {
        let at = key?.as_ref()?;
        let listed = at.get()?;
        if listed.is_empty() {
            report
                .error(format!("`{name}` names no core"))
                .label(&at.span, "an empty list")
                .advise(format!("name at least one of {}, or leave `{name}` out", names(machine.cores())));
            return None;
        }
        let mut cores: Vec<usize> = Vec::new();
        for core in listed {
            let Some(number) = core.get() else { continue };
            if cores.contains(number) {
                report
                    .error(format!("core {number} is listed twice"))
                    .label(&core.span, "already listed")
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
        // on a machine with too few cores, real-time and shared cores are the same
        if rest.is_empty() { all.to_vec() } else { rest }
    };
    let realtime = realtime.unwrap_or_else(|| {
        let free = without(shared.as_deref().unwrap_or_default());
        free[free.len() - 1..].to_vec()
    });
    let shared = shared.unwrap_or_else(|| without(&realtime));
    Cores { realtime, shared }
}

/// Returns `true` if a core exists; otherwise reports an error.
fn exists(core: usize, machine: &Machine, at: &At<usize>, report: &mut Report) -> bool {
    let there = machine.cores().contains(&core);
    if !there {
        report
            .error(format!("core {core} does not exist on this machine"))
            .label(&at.span, "no such core")
            .advise(format!("cores this process may use: {}", names(machine.cores())));
    }
    there
}

fn names(cores: &[usize]) -> String {
    cores.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")
}

/// Returns the core of each component: from the file, or else, for a real-time component, the core of its
/// trigger chain, which is assigned to the least loaded real-time core.
pub(super) fn pin(
    drafts: &[Draft<'_, '_>],
    schedules: &[Schedule],
    timing: &Timing,
    cores: &Cores,
    machine: &Machine,
    report: &mut Report,
) -> Vec<Option<usize>> {
    let given: Vec<Option<usize>> = (0..drafts.len())
        .map(|component| given(&drafts[component], schedules[component], cores, machine, report))
        .collect();
    // chains by their head component, and their members without an explicit core
    let leaders: Vec<usize> = (0..drafts.len())
        .filter(|c| schedules[*c] == Schedule::Fifo && leader(*c, schedules, timing) == *c)
        .collect();
    let share = |component: usize| {
        let budget = good(&drafts[component].table.budget).map_or(0.0, |budget| budget.ns as f64);
        timing.period_ns(component).map_or(0.0, |period| budget / period as f64)
    };
    let mut chains: Vec<ChainLoad> =
        leaders.iter().map(|leader| ChainLoad { share: 0.0, core: given[*leader] }).collect();
    for component in (0..drafts.len()).filter(|c| schedules[*c] == Schedule::Fifo) {
        let leader = leader(component, schedules, timing);
        let chain = leaders.iter().position(|other| *other == leader);
        match (given[component], chain) {
            (Some(core), Some(chain)) if chains[chain].core == Some(core) => {
                chains[chain].share += share(component)
            }
            (None, Some(chain)) => chains[chain].share += share(component),
            (core, _) => chains.push(ChainLoad { share: share(component), core }),
        }
    }
    let placed = assign::cores(&chains, &cores.realtime);
    (0..drafts.len())
        .map(|component| match schedules[component] {
            Schedule::Normal | Schedule::Deadline => given[component],
            Schedule::Fifo => given[component].or_else(|| {
                let leader = leader(component, schedules, timing);
                leaders.iter().position(|other| *other == leader).map(|chain| placed[chain])
            }),
        })
        .collect()
}

/// Returns the core in the file.
fn given(
    draft: &Draft<'_, '_>,
    schedule: Schedule,
    cores: &Cores,
    machine: &Machine,
    report: &mut Report,
) -> Option<usize> {
    let at = draft.table.core.as_ref()?;
    let core = *at.get()?;
    if schedule == Schedule::Deadline {
        report
            .error(format!(
                "component `{}` is scheduled by its deadline and must not have a `core`",
                draft.name
            ))
            .label(&at.key, "`SCHED_DEADLINE` runs a component on any free core")
            .advise("leave `core` out, or schedule the component as `fifo`");
        return None;
    }
    if !exists(core, machine, at, report) {
        return None;
    }
    if !cores.realtime.contains(&core) && !cores.shared.contains(&core) {
        report
            .error(format!("core {core} is not one of the graph's cores"))
            .label(&at.span, "not listed in `[cores]`")
            .advise(format!(
                "real-time cores are {}, shared cores {}; add the core to one of these lists",
                names(&cores.realtime),
                names(&cores.shared)
            ));
    }
    Some(core)
}

/// Warns about an unused real-time core.
pub(super) fn unused_core(
    graph: &GraphTable<'_>,
    cores: &Cores,
    pinned: &[Option<usize>],
    report: &mut Report,
) {
    let listed = good(&graph.cores).and_then(|table| good(&table.realtime));
    for at in listed.into_iter().flatten() {
        let Some(core) = at.get().filter(|core| cores.realtime.contains(core)) else { continue };
        if !cores.shared.contains(core) && !pinned.contains(&Some(*core)) && !pinned.is_empty() {
            report
                .warning(format!("no component runs on the real-time core {core}"))
                .label(&at.span, "idle")
                .advise(format!(
                    "pin a component to it with `core = {core}`, or remove the core from `[cores]`"
                ));
        }
    }
}
