//! Mermaid: text that GitHub and many editors draw.

use std::fmt::Write as _;

use motorium::plan::Plan;

use super::wires::wires;
use super::words;

/// The graph as a Mermaid flowchart.
pub(crate) fn mermaid(plan: &Plan) -> String {
    let mut text = format!("---\ntitle: {}\n---\nflowchart LR\n", escape(&plan.name));
    for (index, component) in plan.components.iter().enumerate() {
        let mut lines =
            vec![format!("<b>{}</b>", escape(&component.name)), escape(&words::program(component))];
        lines.extend(words::facts(component, plan).iter().map(|fact| escape(fact)));
        let _ = writeln!(text, "    c{index}[\"{}\"]", lines.join("<br/>"));
    }
    let mut budgeted = Vec::new();
    for (edge, wire) in wires(plan).into_iter().enumerate() {
        let arrow = if wire.wakes { "==>" } else { "-.->" };
        let label = label(plan, wire.topic);
        let _ = writeln!(text, "    c{} {arrow}|\"{label}\"| c{}", wire.writer, wire.reader);
        if wire.budgeted {
            budgeted.push(edge.to_string());
        }
    }
    for (index, topic) in plan.topics.iter().enumerate().filter(|(_, topic)| topic.readers.is_empty()) {
        let _ = writeln!(text, "    t{index}(( ))");
        let _ = writeln!(text, "    c{} -.->|\"{}\"| t{index}", topic.writer, label(plan, index));
    }
    if !budgeted.is_empty() {
        let _ = writeln!(text, "    linkStyle {} stroke:#d9480f", budgeted.join(","));
    }
    text
}

fn label(plan: &Plan, topic: usize) -> String {
    let mut lines = vec![escape(&plan.topics[topic].name), escape(&words::carried(&plan.topics[topic]))];
    let latencies = plan.latencies.iter().filter(|latency| latency.to == topic);
    lines.extend(latencies.map(|latency| escape(&words::latency(latency, plan).join(" "))));
    lines.join("<br/>")
}

/// Characters that mean something in a quoted Mermaid label, as entities.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('"', "&quot;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('#', "&num;")
}
