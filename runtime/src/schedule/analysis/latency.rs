//! Latency bounds of data through a graph.
//!
//! The path of data from one topic to another consists of *segments*. A segment is a component released by
//! the clock or by events (the head of a trigger chain), followed by the components that it triggers. Between
//! two segments, the data waits in shared memory until the head of the next segment reads it.
//!
//! A component is assumed to publish at the end of its step. Its work after the publication is not part of
//! the latency of that sample, but delays the components it triggers on its core.

use super::Analysis;
use super::phases::greatest_common_divisor;
use super::tasks::{self, Place, Release};
use super::window::{Sum, after_first_stage};
use crate::plan::{Activation, LatencyPlan, Plan};

/// A bound on a latency, as a sum.
#[derive(Debug)]
pub(in crate::schedule) struct LatencySum {
    /// Maximum latency, ns.
    pub ns: u64,
    /// Terms of the sum, in the order of the path.
    pub terms: Vec<LatencyTerm>,
}

/// A term of the bound on a latency.
#[derive(Debug)]
pub(in crate::schedule) enum LatencyTerm {
    /// The whole path, from the release of its first component to the end of its last component.
    WholePath { ns: u64 },
    /// Remainder of the first component's step after its publication.
    AfterPublication { ns: u64 },
    /// A wake-up on another core.
    ToCore { ns: u64, core: usize },
    /// The stages of the task at `place`, from stage `first` to the stage of `place`.
    Stages { place: Place, first: usize, sum: Sum },
    /// From the release of `writer` until the time-triggered `reader` reads its data.
    Wait { ns: u64, writer: usize, reader: usize },
    /// The last segment, to the end of its last component.
    ToEnd { ns: u64, component: usize },
}

/// Returns the bound of a latency budget with the path `path`; `None` without a bound.
pub(in crate::schedule) fn latency(analysis: &Analysis<'_>, path: &[usize]) -> Option<LatencySum> {
    match segments(analysis.plan, path).as_slice() {
        [_] => triggered(analysis, path),
        segments => sampled(analysis, segments),
    }
}

/// Returns the components on the path from the writer of `from` to the writer of `to`.
pub(in crate::schedule) fn path(plan: &Plan, latency: &LatencyPlan) -> Vec<usize> {
    let mut path = vec![latency.component];
    let mut topic = latency.to;
    // a path visits no component twice
    while topic != latency.from && path.len() <= plan.components.len() {
        let component = &plan.components[plan.topics[topic].writer];
        let Some(cause) = component.cause.and_then(|cause| component.inputs.get(cause)?.topic) else { break };
        topic = cause;
        path.push(plan.topics[topic].writer);
    }
    path.reverse();
    path
}

/// Splits the path before every component that is not triggered by its predecessor.
fn segments<'p>(plan: &Plan, path: &'p [usize]) -> Vec<&'p [usize]> {
    let is_head = |component: usize| plan.components[component].activation.is_head();
    let cuts: Vec<usize> = (1..path.len()).filter(|index| is_head(path[*index])).collect();
    let starts = core::iter::once(0).chain(cuts.iter().copied());
    let ends = cuts.iter().copied().chain([path.len()]);
    starts.zip(ends).map(|(start, end)| &path[start..end]).collect()
}

/// Returns the components of a path that step on events, if data waits for such a step or is read at a rate
/// after it. Events may be arbitrarily rare.
pub(in crate::schedule) fn sampled_events(plan: &Plan, path: &[usize]) -> Vec<usize> {
    let segments = segments(plan, path);
    let heads = segments.iter().filter(|_| segments.len() > 1).map(|segment| segment[0]);
    let by_events = |head: &usize| matches!(plan.components[*head].activation, Activation::Descriptor { .. });
    heads.filter(by_events).collect()
}

/// Returns the latency from the publication of the first component to the end of the last, if each is
/// triggered by its predecessor.
fn triggered(analysis: &Analysis<'_>, path: &[usize]) -> Option<LatencySum> {
    let last = path.last()?;
    let places: Option<Vec<Place>> = path.iter().map(|component| analysis.tasks.places[*component]).collect();
    let since_release = since_release(analysis, *last)
        .map(|ns| LatencySum { ns, terms: vec![LatencyTerm::WholePath { ns }] });
    let hop_by_hop = places.and_then(|places| hop_by_hop(analysis, path, &places));
    match (since_release, hop_by_hop) {
        (Some(one), Some(other)) => Some(if one.ns < other.ns { one } else { other }),
        (one, other) => one.or(other),
    }
}

/// Sums the latency: the remainder of the first task, then each later task from its own release.
fn hop_by_hop(analysis: &Analysis<'_>, path: &[usize], places: &[Place]) -> Option<LatencySum> {
    let tasks = &analysis.tasks.tasks;
    let mut total = 0;
    let mut terms = Vec::new();
    let mut places = places.iter().peekable();
    while let Some(place) = places.next() {
        // only the last stage of each task matters
        if places.peek().is_some_and(|next| next.task == place.task) {
            continue;
        }
        let (sum, first): (Sum, usize) = if terms.is_empty() && total == 0 && first_task(analysis, place.task)
        {
            let goes_on = goes_on(analysis, path, *place);
            if goes_on > 0 {
                terms.push(LatencyTerm::AfterPublication { ns: goes_on });
            }
            (rest(analysis, *place, goes_on)?, 1)
        } else {
            let bounds = analysis.responses.bounds[place.task].as_ref()?;
            if let Release::Trigger { delay_ns, .. } = tasks[place.task].release
                && delay_ns > 0
            {
                total += delay_ns as i64;
                terms.push(LatencyTerm::ToCore { ns: delay_ns, core: tasks[place.task].core });
            }
            (bounds.get(place.stage)?.response.clone(), 0)
        };
        total += sum.total;
        terms.push(LatencyTerm::Stages { place: *place, first, sum });
    }
    Some(LatencySum { ns: u64::try_from(total).ok()?, terms })
}

fn first_task(analysis: &Analysis<'_>, task: usize) -> bool {
    !matches!(analysis.tasks.tasks[task].release, Release::Trigger { .. })
}

/// Returns the longest time that the head of a task continues after its publication, before all components on
/// a path through the task have run, ns. A more urgent component preempts it immediately.
fn goes_on(analysis: &Analysis<'_>, path: &[usize], place: Place) -> u64 {
    let task = &analysis.tasks.tasks[place.task];
    let priority = |component: usize| tasks::priority(&analysis.plan.components[component]);
    let in_task = |component: usize| analysis.tasks.places[component].is_some_and(|at| at.task == place.task);
    let waits = |component: usize| in_task(component) && priority(component) <= priority(task.head());
    if path.iter().skip(1).any(|component| waits(*component)) { task.stages[0].steps[0].after_ns } else { 0 }
}

/// Returns the longest time from the publication of the first stage of a task to the end of another, if the
/// first continues for `goes_on` in between.
fn rest(analysis: &Analysis<'_>, place: Place, goes_on: u64) -> Option<Sum> {
    let (demands, index) = analysis.responses.on_core_of(analysis.tasks, place.task);
    let bounds = analysis.responses.bounds[place.task].as_ref()?;
    if bounds.iter().any(|bound| bound.finish.total > demands[index].period) {
        return None;
    }
    let queued = bounds.first()?.finish.total;
    after_first_stage(&demands, index, queued, goes_on as i64)?.get(place.stage).cloned()
}

/// Returns the time from the release at the head of a chain to the end of a component's step, ns.
pub(in crate::schedule) fn since_release(analysis: &Analysis<'_>, component: usize) -> Option<u64> {
    if let Some((reservation, _)) = analysis.tasks.reservation(component) {
        return u64::try_from(analysis.responses.reserved_finish(reservation)?).ok();
    }
    let place = analysis.tasks.places[component]?;
    let bound = analysis.responses.bounds[place.task].as_ref()?.get(place.stage)?;
    let spin = analysis.tasks.tasks[place.task].spin_ns();
    u64::try_from(bound.finish.total - spin as i64).ok()
}

/// Returns the time from the release at the head of the first segment to the end of the last segment.
fn sampled(analysis: &Analysis<'_>, segments: &[&[usize]]) -> Option<LatencySum> {
    let mut total = 0;
    let mut terms = Vec::new();
    for pair in segments.windows(2) {
        let (writer, reader) = (pair[0], pair[1]);
        let ns = age_at_read(analysis, writer, reader)?;
        terms.push(LatencyTerm::Wait { ns, writer: writer[0], reader: reader[0] });
        total += ns;
    }
    let component = *segments.last()?.last()?;
    let ns = since_release(analysis, component)?;
    terms.push(LatencyTerm::ToEnd { ns, component });
    Some(LatencySum { ns: total + ns, terms })
}

/// Returns the greatest age of the newest data of a chain, since the release at its head, when a
/// time-triggered component is released and reads it.
///
/// Data has certainly been published once the bound F has passed since the release of its chain, so the
/// newest release that is at least F ago counts. On a common clock, the time between releases of the two is
/// `d + k * g`, where g is the greatest common divisor of the periods and d the difference of the phases.
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
            // data may wait forever for the next event, and ages without bound after the last one
            Release::Event | Release::Trigger { .. } => None,
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
