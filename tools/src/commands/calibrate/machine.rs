//! Measurement of the machine's overheads.

use std::path::Path;
use std::time::Duration;

use motorium::launcher::Report;
use motorium::plan::{Activation, Plan};
use motorium::schedule::Overheads;
use motorium::worker::Registry;
use motorium_benches::Distribution;
use motorium_benches::pair::{self, PingPong, Transport};

use crate::commands::doctor::measure_wake_up;

/// Priority of the measuring threads, equal to the fastest components'.
const FIFO: u8 = 80;
/// Size of a handed-over sample, bytes: a joint state of a robot arm.
const BYTES: usize = 512;

/// Times of the machine, measured without a graph, ns.
#[derive(Debug, Clone, Copy)]
pub(super) struct Floor {
    wake_ns: u64,
    /// Duration of a hand-over on one core: p50 and p99.
    hop_same_core_ns: [u64; 2],
    hop_cross_core_ns: u64,
}

/// Measures the machine: the lateness of wake-ups and the time of a hand-over.
pub(super) fn measure(program: &Path, registry: &Registry, time: Duration) -> anyhow::Result<Floor> {
    let defaults = Overheads::default();
    let wake_ns = measure_wake_up(time).map_or(defaults.wake_ns, |late| late.p99);
    let cores = core_affinity();
    let last = cores.last().copied().unwrap_or(0);
    let first = cores.first().copied().unwrap_or(0);
    let hop = |cores: [usize; 2], pace_ns: u64, rounds: usize| {
        let ping_pong = PingPong {
            transport: Transport::Blocking,
            bytes: BYTES,
            cores,
            fifo: FIFO,
            rounds,
            warm_up: 1_000,
            pace_ns,
        };
        anyhow::Ok(Distribution::from_samples(pair::measure(program, registry, &ping_pong)?.samples))
    };
    let same = hop([last, last], 0, 20_000)?;
    // between sparse hand-overs the other core goes idle, as it does in a graph
    let cross = if first == last { None } else { Some(hop([last, first], 500_000, 3_000)?) };
    Ok(Floor {
        wake_ns,
        hop_same_core_ns: [same.p50, same.p99],
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
    /// Adds the overhead of steps measured in a run of a graph.
    pub(super) fn overheads(&self, plan: &Plan, report: &Report) -> Overheads {
        let besides = plan.components.iter().zip(&report.components).enumerate();
        let besides: Vec<Beside> = besides
            .filter(|(_, (_, measured))| measured.steps > 0)
            .map(|(index, (_, measured))| Beside {
                release: Released::classify(plan, index),
                ns: [
                    measured.cpu_ns.p50.saturating_sub(measured.execution_ns.p50),
                    measured.cpu_ns.p99.saturating_sub(measured.execution_ns.p99),
                ],
            })
            .collect();
        let (worker_ns, timer_ns) = split(&besides, self.hop_same_core_ns);
        let microsecond = |ns: u64| ns.div_ceil(1_000) * 1_000;
        Overheads {
            wake_ns: microsecond(self.wake_ns),
            timer_ns: microsecond(timer_ns),
            hop_same_core_ns: microsecond(self.hop_same_core_ns[1]),
            hop_cross_core_ns: microsecond(self.hop_cross_core_ns),
            worker_ns: microsecond(worker_ns),
            ..Overheads::default()
        }
    }
}

/// Release of a component, as far as it affects the cost of a step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Released {
    Clock,
    SameCore,
    OtherCore,
}

impl Released {
    fn classify(plan: &Plan, component: usize) -> Self {
        match plan.components[component].activation {
            // the kernel wakes both, and both bear the cost
            Activation::Periodic { .. } | Activation::Descriptor { .. } => Self::Clock,
            Activation::Triggered { topic, .. } if plan.stays_on_core(topic) => Self::SameCore,
            Activation::Triggered { .. } => Self::OtherCore,
        }
    }
}

/// Processor time of a component's steps minus their execution time, ns, p50 and p99.
#[derive(Debug, Clone, Copy)]
struct Beside {
    release: Released,
    ns: [u64; 2],
}

/// Returns the cost of the worker per step, and the additional cost of a release by the clock: the maximum
/// over components, at p50 or p99, whichever is larger. `hop` is the duration of a hand-over on a core, p50
/// and p99.
fn split(besides: &[Beside], hop: [u64; 2]) -> (u64, u64) {
    let most = |release: Released, less: [u64; 2]| {
        let of = besides.iter().filter(|beside| beside.release == release);
        of.flat_map(|beside| [0, 1].map(|at| beside.ns[at].saturating_sub(less[at]))).max()
    };
    let cautious = Overheads::CAUTIOUS;
    let clock = most(Released::Clock, [0; 2]);
    let worker = most(Released::SameCore, hop)
        .or_else(|| most(Released::OtherCore, [cautious.look_ns; 2]))
        // all components are released by the clock, so the two cannot be separated
        .unwrap_or_else(|| cautious.worker_ns.min(clock.unwrap_or(cautious.worker_ns)))
        .max(1);
    (worker, clock.map_or(cautious.timer_ns, |clock| clock.saturating_sub(worker)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn beside(release: Released, p50_us: u64, p99_us: u64) -> Beside {
        Beside { release, ns: [p50_us * 1_000, p99_us * 1_000] }
    }

    #[test]
    fn worker_overhead_is_separate_from_hop_and_timer() {
        let graph = [
            beside(Released::Clock, 28, 55),
            beside(Released::SameCore, 7, 13),
            beside(Released::SameCore, 6, 15),
            beside(Released::OtherCore, 30, 40),
        ];
        assert_eq!(split(&graph, [3_000, 5_000]), (10_000, 45_000));
    }

    #[test]
    fn short_tail_does_not_hide_the_cost() {
        assert_eq!(split(&[beside(Released::SameCore, 9, 8)], [3_000, 5_000]).0, 6_000);
    }

    #[test]
    fn split_sums_match_the_total_without_triggers() {
        let (worker, timer) = split(&[beside(Released::Clock, 28, 55)], [3_000, 5_000]);
        assert_eq!((worker, worker + timer), (Overheads::CAUTIOUS.worker_ns, 55_000));
        assert_eq!(split(&[beside(Released::Clock, 2, 5)], [3_000, 5_000]), (5_000, 0));
    }
}
