//! `log.replay`: publishes what a recording has of a component, in its place.

use std::collections::VecDeque;
use std::path::PathBuf;

use motorium::declare::{ClockKind, TopicPattern};
use motorium::plan::{Activation, ComponentPlan, Plan, PortPlan, Program};
use motorium::prelude::*;
use motorium::state::Stamp;
use motorium::transport::{RawInput, RawOutput};
use motorium::worker::Kind;

use super::{ReadError, Recording};

/// Configuration of `log.replay`.
///
/// ```toml excerpt
/// recording = "out/run.mcap"
/// component = "encoder"
/// ```
#[derive(Debug, Clone, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReplayConfig {
    /// The recording, relative to the folder of the graph.
    pub recording: PathBuf,
    /// Name of the component in the recorded graph. Its ports are those of this one.
    pub component: String,
}

/// A component that publishes what a recording has of another, at the times of the recording since its start.
pub struct Replay {
    outputs: Vec<(RawOutput, VecDeque<Recorded>)>,
    inputs: Vec<RawInput>,
    is_lockstep: bool,
    episode: u64,
    published: u64,
    refused: u64,
}

/// A sample that is to be published; its times are since the start of its episode.
struct Recorded {
    episode: u64,
    due_ns: u64,
    /// Age of its source when it was published, ns.
    age_ns: u64,
    bytes: Vec<u8>,
}

impl Component for Replay {
    const KIND: &'static str = "log.replay";
    const SUMMARY: &'static str = "publishes what a recording has of a component";
    const RESETS: bool = true;
    type Config = ReplayConfig;

    fn declare(config: &ReplayConfig, declare: &mut Declare) -> Result<(), ConfigError> {
        let path = declare.folder().join(&config.recording);
        let wrong = |error: ReadError| ConfigError::key("recording", error.to_string());
        let plan = Recording::open(&path).and_then(|recording| recording.plan()).map_err(wrong)?;
        let component =
            find(&plan, &config.component).map_err(|error| ConfigError::key("component", error))?;
        for port in states(component) {
            declare.raw_output(&port.port, port.layout.clone(), "as it was recorded");
        }
        Ok(())
    }

    fn configure(config: ReplayConfig, setup: &mut Setup) -> Result<Self, ConfigureError> {
        let path = setup.folder().join(&config.recording);
        let recording = Recording::open(&path).map_err(ConfigureError::failed)?;
        let recorded = recording.plan().map_err(ConfigureError::failed)?;
        let component = find(&recorded, &config.component).map_err(ConfigureError::failed)?;
        let observer = setup.observer()?;
        let own = find(observer.plan(), setup.name()).map_err(ConfigureError::failed)?;
        let mut outputs = Vec::new();
        let mut queues: Vec<(Option<usize>, VecDeque<Recorded>)> = Vec::new();
        for port in states(component) {
            if own.outputs.iter().any(|output| output.port == port.port && output.topic.is_some()) {
                let topic = port.topic.and_then(|topic| recording.topic(&recorded.topics[topic].name));
                queues.push((topic, VecDeque::new()));
                outputs.push(setup.raw_output(&port.port)?);
            }
        }
        let start_ns = start_of(&recording, &recorded).map_err(ConfigureError::failed)?;
        for sample in recording.samples() {
            let sample = sample.map_err(ConfigureError::failed)?;
            let Some((_, queue)) = queues.iter_mut().find(|(topic, _)| *topic == Some(sample.topic)) else {
                continue;
            };
            let Stamp { episode, publish_time, source_time, .. } = sample.stamp;
            queue.push_back(Recorded {
                episode,
                due_ns: publish_time.saturating_sub(start_ns),
                age_ns: publish_time.saturating_sub(source_time),
                bytes: sample.bytes,
            });
        }
        // What it reads is not looked at: the times of the values that caused its own are.
        let cause = own.cause.map(|index| &own.inputs[index]);
        let inputs = cause.filter(|input| single(input)).map(|input| setup.raw_input(&input.port));
        Ok(Self {
            outputs: outputs.into_iter().zip(queues).map(|(output, (_, queue))| (output, queue)).collect(),
            inputs: inputs.into_iter().collect::<Result<_, _>>()?,
            is_lockstep: observer.plan().clock == ClockKind::Lockstep,
            episode: 0,
            published: 0,
            refused: 0,
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        for input in &mut self.inputs {
            let _ = input.next_unread();
        }
        // In real time a sample that was published just after its step is due in it again.
        let until_ns = match self.is_lockstep {
            true => tick.time_ns,
            false => tick.deadline_ns,
        };
        for (output, queue) in &mut self.outputs {
            let mut newest = None;
            while queue.front().is_some_and(|next| {
                next.episode < self.episode || (next.episode == self.episode && next.due_ns <= until_ns)
            }) {
                // Publications of one step are told apart by nobody but a tap: all of them go out.
                if let Some(value) = newest.replace(queue.pop_front()).flatten() {
                    publish(output, &value, tick, self.is_lockstep, &mut self.published, &mut self.refused);
                }
            }
            if let Some(value) = newest.flatten() {
                publish(output, &value, tick, self.is_lockstep, &mut self.published, &mut self.refused);
            }
        }
        Ok(())
    }

    fn reset(&mut self, episode: &Episode) -> Result<(), StepError> {
        self.episode = episode.index;
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let left: usize = self.outputs.iter().map(|(_, queue)| queue.len()).sum();
        Some(serde_json::json!({ "published": self.published, "refused": self.refused, "left": left }))
    }
}

fn publish(
    output: &mut RawOutput,
    value: &Recorded,
    tick: &Tick,
    is_lockstep: bool,
    published: &mut u64,
    refused: &mut u64,
) {
    // In lockstep the clock of stamps is that of ticks; in real time the age begins anew.
    let sent = match is_lockstep {
        true => output.publish_from(&value.bytes, tick.time_ns.saturating_sub(value.age_ns)),
        false => output.publish(&value.bytes),
    };
    match sent {
        Ok(()) => *published += 1,
        Err(_) => *refused += 1,
    }
}

/// The time zero of the stamps of a recording: that of the first event, or sample, of a run in real time.
fn start_of(recording: &Recording, plan: &Plan) -> Result<u64, ReadError> {
    if plan.clock == ClockKind::Lockstep {
        return Ok(0);
    }
    let mut first = u64::MAX;
    for sample in recording.samples() {
        let sample = sample?;
        if recording.topics()[sample.topic].name != super::EVENTS {
            first = first.min(sample.stamp.publish_time);
        }
    }
    Ok(if first == u64::MAX { 0 } else { first })
}

fn find<'p>(plan: &'p Plan, name: &str) -> Result<&'p ComponentPlan, String> {
    plan.components.iter().find(|component| component.name == name).ok_or_else(|| {
        let names: Vec<&str> = plan.components.iter().map(|component| component.name.as_str()).collect();
        format!("the recorded graph has no component `{name}`, but {}", names.join(", "))
    })
}

/// The outputs that can be published from a recording: states.
fn states(component: &ComponentPlan) -> impl Iterator<Item = &PortPlan> {
    component.outputs.iter().filter(|port| port.pattern == TopicPattern::State)
}

fn single(port: &PortPlan) -> bool {
    port.topic.is_some() && !matches!(port.pattern, TopicPattern::Slices { .. })
}

/// The plan of a recording in which a `log.replay` takes the place of each of these components, with its activation and its
/// order.
///
/// # Errors
/// The recording has no plan, or the plan no such component.
pub fn replaced(recording: &Recording, names: &[String]) -> Result<Plan, ReadError> {
    let mut plan = recording.plan()?;
    let foreign = |reason| ReadError::Foreign { path: recording.path().to_path_buf(), reason };
    let file = std::path::absolute(recording.path()).unwrap_or_else(|_| recording.path().to_path_buf());
    for name in names {
        find(&plan, name).map_err(foreign)?;
        for component in plan.components.iter_mut().filter(|component| component.name == *name) {
            if is_logger(component) {
                continue;
            }
            component.program = Program::Builtin { kind: Replay::KIND.to_string() };
            component.config = serde_json::json!({ "recording": file, "component": name });
            component.parameters.clear();
            (component.actuator, component.resets) = (false, true);
            if let Activation::Descriptor { min_interval_ns } = component.activation {
                component.activation = Activation::Periodic { period_ns: min_interval_ns, phase_ns: 0 };
            }
        }
    }
    Ok(plan)
}

/// The kind `log.replay`, for programs that host the plans of [`replaced`]: it stands in no graph that a person writes.
pub fn replay_kind() -> Kind {
    Kind::of::<Replay>()
}

fn is_logger(component: &ComponentPlan) -> bool {
    matches!(&component.program, Program::Builtin { kind } if kind.starts_with("log.") && kind != Replay::KIND)
}

/// The components of a plan that write what happens and publish nothing: a replay does without them.
pub fn loggers(plan: &Plan) -> Vec<String> {
    let loggers = plan.components.iter().filter(|component| is_logger(component));
    loggers.map(|component| component.name.clone()).collect()
}
