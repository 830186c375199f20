//! The metrics of a run in the format of Prometheus.

use std::fmt;

use motorium::plan::{ClockKind, ComponentPlan, Plan};
use motorium::region::{Command, Phase};
use motorium::telemetry::Snapshot;
use prometheus_client::collector::Collector;
use prometheus_client::encoding::{DescriptorEncoder, text};
use prometheus_client::registry::Registry;

use super::families::{Families, Family, Labels, seconds};
use super::{ComponentSample, Sample};
use crate::runs::LivingRun;

/// Content type of the text: OpenMetrics 1.0, which Prometheus reads from version 2.5 on.
pub(super) const CONTENT_TYPE: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";

/// The metrics of a run, read only on request.
#[derive(Debug)]
pub(super) struct Exposition(Registry);

impl Exposition {
    pub(super) fn new(run: LivingRun) -> Self {
        let labels = [("run", run.folder.id().to_string()), ("graph", run.plan.name.clone())];
        let labels = labels.into_iter().map(|(name, value)| (name.into(), value.into()));
        let mut registry = Registry::with_prefix_and_labels("motorium", labels);
        registry.register_collector(Box::new(Collected(run)));
        Self(registry)
    }

    /// Returns the current values as text.
    pub(super) fn text(&self) -> String {
        let mut text = String::new();
        text::encode(&mut text, &self.0).expect("writing to a string does not fail");
        text
    }
}

#[derive(Debug)]
struct Collected(LivingRun);

impl Collector for Collected {
    fn encode(&self, encoder: DescriptorEncoder<'_>) -> fmt::Result {
        let view = View { plan: &self.0.plan, sample: &Sample::take(&self.0) };
        let mut families = Families(encoder);
        view.run(&mut families)?;
        view.steps(&mut families)?;
        view.faults(&mut families)?;
        view.machine(&mut families)?;
        view.data(&mut families)
    }
}

/// Some of the histograms of a component.
type Durations = fn(&ComponentSample) -> &Snapshot;

/// Families of a sample.
struct View<'a> {
    plan: &'a Plan,
    sample: &'a Sample,
}

impl<'a> View<'a> {
    /// Returns one series per component.
    fn each<T>(&self, value: impl Fn(&'a ComponentSample) -> T) -> impl Iterator<Item = (Labels<'a>, T)> {
        let components: &'a [ComponentPlan] = &self.plan.components;
        let pairs = components.iter().zip(&self.sample.components);
        pairs.map(move |(plan, sample)| (vec![("component", plan.name.as_str())], value(sample)))
    }

    /// Returns one series per component and value of a label.
    fn split<T, const N: usize>(
        &self,
        label: &'static str,
        values: impl Fn(&'a ComponentSample) -> [(&'static str, T); N],
    ) -> impl Iterator<Item = (Labels<'a>, T)> {
        self.each(values).flat_map(move |(labels, values)| {
            values.map(|(name, value)| (labels.iter().copied().chain([(label, name)]).collect(), value))
        })
    }

    fn run(&self, families: &mut Families<'_>) -> fmt::Result {
        let clock = match self.plan.clock {
            ClockKind::Realtime => "realtime",
            ClockKind::Lockstep => "lockstep",
        };
        families.gauge(
            &Family::unitless("run_clock", "1 for the clock that drives the run."),
            [(vec![("clock", clock)], 1_u64)],
        )?;
        families.gauge(
            &Family::seconds("run_elapsed", "Time since the start of the run, on its clock."),
            [(Labels::new(), seconds(self.sample.elapsed_ns))],
        )?;
        families.gauge(
            &Family::unitless("run_safe_stop", "1 while the graph is in its safe state."),
            [(Labels::new(), u64::from(self.sample.command == Command::SafeStop))],
        )
    }

    fn steps(&self, families: &mut Families<'_>) -> fmt::Result {
        families.counter(
            &Family::unitless("component_steps", "Steps done, through restarts."),
            self.each(|c| c.steps),
        )?;
        let of_steps: [(_, _, _, Durations); 3] = [
            (
                ["component_lateness", "component_lateness_max"],
                "Time from release or triggering publication to the beginning of the step.",
                "The largest lateness of the run.",
                |c| &c.lateness,
            ),
            (
                ["component_execution", "component_execution_max"],
                "Time from the beginning to the end of the step, in wall-clock time.",
                "The largest execution time of the run.",
                |c| &c.execution,
            ),
            (
                ["component_cpu", "component_cpu_max"],
                "CPU time of a step, without spinning.",
                "The largest CPU time of a step of the run.",
                |c| &c.cpu,
            ),
        ];
        for ([name, largest], help, help_of_largest, of) in of_steps {
            families.durations(&Family::seconds(name, help), self.each(of))?;
            families.gauge(
                &Family::seconds(largest, help_of_largest),
                self.each(|c| seconds(of(c).percentiles().max)),
            )?;
        }
        families.counter(
            &Family::unitless("component_missed_steps", "Steps that missed their time, by cause."),
            self.split("cause", |c| {
                [
                    ("late_wake", c.misses.late_wake),
                    ("long_step", c.misses.long_step),
                    ("stolen", c.misses.stolen),
                    ("late_input", c.misses.late_input),
                ]
            }),
        )?;
        families.counter(
            &Family::unitless("component_skipped_releases", "Releases dropped by the overrun policy."),
            self.each(|c| c.misses.skipped),
        )?;
        families.counter(
            &Family::unitless(
                "component_deferred_releases",
                "Releases by events that waited for their minimum interval.",
            ),
            self.each(|c| c.deferred),
        )?;
        families.counter(
            &Family::unitless("component_over_budget_steps", "Steps that exceeded the budget."),
            self.each(|c| c.misses.over_budget),
        )
    }

    fn faults(&self, families: &mut Families<'_>) -> fmt::Result {
        let u64_of = |yes: bool| u64::from(yes);
        families.gauge(
            &Family::unitless("component_running", "1 while the component steps."),
            self.each(|c| u64_of(c.phase == Phase::Running)),
        )?;
        families.gauge(
            &Family::unitless("component_safe_state", "1 while an actuator applies the safe state."),
            self.each(|c| u64_of(c.safe)),
        )?;
        families.counter(
            &Family::unitless("component_restarts", "Restarts of the component."),
            self.each(|c| c.restarts),
        )?;
        families.counter(
            &Family::unitless("component_errors", "Steps that returned an error and were tolerated."),
            self.each(|c| c.errors),
        )?;
        families.counter(
            &Family::unitless("component_refused_samples", "Samples withheld or refused for their content."),
            self.each(|c| c.refused),
        )?;
        let counted = self
            .split("code", |c| [("own", c.allocations.map(|a| a.0)), ("foreign", c.allocations.map(|a| a.1))])
            .filter_map(|(labels, count)| Some((labels, count?)));
        families.counter(
            &Family::unitless("component_allocations", "Heap allocations in steps after the first 100."),
            counted,
        )?;
        families.counter(
            &Family::unitless(
                "component_page_faults",
                "Page faults of the thread after the first 100 steps.",
            ),
            self.each(|c| c.page_faults),
        )
    }

    fn machine(&self, families: &mut Families<'_>) -> fmt::Result {
        families.gauge(
            &Family::seconds(
                "component_spin",
                "Current time for which the component spins before a release.",
            ),
            self.each(|c| seconds(c.spin_ns)),
        )?;
        families.counter(
            &Family::seconds(
                "component_watched",
                "Time of spinning, in which stalls of the core are measured.",
            ),
            self.each(|c| seconds(c.stalls.watched_ns)),
        )?;
        families.counter(
            &Family::unitless(
                "component_stalls",
                "Stalls of the core of over 10 us, observed while spinning.",
            ),
            self.each(|c| c.stalls.count),
        )?;
        families.counter(
            &Family::seconds("component_stalled", "Total duration of the stalls of the core."),
            self.each(|c| seconds(c.stalls.total_ns)),
        )?;
        let there = |of: fn(&super::thread::Usage) -> u64| {
            self.each(move |c| c.usage.as_ref().map(of)).filter_map(|(labels, value)| Some((labels, value?)))
        };
        families.counter(
            &Family::seconds("component_thread", "Time that the stepping thread has run, spinning included."),
            there(|usage| usage.thread_ns).map(|(labels, ns)| (labels, seconds(ns))),
        )?;
        families.gauge(
            &Family::bytes("component_resident_memory", "Memory of the component's process in use."),
            there(|usage| usage.resident_bytes),
        )?;
        let numbers: Vec<String> = self.sample.cores.iter().map(|core| core.core.to_string()).collect();
        let ticks = numbers.iter().zip(&self.sample.cores).flat_map(|(number, core)| {
            [
                ("user", core.user),
                ("system", core.system),
                ("interrupts", core.interrupts),
                ("idle", core.idle),
                ("stolen", core.stolen),
            ]
            .map(|(mode, ticks)| (vec![("core", number.as_str()), ("mode", mode)], ticks as f64 / 100.0))
        });
        families.counter(&Family::seconds("core", "Time of each core of the machine, by use."), ticks)
    }

    fn data(&self, families: &mut Families<'_>) -> fmt::Result {
        let topic = |index: usize| self.plan.topics[index].name.as_str();
        let chain = |index: usize| {
            let latency = &self.plan.latencies[index];
            vec![("from", topic(latency.from)), ("to", topic(latency.to))]
        };
        let latencies = || self.sample.latencies.iter().enumerate();
        families.durations(
            &Family::seconds("latency", "End-to-end latency of a chain."),
            latencies().map(|(i, sample)| (chain(i), &sample.latency)),
        )?;
        families.gauge(
            &Family::seconds("latency_max", "The largest latency of the run."),
            latencies().map(|(i, sample)| (chain(i), seconds(sample.latency.percentiles().max))),
        )?;
        families.gauge(
            &Family::seconds("latency_budget", "The budget of a chain."),
            self.plan.latencies.iter().enumerate().map(|(i, plan)| (chain(i), seconds(plan.max_ns))),
        )?;
        families.counter(
            &Family::unitless("latency_missed", "Latencies above the budget."),
            latencies().map(|(i, sample)| (chain(i), sample.missed)),
        )?;
        let edges = self.plan.edges();
        let reader = |index: usize| self.plan.components[index].name.as_str();
        families.durations(
            &Family::seconds("edge_age", "Age of samples at the beginning of the step that first read them."),
            edges
                .iter()
                .zip(&self.sample.edges)
                .map(|((written, by), age)| (vec![("topic", topic(*written)), ("reader", reader(*by))], age)),
        )?;
        let topics = || self.sample.topics.iter().enumerate();
        families.counter(
            &Family::unitless("topic_published", "Samples published."),
            topics().map(|(i, sample)| (vec![("topic", topic(i))], sample.published)),
        )?;
        families.counter(
            &Family::unitless("topic_dropped", "Samples that readers of a stream lost."),
            topics().map(|(i, sample)| (vec![("topic", topic(i))], sample.dropped)),
        )
    }
}
