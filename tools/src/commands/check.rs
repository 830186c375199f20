//! `motorium check`: checks a graph file without starting anything.

use std::process::ExitCode;

use motorium::plan::{Activation, Plan, SchedulingClass};

use super::loading::GraphArgs;
use crate::report::table;
use crate::{registry, style};

/// Check a graph file without starting anything.
///
/// Example: motorium check graphs/panda-reach.toml --json
#[derive(Debug, clap::Args)]
pub(crate) struct Check {
    #[command(flatten)]
    graph: GraphArgs,
    /// Print the checked plan, or what is wrong, as JSON
    #[arg(long)]
    json: bool,
}

impl Check {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let checked = match self.graph.load(&registry::registry(), self.json) {
            Ok(checked) => checked,
            Err(code) => return Ok(code),
        };
        if self.json {
            let diagnostics: Vec<_> = checked.warnings.iter().map(|warning| warning.report()).collect();
            let output = serde_json::json!({ "valid": true, "diagnostics": diagnostics, "plan": checked.plan });
            println!("{}", serde_json::to_string_pretty(&output)?);
        } else {
            anstream::print!("{}", describe(&checked.plan));
        }
        Ok(ExitCode::SUCCESS)
    }
}

fn describe(plan: &Plan) -> String {
    let mut components = table(["component", "kind", "steps", "budget", "core", "class", "reads", "writes"]);
    for component in &plan.components {
        let kind = match &component.program {
            motorium::plan::Program::Builtin { kind } => kind.clone(),
            motorium::plan::Program::Exec { path } => path.display().to_string(),
        };
        let steps = match &component.activation {
            Activation::Periodic { period_ns, .. } => format!("at {} Hz", 1e9 / *period_ns as f64),
            Activation::Triggered { topic, .. } => format!("on {}", plan.topics[*topic].name),
        };
        let class = match component.class {
            SchedulingClass::Fifo(priority) => format!("FIFO {priority}"),
            SchedulingClass::Normal => "normal".to_string(),
        };
        let names = |ports: &[motorium::plan::PortPlan]| {
            let wired: Vec<_> =
                ports.iter().filter_map(|port| Some(plan.topics[port.topic?].name.as_str())).collect();
            wired.join("\n")
        };
        components.add_row([
            component.name.clone(),
            kind,
            steps,
            component.budget_ns.map_or_else(|| "-".to_string(), |ns| format!("{} us", ns as f64 * 1e-3)),
            component.core.map_or_else(|| "shared".to_string(), |core| core.to_string()),
            class,
            names(&component.inputs),
            names(&component.outputs),
        ]);
    }
    let mut text = format!("{}\n", components.trim_fmt());
    for latency in &plan.latencies {
        text += &format!(
            "latency {} -> {}: at most {} us\n",
            plan.topics[latency.from].name,
            plan.topics[latency.to].name,
            latency.max_ns as f64 * 1e-3
        );
    }
    text + &format!("{} {} is a graph that can run\n", style::good("ok:"), plan.file.display())
}
