//! The components of a graph as a table.

use std::fmt::Write as _;

use motorium::plan::{Activation, ClockKind, ComponentPlan, Plan, PortPlan, Program, SchedulingClass};
use motorium::units::{Rate, TimeSpan};

use crate::report::table;

/// Returns a table of all components.
pub(super) fn describe(plan: &Plan) -> String {
    let mut components = table([
        "component",
        "kind",
        "steps",
        "budget",
        "core",
        "class",
        "hung after",
        "CPU limit",
        "reads",
        "writes",
    ]);
    for component in &plan.components {
        let names = |ports: &[PortPlan]| {
            let wired: Vec<_> =
                ports.iter().filter_map(|port| Some(plan.topics[port.topic?].name.as_str())).collect();
            wired.join("\n")
        };
        let class = match component.class {
            SchedulingClass::Fifo(priority) => format!("FIFO {priority}"),
            SchedulingClass::Deadline { .. } => "DEADLINE".to_string(),
            SchedulingClass::Normal => "normal".to_string(),
        };
        let core = match (component.core, component.class) {
            (Some(core), _) => core.to_string(),
            (None, SchedulingClass::Deadline { .. }) => "any".to_string(),
            (None, _) => "shared".to_string(),
        };
        components.add_row([
            component.name.clone(),
            program(component),
            steps(component, plan),
            component.budget_ns.map_or_else(|| "-".to_string(), |ns| TimeSpan { ns }.to_string()),
            core,
            class,
            TimeSpan { ns: component.liveness.hang_after_ns }.to_string(),
            component.liveness.cpu_limit_ns.map_or_else(|| "-".to_string(), |ns| TimeSpan { ns }.to_string()),
            names(&component.inputs),
            names(&component.outputs),
        ]);
    }
    format!("{}\n{}{}", components.trim_fmt(), safe_within(plan), notes(plan))
}

/// Facts that components declare about themselves.
fn notes(plan: &Plan) -> String {
    let mut text = String::new();
    for component in &plan.components {
        for note in &component.notes {
            let _ = writeln!(text, "`{}` {note}", component.name);
        }
    }
    text
}

/// Returns the time within which each actuator reaches its safe state, even if another process loops on its
/// core.
fn safe_within(plan: &Plan) -> String {
    let mut text = String::new();
    if plan.clock != ClockKind::Realtime {
        return text;
    }
    for (index, component) in plan.components.iter().enumerate().filter(|(_, component)| component.actuator) {
        let time = |ns: u64| TimeSpan { ns };
        let safety = plan.safety_of(component);
        let (stale_after, period) = (safety.stale_after_ns, component.period_ns());
        let by = plan.longest_hold_up(index);
        let held_up = by.map_or(0, |(_, limit_ns)| limit_ns);
        let name = &component.name;
        let _ = write!(
            text,
            "`{name}` is in its safe state within {} of a failure: {} until a command is stale, {} period",
            time(stale_after + period + held_up),
            time(stale_after),
            time(period)
        );
        if let Some((other, limit_ns)) = by {
            let other = &plan.components[other].name;
            let _ = write!(text, ", {} CPU limit of `{other}` (and two ticks of the kernel)", time(limit_ns));
        }
        text.push('\n');
    }
    text
}

fn program(component: &ComponentPlan) -> String {
    match &component.program {
        Program::Builtin { kind } => kind.clone(),
        Program::Sibling { kind, path } => format!("{kind}\n{}", path.display()),
        Program::Exec { path } => path.display().to_string(),
    }
}

fn steps(component: &ComponentPlan, plan: &Plan) -> String {
    match component.activation {
        Activation::Periodic { period_ns, phase_ns: 0 } => format!("at {}", Rate { period_ns }),
        Activation::Periodic { period_ns, phase_ns } => {
            format!("at {} after {}", Rate { period_ns }, TimeSpan { ns: phase_ns })
        }
        Activation::Descriptor { min_interval_ns } => {
            format!("on events, {} apart", TimeSpan { ns: min_interval_ns })
        }
        Activation::Triggered { topic, .. } => format!("on {}", plan.topics[topic].name),
    }
}
