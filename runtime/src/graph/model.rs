//! The graph file as tables, with one type per table and one field per key. The JSON Schema is generated from
//! the same types.

use schemars::JsonSchema;

use super::defaults;
use super::diagnostic::Report;
use super::read::{At, Keys, Read, Value};
use super::values::{AnyTable, Expectations, Name, Named, Schedule, Share, SpinChoice, TopicName};
use crate::declare::ParameterValue;
use crate::plan::{ClockKind, OnDenied, OnError, OnFailure, OnMiss, OnOverrun, RestartWhen};
use crate::units::{Rate, TimeSpan};

/// Implements reading of a table whose fields have the names of the keys.
macro_rules! take_fields {
    ($keys:ident, $($field:ident),* $(; $rest:ident: $value:expr)?) => {
        Self { $( $field: $keys.take(stringify!($field)), )* $( $rest: $value )? }
    };
}

mod activate;
mod robot;
mod safety;

pub(super) use activate::ActivateTable;
pub(super) use robot::{BaseTable, RobotTable};
pub(super) use safety::{ActuatorSafetyTable, SafetyTable};

/// A graph of components that share state: the components, their wiring, their times and their safety.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Graph")]
pub(super) struct GraphTable<'i> {
    /// Base graph file, relative to this file. Tables of this file are merged key by key into the tables of
    /// the base file; all other values replace the values of the base file.
    pub extends: Option<At<String>>,
    /// Dotted paths of keys to remove from the base files before this file is applied, such as
    /// `component.encoder`.
    pub remove: Option<At<Vec<At<String>>>>,
    /// Name of the graph.
    #[schemars(required)]
    pub name: Option<At<Name>>,
    /// `realtime`: the machine's clock. `lockstep`: simulated time, deterministic and as fast as possible.
    #[schemars(extend("default" = defaults::CLOCK))]
    pub clock: Option<At<ClockKind>>,
    /// Duration of the run. Default: until the run is stopped.
    pub duration: Option<At<TimeSpan>>,
    /// Seed of the run, from which the seed of every component is derived, together with the component's
    /// name.
    #[schemars(extend("default" = defaults::SEED))]
    pub seed: Option<At<u64>>,
    /// Division of the run into episodes. In lockstep, each episode begins with a reset of all components. In
    /// real time, episodes begin without a reset.
    pub episodes: Option<At<EpisodesTable>>,
    /// Assignment of the machine's cores.
    pub cores: Option<At<CoresTable>>,
    /// Settings for real time.
    pub realtime: Option<At<RealtimeTable>>,
    /// The world around the robots, shared by all components that simulate or perceive it: gravity, ground,
    /// objects. Poses are in the world frame, z up.
    pub world: Option<At<AnyTable<'i>>>,
    /// Robots, by name.
    pub robot: Option<At<Named<RobotTable>>>,
    /// Components, by name. Each runs as a separate process.
    #[schemars(required)]
    pub component: Option<At<Named<ComponentTable<'i>>>>,
    /// Settings of topics, by name.
    pub topic: Option<At<Named<TopicTable>>>,
    /// End-to-end latency budgets, measured from the stamps that travel with the data.
    pub latency: Option<At<Vec<At<LatencyTable>>>>,
    /// Limits and states for the safety of the robot.
    pub safety: Option<At<SafetyTable>>,
    /// Conditions on values in the report, such as `"controller.position_error_m" = "<= 1e-3"`. A run that
    /// ends normally but violates a condition has a separate exit code.
    pub expect: Option<At<Expectations>>,
    /// Known keys that are probably misspelt in the file.
    #[schemars(skip)]
    pub meant: Vec<&'static str>,
}

/// Names of the keys at the top of the file.
pub(super) const TOP_KEYS: [&str; 16] = [
    "extends",
    "remove",
    "name",
    "clock",
    "duration",
    "seed",
    "episodes",
    "cores",
    "realtime",
    "world",
    "robot",
    "component",
    "topic",
    "latency",
    "safety",
    "expect",
];

impl<'i> GraphTable<'i> {
    pub(super) fn read(value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let mut keys = Keys::read("graph", value, report)?;
        let mut table = take_fields!(
            keys, extends, remove, name, clock, duration, seed, episodes, cores, realtime, world, robot, component,
            topic, latency, safety, expect; meant: Vec::new()
        );
        // keys in files have already been applied; these are from the command line
        for at in table.extends.iter().map(|at| &at.key).chain(table.remove.iter().map(|at| &at.key)) {
            keys.report()
                .error("`extends` and `remove` cannot be set from the command line")
                .label(at, "expected in a file")
                .advise("write a separate file, and merge it over the graph by `--with FILE`");
        }
        table.meant = keys.finish("the graph");
        Some(table)
    }
}

/// The episodes of a run.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Episodes")]
pub(super) struct EpisodesTable {
    /// Number of episodes. An episode lasts for `duration`, or until the component with `ends_episode` ends
    /// the episode.
    #[schemars(range(min = 1), extend("default" = defaults::EPISODES))]
    pub count: Option<At<u64>>,
    /// If true, each episode has a separate seed: the graph's seed plus the index of the episode.
    #[schemars(extend("default" = false))]
    pub vary_seed: Option<At<bool>>,
}

impl<'i> Read<'i> for EpisodesTable {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let mut keys = Keys::read(key, value, report)?;
        let table = take_fields!(keys, count, vary_seed);
        keys.finish("`[episodes]`");
        Some(table)
    }
}

/// Assignment of the machine's cores.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Cores")]
pub(super) struct CoresTable {
    /// Cores for real-time components. Default: the last core of the machine.
    #[schemars(length(min = 1), extend("uniqueItems" = true))]
    pub realtime: Option<At<Vec<At<usize>>>>,
    /// Cores for everything that is not real-time. Default: all cores that are not listed in `realtime`; on a
    /// machine with one core, that core.
    #[schemars(length(min = 1), extend("uniqueItems" = true))]
    pub shared: Option<At<Vec<At<usize>>>>,
}

impl<'i> Read<'i> for CoresTable {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let mut keys = Keys::read(key, value, report)?;
        let table = take_fields!(keys, realtime, shared);
        keys.finish("`[cores]`");
        Some(table)
    }
}

/// Settings for real time.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Realtime")]
pub(super) struct RealtimeTable {
    /// Time before its release at which a waiting real-time component stops sleeping and starts spinning. `"0
    /// us"` disables spinning; `"auto"` adapts the time to the measured wake-up errors of this machine.
    #[schemars(extend("default" = defaults::SPIN))]
    pub spin: Option<At<SpinChoice>>,
    /// Maximum share of its core that a component may use for an `"auto"` spin.
    #[schemars(extend("default" = defaults::SPIN_SHARE))]
    pub spin_share: Option<At<Share>>,
    /// Policy for priorities, cores and locked memory that the system denies: continue and report them, or
    /// refuse to run.
    #[schemars(extend("default" = defaults::ON_DENIED))]
    pub on_denied: Option<At<OnDenied>>,
    /// Maximum exit latency of idle states: deeper idle states are disabled on all cores while the graph
    /// runs.
    #[schemars(extend("default" = defaults::IDLE_EXIT))]
    pub idle_exit: Option<At<TimeSpan>>,
    /// Time without a step after which a component counts as hung and is ended. Default: 20 periods of the
    /// component, but at least 200 ms, or 1 s for a component that is not real-time.
    pub hang_after: Option<At<TimeSpan>>,
    /// Share of lost steps above which a warning about a component is printed.
    #[schemars(extend("default" = defaults::LOST_STEPS))]
    pub lost_steps: Option<At<Share>>,
}

impl<'i> Read<'i> for RealtimeTable {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let mut keys = Keys::read(key, value, report)?;
        let table = take_fields!(keys, spin, spin_share, on_denied, idle_exit, hang_after, lost_steps);
        keys.finish("`[realtime]`");
        Some(table)
    }
}

/// Settings of one topic.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Topic")]
pub(super) struct TopicTable {
    /// Number of older values of a state to keep for taps (`motorium topic echo --every`, recorders), at most
    /// 10000.
    #[schemars(range(max = 10_000), extend("default" = 0))]
    pub history: Option<At<usize>>,
}

impl<'i> Read<'i> for TopicTable {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let mut keys = Keys::read(&format!("topic.{key}"), value, report)?;
        let table = take_fields!(keys, history);
        keys.finish(&format!("topic `{key}`"));
        Some(table)
    }
}

/// A component: its program, its activation, its wiring, and the consequences of its failure.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Component")]
pub(super) struct ComponentTable<'i> {
    /// Kind of the component, if it is built in.
    pub kind: Option<At<String>>,
    /// Path of the user's program, relative to the graph file. Set either this or `kind`.
    pub exec: Option<At<String>>,
    /// Robot on which the component works: a name from `[robot]`.
    pub robot: Option<At<String>>,
    /// Robots on which the component works, in place of `robot`, for kinds that support several robots: names
    /// from `[robot]`, each once. Port `PORT` of robot `NAME` is then called `NAME.PORT`.
    pub robots: Option<At<Vec<At<String>>>>,
    /// Rate at which the component steps.
    pub rate: Option<At<Rate>>,
    /// Topic that triggers the component: the component steps whenever the topic is published, and must
    /// subscribe to it.
    pub trigger: Option<At<TopicName>>,
    /// Events outside the graph that trigger the component, for kinds that can wait for such events.
    pub activate: Option<At<ActivateTable>>,
    /// Offset of the first step within the period; only with `rate`.
    #[schemars(extend("default" = defaults::PHASE))]
    pub phase: Option<At<TimeSpan>>,
    /// Allowed execution time per step.
    pub budget: Option<At<TimeSpan>>,
    /// Scheduling class: real-time or not.
    #[schemars(extend("default" = defaults::SCHEDULE))]
    pub schedule: Option<At<Schedule>>,
    /// Real-time priority. Default: the faster the component, the higher the priority. In a trigger chain, it
    /// is the priority of the chain's head.
    #[schemars(range(min = 1, max = 98))]
    pub priority: Option<At<i64>>,
    /// Time before each release at which the component starts spinning. Overrides `[realtime]`; only with
    /// `rate`.
    pub spin: Option<At<SpinChoice>>,
    /// Core of the component, one of the cores in `[cores]`. Default: the core of its trigger chain, or the
    /// first core of its class.
    pub core: Option<At<usize>>,
    /// Inputs: `port = "topic"`.
    pub subscribe: Option<At<Named<TopicName>>>,
    /// Outputs: `port = "topic"`.
    pub publish: Option<At<Named<TopicName>>>,
    /// Initial values of parameters, which may be changed at run time.
    pub params: Option<At<Named<ParameterValue>>>,
    /// Configuration of the kind.
    pub config: Option<At<AnyTable<'i>>>,
    /// Policy for a step that ran past the next release.
    #[schemars(extend("default" = defaults::ON_OVERRUN))]
    pub on_overrun: Option<At<OnOverrun>>,
    /// Time without a step after which the component counts as hung and is ended. Overrides `[realtime]`.
    pub hang_after: Option<At<TimeSpan>>,
    /// Time for which the component may compute without sleeping before the kernel kills it; only with
    /// `schedule = "fifo"`. Default: 10 budgets (or periods, without a budget), but at least 50 ms.
    pub cpu_limit: Option<At<TimeSpan>>,
    /// Share of its steps that the component may lose without a warning. Overrides `[realtime]`.
    pub lost_steps: Option<At<Share>>,
    /// Number of late steps above which the graph enters its safe state. Each punctual step offsets one late
    /// step. Default: 0 with `on_overrun = "safe_stop"`, otherwise unlimited.
    pub overruns_tolerated: Option<At<u32>>,
    /// Policy for a step that failed.
    #[schemars(extend("default" = defaults::ON_ERROR))]
    pub on_error: Option<At<OnError>>,
    /// Policy for a failure without a restart.
    #[schemars(extend("default" = defaults::ON_FAILURE))]
    pub on_failure: Option<At<OnFailure>>,
    /// Restart policy.
    pub restart: Option<At<RestartTable>>,
    /// Time within which the component must stop at the end of a run before it is killed.
    #[schemars(extend("default" = defaults::STOP_WITHIN))]
    pub stop_within: Option<At<TimeSpan>>,
    /// If true, the component may end an episode early. Allowed for at most one component of a graph, of a
    /// kind that supports it.
    #[schemars(extend("default" = false))]
    pub ends_episode: Option<At<bool>>,
    /// If true, the component begins the episodes of a run in real time. Allowed for at most one component of
    /// a graph, of a kind that supports it.
    #[schemars(extend("default" = false))]
    pub begins_episodes: Option<At<bool>>,
    /// Safety settings of an actuator, which override `[safety]`.
    pub safety: Option<At<ActuatorSafetyTable>>,
    /// Known keys that are probably misspelt in the file.
    #[schemars(skip)]
    pub meant: Vec<&'static str>,
}

impl<'i> Read<'i> for ComponentTable<'i> {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let mut keys = Keys::read(&format!("component.{key}"), value, report)?;
        let mut table = take_fields!(
            keys, kind, exec, robot, robots, rate, trigger, activate, phase, budget, schedule, priority, spin, core, subscribe, publish,
            params, config, on_overrun, hang_after, cpu_limit, lost_steps, overruns_tolerated, on_error, on_failure, restart, stop_within,
            ends_episode, begins_episodes, safety; meant: Vec::new()
        );
        table.meant = keys.finish(&format!("component `{key}`"));
        Some(table)
    }
}

/// The restart policy of a component.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Restart")]
pub(super) struct RestartTable {
    /// Condition under which a component is restarted.
    #[schemars(extend("default" = defaults::RESTART_WHEN))]
    pub when: Option<At<RestartWhen>>,
    /// Maximum number of restarts within `window`.
    #[schemars(range(min = 1), extend("default" = defaults::RESTART_AT_MOST))]
    pub at_most: Option<At<u32>>,
    /// Time window over which restarts are counted.
    #[schemars(extend("default" = defaults::RESTART_WINDOW))]
    pub window: Option<At<TimeSpan>>,
    /// Time within which a restarted component must step again.
    #[schemars(extend("default" = defaults::RESTART_WITHIN))]
    pub within: Option<At<TimeSpan>>,
}

impl<'i> Read<'i> for RestartTable {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let mut keys = Keys::read(key, value, report)?;
        let table = take_fields!(keys, when, at_most, window, within);
        keys.finish("`restart`");
        Some(table)
    }
}

/// An end-to-end latency budget.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Latency")]
pub(super) struct LatencyTable {
    /// Topic where the data originates. It must be published by a component at the head of a trigger chain.
    #[schemars(required)]
    pub from: Option<At<TopicName>>,
    /// Topic where the measured latency ends.
    #[schemars(required)]
    pub to: Option<At<TopicName>>,
    /// Maximum time from the source time of `from` to the publication of `to`.
    #[schemars(required)]
    pub max: Option<At<TimeSpan>>,
    /// Policy for a latency above `max`.
    #[schemars(extend("default" = defaults::ON_MISS))]
    pub on_miss: Option<At<OnMiss>>,
    /// Known keys that are probably misspelt in the file.
    #[schemars(skip)]
    pub meant: Vec<&'static str>,
}

impl<'i> Read<'i> for LatencyTable {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let mut keys = Keys::read(key, value, report)?;
        let mut table = take_fields!(keys, from, to, max, on_miss; meant: Vec::new());
        table.meant = keys.finish("`[[latency]]`");
        Some(table)
    }
}
