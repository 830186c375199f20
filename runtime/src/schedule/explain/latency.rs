//! Bounds on latencies, with their sums as text.

use super::{terms, words};
use crate::plan::{LatencyPlan, Plan};
use crate::schedule::admission::{LatencyBound, Verdict};
use crate::schedule::analysis::Analysis;
use crate::schedule::analysis::latency::{self, LatencySum, LatencyTerm};

/// Returns the bound of one latency budget.
pub(in crate::schedule) fn latency(analysis: &Analysis<'_>, budget: &LatencyPlan) -> LatencyBound {
    let plan = analysis.plan;
    let path = latency::path(plan, budget);
    let analysed = path.iter().all(|component| analysis.tasks.knows(*component));
    let bounded = if analysed { latency::latency(analysis, &path) } else { None };
    let max = words::time(budget.max_ns);
    let holds = bounded.as_ref().is_some_and(|bounded| bounded.ns <= budget.max_ns);
    let rests = |component: &usize| match analysis.tasks.places[*component] {
        Some(place) => analysis.unknown.rests[place.task],
        None => plan.components[*component].budget_ns.is_none(),
    };
    let known = !path.iter().any(rests);
    let events = latency::sampled_events(plan, &path);
    let arithmetic = match (&bounded, analysed) {
        (None, true) if !events.is_empty() => {
            format!("{} when events come, which may be arbitrarily rare: no bound", stepping(plan, &events))
        }
        (Some(sum), _) => {
            words::comparison(&sum_terms(analysis, &path, sum), words::time(sum.ns), holds, &max)
        }
        (None, true) => format!("grows without bound > {max}"),
        (None, false) => {
            let others: Vec<usize> =
                path.iter().copied().filter(|component| !analysis.tasks.knows(*component)).collect();
            format!(
                "{} not real-time on one core, so the latency has no bound",
                are(&words::names(plan, &others), others.len())
            )
        }
    };
    LatencyBound {
        from: plan.topics[budget.from].name.clone(),
        to: plan.topics[budget.to].name.clone(),
        path: path.iter().map(|component| plan.components[*component].name.clone()).collect(),
        bound_ns: bounded.as_ref().map(|bounded| bounded.ns),
        max_ns: budget.max_ns,
        verdict: match (analysed, holds, known) {
            (false, ..) | (_, true, false) => Verdict::NotProvable,
            (_, false, _) if bounded.is_none() && !events.is_empty() => Verdict::NotProvable,
            (_, true, true) => Verdict::Holds,
            (_, false, _) => Verdict::Exceeds,
        },
        arithmetic,
    }
}

/// Formats "`a` is" or "`a` and `b` are".
fn are(names: &str, count: usize) -> String {
    format!("{names} {}", if count == 1 { "is" } else { "are" })
}

/// Formats "`a` steps" or "`a` and `b` step".
fn stepping(plan: &Plan, components: &[usize]) -> String {
    format!("{} {}", words::names(plan, components), if components.len() == 1 { "steps" } else { "step" })
}

/// Formats the terms of a latency's bound, each with its sign except the first.
fn sum_terms(analysis: &Analysis<'_>, path: &[usize], sum: &LatencySum) -> Vec<String> {
    let terms = sum.terms.iter().flat_map(|term| term_texts(analysis, path, term));
    terms.enumerate().map(|(index, term)| terms::joined(index, &term)).collect()
}

fn term_texts(analysis: &Analysis<'_>, path: &[usize], term: &LatencyTerm) -> Vec<String> {
    let plan = analysis.plan;
    let name = |component: usize| plan.components[component].name.as_str();
    vec![match term {
        LatencyTerm::Stages { place, first, sum } => {
            return terms::bound_terms(analysis, *place, *first, sum);
        }
        LatencyTerm::WholePath { ns } => {
            let (from, to) = (name(path[0]), name(path[path.len() - 1]));
            format!("{} from the release of `{from}` to the end of `{to}`", words::time(*ns))
        }
        LatencyTerm::AfterPublication { ns } => {
            format!("{} ({}, after it has published)", words::time(*ns), name(path[0]))
        }
        LatencyTerm::ToCore { ns, core } => format!("{} (to core {core})", words::time(*ns)),
        LatencyTerm::Wait { ns, writer, reader } => format!(
            "{} (from the release of `{}` until `{}` reads {})",
            words::time(*ns),
            name(*writer),
            name(*reader),
            topic_read(plan, *reader)
        ),
        LatencyTerm::ToEnd { ns, component } => {
            format!("{} (to the end of `{}`)", words::time(*ns), name(*component))
        }
    }]
}

/// Returns the topic whose source time a component propagates.
fn topic_read(plan: &Plan, reader: usize) -> &str {
    let component = &plan.components[reader];
    let topic = component.cause.and_then(|cause| component.inputs[cause].topic);
    topic.map_or("its data", |topic| plan.topics[topic].name.as_str())
}
