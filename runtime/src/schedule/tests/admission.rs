//! Verdicts and arithmetic of whole graphs.

use super::graphs::{Node, When, graph, node};
use crate::plan::{ClockKind, OnOverrun};
use crate::schedule::{Admission, Overheads, RtLimit, Verdict, admit};
use crate::severity::Severity;

const US: u64 = 1_000;
const KHZ: When = When::Every(1_000 * US, 0);

/// A machine whose costs are easy to distinguish in a sum.
const MACHINE: Overheads = Overheads {
    wake_ns: 40 * US,
    timer_ns: 0,
    hop_same_core_ns: 6 * US,
    hop_cross_core_ns: 30 * US,
    look_ns: 0,
    worker_ns: 3 * US,
};

fn every(us: u64) -> When {
    When::Every(us * US, 0)
}

/// Returns physics, encoder, policy and controller as a chain.
fn reach(controller_us: u64) -> Vec<Node> {
    vec![
        node("physics", KHZ, 400 * US),
        node("encoder", When::After(0), 50 * US),
        node("policy", When::After(1), 50 * US),
        node("controller", When::After(2), controller_us * US),
    ]
}

fn check(nodes: &[Node], latencies: &[(usize, usize, u64)]) -> Admission {
    admit(&graph(nodes, 100 * US, latencies), &MACHINE, RtLimit::KERNEL_DEFAULT)
}

fn errors(admission: &Admission) -> Vec<&str> {
    admission.refusals().map(|problem| problem.message.as_str()).collect()
}

fn warnings(admission: &Admission) -> Vec<&str> {
    let warnings = admission.problems.iter().filter(|problem| problem.severity == Severity::Warning);
    warnings.map(|problem| problem.message.as_str()).collect()
}

#[test]
fn chain_on_one_core_is_the_sum_of_steps_and_hand_overs() {
    let admission = check(&reach(300), &[(0, 3, 600 * US)]);
    assert_eq!(admission.verdict, Verdict::Holds, "{:?}", admission.problems);
    assert_eq!(
        admission.cores[0].arithmetic,
        "0.100 (physics spinning) + 0.403 (physics) + 0.059 (encoder) + 0.059 (policy) + 0.309 (controller) \
         = 0.930 <= 0.95"
    );
    let responses: Vec<_> = admission.tasks.iter().map(|task| task.response_ns.unwrap() / US).collect();
    assert_eq!(responses, [403, 462, 521, 830]);
    assert_eq!(
        admission.tasks[3].arithmetic,
        "403 us (physics) + 59 us (encoder) + 59 us (policy) + 309 us (controller) = 830 us <= 1 ms"
    );
    let latency = &admission.latencies[0];
    assert_eq!(latency.bound_ns, Some(430 * US));
    assert_eq!(latency.path, ["physics", "encoder", "policy", "controller"]);
    assert_eq!(
        latency.arithmetic,
        "3 us (physics, after it has published) + 59 us (encoder) + 59 us (policy) + 309 us (controller) = 430 us \
         <= 600 us"
    );
    // more urgent components get the core immediately
    let rising: Vec<Node> =
        reach(300).into_iter().enumerate().map(|(index, node)| node.rising(index as u8)).collect();
    let latency = &check(&rising, &[(0, 3, 600 * US)]).latencies[0];
    assert_eq!(
        latency.arithmetic,
        "59 us (encoder) + 59 us (policy) + 309 us (controller) = 427 us <= 600 us"
    );
}

#[test]
fn overloaded_core_is_refused_with_the_sum() {
    let admission = check(&reach(600), &[]);
    assert!(admission.refuses());
    assert_eq!(errors(&admission), ["core 1 is overloaded"]);
    assert_eq!(
        admission.problems[0].arithmetic.as_deref(),
        Some(
            "core 1: 0.100 (physics spinning) + 0.403 (physics) + 0.059 (encoder) + 0.059 (policy) + 0.609 \
             (controller) = 1.230 > 0.95"
        )
    );
    assert!(
        admission.tasks.iter().all(|task| task.verdict == Verdict::Exceeds && task.response_ns.is_none())
    );
}

#[test]
fn graph_the_kernel_would_throttle_is_refused_with_reason() {
    let admission = check(&reach(325), &[]);
    assert_eq!(
        errors(&admission),
        ["core 1 is overloaded: the kernel grants its real-time components less time than they need"]
    );
    assert!(admission.cores[0].arithmetic.ends_with("= 0.955 > 0.95"), "{}", admission.cores[0].arithmetic);
    let without = admit(&graph(&reach(325), 100 * US, &[]), &MACHINE, RtLimit::NONE);
    assert_eq!(without.verdict, Verdict::Holds);
}

#[test]
fn long_step_is_refused_in_spite_of_a_small_mean_load() {
    // 1.2 s in every 4 s: a third of the core, but more than 950 ms in one second
    let admission = check(&[node("planner", every(4_000_000), 1_200_000 * US)], &[]);
    assert_eq!(errors(&admission), ["the kernel may stop the real-time components of core 1 (throttling)"]);
    assert_eq!(
        admission.problems[0].arithmetic.as_deref(),
        Some("core 1, in one period of 1 s: 1 s (`planner`) > 950 ms")
    );
}

#[test]
fn slow_task_that_is_too_urgent_makes_a_fast_one_late() {
    let nodes = [
        node("control", KHZ, 200 * US).priority(50),
        node("planner", every(100_000), 5_000 * US).priority(60),
    ];
    let admission = check(&nodes, &[]);
    assert_eq!(errors(&admission), ["component `control` may still be running when its next step is due"]);
    let arithmetic = admission.problems[0].arithmetic.as_deref().unwrap();
    assert!(arithmetic.starts_with("control: 203 us (control) + 5.103 ms (planner)"), "{arithmetic}");
    assert!(arithmetic.contains("> 1 ms"), "{arithmetic}");
    // with exchanged priorities both hold
    let rate_monotonic = [nodes[0].clone().priority(60), nodes[1].clone().priority(50)];
    assert_eq!(check(&rate_monotonic, &[]).verdict, Verdict::Holds);
}

#[test]
fn late_wake_up_is_hidden_by_spinning_before_the_release() {
    let spinning = check(&[node("a", KHZ, 100 * US)], &[]);
    assert_eq!(spinning.tasks[0].response_ns, Some(103 * US));
    let sleeping = admit(&graph(&[node("a", KHZ, 100 * US)], 0, &[]), &MACHINE, RtLimit::KERNEL_DEFAULT);
    assert_eq!(sleeping.tasks[0].response_ns, Some(143 * US));
    assert_eq!(sleeping.tasks[0].arithmetic, "103 us (a) + 40 us (released late) = 143 us <= 1 ms");
}

#[test]
fn clock_wake_up_and_polling_are_part_of_the_cost() {
    let machine = Overheads { timer_ns: 20 * US, look_ns: 10 * US, ..MACHINE };
    let nodes = [
        node("sensor", KHZ, 100 * US),
        node("filter", When::After(0), 50 * US),
        node("far", When::After(0), 50 * US).core(2),
    ];
    let admission = admit(&graph(&nodes, 0, &[]), &machine, RtLimit::NONE);
    let sums: Vec<_> = admission.cores.iter().map(|core| core.arithmetic.as_str()).collect();
    assert_eq!(sums, ["0.123 (sensor) + 0.059 (filter) = 0.182 <= 1", "0.063 (far) <= 1"]);
}

#[test]
fn latency_to_another_core_includes_its_wake_up() {
    let nodes = [
        node("sensor", KHZ, 100 * US),
        node("filter", When::After(0), 50 * US).core(2),
        node("control", When::After(1), 50 * US).core(2),
    ];
    let admission = check(&nodes, &[(0, 2, 200 * US)]);
    // 30 us to the other core, 53 us of the filter there, 59 us of the controller after it
    assert_eq!(admission.latencies[0].bound_ns, Some(142 * US), "{}", admission.latencies[0].arithmetic);
    assert_eq!(
        admission.latencies[0].arithmetic,
        "30 us (to core 2) + 53 us (filter) + 59 us (control) = 142 us <= 200 us"
    );
    assert_eq!(admission.tasks[2].response_ns, Some(112 * US));
    assert_eq!(admission.tasks[2].chain_ns, Some((103 + 30 + 112) * US));
    assert_eq!(admission.tasks[2].released_with, "filter");
}

#[test]
fn time_triggered_reader_adds_the_time_until_it_reads() {
    let phased = |phase: u64| {
        let control = node("control", When::Every(1_000 * US, phase * US), 100 * US).core(2).reading(0);
        check(&[node("sensor", KHZ, 200 * US), control], &[(0, 1, 2_000 * US)]).latencies[0].clone()
    };
    // released together, it reads the sample of a period ago
    assert_eq!(phased(0).bound_ns, Some(1_103 * US));
    // released just after the sensor has finished, it reads the new sample
    assert_eq!(phased(210).bound_ns, Some(313 * US));
    assert_eq!(
        phased(210).arithmetic,
        "210 us (from the release of `sensor` until `control` reads topic/sensor) + 103 us (to the end of `control`) \
         = 313 us <= 2 ms"
    );
    // released just before that, it waits for most of a period
    assert_eq!(phased(200).bound_ns, Some(1_303 * US));
}

#[test]
fn reader_that_may_leave_the_clock_may_just_miss_the_data() {
    let mut control = node("control", When::Every(1_000 * US, 210 * US), 100 * US).core(2).reading(0);
    control.on_overrun = OnOverrun::Rephase;
    let admission = check(&[node("sensor", KHZ, 200 * US), control], &[(0, 1, 2_000 * US)]);
    assert_eq!(admission.latencies[0].bound_ns, Some(1_306 * US));
}

#[test]
fn latency_budget_that_is_too_short_is_refused() {
    let admission = check(&reach(300), &[(0, 3, 400 * US)]);
    assert_eq!(admission.latencies[0].verdict, Verdict::Exceeds);
    assert_eq!(
        errors(&admission),
        ["data may take longer from `topic/physics` to `topic/controller` than its latency budget"]
    );
}

#[test]
fn components_without_a_budget_are_named_and_not_refused() {
    let mut nodes = reach(50);
    nodes[2] = nodes[2].clone().no_budget();
    nodes.push(node("watch", every(100_000), 10 * US).priority(10));
    nodes.push(node("fast", every(500), 10 * US).priority(90));
    let admission = check(&nodes, &[(0, 3, 600 * US)]);
    assert_eq!(admission.verdict, Verdict::NotProvable);
    assert!(errors(&admission).is_empty());
    assert_eq!(
        warnings(&admission),
        ["component `policy` has no budget, so dependent response times cannot be verified"]
    );
    let verdicts: Vec<_> = admission.tasks.iter().map(|task| task.verdict).collect();
    // all components at or below its priority, but not more urgent ones
    let unknown = Verdict::NotProvable;
    assert_eq!(verdicts, [unknown, unknown, unknown, unknown, unknown, Verdict::Holds]);
    assert_eq!(admission.latencies[0].verdict, Verdict::NotProvable);
}

#[test]
fn bound_exceeded_without_the_unknown_time_is_refused() {
    let mut nodes = reach(900);
    nodes[1] = nodes[1].clone().no_budget();
    assert!(check(&nodes, &[]).refuses());
}

#[test]
fn components_that_are_not_real_time_have_no_bound() {
    let nodes = [
        node("physics", KHZ, 100 * US),
        node("logger", When::After(0), 900 * US).not_realtime(),
        node("view", every(20_000), 900 * US).not_realtime(),
    ];
    let admission = check(&nodes, &[]);
    assert_eq!(admission.verdict, Verdict::Holds);
    assert_eq!(admission.tasks[1].verdict, Verdict::BestEffort);
    assert!(admission.problems.is_empty(), "{:?}", admission.problems);
    // but a latency through them cannot be verified
    let admission = check(&nodes, &[(0, 1, 600 * US)]);
    assert_eq!(admission.verdict, Verdict::NotProvable);
    assert_eq!(
        warnings(&admission),
        ["the latency from `topic/physics` to `topic/logger` cannot be verified"]
    );
}

#[test]
fn real_time_after_best_effort_is_not_provable() {
    let nodes = [node("view", KHZ, 100 * US).not_realtime(), node("control", When::After(0), 100 * US)];
    let admission = check(&nodes, &[]);
    assert_eq!(admission.verdict, Verdict::NotProvable);
    assert_eq!(
        warnings(&admission),
        [
            "component `control` is triggered by a component that is not real-time, so dependent response times cannot be verified"
        ]
    );
}

#[test]
fn phases_separate_components_on_one_core() {
    let at = |phase: u64| {
        let nodes = [node("a", KHZ, 300 * US), node("b", When::Every(1_000 * US, phase * US), 300 * US)];
        check(&nodes, &[]).tasks.iter().map(|task| task.response_ns.unwrap() / US).collect::<Vec<_>>()
    };
    assert_eq!(at(500), [303, 303]);
    // spinning needs the core, too: `b` begins 100 us before its release
    assert_eq!(at(0), [706, 706]);
}

#[test]
fn phases_of_a_component_that_may_leave_its_grid_are_ignored() {
    let mut nodes = [node("a", KHZ, 300 * US), node("b", When::Every(1_000 * US, 500 * US), 300 * US)];
    nodes[0].on_overrun = OnOverrun::Rephase;
    let responses: Vec<_> =
        check(&nodes, &[]).tasks.iter().map(|task| task.response_ns.unwrap() / US).collect();
    assert_eq!(responses, [706, 706]);
}

#[test]
fn lockstep_has_no_deadlines() {
    let mut plan = graph(&reach(900), 100 * US, &[(0, 3, 1)]);
    plan.clock = ClockKind::Lockstep;
    let admission = admit(&plan, &MACHINE, RtLimit::KERNEL_DEFAULT);
    assert_eq!(admission.verdict, Verdict::BestEffort);
    assert!(!admission.refuses() && admission.problems.is_empty());
}
