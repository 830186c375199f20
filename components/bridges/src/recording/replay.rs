//! `log.replay`: publishes the recorded values of a component, which it replaces.

use std::collections::VecDeque;
use std::path::PathBuf;

use motorium::component::EpisodeEnd;
use motorium::declare::{ClockKind, RobotReference, TopicPattern};
use motorium::plan::{ComponentPlan, Plan, PortPlan};
use motorium::prelude::*;
use motorium::raw::{RawInput, RawOutput};
use motorium::state::Stamp;
use motorium::units::TimeSpan;
use motorium::worker::Kind;

use super::ease::{Ease, EaseError, rates};
use super::spans::Spans;
use super::{EVENTS, ReadError, Recording};
use crate::foxglove::robot_of_topic;

/// Configuration of `log.replay`.
///
/// ```toml excerpt
/// recording = "out/run.mcap"
/// component = "encoder"
/// ```
#[derive(Debug, Clone, serde::Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ReplayConfig {
    /// Path of the recording, relative to the folder of the graph.
    #[schemars(extend("format" = "path"))]
    pub recording: PathBuf,
    /// Name of the replaced component in the recorded graph. The replay has the ports of the replaced
    /// component.
    pub component: String,
    /// Index of the only episode to replay, from 0. Default: all episodes, in order.
    #[serde(default)]
    pub episode: Option<u64>,
    /// Delay of the first recorded sample after the start. Default 0.
    #[serde(default)]
    pub lead: TimeSpan,
    /// Time between the end of the recording and the end of the replay. Default 0.
    #[serde(default)]
    pub ramp_down: TimeSpan,
    /// Ports of joint commands that are extended: they move a robot to the start pose within `lead` and bring
    /// it to rest within `ramp_down`. Default: an empty list.
    #[serde(default)]
    pub eased: Vec<Eased>,
}

/// A port of joint commands to which an approach and a deceleration are added, before and after the
/// recording.
///
/// ```
/// let eased = motorium_bridges::recording::Eased { port: "joint_command".into(), measured: "joint_state".into() };
/// assert_eq!(serde_json::to_value(eased).unwrap()["measured"], "joint_state");
/// ```
#[derive(Debug, Clone, serde::Deserialize, serde::Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Eased {
    /// Name of the port with the commands.
    pub port: String,
    /// Name of the port at which the replay reads the measured joint states.
    pub measured: String,
}

/// A component that publishes the recorded values of another component at their recorded times, counted from
/// the start of the run.
pub struct Replay {
    outputs: Vec<Replayed>,
    /// The input that triggers its outputs, and measured joint states.
    inputs: Vec<(String, RawInput)>,
    is_lockstep: bool,
    episode: u64,
    /// Times at which episodes ended earlier than planned, ns, and the permission to end episodes.
    ends: Vec<Option<u64>>,
    end: Option<EpisodeEnd>,
    counts: Counts,
}

/// An output and its remaining values.
struct Replayed {
    output: RawOutput,
    queue: VecDeque<Recorded>,
    /// Commands outside the recording, and the port of the measured joint states.
    ease: Option<(Ease, String)>,
}

#[derive(Default)]
struct Counts {
    published: u64,
    refused: u64,
    /// Number of samples that were not due before their episode ended.
    left: u64,
}

/// A sample to publish; its times are relative to the start of its episode.
struct Recorded {
    episode: u64,
    due_ns: u64,
    /// Age of its source when it was published, ns.
    age_ns: u64,
    bytes: Vec<u8>,
}

impl Component for Replay {
    const KIND: &'static str = "log.replay";
    const SUMMARY: &'static str = "publishes the recorded samples of a component";
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
        declare.may_end_episodes();
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
                outputs.push((port.port.clone(), setup.raw_output(&port.port)?));
            }
        }
        let mut spans = Spans::new(recorded.clock, config.episode);
        for sample in recording.samples() {
            let sample = sample.map_err(ConfigureError::failed)?;
            if recording.topics()[sample.topic].name == EVENTS {
                continue;
            }
            let Some(episode) = spans.add(&sample.stamp) else { continue };
            let Some((_, queue)) = queues.iter_mut().find(|(topic, _)| *topic == Some(sample.topic)) else {
                continue;
            };
            let Stamp { publish_time, source_time, .. } = sample.stamp;
            queue.push_back(Recorded {
                episode,
                due_ns: publish_time,
                age_ns: publish_time.saturating_sub(source_time),
                bytes: sample.bytes,
            });
        }
        let start_ns = spans.start_ns(&recorded);
        for value in queues.iter_mut().flat_map(|(_, queue)| queue) {
            value.due_ns = value.due_ns.saturating_sub(start_ns) + config.lead.ns;
        }
        let around_ns = config.lead.ns + config.ramp_down.ns;
        let ends = spans.early_ends(&recorded).into_iter().map(|end| Some(end? + around_ns)).collect();
        // It reads two kinds of inputs: the input whose source times its outputs carry, and measured joint
        // states.
        let cause = own.cause.map(|index| &own.inputs[index].port);
        let is_read =
            |port: &String| cause == Some(port) || config.eased.iter().any(|eased| eased.measured == *port);
        let mut inputs = Vec::new();
        for input in own.inputs.iter().filter(|input| single(input) && is_read(&input.port)) {
            inputs.push((input.port.clone(), setup.raw_input(&input.port)?));
        }
        let robot = |port: &String| {
            let topic = own.outputs.iter().find(|output| output.port == *port)?.topic?;
            robot_of_topic(observer.plan(), topic)
        };
        let mut replayed = Vec::new();
        for ((port, output), (_, queue)) in outputs.into_iter().zip(queues) {
            let eased = config.eased.iter().find(|eased| eased.port == port);
            let ease = eased
                .map(|eased| eased.around(robot(&port), &queue, spans.count(), config.ramp_down))
                .transpose();
            let ease = ease.map_err(|error| ConfigureError::failed(format!("output `{port}`: {error}")))?;
            replayed.push(Replayed { output, queue, ease: ease.flatten() });
        }
        Ok(Self {
            outputs: replayed,
            inputs,
            is_lockstep: observer.plan().clock == ClockKind::Lockstep,
            episode: 0,
            ends,
            end: setup.episode_end(),
            counts: Counts::default(),
        })
    }

    fn step(&mut self, tick: &Tick) -> Result<(), StepError> {
        // In real time, a sample published just after its step is due in the same step of the replay.
        let until_ns = match self.is_lockstep {
            true => tick.time_ns,
            false => tick.deadline_ns,
        };
        for (port, input) in &mut self.inputs {
            let Some(read) = input.next_unread() else { continue };
            for (ease, measured) in self.outputs.iter_mut().filter_map(|replayed| replayed.ease.as_mut()) {
                if *measured == *port && ease.needs_start() {
                    ease.begin(read.bytes, until_ns).map_err(|error| StepError::failed(error.to_string()))?;
                }
            }
        }
        for Replayed { output, queue, ease } in &mut self.outputs {
            let mut newest = None;
            while queue.front().is_some_and(|next| next.episode == self.episode && next.due_ns <= until_ns) {
                // Only a tap can distinguish the publications of one step, so all of them are published.
                if let Some(value) = newest.replace(queue.pop_front()).flatten() {
                    publish(output, &value, tick, self.is_lockstep, &mut self.counts);
                }
            }
            if let Some(value) = newest.flatten() {
                publish(output, &value, tick, self.is_lockstep, &mut self.counts);
            } else if let Some((ease, _)) = ease
                && ease.is_due(until_ns)
                && let Some(command) = ease.command(until_ns)
                && output.publish(command).is_err()
            {
                self.counts.refused += 1;
            }
        }
        let is_over = |end_ns: &u64| tick.time_ns >= *end_ns;
        if let Some(end) = &self.end
            && self.ends.get(self.episode as usize).copied().flatten().as_ref().is_some_and(is_over)
        {
            end.end();
        }
        Ok(())
    }

    fn reset(&mut self, episode: &Episode) -> Result<(), StepError> {
        self.episode = episode.index;
        for Replayed { queue, ease, .. } in &mut self.outputs {
            while queue.front().is_some_and(|next| next.episode < episode.index) {
                queue.pop_front();
                self.counts.left += 1;
            }
            if let Some((ease, _)) = ease {
                ease.reset(episode.index);
            }
        }
        Ok(())
    }

    fn result(&self) -> Option<serde_json::Value> {
        let left: usize = self.outputs.iter().map(|replayed| replayed.queue.len()).sum();
        let eased = self.outputs.iter().filter_map(|replayed| replayed.ease.as_ref());
        let eased: u64 = eased.map(|(ease, _)| ease.made).sum();
        Some(serde_json::json!({
            "published": self.counts.published,
            "refused": self.counts.refused,
            "left": self.counts.left + left as u64,
            "eased": eased,
        }))
    }
}

impl Eased {
    /// Returns the commands before and after the recorded ones, within the limits of the robot; `None` if the
    /// port does not carry joint commands.
    fn around(
        &self,
        robot: Option<&RobotReference>,
        queue: &VecDeque<Recorded>,
        episodes: u64,
        ramp_down: TimeSpan,
    ) -> Result<Option<(Ease, String)>, EaseError> {
        let rates = robot.map(rates).transpose()?.unwrap_or_default();
        let Some(mut ease) = Ease::new(rates) else { return Ok(None) };
        for episode in 0..episodes {
            let mut of_episode = queue.iter().filter(|value| value.episode == episode);
            let first = of_episode.next();
            let last = of_episode.next_back().or(first);
            let ends =
                first.zip(last).map(|(first, last)| [first, last].map(|it| (&it.bytes[..], it.due_ns)));
            ease.push(ends, ramp_down)?;
        }
        Ok(Some((ease, self.measured.clone())))
    }
}

fn publish(output: &mut RawOutput, value: &Recorded, tick: &Tick, is_lockstep: bool, counts: &mut Counts) {
    // In lockstep, the stamp clock counts ticks, so the recorded age is preserved; in real time, ages restart
    // at zero.
    let sent = match is_lockstep {
        true => output.publish_from(&value.bytes, tick.time_ns.saturating_sub(value.age_ns)),
        false => output.publish(&value.bytes),
    };
    match sent {
        Ok(()) => counts.published += 1,
        Err(_) => counts.refused += 1,
    }
}

pub(super) fn find<'p>(plan: &'p Plan, name: &str) -> Result<&'p ComponentPlan, String> {
    plan.components.iter().find(|component| component.name == name).ok_or_else(|| {
        let names: Vec<&str> = plan.components.iter().map(|component| component.name.as_str()).collect();
        format!("the recorded graph has no component `{name}`, expected one of {}", names.join(", "))
    })
}

/// Outputs that can be published from a recording: states.
fn states(component: &ComponentPlan) -> impl Iterator<Item = &PortPlan> {
    component.outputs.iter().filter(|port| port.pattern == TopicPattern::State)
}

fn single(port: &PortPlan) -> bool {
    port.topic.is_some() && !matches!(port.pattern, TopicPattern::Slices { .. })
}

/// Returns the kind `log.replay`, for programs that run plans from [`replaced`]. It is not meant for
/// hand-written graphs.
// Not inlined, as required by `Kind::of`.
#[inline(never)]
pub fn replay_kind() -> Kind {
    Kind::of::<Replay>()
}
