//! Positions of all parts of the picture, in pixels.

use motorium::plan::Plan;

use super::card::{Card, FACT, Output, card};
use super::layers::{Item, Layers};
use super::wires::Wire;
use super::{Measured, labels};
use crate::text::width;

/// Gap between items of a column.
const GAP: f64 = 30.0;
/// Distance between parallel wires.
const LANE: f64 = 11.0;
/// Width of the strip between two columns in which wires bend.
const BEND: f64 = 42.0;
const MARGIN: f64 = 28.0;
/// Font size of the title.
const TITLE: f64 = 18.0;
/// Height of title and summary.
pub(super) const HEADER: f64 = 74.0;
/// Height of the legend.
const FOOTER: f64 = 46.0;
const PASSAGE: f64 = 14.0;
/// Number of rounds that even out heights.
const ROUNDS: usize = 24;

/// A column: boxes, then the names of the topics they write, then the space where wires bend.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Column {
    x: f64,
    /// End of the topic names.
    named: f64,
    /// Left and right edge of the strip in which wires to the next column bend.
    pub(super) bend: (f64, f64),
}

/// The placed parts of the picture.
#[derive(Debug)]
pub(super) struct Placement {
    pub(super) width: f64,
    pub(super) height: f64,
    /// By component.
    pub(super) cards: Vec<Card>,
    pub(super) columns: Vec<Column>,
    /// By wire: heights at which it passes the columns on its way.
    pub(super) passages: Vec<Vec<f64>>,
    /// By wire: the lanes of a backward wire.
    pub(super) lanes: Vec<Option<Lanes>>,
}

/// The route of a backward wire: down in one column, left below everything, up before another.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lanes {
    pub(super) down: f64,
    pub(super) below: f64,
    pub(super) up: f64,
}

impl Placement {
    pub(super) fn compute(plan: &Plan, wires: &[Wire], layers: &Layers, measured: Option<&Measured>) -> Self {
        let mut cards: Vec<Card> = (0..plan.components.len())
            .map(|component| card(plan, component, wires, layers, measured))
            .collect();
        let tops = heights(&cards, wires, layers);
        let mut passages = vec![Vec::new(); wires.len()];
        for (items, tops) in layers.columns.iter().zip(&tops) {
            for (item, top) in items.iter().zip(tops) {
                match item {
                    Item::Component(component) => cards[*component].y = HEADER + top,
                    Item::Passage(wire) => passages[*wire].push(HEADER + top + PASSAGE / 2.0),
                }
            }
        }
        let columns = columns(&mut cards, wires, layers);
        let content = cards.iter().map(|card| card.y + card.height.max(card.slots())).fold(HEADER, f64::max);
        let (lanes, bottom) = lanes(wires, layers, &columns, content);
        let end = columns.last().map_or(0.0, |last| last.bend.0.max(last.named));
        let title = width(&plan.name, TITLE).max(width(&labels::summary(plan), FACT)) + 2.0 * MARGIN;
        Self {
            width: (end + MARGIN).max(title).max(480.0),
            height: bottom + FOOTER,
            cards,
            columns,
            passages,
            lanes,
        }
    }

    /// Point at which a wire leaves its writer.
    pub(super) fn start(&self, wire: &Wire) -> (f64, f64) {
        let card = &self.cards[wire.writer];
        let offset = card.outputs.iter().find(|output| output.topic == wire.topic).map_or(0.0, |o| o.offset);
        (card.x + card.width, card.y + offset)
    }

    /// Point at which a wire, given by its index, meets its reader.
    pub(super) fn end(&self, index: usize, wire: &Wire) -> (f64, f64) {
        let card = &self.cards[wire.reader];
        (card.x, card.y + card.input(index))
    }
}

/// Input of the search for heights.
struct Heights<'a> {
    cards: &'a [Card],
    wires: &'a [Wire],
    layers: &'a Layers,
    /// By column: top of every item.
    tops: Vec<Vec<f64>>,
}

/// Top of every item, by column: neighbours as level with each other as their order and the gaps allow.
fn heights(cards: &[Card], wires: &[Wire], layers: &Layers) -> Vec<Vec<f64>> {
    let mut heights = Heights { cards, wires, layers, tops: Vec::new() };
    for items in &layers.columns {
        let stacked: Vec<_> = items.iter().map(|item| (0.0, heights.height(*item), 1.0)).collect();
        heights.tops.push(spread(&stacked));
    }
    let count = layers.columns.len();
    for round in 0..ROUNDS {
        let left = round % 2 == 0;
        for step in 0..count {
            let column = if left { step } else { count - 1 - step };
            let wanted: Vec<(f64, f64, f64)> = layers.columns[column]
                .iter()
                .zip(&heights.tops[column])
                .map(|(item, top)| match heights.level(column, *item, left) {
                    Some(wanted) => (wanted, heights.height(*item), 1.0),
                    // items without a level yield to items with one
                    None => (*top, heights.height(*item), 0.05),
                })
                .collect();
            heights.tops[column] = spread(&wanted);
        }
    }
    let mut tops = heights.tops;
    let least = tops.iter().flatten().copied().fold(f64::INFINITY, f64::min);
    let least = if least.is_finite() { least } else { 0.0 };
    tops.iter_mut().flatten().for_each(|top| *top -= least);
    tops
}

impl Heights<'_> {
    fn height(&self, item: Item) -> f64 {
        match item {
            Item::Component(component) => self.cards[component].height,
            Item::Passage(_) => PASSAGE,
        }
    }

    /// The top at which an item is level with its neighbours on one side: the mean over the wires between
    /// them.
    fn level(&self, column: usize, item: Item, left: bool) -> Option<f64> {
        let Self { cards, layers, .. } = self;
        let next = if left { column.checked_sub(1)? } else { column + 1 };
        let wanted: Vec<f64> = self
            .wires
            .iter()
            .enumerate()
            .filter(|(index, _)| !layers.back[*index])
            .filter_map(|(index, wire)| {
                let port = |of_reader: bool| match of_reader {
                    true => (wire.reader, cards[wire.reader].input(index)),
                    false => (wire.writer, cards[wire.writer].output(wire.topic)),
                };
                let mine = match (item, port(left)) {
                    (Item::Passage(passage), _) if passage == index => PASSAGE / 2.0,
                    (Item::Component(component), (end, offset)) if component == end => offset,
                    _ => return None,
                };
                let (component, offset) = port(!left);
                let near = layers.column_of[component] == next;
                let (neighbour, theirs) = if near {
                    (Item::Component(component), offset)
                } else {
                    (Item::Passage(index), PASSAGE / 2.0)
                };
                let place = layers.columns.get(next)?.iter().position(|other| *other == neighbour)?;
                Some(self.tops[next][place] + theirs - mine)
            })
            .collect();
        let count = wanted.len();
        (count > 0).then(|| wanted.iter().sum::<f64>() / count as f64)
    }
}

/// Tops as close as possible to the desired ones (least squares), in the same order and with gaps between:
/// isotonic regression by pooling adjacent violators. Each entry is the desired top, the height and the
/// weight.
fn spread(wanted: &[(f64, f64, f64)]) -> Vec<f64> {
    // in coordinates without heights and gaps, the order is the only constraint
    let mut pools: Vec<(f64, f64, usize)> = Vec::new();
    let mut before = 0.0;
    let mut shifts = Vec::new();
    for (top, height, weight) in wanted {
        shifts.push(before);
        let mut pool = (top - before, *weight, 1);
        before += height + GAP;
        while let Some(last) = pools.last().copied().filter(|last| last.0 > pool.0) {
            let weight = last.1 + pool.1;
            pool = ((last.0 * last.1 + pool.0 * pool.1) / weight, weight, last.2 + pool.2);
            pools.pop();
        }
        pools.push(pool);
    }
    let flat = pools.iter().flat_map(|(top, _, count)| std::iter::repeat_n(*top, *count));
    flat.zip(shifts).map(|(top, shift)| top + shift).collect()
}

/// Columns from left to right; sets the position and width of every box.
fn columns(cards: &mut [Card], wires: &[Wire], layers: &Layers) -> Vec<Column> {
    let lanes = |end: fn(&Wire) -> usize, column: usize| {
        let goes = |index: &usize| layers.back[*index] && layers.column_of[end(&wires[*index])] == column;
        (0..wires.len()).filter(goes).count() as f64 * LANE
    };
    let mut columns = Vec::new();
    let mut x = MARGIN + lanes(|wire| wire.reader, 0);
    for column in 0..layers.columns.len() {
        let members: Vec<usize> =
            (0..cards.len()).filter(|component| layers.column_of[*component] == column).collect();
        let width = members.iter().map(|component| cards[*component].width).fold(0.0, f64::max);
        let names = members.iter().flat_map(|component| &cards[*component].outputs).map(Output::width);
        let named = x + width + names.fold(0.0, f64::max);
        for component in members {
            cards[component].x = x;
            cards[component].width = width;
        }
        let start = named + lanes(|wire| wire.writer, column) + 6.0;
        let stop = start + BEND;
        columns.push(Column { x, named, bend: (start, stop) });
        x = stop + lanes(|wire| wire.reader, column + 1) + 14.0;
    }
    columns
}

/// The lanes of wires that go back, and the lowest point of the drawing.
fn lanes(wires: &[Wire], layers: &Layers, columns: &[Column], content: f64) -> (Vec<Option<Lanes>>, f64) {
    let mut bottom = content;
    let mut down = vec![0; columns.len()];
    let mut up = vec![0; columns.len()];
    let lanes = wires
        .iter()
        .enumerate()
        .map(|(index, wire)| {
            let (from, to) = (layers.column_of[wire.writer], layers.column_of[wire.reader]);
            layers.back[index].then(|| {
                bottom += if bottom == content { 22.0 } else { LANE };
                down[from] += 1;
                up[to] += 1;
                Lanes {
                    down: columns[from].named + LANE * f64::from(down[from]) - 4.0,
                    below: bottom,
                    up: columns[to].x - LANE * f64::from(up[to]) - 8.0,
                }
            })
        })
        .collect();
    (lanes, bottom + 10.0)
}
