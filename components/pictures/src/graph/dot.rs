//! DOT: text for Graphviz.

use std::fmt::Write as _;

use motorium::plan::Plan;

use super::wires::wires;
use super::{Measured, labels};
use crate::text::escape;

/// Returns the graph in the DOT language, with measured values if there are any.
pub fn dot(plan: &Plan, measured: Option<&Measured>) -> String {
    let mut text = format!("digraph \"{}\" {{\n", quote(&plan.name));
    text.push_str("    rankdir=LR;\n");
    text.push_str("    node [shape=box, style=rounded, fontname=\"Helvetica\", fontsize=11];\n");
    text.push_str("    edge [fontname=\"Helvetica\", fontsize=10];\n");
    for (index, component) in plan.components.iter().enumerate() {
        let mut lines =
            vec![format!("<b>{}</b>", escape(&component.name)), escape(&labels::program(component))];
        lines.extend(labels::facts(component, plan).iter().map(|fact| escape(fact)));
        lines.extend(measured.and_then(|measured| Measured::text_at(&measured.rates, index)).map(escape));
        let _ = writeln!(text, "    c{index} [label=<{}>];", lines.join("<br/>"));
    }
    for wire in wires(plan) {
        let style = if wire.wakes { "solid" } else { "dashed" };
        let colour = if wire.budgeted { ", color=\"#d9480f\", penwidth=2" } else { "" };
        let label = label(plan, wire.topic, measured);
        let _ = writeln!(
            text,
            "    c{} -> c{} [label=<{label}>, style={style}{colour}];",
            wire.writer, wire.reader
        );
    }
    for (index, topic) in plan.topics.iter().enumerate().filter(|(_, topic)| topic.readers.is_empty()) {
        let _ = writeln!(text, "    t{index} [shape=point];");
        let _ = writeln!(
            text,
            "    c{} -> t{index} [label=<{}>, style=dashed];",
            topic.writer,
            label(plan, index, measured)
        );
    }
    text.push_str("}\n");
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

fn quote(text: &str) -> String {
    text.replace('\\', "\\\\").replace('"', "\\\"")
}
