//! The graph as a picture.

use std::fmt::Write as _;

use motorium::plan::{Plan, SchedulingClass};

use super::card::{ABOVE, BELOW, Card, FACT, LINE, NAME_BASELINE, Output, SMALL_LINE};
use super::layers::Layers;
use super::placement::{HEADER, Placement};
use super::style::STYLE;
use super::wires::{Wire, wires};
use super::{Measured, labels};
use crate::text::{escape, width};

/// Length of an arrow head.
const HEAD: f64 = 9.0;
/// Radius of the corners of a wire.
const CORNER: f64 = 9.0;

/// Returns the graph as SVG, with measured values if there are any.
pub fn svg(plan: &Plan, measured: Option<&Measured>) -> String {
    let wires = wires(plan);
    let layers = Layers::assign(plan, &wires);
    let placement = Placement::compute(plan, &wires, &layers, measured);
    let (w, h) = (placement.width.ceil(), placement.height.ceil());
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" width=\"{w}\" height=\"{h}\" role=\"img\">\n"
    );
    let _ = writeln!(svg, "<title>{}</title>", escape(&plan.name));
    let _ = writeln!(svg, "<style>{STYLE}</style>");
    let _ = writeln!(
        svg,
        "<rect class=\"page\" x=\"0.5\" y=\"0.5\" width=\"{}\" height=\"{}\" rx=\"10\"/>",
        w - 1.0,
        h - 1.0
    );
    text(&mut svg, "title", 28.0, 34.0, &plan.name);
    text(&mut svg, "fact", 28.0, 53.0, &labels::summary(plan));
    // where wires overlap, the more important ones are drawn on top
    let mut order: Vec<usize> = (0..wires.len()).collect();
    order.sort_by_key(|index| (wires[*index].budgeted, wires[*index].wakes));
    for index in order {
        let wire = &wires[index];
        draw_wire(&mut svg, index, wire, plan, &layers, &placement);
    }
    for (component, card) in placement.cards.iter().enumerate() {
        draw_card(&mut svg, component, card, plan);
    }
    legend(&mut svg, plan, placement.height - 20.0);
    svg.push_str("</svg>\n");
    debug_assert!(placement.cards.iter().all(|card| card.y >= HEADER));
    svg
}

fn text(svg: &mut String, class: &str, x: f64, y: f64, content: &str) {
    let _ = writeln!(svg, "<text class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\">{}</text>", escape(content));
}

fn draw_card(svg: &mut String, component: usize, card: &Card, plan: &Plan) {
    let Card { x, y, width, height, .. } = card;
    let described = &plan.components[component];
    let _ = writeln!(
        svg,
        "<rect class=\"card\" x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" rx=\"7\"/>"
    );
    let class = match described.class {
        SchedulingClass::Fifo(_) | SchedulingClass::Deadline { .. } => "realtime",
        SchedulingClass::Normal => "shared",
    };
    let _ = writeln!(
        svg,
        "<rect class=\"{class}\" x=\"{:.1}\" y=\"{:.1}\" width=\"3.5\" height=\"{:.1}\" rx=\"1.7\"/>",
        x + 5.0,
        y + 9.0,
        height - 18.0
    );
    let left = x + 17.0;
    let lines = card.lines.len() + usize::from(card.measured.is_some());
    let spare = height - (NAME_BASELINE + LINE * lines as f64 + 12.0);
    let mut baseline = y + NAME_BASELINE + (spare / 2.0).max(0.0);
    text(svg, "name", left, baseline, &described.name);
    for (index, line) in card.lines.iter().enumerate() {
        baseline += LINE;
        text(svg, if index == 0 { "kind" } else { "fact" }, left, baseline, line);
    }
    if let Some(rate) = &card.measured {
        text(svg, "rate", left, baseline + LINE, rate);
    }
    for output in &card.outputs {
        draw_output(svg, card, output, plan.topics[output.topic].readers.is_empty());
    }
}

/// The name of a topic, written on its wire.
fn draw_output(svg: &mut String, card: &Card, output: &Output, unread: bool) {
    let (x, y) = (card.x + card.width, card.y + output.offset);
    if unread {
        let end = x + output.width();
        let _ = writeln!(svg, "<path class=\"wire\" d=\"M{x:.1},{y:.1} H{end:.1}\"/>");
        let _ = writeln!(svg, "<circle class=\"arrow\" cx=\"{end:.1}\" cy=\"{y:.1}\" r=\"3\"/>");
    }
    let left = x + 8.0;
    text(svg, "topic", left, y - ABOVE, &output.name);
    let small = [("small", Some(&output.carried)), ("measured", output.measured.as_ref())];
    let lines = small.into_iter().filter_map(|(class, line)| Some((class, line?)));
    let lines = lines.chain(output.budgets.iter().map(|budget| ("budget", budget)));
    for (index, (class, line)) in lines.enumerate() {
        text(svg, class, left, y + BELOW + SMALL_LINE * index as f64, line);
    }
}

fn draw_wire(
    svg: &mut String,
    index: usize,
    wire: &Wire,
    plan: &Plan,
    layers: &Layers,
    placement: &Placement,
) {
    let (x, y) = placement.start(wire);
    let (end_x, end_y) = placement.end(index, wire);
    let stop = end_x - HEAD + 1.0;
    let mut path = format!("M{x:.1},{y:.1}");
    match placement.lanes[index] {
        Some(lanes) => {
            let corner = [
                (lanes.down, y),
                (lanes.down, lanes.below),
                (lanes.up, lanes.below),
                (lanes.up, end_y),
                (stop, end_y),
            ];
            rounded(&mut path, (x, y), &corner);
        }
        None => {
            let (mut column, last) = (layers.column_of[wire.writer], layers.column_of[wire.reader]);
            let mut height = y;
            let passages = placement.passages[index].iter().copied().chain([end_y]);
            for next in passages.take(last - column) {
                let (start, end) = placement.columns[column].bend;
                let middle = (start + end) / 2.0;
                let _ = write!(
                    path,
                    " H{start:.1} C{middle:.1},{height:.1} {middle:.1},{next:.1} {end:.1},{next:.1}"
                );
                height = next;
                column += 1;
            }
            let _ = write!(path, " H{stop:.1}");
        }
    }
    let kind = if wire.wakes { "wakes" } else { "reads" };
    let budgeted = if wire.budgeted { " budgeted" } else { "" };
    let (writer, reader) = (&plan.components[wire.writer], &plan.components[wire.reader]);
    let port = &reader.inputs[wire.input].port;
    let topic = &plan.topics[wire.topic].name;
    let title = format!("{topic}: {} to {}.{port}", writer.name, reader.name);
    let _ = writeln!(
        svg,
        "<g><title>{}</title><path class=\"wire {kind}{budgeted}\" d=\"{path}\"/>\
         <path class=\"arrow{budgeted}\" d=\"M{end_x:.1},{end_y:.1} l-{HEAD},-4.5 v9 z\"/></g>",
        escape(&title)
    );
}

/// Straight lines from corner to corner, the corners rounded.
fn rounded(path: &mut String, start: (f64, f64), corners: &[(f64, f64)]) {
    let mut from = start;
    for (index, corner) in corners.iter().enumerate() {
        let Some(next) = corners.get(index + 1) else {
            let _ = write!(path, " L{:.1},{:.1}", corner.0, corner.1);
            return;
        };
        let toward = |other: (f64, f64)| {
            let (dx, dy) = (other.0 - corner.0, other.1 - corner.1);
            let length = dx.hypot(dy);
            let part = if length > 0.0 { CORNER.min(length / 2.0) / length } else { 0.0 };
            (corner.0 + dx * part, corner.1 + dy * part)
        };
        let (before, after) = (toward(from), toward(*next));
        let _ = write!(
            path,
            " L{:.1},{:.1} Q{:.1},{:.1} {:.1},{:.1}",
            before.0, before.1, corner.0, corner.1, after.0, after.1
        );
        from = *corner;
    }
}

fn legend(svg: &mut String, plan: &Plan, y: f64) {
    let mut entries =
        vec![("wire wakes", "wakes its reader"), ("wire reads", "is read when its reader steps")];
    if !plan.latencies.is_empty() {
        entries.push(("wire wakes budgeted", "has a latency budget"));
    }
    let mut x = 28.0;
    for (class, words) in entries {
        let _ = writeln!(svg, "<path class=\"{class}\" d=\"M{x:.1},{:.1} h30\"/>", y - 4.0);
        text(svg, "small", x + 38.0, y, words);
        x += 38.0 + width(words, FACT) + 22.0;
    }
}
