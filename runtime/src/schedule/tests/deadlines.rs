//! `SCHED_DEADLINE` components and their effect on lower classes.

use proptest::prelude::*;

use super::graphs::{Node, When, graph, node};
use super::stepwise::{Chance, Machine};
use crate::schedule::analysis::global::{Global, Reserved};
use crate::schedule::{Activity, Admission, Overheads, RtLimit, Verdict, admit};

const US: u64 = 1_000;
const KHZ: When = When::Every(1_000 * US, 0);

fn set(reserved: &[(i64, i64)]) -> Vec<Reserved> {
    reserved.iter().map(|(runtime, period)| Reserved { runtime: *runtime, period: *period }).collect()
}

/// Returns the response times of reservations (run time, period) on a number of cores.
fn responses(reserved: &[(i64, i64)], cores: usize) -> Vec<Option<i64>> {
    let global = Global::analyse(set(reserved), cores, 0);
    (0..reserved.len()).map(|index| global.response(index, reserved[index].0)).collect()
}

#[test]
fn earliest_deadline_first_uses_exactly_one_core() {
    // C. Liu, J. Layland 1973: utilisation 1 is enough and necessary
    assert!(responses(&[(2, 5), (4, 10), (2, 10)], 1).iter().all(Option::is_some));
    assert!(responses(&[(2, 5), (4, 10), (3, 10)], 1).iter().all(Option::is_none));
}

#[test]
fn long_task_among_many_short_ones_may_be_late() {
    // S. Dhall, C. Liu, *On a real-time scheduling problem*, 1978: short tasks have earlier deadlines and run
    // on all cores first, so the long task no longer fits
    let short = (2, 100);
    assert_eq!(responses(&[short, short, (100, 101)], 2), [None; 3]);
    // one core each
    assert_eq!(responses(&[short, (100, 101)], 2), [Some(2), Some(100)]);
    assert!(responses(&[short, short, (99, 101)], 2).iter().all(Option::is_some));
}

#[test]
fn reservations_up_to_the_number_of_cores_never_wait() {
    assert_eq!(responses(&[(7, 10), (19, 20), (1, 5)], 3), [Some(7), Some(19), Some(1)]);
}

#[test]
fn low_density_is_admitted_by_the_density_test() {
    // J. Goossens, S. Funk, S. Baruah 2003: 2 cores, largest density 0.5, sum 1.5 <= 2 - 0.5
    let set = [(5, 10), (10, 20), (15, 30)];
    assert!(responses(&set, 2).iter().all(Option::is_some));
}

#[test]
fn only_the_run_time_is_guaranteed() {
    let global = Global::analyse(set(&[(5, 10)]), 2, 0);
    assert_eq!((global.response(0, 3), global.response(0, 6)), (Some(3), None));
}

fn check(nodes: &[Node], overheads: &Overheads) -> Admission {
    admit(&graph(nodes, 0, &[]), overheads, RtLimit::KERNEL_DEFAULT)
}

#[test]
fn sum_of_a_priority_contains_every_deadline_component() {
    let nodes = [
        node("loop", KHZ, 300 * US),
        node("vision", When::Every(2_000 * US, 0), 200 * US).by_deadline(200 * US, 50 * US),
        node("map", When::Every(4_000 * US, 0), 100 * US).by_deadline(100 * US, 50 * US),
    ];
    let admission = check(&nodes, &Overheads::NONE);
    assert_eq!(admission.verdict, Verdict::Holds);
    assert_eq!(admission.tasks[0].response_ns, Some((300 + 250 + 150) * US));
    assert_eq!(
        admission.tasks[0].arithmetic,
        "300 us (loop) + 250 us (vision by its deadline) + 150 us (map by its deadline) = 700 us <= 1 ms"
    );
    assert_eq!(admission.tasks[1].response_ns, Some(200 * US));
    assert_eq!(admission.cores[0].terms.iter().filter(|term| term.activity == Activity::Reserved).count(), 2);
    let deadlines = admission.deadlines.unwrap();
    assert_eq!((deadlines.cores, deadlines.verdict), (2, Verdict::Holds));
    assert_eq!(deadlines.arithmetic, "0.125 (vision) + 0.037 (map) = 0.163 <= 2 x 0.9");
}

#[test]
fn component_triggered_by_a_deadline_starts_at_its_bound() {
    let overheads = Overheads { wake_ns: 40 * US, hop_cross_core_ns: 30 * US, ..Overheads::NONE };
    let nodes = [
        node("camera", KHZ, 200 * US).by_deadline(200 * US, 50 * US),
        node("loop", When::After(0), 100 * US),
    ];
    let plan = graph(&nodes, 0, &[(0, 1, 500 * US)]);
    let admission = admit(&plan, &overheads, RtLimit::KERNEL_DEFAULT);
    assert_eq!(admission.tasks[0].response_ns, Some(240 * US), "{}", admission.tasks[0].arithmetic);
    assert_eq!(admission.tasks[0].arithmetic, "200 us (camera) + 40 us (released late) = 240 us <= 1 ms");
    // the camera has 250 us, so that it may still have the core until 290 us after its release, 20 us beyond
    // the 270 us at which the loop is triggered at the latest
    assert_eq!(admission.tasks[1].chain_ns, Some((290 + 100) * US), "{}", admission.tasks[1].arithmetic);
    assert_eq!(admission.latencies[0].bound_ns, Some(390 * US), "{}", admission.latencies[0].arithmetic);
    assert_eq!(admission.latencies[0].verdict, Verdict::Holds);
    let less = admit(&graph(&nodes, 0, &[(0, 1, 380 * US)]), &overheads, RtLimit::KERNEL_DEFAULT);
    assert_eq!(less.latencies[0].verdict, Verdict::Exceeds);
}

#[test]
fn excess_deadline_bandwidth_is_refused_with_its_sum() {
    let nodes = [
        node("a", KHZ, 650 * US).by_deadline(650 * US, 0),
        node("b", KHZ, 650 * US).by_deadline(650 * US, 0),
        node("c", KHZ, 650 * US).by_deadline(650 * US, 0),
        node("loop", KHZ, 1),
    ];
    let admission = check(&nodes, &Overheads::NONE);
    assert!(admission.refuses());
    let problem =
        admission.refusals().find(|problem| problem.message.contains("under `SCHED_DEADLINE`")).unwrap();
    let arithmetic = problem.arithmetic.as_deref().unwrap();
    assert_eq!(arithmetic, "all cores: 0.650 (a) + 0.650 (b) + 0.650 (c) = 1.950 > 2 x 0.9");
}

#[test]
fn step_longer_than_its_reservation_is_refused() {
    let overheads = Overheads { worker_ns: 60 * US, ..Overheads::NONE };
    let admission = check(&[node("a", KHZ, 200 * US).by_deadline(200 * US, 50 * US)], &overheads);
    assert_eq!(admission.tasks[0].verdict, Verdict::Exceeds);
    assert_eq!(admission.tasks[0].arithmetic, "260 us > 250 us that the kernel grants");
}

/// A component scheduled by deadline or by priority: period, phase, cost, spare run time or priority, core.
type Any = (u64, u64, u64, Result<u64, u8>, usize);

fn any_node() -> impl Strategy<Value = Any> {
    let class = prop_oneof![(0u64..3).prop_map(Ok), (1u8..4).prop_map(Err)];
    (prop::sample::select(vec![12u64, 20, 30, 33, 40]), 0u64..20, 1u64..9, class, 0usize..2)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// With deadlines on all cores and priorities below, no response exceeds its bound.
    #[test]
    fn no_response_with_deadlines_exceeds_its_bound(
        set in proptest::collection::vec(any_node(), 2..6),
        follows in proptest::collection::vec(1u64..4, 0..4),
        wake_ns in 0u64..4,
        hop_cross_core_ns in 0u64..4,
        hop_same_core_ns in 0u64..2,
        (worker_ns, timer_ns, look_ns) in (0u64..2, 0u64..2, 0u64..3),
        seed in any::<u64>(),
    ) {
        let overheads = Overheads { wake_ns, timer_ns, hop_same_core_ns, hop_cross_core_ns, look_ns, worker_ns };
        let mut nodes: Vec<Node> = set
            .iter()
            .enumerate()
            .map(|(index, (period, phase, cost, class, core))| {
                let node = node(&format!("n{index}"), When::Every(*period, phase % period), *cost).core(*core);
                match class {
                    Ok(room) => node.by_deadline(cost + worker_ns + timer_ns, *room),
                    Err(priority) => node.priority(10 * priority),
                }
            })
            .collect();
        // a chain with rising priorities, triggered by the first component
        for (rise, cost) in follows.into_iter().enumerate() {
            let writer = if rise == 0 { 0 } else { nodes.len() - 1 };
            let after = node(&format!("after {rise}"), When::After(writer), cost).core(1);
            nodes.push(after.priority(20).rising(rise as u8));
        }
        let admission = admit(&graph(&nodes, 0, &[]), &overheads, RtLimit::NONE);
        let seen = Machine::new(&nodes, 0, overheads, Chance::Times, seed).run(2_000);
        for (index, task) in admission.tasks.iter().enumerate() {
            // late components skip releases, which the bounds do not cover
            if let Some(bound) = task.response_ns.filter(|_| task.verdict == Verdict::Holds) {
                prop_assert!(
                    seen.response[index] <= bound as i64,
                    "n{index} took {}: {} in {nodes:?}", seen.response[index], task.arithmetic
                );
            }
        }
    }

    /// Earliest deadline first on several cores, with every release in time and its full run time.
    #[test]
    fn admitted_deadlines_are_met(
        set in proptest::collection::vec((prop::sample::select(vec![8u64, 10, 12, 15, 20]), 1u64..12), 1..6),
        seed in any::<u64>(),
    ) {
        let mut nodes: Vec<Node> = set
            .iter()
            .enumerate()
            .map(|(index, (period, cost))| {
                let cost = *cost.min(period);
                node(&format!("n{index}"), When::Every(*period, seed.rotate_left(index as u32 * 7) % period), cost)
                    .by_deadline(cost, 0)
            })
            .collect();
        // the second core
        nodes.push(node("other", When::Every(1_000, 0), 1).priority(1));
        let admission = admit(&graph(&nodes, 0, &[]), &Overheads::NONE, RtLimit::NONE);
        let seen = Machine::new(&nodes, 0, Overheads::NONE, Chance::None, seed).run(2_000);
        for (index, task) in admission.tasks[..set.len()].iter().enumerate() {
            if let Some(bound) = task.response_ns.filter(|_| task.verdict == Verdict::Holds) {
                prop_assert!(seen.response[index] <= bound as i64, "n{index}: {}", task.arithmetic);
            }
        }
    }
}
