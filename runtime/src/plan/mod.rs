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

/// A resolved graph.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Name of the graph.
    pub name: String,
    /// The graph file, for messages.
    pub file: PathBuf,
    /// The clock.
    pub clock: ClockKind,
    /// Duration of the run, ns; `None` runs until stopped.
    pub duration_ns: Option<u64>,
    /// Seed of the run, from which each component derives its own.
    pub seed: u64,
    /// Division into episodes.
    #[serde(default)]
    pub episodes: Option<EpisodesPlan>,
    /// Components in the order of the file; their index here is their identity.
    pub components: Vec<ComponentPlan>,
    /// Topics in the order of first mention.
    pub topics: Vec<TopicPlan>,
    /// End-to-end latency budgets.
    pub latencies: Vec<LatencyPlan>,
    /// Cores and scheduling.
    pub scheduling: SchedulingPlan,
    /// Limits and states for the safety of the robot.
    pub safety: SafetyPlan,
    /// Conditions on the report of the run.
    #[serde(default)]
    pub expectations: Vec<Expectation>,
    /// Minimum number of events kept unread in the trace of each component; 0 for a run without a trace.
    #[serde(default)]
    pub trace_events: usize,
}

impl Plan {
    /// Returns the safety rules of an actuator: its own, or else the graph's.
    pub fn safety_of(&self, component: &ComponentPlan) -> ActuatorSafety {
        component.safety.unwrap_or_else(|| self.safety.of_actuators())
    }

    /// Returns the longest time that an actuator stays in its safe state before it is stopped, ns: at least
    /// the graph's.
    pub fn settle_ns(&self) -> u64 {
        let own = self.components.iter().filter_map(|component| Some(component.safety?.settle_ns));
        own.fold(self.safety.settle_ns, u64::max)
    }

    /// Returns the component that begins the episodes of a run in real time.
    pub fn episode_driver(&self) -> Option<&ComponentPlan> {
        self.components.iter().find(|component| component.begins_episodes)
    }
}

/// The episodes of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct EpisodesPlan {
    /// Number of episodes; each lasts for the duration of the plan, or until a component ends it.
    pub count: u64,
    /// If true, the seed of each episode is the plan's plus its index; otherwise all have the plan's seed.
    pub vary_seed: bool,
}

impl EpisodesPlan {
    /// Returns the seed of episode `index` in a run with seed `of_run`.
    pub fn seed(self, of_run: u64, index: u64) -> u64 {
        if self.vary_seed { of_run.wrapping_add(index) } else { of_run }
    }
}

/// Returns the seed of a component for a run or episode with this seed. It depends on the component's name
/// rather than its position, so adding a component does not change the other seeds.
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
    /// Run without them, and print one line that lists them.
    Warn,
    /// Refuse to run.
    Strict,
}

/// Scheduling for the whole graph.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SchedulingPlan {
    /// Cores of everything that is not real-time: launcher, tools, components of class `Normal`.
    pub shared_cores: Vec<usize>,
    /// Policy for denied requests.
    pub on_denied: OnDenied,
    /// Maximum exit latency of idle states while the graph runs in real time, ns.
    pub idle_exit_ns: u64,
}

/// Time before a release at which a component stops sleeping and starts spinning.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Spin {
    /// A fixed time.
    Fixed {
        /// The time, ns; 0 for no spinning.
        ns: u64,
    },
    /// A time that follows the measured wake errors of the machine.
    Tuned {
        /// Upper limit, ns.
        at_most_ns: u64,
    },
}

impl Spin {
    /// Returns the longest possible time, ns.
    pub fn at_most_ns(self) -> u64 {
        match self {
            Self::Fixed { ns } | Self::Tuned { at_most_ns: ns } => ns,
        }
    }
}

/// The program of a component.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Program {
    /// A kind that the launching program hosts itself.
    Builtin {
        /// Name of the kind.
        kind: String,
    },
    /// A kind hosted by another installed program.
    Sibling {
        /// Name of the kind.
        kind: String,
        /// Path of the executable.
        path: PathBuf,
    },
    /// The user's own program.
    Exec {
        /// Path of the executable.
        path: PathBuf,
    },
}

/// The activation of a component's steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Activation {
    /// Periodic: at `start + phase + n * period`.
    Periodic {
        /// Period, ns.
        period_ns: u64,
        /// Offset of the first release, ns.
        phase_ns: u64,
    },
    /// On each publication of a topic.
    Triggered {
        /// Index of the topic.
        topic: usize,
        /// Index in `inputs` of the port that reads it.
        input: usize,
        /// Period of the component at the head of the chain, ns.
        period_ns: u64,
    },
    /// Sporadic: while a file descriptor of the component is readable.
    Descriptor {
        /// Shortest time between two releases, ns.
        min_interval_ns: u64,
    },
}

impl Activation {
    /// Returns the nominal time between two steps, ns; the shortest one for a sporadic component.
    pub fn period_ns(&self) -> u64 {
        match *self {
            Self::Periodic { period_ns, .. } | Self::Triggered { period_ns, .. } => period_ns,
            Self::Descriptor { min_interval_ns } => min_interval_ns,
        }
    }

    /// Returns `true` if the component is at the head of a trigger chain: no other component releases it.
    pub fn is_head(&self) -> bool {
        !matches!(self, Self::Triggered { .. })
    }
}

/// Scheduling class of one component.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SchedulingClass {
    /// `SCHED_FIFO` with this priority, 1 to 99.
    Fifo(u8),
    /// `SCHED_DEADLINE`: the kernel gives the component this time in every period, ahead of all `SCHED_FIFO`
    /// threads, and no more. It runs on any core.
    Deadline {
        /// CPU time in each period, ns.
        runtime_ns: u64,
        /// Period and relative deadline, ns.
        period_ns: u64,
    },
    /// The system's default time sharing.
    Normal,
}

/// A port wired to a topic.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PortPlan {
    /// Name of the port.
    pub port: String,
    /// Index of the topic; `None` for a port left unwired.
    pub topic: Option<usize>,
    /// State or stream, as declared by this side.
    pub pattern: TopicPattern,
    /// Layout of its samples.
    pub layout: TypeLayout,
}

/// A parameter with its initial value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ParameterPlan {
    /// Name, default, range.
    pub declaration: ParameterDeclaration,
    /// Value at the start of the run.
    pub initial: ParameterValue,
}

/// A resolved component.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ComponentPlan {
    /// Its name in the graph.
    pub name: String,
    /// Its program.
    pub program: Program,
    /// Its activation.
    pub activation: Activation,
    /// Execution time allowed per step, ns.
    pub budget_ns: Option<u64>,
    /// Longest time that a step waits for an answer from outside the graph, without using the core, ns.
    #[serde(default)]
    pub waits_ns: u64,
    /// Core it is pinned to; `None` for any of the shared cores, or for any core with `SCHED_DEADLINE`.
    pub core: Option<usize>,
    /// Spinning before a release. A triggered component does not spin.
    pub spin: Spin,
    /// Scheduling class.
    pub class: SchedulingClass,
    /// Increment of its priority over the head of its trigger chain on its core, so that a triggered
    /// component runs before the component that triggered it continues.
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
    /// The `config` table.
    pub config: serde_json::Value,
    /// Folder that relative paths in the `config` table refer to.
    #[serde(default)]
    pub folder: PathBuf,
    /// The robot it works on.
    pub robot: Option<RobotReference>,
    /// Robots of the component, if the graph assigns several by `robots`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub robots: Vec<RobotReference>,
    /// True if it applies commands to a robot.
    pub actuator: bool,
    /// The safety of an actuator for which the graph overrides its `[safety]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub safety: Option<ActuatorSafety>,
    /// Facts about the component in this graph that its table does not show, one sentence each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// Seed of its random numbers, derived from the run's seed and its name.
    pub seed: u64,
    /// True if it can be reset for a new episode.
    #[serde(default)]
    pub resets: bool,
    /// `true` if it may end an episode.
    #[serde(default)]
    pub ends_episode: bool,
    /// True if it begins the episodes of a run in real time.
    #[serde(default, skip_serializing_if = "core::ops::Not::not")]
    pub begins_episodes: bool,
    /// The consequence of a late step.
    pub on_overrun: OnOverrun,
    /// Limits on time without a step, computing time and lost steps.
    pub liveness: LivenessPlan,
    /// Number of late steps, minus later punctual ones, above which the graph enters its safe state; `None`
    /// for no limit.
    pub overruns_tolerated: Option<u32>,
    /// The consequence of a failed step.
    pub on_error: OnError,
    /// The consequence of its permanent failure.
    pub on_failure: OnFailure,
    /// Its restart policy.
    pub restart: RestartPlan,
    /// Time within which it must stop before it is killed; default [`STOP_WITHIN_NS`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stop_within_ns: Option<u64>,
    /// Position in the fixed order of a lockstep tick: writers before the readers they trigger.
    pub order: usize,
}

/// Default time for a component to stop, ns.
pub const STOP_WITHIN_NS: u64 = 2_000_000_000;

impl Plan {
    /// Returns the component that can block this component's core longest by computing endlessly, and the
    /// limit at which the kernel kills it, ns. Returns `None` if there is none: lower priorities never block
    /// a core, and `SCHED_DEADLINE` components only get their budget in every period.
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

    /// Returns the emergency-stop topics read by the gates of actuators: one, unless `subscribe` tables name
    /// others.
    pub(crate) fn emergency_stops(&self) -> impl Iterator<Item = usize> {
        let actuators = self.components.iter().filter(|component| component.actuator);
        let ports = actuators.flat_map(|component| &component.inputs);
        ports.filter(|port| port.port == EMERGENCY_STOP_PORT).filter_map(|port| port.topic)
    }

    /// Returns `true` if a value of this topic can be an emergency stop.
    pub(crate) fn is_emergency_stop(&self, topic: usize) -> bool {
        self.emergency_stops().any(|stop| stop == topic)
    }

    /// Returns the edges of the graph as pairs of topic and reader, ordered by topic and then by reader. A
    /// component that reads a topic through several ports is one edge.
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

    /// Returns the pin that an input uses: its index among the ports that read its topic. 0 for an unwired
    /// input.
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
