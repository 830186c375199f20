//! Graphs built by hand.

use std::path::PathBuf;

use crate::declare::TopicPattern;
use crate::plan::{
    Activation, ClockKind, ComponentPlan, LatencyPlan, OnDenied, OnError, OnFailure, OnMiss, OnOverrun, Plan,
    PortPlan, Program, RestartPlan, RestartWhen, SafetyPlan, SchedulingClass, SchedulingPlan, Spin,
    TopicPlan,
};
use crate::state::{JointState, StateBuffer as _};

/// Activation of a component.
#[derive(Debug, Clone, Copy)]
pub(crate) enum When {
    /// Every period, with a phase, ns.
    Every(u64, u64),
    /// On events with this minimum interval, ns.
    OnEvents(u64),
    /// On publications of the component with this index.
    After(usize),
}

/// A component.
#[derive(Debug, Clone)]
pub(crate) struct Node {
    pub name: String,
    pub when: When,
    pub budget_ns: Option<u64>,
    pub core: Option<usize>,
    pub class: SchedulingClass,
    pub rise: u8,
    pub on_overrun: OnOverrun,
    /// Component whose topic a time-triggered component reads, and whose source time it propagates.
    pub reads: Option<usize>,
}

/// Returns a real-time component on core 1 at priority 80; times in ns.
pub(crate) fn node(name: &str, when: When, budget_ns: u64) -> Node {
    Node {
        name: name.to_string(),
        when,
        budget_ns: Some(budget_ns),
        core: Some(1),
        class: SchedulingClass::Fifo(80),
        rise: 0,
        on_overrun: OnOverrun::Skip,
        reads: None,
    }
}

impl Node {
    pub(crate) fn priority(mut self, priority: u8) -> Self {
        self.class = SchedulingClass::Fifo(priority);
        self
    }

    /// Raises the priority above the head of its chain.
    pub(crate) fn rising(mut self, rise: u8) -> Self {
        let SchedulingClass::Fifo(priority) = self.class else { panic!("only priorities rise") };
        (self.class, self.rise) = (SchedulingClass::Fifo(priority - self.rise + rise), rise);
        self
    }

    pub(crate) fn core(mut self, core: usize) -> Self {
        self.core = Some(core);
        self
    }

    pub(crate) fn not_realtime(mut self) -> Self {
        (self.class, self.core) = (SchedulingClass::Normal, None);
        self
    }

    /// Schedules the component by deadline, with spare run time.
    pub(crate) fn by_deadline(mut self, needs_ns: u64, room_ns: u64) -> Self {
        let When::Every(period_ns, _) = self.when else { panic!("only periodic components have deadlines") };
        self.class = SchedulingClass::Deadline { runtime_ns: (needs_ns + room_ns).min(period_ns), period_ns };
        self.core = None;
        self
    }

    pub(crate) fn no_budget(mut self) -> Self {
        self.budget_ns = None;
        self
    }

    pub(crate) fn reading(mut self, writer: usize) -> Self {
        self.reads = Some(writer);
        self
    }
}

/// Returns a graph in which every component writes the topic with its own index. Latency budgets are from
/// topic to topic.
pub(crate) fn graph(nodes: &[Node], spin_ns: u64, latencies: &[(usize, usize, u64)]) -> Plan {
    let head = |mut index: usize| loop {
        match nodes[index].when {
            When::Every(period, _) | When::OnEvents(period) => return period,
            When::After(writer) => index = writer,
        }
    };
    let port = |topic: usize| PortPlan {
        port: format!("port{topic}"),
        topic: Some(topic),
        pattern: TopicPattern::State,
        layout: JointState::layout(),
    };
    let components = nodes.iter().enumerate().map(|(index, node)| {
        let (activation, input) = match node.when {
            When::Every(period_ns, phase_ns) => (Activation::Periodic { period_ns, phase_ns }, node.reads),
            When::OnEvents(min_interval_ns) => (Activation::Descriptor { min_interval_ns }, node.reads),
            When::After(topic) => {
                (Activation::Triggered { topic, input: 0, period_ns: head(index) }, Some(topic))
            }
        };
        ComponentPlan {
            name: node.name.clone(),
            program: Program::Builtin { kind: "test".to_string() },
            activation,
            budget_ns: node.budget_ns,
            core: node.core,
            spin: Spin::Fixed { ns: if matches!(node.when, When::Every(..)) { spin_ns } else { 0 } },
            class: node.class,
            rise: node.rise,
            inputs: input.map(port).into_iter().collect(),
            outputs: vec![port(index)],
            cause: input.map(|_| 0),
            parameters: Vec::new(),
            config: serde_json::Value::Null,
            robot: None,
            robots: Vec::new(),
            stop_within_ns: None,
            waits_ns: 0,
            folder: Default::default(),
            actuator: false,
            notes: Vec::new(),
            seed: 0,
            on_overrun: node.on_overrun,
            liveness: Default::default(),
            overruns_tolerated: None,
            on_error: OnError::Fail,
            on_failure: OnFailure::SafeStop,
            restart: RestartPlan { when: RestartWhen::Never, at_most: 0, window_ns: 1, within_ns: 1 },
            resets: false,
            ends_episode: false,
            begins_episodes: false,
            safety: None,
            order: index,
        }
    });
    let topics = (0..nodes.len()).map(|topic| {
        let triggers = |index: &usize| matches!(nodes[*index].when, When::After(writer) if writer == topic);
        let triggers: Vec<usize> = (0..nodes.len()).filter(triggers).collect();
        TopicPlan {
            name: format!("topic/{}", nodes[topic].name),
            pattern: TopicPattern::State,
            layout: JointState::layout(),
            writer: topic,
            readers: triggers.clone(),
            triggers,
            history: 0,
        }
    });
    Plan {
        name: "made".to_string(),
        file: PathBuf::from("made.toml"),
        clock: ClockKind::Realtime,
        duration_ns: None,
        episodes: None,
        seed: 0,
        components: components.collect(),
        topics: topics.collect(),
        latencies: latencies
            .iter()
            .map(|(from, to, max_ns)| LatencyPlan {
                from: *from,
                to: *to,
                max_ns: *max_ns,
                on_miss: OnMiss::Warn,
                component: *to,
                output: 0,
            })
            .collect(),
        scheduling: SchedulingPlan { shared_cores: vec![0], on_denied: OnDenied::Warn, idle_exit_ns: 0 },
        safety: SafetyPlan::for_tests(),
        expectations: Vec::new(),
        trace_events: 0,
    }
}
