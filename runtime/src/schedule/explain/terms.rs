//! Terms of a bound, as text.

use super::words;
use crate::schedule::analysis::Analysis;
use crate::schedule::analysis::tasks::Place;
use crate::schedule::analysis::window::Sum;

/// Formats the terms of a bound of a stage: the stages of the job from `first` on, then other jobs, then the
/// time before the release.
pub(in crate::schedule) fn bound_terms(
    analysis: &Analysis<'_>,
    place: Place,
    first: usize,
    sum: &Sum,
) -> Vec<String> {
    let tasks = &analysis.tasks.tasks;
    let task = &tasks[place.task];
    let name = |component: usize| &analysis.plan.components[component].name;
    let mut terms: Vec<String> = task.stages[..=place.stage]
        .iter()
        .skip(first)
        .flat_map(|stage| &stage.steps)
        .flat_map(|step| {
            let waits = (step.waits_ns > 0)
                .then(|| format!("{} (waiting of {})", words::time(step.waits_ns), name(step.component)));
            let works = format!("{} ({})", words::time(step.cost_ns()), name(step.component));
            core::iter::once(works).chain(waits)
        })
        .collect();
    let here = analysis.tasks.on_core(task.core);
    // SCHED_DEADLINE components follow the tasks of the core
    for (reservation, count) in analysis.tasks.reservations.iter().zip(sum.jobs.iter().skip(here.len())) {
        if *count > 0 {
            let times = if *count == 1 { String::new() } else { format!("{count} x ") };
            let (time, name) = (words::time(reservation.runtime_ns), name(reservation.step.component));
            terms.push(format!("{times}{time} ({name} by its deadline)"));
        }
    }
    for (index, count) in here.into_iter().zip(&sum.jobs) {
        if *count > 0 {
            let members: Vec<&str> = tasks[index].steps().map(|step| name(step.component).as_str()).collect();
            let times = if *count == 1 { String::new() } else { format!("{count} x ") };
            let is_own = index == place.task;
            let before = if is_own { ", an earlier job" } else { "" };
            let waits_ns = if is_own { tasks[index].waits_ns() } else { 0 };
            terms.push(format!(
                "{times}{} ({}{before})",
                words::time(tasks[index].cost_ns() + waits_ns),
                members.join(", ")
            ));
        }
    }
    match sum.elapsed {
        0 => {}
        late @ ..0 => terms.push(format!("{} (released late)", words::time(late.unsigned_abs()))),
        passed => terms.push(format!("- {} (before its release)", words::time(passed.unsigned_abs()))),
    }
    terms
}

/// Adds the sign to a term, unless it is the first.
pub(in crate::schedule) fn joined(index: usize, term: &str) -> String {
    if index == 0 || term.starts_with('-') { term.to_string() } else { format!("+ {term}") }
}
