//! The layers of a terrain.

use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::error::TerrainError;
use super::expression::Expression;
use super::image::Picture;

/// A layer of a terrain.
///
/// `direction` is an angle from x towards y (rad), default 0. `from` is the distance from the origin along
/// `direction` at which the layer starts (m), default 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum TerrainLayer {
    /// A height given by an equation.
    Equation {
        /// Height (m) as an expression of `x` and `y` (m): numbers, `+ - * / ^`, brackets, `pi`, and sin,
        /// cos, tan, exp, log, sqrt, abs, floor, min, max.
        height: String,
    },
    /// An image whose grey values are heights: a greyscale PNG file of 8 or 16 bits.
    ///
    /// Seen from above, x points to the right in the image and y up. The outermost pixels are on the edges of
    /// `size`. Heights are interpolated between pixels. Beyond the image, the height continues as at the
    /// nearest edge.
    Image {
        /// Path of the file, relative to the graph's folder.
        #[schemars(extend("format" = "path"))]
        file: String,
        /// Heights of a black and of a white pixel (m).
        height: [f64; 2],
        /// Length along x and y covered by the image (m). Default: the terrain's size.
        #[serde(default)]
        size: Option<[f64; 2]>,
        /// Centre along x and y (m). Default: the terrain's centre.
        #[serde(default)]
        centre: Option<[f64; 2]>,
    },
    /// A fractal surface by the diamond-square algorithm.
    DiamondSquare {
        /// Maximum height above or below zero (m).
        height: f64,
        /// Ratio of the random heights at each level to the random heights at the next coarser level: 0
        /// (smooth) to 1 (rough). Default 0.5.
        #[serde(default = "half")]
        roughness: f64,
    },
    /// A slope that starts at a line across `direction`.
    Slope {
        /// Angle of the slope (rad); negative for a descent.
        angle: f64,
        /// Direction: angle from x towards y (rad). Default 0.
        #[serde(default)]
        direction: f64,
        /// Distance from the origin along `direction` at which the layer starts (m). Default 0.
        #[serde(default)]
        from: f64,
        /// Horizontal length after which the ground is level again (m). Default: unlimited.
        #[serde(default)]
        length: Option<f64>,
    },
    /// A flight of steps.
    Steps {
        /// Height of a step (m); negative for a descent.
        rise: f64,
        /// Length of a step (m).
        run: f64,
        /// Number of steps.
        count: u32,
        /// Direction: angle from x towards y (rad). Default 0.
        #[serde(default)]
        direction: f64,
        /// Distance from the origin along `direction` at which the layer starts (m). Default 0.
        #[serde(default)]
        from: f64,
    },
    /// Round stones at random positions.
    Stones {
        /// Height of the highest stone (m); the lowest is half as high.
        height: f64,
        /// Diameter of the largest stone (m); the smallest is half as wide.
        size: f64,
        /// Number of stones per square metre.
        per_square_metre: f64,
    },
    /// Gaps across the direction of travel.
    Gaps {
        /// Width of a gap (m).
        width: f64,
        /// Distance between the starts of consecutive gaps (m).
        every: f64,
        /// Depth (m).
        depth: f64,
        /// Direction: angle from x towards y (rad). Default 0.
        #[serde(default)]
        direction: f64,
        /// Distance from the origin along `direction` at which the layer starts (m). Default 0.
        #[serde(default)]
        from: f64,
    },
}

fn half() -> f64 {
    0.5
}

/// Corner, spacing and number of heights of a grid.
type Grid = ([f64; 2], f64, [usize; 2]);

impl TerrainLayer {
    /// Adds the heights of the layer; `key` names the layer in errors.
    pub(super) fn add(
        &self,
        key: &str,
        seed: u64,
        grid: Grid,
        heights: &mut [f64],
    ) -> Result<(), TerrainError> {
        let (corner, spacing, count) = grid;
        let check = |name: &str, value: f64, good: bool, expected: &'static str| {
            let at = || format!("{key}.{name}");
            if good && value.is_finite() { Ok(()) } else { Err(TerrainError::value(at(), value, expected)) }
        };
        let finite = |name: &str, value: f64| check(name, value, true, "a finite number");
        let positive = |name: &str, value: f64| check(name, value, value > 0.0, "a positive number");
        let mut by_place = |height: &mut dyn FnMut(f64, f64) -> f64| {
            for (index, sum) in heights.iter_mut().enumerate() {
                let x = corner[0] + spacing * (index / count[1]) as f64;
                let y = corner[1] + spacing * (index % count[1]) as f64;
                *sum += height(x, y);
            }
        };
        let along = |direction: f64, from: f64| {
            let (sin, cos) = direction.sin_cos();
            move |x: f64, y: f64| x * cos + y * sin - from
        };
        match *self {
            Self::Equation { height: ref text } => {
                let expression = Expression::parse(text).map_err(|problem| TerrainError::Equation {
                    key: format!("{key}.equation.height"),
                    text: text.clone(),
                    problem,
                })?;
                by_place(&mut |x, y| expression.value(x, y));
            }
            Self::Image { ref file, height: [black, white], size, centre } => {
                finite("image.height", black)?;
                finite("image.height", white)?;
                let whole = count.map(|count| spacing * (count - 1) as f64);
                let size = size.unwrap_or(whole);
                let middle = [0, 1].map(|axis| corner[axis] + 0.5 * whole[axis]);
                let centre = centre.unwrap_or(middle);
                for length in size {
                    positive("image.size", length)?;
                }
                for place in centre {
                    finite("image.centre", place)?;
                }
                let picture = Picture::read(Path::new(file)).map_err(|problem| TerrainError::Picture {
                    key: format!("{key}.image.file"),
                    file: file.clone(),
                    problem,
                })?;
                by_place(&mut |x, y| {
                    let (right, up) = ((x - centre[0]) / size[0] + 0.5, (y - centre[1]) / size[1] + 0.5);
                    black + (white - black) * picture.grey_at(right, 1.0 - up)
                });
            }
            Self::Slope { angle, direction, from, length } => {
                check("slope.angle", angle, angle.abs() < 1.5, "an angle between -1.5 and 1.5 rad")?;
                finite("slope.direction", direction)?;
                finite("slope.from", from)?;
                let length = length.unwrap_or(f64::MAX);
                positive("slope.length", length)?;
                let (rise, way) = (angle.tan(), along(direction, from));
                by_place(&mut |x, y| rise * way(x, y).clamp(0.0, length));
            }
            Self::Steps { rise, run, count, direction, from } => {
                finite("steps.rise", rise)?;
                positive("steps.run", run)?;
                finite("steps.direction", direction)?;
                finite("steps.from", from)?;
                let way = along(direction, from);
                by_place(&mut |x, y| rise * ((way(x, y) / run).floor() + 1.0).clamp(0.0, f64::from(count)));
            }
            Self::Gaps { width, every, depth, direction, from } => {
                positive("gaps.width", width)?;
                check("gaps.every", every, every > width, "a length above `width`")?;
                positive("gaps.depth", depth)?;
                finite("gaps.direction", direction)?;
                finite("gaps.from", from)?;
                let way = along(direction, from);
                by_place(&mut |x, y| {
                    let way = way(x, y);
                    if way >= 0.0 && way.rem_euclid(every) < width { -depth } else { 0.0 }
                });
            }
            Self::DiamondSquare { height, roughness } => {
                finite("diamond_square.height", height)?;
                let share = (0.0..=1.0).contains(&roughness);
                check("diamond_square.roughness", roughness, share, "a number from 0 to 1")?;
                let (side, surface) = diamond_square(count, roughness, seed);
                let highest = surface.iter().fold(f64::MIN_POSITIVE, |most, height| most.max(height.abs()));
                for (index, sum) in heights.iter_mut().enumerate() {
                    *sum += height / highest * surface[index / count[1] * side + index % count[1]];
                }
            }
            Self::Stones { height, size, per_square_metre } => {
                finite("stones.height", height)?;
                positive("stones.size", size)?;
                let many = (0.0..=1e5).contains(&per_square_metre);
                check("stones.per_square_metre", per_square_metre, many, "a number from 0 to 1e5")?;
                let few = heights_of_stones(grid, size, per_square_metre) <= MOST_OF_STONES;
                let expected = "fewer or smaller stones, covering at most ten million heights in total";
                check("stones.per_square_metre", per_square_metre, few, expected)?;
                stones(grid, (height, size, per_square_metre), seed, heights);
            }
        }
        Ok(())
    }
}

/// Maximum number of heights covered by stones, counting overlaps, which bounds the generation time.
const MOST_OF_STONES: f64 = 1e7;

/// Maximum number of heights covered by the stones of a layer, counting overlaps.
fn heights_of_stones((_, spacing, count): Grid, size: f64, per_square_metre: f64) -> f64 {
    let stones: f64 =
        count.iter().map(|count| spacing * (count - 1) as f64).product::<f64>() * per_square_metre;
    let each: f64 = count.iter().map(|count| (size / spacing + 3.0).min(*count as f64)).product();
    stones * each
}

/// Adds paraboloid caps at random positions; where caps overlap, the higher one applies.
fn stones(
    (corner, spacing, count): Grid,
    (height, size, per_square_metre): (f64, f64, f64),
    seed: u64,
    heights: &mut [f64],
) {
    let length = count.map(|count| spacing * (count - 1) as f64);
    let stones = (per_square_metre * length[0] * length[1]).round() as u64;
    let mut layer = vec![0.0_f64; heights.len()];
    for stone in 0..stones {
        let draw = |number: u64| uniform(seed, 5 * stone + number);
        let centre = [draw(0) * length[0], draw(1) * length[1]];
        let (radius, top) = (0.25 * size * (1.0 + draw(2)), 0.5 * height * (1.0 + draw(3)));
        let index = |axis: usize, place: f64| ((place / spacing).max(0.0) as usize).min(count[axis] - 1);
        for i in index(0, centre[0] - radius)..=index(0, centre[0] + radius + spacing) {
            for j in index(1, centre[1] - radius)..=index(1, centre[1] + radius + spacing) {
                let (dx, dy) = (spacing * i as f64 - centre[0], spacing * j as f64 - centre[1]);
                let cap = top * (1.0 - (dx * dx + dy * dy) / (radius * radius));
                let place = &mut layer[i * count[1] + j];
                if cap / top > *place / top && cap / top > 0.0 {
                    *place = cap;
                }
            }
        }
    }
    debug_assert!(corner.iter().all(|corner| corner.is_finite()));
    heights.iter_mut().zip(&layer).for_each(|(sum, stone)| *sum += stone);
}

/// Returns a square of at least `count` heights, and its side.
fn diamond_square(count: [usize; 2], roughness: f64, seed: u64) -> (usize, Vec<f64>) {
    let cells = (count[0].max(count[1]) - 1).next_power_of_two();
    let side = cells + 1;
    let mut surface = vec![0.0; side * side];
    let random = |i: usize, j: usize| 2.0 * uniform(seed, (i * side + j) as u64) - 1.0;
    for (i, j) in [(0, 0), (0, cells), (cells, 0), (cells, cells)] {
        surface[i * side + j] = random(i, j);
    }
    let (mut step, mut scale) = (cells, roughness);
    while step > 1 {
        let half = step / 2;
        // centres of squares, then midpoints of their sides
        for i in (half..side).step_by(step) {
            for j in (half..side).step_by(step) {
                let corner = |a: usize, b: usize| surface[a * side + b];
                let sum = corner(i - half, j - half)
                    + corner(i - half, j + half)
                    + corner(i + half, j - half)
                    + corner(i + half, j + half);
                surface[i * side + j] = 0.25 * sum + scale * random(i, j);
            }
        }
        for i in (0..side).step_by(half) {
            let first = if (i / half).is_multiple_of(2) { half } else { 0 };
            for j in (first..side).step_by(step) {
                let (mut sum, mut corners) = (0.0, 0.0);
                let around = [
                    (i.checked_sub(half), Some(j)),
                    (Some(i + half), Some(j)),
                    (Some(i), j.checked_sub(half)),
                    (Some(i), Some(j + half)),
                ];
                for (a, b) in around {
                    let (Some(a), Some(b)) = (a, b) else { continue };
                    if a < side && b < side {
                        sum += surface[a * side + b];
                        corners += 1.0;
                    }
                }
                surface[i * side + j] = sum / corners + scale * random(i, j);
            }
        }
        step = half;
        scale *= roughness;
    }
    (side, surface)
}

/// Returns the pseudo-random number from 0 to 1 at index `number` of a seed's sequence.
fn uniform(seed: u64, number: u64) -> f64 {
    (mixed(seed.wrapping_add(mixed(number))) >> 11) as f64 / (1_u64 << 53) as f64
}

/// Mixes all bits of a number: SplitMix64 (Steele, Lea, Flood 2014).
pub(super) fn mixed(number: u64) -> u64 {
    let mut z = number.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
