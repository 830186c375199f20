//! Plans: resolved and checked graph files, as used by the launcher, the workers and the tools.
//!
//! `graph::load` creates a plan, which is passed to the worker processes as JSON. Plans are never written by
//! hand.

mod expectation;
mod faults;
mod safety;
mod topics;

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

pub use crate::declare::ClockKind;
use crate::declare::{ParameterDeclaration, ParameterValue, RobotReference, TopicPattern};
use crate::state::{Digest, TypeLayout};
pub use expectation::{Comparison, Expectation, ExpectationError};
pub use faults::{LivenessPlan, OnError, OnFailure, OnOverrun, RestartPlan, RestartWhen};
pub(crate) use safety::EMERGENCY_STOP_PORT;
pub use safety::{ActuatorSafety, GateRules, LimitPolicy, ResumeRule, SafeState, SafetyPlan};
pub use topics::{LatencyPlan, OnMiss, TopicPlan};

/// A resolved and checked graph.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Name of the graph.
    pub name: String,
    /// Path of the graph file, for messages.
    pub file: PathBuf,
    /// Clock of the run: real time or lockstep.
    pub clock: ClockKind,
    /// Duration of the run, ns; `None` if the run continues until it is stopped.
    pub duration_ns: Option<u64>,
    /// Seed of the run, from which the seeds of all components are derived.
    pub seed: u64,
    /// Episodes of the run; `None` if it is not divided into episodes.
    #[serde(default)]
    pub episodes: Option<EpisodesPlan>,
    /// Components in the order of the file. All parts of the plan refer to a component by its index in this
    /// list.
    pub components: Vec<ComponentPlan>,
    /// Topics in the order of their first mention in the file.
    pub topics: Vec<TopicPlan>,
    /// End-to-end latency budgets.
    pub latencies: Vec<LatencyPlan>,
    /// Cores and scheduling of the whole graph.
    pub scheduling: SchedulingPlan,
    /// Limits and states for the safety of the robot.
    pub safety: SafetyPlan,
    /// Conditions that the report of the run must satisfy.
    #[serde(default)]
    pub expectations: Vec<Expectation>,
    /// Minimum capacity of each component's trace, in events; 0 if the run is not traced. Unread events
    /// beyond the capacity are lost.
    #[serde(default)]
    pub trace_events: usize,
}

impl Plan {
    /// Returns the safety rules of an actuator: its own rules if its table sets any, otherwise the rules in
    /// the graph's `[safety]` table.
    pub fn safety_of(&self, component: &ComponentPlan) -> ActuatorSafety {
        component.safety.unwrap_or_else(|| self.safety.of_actuators())
    }

    /// Returns the longest time for which any actuator of the graph stays in its safe state before it is
    /// stopped, ns. The result is not less than the graph's `settle_ns`.
    pub fn settle_ns(&self) -> u64 {
        let own = self.components.iter().filter_map(|component| Some(component.safety?.settle_ns));
        own.fold(self.safety.settle_ns, u64::max)
    }

    /// Returns the component that begins the episodes of a run in real time, or `None` if no component does.
    pub fn episode_driver(&self) -> Option<&ComponentPlan> {
        self.components.iter().find(|component| component.begins_episodes)
    }
}

/// The episodes of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct EpisodesPlan {
    /// Number of episodes. An episode lasts for the duration of the plan, or until a component ends the
    /// episode.
    pub count: u64,
    /// If true, the seed of each episode is the plan's seed plus the episode's index; otherwise it is the
    /// plan's seed.
    pub vary_seed: bool,
}

impl EpisodesPlan {
    /// Returns the seed of episode `index` in a run with seed `of_run`.
    pub fn seed(self, of_run: u64, index: u64) -> u64 {
        if self.vary_seed { of_run.wrapping_add(index) } else { of_run }
    }
}

/// Returns the seed of a component in a run or an episode with seed `seed`. It depends on the component's
/// name rather than its index, so adding a component does not change the seeds of others.
pub(crate) fn component_seed(seed: u64, name: &str) -> u64 {
    let mut digest = Digest::default();
    digest.write_u64(seed);
    digest.write(name.as_bytes());
    digest.finish()
}

/// Policy for real-time requests that the system denies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnDenied {
    /// Run without the denied settings, and print one line that lists the denied requests.
    Warn,
    /// Refuse to run.
    Strict,
}

/// Scheduling for the whole graph.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SchedulingPlan {
    /// Cores for everything that is not real-time: launcher, tools, and components of class `Normal`.
    pub shared_cores: Vec<usize>,
    /// Policy for real-time requests that the system denies.
    pub on_denied: OnDenied,
    /// Maximum exit latency of idle states while the graph runs in real time, ns.
    pub idle_exit_ns: u64,
}

/// Time before each release at which a component stops sleeping and starts spinning.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Spin {
    /// A fixed time.
    Fixed {
        /// Time before the release, ns; 0 disables spinning.
        ns: u64,
    },
    /// A time that adapts to the wake-up errors measured on the machine.
    Tuned {
        /// Upper limit of the adapted time, ns.
        at_most_ns: u64,
    },
}

impl Spin {
    /// Returns the longest possible time of spinning before a release, ns.
    pub fn at_most_ns(self) -> u64 {
        match self {
            Self::Fixed { ns } | Self::Tuned { at_most_ns: ns } => ns,
        }
    }
}

/// The program that runs a component.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Program {
    /// A kind that the launching program contains.
    Builtin {
        /// Name of the kind.
        kind: String,
    },
    /// A kind that a separate installed program contains.
    Sibling {
        /// Name of the kind.
        kind: String,
        /// Path of the executable.
        path: PathBuf,
    },
    /// A program of the user.
    Exec {
        /// Path of the executable.
        path: PathBuf,
    },
}

/// Condition that releases the steps of a component.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Activation {
    /// Time-triggered: released at `start + phase + n * period`.
    Periodic {
        /// Period, ns.
        period_ns: u64,
        /// Offset of the first release, ns.
        phase_ns: u64,
    },
    /// Released by each publication of a topic.
    Triggered {
        /// Index of the topic in the plan.
        topic: usize,
        /// Index in `inputs` of the port that reads the topic.
        input: usize,
        /// Period of the component at the head of the chain, ns.
        period_ns: u64,
    },
    /// Sporadic: released while a file descriptor of the component is readable.
    Descriptor {
        /// Minimum time between two releases, ns.
        min_interval_ns: u64,
    },
}

impl Activation {
    /// Returns the nominal time between two steps, ns. For a sporadic component, this is the minimum interval
    /// between two releases.
    pub fn period_ns(&self) -> u64 {
        match *self {
            Self::Periodic { period_ns, .. } | Self::Triggered { period_ns, .. } => period_ns,
            Self::Descriptor { min_interval_ns } => min_interval_ns,
        }
    }

    /// Returns `true` if the component is at the head of a trigger chain, that is, if no other component
    /// releases it.
    pub fn is_head(&self) -> bool {
        !matches!(self, Self::Triggered { .. })
    }
}

/// Scheduling class of a component.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SchedulingClass {
    /// `SCHED_FIFO` with this priority, 1 to 99.
    Fifo(u8),
    /// `SCHED_DEADLINE`: the kernel grants the component `runtime_ns` of CPU time in every period and no
    /// more, ahead of all `SCHED_FIFO` threads. The component may run on any core.
    Deadline {
        /// CPU time granted in each period, ns.
        runtime_ns: u64,
        /// Period and relative deadline, ns.
        period_ns: u64,
    },
    /// The default time sharing of the operating system (`SCHED_OTHER`).
    Normal,
}

/// A port wired to a topic.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PortPlan {
    /// Name of the port.
    pub port: String,
    /// Index of the topic in the plan; `None` if the graph leaves the port unwired.
    pub topic: Option<usize>,
    /// Delivery pattern as declared by this port.
    pub pattern: TopicPattern,
    /// Layout of the samples.
    pub layout: TypeLayout,
}

/// A parameter with its initial value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParameterPlan {
    /// Declaration of the parameter: name, default and range.
    pub declaration: ParameterDeclaration,
    /// Value at the start of the run.
    pub initial: ParameterValue,
}

/// A resolved component.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ComponentPlan {
    /// Name of the component in the graph.
    pub name: String,
    /// Program that runs the component.
    pub program: Program,
    /// Condition that releases the component's steps.
    pub activation: Activation,
    /// Allowed execution time per step, ns; `None` if the graph sets no budget.
    pub budget_ns: Option<u64>,
    /// Maximum time for which a step waits for an answer from outside the graph, without using the core, ns.
    #[serde(default)]
    pub waits_ns: u64,
    /// Core to which the component is pinned; `None` if it may run on any shared core or, with
    /// `SCHED_DEADLINE`, on any core.
    pub core: Option<usize>,
    /// Spinning before each release. A triggered component does not spin.
    pub spin: Spin,
    /// Scheduling class.
    pub class: SchedulingClass,
    /// Amount by which the component's priority exceeds the priority of the first component in its trigger
    /// chain on the same core. If this is above 0, the component runs before the component that triggered it
    /// continues.
    #[serde(default)]
    pub rise: u8,
    /// Inputs in the order of declaration.
    pub inputs: Vec<PortPlan>,
    /// Outputs in the order of declaration.
    pub outputs: Vec<PortPlan>,
    /// Index in `inputs` of the port whose source time the outputs propagate.
    pub cause: Option<usize>,
    /// Parameters in the order of declaration.
    pub parameters: Vec<ParameterPlan>,
    /// The `config` table of the component.
    pub config: serde_json::Value,
    /// Folder that relative paths in the `config` table refer to.
    #[serde(default)]
    pub folder: PathBuf,
    /// Robot assigned to the component, or `None`.
    pub robot: Option<RobotReference>,
    /// Robots listed under the component's key `robots`; empty if the component has a single `robot` or no
    /// robot.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub robots: Vec<RobotReference>,
    /// True if the component applies commands to a robot.
    pub actuator: bool,
    /// Safety rules of this actuator; `None` if the graph's `[safety]` applies unchanged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub safety: Option<ActuatorSafety>,
    /// Facts about the component in this graph that its table in the graph file does not show, one sentence
    /// each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// Seed of the component's random numbers, derived from the run's seed and the component's name.
    pub seed: u64,
    /// True if the component can be reset for a new episode.
    #[serde(default)]
    pub resets: bool,
    /// True if the component may end an episode.
    #[serde(default)]
    pub ends_episode: bool,
    /// True if the component begins the episodes of a run in real time.
    #[serde(default, skip_serializing_if = "core::ops::Not::not")]
    pub begins_episodes: bool,
    /// Policy for a late step.
    pub on_overrun: OnOverrun,
    /// Limits on time without a step, computing time and lost steps.
    pub liveness: LivenessPlan,
    /// Number of late steps, minus later punctual steps, above which the graph enters its safe state; `None`
    /// for no limit.
    pub overruns_tolerated: Option<u32>,
    /// Policy for a failed step.
    pub on_error: OnError,
    /// Policy for a permanent failure of the component.
    pub on_failure: OnFailure,
    /// Restart policy of the component.
    pub restart: RestartPlan,
    /// Time within which the component must stop before it is killed, ns; `None` for the default
    /// [`STOP_WITHIN_NS`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stop_within_ns: Option<u64>,
    /// Position of the component in the fixed order of a lockstep tick. A component comes before the
    /// components that it triggers.
    pub order: usize,
}

/// Default time within which a component must stop, ns.
pub const STOP_WITHIN_NS: u64 = 2_000_000_000;

impl Plan {
    /// Returns the component that can block this component's core for the longest time by computing
    /// endlessly, and the time after which the kernel kills the blocking component, ns. Returns `None` if no
    /// component can block the core: components of lower priority never block it, and a `SCHED_DEADLINE`
    /// component only gets its budget in every period.
    pub fn longest_hold_up(&self, component: usize) -> Option<(usize, u64)> {
        let held = &self.components[component];
        let priority = |component: &ComponentPlan| match component.class {
            SchedulingClass::Fifo(priority) => priority,
            SchedulingClass::Deadline { .. } => u8::MAX,
            SchedulingClass::Normal => 0,
        };
        let others = self.components.iter().enumerate().filter(|(index, other)| {
            *index != component && other.core == held.core && priority(other) >= priority(held)
        });
        let limits = others.filter_map(|(index, other)| Some((index, other.liveness.cpu_limit_ns?)));
        limits.max_by_key(|(_, limit)| *limit)
    }

    /// Returns the emergency-stop topics that the gates of actuators read. There is one, unless `subscribe`
    /// tables name others.
    pub(crate) fn emergency_stops(&self) -> impl Iterator<Item = usize> {
        let actuators = self.components.iter().filter(|component| component.actuator);
        let ports = actuators.flat_map(|component| &component.inputs);
        ports.filter(|port| port.port == EMERGENCY_STOP_PORT).filter_map(|port| port.topic)
    }

    /// Returns `true` if a value of this topic can be an emergency stop.
    pub(crate) fn is_emergency_stop(&self, topic: usize) -> bool {
        self.emergency_stops().any(|stop| stop == topic)
    }

    /// Returns the edges of the graph as pairs of a topic index and the index of a reading component, ordered
    /// by topic and then by reader. A component that reads a topic through several ports counts as one edge.
    pub fn edges(&self) -> Vec<(usize, usize)> {
        let mut edges = Vec::new();
        for (index, topic) in self.topics.iter().enumerate() {
            for reader in &topic.readers {
                if !edges.contains(&(index, *reader)) {
                    edges.push((index, *reader));
                }
            }
        }
        edges
    }

    /// Returns the index of the pin (the reader's slot in a topic) that an input uses. It is the input's
    /// index among all ports that read its topic; 0 for an unwired input.
    pub fn pin(&self, component: usize, input: usize) -> usize {
        let inputs = &self.components[component].inputs;
        let Some(topic) = inputs[input].topic else { return 0 };
        let before = inputs[..input].iter().filter(|other| other.topic == Some(topic)).count();
        let ports = self.topics[topic].readers.iter().enumerate().filter(|(_, reader)| **reader == component);
        ports.map(|(pin, _)| pin).nth(before).unwrap_or_default()
    }

    /// Returns `true` if all components that a topic triggers are pinned to the core of its writer.
    pub fn stays_on_core(&self, topic: usize) -> bool {
        let topic = &self.topics[topic];
        let core = |component: usize| self.components[component].core;
        let here = core(topic.writer);
        here.is_some() && topic.triggers.iter().all(|reader| core(*reader) == here)
    }
}

impl ComponentPlan {
    /// Returns the nominal time between two steps, ns.
    pub fn period_ns(&self) -> u64 {
        self.activation.period_ns()
    }
}
