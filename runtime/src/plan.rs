//! A plan: a graph file with everything resolved and checked, as the launcher, the workers and the tools use it.
//!
//! Plans are made by [`graph::load`](crate::graph::load), travel to the worker processes as JSON, and are never
//! written by hand.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::declare::{ParameterDeclaration, ParameterValue, RobotReference, TopicPattern};
use crate::state::TypeLayout;

/// Which clock drives the run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ClockKind {
    /// The machine's monotonic clock; components meet absolute deadlines.
    Realtime,
    /// Simulated time, handed out tick by tick in a fixed order, as fast as the machine allows.
    Lockstep,
}

/// A graph, resolved.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Name of the graph.
    pub name: String,
    /// The graph file, for messages.
    pub file: PathBuf,
    /// The clock.
    pub clock: ClockKind,
    /// How long to run; until stopped if `None`.
    pub duration_ns: Option<u64>,
    /// Seed from which every component derives its own.
    pub seed: u64,
    /// Components in the order of the file; their index here is their identity.
    pub components: Vec<ComponentPlan>,
    /// Topics in the order of first mention.
    pub topics: Vec<TopicPlan>,
    /// End-to-end latency budgets.
    pub latencies: Vec<LatencyPlan>,
    /// Cores and scheduling.
    pub scheduling: SchedulingPlan,
    /// What keeps the robot safe.
    pub safety: SafetyPlan,
}

/// How real-time requests that the system denies are treated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnDenied {
    /// Run without, and say in one line what was lost.
    Warn,
    /// Refuse to run.
    Strict,
}

/// Scheduling for the whole graph.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SchedulingPlan {
    /// Core of everything that is not real-time: launcher, observers, components without a deadline.
    pub shared_cores: Vec<usize>,
    /// What to do without privileges.
    pub on_denied: OnDenied,
    /// Longest time that a core may take to leave its idle state while the graph runs in real time, ns.
    pub idle_exit_ns: u64,
}

/// How long before its release a waiting component stops sleeping and spins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Spin {
    /// Always this long.
    Fixed {
        /// The margin, ns; 0 to sleep all the way.
        ns: u64,
    },
    /// As long as the machine's measured wake errors ask for.
    Tuned {
        /// But never longer than this, ns.
        at_most_ns: u64,
    },
}

impl Spin {
    /// The longest it can take, ns.
    pub fn at_most_ns(self) -> u64 {
        match self {
            Self::Fixed { ns } | Self::Tuned { at_most_ns: ns } => ns,
        }
    }
}

/// The state an actuator takes when commands fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SafeState {
    /// Hold the position at which the command went stale, with the gains of the last command.
    Hold,
    /// No setpoint, only damping.
    Damp,
    /// No effort at all.
    ZeroTorque,
    /// Stop as fast as the effort limits allow, then hold.
    Brake,
}

/// What keeps the robot safe.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SafetyPlan {
    /// A command older than this is never applied.
    pub stale_after_ns: u64,
    /// What is applied instead.
    pub safe_state: SafeState,
    /// How long actuators stay in the safe state before they are stopped, at every end of a run.
    pub settle_ns: u64,
}

/// Which program runs a component.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Program {
    /// A kind that the launching binary hosts itself.
    Builtin {
        /// Name of the kind.
        kind: String,
    },
    /// The user's own program.
    Exec {
        /// The executable, resolved.
        path: PathBuf,
    },
}

/// When a component steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Activation {
    /// At fixed times: `start + phase + n * period`.
    Periodic {
        /// Period, ns.
        period_ns: u64,
        /// Offset of the first release, ns.
        phase_ns: u64,
    },
    /// Whenever a topic is published.
    Triggered {
        /// Index of the topic.
        topic: usize,
        /// Index in `inputs` of the port that reads it.
        input: usize,
        /// Period of the time-triggered component at the head of the chain, ns.
        period_ns: u64,
    },
}

/// What happens after a step that ran past the next release.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnOverrun {
    /// Releases that have passed are dropped; the next future one on the original grid is met.
    Skip,
    /// Releases that have passed are run one after the other, at once, until the grid is met again.
    CatchUp,
    /// The grid starts anew from the end of the late step.
    Rephase,
    /// As skip, and the outputs of the late step are withheld: readers keep the older value, whose age tells.
    Hold,
    /// The whole graph goes to its safe state.
    SafeStop,
}

/// What happens after a step that returned an error or made an invalid output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnError {
    /// The component has failed; `restart` and `on_failure` say what follows.
    Fail,
    /// The error is reported and counted; the component goes on, its readers keep the older value.
    Hold,
}

/// What happens when a component has failed and is not restarted (any more).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnFailure {
    /// The whole graph goes to its safe state and ends.
    SafeStop,
    /// The graph goes on without the component.
    Ignore,
}

/// When a component that ended is started again.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RestartWhen {
    /// Never.
    Never,
    /// After a crash, an error or a kill.
    Failure,
    /// Also after it ended by itself in good order.
    Always,
}

/// Restart policy.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct RestartPlan {
    /// When to restart.
    pub when: RestartWhen,
    /// At most this many restarts within `window_ns`.
    pub at_most: u32,
    /// The window over which restarts are counted, ns.
    pub window_ns: u64,
    /// A restarted component must be stepping again within this time, ns; else it counts as failed again.
    pub within_ns: u64,
}

/// Scheduling class of one component.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SchedulingClass {
    /// `SCHED_FIFO` with this priority, 1 to 99.
    Fifo(u8),
    /// `SCHED_DEADLINE`: the kernel gives it its time in every period, before anything that is `SCHED_FIFO`, and no more
    /// than that. It runs on any core.
    Deadline {
        /// Time of a core in each period, ns.
        runtime_ns: u64,
        /// The period, and the deadline within it, ns.
        period_ns: u64,
    },
    /// The system's normal time sharing.
    Normal,
}

/// A port wired to a topic.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PortPlan {
    /// Name of the port.
    pub port: String,
    /// Index of the topic; `None` for a port left unwired.
    pub topic: Option<usize>,
    /// State or stream, as this side declares it.
    pub pattern: TopicPattern,
    /// The type it carries.
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

/// One component, resolved.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ComponentPlan {
    /// Its name in the graph.
    pub name: String,
    /// What runs it.
    pub program: Program,
    /// When it steps.
    pub activation: Activation,
    /// Execution time allowed per step, ns.
    pub budget_ns: Option<u64>,
    /// Core it is pinned to; if `None`, any of the shared cores, or any core at all with `SCHED_DEADLINE`.
    pub core: Option<usize>,
    /// How long it spins before a release. A triggered component does not.
    pub spin: Spin,
    /// Scheduling class.
    pub class: SchedulingClass,
    /// How far its priority lies above that of the component at the head of its trigger chain on its core: those that
    /// are triggered run before whoever has triggered them goes on.
    #[serde(default)]
    pub rise: u8,
    /// Inputs in the order of declaration.
    pub inputs: Vec<PortPlan>,
    /// Outputs in the order of declaration.
    pub outputs: Vec<PortPlan>,
    /// Index in `inputs` of the port whose source time the outputs inherit.
    pub cause: Option<usize>,
    /// Parameters in the order of declaration.
    pub parameters: Vec<ParameterPlan>,
    /// The `config` table.
    pub config: serde_json::Value,
    /// The robot it works on.
    pub robot: Option<RobotReference>,
    /// Whether it applies commands to a robot.
    pub actuator: bool,
    /// Seed of its random numbers, derived from the run's seed and its name.
    pub seed: u64,
    /// After a late step.
    pub on_overrun: OnOverrun,
    /// Late steps, less the steps in time since, above which the graph goes to its safe state; any number if `None`.
    pub overruns_tolerated: Option<u32>,
    /// After a failed step.
    pub on_error: OnError,
    /// After it has failed for good.
    pub on_failure: OnFailure,
    /// When it is started again.
    pub restart: RestartPlan,
    /// Position in the fixed order of a lockstep tick: writers before the readers they trigger.
    pub order: usize,
}

impl Plan {
    /// The edges of the graph, as topic and reader, in the order of topics and then of readers: a component that reads
    /// a topic through several ports is one edge.
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

    /// Number of an input among the readers of its topic, counted by ports: the pin that it uses. 0 for an unwired one.
    pub fn pin(&self, component: usize, input: usize) -> usize {
        let inputs = &self.components[component].inputs;
        let Some(topic) = inputs[input].topic else { return 0 };
        let before = inputs[..input].iter().filter(|other| other.topic == Some(topic)).count();
        let ports = self.topics[topic].readers.iter().enumerate().filter(|(_, reader)| **reader == component);
        ports.map(|(pin, _)| pin).nth(before).unwrap_or_default()
    }

    /// Whether all whom a topic triggers are pinned to the core of its writer.
    pub fn stays_on_core(&self, topic: usize) -> bool {
        let topic = &self.topics[topic];
        let core = |component: usize| self.components[component].core;
        let here = core(topic.writer);
        here.is_some() && topic.triggers.iter().all(|reader| core(*reader) == here)
    }
}

impl ComponentPlan {
    /// Nominal time between two steps, ns.
    pub fn period_ns(&self) -> u64 {
        match self.activation {
            Activation::Periodic { period_ns, .. } | Activation::Triggered { period_ns, .. } => period_ns,
        }
    }
}

/// One topic, resolved.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TopicPlan {
    /// Name, such as `panda/joint_state`.
    pub name: String,
    /// State or stream.
    pub pattern: TopicPattern,
    /// The type it carries.
    pub layout: TypeLayout,
    /// Index of the component that writes it.
    pub writer: usize,
    /// Indices of the components that read it.
    pub readers: Vec<usize>,
    /// Indices of the components that it wakes.
    pub triggers: Vec<usize>,
    /// Values of a state kept for taps, beyond those that readers need.
    #[serde(default)]
    pub history: usize,
}

/// An end-to-end latency budget.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LatencyPlan {
    /// Topic at the head of the chain.
    pub from: usize,
    /// Topic at its end.
    pub to: usize,
    /// Longest time allowed from the source time of `from` to the publish time of `to`, ns.
    pub max_ns: u64,
    /// What happens when it is missed.
    pub on_miss: OnMiss,
    /// The component that publishes `to` and so measures the latency.
    pub component: usize,
    /// Index of `to` in that component's outputs.
    pub output: usize,
}

/// What happens when a latency budget is missed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum OnMiss {
    /// It is counted and reported.
    Warn,
    /// The whole graph goes to its safe state.
    SafeStop,
}
