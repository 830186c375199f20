//! Assembly of the plan from its resolved parts.

use super::context::Context;
use super::draft::Draft;
use super::latency::Latencies;
use super::scheduling::Scheduling;
use super::timing::Timing;
use super::wiring::Wiring;
use crate::declare::{Direction, PortDeclaration, TopicPattern};
use crate::graph::defaults;
use crate::graph::model::{EpisodesTable, GraphTable, RestartTable};
use crate::graph::read::{good, good_or};
use crate::graph::values::Name;
use crate::plan::{
    Activation, ActuatorSafety, ComponentPlan, EpisodesPlan, Expectation, LivenessPlan, ParameterPlan, Plan,
    PortPlan, RestartPlan, SafetyPlan, TopicPlan, component_seed,
};

/// Resolved parts of a graph.
pub(super) struct Parts<'g, 'i> {
    pub drafts: Vec<Draft<'g, 'i>>,
    pub wiring: Wiring,
    pub timing: Timing,
    pub scheduling: Scheduling,
    /// Liveness limits of each component.
    pub liveness: Vec<LivenessPlan>,
    pub parameters: Vec<Vec<ParameterPlan>>,
    pub latencies: Latencies,
    /// Number of values that each topic keeps for taps.
    pub histories: Vec<usize>,
    pub safety: SafetyPlan,
    /// Safety settings of each component; `None` if the graph's settings apply.
    pub actuators: Vec<Option<ActuatorSafety>>,
    pub expectations: Vec<Expectation>,
    pub order: Vec<usize>,
}

impl Parts<'_, '_> {
    /// Returns the plan; `None` if a part is missing, which only happens in a graph with errors.
    pub(super) fn assemble(self, graph: &GraphTable<'_>, context: &Context<'_>) -> Option<Plan> {
        let Name(name) = good(&graph.name)?.clone();
        let seed = good_or(&graph.seed, defaults::SEED);
        let components = (0..self.drafts.len()).map(|index| self.component(index, seed));
        let topics = (0..self.wiring.topics.len()).map(|index| self.topic(index));
        Some(Plan {
            name,
            file: context.file.to_path_buf(),
            clock: good_or(&graph.clock, defaults::CLOCK),
            duration_ns: good(&graph.duration).map(|duration| duration.ns),
            seed,
            episodes: good(&graph.episodes).map(episodes),
            components: components.collect::<Option<_>>()?,
            topics: topics.collect::<Option<_>>()?,
            latencies: self.latencies.plans,
            scheduling: self.scheduling.plan,
            safety: self.safety,
            expectations: self.expectations,
            trace_events: 0,
        })
    }

    fn component(&self, index: usize, seed: u64) -> Option<ComponentPlan> {
        let draft = &self.drafts[index];
        let declaration = draft.declaration.as_ref()?;
        let ports = |direction| -> Vec<PortPlan> {
            draft
                .ports(direction)
                .enumerate()
                .map(|(at, port)| self.port(index, direction, at, port))
                .collect()
        };
        Some(ComponentPlan {
            name: draft.name.to_string(),
            program: draft.program.clone()?,
            activation: self.timing.activation[index].clone()?,
            budget_ns: good(&draft.table.budget).map(|budget| budget.ns),
            waits_ns: declaration.waits_ns,
            core: self.scheduling.cores[index],
            spin: self.scheduling.spins[index],
            class: self.scheduling.classes[index],
            rise: self.scheduling.rises[index],
            inputs: ports(Direction::Input),
            outputs: ports(Direction::Output),
            cause: self.latencies.causes[index],
            parameters: self.parameters[index].clone(),
            config: draft.config.clone(),
            folder: draft.placement.folder.clone(),
            robot: draft.robot.clone(),
            robots: draft.robots.clone(),
            actuator: declaration.actuator,
            safety: self.actuators[index],
            notes: declaration.notes.clone(),
            seed: component_seed(seed, draft.name),
            resets: declaration.resets,
            ends_episode: good_or(&draft.table.ends_episode, false),
            begins_episodes: good_or(&draft.table.begins_episodes, false),
            on_overrun: good_or(&draft.table.on_overrun, defaults::ON_OVERRUN),
            liveness: self.liveness[index],
            overruns_tolerated: good(&draft.table.overruns_tolerated).copied(),
            on_error: good_or(&draft.table.on_error, defaults::ON_ERROR),
            on_failure: good_or(&draft.table.on_failure, defaults::ON_FAILURE),
            restart: restart(good(&draft.table.restart)),
            stop_within_ns: good(&draft.table.stop_within).map(|time| time.ns),
            order: self.order[index],
        })
    }

    fn port(&self, component: usize, direction: Direction, index: usize, port: &PortDeclaration) -> PortPlan {
        let topic = self.wiring.of_port(component, direction, index).and_then(|wire| wire.topic);
        let written = topic.filter(|_| port.layout.is_any()).and_then(|topic| self.written(topic));
        let layout = written.unwrap_or(port).layout.clone();
        PortPlan { port: port.name.clone(), topic, pattern: port.pattern, layout }
    }

    /// Returns the output that writes a topic.
    fn written(&self, topic: usize) -> Option<&PortDeclaration> {
        self.wiring.writer(topic)?.declared(&self.drafts)
    }

    fn topic(&self, topic: usize) -> Option<TopicPlan> {
        let writer = self.wiring.writer(topic)?;
        let written = self.written(topic)?;
        let readers: Vec<usize> =
            self.wiring.of_topic(topic, Direction::Input).map(|wire| wire.component).collect();
        // every reader gets the capacity of the most demanding one
        let wanted = self.wiring.of_topic(topic, Direction::Input).filter_map(|wire| {
            self.drafts[wire.component].ports(Direction::Input).nth(wire.index?)?.pattern.capacity()
        });
        let pattern = match written.pattern {
            TopicPattern::State => TopicPattern::State,
            TopicPattern::Stream { capacity } => {
                TopicPattern::Stream { capacity: wanted.fold(capacity, usize::max) }
            }
            TopicPattern::Slices { capacity, longest } => {
                TopicPattern::Slices { capacity: wanted.fold(capacity, usize::max), longest }
            }
        };
        let triggered = |component: &usize| matches!(self.timing.activation[*component], Some(Activation::Triggered { topic: by, .. }) if by == topic);
        Some(TopicPlan {
            name: self.wiring.topics[topic].clone(),
            pattern,
            layout: written.layout.clone(),
            writer: writer.component,
            triggers: (0..self.drafts.len()).filter(triggered).collect(),
            readers,
            history: self.histories[topic],
        })
    }
}

fn episodes(table: &EpisodesTable) -> EpisodesPlan {
    EpisodesPlan {
        count: good_or(&table.count, defaults::EPISODES),
        vary_seed: good_or(&table.vary_seed, false),
    }
}

fn restart(table: Option<&RestartTable>) -> RestartPlan {
    let of = |key: fn(&RestartTable) -> &Option<crate::graph::read::At<crate::units::TimeSpan>>, default| {
        table.map_or(default, |table| good_or(key(table), default))
    };
    RestartPlan {
        when: table.map_or(defaults::RESTART_WHEN, |table| good_or(&table.when, defaults::RESTART_WHEN)),
        at_most: table
            .map_or(defaults::RESTART_AT_MOST, |table| good_or(&table.at_most, defaults::RESTART_AT_MOST)),
        window_ns: of(|table| &table.window, defaults::RESTART_WINDOW).ns,
        within_ns: of(|table| &table.within, defaults::RESTART_WITHIN).ns,
    }
}
