//! Topics and parameters through their real mechanisms, within one process.

mod filling;
mod joining;
mod latest;
mod streams;

use std::rc::Rc;

use super::*;
use crate::context::Context;
use crate::declare::{Declare, ParameterValue, TopicPattern};
use crate::parameter::{ParameterReader, ParameterService};
use crate::plan::*;
use crate::region::Region;
use crate::run_folder::RunFolder;
use crate::state::{Defect, JointState, StateBuffer, TypeLayout, Wrench};

fn component(name: &str) -> ComponentPlan {
    let mut declare = Declare::new(None);
    declare.float("gain", 1.0, 0.0..=10.0, "", "a factor");
    declare.choice("mode", &["slow", "quick"], "slow", "a choice");
    declare.array("offsets", &[0.5, 1.5], -2.0..=2.0, "m", "an array");
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
            .map(|declaration| ParameterPlan { initial: declaration.default.clone(), declaration })
            .collect(),
        config: serde_json::Value::Null,
        robot: None,
        robots: Vec::new(),
        stop_within_ns: None,
        waits_ns: 0,
        folder: Default::default(),
        actuator: false,
        notes: Vec::new(),
        seed: 0,
        on_overrun: OnOverrun::Skip,
        liveness: Default::default(),
        overruns_tolerated: None,
        on_error: OnError::Fail,
        on_failure: OnFailure::SafeStop,
        restart: RestartPlan { when: RestartWhen::Never, at_most: 0, window_ns: 1, within_ns: 1 },
        resets: false,
        ends_episode: false,
        begins_episodes: false,
        safety: None,
        order: 0,
    }
}

/// A domain with one topic, a writer (component 0) and a reader (component 1).
pub(crate) struct Bench {
    pub(crate) folder: RunFolder,
    plan: Plan,
    region: Rc<Region>,
    node: Rc<iceoryx2::node::Node<Shared>>,
    _service: TopicService,
    _parameters: Option<ParameterService>,
}

impl Bench {
    pub(crate) fn new(layout: TypeLayout, pattern: TopicPattern) -> Self {
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
            episodes: None,
            seed: 0,
            components: vec![component("writer"), component("reader")],
            topics: vec![topic],
            latencies: Vec::new(),
            scheduling: SchedulingPlan { shared_cores: vec![0], on_denied: OnDenied::Warn, idle_exit_ns: 0 },
            safety: SafetyPlan::for_tests(),
            expectations: Vec::new(),
            trace_events: 0,
        };
        let (folder, region) = RunFolder::create(&plan).unwrap();
        let node = Rc::new(folder.domain().unwrap().node().unwrap());
        let service = TopicService::create(&node, &plan.topics[0]).unwrap();
        let parameters = ParameterService::create(&node, &plan.components[1]).unwrap();
        Self { folder, plan, region: Rc::new(region), node, _service: service, _parameters: parameters }
    }

    pub(crate) fn topic(&self) -> &TopicPlan {
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
        Input::open(&self.participant(1), &place)
    }

    pub(crate) fn output<T: StateBuffer>(&self) -> Output<T> {
        Output::open(&self.participant(0), self.output_place(), "output").unwrap()
    }

    pub(crate) fn output_place(&self) -> OutputPlace<'_> {
        OutputPlace {
            index: 0,
            topic: self.topic(),
            probes: Vec::new(),
            wakes_late: false,
            is_emergency_stop: false,
        }
    }

    pub(crate) fn participant(&self, index: usize) -> Participant {
        Participant::new(self.node.clone(), self.context(index))
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        self.folder.remove();
    }
}

pub(crate) fn wrench(x: f64) -> Wrench {
    Wrench { force: [x, 0.0, 0.0], torque: [0.0; 3] }
}

#[test]
fn only_hold_withholds_and_counts_late_publications() {
    for policy in
        [OnOverrun::Hold, OnOverrun::Skip, OnOverrun::CatchUp, OnOverrun::Rephase, OnOverrun::SafeStop]
    {
        let mut bench = Bench::new(Wrench::layout(), TopicPattern::State);
        bench.plan.components[0].on_overrun = policy;
        let participant = bench.participant(0);
        let context = participant.context().clone();
        let mut input = bench.input::<Wrench>();
        let mut output = Output::open(&participant, bench.output_place(), "output").unwrap();
        let holds = policy == OnOverrun::Hold;
        context.enter_step(1_000, 1_000, 2_000);
        assert_eq!(
            [1_999, 2_000, 2_001].map(|now| context.stamp(1, now, None).is_err()),
            [false, false, holds]
        );
        // the deadline lies ahead, then long past
        for (deadline_ns, x) in [(u64::MAX, 1.0), (2_000, 2.0)] {
            context.enter_step(1_000, 1_000, deadline_ns);
            output.send(&wrench(x)).unwrap();
        }
        let newest = input.latest().unwrap().force[0];
        assert_eq!(newest, if holds { 1.0 } else { 2.0 }, "{policy:?}");
        let refused = context.block().refused.load(std::sync::atomic::Ordering::Relaxed);
        assert_eq!(refused, 2 * u64::from(holds), "{policy:?}");
    }
}

#[test]
fn value_that_is_not_finite_is_not_published() {
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
fn entries_beyond_the_count_are_neither_checked_nor_shown() {
    let bench = Bench::new(JointState::layout(), TopicPattern::State);
    let (mut output, mut input) = (bench.output::<JointState>(), bench.input::<JointState>());
    let mut loan = output.loan().unwrap();
    loan.set_count(3);
    loan.velocity_mut().fill(f64::NAN);
    loan.set_count(0);
    loan.publish().unwrap();
    assert_eq!(input.latest().unwrap().velocity(), &[] as &[f64]);
}

pub(crate) mod swapped {
    crate::state_buffer! {
        /// A wrench whose fields are in a different order: same name, same size.
        pub(crate) struct Wrench as "motorium.Wrench" {
            /// Torque, N m.
            pub(crate) torque: [f64; 3],
            /// Force, N.
            pub(crate) force: [f64; 3],
        }
    }
}

#[test]
fn layouts_of_equal_size_are_distinguished() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let opened = bench.try_input::<swapped::Wrench>();
    let text = opened.unwrap_err().to_string();
    assert!(text.contains("0  torque: [f64; 3]") && text.contains("0  force: [f64; 3]"), "{text}");
    assert!(text.contains("this program") && text.contains("the topic"), "{text}");
}

#[test]
fn parameter_change_takes_effect_at_the_next_tick() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let mut reader = ParameterReader::open(&bench.node, &bench.plan.components[1]).unwrap();
    let (_, numbers, place) = reader.parameter("gain").unwrap();
    let gain = Parameter::<f64>::new(numbers.clone(), place);
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
fn parameters_of_a_component_change_together_or_not_at_all() {
    let bench = Bench::new(Wrench::layout(), TopicPattern::State);
    let mut reader = ParameterReader::open(&bench.node, &bench.plan.components[1]).unwrap();
    let handle = |name: &str| {
        let (declaration, numbers, place) = reader.parameter(name).unwrap();
        (numbers.clone(), place, declaration.numbers())
    };
    let ((gain, place, _), (mode, at, _), (offsets, from, count)) =
        (handle("gain"), handle("mode"), handle("offsets"));
    let (gain, mode) = (Parameter::<f64>::new(gain, place), Parameter::<Choice>::new(mode, at));
    let offsets = ParameterArray::new(offsets, from, count);
    let mut plan = bench.plan.clone();
    plan.components.remove(0);
    let table = ParameterTable::open(&bench.folder.domain().unwrap(), plan).unwrap();
    let seen = |gain: &Parameter<f64>| {
        (gain.get(), mode.get().index(), offsets.iter().collect::<Vec<_>>(), offsets.get(1))
    };

    let refused = table.set_many([("reader.gain", 4.0.into()), ("reader.offsets", [0.0, 3.0].into())]);
    assert!(refused.unwrap_err().to_string().contains("`offsets[1]` is 3, expected from -2 to 2"));
    reader.refresh();
    assert_eq!(seen(&gain), (1.0, 0, vec![0.5, 1.5], 1.5));
    let twice = table.set_many([("reader.gain", 4.0.into()), ("reader.gain", 5.0.into())]);
    assert!(twice.unwrap_err().to_string().contains("twice"));

    let values = [
        ("reader.gain", 4.0.into()),
        ("reader.offsets", [1.0, -1.0].into()),
        ("reader.mode", "quick".into()),
    ];
    assert_eq!(table.set_many(values).unwrap()[2], ParameterValue::Choice("quick".to_string()));
    assert_eq!(seen(&gain), (1.0, 0, vec![0.5, 1.5], 1.5), "not before the step is over");
    reader.refresh();
    assert_eq!(seen(&gain), (4.0, 1, vec![1.0, -1.0], -1.0));
    table.set("reader.gain", 2.0.into()).unwrap();
    reader.refresh();
    assert_eq!(seen(&gain), (2.0, 1, vec![1.0, -1.0], -1.0), "the others are unchanged");
    let listed: Vec<_> = table.list().unwrap().into_iter().map(|(_, _, value)| value.to_string()).collect();
    assert_eq!(listed, ["2", "quick", "[1, -1]"]);
}

#[test]
fn invalid_parameter_is_refused_with_the_allowed_values() {
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
    assert!(refused("reader.gian", ParameterValue::Float(1.0)).contains("did you mean `gain`?"));
    assert!(refused("gain", ParameterValue::Float(1.0)).contains("component.parameter"));
}
