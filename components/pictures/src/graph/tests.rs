use std::path::PathBuf;

use motorium::declare::TopicPattern;
use motorium::plan::{
    Activation, ClockKind, ComponentPlan, GateRules, LatencyPlan, LimitPolicy, OnDenied, OnError, OnFailure,
    OnMiss, OnOverrun, Plan, PortPlan, Program, RestartPlan, RestartWhen, ResumeRule, SafeState, SafetyPlan,
    SchedulingClass, SchedulingPlan, Spin, TopicPlan,
};
use motorium::state::{JointState, StateBuffer as _};

use super::layers::{Item, Layers};
use super::placement::{HEADER, Placement};
use super::wires::{Wire, wires};
use super::{Measured, dot, mermaid, svg};

/// A component that reads and writes these topics; if `trigger`, its first input wakes it.
fn component(
    index: usize,
    name: &str,
    actuator: bool,
    inputs: &[Option<usize>],
    outputs: &[usize],
    trigger: bool,
) -> ComponentPlan {
    let port = |name: String, topic: Option<usize>| PortPlan {
        port: name,
        topic,
        pattern: TopicPattern::State,
        layout: JointState::layout(),
    };
    let activation = match inputs.first().copied().flatten().filter(|_| trigger) {
        Some(topic) => Activation::Triggered { topic, input: 0, period_ns: 1_000_000 },
        None => Activation::Periodic { period_ns: 1_000_000, phase_ns: 0 },
    };
    ComponentPlan {
        name: name.to_string(),
        program: Program::Builtin { kind: format!("test.{name}") },
        cause: matches!(activation, Activation::Triggered { .. }).then_some(0),
        activation,
        budget_ns: Some(150_000),
        core: Some(1),
        spin: Spin::Fixed { ns: 100_000 },
        rise: 0,
        class: if index % 3 == 2 { SchedulingClass::Normal } else { SchedulingClass::Fifo(80) },
        inputs: inputs.iter().enumerate().map(|(i, topic)| port(format!("in{i}"), *topic)).collect(),
        outputs: outputs.iter().enumerate().map(|(i, topic)| port(format!("out{i}"), Some(*topic))).collect(),
        parameters: Vec::new(),
        config: serde_json::Value::Null,
        robot: None,
        robots: Vec::new(),
        stop_within_ns: None,
        waits_ns: 0,
        folder: Default::default(),
        actuator,
        notes: Vec::new(),
        seed: 0,
        on_overrun: OnOverrun::Skip,
        liveness: Default::default(),
        overruns_tolerated: None,
        on_error: OnError::Fail,
        on_failure: OnFailure::SafeStop,
        restart: RestartPlan { when: RestartWhen::Never, at_most: 5, window_ns: 1, within_ns: 1 },
        resets: false,
        ends_episode: false,
        begins_episodes: false,
        safety: None,
        order: index,
    }
}

fn plan(components: Vec<ComponentPlan>, latencies: &[(usize, usize)]) -> Plan {
    let count = components.iter().flat_map(|c| &c.outputs).count();
    let topics = (0..count)
        .map(|topic| {
            let writes = |c: &ComponentPlan| c.outputs.iter().any(|port| port.topic == Some(topic));
            let reads = |c: &ComponentPlan| c.inputs.iter().any(|port| port.topic == Some(topic));
            let all = |test: &dyn Fn(&ComponentPlan) -> bool| -> Vec<usize> {
                (0..components.len()).filter(|index| test(&components[*index])).collect()
            };
            TopicPlan {
                name: format!("robot/topic_{topic}"),
                pattern: TopicPattern::State,
                layout: JointState::layout(),
                writer: all(&writes)[0],
                readers: all(&reads),
                triggers: Vec::new(),
                history: 0,
            }
        })
        .collect::<Vec<_>>();
    let latencies = latencies.iter().map(|(from, to)| LatencyPlan {
        from: *from,
        to: *to,
        max_ns: 300_000,
        on_miss: OnMiss::Warn,
        component: topics[*to].writer,
        output: 0,
    });
    Plan {
        name: "drawn <here>".to_string(),
        file: PathBuf::from("drawn.toml"),
        clock: ClockKind::Realtime,
        duration_ns: None,
        episodes: None,
        seed: 0,
        components,
        latencies: latencies.collect(),
        topics,
        scheduling: SchedulingPlan { shared_cores: vec![0], on_denied: OnDenied::Warn, idle_exit_ns: 0 },
        expectations: Vec::new(),
        trace_events: 0,
        safety: SafetyPlan {
            stale_after_ns: 5_000_000,
            source_stale_after_ns: 10_000_000,
            gate: GateRules {
                safe_state: SafeState::Hold,
                limits: LimitPolicy::Clamp,
                resume: ResumeRule::Near,
            },
            settle_ns: 0,
            emergency_stop_max_age_ns: 0,
            stop_together: false,
        },
    }
}

/// A robot, its sensor, a controller triggered through both, and a separate policy.
fn control_loop() -> Plan {
    plan(
        vec![
            component(0, "physics", true, &[Some(3)], &[0], false),
            component(1, "encoder", false, &[Some(0)], &[1], true),
            component(2, "policy", false, &[None], &[2], false),
            component(3, "controller", false, &[Some(1), Some(2)], &[3], true),
        ],
        &[(0, 3)],
    )
}

/// Graphs of all shapes: up to 12 components, each reading and writing a few topics, with loops.
fn some_graph(seed: u64) -> Plan {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut below = |bound: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) as usize) % bound
    };
    let count = 1 + below(12);
    let mut topics = 0;
    let outputs: Vec<Vec<usize>> = (0..count)
        .map(|_| {
            let first = topics;
            topics += below(4);
            (first..topics).collect()
        })
        .collect();
    let components = (0..count)
        .map(|index| {
            let wanted = if topics == 0 { 0 } else { below(5) };
            let inputs: Vec<Option<usize>> =
                (0..wanted).map(|_| (below(6) > 0).then(|| below(topics))).collect();
            component(
                index,
                &format!("component-{index}"),
                below(5) == 0,
                &inputs,
                &outputs[index],
                below(2) == 0,
            )
        })
        .collect();
    plan(components, &[])
}

fn placed(plan: &Plan) -> (Vec<Wire>, Layers, Placement) {
    let wires = wires(plan);
    let layers = Layers::assign(plan, &wires);
    let placement = Placement::compute(plan, &wires, &layers, None);
    (wires, layers, placement)
}

#[test]
fn control_loop_is_drawn_left_to_right() {
    let plan = control_loop();
    let (wires, layers, _) = placed(&plan);
    assert_eq!(layers.column_of, [0, 1, 1, 2], "the policy is next to the sensor, just before its reader");
    let back: Vec<usize> =
        (0..wires.len()).filter(|index| layers.back[*index]).map(|i| wires[i].reader).collect();
    assert_eq!(back, [0], "only the command to the robot goes back");
    let budgeted: Vec<usize> = wires.iter().filter(|wire| wire.budgeted).map(|wire| wire.topic).collect();
    assert_eq!(budgeted, [0, 1], "the budget goes from the robot through the sensor to the controller");
}

#[test]
fn graph_drawings_never_overlap_or_leave_the_page() {
    for seed in 0..300 {
        let plan = some_graph(seed);
        let (_, layers, placement) = placed(&plan);
        let (width, height) = (placement.width, placement.height);
        // boxes, and the names of topics next to them
        let mut areas: Vec<(String, [f64; 4])> = Vec::new();
        for (index, card) in placement.cards.iter().enumerate() {
            let name = &plan.components[index].name;
            areas.push((name.clone(), [card.x, card.y, card.x + card.width, card.y + card.height]));
            for output in &card.outputs {
                let (left, wire) = (card.x + card.width, card.y + output.offset);
                let area = [left, wire - 16.0, left + output.width(), wire + 16.0];
                areas.push((format!("{name}: {}", output.name), area));
            }
        }
        for (index, (name, area)) in areas.iter().enumerate() {
            let [left, top, right, bottom] = *area;
            assert!(
                left >= 0.0 && top >= HEADER - 20.0 && right <= width && bottom <= height,
                "{seed}: {name}"
            );
            for (other_name, other) in &areas[..index] {
                let apart = right <= other[0] || other[2] <= left || bottom <= other[1] || other[3] <= top;
                assert!(apart, "{seed}: {name} overlaps {other_name}: {area:?} {other:?}");
            }
        }
        let placed: usize =
            layers.columns.iter().flatten().filter(|item| matches!(item, Item::Component(_))).count();
        assert_eq!(placed, plan.components.len(), "{seed}");
    }
}

#[test]
fn forward_wire_goes_to_the_right() {
    for seed in 0..300 {
        let plan = some_graph(seed);
        let (wires, layers, placement) = placed(&plan);
        for (index, wire) in wires.iter().enumerate() {
            let (start, end) = (placement.start(wire), placement.end(index, wire));
            assert_eq!(placement.lanes[index].is_some(), layers.back[index], "{seed}");
            if !layers.back[index] {
                assert!(start.0 < end.0, "{seed}: wire {index} starts at {start:?} and ends at {end:?}");
                let between = layers.column_of[wire.reader] - layers.column_of[wire.writer] - 1;
                assert_eq!(placement.passages[index].len(), between, "{seed}");
            }
        }
    }
}

#[test]
fn the_picture_is_xml_and_shows_every_component_and_topic() {
    for seed in 0..50 {
        let plan = some_graph(seed);
        let picture = svg(&plan, None);
        let document = roxmltree::Document::parse(&picture).expect("well-formed XML");
        let texts: Vec<&str> = document
            .descendants()
            .filter(|node| node.has_tag_name("text"))
            .filter_map(|node| node.text())
            .collect();
        assert!(texts.contains(&"drawn <here>"));
        for name in plan.components.iter().map(|c| &c.name).chain(plan.topics.iter().map(|t| &t.name)) {
            assert!(texts.contains(&name.as_str()), "{seed}: {name} is missing");
        }
        let wires = wires(&plan).len();
        let drawn = document.descendants().filter(|node| node.has_tag_name("g")).count();
        assert_eq!(drawn, wires, "{seed}");
    }
}

#[test]
fn measured_values_are_drawn_where_they_belong() {
    let measured = Measured {
        rates: vec![Some("999.8 Hz".to_string())],
        topics: vec![None, Some("p99 24 us".to_string())],
        latencies: vec![Some("p99 231 us".to_string())],
    };
    let picture = svg(&control_loop(), Some(&measured));
    assert!(picture.contains(">999.8 Hz<") && picture.contains(">p99 24 us<"), "{picture}");
    assert!(picture.contains(">≤ 300 us: p99 231 us<"), "{picture}");
    assert!(!svg(&control_loop(), None).contains("p99"));
    for text in [mermaid(&control_loop(), Some(&measured)), dot(&control_loop(), Some(&measured))] {
        assert!(text.contains("999.8 Hz") && text.contains("<br/>p99 24 us"), "{text}");
        assert!(text.contains("since robot/topic_0: p99 231 us"), "{text}");
    }
}

#[test]
fn mermaid_shows_triggers_budgets_and_topics_without_a_reader() {
    let mut plan = control_loop();
    plan.components[2].inputs[0].topic = None;
    plan.components[3].inputs[1].topic = None;
    plan.topics[2].readers.clear();
    insta::assert_snapshot!(mermaid(&plan, None), @r##"
    ---
    title: drawn &lt;here&gt;
    ---
    flowchart LR
        c0["<b>physics</b><br/>test.physics<br/>every 1 ms (1 kHz)<br/>core 1, FIFO 80<br/>budget 150 us<br/>stale after 5 ms: hold"]
        c1["<b>encoder</b><br/>test.encoder<br/>on in0<br/>core 1, FIFO 80<br/>budget 150 us"]
        c2["<b>policy</b><br/>test.policy<br/>every 1 ms (1 kHz)<br/>core 1, not real-time<br/>budget 150 us"]
        c3["<b>controller</b><br/>test.controller<br/>on in0<br/>core 1, FIFO 80<br/>budget 150 us"]
        c3 -.->|"robot/topic_3<br/>JointState<br/>≤ 300 us since robot/topic_0"| c0
        c0 ==>|"robot/topic_0<br/>JointState"| c1
        c1 ==>|"robot/topic_1<br/>JointState"| c3
        t2(( ))
        c2 -.->|"robot/topic_2<br/>JointState"| t2
        linkStyle 1,2 stroke:#d9480f
    "##);
}

#[test]
fn dot_shows_the_same() {
    insta::assert_snapshot!(dot(&control_loop(), None), @r##"
    digraph "drawn <here>" {
        rankdir=LR;
        node [shape=box, style=rounded, fontname="Helvetica", fontsize=11];
        edge [fontname="Helvetica", fontsize=10];
        c0 [label=<<b>physics</b><br/>test.physics<br/>every 1 ms (1 kHz)<br/>core 1, FIFO 80<br/>budget 150 us<br/>stale after 5 ms: hold>];
        c1 [label=<<b>encoder</b><br/>test.encoder<br/>on in0<br/>core 1, FIFO 80<br/>budget 150 us>];
        c2 [label=<<b>policy</b><br/>test.policy<br/>every 1 ms (1 kHz)<br/>core 1, not real-time<br/>budget 150 us>];
        c3 [label=<<b>controller</b><br/>test.controller<br/>on in0<br/>core 1, FIFO 80<br/>budget 150 us>];
        c3 -> c0 [label=<robot/topic_3<br/>JointState<br/>≤ 300 us since robot/topic_0>, style=dashed];
        c0 -> c1 [label=<robot/topic_0<br/>JointState>, style=solid, color="#d9480f", penwidth=2];
        c1 -> c3 [label=<robot/topic_1<br/>JointState>, style=solid, color="#d9480f", penwidth=2];
        c2 -> c3 [label=<robot/topic_2<br/>JointState>, style=dashed];
    }
    "##);
}
