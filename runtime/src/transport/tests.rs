//! Topics and parameters across their real mechanisms, within one process.

use std::rc::Rc;

use super::*;
use crate::declare::{Declare, ParameterValue, TopicPattern};
use crate::plan::*;
use crate::region::Region;
use crate::run_folder::RunFolder;
use crate::state::{Defect, JointState, StateBuffer, TypeLayout, Wrench};

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
        Self::make(layout, pattern, 0)
    }

    fn with_history(history: usize) -> Self {
        Self::make(Wrench::layout(), TopicPattern::State, history)
    }

    fn make(layout: TypeLayout, pattern: TopicPattern, history: usize) -> Self {
        quieten();
        let topic = TopicPlan {
            name: "test/topic".to_string(),
            pattern,
            layout,
            writer: 0,
            readers: vec![1],
            triggers: Vec::new(),
            history,
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
        self.try_input().unwrap()
    }

    fn try_input<T: StateBuffer>(&self) -> Result<Input<T>, PortError> {
        let topic = self.topic();
        let place = InputPlace { index: 0, topic, port: "input", pin: 0, is_cause: false, edge: Some(0) };
        Input::open(&self.node, place, self.context(1))
    }

    fn output<T: StateBuffer>(&self) -> Output<T> {
        Output::open(&self.node, (0, self.topic()), "output", Vec::new(), self.context(0)).unwrap()
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        self.folder.remove();
    }
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
    let opened = bench.try_input::<swapped::Wrench>();
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
fn a_state_is_read_where_the_writer_left_it() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let (mut output, mut input) = (bench.output::<Wrench>(), bench.input::<Wrench>());
    output.send(&wrench(1.0)).unwrap();
    let first = core::ptr::from_ref::<Wrench>(&input.latest().unwrap());
    assert_eq!(core::ptr::from_ref::<Wrench>(&input.latest().unwrap()), first, "no copy is made");
    // Three slots are enough for a writer and a reader that keeps up.
    let mut places = std::collections::HashSet::new();
    for x in 0..100 {
        output.send(&wrench(f64::from(x))).unwrap();
        places.insert(core::ptr::from_ref::<Wrench>(&input.latest().unwrap()));
    }
    assert!(places.len() <= 3, "{} places", places.len());
}

#[test]
fn a_killed_reader_costs_one_slot_until_its_successor_takes_the_pin_over() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let mut output = bench.output::<Wrench>();
    output.send(&wrench(1.0)).unwrap();
    let mut killed = bench.input::<Wrench>();
    assert!(killed.latest().is_some());
    std::mem::forget(killed);
    (0..1_000).for_each(|x| output.send(&wrench(f64::from(x))).unwrap());
    let mut successor = bench.input::<Wrench>();
    assert_eq!(successor.latest().unwrap().force[0], 999.0);
}

#[test]
fn a_writer_killed_while_it_fills_a_value_leaves_the_one_before_and_its_successor_counts_on() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let (mut killed, mut input) = (bench.output::<Wrench>(), bench.input::<Wrench>());
    killed.send(&wrench(1.0)).unwrap();
    killed.loan().unwrap().force[0] = f64::NAN;
    std::mem::forget(killed);
    assert_eq!(input.latest().unwrap().force[0], 1.0);
    let mut successor = bench.output::<Wrench>();
    successor.send(&wrench(2.0)).unwrap();
    let reading = input.latest().unwrap();
    assert_eq!((reading.force[0], reading.stamp().sequence), (2.0, 2));
}

#[test]
fn news_show_without_reading_and_end_with_it() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let (mut output, mut input) = (bench.output::<Wrench>(), bench.input::<Wrench>());
    assert!(!input.has_news() && input.next_unread().is_none());
    output.send(&wrench(1.0)).unwrap();
    assert!(input.has_news());
    assert_eq!(input.next_unread().unwrap().force[0], 1.0);
    assert!(!input.has_news() && input.next_unread().is_none());
    assert_eq!(input.current().unwrap().force[0], 1.0);
}

#[test]
fn a_trigger_is_due_for_what_was_published_before_its_first_wait() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let mut output = bench.output::<Wrench>();
    output.send(&wrench(1.0)).unwrap();
    let trigger = open_trigger(&bench.node, bench.topic(), &bench.context(1)).unwrap();
    assert_eq!(trigger.first_seen(), 0);
    trigger.wait();
    assert_eq!(trigger.newest().0, 1);
    assert!(!trigger.is_due());
    // One that was restarted begins with what comes.
    bench.region.components()[1].restarts.store(1, std::sync::atomic::Ordering::Relaxed);
    assert_eq!(open_trigger(&bench.node, bench.topic(), &bench.context(1)).unwrap().first_seen(), 1);
}

#[test]
fn no_publication_is_lost_however_waiting_and_publishing_fall_together() {
    const ROUNDS: u64 = 20_000;
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let (folder, topic) = (&bench.folder, bench.topic());
    let open = || TopicMemory::open(&folder.domain().unwrap().node().unwrap(), topic).unwrap();
    let (there, back) = (std::sync::atomic::AtomicU64::new(0), std::sync::atomic::AtomicU64::new(0));
    let ready = std::sync::Barrier::new(2);
    let play = |begins: bool, mine: &std::sync::atomic::AtomicU64, theirs: &std::sync::atomic::AtomicU64| {
        use std::sync::atomic::Ordering::SeqCst;
        let memory = Rc::new(open());
        let trigger = Trigger::new(memory.clone(), 0);
        ready.wait();
        for round in 0..ROUNDS {
            if begins {
                mine.store(round + 1, SeqCst);
                memory.count(0);
                memory.notify();
            }
            while theirs.load(SeqCst) <= round {
                trigger.wait();
            }
            // Sometimes the other side has time to fall asleep, sometimes not.
            (0..round % 97 * 10).for_each(|_| core::hint::spin_loop());
            if !begins {
                mine.store(round + 1, SeqCst);
                memory.count(0);
                memory.notify();
            }
        }
    };
    std::thread::scope(|scope| {
        scope.spawn(|| play(false, &back, &there));
        play(true, &there, &back);
    });
}

#[test]
fn a_tap_reads_every_value_of_a_topic_with_a_history_and_counts_what_it_missed() {
    let mut bench = Bench::with_history(32);
    bench.plan.name = "tapped".to_string();
    let domain = bench.folder.domain().unwrap();
    let mut output = bench.output::<Wrench>();
    output.send(&wrench(0.0)).unwrap();
    let mut tap = Tap::open(&domain, bench.topic()).unwrap();
    for round in 0..10 {
        (1..=30).for_each(|x| output.send(&wrench(f64::from(30 * round + x))).unwrap());
        while let Some(sample) = tap.next_unread() {
            let x = f64::from_le_bytes(sample.bytes[..8].try_into().unwrap());
            assert_eq!(sample.stamp.sequence as f64, x + 1.0);
        }
        assert_eq!(tap.missed(), 0, "round {round}");
    }
    (0..100).for_each(|x| output.send(&wrench(f64::from(x))).unwrap());
    let mut read = 0;
    while tap.next_unread().is_some() {
        read += 1;
    }
    assert!(read >= 32 && tap.missed() + read == 100, "{read} read, {} missed", tap.missed());
}

#[test]
fn four_taps_find_a_place_and_that_of_a_closed_one_is_free_again() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let domain = bench.folder.domain().unwrap();
    let mut taps: Vec<_> = (0..4).map(|_| Tap::open(&domain, bench.topic()).unwrap()).collect();
    let error = Tap::open(&domain, bench.topic()).unwrap_err().to_string();
    assert!(error.contains("four places"), "{error}");
    taps.pop();
    assert!(Tap::open(&domain, bench.topic()).is_ok());
}

#[test]
fn slices_of_any_length_up_to_the_declared_one_arrive_whole_and_in_order() {
    let bench = Bench::new(u16::layout(), TopicPattern::Slices { capacity: 4, longest: 1_000 });
    let (node, topic) = (&bench.node, bench.topic());
    let mut output =
        SliceOutput::<u16>::open(node, (0, topic), "output", Vec::new(), bench.context(0)).unwrap();
    let place = InputPlace { index: 0, topic, port: "input", pin: 0, is_cause: false, edge: Some(0) };
    let mut input = SliceInput::<u16>::open(node, place, bench.context(1)).unwrap();
    assert!(input.next_unread().is_none());
    for length in [0, 1, 1_000] {
        let mut loan = output.loan(length).unwrap();
        loan.iter_mut().enumerate().for_each(|(i, value)| *value = (length + i) as u16);
        loan.publish().unwrap();
    }
    for (sequence, length) in [(1, 0), (2, 1), (3, 1_000)] {
        let (stamp, slice) = input.next_unread().unwrap();
        assert_eq!((stamp.sequence, slice.len()), (sequence, length));
        assert!(slice.iter().enumerate().all(|(i, value)| *value == (length + i) as u16));
    }
    let error = output.loan(1_001).unwrap_err().to_string();
    assert!(error.contains("longer than the output declares"), "{error}");
    for value in 0..9 {
        let mut loan = output.loan(1).unwrap();
        loan[0] = value;
        loan.publish().unwrap();
    }
    let read: Vec<u16> = std::iter::from_fn(|| input.next_unread().map(|(_, slice)| slice[0])).collect();
    assert_eq!(read, [5, 6, 7, 8]);
    assert_eq!(input.lost(), 5);
}

#[test]
fn a_slice_with_a_number_that_is_not_finite_is_not_published_and_single_values_do_not_meet_slices() {
    let bench = Bench::new(f32::layout(), TopicPattern::Slices { capacity: 4, longest: 8 });
    let (node, topic) = (&bench.node, bench.topic());
    let mut output =
        SliceOutput::<f32>::open(node, (0, topic), "output", Vec::new(), bench.context(0)).unwrap();
    let mut loan = output.loan(8).unwrap();
    loan.fill(1.0);
    loan[5] = f32::NAN;
    let error = loan.publish().unwrap_err();
    let crate::declare::StepError::InvalidOutput { defect: Defect::NotFinite { index: 5, .. }, .. } = error
    else {
        panic!("{error}")
    };
    let error = bench.try_input::<f32>().unwrap_err().to_string();
    assert!(error.contains("slice_input"), "{error}");
}

#[test]
fn arrays_are_digested_as_their_elements_are() {
    use crate::state::{Digest, Field};
    let (mut bytes, mut elements) = (Digest::default(), Digest::default());
    let values = [1.5_f64, -2.0, 3.25];
    f64::digest_all(&values, &mut bytes);
    values.iter().for_each(|value| value.digest(&mut elements));
    assert_eq!(bytes.finish(), elements.finish());
}
