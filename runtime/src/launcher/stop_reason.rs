//! The reason why components ordered a safe stop, as text.

use crate::plan::{OnMiss, OnOverrun, Plan};
use crate::region::{Misses, Region};
use crate::units::TimeSpan;

/// Describes the exceeded limits of the graph.
pub(super) fn reason(plan: &Plan, region: &Region) -> String {
    let misses: Vec<Misses> = region.components().iter().map(|block| block.misses()).collect();
    let latencies: Vec<(u64, u64)> = region
        .latencies()
        .iter()
        .map(|block| {
            (block.missed.load(std::sync::atomic::Ordering::Relaxed), block.latency.percentiles().max)
        })
        .collect();
    describe(plan, &misses, &latencies)
}

/// Describes exceeded limits like [`reason`]. `misses` contains the misses of each component, and `latencies`
/// the number of misses and the longest latency (ns) of each latency budget.
fn describe(plan: &Plan, misses: &[Misses], latencies: &[(u64, u64)]) -> String {
    let overruns = plan.components.iter().zip(misses).filter_map(|(component, misses)| {
        let strict = component.on_overrun == OnOverrun::SafeStop;
        let tolerated = component.overruns_tolerated.or(strict.then_some(0))?;
        // a stale input does not count as an overrun
        let late = misses.late_wake.saturating_add(misses.long_step).saturating_add(misses.stolen);
        (late > u64::from(tolerated)).then(|| {
            let causes = [
                (misses.long_step, "too long"),
                (misses.late_wake, "delayed by others"),
                (misses.stolen, "delayed by the host"),
            ];
            let causes: Vec<String> = causes
                .iter()
                .filter(|(count, _)| *count > 0)
                .map(|(count, cause)| format!("{count} {cause}"))
                .collect();
            let steps = if late == 1 { "step" } else { "steps" };
            format!(
                "`{}` had {late} late {steps} ({}), expected at most {tolerated}",
                component.name,
                causes.join(", ")
            )
        })
    });
    let late = plan.latencies.iter().zip(latencies).filter_map(|(latency, (missed, longest_ns))| {
        let (from, to) = (&plan.topics[latency.from].name, &plan.topics[latency.to].name);
        (latency.on_miss == OnMiss::SafeStop && *missed > 0).then(|| {
            format!(
                "the latency from `{from}` to `{to}` was {}, expected at most {}",
                TimeSpan { ns: *longest_ns },
                TimeSpan { ns: latency.max_ns }
            )
        })
    });
    let found: Vec<String> = overruns.chain(late).collect();
    match found.as_slice() {
        // the counters of the ordering component may not be visible yet
        [] => "a component ordered the safe stop (a latency budget or an overrun policy)".to_string(),
        found => found.join("; "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::schedule::tests::graphs::{When, graph, node};

    fn plan() -> Plan {
        let nodes = [node("physics", When::Every(1_000_000, 0), 1), node("controller", When::After(0), 1)];
        let mut plan = graph(&nodes, 0, &[(0, 1, 300_000)]);
        plan.components[1].on_overrun = OnOverrun::SafeStop;
        plan.latencies[0].on_miss = OnMiss::SafeStop;
        plan
    }

    #[test]
    fn only_excessive_overruns_are_named_with_their_cause() {
        let late = Misses { long_step: 1, late_wake: 2, ..Misses::default() };
        let both = [late, late];
        assert_eq!(
            describe(&plan(), &both, &[(0, 0)]),
            "`controller` had 3 late steps (1 too long, 2 delayed by others), expected at most 0"
        );
        let mut tolerant = plan();
        tolerant.components[1].overruns_tolerated = Some(3);
        assert!(describe(&tolerant, &both, &[(0, 0)]).starts_with("a component ordered"));
    }

    #[test]
    fn excessive_latency_is_reported_with_its_budget() {
        assert_eq!(
            describe(&plan(), &[Misses::default(); 2], &[(1, 412_000)]),
            "the latency from `topic/physics` to `topic/controller` was 412 us, expected at most 300 us"
        );
    }
}
