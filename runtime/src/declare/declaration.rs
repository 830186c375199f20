//! The declaration of a component: its ports, parameters and requirements.

use core::cell::Cell;
use std::path::Path;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::{
    ClockKind, DeclareWarning, Direction, ParameterDeclaration, ParameterValue, Placement, PortDeclaration,
    RobotReference, Taps, TopicPattern,
};
use crate::state::{StateBuffer, TypeLayout};

/// Everything a component declares.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Declaration {
    /// Ports in the order of their declaration.
    pub ports: Vec<PortDeclaration>,
    /// Parameters in the order of their declaration.
    pub parameters: Vec<ParameterDeclaration>,
    /// `true` for a component that applies commands (physics, drives). It must be able to reach its safe
    /// state without help from other components.
    pub actuator: bool,
    /// True if the component can be reset for a new episode.
    #[serde(default)]
    pub resets: bool,
    /// True if the component can end an episode.
    #[serde(default)]
    pub may_end_episodes: bool,
    /// True if the component can begin episodes in real time.
    #[serde(default, skip_serializing_if = "core::ops::Not::not")]
    pub may_begin_episodes: bool,
    /// True if a file descriptor can release the component's steps.
    #[serde(default)]
    pub wakes_on_descriptor: bool,
    /// Maximum time for which a step sleeps while it waits for an answer from outside the graph, ns; 0 if
    /// steps never wait.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub waits_ns: u64,
    /// Reason why the component cannot keep deadlines; `None` if it can.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub not_real_time: Option<String>,
    /// Topics of which the component reads every value through taps, or `None`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub taps: Option<Taps>,
    /// Warnings about a valid but probably unintended configuration.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<DeclareWarning>,
    /// Facts about the component in this graph that its table in the graph file does not show, one sentence
    /// each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
}

fn is_zero(number: &u64) -> bool {
    *number == 0
}

/// Collects the declarations of a component: its ports, parameters and requirements.
///
/// ```
/// use motorium::prelude::*;
///
/// let mut declare = Declare::new(None);
/// declare.input::<JointState>("state", "measured joint state");
/// declare.output::<JointState>("filtered", "joint state with filtered velocities");
/// declare.float("time_constant", 0.01, 0.0..=1.0, "s", "time constant of the filter");
///
/// let declaration = declare.into_declaration();
/// assert_eq!(declaration.ports.len(), 2);
/// assert!(declaration.parameters[0].admit(motorium::declare::ParameterValue::Float(2.0)).is_err());
/// ```
#[derive(Debug)]
pub struct Declare {
    pub(crate) declaration: Declaration,
    robot: Option<RobotReference>,
    robots: Vec<RobotReference>,
    placement: Placement,
    /// True once the component has read its list of robots, which means that it supports several.
    takes_several: Cell<bool>,
}

impl Declare {
    /// Creates an empty declaration for a component that works on `robot`, or on no robot.
    pub fn new(robot: Option<RobotReference>) -> Self {
        Self {
            declaration: Declaration::default(),
            robot,
            robots: Vec::new(),
            placement: Placement::default(),
            takes_several: Cell::new(false),
        }
    }

    /// Creates an empty declaration for a component that works on several robots.
    pub fn of_robots(robots: Vec<RobotReference>) -> Self {
        Self { robots, ..Self::new(None) }
    }

    /// Sets the placement of the component in its graph.
    #[must_use]
    pub fn placed(self, placement: Placement) -> Self {
        Self { placement, ..self }
    }

    /// Returns the nominal time between two steps, like `Setup::period`. Returns `None` outside a graph, and
    /// if the rates or triggers in the graph file are invalid. Invalid rates and triggers are reported
    /// separately.
    pub fn period(&self) -> Option<Duration> {
        self.placement.period
    }

    /// Returns the clock of the graph: real time or lockstep.
    pub fn clock(&self) -> ClockKind {
        self.placement.clock
    }

    /// Returns the folder that relative paths in the `config` table refer to, like `Setup::folder`. This is
    /// the folder of the graph file that contains the component.
    pub fn folder(&self) -> &Path {
        &self.placement.folder
    }

    /// Returns `true` if the component's `subscribe` table in the graph contains this port, like
    /// `Setup::subscribes`. Intended for components whose role depends on the wiring. Always `false` outside
    /// a graph.
    ///
    /// ```
    /// use motorium::declare::{Declare, Placement};
    ///
    /// let placement = Placement { subscribed: vec!["follow".to_owned()], ..Placement::default() };
    /// let declare = Declare::new(None).placed(placement);
    /// assert!(declare.subscribes("follow") && !declare.subscribes("joint_command"));
    /// ```
    pub fn subscribes(&self, port: &str) -> bool {
        self.placement.subscribed.iter().any(|subscribed| subscribed == port)
    }

    /// Adds a fact about the component in this graph that its table in the graph file does not show.
    /// `motorium check` prints the fact after the component's name.
    pub fn note(&mut self, fact: impl Into<String>) {
        self.declaration.notes.push(fact.into());
    }

    /// Adds a warning about a valid but probably unintended configuration. `motorium check` and `run` print
    /// the warning with its position in the graph file: the component, or the key set by
    /// [`DeclareWarning::key`](method@DeclareWarning::key).
    ///
    /// ```
    /// use motorium::prelude::*;
    ///
    /// fn check_latency(latency: TimeSpan, declare: &mut Declare) {
    ///     if let Some(period) = declare.period() && period > latency.into() {
    ///         declare
    ///             .warn(format!("a latency of {latency}, less than a period of the component"))
    ///             .key("latency")
    ///             .advise("raise its rate");
    ///     }
    /// }
    /// ```
    pub fn warn(&mut self, message: impl Into<String>) -> &mut DeclareWarning {
        let warnings = &mut self.declaration.warnings;
        warnings.push(DeclareWarning::new(message));
        let last = warnings.len() - 1;
        &mut warnings[last]
    }

    /// Returns the collected declaration.
    pub fn into_declaration(self) -> Declaration {
        self.declaration
    }

    /// Returns the robot named by the component's key `robot` in the graph file, or `None`.
    pub fn robot(&self) -> Option<&RobotReference> {
        self.robot.as_ref()
    }

    /// Returns the robots listed under the component's key `robots` in the graph file. Empty if the component
    /// has a single `robot` or no robot. A component that never calls this function supports at most one
    /// robot, so a graph that sets `robots` for the component is rejected.
    pub fn robots(&self) -> &[RobotReference] {
        self.takes_several.set(true);
        &self.robots
    }

    /// Returns `false` if the graph file assigns several robots to a component that supports at most one.
    pub(crate) fn robots_fit(&self) -> bool {
        self.robots.is_empty() || self.takes_several.get()
    }

    /// Declares an input that reads the newest value of a topic. The graph must wire the input to a topic.
    pub fn input<T: StateBuffer>(&mut self, name: &str, doc: &str) {
        self.port::<T>(name, Direction::Input, TopicPattern::State, true, doc);
    }

    /// Declares an input that reads the newest value of a topic. The graph may leave the input unwired.
    pub fn optional_input<T: StateBuffer>(&mut self, name: &str, doc: &str) {
        self.port::<T>(name, Direction::Input, TopicPattern::State, false, doc);
    }

    /// Declares an output for the newest value of a topic. Samples of an unwired output are discarded.
    pub fn output<T: StateBuffer>(&mut self, name: &str, doc: &str) {
        self.port::<T>(name, Direction::Output, TopicPattern::State, false, doc);
    }

    /// Declares an input that reads every sample of a stream, through a queue of `capacity` samples.
    pub fn stream_input<T: StateBuffer>(&mut self, name: &str, capacity: usize, doc: &str) {
        self.port::<T>(name, Direction::Input, TopicPattern::Stream { capacity }, true, doc);
    }

    /// Declares an output of a stream. Each reader may read every sample, through a queue of `capacity`
    /// samples.
    pub fn stream_output<T: StateBuffer>(&mut self, name: &str, capacity: usize, doc: &str) {
        self.port::<T>(name, Direction::Output, TopicPattern::Stream { capacity }, false, doc);
    }

    /// Declares an input that reads every slice of a stream, such as images or frames, through a queue of
    /// `capacity` slices.
    pub fn slice_input<T: StateBuffer>(&mut self, name: &str, capacity: usize, doc: &str) {
        self.port::<T>(name, Direction::Input, TopicPattern::Slices { capacity, longest: 0 }, true, doc);
    }

    /// Declares an output of slices, such as images or frames, of at most `longest` elements per slice. Each
    /// reader has a queue of `capacity` slices.
    pub fn slice_output<T: StateBuffer>(&mut self, name: &str, longest: usize, capacity: usize, doc: &str) {
        self.port::<T>(name, Direction::Output, TopicPattern::Slices { capacity, longest }, false, doc);
    }

    /// Declares an input that reads the newest value of a topic of any type, as bytes. The graph must wire
    /// the input, and the topic's writer declares the layout of the bytes. Intended for bridges and
    /// recorders.
    pub fn raw_input(&mut self, name: &str, doc: &str) {
        self.any_input(name, true, doc);
    }

    /// Declares an input like [`raw_input`](Self::raw_input) that the graph may leave unwired.
    pub fn optional_raw_input(&mut self, name: &str, doc: &str) {
        self.any_input(name, false, doc);
    }

    /// Declares an input that reads every value of a stream of any type, as bytes, through a queue of
    /// `capacity` values. The graph must wire the input to a topic.
    pub fn raw_stream_input(&mut self, name: &str, capacity: usize, doc: &str) {
        self.any_port(name, TopicPattern::Stream { capacity }, true, doc);
    }

    /// Declares an input that reads every slice of a stream of any type, as bytes and the number of elements,
    /// through a queue of `capacity` slices. The graph must wire the input to a topic.
    pub fn raw_slice_input(&mut self, name: &str, capacity: usize, doc: &str) {
        self.any_port(name, TopicPattern::Slices { capacity, longest: 0 }, true, doc);
    }

    fn any_input(&mut self, name: &str, required: bool, doc: &str) {
        self.any_port(name, TopicPattern::State, required, doc);
    }

    fn any_port(&mut self, name: &str, pattern: TopicPattern, required: bool, doc: &str) {
        self.add(PortDeclaration {
            name: name.to_string(),
            direction: Direction::Input,
            pattern,
            layout: TypeLayout::any(),
            required,
            doc: doc.to_string(),
        });
    }

    /// Declares an output for the newest value of a topic whose type is only known at run time.
    pub fn raw_output(&mut self, name: &str, layout: TypeLayout, doc: &str) {
        self.raw_port(name, layout, TopicPattern::State, doc);
    }

    /// Declares an output of a stream whose type is only known at run time. Each reader has a queue of
    /// `capacity` values.
    pub fn raw_stream_output(&mut self, name: &str, layout: TypeLayout, capacity: usize, doc: &str) {
        self.raw_port(name, layout, TopicPattern::Stream { capacity }, doc);
    }

    /// Declares an output of slices whose element type is only known at run time. A slice has at most
    /// `longest` elements. Each reader has a queue of `capacity` slices.
    pub fn raw_slice_output(
        &mut self,
        name: &str,
        layout: TypeLayout,
        longest: usize,
        capacity: usize,
        doc: &str,
    ) {
        self.raw_port(name, layout, TopicPattern::Slices { capacity, longest }, doc);
    }

    fn raw_port(&mut self, name: &str, layout: TypeLayout, pattern: TopicPattern, doc: &str) {
        self.add(PortDeclaration {
            name: name.to_string(),
            direction: Direction::Output,
            pattern,
            layout,
            required: false,
            doc: doc.to_string(),
        });
    }

    /// Declares that this component applies commands to a robot. Such a component must enter its safe state
    /// without outside help when the commands become stale.
    pub fn actuator(&mut self) {
        self.declaration.actuator = true;
    }

    /// Declares that this component can end an episode (`Setup::episode_end`). The component is only
    /// permitted to end episodes if the graph sets `ends_episode = true`.
    pub fn may_end_episodes(&mut self) {
        self.declaration.may_end_episodes = true;
    }

    /// Declares that this component can begin episodes in real time (`Setup::episode_driver`). The component
    /// is only permitted to begin episodes if the graph sets `begins_episodes = true`.
    pub fn may_begin_episodes(&mut self) {
        self.declaration.may_begin_episodes = true;
    }

    /// Declares that this component can be reset for a new episode. Only needed by components whose type is
    /// only known at run time; types that implement `Component` set `Component::RESETS`.
    pub fn resets(&mut self) {
        self.declaration.resets = true;
    }

    /// Declares that this component has a file descriptor, such as a socket, that can release its steps. A
    /// graph may then set `activate = { on = "fd", min_interval = "1 ms" }`. The component passes the
    /// descriptor to `Setup::wake_on`.
    pub fn wakes_on_descriptor(&mut self) {
        self.declaration.wakes_on_descriptor = true;
    }

    /// Declares that a step waits for an answer from outside the graph, for example from a device, for at
    /// most `longest`. The component sleeps while it waits, so other components can use the core. The wait
    /// counts towards the step's response time but not towards its budget.
    ///
    /// ```
    /// use motorium::prelude::*;
    /// use std::time::Duration;
    ///
    /// let mut declare = Declare::new(None);
    /// declare.waits(Duration::from_micros(500));
    /// assert_eq!(declare.into_declaration().waits_ns, 500_000);
    /// ```
    pub fn waits(&mut self, longest: Duration) {
        self.declaration.waits_ns = u64::try_from(longest.as_nanos()).unwrap_or(u64::MAX);
    }

    /// Declares that this component cannot keep deadlines. `reason` names the cause, for example garbage
    /// collection or an interpreter's lock. The scheduling class of the component then defaults to `normal`.
    /// `motorium check` prints a warning with the reason and the names of the real-time components that
    /// depend on this component.
    ///
    /// ```
    /// use motorium::prelude::*;
    ///
    /// let mut declare = Declare::new(None);
    /// declare.not_real_time("its interpreter collects garbage");
    /// assert!(declare.into_declaration().not_real_time.is_some());
    /// ```
    pub fn not_real_time(&mut self, reason: &str) {
        self.declaration.not_real_time = Some(reason.to_string());
    }

    /// Declares that this component reads every value of some topics through taps (`Setup::observer`). The
    /// tapped topics keep enough old values to bridge the time for which a tap may go unread.
    ///
    /// ```
    /// use motorium::declare::{Declare, Taps};
    /// use std::time::Duration;
    ///
    /// let mut declare = Declare::new(None);
    /// declare.taps(Taps::new(["panda/*"], Duration::from_millis(200)));
    /// assert!(declare.into_declaration().taps.is_some());
    /// ```
    pub fn taps(&mut self, taps: Taps) {
        self.declaration.taps = Some(taps);
    }

    /// Declares a floating-point parameter in `unit`. The value may change at run time within `range`.
    pub fn float(
        &mut self,
        name: &str,
        default: f64,
        range: core::ops::RangeInclusive<f64>,
        unit: &str,
        doc: &str,
    ) {
        self.parameter(name, ParameterValue::Float(default), Some((*range.start(), *range.end())), unit, doc);
    }

    /// Declares an integer parameter. The value may change at run time within `range`.
    pub fn integer(&mut self, name: &str, default: i64, range: core::ops::RangeInclusive<i64>, doc: &str) {
        let range = Some((*range.start() as f64, *range.end() as f64));
        self.parameter(name, ParameterValue::Integer(default), range, "", doc);
    }

    /// Declares a Boolean parameter. The value may change at run time.
    pub fn boolean(&mut self, name: &str, default: bool, doc: &str) {
        self.parameter(name, ParameterValue::Boolean(default), None, "", doc);
    }

    /// Declares a parameter whose value is one of `choices` and may change at run time. `default` must be one
    /// of the choices. The component reads the value as a `Choice`: the index of the chosen name.
    pub fn choice(&mut self, name: &str, choices: &[&str], default: &str, doc: &str) {
        self.parameter(name, ParameterValue::Choice(default.to_string()), None, "", doc);
        if let Some(declared) = self.declaration.parameters.last_mut() {
            declared.choices = choices.iter().map(ToString::to_string).collect();
        }
    }

    /// Declares an array parameter in `unit`. The array may change at run time, all entries together. Its
    /// length is the length of `default`, and each entry must be within `range`. The component opens the
    /// array with `Setup::parameter_array`.
    pub fn array(
        &mut self,
        name: &str,
        default: &[f64],
        range: core::ops::RangeInclusive<f64>,
        unit: &str,
        doc: &str,
    ) {
        let range = Some((*range.start(), *range.end()));
        self.parameter(name, ParameterValue::Array(default.to_vec()), range, unit, doc);
    }

    fn port<T: StateBuffer>(
        &mut self,
        name: &str,
        direction: Direction,
        pattern: TopicPattern,
        required: bool,
        doc: &str,
    ) {
        let (name, layout, doc) = (name.to_string(), T::layout(), doc.to_string());
        self.add(PortDeclaration { name, direction, pattern, layout, required, doc });
    }

    fn add(&mut self, port: PortDeclaration) {
        debug_assert!(
            self.declaration.ports.iter().all(|other| other.name != port.name),
            "port `{}` is declared twice",
            port.name
        );
        self.declaration.ports.push(port);
    }

    fn parameter(
        &mut self,
        name: &str,
        default: ParameterValue,
        range: Option<(f64, f64)>,
        unit: &str,
        doc: &str,
    ) {
        let finite = |x: f64| x.is_finite().then_some(x);
        self.declaration.parameters.push(ParameterDeclaration {
            name: name.to_string(),
            default,
            min: range.and_then(|(low, _)| finite(low)),
            max: range.and_then(|(_, high)| finite(high)),
            choices: Vec::new(),
            unit: unit.to_string(),
            doc: doc.to_string(),
        });
    }
}
