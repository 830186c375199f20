//! Boxes: texts of a component and its outputs, with their sizes in pixels.

use motorium::plan::Plan;

use super::layers::{Item, Layers};
use super::wires::{Wire, outputs};
use super::{Measured, labels};
use crate::text::width;

/// Font sizes.
pub(super) const NAME: f64 = 15.0;
pub(super) const FACT: f64 = 12.0;
pub(super) const TOPIC: f64 = 12.5;
pub(super) const SMALL: f64 = 11.0;

/// Distance between lines of text in a box, and below a wire.
pub(super) const LINE: f64 = 17.0;
pub(super) const SMALL_LINE: f64 = 14.5;
/// From the top of a box to the baseline of its name.
pub(super) const NAME_BASELINE: f64 = 24.0;
/// Distance from the wire up to the baseline of the topic's name, and down to the baseline of the first line
/// below.
pub(super) const ABOVE: f64 = 5.0;
pub(super) const BELOW: f64 = 13.5;

const PADDING: f64 = 14.0;
/// Minimum height of each input.
const INPUT_SLOT: f64 = 24.0;

/// A component as a box.
#[derive(Debug, Clone)]
pub(super) struct Card {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) width: f64,
    pub(super) height: f64,
    /// Lines below the name; the first one is the program.
    pub(super) lines: Vec<String>,
    pub(super) measured: Option<String>,
    /// Its output topics, from top to bottom.
    pub(super) outputs: Vec<Output>,
    /// Its input wires, from top to bottom: index, and distance from the top of the box.
    inputs: Vec<(usize, f64)>,
}

/// A topic, drawn at the right side of its writer.
#[derive(Debug, Clone)]
pub(super) struct Output {
    pub(super) topic: usize,
    /// Distance of the wire from the top of the box.
    pub(super) offset: f64,
    pub(super) name: String,
    pub(super) carried: String,
    pub(super) measured: Option<String>,
    pub(super) budgets: Vec<String>,
}

impl Output {
    fn height(&self) -> f64 {
        let below = 1 + usize::from(self.measured.is_some()) + self.budgets.len();
        TOPIC + ABOVE + BELOW + SMALL_LINE * below as f64
    }

    pub(super) fn width(&self) -> f64 {
        let small = self.budgets.iter().chain(&self.measured).chain([&self.carried]);
        small.map(|line| width(line, SMALL)).fold(width(&self.name, TOPIC), f64::max) + 12.0
    }
}

impl Card {
    pub(super) fn input(&self, wire: usize) -> f64 {
        self.inputs.iter().find(|(index, _)| *index == wire).map_or(self.height / 2.0, |(_, offset)| *offset)
    }

    pub(super) fn output(&self, topic: usize) -> f64 {
        self.outputs.iter().find(|output| output.topic == topic).map_or(self.height / 2.0, |o| o.offset)
    }

    /// Height required by the names of its topics.
    pub(super) fn slots(&self) -> f64 {
        self.outputs.iter().map(Output::height).sum()
    }
}

pub(super) fn card(
    plan: &Plan,
    component: usize,
    wires: &[Wire],
    layers: &Layers,
    measured: Option<&Measured>,
) -> Card {
    let described = &plan.components[component];
    let mut lines = vec![labels::program(described)];
    lines.extend(labels::facts(described, plan));
    let rate =
        measured.and_then(|measured| Measured::text_at(&measured.rates, component)).map(str::to_string);
    let text =
        lines.iter().chain(&rate).map(|line| width(line, FACT)).fold(width(&described.name, NAME), f64::max);
    let count = lines.len() + usize::from(rate.is_some());
    let mut outputs: Vec<Output> =
        outputs(plan, component).into_iter().map(|topic| output(plan, topic, measured)).collect();
    let place = |item: Option<&Item>, column: usize| {
        let items = layers.columns.get(column)?;
        items.iter().position(|other| Some(other) == item)
    };
    let column = layers.column_of[component];
    // outputs in the order of their readers; backward ones come last
    outputs.sort_by_key(|output| {
        wires
            .iter()
            .enumerate()
            .filter(|(index, wire)| wire.topic == output.topic && !layers.back[*index])
            .filter_map(|(index, wire)| {
                let near = layers.column_of[wire.reader] == column + 1;
                let item = if near { Item::Component(wire.reader) } else { Item::Passage(index) };
                place(Some(&item), column + 1)
            })
            .min()
            .unwrap_or(usize::MAX)
    });
    let mut inputs: Vec<(usize, usize)> = wires
        .iter()
        .enumerate()
        .filter(|(_, wire)| wire.reader == component)
        .map(|(index, wire)| {
            let near = layers.column_of[wire.writer] + 1 == column;
            let item = if near { Item::Component(wire.writer) } else { Item::Passage(index) };
            let place = (!layers.back[index]).then(|| place(Some(&item), column.checked_sub(1)?)).flatten();
            (place.unwrap_or(usize::MAX), index)
        })
        .collect();
    inputs.sort_unstable();
    let slots: f64 = outputs.iter().map(Output::height).sum();
    let height = (NAME_BASELINE + LINE * count as f64 + PADDING)
        .max(slots + 8.0)
        .max(INPUT_SLOT * inputs.len() as f64 + 16.0);
    let mut top = (height - slots) / 2.0;
    for output in &mut outputs {
        output.offset = top + TOPIC + ABOVE;
        top += output.height();
    }
    let step = height / (inputs.len() + 1) as f64;
    let inputs =
        inputs.iter().enumerate().map(|(place, (_, wire))| (*wire, step * (place + 1) as f64)).collect();
    Card {
        x: 0.0,
        y: 0.0,
        width: (text + 2.0 * PADDING + 6.0).max(130.0),
        height,
        lines,
        measured: rate,
        outputs,
        inputs,
    }
}

fn output(plan: &Plan, topic: usize, measured: Option<&Measured>) -> Output {
    let budgets = plan.latencies.iter().enumerate().filter(|(_, latency)| latency.to == topic);
    let budgets = budgets.flat_map(|(index, latency)| {
        let [limit, since] = labels::latency(latency, plan);
        match measured.and_then(|measured| Measured::text_at(&measured.latencies, index)) {
            Some(seen) => [format!("{limit}: {seen}"), since],
            None => [limit, since],
        }
    });
    Output {
        topic,
        offset: 0.0,
        name: plan.topics[topic].name.clone(),
        carried: labels::carried(&plan.topics[topic]),
        measured: measured
            .and_then(|measured| Measured::text_at(&measured.topics, topic))
            .map(str::to_string),
        budgets: budgets.collect(),
    }
}
