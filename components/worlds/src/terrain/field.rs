//! Height fields: surfaces over a grid, for rays and contacts.

use motorium_robots::{V3, nearest_on_triangle};
use nalgebra::{Point3, Vector3};

/// Number of cells along a side of a block; the highest point of each block is stored.
pub(super) const BLOCK: i64 = 8;

/// Ground as a grid of heights, with two triangles per cell. The ground is solid below the surface.
///
/// Beyond the grid, the height continues as at the nearest edge. Each cell is split along the diagonal from
/// its corner with the smallest x and y.
///
/// ```
/// use motorium_worlds::HeightField;
///
/// // A ramp of 1:10 that begins at x = 0.
/// let ramp = HeightField::new([-1.0, -1.0], 0.5, [5, 5], |x, _| 0.1 * x.max(0.0));
/// assert!((ramp.height(0.75, 0.3) - 0.075).abs() < 1e-12);
/// assert_eq!(ramp.height(9.0, 0.0), 0.1, "the edge");
/// assert!((ramp.normal(0.6, 0.1).x + 0.1 / 1.01_f64.sqrt()).abs() < 1e-12);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct HeightField {
    /// Corner of smallest x and y \[m\].
    pub(super) origin: [f64; 2],
    /// Side of a cell \[m\].
    pub(super) spacing: f64,
    /// Number of heights along x and y.
    pub(super) count: [usize; 2],
    heights: Vec<f64>,
    /// Number of blocks along x and y.
    blocks: [i64; 2],
    tops: Vec<f64>,
    pub(super) low: f64,
    pub(super) high: f64,
}

/// A triangle of a height field near a query point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearTriangle {
    /// Index of the triangle in the field.
    pub index: u32,
    /// Point of the triangle nearest to the query point \[m\].
    pub nearest: Point3<f64>,
    /// Upward unit normal of the triangle.
    pub normal: Vector3<f64>,
    /// Cell along x and y, and half of the cell: 0 at the end of x, 1 at the end of y.
    place: ([i64; 2], usize),
}

/// A cell: the height of its first corner, and the slopes of both triangles.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    pub(super) height: f64,
    /// Slopes along x and y of the triangle at the end of x, then of the triangle at the end of y.
    pub(super) slopes: [(f64, f64); 2],
    pub(super) top: f64,
}

impl HeightField {
    /// Creates a field of `count` heights along x and y, `spacing` \[m\] apart, starting at the corner
    /// `origin` \[m\].
    ///
    /// # Panics
    /// If there are fewer than two heights along an axis or more than 2^31 in total, the spacing is not
    /// positive, or a height is not finite.
    pub fn new(
        origin: [f64; 2],
        spacing: f64,
        count: [usize; 2],
        mut height: impl FnMut(f64, f64) -> f64,
    ) -> Self {
        assert!(count[0] > 1 && count[1] > 1 && count[0] * count[1] < 1 << 31, "{count:?} heights");
        assert!(spacing > 0.0 && spacing.is_finite(), "a spacing of {spacing}");
        let place = |index: usize, axis: usize| origin[axis] + spacing * index as f64;
        let heights: Vec<f64> = (0..count[0] * count[1])
            .map(|index| height(place(index / count[1], 0), place(index % count[1], 1)))
            .collect();
        assert!(heights.iter().all(|height| height.is_finite()), "heights must be finite");
        let low = heights.iter().copied().fold(f64::INFINITY, f64::min);
        let high = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let blocks = count.map(|count| (count as i64 - 2) / BLOCK + 1);
        let mut field = Self { origin, spacing, count, heights, blocks, tops: Vec::new(), low, high };
        field.tops = (0..blocks[0] * blocks[1])
            .map(|index| {
                let (i, j) = (index / blocks[1] * BLOCK, index % blocks[1] * BLOCK);
                let corners = (i..=i + BLOCK).flat_map(|i| (j..=j + BLOCK).map(move |j| (i, j)));
                corners.map(|(i, j)| field.corner_height(i, j)).fold(f64::NEG_INFINITY, f64::max)
            })
            .collect();
        field
    }

    /// Returns the lowest and the highest height \[m\].
    pub fn range(&self) -> (f64, f64) {
        (self.low, self.high)
    }

    /// Returns the corner with the smallest x and y \[m\], and the number of heights along x and y.
    pub fn grid(&self) -> ([f64; 2], [usize; 2]) {
        (self.origin, self.count)
    }

    /// Returns the distance between neighbouring heights \[m\].
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Returns the height of a grid corner; beyond the grid, of the nearest corner.
    #[inline(always)]
    pub(super) fn corner_height(&self, i: i64, j: i64) -> f64 {
        let i = i.clamp(0, self.count[0] as i64 - 1) as usize;
        let j = j.clamp(0, self.count[1] as i64 - 1) as usize;
        self.heights[i * self.count[1] + j]
    }

    /// Returns the highest point of a block or, beyond the grid, of the nearest block: nothing there is
    /// higher than at the edge.
    #[inline(always)]
    pub(super) fn top(&self, i: i64, j: i64) -> f64 {
        let (i, j) = (i.clamp(0, self.blocks[0] - 1), j.clamp(0, self.blocks[1] - 1));
        self.tops[(i * self.blocks[1] + j) as usize]
    }

    #[inline(always)]
    pub(super) fn cell(&self, i: i64, j: i64) -> Cell {
        let (a, b) = (self.corner_height(i, j), self.corner_height(i + 1, j));
        let (c, d) = (self.corner_height(i, j + 1), self.corner_height(i + 1, j + 1));
        Cell { height: a, slopes: [(b - a, d - b), (d - c, c - a)], top: a.max(b).max(c.max(d)) }
    }

    /// Returns a position in the grid, in cells from its corner.
    #[inline(always)]
    pub(super) fn in_cells(&self, x: f64, y: f64) -> (f64, f64) {
        ((x - self.origin[0]) / self.spacing, (y - self.origin[1]) / self.spacing)
    }

    /// Returns the cell at a position in the world, its triangle there (0 or 1), and the position in the
    /// cell.
    fn triangle(&self, x: f64, y: f64) -> (Cell, usize, (f64, f64)) {
        let (x, y) = self.in_cells(x, y);
        let (i, j) = (x.floor(), y.floor());
        let (u, v) = (x - i, y - j);
        (self.cell(i as i64, j as i64), usize::from(v > u), (u, v))
    }

    /// Returns the height of the surface at a position \[m\].
    pub fn height(&self, x: f64, y: f64) -> f64 {
        let (cell, triangle, (u, v)) = self.triangle(x, y);
        let (along_x, along_y) = cell.slopes[triangle];
        cell.height + along_x * u + along_y * v
    }

    /// Returns the upward unit normal of the surface at a position.
    pub fn normal(&self, x: f64, y: f64) -> Vector3<f64> {
        let (cell, triangle, _) = self.triangle(x, y);
        self.upward(cell.slopes[triangle]).into()
    }

    #[inline(always)]
    pub(super) fn upward(&self, (along_x, along_y): (f64, f64)) -> V3 {
        let normal = V3::new(-along_x, -along_y, self.spacing);
        normal * (1.0 / normal.dot(normal).sqrt())
    }

    /// Returns an upper bound on the height within `reach` \[m\] of a position. Distances are measured
    /// separately along x and y.
    pub fn highest_near(&self, x: f64, y: f64, reach: f64) -> f64 {
        let block = self.spacing * BLOCK as f64;
        let index = |place: f64, axis: usize| ((place - self.origin[axis]) / block).floor() as i64;
        let inside = |index: i64, axis: usize| index.clamp(0, self.blocks[axis] - 1);
        let mut highest = f64::NEG_INFINITY;
        for i in inside(index(x - reach, 0), 0)..=inside(index(x + reach, 0), 0) {
            for j in inside(index(y - reach, 1), 1)..=inside(index(y + reach, 1), 1) {
                highest = highest.max(self.top(i, j));
            }
        }
        highest
    }

    /// Calls `visit` with every triangle that has a point within `reach` \[m\] of `point`.
    pub fn visit_near(&self, point: &Point3<f64>, reach: f64, visit: &mut dyn FnMut(NearTriangle)) {
        let (x, y) = self.in_cells(point.x, point.y);
        let wide = reach / self.spacing;
        let p: V3 = point.coords.into();
        for i in (x - wide).floor() as i64..=(x + wide).floor() as i64 {
            for j in (y - wide).floor() as i64..=(y + wide).floor() as i64 {
                let cell = self.cell(i, j);
                if cell.top < point.z - reach {
                    continue;
                }
                let (first, last) = (self.corner(i, j), self.corner(i + 1, j + 1));
                let others = [self.corner(i + 1, j), self.corner(i, j + 1)];
                for (half, other) in others.into_iter().enumerate() {
                    let nearest = nearest_on_triangle(p, [first, other, last]);
                    let out = p - nearest;
                    if out.dot(out) <= reach * reach {
                        // wraps far beyond the grid, where equal numbers are coincidental
                        let number = i.wrapping_mul(1 << 15).wrapping_add(j).wrapping_mul(2) + half as i64;
                        visit(NearTriangle {
                            index: number as u32,
                            nearest: Point3::from(Vector3::from(nearest)),
                            normal: self.upward(cell.slopes[half]).into(),
                            place: ([i, j], half),
                        });
                    }
                }
            }
        }
    }

    /// Returns a corner of the grid.
    #[inline(always)]
    fn corner(&self, i: i64, j: i64) -> V3 {
        V3::new(
            self.origin[0] + self.spacing * i as f64,
            self.origin[1] + self.spacing * j as f64,
            self.corner_height(i, j),
        )
    }

    /// Returns `true` if a point is within `reach` \[m\] of a triangle.
    pub fn is_near(&self, triangle: &NearTriangle, point: &Point3<f64>, reach: f64) -> bool {
        let ([i, j], half) = triangle.place;
        let (x, y) = self.in_cells(point.x, point.y);
        let (wide, u, v) = (reach / self.spacing + 1e-9, x - i as f64, y - j as f64);
        if u.min(v) < -wide || u.max(v) > 1.0 + wide {
            return false;
        }
        let other = if half == 0 { self.corner(i + 1, j) } else { self.corner(i, j + 1) };
        let p: V3 = point.coords.into();
        let out = p - nearest_on_triangle(p, [self.corner(i, j), other, self.corner(i + 1, j + 1)]);
        out.dot(out) <= reach * reach
    }

    /// Calls `visit` with the number and the position of every peak within `reach` \[m\] of a position,
    /// separately along x and y. A peak is a grid corner that rises above the line between its two neighbours
    /// along x or y. A flat body touches peaks before other points.
    pub fn visit_peaks(&self, x: f64, y: f64, reach: f64, visit: &mut dyn FnMut(u32, Point3<f64>)) {
        let (u, v) = self.in_cells(x, y);
        let wide = reach / self.spacing;
        let least = 1e-6 * self.spacing;
        for i in (u - wide).ceil() as i64..=(u + wide).floor() as i64 {
            for j in (v - wide).ceil() as i64..=(v + wide).floor() as i64 {
                let height = self.corner_height(i, j);
                let above = |a: f64, b: f64| height - 0.5 * (a + b) > least;
                let beside = |a: i64, by: i64| a.saturating_add(by);
                let along = above(self.corner_height(beside(i, -1), j), self.corner_height(beside(i, 1), j));
                if along || above(self.corner_height(i, beside(j, -1)), self.corner_height(i, beside(j, 1))) {
                    let (x, y) =
                        (self.origin[0] + self.spacing * i as f64, self.origin[1] + self.spacing * j as f64);
                    visit(i.wrapping_mul(1 << 15).wrapping_add(j) as u32, Point3::new(x, y, height));
                }
            }
        }
    }
}

/// Sine of the angle between two triangles below which they count as coplanar.
const FLAT: f64 = 1e-3;

/// Steps from a corner along the three edges that start there.
const EDGES: [[i64; 2]; 3] = [[1, 0], [0, 1], [1, 1]];

impl HeightField {
    /// Calls `visit` with every ridge (convex edge) within `reach` \[m\] of a position, separately along x
    /// and y. The edges of a body touch ridges before other edges. The arguments of `visit` are the ridge's
    /// unique number below 2^32, its two ends, and the normals of the triangles on its two sides.
    pub fn visit_ridges(
        &self,
        x: f64,
        y: f64,
        reach: f64,
        visit: &mut dyn FnMut(u32, [Point3<f64>; 2], [Vector3<f64>; 2]),
    ) {
        let (u, v) = self.in_cells(x, y);
        let wide = reach / self.spacing;
        // Edges that start outside the reach may end within it.
        for i in (u - wide).floor() as i64..=(u + wide).floor() as i64 {
            for j in (v - wide).floor() as i64..=(v + wide).floor() as i64 {
                for (side, [along_x, along_y]) in EDGES.into_iter().enumerate() {
                    // the triangles on both sides of the edge, as cells and their halves
                    let [one, other] = match side {
                        0 => [([i, j], 0), ([i, j.saturating_sub(1)], 1)],
                        1 => [([i, j], 1), ([i.saturating_sub(1), j], 0)],
                        _ => [([i, j], 0), ([i, j], 1)],
                    };
                    let [one, other] =
                        [one, other].map(|([i, j], half): ([i64; 2], usize)| self.cell(i, j).slopes[half]);
                    // decrease of the slope across the edge
                    let bend = match side {
                        0 => other.1 - one.1,
                        1 => other.0 - one.0,
                        _ => (one.1 - one.0) - (other.1 - other.0),
                    };
                    if bend <= FLAT * self.spacing {
                        continue;
                    }
                    let ends = [self.corner(i, j), self.corner(i + along_x, j + along_y)];
                    let ends = ends.map(|end| Point3::from(Vector3::from(end)));
                    let normals = [one, other].map(|slopes| Vector3::from(self.upward(slopes)));
                    let corner = i.wrapping_mul(1 << 15).wrapping_add(j) as u32;
                    visit(corner << 2 | side as u32, ends, normals);
                }
            }
        }
    }
}
