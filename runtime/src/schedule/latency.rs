//! Bounds on the latency of data through a graph.
//!
//! The way from one topic to another goes in *legs*: the component at the head of a chain, and those that trigger one
//! another after it. From one leg to the next the data waits in shared memory until the next head reads it.
//!
//! A component is taken to publish at the end of its step: what it does after it has published is not part of the
//! latency of what it published, but holds up those it triggers on its core.

use super::admission::{LatencyBound, Verdict};
use super::phases::greatest_common_divisor;
use super::response::Responses;
use super::tasks::{self, Place, Release, StaticPlan};
use super::unknown::Unknown;
use super::window::{Sum, after_first_stage};
use super::{terms, words};
use crate::plan::{Activation, LatencyPlan, Plan};

/// Everything that the bound of a latency is found from.
#[derive(Debug, Clone, Copy)]
pub(super) struct Analysis<'a> {
    pub plan: &'a Plan,
    pub tasks: &'a StaticPlan,
    pub responses: &'a Responses,
    pub unknown: &'a Unknown,
}

/// A bound and the terms of its sum.
struct Bounded {
    ns: u64,
    terms: Vec<String>,
}

/// The bound of one latency budget.
pub(super) fn latency(analysis: &Analysis<'_>, latency: &LatencyPlan) -> LatencyBound {
    let plan = analysis.plan;
    let path = path(plan, latency);
    let analysed = path.iter().all(|component| analysis.tasks.knows(*component));
    let bounded = match legs(plan, &path).as_slice() {
        _ if !analysed => None,
        [_] => triggered(analysis, &path),
        legs => sampled(analysis, legs),
    };
    let max = words::time(latency.max_ns);
    let holds = bounded.as_ref().is_some_and(|bounded| bounded.ns <= latency.max_ns);
    let rests = |component: &usize| match analysis.tasks.places[*component] {
        Some(place) => analysis.unknown.rests[place.task],
        None => plan.components[*component].budget_ns.is_none(),
    };
    let known = !path.iter().any(rests);
    let arithmetic = match (&bounded, analysed) {
        (Some(bounded), _) => words::comparison(&bounded.terms, words::time(bounded.ns), holds, &max),
        (None, true) => format!("grows without bound > {max}"),
        (None, false) => {
            let others: Vec<usize> =
                path.iter().copied().filter(|component| !analysis.tasks.knows(*component)).collect();
            format!("{} not real-time on one core: no bound", are(&words::names(plan, &others), others.len()))
        }
    };
    LatencyBound {
        from: plan.topics[latency.from].name.clone(),
        to: plan.topics[latency.to].name.clone(),
        path: path.iter().map(|component| plan.components[*component].name.clone()).collect(),
        bound_ns: bounded.map(|bounded| bounded.ns),
        max_ns: latency.max_ns,
        verdict: match (analysed, holds, known) {
            (false, ..) | (_, true, false) => Verdict::NotProvable,
            (_, true, true) => Verdict::Holds,
            (_, false, _) => Verdict::Exceeds,
        },
        arithmetic,
    }
}

/// "`a` is", "`a` and `b` are".
fn are(names: &str, count: usize) -> String {
    format!("{names} {}", if count == 1 { "is" } else { "are" })
}

/// The components that data goes through, from the writer of `from` to that of `to`.
fn path(plan: &Plan, latency: &LatencyPlan) -> Vec<usize> {
    let mut path = vec![latency.component];
    let mut topic = latency.to;
    // a way is no longer than there are components
    while topic != latency.from && path.len() <= plan.components.len() {
        let component = &plan.components[plan.topics[topic].writer];
        let Some(cause) = component.cause.and_then(|cause| component.inputs.get(cause)?.topic) else { break };
        topic = cause;
        path.push(plan.topics[topic].writer);
    }
    path.reverse();
    path
}

/// The path cut before every time-triggered component.
fn legs<'p>(plan: &Plan, path: &'p [usize]) -> Vec<&'p [usize]> {
    let periodic =
        |component: &usize| matches!(plan.components[*component].activation, Activation::Periodic { .. });
    let cuts: Vec<usize> = (1..path.len()).filter(|index| periodic(&path[*index])).collect();
    let starts = core::iter::once(0).chain(cuts.iter().copied());
    let ends = cuts.iter().copied().chain([path.len()]);
    starts.zip(ends).map(|(start, end)| &path[start..end]).collect()
}

/// From the publication of the first component to the end of the last, all triggered by one another.
fn triggered(analysis: &Analysis<'_>, path: &[usize]) -> Option<Bounded> {
    let last = path.last()?;
    let places: Option<Vec<Place>> = path.iter().map(|component| analysis.tasks.places[*component]).collect();
    let since_release = since_release(analysis, *last).map(|ns| Bounded {
        ns,
        terms: vec![format!(
            "{} from the release of `{}` to the end of `{}`",
            words::time(ns),
            analysis.plan.components[path[0]].name,
            analysis.plan.components[*last].name
        )],
    });
    let hop_by_hop = places.and_then(|places| hop_by_hop(analysis, path, &places));
    match (since_release, hop_by_hop) {
        (Some(one), Some(other)) => Some(if one.ns < other.ns { one } else { other }),
        (one, other) => one.or(other),
    }
}

/// The same as a sum: the rest of the first task, then each task after it from its own release.
fn hop_by_hop(analysis: &Analysis<'_>, path: &[usize], places: &[Place]) -> Option<Bounded> {
    let tasks = &analysis.tasks.tasks;
    let mut total = 0;
    let mut words: Vec<String> = Vec::new();
    let mut places = places.iter().peekable();
    while let Some(place) = places.next() {
        // only the last stage of each task matters
        if places.peek().is_some_and(|next| next.task == place.task) {
            continue;
        }
        let (sum, first): (Sum, usize) = if words.is_empty() && total == 0 && first_task(analysis, place.task)
        {
            let goes_on = goes_on(analysis, path, *place);
            if goes_on > 0 {
                let name = &analysis.plan.components[path[0]].name;
                words.push(format!("{} ({name}, after it has published)", words::time(goes_on)));
            }
            (rest(analysis, *place, goes_on)?, 1)
        } else {
            let bounds = analysis.responses.bounds[place.task].as_ref()?;
            if let Release::Trigger { delay_ns, .. } = tasks[place.task].release
                && delay_ns > 0
            {
                total += delay_ns as i64;
                words.push(format!("{} (to core {})", words::time(delay_ns), tasks[place.task].core));
            }
            (bounds.get(place.stage)?.response.clone(), 0)
        };
        total += sum.total;
        words.extend(terms::of(analysis, *place, first, &sum));
    }
    let words = words.iter().enumerate().map(|(index, term)| terms::joined(index, term)).collect();
    Some(Bounded { ns: u64::try_from(total).ok()?, terms: words })
}

fn first_task(analysis: &Analysis<'_>, task: usize) -> bool {
    matches!(analysis.tasks.tasks[task].release, Release::Timer { .. })
}

/// How long the component at the head of a task goes on after it has published, before those on a path through the task
/// have all had their turn, ns: what is more urgent has it at once.
fn goes_on(analysis: &Analysis<'_>, path: &[usize], place: Place) -> u64 {
    let task = &analysis.tasks.tasks[place.task];
    let priority = |component: usize| tasks::priority(&analysis.plan.components[component]);
    let in_task = |component: usize| analysis.tasks.places[component].is_some_and(|at| at.task == place.task);
    let waits = |component: usize| in_task(component) && priority(component) <= priority(task.head());
    if path.iter().skip(1).any(|component| waits(*component)) { task.stages[0].steps[0].after_ns } else { 0 }
}

/// From the publication of the first stage of a task to the end of another, if the first goes on for so long in
/// between.
fn rest(analysis: &Analysis<'_>, place: Place, goes_on: u64) -> Option<Sum> {
    let (demands, index) = analysis.responses.on_core_of(analysis.tasks, place.task);
    let bounds = analysis.responses.bounds[place.task].as_ref()?;
    if bounds.iter().any(|bound| bound.finish.total > demands[index].period) {
        return None;
    }
    let queued = bounds.first()?.finish.total;
    after_first_stage(&demands, index, queued, goes_on as i64)?.get(place.stage).cloned()
}

/// From the release at the head of a chain to the end of a component's step, ns.
pub(super) fn since_release(analysis: &Analysis<'_>, component: usize) -> Option<u64> {
    if let Some((reservation, _)) = analysis.tasks.reservation(component) {
        return u64::try_from(analysis.responses.reserved_finish(reservation)?).ok();
    }
    let place = analysis.tasks.places[component]?;
    let bound = analysis.responses.bounds[place.task].as_ref()?.get(place.stage)?;
    let spin = analysis.tasks.tasks[place.task].spin_ns();
    u64::try_from(bound.finish.total - spin as i64).ok()
}

/// From the release at the head of the first leg to the end of the last one.
fn sampled(analysis: &Analysis<'_>, legs: &[&[usize]]) -> Option<Bounded> {
    let plan = analysis.plan;
    let mut total = 0;
    let mut terms = Vec::new();
    for pair in legs.windows(2) {
        let (writer, reader) = (pair[0], pair[1]);
        let age = age_at_read(analysis, writer, reader)?;
        let topic =
            plan.components[reader[0]].cause.and_then(|cause| plan.components[reader[0]].inputs[cause].topic);
        let topic = topic.map_or("its data", |topic| plan.topics[topic].name.as_str());
        terms.push(format!(
            "{} (from the release of `{}` until `{}` reads {topic})",
            words::time(age),
            plan.components[writer[0]].name,
            plan.components[reader[0]].name
        ));
        total += age;
    }
    let last = legs.last()?;
    let end = since_release(analysis, *last.last()?)?;
    terms.push(format!("{} (to the end of `{}`)", words::time(end), plan.components[*last.last()?].name));
    let terms = terms.iter().enumerate().map(|(index, term)| terms::joined(index, term)).collect();
    Some(Bounded { ns: total + end, terms })
}

/// How old the newest data of a chain can be, since the release at its head, when a time-triggered component is
/// released and reads it.
///
/// Data is there for certain at the bound F after the release of its chain. Of the releases that are at least F ago
/// the newest counts. On one clock the time between releases of the two is `d + k * g`, with g the greatest common
/// divisor of the periods and d the difference of the phases.
fn age_at_read(analysis: &Analysis<'_>, writer: &[usize], reader: &[usize]) -> Option<u64> {
    let end = since_release(analysis, *writer.last()?)? as i64;
    let timer = |component: usize| {
        if let Some((_, reservation)) = analysis.tasks.reservation(component) {
            let (period, phase) = (reservation.period_ns as i64, reservation.phase_ns as i64);
            return Some((period, phase, reservation.fixed));
        }
        let task = &analysis.tasks.tasks[analysis.tasks.places[component]?.task];
        match task.release {
            Release::Timer { phase_ns, fixed, .. } => Some((task.period_ns as i64, phase_ns as i64, fixed)),
            Release::Trigger { .. } => None,
        }
    };
    let (period, phase, fixed) = timer(writer[0])?;
    let (reader_period, reader_phase, reader_fixed) = timer(reader[0])?;
    let age = if fixed && reader_fixed {
        let grain = greatest_common_divisor(period, reader_period);
        end + period - grain + (reader_phase - phase - end).rem_euclid(grain)
    } else {
        end + period
    };
    u64::try_from(age).ok()
}
