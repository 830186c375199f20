//! Mermaid: text that GitHub and many editors draw.

use std::fmt::Write as _;

use motorium::plan::Plan;

use super::wires::wires;
use super::{Measured, labels};

/// Returns the graph as a Mermaid flowchart, with measured values if there are any.
pub fn mermaid(plan: &Plan, measured: Option<&Measured>) -> String {
    let mut text = format!("---\ntitle: {}\n---\nflowchart LR\n", escape(&plan.name));
    for (index, component) in plan.components.iter().enumerate() {
        let mut lines =
            vec![format!("<b>{}</b>", escape(&component.name)), escape(&labels::program(component))];
        lines.extend(labels::facts(component, plan).iter().map(|fact| escape(fact)));
        lines.extend(measured.and_then(|measured| Measured::text_at(&measured.rates, index)).map(escape));
        let _ = writeln!(text, "    c{index}[\"{}\"]", lines.join("<br/>"));
    }
    let mut budgeted = Vec::new();
    for (edge, wire) in wires(plan).into_iter().enumerate() {
        let arrow = if wire.wakes { "==>" } else { "-.->" };
        let label = label(plan, wire.topic, measured);
        let _ = writeln!(text, "    c{} {arrow}|\"{label}\"| c{}", wire.writer, wire.reader);
        if wire.budgeted {
            budgeted.push(edge.to_string());
        }
    }
    for (index, topic) in plan.topics.iter().enumerate().filter(|(_, topic)| topic.readers.is_empty()) {
        let _ = writeln!(text, "    t{index}(( ))");
        let _ = writeln!(text, "    c{} -.->|\"{}\"| t{index}", topic.writer, label(plan, index, measured));
    }
    if !budgeted.is_empty() {
        let _ = writeln!(text, "    linkStyle {} stroke:#d9480f", budgeted.join(","));
    }
    text
}

fn label(plan: &Plan, topic: usize, measured: Option<&Measured>) -> String {
    let mut lines = vec![escape(&plan.topics[topic].name), escape(&labels::carried(&plan.topics[topic]))];
    lines.extend(measured.and_then(|measured| Measured::text_at(&measured.topics, topic)).map(escape));
    for (index, latency) in plan.latencies.iter().enumerate().filter(|(_, latency)| latency.to == topic) {
        let budget = labels::latency(latency, plan).join(" ");
        let seen = measured.and_then(|measured| Measured::text_at(&measured.latencies, index));
        lines.push(escape(&seen.map_or(budget.clone(), |seen| format!("{budget}: {seen}"))));
    }
    lines.join("<br/>")
}

/// Escapes the special characters of a quoted Mermaid label as entities.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('"', "&quot;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('#', "&num;")
}
