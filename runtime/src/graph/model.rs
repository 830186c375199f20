//! The graph file as tables: one type a table, one field a key. The JSON Schema comes from the same types.

use schemars::JsonSchema;

use super::defaults;
use super::diagnostic::Report;
use super::read::{At, Keys, Read, Value};
use super::values::{AnyTable, Name, Named, Schedule, Share, SpinChoice, TopicName};
use crate::declare::ParameterValue;
use crate::plan::{ClockKind, OnDenied, OnError, OnFailure, OnMiss, OnOverrun, RestartWhen, SafeState};
use crate::units::{Rate, TimeSpan};

/// A graph of components that share state: what runs, how it is wired, when it steps and what keeps it safe.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Graph")]
pub(super) struct GraphTable<'i> {
    /// Name of the graph.
    #[schemars(required)]
    pub name: Option<At<Name>>,
    /// `realtime`: the machine's clock; `lockstep`: simulated time, deterministic, as fast as the machine allows.
    #[schemars(extend("default" = defaults::CLOCK))]
    pub clock: Option<At<ClockKind>>,
    /// How long to run; until it is stopped if left out.
    pub duration: Option<At<TimeSpan>>,
    /// Seed of all random numbers: every component derives its own from this and its name.
    #[schemars(extend("default" = defaults::SEED))]
    pub seed: Option<At<u64>>,
    /// Which cores do what.
    pub cores: Option<At<CoresTable>>,
    /// How real time is kept.
    pub realtime: Option<At<RealtimeTable>>,
    /// Robots, by name.
    pub robot: Option<At<Named<RobotTable>>>,
    /// Components, by name: each runs as a process of its own.
    #[schemars(required)]
    pub component: Option<At<Named<ComponentTable<'i>>>>,
    /// Settings of topics, by name.
    pub topic: Option<At<Named<TopicTable>>>,
    /// End-to-end latency budgets, measured from stamps that travel with the data.
    pub latency: Option<At<Vec<At<LatencyTable>>>>,
    /// What keeps the robot safe when commands fail.
    pub safety: Option<At<SafetyTable>>,
    /// Keys that misspelt ones probably mean.
    #[schemars(skip)]
    pub meant: Vec<&'static str>,
}

/// Names of the keys at the top of the file.
pub(super) const TOP_KEYS: [&str; 11] = [
    "name",
    "clock",
    "duration",
    "seed",
    "cores",
    "realtime",
    "robot",
    "component",
    "topic",
    "latency",
    "safety",
];

impl<'i> GraphTable<'i> {
    pub(super) fn read(value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let mut keys = Keys::read("graph", value, report)?;
        let mut table = Self {
            name: keys.take("name"),
            clock: keys.take("clock"),
            duration: keys.take("duration"),
            seed: keys.take("seed"),
            cores: keys.take("cores"),
            realtime: keys.take("realtime"),
            robot: keys.take("robot"),
            component: keys.take("component"),
            topic: keys.take("topic"),
            latency: keys.take("latency"),
            safety: keys.take("safety"),
            meant: Vec::new(),
        };
        table.meant = keys.finish("the graph");
        Some(table)
    }
}

/// Which cores do what.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Cores")]
pub(super) struct CoresTable {
    /// Cores of real-time components. If left out: the last core of the machine.
    #[schemars(length(min = 1), extend("uniqueItems" = true))]
    pub realtime: Option<At<Vec<At<usize>>>>,
    /// Cores of everything else. If left out: all that are not real-time, or the same one on a machine with one core.
    #[schemars(length(min = 1), extend("uniqueItems" = true))]
    pub shared: Option<At<Vec<At<usize>>>>,
}

impl<'i> Read<'i> for CoresTable {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let mut keys = Keys::read(key, value, report)?;
        let table = Self { realtime: keys.take("realtime"), shared: keys.take("shared") };
        keys.finish("`[cores]`");
        Some(table)
    }
}

/// How real time is kept.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Realtime")]
pub(super) struct RealtimeTable {
    /// A waiting real-time component sleeps until this long before its release, then spins. `"0 us"`: it never spins;
    /// `"auto"`: as long as the wake errors of this machine ask for.
    #[schemars(extend("default" = defaults::SPIN))]
    pub spin: Option<At<SpinChoice>>,
    /// A component whose spin is `"auto"` takes at most this share of its core for it.
    #[schemars(extend("default" = defaults::SPIN_SHARE))]
    pub spin_share: Option<At<Share>>,
    /// Without the privilege for priorities, cores or locked memory: go on and say so, or refuse to run.
    #[schemars(extend("default" = defaults::ON_DENIED))]
    pub on_denied: Option<At<OnDenied>>,
    /// Idle states that take longer than this to leave are kept from all cores while the graph runs.
    #[schemars(extend("default" = defaults::IDLE_EXIT))]
    pub idle_exit: Option<At<TimeSpan>>,
}

impl<'i> Read<'i> for RealtimeTable {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let mut keys = Keys::read(key, value, report)?;
        let table = Self {
            spin: keys.take("spin"),
            spin_share: keys.take("spin_share"),
            on_denied: keys.take("on_denied"),
            idle_exit: keys.take("idle_exit"),
        };
        keys.finish("`[realtime]`");
        Some(table)
    }
}

/// Settings of one topic.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Topic")]
pub(super) struct TopicTable {
    /// Values of a state kept behind the newest one, for taps (`motorium topic echo --every`, recorders), up to 10000.
    #[schemars(range(max = 10_000), extend("default" = 0))]
    pub history: Option<At<usize>>,
}

impl<'i> Read<'i> for TopicTable {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let mut keys = Keys::read(&format!("topic.{key}"), value, report)?;
        let table = Self { history: keys.take("history") };
        keys.finish(&format!("topic `{key}`"));
        Some(table)
    }
}

/// A robot.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Robot")]
pub(super) struct RobotTable {
    /// Its model: a name of the catalogue, a folder, or a URDF file (relative to the graph file).
    #[schemars(required)]
    pub urdf: Option<At<String>>,
    /// Keys that misspelt ones probably mean.
    #[schemars(skip)]
    pub meant: Vec<&'static str>,
}

impl<'i> Read<'i> for RobotTable {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let mut keys = Keys::read(&format!("robot.{key}"), value, report)?;
        let mut table = Self { urdf: keys.take("urdf"), meant: Vec::new() };
        table.meant = keys.finish(&format!("robot `{key}`"));
        Some(table)
    }
}

/// A component: what it runs, when it steps, what it is wired to, and what happens when it fails.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Component")]
pub(super) struct ComponentTable<'i> {
    /// A built-in kind of component.
    pub kind: Option<At<String>>,
    /// The user's own program instead of a built-in kind, relative to the graph file.
    pub exec: Option<At<String>>,
    /// The robot it works on: a name from `[robot]`.
    pub robot: Option<At<String>>,
    /// Steps at fixed times.
    pub rate: Option<At<Rate>>,
    /// Steps whenever this topic is published; the component must subscribe to it.
    pub trigger: Option<At<TopicName>>,
    /// Offset of the first step within the period; only with `rate`.
    #[schemars(extend("default" = defaults::PHASE))]
    pub phase: Option<At<TimeSpan>>,
    /// Execution time allowed per step.
    pub budget: Option<At<TimeSpan>>,
    /// Real-time, or not.
    #[schemars(extend("default" = defaults::SCHEDULE))]
    pub schedule: Option<At<Schedule>>,
    /// Real-time priority. If left out: the faster the component, the higher; as the head of its trigger chain.
    #[schemars(range(min = 1, max = 98))]
    pub priority: Option<At<i64>>,
    /// How long this component spins before its releases, instead of what `[realtime]` says; only with `rate`.
    pub spin: Option<At<SpinChoice>>,
    /// Core, one of those in `[cores]`. If left out: that of its trigger chain, or the first of its class.
    pub core: Option<At<usize>>,
    /// Inputs: `port = "topic"`.
    pub subscribe: Option<At<Named<TopicName>>>,
    /// Outputs: `port = "topic"`.
    pub publish: Option<At<Named<TopicName>>>,
    /// Initial values of parameters, which may be changed while the graph runs.
    pub params: Option<At<Named<ParameterValue>>>,
    /// Configuration of the kind.
    pub config: Option<At<AnyTable<'i>>>,
    /// What happens after a step that ran past the next release.
    #[schemars(extend("default" = defaults::ON_OVERRUN))]
    pub on_overrun: Option<At<OnOverrun>>,
    /// Late steps that are tolerated before the graph goes to its safe state; each step in time makes up for a late one.
    /// If left out: none with `on_overrun = "safe_stop"`, else any number.
    pub overruns_tolerated: Option<At<u32>>,
    /// What happens after a step that failed.
    #[schemars(extend("default" = defaults::ON_ERROR))]
    pub on_error: Option<At<OnError>>,
    /// What happens when the component has failed and is not restarted.
    #[schemars(extend("default" = defaults::ON_FAILURE))]
    pub on_failure: Option<At<OnFailure>>,
    /// When it is started again.
    pub restart: Option<At<RestartTable>>,
    /// Keys that misspelt ones probably mean.
    #[schemars(skip)]
    pub meant: Vec<&'static str>,
}

impl<'i> Read<'i> for ComponentTable<'i> {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let mut keys = Keys::read(&format!("component.{key}"), value, report)?;
        let mut table = Self {
            kind: keys.take("kind"),
            exec: keys.take("exec"),
            robot: keys.take("robot"),
            rate: keys.take("rate"),
            trigger: keys.take("trigger"),
            phase: keys.take("phase"),
            budget: keys.take("budget"),
            schedule: keys.take("schedule"),
            priority: keys.take("priority"),
            spin: keys.take("spin"),
            core: keys.take("core"),
            subscribe: keys.take("subscribe"),
            publish: keys.take("publish"),
            params: keys.take("params"),
            config: keys.take("config"),
            on_overrun: keys.take("on_overrun"),
            overruns_tolerated: keys.take("overruns_tolerated"),
            on_error: keys.take("on_error"),
            on_failure: keys.take("on_failure"),
            restart: keys.take("restart"),
            meant: Vec::new(),
        };
        table.meant = keys.finish(&format!("component `{key}`"));
        Some(table)
    }
}

/// When a component is started again.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Restart")]
pub(super) struct RestartTable {
    /// After what.
    #[schemars(extend("default" = defaults::RESTART_WHEN))]
    pub when: Option<At<RestartWhen>>,
    /// At most this many restarts within `window`.
    #[schemars(range(min = 1), extend("default" = defaults::RESTART_AT_MOST))]
    pub at_most: Option<At<u32>>,
    /// The time over which restarts are counted.
    #[schemars(extend("default" = defaults::RESTART_WINDOW))]
    pub window: Option<At<TimeSpan>>,
    /// A restarted component must step again within this time.
    #[schemars(extend("default" = defaults::RESTART_WITHIN))]
    pub within: Option<At<TimeSpan>>,
}

impl<'i> Read<'i> for RestartTable {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let mut keys = Keys::read(key, value, report)?;
        let table = Self {
            when: keys.take("when"),
            at_most: keys.take("at_most"),
            window: keys.take("window"),
            within: keys.take("within"),
        };
        keys.finish("`restart`");
        Some(table)
    }
}

/// An end-to-end latency budget.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Latency")]
pub(super) struct LatencyTable {
    /// Topic where the data begins: published by a component at the head of a chain.
    #[schemars(required)]
    pub from: Option<At<TopicName>>,
    /// Topic where it ends.
    #[schemars(required)]
    pub to: Option<At<TopicName>>,
    /// Longest time from the source time of `from` to the publication of `to`.
    #[schemars(required)]
    pub max: Option<At<TimeSpan>>,
    /// What happens when it takes longer.
    #[schemars(extend("default" = defaults::ON_MISS))]
    pub on_miss: Option<At<OnMiss>>,
    /// Keys that misspelt ones probably mean.
    #[schemars(skip)]
    pub meant: Vec<&'static str>,
}

impl<'i> Read<'i> for LatencyTable {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let mut keys = Keys::read(key, value, report)?;
        let mut table = Self {
            from: keys.take("from"),
            to: keys.take("to"),
            max: keys.take("max"),
            on_miss: keys.take("on_miss"),
            meant: Vec::new(),
        };
        table.meant = keys.finish("`[[latency]]`");
        Some(table)
    }
}

/// What keeps the robot safe. The side that applies commands does this by itself, whoever died.
#[derive(Debug, JsonSchema)]
#[schemars(deny_unknown_fields, rename = "Safety")]
pub(super) struct SafetyTable {
    /// A command older than this is never applied.
    #[schemars(extend("default" = defaults::STALE_AFTER))]
    pub stale_after: Option<At<TimeSpan>>,
    /// What is applied instead.
    #[schemars(extend("default" = defaults::SAFE_STATE))]
    pub safe_state: Option<At<SafeState>>,
    /// How long the actuators stay in the safe state before they are stopped, at every end of a run.
    #[schemars(extend("default" = defaults::SETTLE))]
    pub settle: Option<At<TimeSpan>>,
}

impl<'i> Read<'i> for SafetyTable {
    fn read(key: &str, value: &Value<'i>, report: &mut Report) -> Option<Self> {
        let mut keys = Keys::read(key, value, report)?;
        let table = Self {
            stale_after: keys.take("stale_after"),
            safe_state: keys.take("safe_state"),
            settle: keys.take("settle"),
        };
        keys.finish("`[safety]`");
        Some(table)
    }
}
