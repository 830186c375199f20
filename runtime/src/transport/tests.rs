//! Topics and parameters across their real mechanisms, within one process.

use std::rc::Rc;

use iceoryx2::node::NodeBuilder;
use iceoryx2::prelude::{SignalHandlingMode, ipc};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::topic::service_name;
use super::*;
use crate::declare::{Declare, ParameterValue, TopicPattern};
use crate::plan::*;
use crate::region::Region;
use crate::run_folder::RunFolder;
use crate::state::{Defect, JointState, Stamp, StateBuffer, TypeLayout, Wrench};

fn component(name: &str) -> ComponentPlan {
    let mut declare = Declare::new(None);
    declare.float("gain", 1.0, 0.0..=10.0, "", "a factor");
    let declaration = declare.into_declaration();
    ComponentPlan {
        name: name.to_string(),
        program: Program::Builtin { kind: "test.none".to_string() },
        activation: Activation::Periodic { period_ns: 1_000_000, phase_ns: 0 },
        budget_ns: None,
        core: None,
        spin: Spin::Fixed { ns: 0 },
        rise: 0,
        class: SchedulingClass::Normal,
        inputs: Vec::new(),
        outputs: Vec::new(),
        cause: None,
        parameters: declaration
            .parameters
            .into_iter()
            .map(|declaration| ParameterPlan { initial: declaration.default, declaration })
            .collect(),
        config: serde_json::Value::Null,
        robot: None,
        actuator: false,
        seed: 0,
        on_overrun: OnOverrun::Skip,
        overruns_tolerated: None,
        on_error: OnError::Fail,
        on_failure: OnFailure::SafeStop,
        restart: RestartPlan { when: RestartWhen::Never, at_most: 0, window_ns: 1, within_ns: 1 },
        order: 0,
    }
}

/// A domain with one topic, a writer (component 0) and a reader (component 1).
struct Bench {
    folder: RunFolder,
    plan: Plan,
    region: Rc<Region>,
    node: iceoryx2::node::Node<Shared>,
    _service: TopicService,
    _parameters: Option<ParameterService>,
}

impl Bench {
    fn new(layout: TypeLayout, pattern: TopicPattern) -> Self {
        quieten();
        let topic = TopicPlan {
            name: "test/topic".to_string(),
            pattern,
            layout,
            writer: 0,
            readers: vec![1],
            triggers: Vec::new(),
        };
        let plan = Plan {
            name: "transport".to_string(),
            file: "transport.toml".into(),
            clock: ClockKind::Realtime,
            duration_ns: None,
            seed: 0,
            components: vec![component("writer"), component("reader")],
            topics: vec![topic],
            latencies: Vec::new(),
            scheduling: SchedulingPlan { shared_cores: vec![0], on_denied: OnDenied::Warn, idle_exit_ns: 0 },
            safety: SafetyPlan { stale_after_ns: 1, safe_state: SafeState::Hold, settle_ns: 1 },
        };
        let (folder, region) = RunFolder::create(&plan).unwrap();
        let node = folder.domain().unwrap().node().unwrap();
        let service = TopicService::create(&node, &plan.topics[0]).unwrap();
        let parameters = ParameterService::create(&node, &plan.components[1]).unwrap();
        Self { folder, plan, region: Rc::new(region), node, _service: service, _parameters: parameters }
    }

    fn topic(&self) -> &TopicPlan {
        &self.plan.topics[0]
    }

    fn context(&self, index: usize) -> Rc<Context> {
        Rc::new(Context::new(&self.plan, index, self.region.clone()))
    }

    fn input<T: StateBuffer>(&self) -> Input<T> {
        Input::open(&self.node, (0, self.topic()), "input", false, Some(0), self.context(1)).unwrap()
    }

    fn output<T: StateBuffer>(&self) -> Output<T> {
        Output::open(&self.node, (0, self.topic()), "output", Vec::new(), self.context(0)).unwrap()
    }

    fn stock_node(&self) -> iceoryx2::node::Node<ipc::Service> {
        NodeBuilder::new()
            .config(self.folder.domain().unwrap().config())
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<ipc::Service>()
            .unwrap()
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        self.folder.remove();
    }
}

/// The topic as a program with stock iceoryx2 opens it.
fn stock_topic(node: &iceoryx2::node::Node<ipc::Service>) -> PortFactory<ipc::Service, Wrench, Stamp> {
    node.service_builder(&service_name("topic", "test/topic").unwrap())
        .publish_subscribe::<Wrench>()
        .user_header::<Stamp>()
        .open()
        .unwrap()
}

fn wrench(x: f64) -> Wrench {
    Wrench { force: [x, 0.0, 0.0], torque: [0.0; 3] }
}

#[test]
fn under_hold_what_is_made_after_the_deadline_is_withheld_and_counted_and_under_no_other_policy() {
    for policy in
        [OnOverrun::Hold, OnOverrun::Skip, OnOverrun::CatchUp, OnOverrun::Rephase, OnOverrun::SafeStop]
    {
        let mut bench = Bench::new(Wrench::layout(), TopicPattern::State);
        bench.plan.components[0].on_overrun = policy;
        let context = bench.context(0);
        let mut input = bench.input::<Wrench>();
        let mut output =
            Output::open(&bench.node, (0, bench.topic()), "output", Vec::new(), context.clone()).unwrap();
        let holds = policy == OnOverrun::Hold;
        context.enter_step(1_000, 1_000, 2_000);
        assert_eq!([1_999, 2_000, 2_001].map(|now| context.withholds(now)), [false, false, holds]);
        // the deadline lies ahead, then long ago
        for (deadline_ns, x) in [(u64::MAX, 1.0), (2_000, 2.0)] {
            context.enter_step(1_000, 1_000, deadline_ns);
            output.send(&wrench(x)).unwrap();
        }
        let newest = input.latest().unwrap().force[0];
        assert_eq!(newest, if holds { 1.0 } else { 2.0 }, "{policy:?}");
        let refused = context.block().refused.load(std::sync::atomic::Ordering::Relaxed);
        assert_eq!(refused, u64::from(holds), "{policy:?}");
    }
}

#[test]
fn a_state_topic_gives_the_newest_value_and_a_second_look_gives_it_again() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let (mut output, mut input) = (bench.output::<Wrench>(), bench.input::<Wrench>());
    assert!(input.latest().is_none());
    for x in [1.0, 2.0, 3.0] {
        output.send(&wrench(x)).unwrap();
    }
    for _ in 0..2 {
        let reading = input.latest().unwrap();
        assert_eq!(reading.force[0], 3.0);
        assert_eq!(reading.stamp().sequence, 3);
        assert!(reading.stamp().publish_time > 0);
    }
}

#[test]
fn a_reader_that_keeps_its_sample_never_holds_up_the_writer() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let (mut output, mut input) = (bench.output::<Wrench>(), bench.input::<Wrench>());
    output.send(&wrench(1.0)).unwrap();
    let kept = input.latest().unwrap();
    for x in 0..1_000 {
        output.send(&wrench(f64::from(x))).unwrap();
    }
    assert_eq!(kept.force[0], 1.0);
}

#[test]
fn a_stream_gives_every_sample_in_order_and_counts_what_it_lost() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::Stream { capacity: 4 });
    let (mut output, mut input) = (bench.output::<Wrench>(), bench.input::<Wrench>());
    let read = |input: &mut Input<Wrench>| {
        let mut seen = Vec::new();
        while let Some(reading) = input.next_unread() {
            seen.push(reading.force[0]);
        }
        seen
    };
    (0..3).for_each(|x| output.send(&wrench(f64::from(x))).unwrap());
    assert_eq!(read(&mut input), [0.0, 1.0, 2.0]);
    assert_eq!(input.lost(), 0);
    (3..13).for_each(|x| output.send(&wrench(f64::from(x))).unwrap());
    assert_eq!(read(&mut input), [9.0, 10.0, 11.0, 12.0]);
    assert_eq!(input.lost(), 6);
    assert_eq!(bench.region.topics()[0].dropped.load(std::sync::atomic::Ordering::Relaxed), 6);
}

#[test]
fn a_value_that_is_not_finite_is_not_published() {
    let bench = Bench::new(JointState::layout(), TopicPattern::State);
    let (mut output, mut input) = (bench.output::<JointState>(), bench.input::<JointState>());
    let mut loan = output.loan().unwrap();
    loan.set_count(3);
    loan.velocity_mut()[2] = f64::NAN;
    let error = loan.publish().unwrap_err();
    let crate::declare::StepError::InvalidOutput { port: "output", defect } = error else {
        panic!("{error}")
    };
    assert!(matches!(defect, Defect::NotFinite { field: "velocity", index: 2, .. }));
    assert!(input.latest().is_none());
}

#[test]
fn what_lies_beyond_the_count_is_neither_checked_nor_shown() {
    let bench = Bench::new(JointState::layout(), TopicPattern::State);
    let (mut output, mut input) = (bench.output::<JointState>(), bench.input::<JointState>());
    let mut loan = output.loan().unwrap();
    loan.set_count(3);
    loan.velocity_mut().fill(f64::NAN);
    loan.set_count(0);
    loan.publish().unwrap();
    assert_eq!(input.latest().unwrap().velocity(), &[] as &[f64]);
}

#[test]
fn a_stock_iceoryx2_program_exchanges_samples_with_the_variant_in_both_directions() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let (mut output, mut input) = (bench.output::<Wrench>(), bench.input::<Wrench>());
    let stock = bench.stock_node();
    let service = stock_topic(&stock);
    let subscriber = service.subscriber_builder().create().unwrap();
    output.send(&wrench(5.0)).unwrap();
    let sample = subscriber.receive().unwrap().unwrap();
    assert_eq!((sample.force[0], sample.user_header().sequence), (5.0, 1));
    let publisher = service.publisher_builder().create().unwrap();
    let mut sample = publisher.loan_uninit().unwrap().write_payload(wrench(6.0));
    *sample.user_header_mut() = Stamp { sequence: 1, origin: 9, ..Stamp::default() };
    sample.send().unwrap();
    assert_eq!(input.latest().unwrap().force[0], 6.0);
}

#[test]
fn small_states_are_repeated_over_iceoryx2_only_while_somebody_listens_there() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let (mut output, _input) = (bench.output::<Wrench>(), bench.input::<Wrench>());
    let stock = bench.stock_node();
    let service = stock_topic(&stock);
    // Like a component's own: it shows what is sent and is no reason to send.
    let own = service.subscriber_builder().name(&super::echo::own_name().unwrap()).create().unwrap();
    output.send(&wrench(1.0)).unwrap();
    assert!(own.receive().unwrap().is_none());
    let guest = service.subscriber_builder().create().unwrap();
    output.send(&wrench(2.0)).unwrap();
    assert_eq!(guest.receive().unwrap().unwrap().force[0], 2.0);
    assert_eq!(own.receive().unwrap().unwrap().force[0], 2.0);
    drop(guest);
    output.send(&wrench(3.0)).unwrap();
    assert!(own.receive().unwrap().is_none());
}

#[test]
fn a_sample_without_a_sequence_or_with_a_nan_is_refused_by_the_reader_and_counted() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let mut input = bench.input::<Wrench>();
    let stock = bench.stock_node();
    let publisher = stock_topic(&stock).publisher_builder().create().unwrap();
    for (sequence, x) in [(0, 1.0), (1, f64::NAN)] {
        let mut sample = publisher.loan_uninit().unwrap().write_payload(wrench(x));
        *sample.user_header_mut() = Stamp { sequence, ..Stamp::default() };
        sample.send().unwrap();
        assert!(input.latest().is_none());
    }
    let refused = &bench.region.components()[1].refused;
    assert_eq!(refused.load(std::sync::atomic::Ordering::Relaxed), 2);
}

mod swapped {
    crate::state_buffer! {
        /// A wrench whose fields are in the other order: same name, same size.
        pub(super) struct Wrench as "motorium.Wrench" {
            /// Torque, N m.
            pub(super) torque: [f64; 3],
            /// Force, N.
            pub(super) force: [f64; 3],
        }
    }
}

#[test]
fn two_layouts_of_one_size_do_not_meet_and_the_error_shows_both() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let opened = Input::<swapped::Wrench>::open(
        &bench.node,
        (0, bench.topic()),
        "input",
        false,
        Some(0),
        bench.context(1),
    );
    let text = opened.unwrap_err().to_string();
    assert!(text.contains("0  torque: [f64; 3]") && text.contains("0  force: [f64; 3]"), "{text}");
    assert!(text.contains("this program") && text.contains("the topic"), "{text}");
}

#[test]
fn a_parameter_set_from_outside_takes_effect_at_the_next_tick_boundary() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let mut reader = ParameterReader::open(&bench.node, &bench.plan.components[1]).unwrap();
    let gain = Parameter::<f64>::new(reader.parameter("gain").unwrap().clone());
    let mut plan = bench.plan.clone();
    plan.components.remove(0);
    let table = ParameterTable::open(&bench.folder.domain().unwrap(), plan).unwrap();
    assert_eq!(table.set("reader.gain", ParameterValue::Integer(4)).unwrap(), ParameterValue::Float(4.0));
    assert_eq!(gain.get(), 1.0);
    reader.refresh();
    assert_eq!(gain.get(), 4.0);
    assert_eq!(table.list().unwrap()[0].2, ParameterValue::Float(4.0));
}

#[test]
fn a_parameter_out_of_range_or_of_another_type_is_refused_with_what_is_allowed() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let mut plan = bench.plan.clone();
    plan.components.remove(0);
    let table = ParameterTable::open(&bench.folder.domain().unwrap(), plan).unwrap();
    let refused = |path: &str, value| table.set(path, value).unwrap_err().to_string();
    assert_eq!(
        refused("reader.gain", ParameterValue::Float(11.0)),
        "parameter `gain` is 11, expected from 0 to 10"
    );
    assert!(refused("reader.gain", ParameterValue::Boolean(true)).contains("expected a number"));
    assert!(refused("reader.gian", ParameterValue::Float(1.0)).contains("it has: gain"));
    assert!(refused("gain", ParameterValue::Float(1.0)).contains("component.parameter"));
}

#[test]
fn an_observer_sees_the_samples_without_being_part_of_the_graph() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let mut output = bench.output::<Wrench>();
    let observer = Observer::open(&bench.folder.domain().unwrap(), bench.topic()).unwrap();
    output.send(&wrench(2.5)).unwrap();
    let seen = observer.next_unread().unwrap();
    assert_eq!(seen.stamp.sequence, 1);
    assert_eq!(seen.bytes.len(), size_of::<Wrench>());
    assert_eq!(f64::from_le_bytes(seen.bytes[..8].try_into().unwrap()), 2.5);
}
