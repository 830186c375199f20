//! A simulated machine never exceeds the bounds of the analysis, and reaches them if nothing is uncertain.

use proptest::prelude::*;

use super::graphs::{Node, When, graph, node};
use super::stepwise::{Chance, Machine, Seen};
use crate::plan::{OnOverrun, SchedulingClass, Spin};
use crate::schedule::{Admission, Overheads, RtLimit, Verdict, admit};

/// A small graph: chains of components that trigger one another, on two cores, in units of 1 ns.
#[derive(Debug, Clone)]
struct Case {
    nodes: Vec<Node>,
    spin: u64,
    tuned: bool,
    overheads: Overheads,
    latencies: Vec<(usize, usize, u64)>,
    seed: u64,
}

fn overheads() -> impl Strategy<Value = Overheads> {
    (0u64..6, 0u64..3, 0u64..2, 0u64..8, 0u64..3, 0u64..3).prop_map(
        |(wake_ns, timer_ns, hop_same_core_ns, hop_cross_core_ns, look_ns, worker_ns)| Overheads {
            wake_ns,
            timer_ns,
            hop_same_core_ns,
            hop_cross_core_ns,
            look_ns,
            worker_ns,
        },
    )
}

fn policy() -> impl Strategy<Value = OnOverrun> {
    prop_oneof![
        4 => Just(OnOverrun::Skip),
        1 => Just(OnOverrun::CatchUp),
        1 => Just(OnOverrun::Rephase),
    ]
}

/// A component after the first of its chain: the component that triggers it, its cost, whether it is on
/// another core, and another priority.
type Follower = (prop::sample::Index, u64, bool, Option<u8>);

fn follower() -> impl Strategy<Value = Follower> {
    (any::<prop::sample::Index>(), 1u64..6, prop::bool::weighted(0.25), prop::option::weighted(0.25, 1u8..4))
}

/// One chain: period, or shortest time between events, phase, cost, core, priority, policy, whether it reads
/// an earlier chain and whether events release it, followers.
type Chain = (u64, u64, u64, usize, u8, OnOverrun, (bool, bool), Vec<Follower>);

fn chain() -> impl Strategy<Value = Chain> {
    (
        prop::sample::select(vec![20u64, 30, 40, 60, 80, 33]),
        0u64..20,
        1u64..10,
        0usize..2,
        1u8..4,
        policy(),
        (any::<bool>(), prop::bool::weighted(0.3)),
        proptest::collection::vec(follower(), 0..4),
    )
}

fn case() -> impl Strategy<Value = Case> {
    let chains = proptest::collection::vec((chain(), any::<bool>()), 1..4);
    let spin = (0u64..6, any::<bool>());
    (chains, spin, overheads(), any::<u64>()).prop_map(|(chains, (spin, tuned), overheads, seed)| {
        let mut nodes: Vec<Node> = Vec::new();
        let mut latencies = Vec::new();
        // origin of the data that a component forwards
        let mut origin: Vec<usize> = Vec::new();
        for (chain, rises) in chains {
            let (period, phase, cost, core, priority, on_overrun, (reads, on_events), followers) = chain;
            let head = nodes.len();
            let when = if on_events { When::OnEvents(period) } else { When::Every(period, phase % period) };
            let mut first = node(&format!("n{head}"), when, cost).core(core).priority(10 * priority);
            first.on_overrun = if on_events { OnOverrun::Skip } else { on_overrun };
            origin.push(head);
            if reads && head > 0 {
                first = first.reading(head - 1);
                origin[head] = origin[head - 1];
                latencies.push((origin[head], head, u64::MAX / 2));
            }
            nodes.push(first);
            for (writer, cost, leaves, priority) in followers {
                let index = nodes.len();
                let writer = head + writer.index(index - head);
                let mut next = nodes[writer].clone();
                next.reads = None;
                next.on_overrun = OnOverrun::Skip;
                (next.name, next.when, next.budget_ns) =
                    (format!("n{index}"), When::After(writer), Some(cost));
                next.core = next.core.map(|core| if leaves { 1 - core } else { core });
                let rise = if rises && !leaves { next.rise + 1 } else { 0 };
                nodes.push(match priority {
                    Some(priority) => next.rising(0).priority(10 * priority),
                    None => next.rising(rise),
                });
                origin.push(origin[head]);
                latencies.push((origin[head], index, u64::MAX / 2));
            }
        }
        let nodes = lowered(nodes);
        Case { nodes, spin, tuned, overheads, latencies, seed }
    })
}

/// Removes rising priorities after components that also wake another core.
fn lowered(mut nodes: Vec<Node>) -> Vec<Node> {
    for index in 0..nodes.len() {
        let When::After(writer) = nodes[index].when else { continue };
        let here = |node: &Node| match node.when {
            When::After(other) if other == writer => node.core == nodes[writer].core,
            _ => true,
        };
        if nodes[index].rise > 0 {
            let rise = if nodes.iter().all(here) { nodes[writer].rise + 1 } else { 0 };
            nodes[index] = nodes[index].clone().rising(rise);
        }
    }
    nodes
}

impl Case {
    fn admit(&self) -> Admission {
        let mut plan = graph(&self.nodes, self.spin, &self.latencies);
        for component in plan.components.iter_mut().filter(|_| self.tuned) {
            component.spin = Spin::Tuned { at_most_ns: component.spin.at_most_ns() };
        }
        admit(&plan, &self.overheads, RtLimit::NONE)
    }

    fn play(&self, chance: Chance, length: i64) -> Seen {
        Machine::new(&self.nodes, self.spin, self.overheads, chance, self.seed).tuned(self.tuned).run(length)
    }
}

#[test]
fn equal_task_may_interrupt_a_chain_more_than_once() {
    let nodes = [
        node("head", When::Every(400, 0), 60),
        node("second", When::After(0), 30),
        node("third", When::After(1), 30),
        node("far", When::Every(90, 4), 1).core(2),
        node("equal", When::After(3), 10),
    ];
    let admission = admit(&graph(&nodes, 0, &[(0, 2, 1_000)]), &Overheads::NONE, RtLimit::NONE);
    let seen = Machine::new(&nodes, 0, Overheads::NONE, Chance::None, 0).run(10_000);
    assert_eq!(seen.latency[&(0, 2)], 80);
    assert_eq!(admission.latencies[0].bound_ns, Some(80), "{}", admission.latencies[0].arithmetic);
    assert_eq!(
        admission.latencies[0].arithmetic,
        "30 ns (second) + 30 ns (third) + 2 x 10 ns (equal) = 80 ns <= 1 us"
    );
}

#[test]
fn equal_task_does_not_interrupt_a_rising_chain() {
    let nodes = [
        node("head", When::Every(400, 0), 60),
        node("second", When::After(0), 30).rising(1),
        node("third", When::After(1), 30).rising(2),
        node("equal", When::Every(90, 5), 10),
    ];
    let seen = Machine::new(&nodes, 0, Overheads::NONE, Chance::None, 0).run(10_000);
    assert_eq!(seen.latency[&(0, 2)], 60);
    let admission = admit(&graph(&nodes, 0, &[(0, 2, 1_000)]), &Overheads::NONE, RtLimit::NONE);
    assert!(admission.latencies[0].bound_ns.is_some_and(|bound| (60..=80).contains(&bound)));
    assert!(admission.tasks[..3].iter().all(|task| task.released_with == "head"));
}

#[test]
fn any_triggered_task_may_run_last_if_priorities_rise() {
    let nodes = [
        node("head", When::Every(400, 0), 10),
        node("left", When::After(0), 20).rising(1),
        node("right", When::After(0), 30).rising(1),
        node("below left", When::After(1), 40).rising(2),
    ];
    let admission = admit(&graph(&nodes, 0, &[]), &Overheads::NONE, RtLimit::NONE);
    let responses: Vec<_> = admission.tasks.iter().map(|task| task.response_ns).collect();
    assert_eq!(responses, [Some(10), Some(100), Some(100), Some(100)]);
    let seen = Machine::new(&nodes, 0, Overheads::NONE, Chance::None, 0).run(10_000);
    assert_eq!(seen.response, [10, 30, 100, 70], "below left comes before right");
}

#[test]
fn events_at_the_minimum_interval_reach_the_bounds() {
    let nodes = [
        node("bus", When::OnEvents(50), 10).priority(90),
        node("decoder", When::After(0), 5).rising(0).priority(90),
        node("slow", When::Every(200, 0), 60).priority(50),
    ];
    let overheads = Overheads { wake_ns: 4, ..Overheads::NONE };
    let admission = admit(&graph(&nodes, 0, &[(0, 1, 100)]), &overheads, RtLimit::NONE);
    assert_eq!(admission.verdict, Verdict::Holds, "{:?}", admission.problems);
    let responses: Vec<_> = admission.tasks.iter().map(|task| task.response_ns).collect();
    // the third event may be late when the window opens, so the fourth follows soon: 4 jobs of 15 in addition
    // to the 60
    assert_eq!(responses, [Some(14), Some(19), Some(94)], "{:?}", admission.tasks);
    assert_eq!(admission.tasks[0].arithmetic, "10 ns (bus) + 4 ns (released late) = 14 ns <= 50 ns");
    assert_eq!(admission.latencies[0].bound_ns, Some(5));
    let seen = Machine::new(&nodes, 0, Overheads::NONE, Chance::None, 0).run(2_000);
    assert_eq!((seen.response, seen.latency[&(0, 1)]), (vec![10, 15, 90], 5));
}

#[test]
fn age_of_event_data_read_at_a_rate_is_unbounded() {
    let nodes = [node("goal", When::OnEvents(500), 10), node("policy", When::Every(100, 0), 10).reading(0)];
    let admission = admit(&graph(&nodes, 0, &[(0, 1, 1_000)]), &Overheads::NONE, RtLimit::NONE);
    assert_eq!((admission.verdict, admission.latencies[0].bound_ns), (Verdict::NotProvable, None));
    assert_eq!(
        admission.latencies[0].arithmetic,
        "`goal` steps when events come, which may be arbitrarily rare: no bound"
    );
    assert!(
        admission.problems[0].advice.contains("let the components on its path trigger"),
        "{:?}",
        admission.problems
    );
}

/// Returns the bound and the simulated response of "late", one of two equals that are released one after the
/// other below a more urgent task.
fn late_behind_an_urgent(equal: [Node; 2]) -> (u64, i64) {
    let [far, equal] = equal;
    let nodes = [
        node("urgent", When::Every(100, 0), 20).priority(90),
        node("late", When::Every(100, 2), 5),
        far,
        equal,
    ];
    let admission = admit(&graph(&nodes, 0, &[]), &Overheads::NONE, RtLimit::NONE);
    let seen = Machine::new(&nodes, 0, Overheads::NONE, Chance::None, 0).run(1_000);
    (admission.tasks[1].response_ns.unwrap(), seen.response[1])
}

#[test]
fn task_waiting_for_the_clock_yields_to_triggered_ones() {
    let far = node("far", When::Every(100, 3), 7).core(2);
    // released at 2, triggered at 10; both wait until 20
    assert_eq!(late_behind_an_urgent([far.clone(), node("equal", When::After(2), 10)]), (33, 33));
    // two tasks that wait for the clock keep their order
    assert_eq!(late_behind_an_urgent([far, node("equal", When::Every(100, 10), 10)]), (23, 23));
}

#[test]
fn adaptive_margin_may_delay_queueing_to_the_release() {
    let nodes = [node("own", When::Every(100, 50), 5), node("equal", When::Every(100, 40), 10)];
    let mut plan = graph(&nodes, 20, &[]);
    // spinning from 30 to 50, it runs before its equal, which spins from 20 to 40 unless its margin adapts
    plan.components[1].spin = Spin::Fixed { ns: 0 };
    let overheads = Overheads { wake_ns: 5, ..Overheads::NONE };
    let response = |plan: &crate::plan::Plan| admit(plan, &overheads, RtLimit::NONE).tasks[0].response_ns;
    assert_eq!(response(&plan), Some(5));
    plan.components[0].spin = Spin::Tuned { at_most_ns: 20 };
    assert_eq!(response(&plan), Some(15));
}

proptest! {
    #[test]
    fn no_response_is_ever_longer_than_its_bound(case in case(), mid in any::<bool>()) {
        let admission = case.admit();
        let chance = if mid { Chance::TimesAndPublications } else { Chance::Times };
        let seen = case.play(chance, 4_000);
        for (index, task) in admission.tasks.iter().enumerate() {
            if let (Some(response), Some(chain)) = (task.response_ns, task.chain_ns) {
                prop_assert!(
                    seen.response[index] <= response as i64,
                    "{} took {} from its release: {}", task.component, seen.response[index], task.arithmetic
                );
                prop_assert!(
                    seen.chain[index] <= chain as i64,
                    "{} took {} from the release of its chain, bound {chain}: {}",
                    task.component, seen.chain[index], task.arithmetic
                );
            }
        }
        for core in &admission.cores {
            let busy = seen.busy[&core.core];
            // a period at each end may be truncated
            prop_assert!(busy <= core.share + 0.05, "core {} was busy for {busy}: {}", core.core, core.arithmetic);
        }
    }

    #[test]
    fn no_latency_is_ever_longer_than_its_bound(case in case()) {
        let admission = case.admit();
        // readers of components that skip releases read older data
        prop_assume!(admission.tasks.iter().all(|task| task.verdict == Verdict::Holds));
        let seen = case.play(Chance::Times, 4_000);
        for (latency, (from, to, _)) in admission.latencies.iter().zip(&case.latencies) {
            // the age of event data read at a rate is unbounded
            if latency.verdict == Verdict::NotProvable && latency.arithmetic.contains("when events come") {
                continue;
            }
            let longest = seen.latency.get(&(*from, *to)).copied().unwrap_or(0);
            prop_assert!(
                latency.bound_ns.is_some_and(|bound| longest <= bound as i64),
                "{} -> {} took {longest}: {}", latency.from, latency.to, latency.arithmetic
            );
        }
    }

    /// For independent tasks on one clock that use up their budgets, the bounds are exact. Equals are never
    /// released simultaneously, because their order would be unknown.
    #[test]
    fn bounds_of_independent_tasks_with_phases_are_exact(
        set in proptest::collection::vec(
            (prop::sample::select(vec![20u64, 30, 40, 60]), 0u64..2, 1u64..9, 0u8..3),
            1..6,
        ),
    ) {
        let nodes: Vec<Node> = set
            .iter()
            .enumerate()
            .map(|(index, (period, phase, cost, priority))| {
                let phase = 10 * phase + 2 * index as u64;
                node(&format!("n{index}"), When::Every(*period, phase), *cost).priority(50 + priority)
            })
            .collect();
        let utilisation: f64 = set.iter().map(|(period, _, cost, _)| *cost as f64 / *period as f64).sum();
        prop_assume!(utilisation <= 1.0);
        let admission = admit(&graph(&nodes, 0, &[]), &Overheads::NONE, RtLimit::NONE);
        // bounds are only exact if jobs end before the next ones are released; otherwise, releases are
        // skipped
        prop_assume!(!admission.refuses());
        let seen = Machine::new(&nodes, 0, Overheads::NONE, Chance::None, 0).run(1_000);
        let bounds: Vec<i64> = admission.tasks.iter().map(|task| task.response_ns.unwrap() as i64).collect();
        prop_assert_eq!(bounds, seen.response);
    }
}

proptest! {
    // every case tests all phases
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Two equals below a more urgent task with unknown phases, some of which reach the bound.
    #[test]
    fn bounds_of_equals_are_exact(
        above in (prop::sample::select(vec![8u64, 9, 10, 12]), 1u64..5),
        equal in (prop::sample::select(vec![8u64, 9, 10, 12]), 1u64..5),
        own in (prop::sample::select(vec![9u64, 12, 18, 24]), 1u64..7),
    ) {
        let nodes = |equal_phase: u64, own_phase: u64| -> Vec<Node> {
            let mut nodes = vec![
                node("above", When::Every(above.0, 0), above.1).priority(60),
                node("equal", When::Every(equal.0, equal_phase), equal.1),
                node("own", When::Every(own.0, own_phase), own.1),
            ];
            nodes[1..].iter_mut().for_each(|node| node.class = SchedulingClass::Fifo(50));
            nodes
        };
        let mut anywhere = nodes(0, 0);
        anywhere.iter_mut().for_each(|node| node.on_overrun = OnOverrun::Rephase);
        let admission = admit(&graph(&anywhere, 0, &[]), &Overheads::NONE, RtLimit::NONE);
        prop_assume!(!admission.refuses());
        let mut longest = 0;
        for equal_phase in 0..equal.0 {
            for own_phase in 0..own.0 {
                let nodes = nodes(equal_phase, own_phase);
                let seen = Machine::new(&nodes, 0, Overheads::NONE, Chance::None, 0).run(250);
                longest = longest.max(seen.response[2]);
            }
        }
        prop_assert_eq!(admission.tasks[2].response_ns, Some(longest as u64), "{}", admission.tasks[2].arithmetic);
    }
}
