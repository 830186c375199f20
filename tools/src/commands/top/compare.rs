//! Two readings of a run, and the interval between them.

use motorium::launcher::{self, LoggedEvent};
use motorium::plan::ComponentPlan;
use motorium::region::{Command, Misses, Phase};
use motorium::telemetry::Snapshot;

use super::data::{
    ComponentSpan, ComponentTop, CoreTop, EdgeSpan, EdgeTop, LatencySpan, LatencyTop, State, TOP_VERSION, Top,
};
use crate::metrics::{ComponentSample, Sample};
use crate::runs::LivingRun;

impl Top {
    /// Returns the state of a run at `now`, and its changes since `before`.
    pub(crate) fn between(run: &LivingRun, before: &Sample, now: &Sample) -> Self {
        let plan = &run.plan;
        let wall_ns = now.taken_ns.saturating_sub(before.taken_ns).max(1);
        let topic = |index: usize| plan.topics[index].name.clone();
        let pairs = now.components.iter().zip(&before.components);
        let components = plan.components.iter().zip(pairs);
        let latencies = plan.latencies.iter().zip(now.latencies.iter().zip(&before.latencies));
        let edges = plan.edges().into_iter().zip(now.edges.iter().zip(&before.edges));
        let times = (now.now_ns, before.now_ns);
        Self {
            version: TOP_VERSION,
            run: run.folder.id().to_string(),
            graph: plan.name.clone(),
            clock: plan.clock,
            state: state(now),
            elapsed_s: now.elapsed_ns as f64 * 1e-9,
            interval_s: wall_ns as f64 * 1e-9,
            components: components
                .map(|(plan, (now, before))| component(plan, (now, times.0), (before, times.1), wall_ns))
                .collect(),
            latencies: latencies
                .map(|(latency, (now, before))| LatencyTop {
                    from: topic(latency.from),
                    to: topic(latency.to),
                    max_ns: latency.max_ns,
                    run: latency_span(&now.latency, now.missed),
                    interval: latency_span(
                        &now.latency.since(&before.latency),
                        now.missed.saturating_sub(before.missed),
                    ),
                })
                .collect(),
            edges: edges
                .map(|((index, reader), (now, before))| EdgeTop {
                    topic: topic(index),
                    reader: plan.components[reader].name.clone(),
                    run: edge_span(now),
                    interval: edge_span(&now.since(before)),
                })
                .collect(),
            cores: cores(run, before, now),
            events: newest_events(run),
        }
    }
}

/// Number of displayed events.
const EVENTS: usize = 5;

fn newest_events(run: &LivingRun) -> Vec<LoggedEvent> {
    let (mut events, _) = launcher::logged(&run.plan, &run.region);
    events.drain(..events.len().saturating_sub(EVENTS));
    events
}

fn state(sample: &Sample) -> State {
    match sample.command {
        Command::Configure | Command::Connect => State::Starting,
        Command::Run => State::Running,
        Command::SafeStop => State::SafeStop,
        Command::Stop => State::Stopping,
    }
}

fn latency_span(latency: &Snapshot, missed: u64) -> LatencySpan {
    LatencySpan { count: latency.count(), missed, latency_ns: latency.percentiles() }
}

fn edge_span(age: &Snapshot) -> EdgeSpan {
    EdgeSpan { read: age.count(), age_ns: age.percentiles() }
}

fn component(
    plan: &ComponentPlan,
    (now, now_ns): (&ComponentSample, u64),
    (before, before_ns): (&ComponentSample, u64),
    wall_ns: u64,
) -> ComponentTop {
    let run_hz = rate(plan, now, now_ns);
    let interval_hz = interval_rate(plan, (now, now_ns), (before, before_ns)).unwrap_or(run_hz);
    let share = |ns: u64| ns as f64 / wall_ns as f64;
    let cpu = now.cpu.since(&before.cpu);
    // The thread of a restarted process counts from its own start.
    let ran =
        now.usage.zip(before.usage).and_then(|(now, before)| now.thread_ns.checked_sub(before.thread_ns));
    ComponentTop {
        name: plan.name.clone(),
        phase: now.phase,
        safe: now.safe,
        gate: now.gate.clone(),
        pid: now.pid,
        core: plan.core,
        core_share: ran.filter(|_| now.pid == before.pid).map(share),
        step_share: share(cpu.sum()),
        resident_bytes: now.usage.map(|usage| usage.resident_bytes),
        shared_bytes: now.usage.map(|usage| usage.shared_bytes),
        spin_ns: now.spin_ns,
        stalls: now.stalls,
        restarts: now.restarts,
        run: whole(now, run_hz),
        interval: ComponentSpan {
            steps: now.steps.saturating_sub(before.steps),
            rate_hz: interval_hz,
            lateness_ns: now.lateness.since(&before.lateness).percentiles(),
            execution_ns: now.execution.since(&before.execution).percentiles(),
            cpu_ns: cpu.percentiles(),
            misses: misses_since(&now.misses, &before.misses),
            deferred: now.deferred.saturating_sub(before.deferred),
            errors: now.errors.saturating_sub(before.errors),
            refused: now.refused.saturating_sub(before.refused),
            allocations: allocations(now, before, |counts| counts.0),
            allocations_apart: allocations(now, before, |counts| counts.1),
            page_faults: now.page_faults.saturating_sub(before.page_faults),
        },
    }
}

fn whole(now: &ComponentSample, rate_hz: f64) -> ComponentSpan {
    ComponentSpan {
        steps: now.steps,
        rate_hz,
        lateness_ns: now.lateness.percentiles(),
        execution_ns: now.execution.percentiles(),
        cpu_ns: now.cpu.percentiles(),
        misses: now.misses,
        deferred: now.deferred,
        errors: now.errors,
        refused: now.refused,
        allocations: now.allocations.map(|counts| counts.0),
        allocations_apart: now.allocations.map(|counts| counts.1),
        page_faults: now.page_faults,
    }
}

/// Steps per second since the first step.
fn rate(plan: &ComponentPlan, now: &ComponentSample, now_ns: u64) -> f64 {
    let (first, last) = (now.first_step_ns, now.last_step_ns);
    launcher::steps_per_second(now.begun, first, last, now_ns, plan.period_ns())
}

/// Returns the rate from the last step before the interval to the last one in it, so that a late reading does
/// not change it. For a component that no longer steps, the rate up to the end of the interval. `None` if it
/// had not stepped before.
fn interval_rate(
    plan: &ComponentPlan,
    (now, now_ns): (&ComponentSample, u64),
    (before, before_ns): (&ComponentSample, u64),
) -> Option<f64> {
    if before.begun == 0 {
        return None;
    }
    let overdue = |last_ns: u64, at_ns: u64| at_ns.saturating_sub(last_ns) > 2 * plan.period_ns();
    let from = if overdue(before.last_step_ns, before_ns) { before_ns } else { before.last_step_ns };
    let steps = now.begun.saturating_sub(before.begun);
    Some(launcher::steps_per_second(steps + 1, from, now.last_step_ns, now_ns, plan.period_ns()))
}

fn allocations(now: &ComponentSample, before: &ComponentSample, which: fn((u64, u64)) -> u64) -> Option<u64> {
    Some(which(now.allocations?).saturating_sub(before.allocations.map_or(0, which)))
}

fn misses_since(now: &Misses, before: &Misses) -> Misses {
    Misses {
        late_wake: now.late_wake.saturating_sub(before.late_wake),
        long_step: now.long_step.saturating_sub(before.long_step),
        stolen: now.stolen.saturating_sub(before.stolen),
        late_input: now.late_input.saturating_sub(before.late_input),
        skipped: now.skipped.saturating_sub(before.skipped),
        over_budget: now.over_budget.saturating_sub(before.over_budget),
    }
}

fn cores(run: &LivingRun, before: &Sample, now: &Sample) -> Vec<CoreTop> {
    now.cores
        .iter()
        .map(|core| {
            let earlier = before.cores.iter().find(|earlier| earlier.core == core.core);
            let did = *core - earlier.copied().unwrap_or_default();
            let components = run.plan.components.iter().zip(&now.components);
            let pinned = components.filter(|(plan, sample)| {
                plan.core == Some(core.core) && !matches!(sample.phase, Phase::Stopped | Phase::Faulted)
            });
            CoreTop {
                core: core.core,
                user: did.share(did.user),
                system: did.share(did.system),
                interrupts: did.share(did.interrupts),
                idle: did.share(did.idle),
                stolen: did.share(did.stolen),
                components: pinned.map(|(plan, _)| plan.name.clone()).collect(),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::Ordering::Relaxed;

    use motorium::region::MissCause;

    use super::*;
    use crate::metrics::fixture::silent_run;

    #[test]
    fn interval_percentiles_match_its_samples() {
        let folder = tempfile::tempdir().expect("a folder");
        let run = silent_run(folder.path());
        let block = &run.region.components()[2];
        (1..=1_000).for_each(|i| block.execution.record(900_000 + i));
        block.miss(MissCause::LongStep);
        let before = Sample::take(&run);
        (1..=500).for_each(|i| block.execution.record(10_000 + 7 * i));
        run.region.latencies()[0].latency.record(77_000);
        run.region.edges()[1].age.record(5_000);
        block.miss(MissCause::Stolen);
        block.miss(MissCause::Stolen);
        let top = Top::between(&run, &before, &Sample::take(&run));
        let component = &top.components[2];
        assert_eq!(component.name, "policy");
        let got = component.interval.execution_ns;
        for (got, nth) in [(got.p50, 250), (got.p99, 495), (got.p999, 500), (got.max, 500)] {
            let expected = 10_000 + 7 * nth;
            assert!(got >= expected && got - expected <= expected / 32, "{got} instead of {expected}");
        }
        assert!(component.run.execution_ns.p50 > 800_000, "the whole run is included");
        assert_eq!(component.run.execution_ns.max, 901_000);
        assert_eq!((component.run.misses.stolen, component.run.misses.long_step), (2, 1));
        assert_eq!((component.interval.misses.stolen, component.interval.misses.long_step), (2, 0));
        assert_eq!(top.components[0].interval.execution_ns.max, 0, "nobody else stepped");
        assert_eq!((top.latencies[0].interval.count, top.latencies[0].interval.latency_ns.max), (1, 77_000));
        assert_eq!((top.edges[1].interval.read, top.edges[0].interval.read), (1, 0));
    }

    #[test]
    fn rates_are_per_step_and_not_per_poll() {
        let folder = tempfile::tempdir().expect("a folder");
        let run = silent_run(folder.path());
        let block = &run.region.components()[0];
        const MS: u64 = 1_000_000;
        let stepped = |steps: u64, last_ms: u64| {
            block.begun.store(steps, Relaxed);
            block.last_step_ns.store(last_ms * MS, Relaxed);
        };
        let look = |at_ms: u64| Sample { now_ns: at_ms * MS, ..Sample::take(&run) };
        block.first_step_ns.store(1_000 * MS, Relaxed);
        let rates = |before: &Sample, at_ms: u64| {
            let top = Top::between(&run, before, &look(at_ms));
            (top.components[0].run.rate_hz, top.components[0].interval.rate_hz)
        };
        let silent = look(900);
        stepped(1_001, 2_000);
        assert_eq!(rates(&silent, 2_001), (1_000.0, 1_000.0), "the first steps of all came in this interval");
        let early = look(2_001);
        stepped(1_101, 2_100);
        assert_eq!(rates(&early, 2_101).1, 1_000.0);
        assert_eq!(rates(&early, 2_200).1, 500.0, "it has stood still for half of the time");
        assert_eq!(rates(&look(2_200), 2_300).1, 0.0, "and for all of it");
        assert_eq!(rates(&silent, 3_200).0, 500.0);
    }

    #[test]
    fn ended_component_has_no_core_share() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut run = silent_run(folder.path());
        (run.plan.components[0].core, run.plan.components[2].core) = (Some(0), Some(0));
        let (block, sample) = (&run.region.components()[0], Sample::take(&run));
        block.enter(Phase::Faulted);
        let top = Top::between(&run, &sample, &Sample::take(&run));
        assert_eq!((top.components[0].core_share, top.components[0].resident_bytes), (None, None));
        assert_eq!(top.components[2].core, Some(0));
        let on_first = &top.cores[0].components;
        assert!(!on_first.contains(&"physics".to_string()), "it runs there no more: {on_first:?}");
        assert!(on_first.contains(&"policy".to_string()), "{on_first:?}");
    }
}
