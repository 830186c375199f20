//! Ray casting on height fields: a ray steps from block to block, and tests the cells of blocks that are high
//! enough to reach it.

use motorium_robots::V3;

use super::HeightField;
use super::field::BLOCK;

/// Maximum distance over which rays are traced over terrain \[m\].
const FARTHEST: f64 = 1e4;

/// Traversal of a grid by a ray.
struct Walk {
    square: [i64; 2],
    step: [i64; 2],
    /// Distances at which the next cell along each axis starts.
    next: [f64; 2],
    /// Distance between consecutive cells along each axis.
    every: [f64; 2],
    from: f64,
    end: f64,
}

impl Walk {
    /// Traverses from `from` to `end` \[m\] along a ray; origin and direction are in cell widths.
    fn new(origin: [f64; 2], direction: [f64; 2], from: f64, end: f64) -> Self {
        let (mut square, mut step) = ([0; 2], [0; 2]);
        let (mut next, mut every) = ([f64::INFINITY; 2], [f64::INFINITY; 2]);
        for axis in 0..2 {
            let (start, slope) = (origin[axis] + direction[axis] * from, direction[axis]);
            square[axis] = start.floor() as i64;
            if slope != 0.0 {
                step[axis] = if slope > 0.0 { 1 } else { -1 };
                every[axis] = 1.0 / slope.abs();
                let side = square[axis] as f64 + if slope > 0.0 { 1.0 } else { 0.0 };
                next[axis] = (side - origin[axis]) / slope;
            }
        }
        Self { square, step, next, every, from, end }
    }
}

impl Iterator for Walk {
    /// A cell, and the distances at which the ray enters and leaves it.
    type Item = ([i64; 2], f64, f64);

    #[inline(always)]
    fn next(&mut self) -> Option<Self::Item> {
        if self.from >= self.end {
            return None;
        }
        let axis = usize::from(self.next[1] < self.next[0]);
        let (square, from) = (self.square, self.from);
        let until = self.next[axis].max(from);
        self.square[axis] += self.step[axis];
        self.next[axis] += self.every[axis];
        self.from = until;
        Some((square, from, until.min(self.end)))
    }
}

impl HeightField {
    /// Returns the distance along a ray to the surface, and the normal there; `None` from below.
    pub(crate) fn meet(&self, origin: V3, direction: V3, range: f64) -> Option<(f64, V3)> {
        // The part of the ray between the highest and the lowest point.
        let (mut from, mut end) = (0.0_f64, range.min(FARTHEST));
        if direction.z < 0.0 {
            from = from.max((self.high - origin.z) / direction.z);
            // a little farther, for rounding
            end = end.min((self.low - 1e-9 - origin.z) / direction.z);
        } else if origin.z > self.high {
            return None;
        } else if direction.z > 0.0 {
            end = end.min((self.high - origin.z) / direction.z);
        }
        if from >= end || origin.z <= self.high && origin.z <= self.height(origin.x, origin.y) {
            return None;
        }
        let (x, y) = self.in_cells(origin.x, origin.y);
        let (along_x, along_y) = (direction.x / self.spacing, direction.y / self.spacing);
        let side = 1.0 / BLOCK as f64;
        let blocks = Walk::new([x * side, y * side], [along_x * side, along_y * side], from, end);
        for ([block_i, block_j], enter, leave) in blocks {
            let lowest = origin.z + direction.z * if direction.z < 0.0 { leave } else { enter };
            if lowest > self.top(block_i, block_j) {
                continue;
            }
            for ([i, j], enter, leave) in Walk::new([x, y], [along_x, along_y], enter, leave) {
                let cell = self.cell(i, j);
                let lowest = origin.z + direction.z * if direction.z < 0.0 { leave } else { enter };
                if lowest > cell.top {
                    continue;
                }
                // Within the cell: its two triangles, in the order in which the ray crosses them.
                let (u, v) = (x - i as f64, y - j as f64);
                let turn = (v - u) / (along_x - along_y);
                let parts = if turn > enter && turn < leave {
                    [(enter, turn), (turn, leave)]
                } else {
                    [(enter, leave); 2]
                };
                for (start, stop) in parts {
                    let middle = 0.5 * (start + stop);
                    let slopes = cell.slopes[usize::from(v + along_y * middle > u + along_x * middle)];
                    let above = |at: f64| {
                        origin.z + direction.z * at
                            - cell.height
                            - slopes.0 * (u + along_x * at)
                            - slopes.1 * (v + along_y * at)
                    };
                    let (first, last) = (above(start), above(stop));
                    if last > 0.0 {
                        continue;
                    }
                    let share = if first > 0.0 { first / (first - last) } else { 0.0 };
                    let distance = start + share * (stop - start);
                    return (distance <= range).then(|| (distance, self.upward(slopes)));
                }
            }
        }
        None
    }
}
