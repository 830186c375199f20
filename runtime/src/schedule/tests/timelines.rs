//! The timeline of a hyperperiod.

use proptest::prelude::*;

use super::graphs::{Node, When, graph, node};
use super::stepwise::{Chance, Machine};
use crate::schedule::{Activity, Lane, Overheads, Timeline, timeline};

const MS: u64 = 1_000_000;

fn drawn_timeline(nodes: &[Node], spin_ns: u64, longest_ns: u64) -> Timeline {
    timeline(&graph(nodes, spin_ns, &[]), &Overheads::NONE, longest_ns)
}

fn spans(lane: &Lane) -> Vec<(u64, u64)> {
    lane.segments.iter().map(|segment| (segment.start_ns, segment.end_ns)).collect()
}

#[test]
fn chain_runs_in_order_and_spins_before_its_release() {
    let nodes = [node("head", When::Every(100, 20), 30), node("tail", When::After(0), 25)];
    let drawn = drawn_timeline(&nodes, 10, MS);
    assert_eq!((drawn.length_ns, drawn.hyperperiod_ns), (100, Some(100)));
    let [core] = drawn.cores.as_slice() else { panic!("one core") };
    assert_eq!(spans(&core.lanes[0]), [(10, 20), (20, 50)]);
    assert_eq!(core.lanes[0].segments[0].activity, Activity::Spin);
    assert_eq!(core.lanes[0].releases_ns, [20]);
    assert_eq!(spans(&core.lanes[1]), [(50, 75)]);
    assert_eq!(core.idle_ns(drawn.length_ns), 35);
    assert!(drawn.notes.is_empty(), "{:?}", drawn.notes);
}

#[test]
fn urgent_tasks_preempt_and_equals_wait() {
    let nodes = [
        node("fast", When::Every(20, 0), 5).priority(90),
        node("slow", When::Every(60, 2), 20).priority(50),
        node("equal", When::Every(60, 1), 4).priority(50),
    ];
    let drawn = drawn_timeline(&nodes, 0, MS);
    let lanes = &drawn.cores[0].lanes;
    assert_eq!(spans(&lanes[0]), [(0, 5), (20, 25), (40, 45)]);
    assert_eq!(lanes[1].component, "slow");
    assert_eq!(spans(&lanes[2]), [(5, 9)]);
    assert_eq!(spans(&lanes[1]), [(9, 20), (25, 34)]);
}

#[test]
fn events_are_drawn_at_their_minimum_interval() {
    let nodes =
        [node("bus", When::OnEvents(40), 5).priority(90), node("slow", When::Every(80, 2), 40).priority(50)];
    let drawn = drawn_timeline(&nodes, 0, MS);
    let lanes = &drawn.cores[0].lanes;
    assert_eq!((spans(&lanes[0]), &lanes[0].releases_ns), (vec![(0, 5), (40, 45)], &vec![0, 40]));
    assert_eq!(spans(&lanes[1]), [(5, 40), (45, 50)]);
    assert_eq!(
        drawn.notes,
        ["released by events, drawn as if they came as often as `min_interval` allows: `bus`"]
    );
}

#[test]
fn spinning_before_time_zero_is_drawn_at_the_end() {
    let drawn = drawn_timeline(&[node("head", When::Every(100, 0), 30)], 10, MS);
    assert_eq!(spans(&drawn.cores[0].lanes[0]), [(0, 30), (90, 100)]);
}

#[test]
fn other_core_begins_after_its_wake_up() {
    let nodes = [node("head", When::Every(100, 0), 30), node("tail", When::After(0), 25).core(2)];
    let overheads = Overheads { hop_cross_core_ns: 7, ..Overheads::NONE };
    let drawn = timeline(&graph(&nodes, 0, &[]), &overheads, MS);
    assert_eq!(spans(&drawn.cores[1].lanes[0]), [(37, 62)]);
    assert_eq!(drawn.cores[1].lanes[0].releases_ns, [37]);
}

#[test]
fn late_step_is_marked() {
    // the first job of the second ends after 114 (J. Lehoczky 1990)
    let nodes = [
        node("fast", When::Every(70, 0), 26).priority(90),
        node("slow", When::Every(100, 0), 62).priority(50),
    ];
    let drawn = drawn_timeline(&nodes, 0, MS);
    assert!(drawn.cores[0].lanes[0].late_ns.is_empty());
    assert!(drawn.cores[0].lanes[1].late_ns.contains(&114), "{:?}", drawn.cores[0].lanes[1].late_ns);
    assert!(drawn.notes.is_empty());
}

#[test]
fn core_that_cannot_keep_up_is_drawn_and_named() {
    let nodes =
        [node("a", When::Every(20, 0), 12).priority(90), node("b", When::Every(20, 0), 12).priority(50)];
    let drawn = drawn_timeline(&nodes, 0, MS);
    assert_eq!(drawn.cores[0].idle_ns(drawn.length_ns), 0);
    assert_eq!(drawn.notes, ["core 1 cannot keep up: it falls further behind than the timeline shows"]);
}

#[test]
fn long_hyperperiods_are_cut_and_omissions_are_noted() {
    let nodes = [
        node("a", When::Every(1_000_000, 0), 1_000),
        node("b", When::Every(999_983, 0), 1_000),
        node("c", When::After(0), 1).no_budget(),
        node("d", When::Every(MS, 0), 1).not_realtime(),
    ];
    let drawn = drawn_timeline(&nodes, 0, 10 * MS);
    assert_eq!(drawn.length_ns, 10 * MS);
    assert_eq!(
        drawn.notes,
        [
            "only the first 10 ms of a hyperperiod of 999.983 s are shown",
            "no budget, drawn with zero length: `c`",
            "not real-time, not drawn: `d`",
        ]
    );
    let primes = [999_999_999_989, 999_999_999_961, 999_999_999_959];
    let nodes: Vec<Node> = primes.iter().map(|period| node("p", When::Every(*period, 0), 1)).collect();
    let drawn = drawn_timeline(&nodes, 0, MS);
    assert_eq!((drawn.hyperperiod_ns, drawn.length_ns), (None, MS));
}

proptest! {
    /// The unit-by-unit simulation keeps the core busy for the same time.
    #[test]
    fn two_simulations_agree(
        set in proptest::collection::vec((prop::sample::select(vec![20u64, 40, 80]), 0u64..20, 1u64..6, 40u8..44), 1..5),
        followers in proptest::collection::vec((any::<prop::sample::Index>(), 1u64..4), 0..4),
    ) {
        let mut nodes: Vec<Node> = set
            .iter()
            .map(|(period, phase, cost, priority)| node("n", When::Every(*period, *phase), *cost).priority(*priority))
            .collect();
        for (writer, cost) in followers {
            let writer = writer.index(nodes.len());
            let mut next = nodes[writer].clone();
            (next.when, next.budget_ns) = (When::After(writer), Some(cost));
            nodes.push(next);
        }
        let drawn = drawn_timeline(&nodes, 0, MS);
        let late = drawn.cores[0].lanes.iter().any(|lane| !lane.late_ns.is_empty());
        // on an overloaded core the least urgent task may never finish
        let keeps_up = drawn.notes.is_empty();
        prop_assume!(keeps_up && !late && drawn.hyperperiod_ns == Some(drawn.length_ns));
        let length = drawn.length_ns as i64;
        let busy = 1.0 - drawn.cores[0].idle_ns(drawn.length_ns) as f64 / length as f64;
        let once = Machine::new(&nodes, 0, Overheads::NONE, Chance::None, 0).run(100 * length).busy[&1];
        // the first of a hundred hyperperiods is incomplete because of phases
        prop_assert!((busy - once).abs() <= 0.02, "{busy} {once}");
    }
}
