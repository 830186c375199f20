//! The components of a graph as a table.

use motorium::plan::{Activation, ComponentPlan, Plan, PortPlan, Program, SchedulingClass};
use motorium::units::{Rate, TimeSpan};

use crate::report::table;

/// A table of all components.
pub(super) fn describe(plan: &Plan) -> String {
    let mut components = table(["component", "kind", "steps", "budget", "core", "class", "reads", "writes"]);
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
            names(&component.inputs),
            names(&component.outputs),
        ]);
    }
    format!("{}\n", components.trim_fmt())
}

fn program(component: &ComponentPlan) -> String {
    match &component.program {
        Program::Builtin { kind } => kind.clone(),
        Program::Exec { path } => path.display().to_string(),
    }
}

fn steps(component: &ComponentPlan, plan: &Plan) -> String {
    match component.activation {
        Activation::Periodic { period_ns, phase_ns: 0 } => format!("at {}", Rate { period_ns }),
        Activation::Periodic { period_ns, phase_ns } => {
            format!("at {} after {}", Rate { period_ns }, TimeSpan { ns: phase_ns })
        }
        Activation::Triggered { topic, .. } => format!("on {}", plan.topics[topic].name),
    }
}
