//! Snapshots of a running graph.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use motorium::os::machine::CoreTimes;
use motorium::os::monotonic_ns;
use motorium::region::{Command, ComponentBlock, GateReport, Misses, Phase, Stalls};
use motorium::telemetry::Snapshot;

use super::thread::Usage;
use crate::runs::LivingRun;

/// A snapshot of a running graph. All counters start at the beginning of the run.
#[derive(Debug, Clone)]
pub(crate) struct Sample {
    /// Time at which the sample was taken, `CLOCK_MONOTONIC` ns.
    pub(crate) taken_ns: u64,
    /// Time since the start of the run on the run's clock, ns; 0 before the start.
    pub(crate) elapsed_ns: u64,
    /// Time of the sample on the clock of the run's stamps, ns.
    pub(crate) now_ns: u64,
    /// Last command of the launcher.
    pub(crate) command: Command,
    /// Sample of each component, in the order of the graph.
    pub(crate) components: Vec<ComponentSample>,
    /// Sample of each latency budget, in the order of the graph.
    pub(crate) latencies: Vec<LatencySample>,
    /// Ages of the samples read over each edge, in the order of the plan's edges.
    pub(crate) edges: Vec<Snapshot>,
    /// Sample of each topic, in the order of the plan.
    pub(crate) topics: Vec<TopicSample>,
    /// Times of each core, in the order of the cores' indices.
    pub(crate) cores: Vec<CoreTimes>,
}

/// Counters and histograms of a component.
#[derive(Debug, Clone)]
pub(crate) struct ComponentSample {
    pub(crate) phase: Phase,
    pub(crate) safe: bool,
    /// Statistics of an actuator's command gate; `None` for other components.
    pub(crate) gate: Option<GateReport>,
    pub(crate) pid: u32,
    pub(crate) begun: u64,
    pub(crate) steps: u64,
    pub(crate) first_step_ns: u64,
    pub(crate) last_step_ns: u64,
    pub(crate) lateness: Snapshot,
    pub(crate) execution: Snapshot,
    pub(crate) cpu: Snapshot,
    pub(crate) misses: Misses,
    pub(crate) deferred: u64,
    pub(crate) errors: u64,
    pub(crate) refused: u64,
    pub(crate) restarts: u32,
    /// Number of heap allocations by the component's code and by third-party code; `None` if the component's
    /// program does not count them.
    pub(crate) allocations: Option<(u64, u64)>,
    pub(crate) page_faults: u64,
    pub(crate) spin_ns: u64,
    pub(crate) stalls: Stalls,
    /// Use of the machine by the component; `None` if the component's process is gone.
    pub(crate) usage: Option<Usage>,
}

/// Histogram and misses of a latency budget.
#[derive(Debug, Clone)]
pub(crate) struct LatencySample {
    pub(crate) latency: Snapshot,
    pub(crate) missed: u64,
}

/// Publications of a topic.
#[derive(Debug, Clone)]
pub(crate) struct TopicSample {
    pub(crate) published: u64,
    pub(crate) dropped: u64,
}

fn load(cell: &AtomicU64) -> u64 {
    cell.load(Relaxed)
}

impl Sample {
    /// Takes a snapshot of a run.
    pub(crate) fn take(run: &LivingRun) -> Self {
        let (region, start) = (&run.region, run.start_ns());
        let started = region.header().start_ns.load(Relaxed) > 0;
        Self {
            taken_ns: monotonic_ns(),
            now_ns: run.now_ns(),
            elapsed_ns: if started { run.now_ns().saturating_sub(start) } else { 0 },
            command: region.header().command(),
            components: region.components().iter().map(ComponentSample::from_block).collect(),
            latencies: region
                .latencies()
                .iter()
                .map(|block| LatencySample { latency: block.latency.snapshot(), missed: load(&block.missed) })
                .collect(),
            edges: region.edges().iter().map(|block| block.age.snapshot()).collect(),
            topics: region
                .topics()
                .iter()
                .map(|block| TopicSample { published: load(&block.published), dropped: load(&block.dropped) })
                .collect(),
            cores: CoreTimes::read(),
        }
    }
}

impl ComponentSample {
    fn from_block(block: &ComponentBlock) -> Self {
        let (phase, pid) = (block.phase(), block.pid.load(Relaxed));
        let ended = matches!(phase, Phase::Stopped | Phase::Faulted);
        let usage = if ended { None } else { Usage::read(pid, block.thread.load(Relaxed)) };
        let counts = block.counts_allocations.load(Relaxed) != 0;
        Self {
            phase,
            safe: block.safe.load(Relaxed) != 0,
            gate: block.gate.report(),
            pid,
            begun: load(&block.begun),
            steps: load(&block.steps),
            first_step_ns: load(&block.first_step_ns),
            last_step_ns: load(&block.last_step_ns),
            lateness: block.lateness.snapshot(),
            execution: block.execution.snapshot(),
            cpu: block.cpu.snapshot(),
            misses: block.misses(),
            deferred: load(&block.deferred),
            errors: load(&block.errors),
            refused: load(&block.refused),
            restarts: block.restarts.load(Relaxed),
            allocations: counts.then(|| (load(&block.allocations), load(&block.allocations_apart))),
            page_faults: load(&block.page_faults),
            spin_ns: load(&block.spin_ns),
            stalls: block.stalls(),
            usage,
        }
    }
}

/// A run without processes, whose counters a test writes.
#[cfg(test)]
pub(crate) mod fixture {
    use std::path::Path;

    use motorium::graph::Machine;
    use motorium::region::Region;
    use motorium::run_folder::RunFolder;

    use crate::runs::LivingRun;

    /// Returns the region of the Panda's graph, empty, in a folder of the test's own.
    pub(crate) fn silent_run(folder: &Path) -> LivingRun {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../graphs/panda-reach.toml");
        let text = std::fs::read_to_string(&file).expect("the graph is there");
        let machine = Machine::with_cores(vec![0, 1]);
        let checked = motorium::graph::check(&file, text, &[], &crate::registry::registry(), &machine);
        let plan = checked.unwrap_or_else(|error| panic!("{}", error.render(false))).plan;
        let region = Region::create(&folder.join("region"), &plan).expect("a region");
        LivingRun { folder: RunFolder::open(folder), plan, region }
    }
}
