//! The set-up of a component: its ports, its parameters and its wiring in the graph.

use std::os::fd::OwnedFd;
use std::path::Path;
use std::rc::Rc;
use std::time::Duration;

use super::{ConfigureError, Helpers, RunClock};
use crate::context::Context;
use crate::declare::{ParameterKind, RobotReference, TopicPattern};
use crate::domain::Domain;
use crate::parameter::{AnyParameter, FoundParameter, Parameter, ParameterArray, ParameterReader};
use crate::plan::{Activation, ClockKind, ComponentPlan, Plan, PortPlan, STOP_WITHIN_NS};
use crate::raw::{RawInput, RawOutput, RawStreamInput, RawStreamOutput};
use crate::run_folder::RunFolder;
use crate::state::{StateBuffer, TypeLayout};
use crate::transport::{
    Connect, Input, InputPlace, Output, OutputPlace, Participant, PortError, Probe, SliceInput, SliceOutput,
    Trigger,
};

/// The set-up of one component: opens the ports and parameters that the component declared.
///
/// Each port is opened once, during configuration, even if the graph leaves it unwired. An unwired input
/// stays empty, and samples of an unwired output are discarded.
///
/// ```
/// use motorium::prelude::*;
///
/// struct Filter {
///     state: Input<JointState>,
///     filtered: Output<JointState>,
///     time_constant: Parameter<f64>,
///     dt: f64,
/// }
///
/// fn configure(setup: &mut Setup) -> Result<Filter, ConfigureError> {
///     Ok(Filter {
///         state: setup.input("state")?,
///         filtered: setup.output("filtered")?,
///         time_constant: setup.parameter("time_constant")?,
///         dt: setup.period().as_secs_f64(),
///     })
/// }
/// ```
pub struct Setup {
    plan: Plan,
    index: usize,
    run: RunFolder,
    domain: Domain,
    participant: Participant,
    parameters: ParameterReader,
    ports: Vec<Rc<dyn Connect>>,
    trigger: Option<Trigger>,
    pub(super) descriptor: Option<OwnedFd>,
    pub(super) helpers: Helpers,
}

/// Ports, parameters, activation and helper threads of a configured component.
pub(crate) struct Prepared {
    pub(crate) ports: Vec<Rc<dyn Connect>>,
    pub(crate) parameters: ParameterReader,
    pub(crate) trigger: Option<Trigger>,
    /// File descriptor that releases the component's steps.
    pub(crate) descriptor: Option<OwnedFd>,
    pub(crate) helpers: Helpers,
}

impl Setup {
    pub(crate) fn new(
        folder: &RunFolder,
        plan: &Plan,
        index: usize,
        context: Rc<Context>,
    ) -> Result<Self, String> {
        let domain = folder.domain().map_err(|error| error.to_string())?;
        let node = Rc::new(domain.node().map_err(|error| error.to_string())?);
        let participant = Participant::new(node, context);
        let component = &plan.components[index];
        let parameters = ParameterReader::open(participant.node(), component);
        let parameters = parameters.map_err(|error| error.to_string())?;
        let trigger = match (plan.clock, &component.activation) {
            (ClockKind::Realtime, Activation::Triggered { topic, .. }) => {
                Some(participant.trigger(&plan.topics[*topic]).map_err(|error| error.to_string())?)
            }
            _ => None,
        };
        let stop_within = Duration::from_nanos(component.stop_within_ns.unwrap_or(STOP_WITHIN_NS));
        Ok(Self {
            plan: plan.clone(),
            index,
            run: folder.clone(),
            domain,
            participant,
            parameters,
            ports: Vec::new(),
            trigger,
            descriptor: None,
            helpers: Helpers::stopping_within(stop_within / 2),
        })
    }

    pub(crate) fn finish(self) -> Prepared {
        let Self { ports, parameters, trigger, descriptor, helpers, .. } = self;
        Prepared { ports, parameters, trigger, descriptor, helpers }
    }

    pub(crate) fn plan(&self) -> &Plan {
        &self.plan
    }

    pub(super) fn run(&self) -> &RunFolder {
        &self.run
    }

    pub(crate) fn context(&self) -> &Rc<Context> {
        self.participant.context()
    }

    pub(crate) fn component(&self) -> &ComponentPlan {
        &self.plan.components[self.index]
    }

    /// Returns the component's name in the graph.
    pub fn name(&self) -> &str {
        &self.component().name
    }

    /// Returns the robot that the graph assigns to this component.
    ///
    /// # Errors
    /// The graph assigns no robot to the component. If a component needs a robot, it should check this in
    /// `declare`, so that `motorium check` reports the error.
    pub fn robot(&self) -> Result<&RobotReference, ConfigureError> {
        self.component()
            .robot
            .as_ref()
            .ok_or_else(|| ConfigureError::failed("the component has no robot; add `robot = \"NAME\"` to it"))
    }

    /// Returns the robots listed under the component's key `robots` in the graph. Empty if the component has
    /// a single `robot` or no robot.
    pub fn robots(&self) -> &[RobotReference] {
        &self.component().robots
    }

    /// Returns the nominal time between two steps.
    pub fn period(&self) -> Duration {
        Duration::from_nanos(self.component().period_ns())
    }

    /// Returns the clock of the run.
    pub fn clock(&self) -> RunClock {
        RunClock::new(self.context().clone())
    }

    /// Returns the folder that relative paths in the `config` table refer to. Same as
    /// [`Declare::folder`](crate::declare::Declare::folder).
    pub fn folder(&self) -> &Path {
        &self.component().folder
    }

    /// Returns the component's seed, derived from the run's seed and the component's name.
    pub fn seed(&self) -> u64 {
        self.component().seed
    }

    /// Opens a declared input.
    ///
    /// # Errors
    /// The port is not declared with this type, or its topic cannot be joined.
    pub fn input<T: StateBuffer>(&mut self, port: &str) -> Result<Input<T>, PortError> {
        let (index, plan) = find(&self.component().inputs, port)?;
        same_type(&T::layout(), plan)?;
        let Some(place) = self.input_place(index, plan) else {
            return Ok(Input::unwired(self.context().clone()));
        };
        let input = Input::<T>::open(&self.participant, &place)?;
        self.ports.extend(input.connection());
        Ok(input)
    }

    /// Returns `true` if the graph wires this input. Same as
    /// [`Declare::subscribes`](crate::declare::Declare).
    pub fn subscribes(&self, port: &str) -> bool {
        self.component().inputs.iter().any(|input| input.port == port && input.topic.is_some())
    }

    /// Returns `true` if the component declared this input.
    pub(crate) fn has_input(&self, port: &str) -> bool {
        self.component().inputs.iter().any(|input| input.port == port)
    }

    /// Opens a declared input that reads slices (arrays of varying length, such as images).
    ///
    /// # Errors
    /// The port is not declared with this type, or its topic cannot be joined.
    pub fn slice_input<T: StateBuffer>(&mut self, port: &str) -> Result<SliceInput<T>, PortError> {
        let (index, plan) = find(&self.component().inputs, port)?;
        same_type(&T::layout(), plan)?;
        let Some(place) = self.input_place(index, plan) else {
            return Ok(SliceInput::unwired(self.context().clone()));
        };
        let input = SliceInput::<T>::open(&self.participant, &place)?;
        self.ports.extend(input.connection());
        Ok(input)
    }

    /// Opens a declared output that publishes slices (arrays of varying length, such as images).
    ///
    /// # Errors
    /// The port is not declared with this type, or its topic cannot be joined.
    pub fn slice_output<T: StateBuffer>(&mut self, port: &'static str) -> Result<SliceOutput<T>, PortError> {
        let (index, plan) = find(&self.component().outputs, port)?;
        same_type(&T::layout(), plan)?;
        let Some(topic) = plan.topic else {
            let longest = match plan.pattern {
                TopicPattern::Slices { longest, .. } => longest,
                TopicPattern::State | TopicPattern::Stream { .. } => 0,
            };
            return Ok(SliceOutput::unwired(port, longest, self.context().clone()));
        };
        let place = self.output_place(index, topic);
        let output = SliceOutput::<T>::open(&self.participant, place, port)?;
        self.ports.extend(output.connection());
        Ok(output)
    }

    /// Opens a declared input that reads a topic of any type as bytes.
    ///
    /// # Errors
    /// The port is not declared, or its topic cannot be joined.
    pub fn raw_input(&mut self, port: &str) -> Result<RawInput, PortError> {
        let (index, plan) = find(&self.component().inputs, port)?;
        let Some(place) = self.input_place(index, plan) else {
            return Ok(RawInput::unwired(self.context().clone()));
        };
        let input = RawInput::open(&self.participant, &place)?;
        self.ports.extend(input.connection());
        Ok(input)
    }

    /// Opens a declared output that publishes values as bytes in the declared layout.
    ///
    /// # Errors
    /// The port is not declared, its layout cannot be checked, or its topic cannot be joined.
    pub fn raw_output(&mut self, port: &str) -> Result<RawOutput, PortError> {
        let (index, plan) = find(&self.component().outputs, port)?;
        let Some(topic) = plan.topic else { return RawOutput::unwired(plan, self.context().clone()) };
        RawOutput::open(&self.participant, self.output_place(index, topic), plan)
    }

    /// Opens a declared input that reads a stream of values or slices of any type as bytes.
    ///
    /// # Errors
    /// The port is not declared as a stream or slices, or its topic cannot be joined.
    pub fn raw_stream_input(&mut self, port: &str) -> Result<RawStreamInput, PortError> {
        let (index, plan) = find(&self.component().inputs, port)?;
        let Some(place) = self.input_place(index, plan) else {
            return Ok(RawStreamInput::unwired(self.context().clone()));
        };
        let input = RawStreamInput::open(&self.participant, &place)?;
        self.ports.extend(input.connection());
        Ok(input)
    }

    /// Opens a declared output that publishes a stream of values or slices as bytes in the declared layout.
    ///
    /// # Errors
    /// The port is not declared as a stream or slices, its layout cannot be checked, or its topic cannot be
    /// joined.
    pub fn raw_stream_output(&mut self, port: &str) -> Result<RawStreamOutput, PortError> {
        let (index, plan) = find(&self.component().outputs, port)?;
        let Some(topic) = plan.topic else { return RawStreamOutput::unwired(plan, self.context().clone()) };
        let output = RawStreamOutput::open(&self.participant, self.output_place(index, topic), plan)?;
        self.ports.extend(output.connection());
        Ok(output)
    }

    /// Returns the iceoryx2 domain of the run, for components that exchange data with programs outside the
    /// graph through separate iceoryx2 services.
    pub fn domain(&self) -> &Domain {
        &self.domain
    }

    /// Returns the wiring of an input in the graph, or `None` if it is unwired.
    fn input_place<'a>(&'a self, index: usize, plan: &'a PortPlan) -> Option<InputPlace<'a>> {
        let topic = plan.topic?;
        Some(InputPlace {
            index: topic,
            topic: &self.plan.topics[topic],
            port: &plan.port,
            pin: self.plan.pin(self.index, index),
            is_cause: self.component().cause == Some(index),
            edge: self.plan.edges().iter().position(|edge| *edge == (topic, self.index)),
        })
    }

    /// Returns the wiring of an output to the topic with index `topic`.
    fn output_place(&self, output: usize, topic: usize) -> OutputPlace<'_> {
        let budgets = self.plan.latencies.iter().enumerate();
        let probes = budgets
            .filter(|(_, latency)| latency.component == self.index && latency.output == output)
            .map(|(i, latency)| Probe { index: i, max_ns: latency.max_ns, on_miss: latency.on_miss })
            .collect();
        let wakes_late = self.plan.stays_on_core(topic);
        let is_emergency_stop = self.plan.is_emergency_stop(topic);
        OutputPlace { index: topic, topic: &self.plan.topics[topic], probes, wakes_late, is_emergency_stop }
    }

    /// Opens a declared output.
    ///
    /// # Errors
    /// The port is not declared with this type, or its topic cannot be joined.
    pub fn output<T: StateBuffer>(&mut self, port: &'static str) -> Result<Output<T>, PortError> {
        let (index, plan) = find(&self.component().outputs, port)?;
        same_type(&T::layout(), plan)?;
        let Some(topic) = plan.topic else { return Ok(Output::unwired(port, self.context().clone())) };
        let output = Output::<T>::open(&self.participant, self.output_place(index, topic), port)?;
        self.ports.extend(output.connection());
        Ok(output)
    }

    /// Opens a declared output, like [`output`](Self::output), but with a name that is composed at run time,
    /// for example from the name of a robot.
    ///
    /// # Errors
    /// Same as [`output`](Self::output).
    pub fn named_output<T: StateBuffer>(&mut self, port: &str) -> Result<Output<T>, PortError> {
        // Errors on the hot path name their port without heap memory, so these few bytes live as long as the
        // process.
        self.output(Box::leak(port.to_owned().into_boxed_str()))
    }

    /// Opens a declared parameter.
    ///
    /// # Errors
    /// The parameter is not declared with this type.
    pub fn parameter<T: AnyParameter>(&self, name: &str) -> Result<Parameter<T>, ConfigureError> {
        let (_, numbers, place) = self.find_parameter(name, T::KIND)?;
        Ok(Parameter::new(numbers.clone(), place))
    }

    /// Opens a declared array parameter.
    ///
    /// # Errors
    /// The parameter is not declared with this type.
    pub fn parameter_array(&self, name: &str) -> Result<ParameterArray, ConfigureError> {
        let (declaration, numbers, place) = self.find_parameter(name, ParameterKind::Array)?;
        Ok(ParameterArray::new(numbers.clone(), place, declaration.numbers()))
    }

    fn find_parameter(&self, name: &str, kind: ParameterKind) -> Result<FoundParameter<'_>, ConfigureError> {
        let found = self
            .parameters
            .parameter(name)
            .ok_or_else(|| ConfigureError::failed(format!("parameter `{name}` is not declared")))?;
        let declared = found.0.default.kind();
        if declared != kind {
            return Err(ConfigureError::failed(format!(
                "parameter `{name}` is opened as {kind:?}, expected {declared:?} as declared"
            )));
        }
        Ok(found)
    }

    /// Returns the handle that ends episodes, for components that declared
    /// [`may_end_episodes`](crate::declare::Declare::may_end_episodes). Returns `None` unless the graph sets
    /// `ends_episode = true`.
    pub fn episode_end(&self) -> Option<EpisodeEnd> {
        self.component().ends_episode.then(|| EpisodeEnd { context: self.context().clone() })
    }

    /// Returns the handle that begins episodes in real time, for components that declared
    /// [`may_begin_episodes`](crate::declare::Declare::may_begin_episodes). Returns `None` unless the graph
    /// sets `begins_episodes = true`.
    pub fn episode_driver(&self) -> Option<EpisodeDriver> {
        self.component().begins_episodes.then(|| EpisodeDriver { context: self.context().clone() })
    }
}

/// A handle with which one component begins the episodes of its graph in real time, for example when an
/// operator presses a pedal or a button, or when a task starts its next attempt.
///
/// ```
/// use motorium::component::EpisodeDriver;
///
/// /// Begins an episode when a pedal is pressed. The seed is the number of times that it was.
/// fn press(driver: &Option<EpisodeDriver>, presses: u64) -> bool {
///     driver.as_ref().is_some_and(|driver| driver.begin(presses))
/// }
/// ```
#[derive(Debug)]
pub struct EpisodeDriver {
    context: Rc<Context>,
}

impl EpisodeDriver {
    /// Begins the next episode with this seed. Every component, including this one, enters the episode at its
    /// next step.
    ///
    /// Returns `false` and has no effect if the launcher has not recorded the current episode yet. The
    /// launcher records an episode within 20 ms of its start.
    pub fn begin(&self, seed: u64) -> bool {
        self.context.region().header().begin_next_episode(seed, crate::os::monotonic_ns())
    }
}

/// A handle with which one component ends the episodes of its graph, for example when a task has succeeded or
/// failed.
///
/// ```
/// use motorium::prelude::*;
///
/// /// Ends the episode of a robot that fell.
/// fn watch(end: &Option<EpisodeEnd>, base: &BaseState) {
///     if let Some(end) = end && base.position[2] < 0.1 {
///         end.end();
///     }
/// }
/// ```
#[derive(Debug)]
pub struct EpisodeEnd {
    context: Rc<Context>,
}

impl EpisodeEnd {
    /// Ends the current episode: in lockstep once all components due at this time have stepped, in real time
    /// within 20 ms.
    pub fn end(&self) {
        self.context.region().header().end_episode(self.context.episode());
    }
}

fn find<'a>(ports: &'a [PortPlan], name: &str) -> Result<(usize, &'a PortPlan), PortError> {
    ports
        .iter()
        .enumerate()
        .find(|(_, port)| port.port == name)
        .ok_or_else(|| PortError::NotDeclared { port: name.to_string() })
}

fn same_type(layout: &TypeLayout, plan: &PortPlan) -> Result<(), PortError> {
    if *layout == plan.layout {
        return Ok(());
    }
    Err(PortError::TypeChanged {
        port: plan.port.clone(),
        difference: plan.layout.difference("declared", layout, "opened"),
    })
}
