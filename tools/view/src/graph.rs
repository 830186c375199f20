//! Description of a run's graph for viewers.

use std::path::PathBuf;

use motorium::declare::RobotReference;
use motorium::plan::{Activation, ClockKind, ComponentPlan, Plan, Program};
use motorium::schedule::{Overheads, timeline};
use motorium_bridges::foxglove::{channels, descriptions, robot_of_topic};
use motorium_bridges::quantities::{entries, quantity};
use motorium_robots::RobotSource;
use serde_json::{Value as Json, json};

/// Length of the predicted timeline sent to viewers, ns.
const PREDICTED_NS: u64 = 10_000_000;

/// Returns the robots of a plan, each once.
pub(crate) fn robots(plan: &Plan) -> Vec<&RobotReference> {
    let mut found: Vec<&RobotReference> = Vec::new();
    for robot in plan.components.iter().flat_map(|component| component.robot.iter().chain(&component.robots))
    {
        if !found.iter().any(|known| known.name == robot.name) {
            found.push(robot);
        }
    }
    found
}

/// Returns the file of a robot, if it has one.
pub(crate) fn file_of(robot: &RobotReference) -> Option<PathBuf> {
    let source = RobotSource {
        name: &robot.name,
        text: &robot.urdf,
        base: &robot.base,
        profile: robot.profile.as_deref(),
        packages: &robot.package_path,
        settings: robot.settings.as_ref(),
        pose: None,
    };
    source.load().ok()?.path
}

/// Returns the components, topics, parameters and robots of a graph, and the beginning of its predicted
/// timeline.
pub(crate) fn describe(run: &str, plan: &Plan, overheads: &Overheads) -> Json {
    let topics = plan.topics.iter().enumerate().map(|(place, topic)| {
        let name = |index: &usize| plan.components[*index].name.as_str();
        let readers: Vec<&str> = topic.readers.iter().map(name).collect();
        json!({
            "name": topic.name,
            "type": topic.layout.type_name,
            "writer": plan.components[topic.writer].name,
            "readers": readers,
            "fields": fields(plan, place),
        })
    });
    let latencies = plan.latencies.iter().map(|latency| {
        let name = |index: usize| plan.topics[index].name.as_str();
        json!({ "from": name(latency.from), "to": name(latency.to), "max_ns": latency.max_ns })
    });
    let is_timed = plan.clock == ClockKind::Realtime;
    let predicted = is_timed.then(|| timeline(plan, overheads, PREDICTED_NS));
    json!({
        "run": run,
        "graph": plan.name,
        "clock": plan.clock,
        "components": plan.components.iter().map(|it| component(plan, it)).collect::<Vec<_>>(),
        "topics": topics.collect::<Vec<_>>(),
        "latencies": latencies.collect::<Vec<_>>(),
        "robots": drawn(plan),
        "timeline": predicted,
    })
}

/// Returns the units of the fields of a topic, and names of the entries of their arrays, if any. Names of
/// joints, which all fields of such a topic share, are listed once, for the field `""`.
fn fields(plan: &Plan, topic: usize) -> Json {
    let layout = &plan.topics[topic].layout;
    let mut quantities = serde_json::Map::new();
    let names = |field: &str| entries(plan, topic, field);
    if layout.type_name.starts_with("motorium.Joint") {
        quantities.insert(String::new(), json!({ "unit": "", "entries": names("") }));
    }
    let of_joints = !quantities.is_empty();
    for field in &layout.fields {
        let unit = quantity(&layout.type_name, &field.name).map_or("", |quantity| quantity.unit);
        let entries = if of_joints { Vec::new() } else { names(&field.name) };
        if !unit.is_empty() || !entries.is_empty() {
            quantities.insert(field.name.clone(), json!({ "unit": unit, "entries": entries }));
        }
    }
    Json::Object(quantities)
}

fn component(plan: &Plan, component: &ComponentPlan) -> Json {
    let kind = match &component.program {
        Program::Builtin { kind } | Program::Sibling { kind, .. } => kind.clone(),
        Program::Exec { path } => path.display().to_string(),
    };
    let trigger = match component.activation {
        Activation::Triggered { topic, .. } => Some(plan.topics[topic].name.as_str()),
        Activation::Periodic { .. } | Activation::Descriptor { .. } => None,
    };
    let parameters = component.parameters.iter().map(|parameter| &parameter.declaration);
    json!({
        "name": component.name,
        "kind": kind,
        "rate_hz": 1e9 / component.period_ns().max(1) as f64,
        "trigger": trigger,
        "budget_ns": component.budget_ns,
        "core": component.core,
        "actuator": component.actuator,
        "parameters": parameters.collect::<Vec<_>>(),
    })
}

/// Returns each robot with the channels that pose it: joints, and the base if it moves.
fn drawn(plan: &Plan) -> Vec<Json> {
    let described = descriptions(plan);
    let robots = described.iter().map(|robot| {
        let own: Vec<_> = (0..plan.topics.len())
            .filter(|index| robot_of_topic(plan, *index).is_some_and(|it| it.name == robot.robot))
            .flat_map(|index| channels(plan, index).unwrap_or_default())
            .collect();
        let of = |end: &str, kind: &str| {
            let found = own.iter().find(|channel| {
                channel.name.ends_with(end) && plan.topics[channel.topic].layout.type_name == kind
            });
            found.map(|channel| channel.name.clone())
        };
        let transforms = of("/transforms", "motorium.JointState");
        let joints = transforms.as_deref().and_then(|name| name.strip_suffix("/transforms"));
        json!({
            "name": robot.robot,
            "description": robot.topic,
            "frame_prefix": robot.frame_prefix,
            "state": joints,
            "joints": joints.map(|topic| format!("{topic}/joints")),
            "transforms": transforms,
            "base": of("/transforms", "motorium.BaseState"),
            "odometry": of("/odometry", "motorium.Odometry"),
        })
    });
    robots.collect()
}
