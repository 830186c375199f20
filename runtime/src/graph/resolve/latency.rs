//! End-to-end latency budgets, and the source times from which they are measured.
//!
//! A sample carries the source time of the input that caused it. In a triggered component this is its
//! trigger; in a time-triggered component it is the input on the path of a latency budget, if any. A chain
//! starts at a component without such a cause, where its samples originate.

use super::draft::Draft;
use super::timing::Timing;
use super::wiring::{Wire, Wiring};
use crate::declare::Direction;
use crate::graph::defaults;
use crate::graph::diagnostic::Report;
use crate::graph::model::{GraphTable, LatencyTable};
use crate::graph::read::{At, good, good_or};
use crate::graph::source::Span;
use crate::graph::values::TopicName;
use crate::nearest::{list, suggest};
use crate::plan::{Activation, LatencyPlan, OnMiss};
use crate::units::TimeSpan;

/// Plans of the latency budgets, and causes of the components.
#[derive(Debug)]
pub(super) struct Latencies {
    pub plans: Vec<LatencyPlan>,
    /// For each component, the index of the input from which its outputs inherit their source time; `None` if
    /// there is no such input.
    pub causes: Vec<Option<usize>>,
}

/// A budget whose topics are known.
struct Budget<'g> {
    from: usize,
    from_span: &'g Span,
    to: usize,
    to_span: &'g Span,
    max: &'g At<TimeSpan>,
    on_miss: OnMiss,
}

/// Finds the causes of all components and the plan of every budget.
pub(super) fn resolve(
    graph: &GraphTable<'_>,
    drafts: &[Draft<'_, '_>],
    wiring: &Wiring,
    timing: &Timing,
    report: &mut Report,
) -> Latencies {
    let mut causes: Vec<Option<usize>> = timing
        .activation
        .iter()
        .map(|activation| match activation {
            Some(Activation::Triggered { input, .. }) => Some(*input),
            _ => None,
        })
        .collect();
    let tables = good(&graph.latency).map(Vec::as_slice).unwrap_or_default();
    let budgets: Vec<Budget<'_>> =
        tables.iter().filter_map(|at| budget(at.get()?, &at.span, wiring, report)).collect();
    // source times can only be traced through a valid graph
    if timing.activation.iter().any(Option::is_none) || wiring.wires.iter().any(|wire| wire.index.is_none()) {
        return Latencies { plans: Vec::new(), causes };
    }
    let mut plans = Vec::new();
    for budget in &budgets {
        let Some(path) = path(budget, &causes, wiring, timing) else {
            no_path(budget, drafts, wiring, timing, &causes, report);
            continue;
        };
        for wire in &path {
            if timing.activation[wire.component].as_ref().is_some_and(Activation::is_head) {
                causes[wire.component] = wire.index;
            }
        }
        too_tight(budget, &path, drafts, report);
        let Some(writer) = wiring.writer(budget.to) else { continue };
        let Some(output) = writer.index else { continue };
        plans.push(LatencyPlan {
            from: budget.from,
            to: budget.to,
            max_ns: budget.max.get().map_or(0, |max| max.ns),
            on_miss: budget.on_miss,
            component: writer.component,
            output,
        });
    }
    // a later budget may have added a cause to the start component of an earlier one
    for budget in &budgets {
        at_the_head(budget, drafts, wiring, &causes, report);
    }
    Latencies { plans, causes }
}

/// Reads the topics and times of a budget.
fn budget<'g>(
    table: &'g LatencyTable,
    place: &Span,
    wiring: &Wiring,
    report: &mut Report,
) -> Option<Budget<'g>> {
    let missing = [("from", table.from.is_none()), ("to", table.to.is_none()), ("max", table.max.is_none())];
    for (key, _) in missing.iter().filter(|(key, missing)| *missing && !table.meant.contains(key)) {
        report
            .error(format!("a latency budget has no `{key}`"))
            .label(place, format!("`{key}` is missing"))
            .advise("write `from = \"topic\"`, `to = \"topic\"`, `max = \"300 us\"`");
    }
    if let Some(max) = table.max.as_ref().filter(|max| max.get() == Some(&TimeSpan { ns: 0 })) {
        report
            .error("a latency budget of zero cannot be met")
            .label(&max.span, "expected a time above zero")
            .advise("allow at least the execution budgets of the components on the path");
    }
    let from = topic(table.from.as_ref(), wiring, report);
    let to = topic(table.to.as_ref(), wiring, report);
    let (from, to) = (from?, to?);
    let (from_span, to_span) = (&table.from.as_ref()?.span, &table.to.as_ref()?.span);
    if from == to {
        report
            .error(format!("a latency budget from `{}` to itself", wiring.topics[from]))
            .label(to_span, "the same topic")
            .and(from_span, "it starts here")
            .advise("to limit the execution time of one component, give it a `budget`");
        return None;
    }
    let max = table.max.as_ref()?;
    let on_miss = good_or(&table.on_miss, defaults::ON_MISS);
    Some(Budget { from, from_span, to, to_span, max, on_miss })
}

fn topic(at: Option<&At<TopicName>>, wiring: &Wiring, report: &mut Report) -> Option<usize> {
    let at = at?;
    let TopicName(name) = at.get()?;
    let found = wiring.topic(name).filter(|topic| wiring.writer(*topic).is_some());
    if found.is_none() && !wiring.incomplete {
        report
            .error(format!("topic `{name}` has no writer"))
            .label(&at.span, "not a topic that can be measured")
            .advise(suggest(name, wiring.written(), "the topics of this graph are"));
    }
    found
}

/// Finds the shortest path of inputs through which data with its source time passes from one topic to
/// another.
fn path<'w>(
    budget: &Budget<'_>,
    causes: &[Option<usize>],
    wiring: &'w Wiring,
    timing: &Timing,
) -> Option<Vec<&'w Wire>> {
    let start = wiring.writer(budget.from)?.component;
    // by topic: the wire that leads to the component that writes it
    let mut came_by: Vec<Option<&Wire>> = vec![None; wiring.topics.len()];
    let mut reached = vec![budget.from];
    let mut next = 0;
    while let Some(topic) = reached.get(next).copied() {
        next += 1;
        for reader in wiring.of_topic(topic, Direction::Input) {
            let is_head = timing.activation[reader.component].as_ref().is_some_and(Activation::is_head);
            let passes = match causes[reader.component] {
                Some(cause) => reader.index == Some(cause),
                None => is_head,
            };
            if !passes || reader.component == start {
                continue;
            }
            for output in wiring.of_component(reader.component, Direction::Output) {
                let Some(topic) = output.topic.filter(|topic| !reached.contains(topic)) else { continue };
                came_by[topic] = Some(reader);
                reached.push(topic);
            }
        }
    }
    let mut path = Vec::new();
    let mut topic = budget.to;
    while topic != budget.from {
        let wire = came_by[topic]?;
        path.push(wire);
        topic = wire.topic?;
    }
    path.reverse();
    Some(path)
}

/// Returns the topic where the source time of a topic's samples originates.
fn origin(topic: usize, causes: &[Option<usize>], wiring: &Wiring) -> Option<usize> {
    let mut current = topic;
    // a path back is at most as long as the number of topics, unless it is cyclic
    for _ in 0..=wiring.topics.len() {
        let writer = wiring.writer(current)?.component;
        let Some(cause) = causes[writer] else { return Some(current) };
        current = wiring.of_port(writer, Direction::Input, cause)?.topic?;
    }
    None
}

fn no_path(
    budget: &Budget<'_>,
    drafts: &[Draft<'_, '_>],
    wiring: &Wiring,
    timing: &Timing,
    causes: &[Option<usize>],
    report: &mut Report,
) {
    let (from, to) = (&wiring.topics[budget.from], &wiring.topics[budget.to]);
    let Some(writer) = wiring.writer(budget.to).map(|wire| wire.component) else { return };
    let cause = causes[writer].and_then(|cause| wiring.of_port(writer, Direction::Input, cause)?.topic);
    let name = drafts[writer].name;
    let diagnostic = report
        .error(format!("no data flows from `{from}` to `{to}`"))
        .label(budget.to_span, format!("not computed from `{from}`"))
        .and(budget.from_span, "the budget starts here");
    let Some(cause) = cause else {
        let inputs = wiring.of_component(writer, Direction::Input).filter_map(|wire| wire.topic);
        let inputs: Vec<&str> = inputs.map(|topic| wiring.topics[topic].as_str()).collect();
        match inputs.as_slice() {
            [] => diagnostic.note(format!("`{to}` is written by `{name}`, which reads nothing")),
            inputs => diagnostic
                .note(format!("`{to}` is written by `{name}`, which reads {}", list(inputs.iter().copied()))),
        };
        diagnostic.advise("start the budget at a topic from which data flows to this topic");
        return;
    };
    let reason = match timing.activation[writer] {
        Some(Activation::Triggered { .. }) => "its trigger",
        _ => "which is on the path of another latency budget",
    };
    diagnostic.note(format!(
        "`{to}` is written by `{name}` and has the source time of `{}`, {reason}",
        wiring.topics[cause]
    ));
    match origin(budget.to, causes, wiring).filter(|origin| *origin != budget.to) {
        Some(origin) => diagnostic.advise(format!("start the budget at `{}`", wiring.topics[origin])),
        None => diagnostic.advise("leave one of the budgets out"),
    };
}

/// Checks that a budget starts where its data originates.
fn at_the_head(
    budget: &Budget<'_>,
    drafts: &[Draft<'_, '_>],
    wiring: &Wiring,
    causes: &[Option<usize>],
    report: &mut Report,
) {
    let Some(writer) = wiring.writer(budget.from).map(|wire| wire.component) else { return };
    let Some(cause) = causes[writer] else { return };
    let input = wiring.of_port(writer, Direction::Input, cause).and_then(|wire| wire.topic);
    let (Some(input), name) = (input, drafts[writer].name) else { return };
    let from = &wiring.topics[budget.from];
    let diagnostic = report
        .error(format!("a latency budget cannot start at `{from}`"))
        .label(
            budget.from_span,
            format!("not at the head of a chain: `{name}` computes it from `{}`", wiring.topics[input]),
        )
        .note("a sample keeps the source time of the data from which it was computed");
    match origin(budget.from, causes, wiring) {
        Some(origin) => diagnostic.advise(format!("start the budget at `{}`", wiring.topics[origin])),
        None => diagnostic.advise("the latency budgets of this graph form a cycle; remove one of them"),
    };
}

/// Warns about a budget below the sum of the execution budgets on its path.
fn too_tight(budget: &Budget<'_>, path: &[&Wire], drafts: &[Draft<'_, '_>], report: &mut Report) {
    let Some(max) = budget.max.get() else { return };
    let limited =
        |wire: &&&Wire| good(&drafts[wire.component].table.budget).map(|budget| (wire.component, budget.ns));
    let parts: Vec<(usize, u64)> = path.iter().filter_map(|wire| limited(&wire)).collect();
    let sum = TimeSpan { ns: parts.iter().map(|(_, ns)| ns).sum() };
    if sum <= *max {
        return;
    }
    let terms: Vec<String> = parts
        .iter()
        .map(|(component, ns)| format!("{} (`{}`)", TimeSpan { ns: *ns }, drafts[*component].name))
        .collect();
    report
        .warning("a latency budget is shorter than the execution budgets on its path")
        .label(&budget.max.span, format!("less than {sum}"))
        .note(match terms.as_slice() {
            [alone] => format!("a step may last {alone}"),
            terms => format!("steps may last {} = {sum}", terms.join(" + ")),
        })
        .advise("raise `max`, or lower the budgets of the components");
}
