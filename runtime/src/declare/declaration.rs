//! The declaration of a component: its ports, its parameters, its needs.

use core::cell::Cell;

use serde::{Deserialize, Serialize};

use super::RobotReference;
use crate::state::{StateBuffer, TypeLayout};

/// The direction of a port.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// Reads.
    Input,
    /// Writes.
    Output,
}

/// The pattern by which a topic carries its samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TopicPattern {
    /// State: the newest value; older ones are gone.
    State,
    /// Stream: a queue for each reader; samples that do not fit are dropped, oldest first, and counted.
    Stream {
        /// Samples a reader may lag behind before it loses the oldest.
        capacity: usize,
    },
    /// A queue of this many slices per reader, each of another length.
    Slices {
        /// Slices a reader may lag behind before it loses the oldest.
        capacity: usize,
        /// Elements of the longest slice. An input declares 0: its topic's writer says it.
        longest: usize,
    },
}

impl TopicPattern {
    /// Samples or slices in a queue; `None` for a state, which has none.
    pub fn capacity(self) -> Option<usize> {
        match self {
            Self::State => None,
            Self::Stream { capacity } | Self::Slices { capacity, .. } => Some(capacity),
        }
    }
}

/// A declared port.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PortDeclaration {
    /// Name of the port in the component's `subscribe` or `publish` table.
    pub name: String,
    /// Reads or writes.
    pub direction: Direction,
    /// State or stream.
    pub pattern: TopicPattern,
    /// Layout of its samples.
    pub layout: TypeLayout,
    /// True if the graph must wire it.
    pub required: bool,
    /// One line of explanation.
    pub doc: String,
}

/// The type of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ParameterKind {
    /// A 64-bit float.
    Float,
    /// A 64-bit signed integer.
    Integer,
    /// True or false.
    Boolean,
}

/// The value of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(untagged)]
pub enum ParameterValue {
    /// True or false.
    Boolean(bool),
    /// A 64-bit signed integer.
    Integer(i64),
    /// A 64-bit float.
    Float(f64),
}

impl ParameterValue {
    /// The kind of this value.
    pub fn kind(&self) -> ParameterKind {
        match self {
            Self::Boolean(_) => ParameterKind::Boolean,
            Self::Integer(_) => ParameterKind::Integer,
            Self::Float(_) => ParameterKind::Float,
        }
    }
}

impl From<f64> for ParameterValue {
    fn from(value: f64) -> Self {
        Self::Float(value)
    }
}

impl From<i64> for ParameterValue {
    fn from(value: i64) -> Self {
        Self::Integer(value)
    }
}

impl From<bool> for ParameterValue {
    fn from(value: bool) -> Self {
        Self::Boolean(value)
    }
}

impl core::fmt::Display for ParameterValue {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Boolean(value) => write!(f, "{value}"),
            Self::Integer(value) => write!(f, "{value}"),
            Self::Float(value) => write!(f, "{value}"),
        }
    }
}

/// A declared parameter: a value that may change while the component runs, applied between two steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct ParameterDeclaration {
    /// Name of the parameter, unique in its component.
    pub name: String,
    /// Value unless the graph file sets another.
    pub default: ParameterValue,
    /// Smallest value allowed.
    pub min: Option<f64>,
    /// Largest value allowed.
    pub max: Option<f64>,
    /// Unit, or empty.
    pub unit: String,
    /// One line of explanation.
    pub doc: String,
}

impl ParameterDeclaration {
    /// Checks a value against type and range; an integer is accepted for a float.
    ///
    /// # Errors
    /// A text with the value found and the values expected.
    pub fn admit(&self, value: ParameterValue) -> Result<ParameterValue, String> {
        let value = match (self.default.kind(), value) {
            (ParameterKind::Float, ParameterValue::Integer(i)) => ParameterValue::Float(i as f64),
            (_, value) => value,
        };
        if value.kind() != self.default.kind() {
            return Err(format!(
                "parameter `{}` is {value}, expected {}",
                self.name,
                match self.default.kind() {
                    ParameterKind::Float => "a number",
                    ParameterKind::Integer => "a whole number",
                    ParameterKind::Boolean => "true or false",
                }
            ));
        }
        let number = match value {
            ParameterValue::Float(x) => x,
            ParameterValue::Integer(i) => i as f64,
            ParameterValue::Boolean(_) => return Ok(value),
        };
        let (low, high) = (self.min.unwrap_or(f64::NEG_INFINITY), self.max.unwrap_or(f64::INFINITY));
        if !number.is_finite() || number < low || number > high {
            let range = match (self.min, self.max) {
                (Some(low), Some(high)) => format!("from {low} to {high}"),
                (Some(low), None) => format!("at least {low}"),
                (None, Some(high)) => format!("at most {high}"),
                (None, None) => "a finite number".to_string(),
            };
            return Err(format!("parameter `{}` is {value}, expected {range}", self.name));
        }
        Ok(value)
    }
}

/// Everything a component declares.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Declaration {
    /// Ports in the order of their declaration.
    pub ports: Vec<PortDeclaration>,
    /// Parameters in the order of their declaration.
    pub parameters: Vec<ParameterDeclaration>,
    /// True for the side that applies commands (physics, drives): it must reach the safe state by itself.
    pub actuator: bool,
    /// True if it can be reset for a new episode.
    #[serde(default)]
    pub resets: bool,
    /// True if it can end an episode.
    #[serde(default)]
    pub may_end_episodes: bool,
    /// True if a file descriptor can release its steps.
    #[serde(default)]
    pub wakes_on_descriptor: bool,
}

/// The receiver of a component's declarations.
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
    /// The component asked for them: it can work on several.
    takes_several: Cell<bool>,
}

impl Declare {
    /// An empty declaration for a component that works on `robot`.
    pub fn new(robot: Option<RobotReference>) -> Self {
        Self {
            declaration: Declaration::default(),
            robot,
            robots: Vec::new(),
            takes_several: Cell::new(false),
        }
    }

    /// An empty declaration for a component that works on several robots.
    pub fn of_robots(robots: Vec<RobotReference>) -> Self {
        Self { robots, ..Self::new(None) }
    }

    /// The collected declaration.
    pub fn into_declaration(self) -> Declaration {
        self.declaration
    }

    /// The robot the graph file gives this component, if any.
    pub fn robot(&self) -> Option<&RobotReference> {
        self.robot.as_ref()
    }

    /// The robots the graph file gives this component by `robots`; empty where it gives it one by `robot`, or none. A
    /// component that never asks works on one robot at most, and `robots` is refused.
    pub fn robots(&self) -> &[RobotReference] {
        self.takes_several.set(true);
        &self.robots
    }

    /// True unless the graph file gives several robots to a component that works on one at most.
    pub(crate) fn robots_fit(&self) -> bool {
        self.robots.is_empty() || self.takes_several.get()
    }

    /// An input that the graph must wire: the newest value of a topic.
    pub fn input<T: StateBuffer>(&mut self, name: &str, doc: &str) {
        self.port::<T>(name, Direction::Input, TopicPattern::State, true, doc);
    }

    /// An input that the graph may leave out.
    pub fn optional_input<T: StateBuffer>(&mut self, name: &str, doc: &str) {
        self.port::<T>(name, Direction::Input, TopicPattern::State, false, doc);
    }

    /// An output. The graph may leave it unwired; its samples are then discarded.
    pub fn output<T: StateBuffer>(&mut self, name: &str, doc: &str) {
        self.port::<T>(name, Direction::Output, TopicPattern::State, false, doc);
    }

    /// An input that reads every sample of a stream topic.
    pub fn stream_input<T: StateBuffer>(&mut self, name: &str, capacity: usize, doc: &str) {
        self.port::<T>(name, Direction::Input, TopicPattern::Stream { capacity }, true, doc);
    }

    /// An output whose readers may ask for every sample.
    pub fn stream_output<T: StateBuffer>(&mut self, name: &str, capacity: usize, doc: &str) {
        self.port::<T>(name, Direction::Output, TopicPattern::Stream { capacity }, false, doc);
    }

    /// An input that reads every slice of a stream of slices, such as images or frames.
    pub fn slice_input<T: StateBuffer>(&mut self, name: &str, capacity: usize, doc: &str) {
        self.port::<T>(name, Direction::Input, TopicPattern::Slices { capacity, longest: 0 }, true, doc);
    }

    /// An output of slices of up to `longest` elements, such as images or frames.
    pub fn slice_output<T: StateBuffer>(&mut self, name: &str, longest: usize, capacity: usize, doc: &str) {
        self.port::<T>(name, Direction::Output, TopicPattern::Slices { capacity, longest }, false, doc);
    }

    /// An input that the graph must wire, to a topic of any type: the newest value as bytes, with the layout that the
    /// topic's writer declares. For what passes values on without knowing them, such as bridges and recorders.
    pub fn raw_input(&mut self, name: &str, doc: &str) {
        self.any_input(name, true, doc);
    }

    /// As [`raw_input`](Self::raw_input), of an input that the graph may leave out.
    pub fn optional_raw_input(&mut self, name: &str, doc: &str) {
        self.any_input(name, false, doc);
    }

    fn any_input(&mut self, name: &str, required: bool, doc: &str) {
        self.add(PortDeclaration {
            name: name.to_string(),
            direction: Direction::Input,
            pattern: TopicPattern::State,
            layout: TypeLayout::any(),
            required,
            doc: doc.to_string(),
        });
    }

    /// An output of a type that the configuration names.
    pub fn raw_output(&mut self, name: &str, layout: TypeLayout, doc: &str) {
        self.add(PortDeclaration {
            name: name.to_string(),
            direction: Direction::Output,
            pattern: TopicPattern::State,
            layout,
            required: false,
            doc: doc.to_string(),
        });
    }

    /// This component applies commands to a robot: it reaches the safe state by itself when they go stale.
    pub fn actuator(&mut self) {
        self.declaration.actuator = true;
    }

    /// This component can end an episode ([`Setup::episode_end`](crate::component::Setup::episode_end)), in a graph that
    /// says `ends_episode = true`.
    pub fn may_end_episodes(&mut self) {
        self.declaration.may_end_episodes = true;
    }

    /// This component has a file descriptor, such as a socket, that can release its steps: a graph may say
    /// `activate = { on = "fd", min_interval = "1 ms" }`. It names the descriptor by
    /// [`Setup::wake_on`](crate::component::Setup::wake_on).
    pub fn wakes_on_descriptor(&mut self) {
        self.declaration.wakes_on_descriptor = true;
    }

    /// A number that may change while the component runs, within `range`, in `unit`.
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

    /// A whole number that may change while the component runs, within `range`.
    pub fn integer(&mut self, name: &str, default: i64, range: core::ops::RangeInclusive<i64>, doc: &str) {
        let range = Some((*range.start() as f64, *range.end() as f64));
        self.parameter(name, ParameterValue::Integer(default), range, "", doc);
    }

    /// A switch that may change while the component runs.
    pub fn boolean(&mut self, name: &str, default: bool, doc: &str) {
        self.parameter(name, ParameterValue::Boolean(default), None, "", doc);
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
            "port `{}` declared twice",
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
            unit: unit.to_string(),
            doc: doc.to_string(),
        });
    }
}
