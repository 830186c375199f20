//! Labels of components and topics.

use motorium::declare::TopicPattern;
use motorium::plan::{
    Activation, ClockKind, ComponentPlan, LatencyPlan, OnMiss, Plan, Program, SafeState, SchedulingClass,
    TopicPlan,
};
use motorium::units::{Rate, TimeSpan};

/// A time with its unit.
pub(super) fn time(ns: u64) -> String {
    TimeSpan { ns }.to_string()
}

/// The program of a component: its kind, or the file name of its program.
pub(super) fn program(component: &ComponentPlan) -> String {
    match &component.program {
        Program::Builtin { kind } | Program::Sibling { kind, .. } => kind.clone(),
        Program::Exec { path } => path
            .file_name()
            .map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned()),
    }
}

/// The activation of a component, as text.
pub(super) fn activation(component: &ComponentPlan) -> String {
    match component.activation {
        Activation::Periodic { period_ns, phase_ns: 0 } => format!("every {}", rate_and_period(period_ns)),
        Activation::Periodic { period_ns, phase_ns } => {
            format!("every {}, after {}", rate_and_period(period_ns), time(phase_ns))
        }
        Activation::Descriptor { min_interval_ns } => {
            format!("on events, at least {} apart", time(min_interval_ns))
        }
        Activation::Triggered { input, .. } => match component.inputs.get(input) {
            Some(port) => format!("on {}", port.port),
            None => "when triggered".to_string(),
        },
    }
}

fn rate_and_period(period_ns: u64) -> String {
    format!("{} ({})", time(period_ns), Rate { period_ns })
}

/// Core and priority of a component.
pub(super) fn scheduling(component: &ComponentPlan) -> String {
    let core = component.core.map_or_else(|| "shared cores".to_string(), |core| format!("core {core}"));
    match component.class {
        SchedulingClass::Fifo(priority) => format!("{core}, FIFO {priority}"),
        SchedulingClass::Deadline { .. } => "any core, DEADLINE".to_string(),
        SchedulingClass::Normal => format!("{core}, not real-time"),
    }
}

/// The lines about a component below its name and kind.
pub(super) fn facts(component: &ComponentPlan, plan: &Plan) -> Vec<String> {
    let mut facts = vec![activation(component), scheduling(component)];
    if let Some(budget_ns) = component.budget_ns {
        facts.push(format!("budget {}", time(budget_ns)));
    }
    if let Some(robot) = &component.robot {
        facts.push(format!("robot {}", robot.name));
    }
    if component.actuator {
        let safety = plan.safety_of(component);
        let safe_state = match safety.gate.safe_state {
            SafeState::Hold => "hold",
            SafeState::Damp => "damp",
            SafeState::ZeroTorque => "zero torque",
            SafeState::Brake => "brake",
        };
        facts.push(format!("stale after {}: {safe_state}", time(safety.stale_after_ns)));
    }
    facts
}

/// The type a topic carries, without the prefix of the built-in types.
pub(super) fn carried(topic: &TopicPlan) -> String {
    let name = topic.layout.type_name.strip_prefix("motorium.").unwrap_or(&topic.layout.type_name);
    match topic.pattern {
        TopicPattern::State => name.to_string(),
        TopicPattern::Stream { capacity } => format!("stream of {name}, {capacity} deep"),
        TopicPattern::Slices { capacity, longest } => {
            format!("slices of up to {longest} {name}, {capacity} deep")
        }
    }
}

/// A latency budget, written at the topic where it ends: its limit, and where it begins.
pub(super) fn latency(latency: &LatencyPlan, plan: &Plan) -> [String; 2] {
    let miss = match latency.on_miss {
        OnMiss::Warn => "",
        OnMiss::SafeStop => ", else stop",
    };
    [format!("≤ {}{miss}", time(latency.max_ns)), format!("since {}", plan.topics[latency.from].name)]
}

/// One line about the whole graph.
pub(super) fn summary(plan: &Plan) -> String {
    let clock = match plan.clock {
        ClockKind::Realtime => "in real time",
        ClockKind::Lockstep => "in lockstep",
    };
    let count = plan.components.len();
    let processes = if count == 1 { "1 process".to_string() } else { format!("{count} processes") };
    match plan.duration_ns {
        Some(ns) => format!("{processes} {clock}, for {}", time(ns)),
        None => format!("{processes} {clock}"),
    }
}
