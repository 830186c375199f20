//! Activation of the components: rates, triggers, and trigger chains.

use super::activate;
use super::draft::Draft;
use super::wiring::Wiring;
use crate::declare::Direction;
use crate::graph::defaults;
use crate::graph::diagnostic::Report;
use crate::graph::read::{At, good_or};
use crate::graph::source::Span;
use crate::graph::values::TopicName;
use crate::nearest::suggest;
use crate::plan::{Activation, ClockKind, OnOverrun};
use crate::units::TimeSpan;

/// The activation of each component.
#[derive(Debug)]
pub(super) struct Timing {
    /// Activation of each component; `None` if it is invalid. The error has then been reported.
    pub activation: Vec<Option<Activation>>,
    /// For each component, the component at the head of its trigger chain, which the clock or events release.
    /// A head refers to itself.
    pub head: Vec<Option<usize>>,
    /// For each component, the component whose output triggers it; `None` if no output does.
    pub triggered_by: Vec<Option<usize>>,
}

impl Timing {
    /// Returns the nominal time between two steps of a component, ns.
    pub(super) fn period_ns(&self, component: usize) -> Option<u64> {
        self.activation[component].as_ref().map(Activation::period_ns)
    }
}

/// Activation of a component, from its own table.
enum Start {
    /// Invalid; the error has been reported.
    Unknown,
    Periodic {
        period_ns: u64,
        phase_ns: u64,
    },
    Descriptor {
        min_interval_ns: u64,
    },
    Triggered {
        topic: usize,
        input: usize,
        span: Span,
    },
}

impl Start {
    /// Returns the period of a component that no other component releases, ns; the shortest time for an
    /// event-released component.
    fn own_period_ns(&self) -> Option<u64> {
        match self {
            Self::Periodic { period_ns, .. } => Some(*period_ns),
            Self::Descriptor { min_interval_ns } => Some(*min_interval_ns),
            Self::Triggered { .. } | Self::Unknown => None,
        }
    }
}

/// Resolves the activation of every component.
pub(super) fn resolve(
    drafts: &[Draft<'_, '_>],
    wiring: &Wiring,
    clock: ClockKind,
    report: &mut Report,
) -> Timing {
    let starts: Vec<Start> = drafts
        .iter()
        .enumerate()
        .map(|(component, draft)| start(component, draft, wiring, clock, report).unwrap_or(Start::Unknown))
        .collect();
    let triggered_by: Vec<Option<usize>> = starts
        .iter()
        .map(|start| match start {
            Start::Triggered { topic, .. } => wiring.writer(*topic).map(|writer| writer.component),
            _ => None,
        })
        .collect();
    loops(drafts, &starts, &triggered_by, wiring, report);
    let head: Vec<Option<usize>> =
        (0..starts.len()).map(|component| head(component, &starts, &triggered_by)).collect();
    let activation = (0..starts.len())
        .map(|component| match (&starts[component], head[component].map(|head| &starts[head])) {
            (Start::Periodic { period_ns, phase_ns }, _) => {
                Some(Activation::Periodic { period_ns: *period_ns, phase_ns: *phase_ns })
            }
            (Start::Descriptor { min_interval_ns }, _) => {
                Some(Activation::Descriptor { min_interval_ns: *min_interval_ns })
            }
            (Start::Triggered { topic, input, .. }, Some(head)) => {
                let period_ns = head.own_period_ns();
                period_ns.map(|period_ns| Activation::Triggered { topic: *topic, input: *input, period_ns })
            }
            _ => None,
        })
        .collect();
    let timing = Timing { activation, head, triggered_by };
    budgets(drafts, &timing, report);
    timing
}

fn start(
    component: usize,
    draft: &Draft<'_, '_>,
    wiring: &Wiring,
    clock: ClockKind,
    report: &mut Report,
) -> Option<Start> {
    let table = draft.table;
    without_grid(draft, report);
    if let Some(at) = &table.activate {
        let min_interval_ns = activate::resolve(draft, at, clock, report);
        return min_interval_ns.map(|min_interval_ns| Start::Descriptor { min_interval_ns });
    }
    match (&table.rate, &table.trigger) {
        (None, None) if table.meant.iter().any(|key| matches!(*key, "rate" | "trigger" | "activate")) => None,
        (None, None) => {
            let input = wiring.of_component(component, Direction::Input).find_map(|wire| wire.topic);
            let by_events = activate::advice(draft);
            let needs =
                if by_events.is_some() { "needs `rate` or `activate`" } else { "needs `rate` or `trigger`" };
            let advice = match (by_events, input) {
                (Some(advice), _) => advice,
                (None, Some(topic)) => format!(
                    "add `rate = \"1 kHz\"`, or `trigger = \"{}\"` to step whenever this topic is published",
                    wiring.topics[topic]
                ),
                (None, None) => "add `rate = \"1 kHz\"`".to_string(),
            };
            report
                .error(format!("component `{}` has nothing that releases its steps", draft.name))
                .label(&draft.place, needs)
                .advise(advice);
            None
        }
        (Some(rate), Some(trigger)) => {
            report
                .error(format!("component `{}` has both `rate` and `trigger`", draft.name))
                .label(
                    &trigger.key,
                    "a component steps at fixed times or when a topic is published, not both",
                )
                .and(&rate.key, "the rate here")
                .advise("leave one of them out");
            None
        }
        (Some(rate), None) => {
            let period_ns = rate.get()?.period_ns;
            let phase_ns = good_or(&table.phase, defaults::PHASE).ns;
            if let Some(phase) = table.phase.as_ref().filter(|_| phase_ns >= period_ns) {
                let period = TimeSpan { ns: period_ns };
                report
                    .error(format!("the phase of component `{}` is not shorter than its period", draft.name))
                    .label(&phase.span, "too long")
                    .and(&rate.span, format!("a period of {period}"))
                    .advise(format!("a phase is an offset within the period: less than {period}"));
            }
            Some(Start::Periodic { period_ns, phase_ns })
        }
        (None, Some(trigger)) => {
            if let Some(phase) = &table.phase {
                report
                    .error(format!("component `{}` has a phase but no rate", draft.name))
                    .label(&phase.key, "does not apply to a triggered component")
                    .and(&trigger.key, "the component steps when this topic is published")
                    .advise("leave `phase` out");
            }
            find_trigger(component, draft, trigger, wiring, report)
        }
    }
}

/// Rejects overrun policies that refer to a grid of releases for a component without a rate.
fn without_grid(draft: &Draft<'_, '_>, report: &mut Report) {
    let Some((place, why, label)) = activate::not_by_the_clock(draft) else { return };
    let Some(policy) = draft.table.on_overrun.as_ref().filter(|_| draft.table.rate.is_none()) else { return };
    let name = match policy.get() {
        Some(OnOverrun::CatchUp) => "catch_up",
        Some(OnOverrun::Rephase) => "rephase",
        _ => return,
    };
    report
        .error(format!("component `{}` has no periodic releases for `{name}`", draft.name))
        .label(&policy.span, why)
        .and(place, format!("{label}; values that arrive during a step cause a single wake-up"))
        .advise("leave `on_overrun` out, or choose skip, hold or safe_stop");
}

fn find_trigger(
    component: usize,
    draft: &Draft<'_, '_>,
    trigger: &At<TopicName>,
    wiring: &Wiring,
    report: &mut Report,
) -> Option<Start> {
    let TopicName(name) = trigger.get()?;
    let topic = wiring.topic(name);
    let wire =
        wiring.of_component(component, Direction::Input).find(|wire| topic.is_some() && wire.topic == topic);
    if let (Some(wire), Some(topic)) = (wire, topic) {
        return Some(Start::Triggered { topic, input: wire.index?, span: trigger.span.clone() });
    }
    if draft.table.subscribe.as_ref().is_some_and(|at| at.get().is_none()) {
        return None;
    }
    let inputs = || wiring.of_component(component, Direction::Input).filter_map(|wire| wire.topic);
    let names: Vec<&str> = inputs().map(|topic| wiring.topics[topic].as_str()).collect();
    let advice = match (topic.and_then(|topic| wiring.writer(topic)), names.as_slice()) {
        (Some(_), _) => format!("add it to `subscribe`: `subscribe = {{ port = \"{name}\" }}`"),
        (None, []) => "subscribe to a topic, and name it in `trigger`".to_string(),
        (None, names) => suggest(name, names.iter().copied(), "it subscribes to"),
    };
    report
        .error(format!("component `{}` is triggered by `{name}` but does not subscribe to it", draft.name))
        .label(&trigger.span, "not one of its inputs")
        .advise(advice);
    None
}

/// Returns the component at the head of a trigger chain.
fn head(component: usize, starts: &[Start], triggered_by: &[Option<usize>]) -> Option<usize> {
    let mut current = component;
    // a chain is at most as long as the number of components, unless it is a loop
    for _ in 0..starts.len() {
        match starts[current] {
            Start::Periodic { .. } | Start::Descriptor { .. } => return Some(current),
            Start::Unknown => return None,
            Start::Triggered { .. } => current = triggered_by[current]?,
        }
    }
    None
}

/// Reports trigger loops, and components that wait for one.
fn loops(
    drafts: &[Draft<'_, '_>],
    starts: &[Start],
    triggered_by: &[Option<usize>],
    wiring: &Wiring,
    report: &mut Report,
) {
    let mut in_a_loop = vec![false; starts.len()];
    for component in 0..starts.len() {
        let mut cycle = vec![component];
        while let Some(next) = triggered_by[cycle[cycle.len() - 1]] {
            if next == component {
                // each loop is reported once, from its first component in the file
                if cycle.iter().all(|member| *member >= component) {
                    report_loop(&cycle, drafts, starts, wiring, report);
                }
                cycle.iter().for_each(|member| in_a_loop[*member] = true);
                break;
            }
            if cycle.contains(&next) {
                break;
            }
            cycle.push(next);
        }
    }
    for component in (0..starts.len()).filter(|component| !in_a_loop[*component]) {
        let mut current = component;
        for _ in 0..starts.len() {
            let Some(next) = triggered_by[current] else { break };
            current = next;
            let Start::Triggered { span, .. } = &starts[component] else { break };
            if in_a_loop[current] {
                report
                    .error(format!("component `{}` would never step", drafts[component].name))
                    .label(span, "this trigger chain has no start")
                    .and(
                        &drafts[current].place,
                        "it is triggered by this component, which is part of a trigger loop",
                    )
                    .advise("break the loop: give one of its components a `rate` instead of its `trigger`");
                break;
            }
        }
    }
}

/// Reports a loop; `cycle` maps each component to its trigger.
fn report_loop(
    cycle: &[usize],
    drafts: &[Draft<'_, '_>],
    starts: &[Start],
    wiring: &Wiring,
    report: &mut Report,
) {
    let mut places = Vec::new();
    let mut path = vec![format!("`{}`", drafts[cycle[0]].name)];
    // the loop in the direction of triggers
    for member in cycle.iter().rev() {
        let Start::Triggered { topic, span, .. } = &starts[*member] else { continue };
        path.push(format!("`{}`", drafts[*member].name));
        places.push((span, format!("`{}` waits for `{}`", drafts[*member].name, wiring.topics[*topic])));
    }
    let last = places.len() - 1;
    places.swap(0, last);
    let message = match cycle {
        [alone] => format!("component `{}` triggers itself", drafts[*alone].name),
        _ => format!("trigger loop: {}", path.join(" triggers ")),
    };
    let diagnostic = report
        .error(message)
        .advise("no component would ever step: give one of them a `rate` instead of its `trigger`");
    for (index, (span, label)) in places.into_iter().enumerate() {
        match index {
            0 => diagnostic.label(span, label),
            _ => diagnostic.and(span, label),
        };
    }
}

/// Checks that budgets are above zero and fit into the period.
fn budgets(drafts: &[Draft<'_, '_>], timing: &Timing, report: &mut Report) {
    for (component, draft) in drafts.iter().enumerate() {
        let Some(at) = &draft.table.budget else { continue };
        let Some(budget) = at.get() else { continue };
        if budget.ns == 0 {
            report
                .error(format!("the budget of component `{}` is zero", draft.name))
                .label(&at.span, "expected a time above zero")
                .advise("leave `budget` out if the execution time does not matter");
        }
        let (Some(period_ns), Some(head)) = (timing.period_ns(component), timing.head[component]) else {
            continue;
        };
        if budget.ns <= period_ns {
            continue;
        }
        let period = TimeSpan { ns: period_ns };
        let diagnostic = report
            .error(format!("the budget of component `{}` is longer than its period", draft.name))
            .label(&at.span, format!("more than {period}"))
            .advise(format!("allow less than {period} per step, or lower the rate"));
        if let Some(rate) = &drafts[head].table.rate {
            let label = if head == component {
                format!("a period of {period}")
            } else {
                format!("`{}`, at the head of its trigger chain, has a period of {period}", drafts[head].name)
            };
            diagnostic.and(&rate.span, label);
        }
    }
}
