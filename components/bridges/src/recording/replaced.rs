//! Plans in which recorded values replace components.

use motorium::declare::ClockKind;
use motorium::plan::{
    Activation, ComponentPlan, EpisodesPlan, OnError, OnFailure, Plan, PortPlan, Program, RestartWhen,
};
use motorium::prelude::*;
use motorium::state::{JointCommand, JointState};
use motorium::units::TimeSpan;

use super::replay::{Eased, Replay, find};
use super::spans::Spans;
use super::{ReadError, Recording};
use crate::foxglove::robot_of_topic;

/// Returns the plan of a recording in which each of the named components is replaced by a `log.replay`, which
/// keeps the activation of the component and its place in the order.
///
/// # Errors
/// Returns an error if the recording has no plan, or if the plan lacks one of these components.
pub fn replaced(recording: &Recording, names: &[String]) -> Result<Plan, ReadError> {
    let mut plan = recording.plan()?;
    let missing = |reason| ReadError::Missing { path: recording.path().to_path_buf(), reason };
    let file = std::path::absolute(recording.path()).unwrap_or_else(|_| recording.path().to_path_buf());
    for name in names {
        find(&plan, name).map_err(missing)?;
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

/// Returns the plan of a replay in lockstep, in which every component except the `live` ones is replaced by a
/// `log.replay`. The run lasts as long as the recorded episode with index `episode`. If `episode` is `None`,
/// the run lasts as long as all recorded episodes together.
///
/// # Errors
/// Returns an error if the recording has no readable plan, or if a component of `live` or the episode is
/// missing.
pub fn replayed(recording: &Recording, live: &[String], episode: Option<u64>) -> Result<Plan, ReadError> {
    let recorded = recording.plan()?;
    let missing = |reason| ReadError::Missing { path: recording.path().to_path_buf(), reason };
    for name in live {
        find(&recorded, name).map_err(missing)?;
    }
    let spans = Spans::from_recording(recording, episode)?;
    if let Some(episode) = episode.filter(|_| spans.count() == 0) {
        let count = spans.episodes();
        let episodes = if count == 1 { "one".to_string() } else { count.to_string() };
        return Err(missing(format!(
            "the recording has no episode {episode}; it has {episodes}, counted from 0"
        )));
    }
    if spans.count() == 0 {
        return Err(missing("the recording contains no samples to replay".to_string()));
    }
    let names: Vec<String> = recorded.components.iter().map(|component| component.name.clone()).collect();
    let names: Vec<String> = names.into_iter().filter(|name| !live.contains(name)).collect();
    let mut plan = replaced(recording, &names)?;
    plan.expectations = Vec::new();
    plan.clock = ClockKind::Lockstep;
    plan.duration_ns = spans.longest_ns(&recorded);
    let vary_seed = recorded.episodes.is_some_and(|episodes| episodes.vary_seed);
    plan.episodes = (spans.count() > 1).then_some(EpisodesPlan { count: spans.count(), vary_seed });
    let mut ends = spans.early_ends(&recorded).into_iter();
    let is_ended = plan.components.iter().any(|component| component.ends_episode);
    let replays = |component: &&mut ComponentPlan| is_replay(component);
    if let Some(first) =
        plan.components.iter_mut().find(replays).filter(|_| !is_ended && ends.any(|end| end.is_some()))
    {
        first.ends_episode = true;
    }
    for component in plan.components.iter_mut().filter(|component| is_replay(component)) {
        component.config["episode"] = serde_json::json!(episode);
    }
    Ok(plan)
}

/// Extends a plan so that robots move to the start pose before the replay and come to rest after the last
/// command. The replay is delayed by `lead` for the approach; `ramp_down` is the time to come to rest. The
/// plan is extended for each robot with a live actuator that follows recorded joint commands, if a live
/// component measures the robot's joint state. Returns the names of the components with eased commands.
pub fn ease_in(plan: &mut Plan, live: &[String], lead: TimeSpan, ramp_down: TimeSpan) -> Vec<String> {
    let is_live = |index: usize| live.contains(&plan.components[index].name);
    let is_followed = |topic: usize| {
        plan.topics[topic].readers.iter().any(|reader| is_live(*reader) && plan.components[*reader].actuator)
    };
    let is_measured = |topic: usize| is_live(plan.topics[topic].writer);
    let mut all = Vec::new();
    for (index, component) in plan.components.iter().enumerate().filter(|(index, _)| !is_live(*index)) {
        let topic_of = |port: &PortPlan, kind: &str| port.topic.filter(|_| port.layout.type_name == kind);
        let mut eased = Vec::new();
        let mut released_by = None;
        for output in &component.outputs {
            let Some(commands) = topic_of(output, JointCommand::NAME).filter(|topic| is_followed(*topic))
            else {
                continue;
            };
            let robot = robot_of_topic(plan, commands);
            // With several robots, each has its own joint states.
            let is_own =
                |topic: usize| robot_of_topic(plan, topic).map(|it| &it.name) == robot.map(|it| &it.name);
            let measured = component.inputs.iter().enumerate().find_map(|(input, port)| {
                let topic =
                    topic_of(port, JointState::NAME).filter(|topic| is_measured(*topic) && is_own(*topic))?;
                Some((input, topic, port.port.clone()))
            });
            let Some((input, topic, measured)) = measured else { continue };
            released_by = released_by.or(Some((input, topic)));
            eased.push(Eased { port: output.port.clone(), measured });
        }
        if let Some((input, topic)) = released_by {
            // The recorded trigger topic may be silent before and after the recording, but joint states are
            // always published.
            let activation = match component.activation {
                Activation::Triggered { topic: other, period_ns, .. } if !is_measured(other) => {
                    Some(Activation::Triggered { topic, input, period_ns })
                }
                _ => None,
            };
            all.push((index, eased, activation));
        }
    }
    if all.is_empty() {
        return Vec::new();
    }
    for component in plan.components.iter_mut().filter(|component| is_replay(component)) {
        component.config["lead"] = serde_json::json!(lead);
        component.config["ramp_down"] = serde_json::json!(ramp_down);
    }
    for (index, eased, activation) in &all {
        let component = &mut plan.components[*index];
        component.config["eased"] = serde_json::json!(eased);
        // A robot that is too far away is not moved at all.
        (component.on_error, component.on_failure) = (OnError::Fail, OnFailure::SafeStop);
        component.restart.when = RestartWhen::Never;
        if let Some(Activation::Triggered { input, .. }) = activation {
            component.cause = Some(*input);
        }
        component.activation = activation.clone().unwrap_or_else(|| component.activation.clone());
    }
    plan.duration_ns = plan.duration_ns.map(|duration| duration + lead.ns + ramp_down.ns);
    all.iter().map(|(index, ..)| plan.components[*index].name.clone()).collect()
}

fn is_replay(component: &ComponentPlan) -> bool {
    matches!(&component.program, Program::Builtin { kind } if kind == Replay::KIND)
}

fn is_logger(component: &ComponentPlan) -> bool {
    matches!(&component.program, Program::Builtin { kind } if kind.starts_with("log.") && kind != Replay::KIND)
}

/// Returns the names of the components of a plan that log but do not publish. A replay omits them.
pub fn loggers(plan: &Plan) -> Vec<String> {
    let loggers = plan.components.iter().filter(|component| is_logger(component));
    loggers.map(|component| component.name.clone()).collect()
}
