//! Columns of components, from left to right along the flow of data.
//!
//! Method of Sugiyama, Tagawa and Toda (1981): break cycles, assign layers, order within each layer to avoid
//! crossings. A wire that closes a loop, such as the command back to the robot, is not part of the layers; it
//! is routed around the picture.

use motorium::plan::Plan;

use super::wires::Wire;

/// An entry of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Item {
    /// A component.
    Component(usize),
    /// A wire on its way to a later column; index of the wire.
    Passage(usize),
}

/// The columns, and the wires that go back.
#[derive(Debug)]
pub(super) struct Layers {
    /// From left to right, each from top to bottom.
    pub(super) columns: Vec<Vec<Item>>,
    /// Column of each component.
    pub(super) column_of: Vec<usize>,
    /// By wire: `true` if it leads to the same column or to the left.
    pub(super) back: Vec<bool>,
}

/// Sweeps over the columns to reduce crossings: more than graphs of this size ever need.
const SWEEPS: usize = 16;

impl Layers {
    pub(super) fn assign(plan: &Plan, wires: &[Wire]) -> Self {
        let count = plan.components.len();
        let back = back_wires(plan, wires);
        let forward: Vec<(usize, usize)> = wires
            .iter()
            .zip(&back)
            .filter(|(_, back)| !**back)
            .map(|(wire, _)| (wire.writer, wire.reader))
            .collect();
        let column_of = assign(count, &forward);
        let mut columns = vec![Vec::new(); column_of.iter().max().map_or(0, |last| last + 1)];
        for component in 0..count {
            columns[column_of[component]].push(Item::Component(component));
        }
        for (index, wire) in wires.iter().enumerate().filter(|(index, _)| !back[*index]) {
            for column in &mut columns[column_of[wire.writer] + 1..column_of[wire.reader]] {
                column.push(Item::Passage(index));
            }
        }
        let mut layers = Self { columns, column_of, back };
        layers.order(wires);
        layers
    }

    /// Items in the neighbouring column that an item is connected to.
    pub(super) fn neighbours(&self, column: usize, item: Item, left: bool, wires: &[Wire]) -> Vec<Item> {
        let at = |wire: usize, component: usize, next: usize| {
            if self.column_of[component] == next { Item::Component(component) } else { Item::Passage(wire) }
        };
        let next = if left { column.checked_sub(1) } else { Some(column + 1) };
        let Some(next) = next.filter(|next| *next < self.columns.len()) else { return Vec::new() };
        let touches = |index: usize, wire: &Wire| match item {
            Item::Passage(passage) => passage == index,
            Item::Component(component) if left => wire.reader == component,
            Item::Component(component) => wire.writer == component,
        };
        wires
            .iter()
            .enumerate()
            .filter(|(index, wire)| !self.back[*index] && touches(*index, wire))
            .map(|(index, wire)| at(index, if left { wire.writer } else { wire.reader }, next))
            .collect()
    }

    /// Orders every column by the mean position of its neighbours, in sweeps to the right and left, and keeps
    /// the order with the fewest crossings.
    fn order(&mut self, wires: &[Wire]) {
        let mut best = self.columns.clone();
        let mut fewest = self.crossings(wires);
        for sweep in 0..SWEEPS {
            let left = sweep % 2 == 0;
            let count = self.columns.len();
            for step in 0..count {
                let column = if left { step } else { count - 1 - step };
                let mut keyed: Vec<(f64, Item)> = self.columns[column]
                    .iter()
                    .enumerate()
                    .map(|(place, item)| (self.mean_place(column, *item, left, place, wires), *item))
                    .collect();
                keyed.sort_by(|(a, _), (b, _)| a.total_cmp(b));
                self.columns[column] = keyed.into_iter().map(|(_, item)| item).collect();
            }
            let crossings = self.crossings(wires);
            if crossings < fewest {
                fewest = crossings;
                best = self.columns.clone();
            }
        }
        self.columns = best;
    }

    fn mean_place(&self, column: usize, item: Item, left: bool, place: usize, wires: &[Wire]) -> f64 {
        let next = if left { column.wrapping_sub(1) } else { column + 1 };
        let neighbours = self.neighbours(column, item, left, wires);
        let places: Vec<usize> = neighbours
            .iter()
            .filter_map(|neighbour| self.columns.get(next)?.iter().position(|other| other == neighbour))
            .collect();
        match places.len() {
            0 => place as f64,
            count => places.iter().sum::<usize>() as f64 / count as f64,
        }
    }

    /// Number of crossings of wires between neighbouring columns.
    fn crossings(&self, wires: &[Wire]) -> usize {
        let mut total = 0;
        for column in 0..self.columns.len().saturating_sub(1) {
            let mut links = Vec::new();
            for (from, item) in self.columns[column].iter().enumerate() {
                for neighbour in self.neighbours(column, *item, false, wires) {
                    let to = self.columns[column + 1].iter().position(|other| *other == neighbour);
                    links.extend(to.map(|to| (from, to)));
                }
            }
            for (index, (from, to)) in links.iter().enumerate() {
                total += links[..index]
                    .iter()
                    .filter(|(other_from, other_to)| {
                        (other_from < from && other_to > to) || (other_from > from && other_to < to)
                    })
                    .count();
            }
        }
        total
    }
}

/// The wires that close a loop: first wires into the component that applies commands, where a control loop
/// closes; then the remaining ones, in the order of the file.
fn back_wires(plan: &Plan, wires: &[Wire]) -> Vec<bool> {
    let mut back: Vec<bool> = wires.iter().map(|wire| wire.writer == wire.reader).collect();
    for index in 0..wires.len() {
        let wire = &wires[index];
        if plan.components[wire.reader].actuator && reaches(wire.reader, wire.writer, wires, &back) {
            back[index] = true;
        }
    }
    // Add the others one by one unless they close a loop. Wires that wake their reader come first: they are
    // the backbone of the picture.
    let mut left_out = vec![true; wires.len()];
    for wakes in [true, false] {
        for index in 0..wires.len() {
            if back[index] || wires[index].wakes != wakes {
                continue;
            }
            if reaches(wires[index].reader, wires[index].writer, wires, &left_out) {
                back[index] = true;
            } else {
                left_out[index] = false;
            }
        }
    }
    back
}

/// Returns `true` if data flows from one component to another along the remaining wires.
fn reaches(from: usize, to: usize, wires: &[Wire], left_out: &[bool]) -> bool {
    let mut seen = vec![from];
    let mut next = 0;
    while let Some(component) = seen.get(next).copied() {
        if component == to {
            return true;
        }
        next += 1;
        for (wire, _) in wires.iter().zip(left_out).filter(|(_, left_out)| !**left_out) {
            if wire.writer == component && !seen.contains(&wire.reader) {
                seen.push(wire.reader);
            }
        }
    }
    false
}

/// Column of each component: one further than its inputs; a component without inputs is placed just before
/// its readers.
fn assign(count: usize, forward: &[(usize, usize)]) -> Vec<usize> {
    let mut column = vec![0; count];
    // longest paths settle after as many rounds as there are components
    for _ in 0..count {
        for (writer, reader) in forward {
            column[*reader] = column[*reader].max(column[*writer] + 1);
        }
    }
    for component in 0..count {
        let reads = forward.iter().any(|(_, reader)| *reader == component);
        let nearest = forward
            .iter()
            .filter(|(writer, _)| *writer == component)
            .map(|(_, reader)| column[*reader])
            .min();
        if let Some(nearest) = nearest.filter(|_| !reads) {
            column[component] = nearest - 1;
        }
    }
    column
}
