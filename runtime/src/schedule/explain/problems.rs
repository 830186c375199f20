//! The problems of an admission, as text with advice.

use super::words;
use crate::plan::Activation;
use crate::schedule::admission::{Admission, Problem, TaskBound, Verdict};
use crate::schedule::analysis::Analysis;
use crate::schedule::analysis::load::{Burst, longest_burst};
use crate::severity::Severity;

/// Finds all problems of an admission, refusals first.
pub(in crate::schedule) fn find(analysis: &Analysis<'_>, admission: &mut Admission) {
    let mut problems = overload(admission);
    problems.extend(reserved_too_much(admission));
    bursts(analysis, admission, &mut problems);
    late(admission, &mut problems);
    latencies(admission, &mut problems);
    not_known(analysis, &mut problems);
    unprovable_latencies(analysis, admission, &mut problems);
    problems.sort_by_key(|problem| problem.severity == Severity::Warning);
    admission.problems = problems;
}

fn error(message: String, arithmetic: Option<String>, advice: &str) -> Problem {
    Problem { severity: Severity::Error, message, arithmetic, advice: advice.to_string() }
}

fn overload(admission: &Admission) -> Vec<Problem> {
    let overloaded = admission.cores.iter().filter(|core| core.verdict == Verdict::Exceeds);
    overloaded
        .map(|core| {
            let message = if core.share > 1.0 {
                format!("core {} is overloaded", core.core)
            } else {
                format!(
                    "core {} is overloaded: the kernel grants its real-time components less time than they need",
                    core.core
                )
            };
            error(
                message,
                Some(format!("core {}: {}", core.core, core.arithmetic)),
                "lower rates or budgets, spin for less time, or move components to another core",
            )
        })
        .collect()
}

/// Returns the problem of more deadlines than the kernel admits.
fn reserved_too_much(admission: &Admission) -> Option<Problem> {
    let load = admission.deadlines.as_ref().filter(|load| load.verdict == Verdict::Exceeds)?;
    Some(error(
        "the kernel does not accept this many components under `SCHED_DEADLINE`".to_string(),
        Some(format!("all cores: {}", load.arithmetic)),
        "lower rates or budgets, or schedule some of them as `fifo`",
    ))
}

/// Finds cores whose mean load is allowed, but not their load in one throttling period.
fn bursts(analysis: &Analysis<'_>, admission: &mut Admission, problems: &mut Vec<Problem>) {
    for core in admission.cores.iter_mut().filter(|core| core.verdict != Verdict::Exceeds) {
        let limit = &admission.rt_limit;
        let burst = longest_burst(analysis.tasks, analysis.responses, core.core, limit);
        let (Some(Burst { total_ns, terms }), Some(runtime_ns)) = (burst, limit.runtime_ns) else { continue };
        if total_ns <= runtime_ns {
            continue;
        }
        core.verdict = Verdict::Exceeds;
        let terms: Vec<String> = terms
            .iter()
            .enumerate()
            .map(|(index, (members, work))| {
                let sign = if index > 0 { "+ " } else { "" };
                format!("{sign}{} ({})", words::time(*work), words::names(analysis.plan, members))
            })
            .collect();
        let period = words::time(limit.period_ns);
        problems.push(error(
            format!("the kernel may stop the real-time components of core {} (throttling)", core.core),
            Some(format!(
                "core {}, in one period of {period}: {}",
                core.core,
                words::comparison(&terms, words::time(total_ns), false, &words::time(runtime_ns))
            )),
            "lower rates or budgets, split long steps, or set kernel.sched_rt_runtime_us to -1",
        ));
    }
}

fn late(admission: &Admission, problems: &mut Vec<Problem>) {
    // an unbounded response on an overloaded core follows from the overload
    let follows = |task: &TaskBound| {
        task.response_ns.is_none()
            && admission.cores.iter().any(|core| Some(core.core) == task.core && core.share > 1.0)
    };
    let mut reported: Vec<&str> = Vec::new();
    for task in admission.tasks.iter().filter(|task| task.verdict == Verdict::Exceeds && !follows(task)) {
        // only the first late member of a chain is reported
        if reported.contains(&task.released_with.as_str()) {
            continue;
        }
        reported.push(&task.released_with);
        let since = if task.released_with == task.component {
            String::new()
        } else {
            format!(", released with `{}`,", task.released_with)
        };
        problems.push(error(
            format!("component `{}`{since} may still be running when its next step is due", task.component),
            Some(format!("{}: {}", task.component, task.arithmetic)),
            "lower rates or budgets, raise its priority, shift it by a phase, or move it to another core",
        ));
    }
}

fn latencies(admission: &Admission, problems: &mut Vec<Problem>) {
    let unbounded_follows = !problems.is_empty();
    for latency in admission.latencies.iter().filter(|latency| latency.verdict == Verdict::Exceeds) {
        if latency.bound_ns.is_none() && unbounded_follows {
            continue;
        }
        problems.push(error(
            format!(
                "data may take longer from `{}` to `{}` than its latency budget",
                latency.from, latency.to
            ),
            Some(format!("{} -> {}: {}", latency.from, latency.to, latency.arithmetic)),
            "allow more time, lower budgets on its path, or let its components trigger one another",
        ));
    }
}

fn not_known(analysis: &Analysis<'_>, problems: &mut Vec<Problem>) {
    let (plan, unknown) = (analysis.plan, analysis.unknown);
    let mut warn = |components: &[usize], one: &str, several: &str, advice: &str| {
        let words = match components {
            [] => return,
            [_] => format!("component {} {one}", words::names(plan, components)),
            _ => format!("components {} {several}", words::names(plan, components)),
        };
        problems.push(Problem {
            severity: Severity::Warning,
            message: format!("{words}, so dependent response times cannot be verified"),
            arithmetic: None,
            advice: advice.to_string(),
        });
    };
    warn(
        &unknown.without_budget,
        "has no budget",
        "have no budget",
        "add the maximum execution time of a step, such as `budget = \"100 us\"`",
    );
    warn(
        &unknown.released_by_others,
        "is triggered by a component that is not real-time",
        "are triggered by components that are not real-time",
        "schedule both in the same way",
    );
    warn(&unknown.without_core, "may run on several cores", "may run on several cores", "add `core = 1`");
}

fn unprovable_latencies(analysis: &Analysis<'_>, admission: &Admission, problems: &mut Vec<Problem>) {
    let by_events = |name: &String| {
        let mut components = analysis.plan.components.iter().filter(|component| component.name == *name);
        components.any(|component| matches!(component.activation, Activation::Descriptor { .. }))
    };
    for latency in &admission.latencies {
        if latency.verdict == Verdict::NotProvable && latency.bound_ns.is_none() {
            problems.push(Problem {
                severity: Severity::Warning,
                message: format!("the latency from `{}` to `{}` cannot be verified", latency.from, latency.to),
                arithmetic: Some(format!("{} -> {}: {}", latency.from, latency.to, latency.arithmetic)),
                advice: match latency.path.iter().any(by_events) {
                    true => "let the components on its path trigger one another; data read at a rate may be arbitrarily old",
                    false => "schedule all components on its path as `fifo`, each on one core",
                }
                .to_string(),
            });
        }
    }
}
