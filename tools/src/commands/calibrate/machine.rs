//! What the machine takes.

use std::path::Path;
use std::time::Duration;

use motorium::component::Registry;
use motorium::launcher::Report;
use motorium::plan::{Activation, Plan};
use motorium::schedule::Overheads;
use motorium_benches::Distribution;
use motorium_benches::pair::{self, Carrier, Throw};

use crate::commands::doctor::measure_wake_up;

/// Priority of the measuring threads: that of the fastest components.
const FIFO: u8 = 80;
/// Bytes of a sample that is handed over: a joint state of a robot arm.
const BYTES: usize = 512;

/// Times of the machine, measured without a graph, ns.
#[derive(Debug, Clone, Copy)]
pub(super) struct Floor {
    wake_ns: u64,
    hop_same_core_p50_ns: u64,
    hop_same_core_ns: u64,
    hop_cross_core_ns: u64,
}

/// Measures the machine: how late it wakes a thread, and how long a hand-over takes.
pub(super) fn measure(program: &Path, registry: &Registry, time: Duration) -> anyhow::Result<Floor> {
    let defaults = Overheads::default();
    let wake_ns = measure_wake_up(time).map_or(defaults.wake_ns, |late| late.p99);
    let cores = core_affinity();
    let last = cores.last().copied().unwrap_or(0);
    let first = cores.first().copied().unwrap_or(0);
    let hop = |cores: [usize; 2], pace_ns: u64, rounds: usize| {
        let throw = Throw {
            carrier: Carrier::Blocking,
            bytes: BYTES,
            cores,
            fifo: FIFO,
            rounds,
            warm_up: 1_000,
            pace_ns,
        };
        anyhow::Ok(Distribution::of(pair::measure(program, registry, &throw)?.samples))
    };
    let same = hop([last, last], 0, 20_000)?;
    // between sparse hand-overs the other core goes idle, as it does in a graph
    let cross = if first == last { None } else { Some(hop([last, first], 500_000, 3_000)?) };
    Ok(Floor {
        wake_ns,
        hop_same_core_p50_ns: same.p50,
        hop_same_core_ns: same.p99,
        hop_cross_core_ns: cross.map_or(defaults.hop_cross_core_ns, |hop| hop.p99),
    })
}

/// Cores that this process may run on.
fn core_affinity() -> Vec<usize> {
    let set = rustix::thread::sched_getaffinity(None).ok();
    let all = 0..rustix::thread::CpuSet::MAX_CPU;
    set.map_or_else(|| vec![0], |set| all.filter(|core| set.is_set(*core)).collect())
}

impl Floor {
    /// With what the worker took in the run of a graph: the core's time of a step less the component's own, and less
    /// the hand-over that is counted by itself.
    pub(super) fn overheads(&self, plan: &Plan, report: &Report) -> Overheads {
        let worker = plan.components.iter().zip(&report.components).map(|(component, measured)| {
            let hop = match component.activation {
                Activation::Triggered { .. } => self.hop_same_core_p50_ns,
                Activation::Periodic { .. } => 0,
            };
            measured.cpu_ns.p50.saturating_sub(measured.execution_ns.p50).saturating_sub(hop)
        });
        let microsecond = |ns: u64| ns.div_ceil(1_000) * 1_000;
        Overheads {
            wake_ns: microsecond(self.wake_ns),
            hop_same_core_ns: microsecond(self.hop_same_core_ns),
            hop_cross_core_ns: microsecond(self.hop_cross_core_ns),
            worker_ns: microsecond(worker.max().unwrap_or(0).max(1)),
        }
    }
}
