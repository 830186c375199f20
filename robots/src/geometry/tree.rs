//! A bounding-box tree.

use crate::math::V3;

/// Maximum number of boxes of a leaf.
const LEAF: usize = 4;

/// Maximum depth of a tree; the number of boxes is halved at every node.
const DEEPEST: usize = 64;

/// An axis-aligned box: its lowest and its highest corner.
pub(super) type Bounds = (V3, V3);

/// A tree of axis-aligned boxes, halved at every node along the longest side. Visits do not allocate.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct BoxTree {
    nodes: Vec<Node>,
    /// Indices of the boxes; the boxes of a leaf are adjacent.
    order: Vec<u32>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Node {
    bounds: Bounds,
    /// Position of the first box in the order.
    first: u32,
    /// Number of boxes of a leaf; 0 for an inner node, whose halves are the next node and `second`.
    count: u32,
    second: u32,
}

impl BoxTree {
    pub(super) fn new(boxes: &[Bounds]) -> Self {
        let mut tree = Self { nodes: Vec::new(), order: (0..boxes.len() as u32).collect() };
        if !boxes.is_empty() {
            tree.split(boxes, 0, boxes.len());
        }
        tree
    }

    fn split(&mut self, boxes: &[Bounds], first: usize, end: usize) {
        let own = &mut self.order[first..end];
        let bounds = own
            .iter()
            .map(|index| boxes[*index as usize])
            .reduce(|a, b| (least(a.0, b.0), most(a.1, b.1)))
            .unwrap_or((V3::ZERO, V3::ZERO));
        let node = self.nodes.len();
        let count = own.len() as u32;
        self.nodes.push(Node { bounds, first: first as u32, count, second: 0 });
        if own.len() <= LEAF {
            return;
        }
        let sides = (bounds.1 - bounds.0).array();
        let axis = (0..3).max_by(|a, b| sides[*a].total_cmp(&sides[*b])).unwrap_or(0);
        let middle = |index: &u32| {
            let (low, high) = boxes[*index as usize];
            low.array()[axis] + high.array()[axis]
        };
        let half = own.len() / 2;
        own.select_nth_unstable_by(half, |a, b| middle(a).total_cmp(&middle(b)).then(a.cmp(b)));
        self.split(boxes, first, first + half);
        self.nodes[node].count = 0;
        self.nodes[node].second = self.nodes.len() as u32;
        self.split(boxes, first + half, end);
    }

    /// Returns the bounding box of all boxes.
    pub(super) fn bounds(&self) -> Option<Bounds> {
        self.nodes.first().map(|node| node.bounds)
    }

    /// Calls `visit` with the indices of all boxes in the leaves accepted by `meets`.
    pub(super) fn visit(&self, mut meets: impl FnMut(&Bounds) -> bool, mut visit: impl FnMut(usize)) {
        let mut stack = [0_u32; DEEPEST];
        let mut waiting = usize::from(!self.nodes.is_empty());
        while waiting > 0 {
            waiting -= 1;
            let index = stack[waiting];
            let node = &self.nodes[index as usize];
            if !meets(&node.bounds) {
                continue;
            }
            if node.count > 0 {
                let first = node.first as usize;
                self.order[first..first + node.count as usize].iter().for_each(|item| visit(*item as usize));
            } else {
                (stack[waiting], stack[waiting + 1]) = (node.second, index + 1);
                waiting += 2;
            }
        }
    }
}

pub(super) fn least(a: V3, b: V3) -> V3 {
    V3::new(a.x.min(b.x), a.y.min(b.y), a.z.min(b.z))
}

pub(super) fn most(a: V3, b: V3) -> V3 {
    V3::new(a.x.max(b.x), a.y.max(b.y), a.z.max(b.z))
}

/// Returns `true` if two boxes share a point.
pub(super) fn overlap(a: &Bounds, b: &Bounds) -> bool {
    let apart = |a_low: f64, a_high: f64, b_low: f64, b_high: f64| a_low > b_high || b_low > a_high;
    !(apart(a.0.x, a.1.x, b.0.x, b.1.x)
        || apart(a.0.y, a.1.y, b.0.y, b.1.y)
        || apart(a.0.z, a.1.z, b.0.z, b.1.z))
}

/// Returns `true` if the line from `origin` along `1 / inverse` meets a box within `range`.
pub(super) fn is_met((low, high): &Bounds, origin: V3, inverse: V3, range: f64) -> bool {
    let slab = |low: f64, high: f64, origin: f64, inverse: f64| {
        let (a, b) = ((low - origin) * inverse, (high - origin) * inverse);
        // a line in the plane of a side: 0 times infinity
        if a.is_nan() || b.is_nan() { (f64::NEG_INFINITY, f64::INFINITY) } else { (a.min(b), a.max(b)) }
    };
    let (x, y, z) = (
        slab(low.x, high.x, origin.x, inverse.x),
        slab(low.y, high.y, origin.y, inverse.y),
        slab(low.z, high.z, origin.z, inverse.z),
    );
    let (enter, leave) = (x.0.max(y.0).max(z.0), x.1.min(y.1).min(z.1));
    enter <= leave && leave >= 0.0 && enter <= range
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn visit_matches_a_linear_search() {
        let mut state = 7_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let boxes: Vec<Bounds> = (0..300)
            .map(|_| {
                let low = V3::new(random(), random(), random());
                (low, low + V3::new(random(), random(), random()) * 0.1)
            })
            .collect();
        let tree = BoxTree::new(&boxes);
        for _ in 0..50 {
            let low = V3::new(random(), random(), random());
            let wanted = (low, low + V3::new(0.2, 0.1, 0.3));
            let mut found = Vec::new();
            tree.visit(|bounds| overlap(bounds, &wanted), |item| found.push(item));
            found.retain(|item| overlap(&boxes[*item], &wanted));
            found.sort_unstable();
            let expected: Vec<_> = (0..300).filter(|item| overlap(&boxes[*item], &wanted)).collect();
            assert_eq!(found, expected);
        }
    }
}
