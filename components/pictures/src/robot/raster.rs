//! Raster pictures: a depth buffer, light from one direction with shadows, and a ground with a grid.

use nalgebra::{Point3, Vector3};

use super::camera::Camera;
use super::scene::Scene;
use super::solid::Solid;

/// Samples of a dot along each side.
const SAMPLES: usize = 2;
/// Largest picture in millions of dots.
const LARGEST: f64 = 4.0;
/// Dots along each side of the map of shadows.
const MAP: usize = 1200;
/// Direction to the light.
const LIGHT: Vector3<f64> = Vector3::new(0.3, -0.45, 0.84);
/// Colour around the ground.
const BACKGROUND: [f64; 3] = [0.945, 0.955, 0.965];
/// Part of the brightness of the ground at a line of its grid.
const LINE: f64 = 0.9;

/// Checks that a picture of this size fits into memory.
///
/// # Errors
///
/// [`SizeError`] for more than 4 million pixels.
pub(super) fn check_size((width, height): (f64, f64)) -> Result<(), SizeError> {
    match 1e-6 * width * height <= LARGEST {
        true => Ok(()),
        false => Err(SizeError { width, height }),
    }
}

/// Error returned when a shaded picture is too large.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("the size is {width}x{height}, expected at most {LARGEST} million dots in a shaded picture")]
pub struct SizeError {
    /// Requested width in dots.
    pub width: f64,
    /// Requested height in dots.
    pub height: f64,
}

/// The ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Floor {
    /// Height \[m\].
    pub(super) height: f64,
    pub(super) colour: [f64; 3],
    /// Side of the squares \[m\].
    pub(super) side: f64,
    /// Colour of every second square; else the sides of the squares are lines.
    pub(super) checker: Option<[f64; 3]>,
    /// The point around which the ground is visible.
    pub(super) middle: Point3<f64>,
}

/// A triangle in the world.
struct Triangle {
    corners: [Point3<f64>; 3],
    normals: [Vector3<f64>; 3],
    colour: [f64; 3],
}

/// Paints the scene. Returns the rows of the picture as red, green and blue.
pub(super) fn paint(scene: &Scene, camera: &Camera, floor: Option<&Floor>) -> Vec<u8> {
    let triangles: Vec<Triangle> = scene.solids.iter().flat_map(triangles).collect();
    let shadows = Shadows::new(&triangles);
    let [width, height] = camera.dots();
    let [wide, high] = [width, height].map(|side| SAMPLES * side);
    let mut seen = vec![Seen { depth: f64::NEG_INFINITY, triangle: 0, shares: [0.0; 2] }; wide * high];
    for (index, triangle) in triangles.iter().enumerate() {
        let corners = triangle.corners.map(|corner| {
            let (x, y) = camera.project(&corner);
            [SAMPLES as f64 * x, SAMPLES as f64 * y, camera.eye.dot(&corner.coords)]
        });
        fill(corners, wide, high, |at, depth, shares| {
            if depth > seen[at].depth {
                seen[at] = Seen { depth, triangle: index as u32, shares: shares.map(|share| share as f32) };
            }
        });
    }
    let colour = |column: usize, row: usize| {
        let at = [column, row].map(|at| (at as f64 + 0.5) / SAMPLES as f64);
        let Seen { depth, triangle, shares } = seen[row * wide + column];
        if depth == f64::NEG_INFINITY {
            return floor.map_or(BACKGROUND, |floor| ground(floor, camera, at, &shadows));
        }
        let Triangle { corners, normals, colour } = &triangles[triangle as usize];
        let [of_b, of_c] = shares.map(f64::from);
        let mix = |[a, b, c]: [Vector3<f64>; 3]| a * (1.0 - of_b - of_c) + b * of_b + c * of_c;
        let normal = mix(*normals).try_normalize(0.0).unwrap_or(camera.eye);
        let point = Point3::from(mix(corners.map(|corner| corner.coords)));
        lit(colour, &normal, &camera.eye, shadows.light(&point, &normal))
    };
    let mut pixels = Vec::with_capacity(3 * width * height);
    for row in 0..height {
        for column in 0..width {
            let mut sum = [0.0; 3];
            for sample in 0..SAMPLES * SAMPLES {
                let (x, y) = (SAMPLES * column + sample % SAMPLES, SAMPLES * row + sample / SAMPLES);
                sum.iter_mut().zip(colour(x, y)).for_each(|(sum, channel)| *sum += channel.clamp(0.0, 1.0));
            }
            pixels.extend(sum.map(|sum| (255.0 * sum / (SAMPLES * SAMPLES) as f64).round() as u8));
        }
    }
    pixels
}

/// The visible point of a sample: the nearest triangle, and the shares of its second and third corner.
#[derive(Clone, Copy)]
struct Seen {
    depth: f64,
    triangle: u32,
    shares: [f32; 2],
}

/// Returns the triangles of a solid.
fn triangles(solid: &Solid) -> Vec<Triangle> {
    let (skin, pose) = (solid.skin(), &solid.pose);
    let of = |(corners, normals): (&[u32; 3], &[Vector3<f64>; 3])| Triangle {
        corners: corners.map(|corner| pose * Point3::from(skin.mesh.points[corner as usize])),
        normals: normals.map(|normal| pose * normal),
        colour: solid.colour,
    };
    skin.mesh.triangles.iter().zip(&skin.normals).map(of).collect()
}

/// Visits the samples whose centres are in a triangle of (right, down, depth): index, depth, and shares of
/// the second and the third corner.
fn fill([a, b, c]: [[f64; 3]; 3], width: usize, height: usize, mut visit: impl FnMut(usize, f64, [f64; 2])) {
    let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
    if area == 0.0 {
        return;
    }
    let range = |axis: usize, most: usize| {
        let low = a[axis].min(b[axis]).min(c[axis]);
        let high = a[axis].max(b[axis]).max(c[axis]);
        ((low - 0.5).ceil().max(0.0) as usize, ((high + 0.5).floor().clamp(0.0, most as f64)) as usize)
    };
    let ((left, right), (top, bottom)) = (range(0, width), range(1, height));
    for row in top..bottom {
        let y = row as f64 + 0.5;
        for column in left..right {
            let x = column as f64 + 0.5;
            let of_b = ((x - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (y - a[1])) / area;
            let of_c = ((b[0] - a[0]) * (y - a[1]) - (x - a[0]) * (b[1] - a[1])) / area;
            let of_a = 1.0 - of_b - of_c;
            if of_a >= 0.0 && of_b >= 0.0 && of_c >= 0.0 {
                let depth = of_a * a[2] + of_b * b[2] + of_c * c[2];
                visit(row * width + column, depth, [of_b, of_c]);
            }
        }
    }
}

/// Returns the colour of a lit surface. `light` is the part of the light that arrives at the surface. Light
/// from below counts less, and a mirrored light makes the surface glossy.
fn lit(colour: &[f64; 3], normal: &Vector3<f64>, eye: &Vector3<f64>, light: f64) -> [f64; 3] {
    let to_light = LIGHT.normalize();
    let sky = 0.36 + 0.12 * normal.z;
    let bright = sky + 0.1 * normal.dot(eye).max(0.0) + 0.56 * light * normal.dot(&to_light).max(0.0);
    let gloss = 0.2 * light * normal.dot(&(to_light + eye).normalize()).max(0.0).powi(36);
    colour.map(|channel| channel * bright + gloss)
}

/// Returns the colour of the ground at a point of the picture: squares and shadows, which fade away from the
/// middle of the ground.
fn ground(floor: &Floor, camera: &Camera, at: [f64; 2], shadows: &Shadows) -> [f64; 3] {
    let origin = camera.point(at[0], at[1]);
    let point = origin + camera.eye * ((floor.height - origin.z) / camera.eye.z);
    let from = point - floor.middle;
    let reach = 0.62 * camera.metres(camera.width.max(camera.height));
    let share = ((from.norm() / reach - 0.45) / 0.55).clamp(0.0, 1.0);
    let fade = share * share * (3.0 - 2.0 * share);
    let place = [point.x, point.y].map(|x| x / floor.side);
    let odd = (place[0].floor() + place[1].floor()).rem_euclid(2.0) > 0.5;
    let edge = place.map(|x| (x - x.round()).abs() * floor.side);
    let line = floor.checker.is_none() && edge[0].min(edge[1]) < 0.6 * camera.metres(1.0);
    let colour = floor.checker.filter(|_| odd).unwrap_or(floor.colour);
    let dark = if line { LINE } else { 1.0 };
    let bright = dark * (0.6 + 0.4 * shadows.light(&point, &Vector3::z()));
    let mut mixed = colour.map(|channel| channel * bright * 1.08);
    mixed.iter_mut().zip(BACKGROUND).for_each(|(channel, far)| *channel += fade * (far - *channel));
    mixed
}

/// Map of shadows: the distance of the nearest surface to the light, over the plane perpendicular to the
/// light.
struct Shadows {
    right: Vector3<f64>,
    up: Vector3<f64>,
    to_light: Vector3<f64>,
    corner: [f64; 2],
    /// Dots per metre.
    scale: f64,
    nearest: Vec<f64>,
}

impl Shadows {
    fn new(triangles: &[Triangle]) -> Self {
        let to_light = LIGHT.normalize();
        let right = to_light.cross(&Vector3::z()).normalize();
        let up = right.cross(&to_light);
        let across = |point: &Point3<f64>| [right.dot(&point.coords), up.dot(&point.coords)];
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for corner in triangles.iter().flat_map(|triangle| &triangle.corners) {
            for (axis, x) in across(corner).into_iter().enumerate() {
                (low[axis], high[axis]) = (low[axis].min(x), high[axis].max(x));
            }
        }
        let extent = (high[0] - low[0]).max(high[1] - low[1]).max(1e-3);
        // A margin of two dots.
        let scale = (MAP - 4) as f64 / extent;
        let corner = low.map(|low| low - 2.0 / scale);
        let mut nearest = vec![f64::NEG_INFINITY; MAP * MAP];
        for triangle in triangles {
            let corners = triangle.corners.map(|point| {
                let [x, y] = across(&point);
                [scale * (x - corner[0]), scale * (y - corner[1]), to_light.dot(&point.coords)]
            });
            fill(corners, MAP, MAP, |at, depth, _| nearest[at] = nearest[at].max(depth));
        }
        Self { right, up, to_light, corner, scale, nearest }
    }

    /// Returns the part of the light that arrives at a point of a surface, 0 to 1: the mean over nine
    /// neighbours.
    fn light(&self, point: &Point3<f64>, normal: &Vector3<f64>) -> f64 {
        // Off the surface by two dots, or it would shade itself.
        let point = point + normal * (2.5 / self.scale);
        let x = self.scale * (self.right.dot(&point.coords) - self.corner[0]);
        let y = self.scale * (self.up.dot(&point.coords) - self.corner[1]);
        let depth = self.to_light.dot(&point.coords);
        let mut free = 0.0;
        for step in 0..9 {
            let at = [x + f64::from(step % 3 - 1), y + f64::from(step / 3 - 1)];
            let inside = at.iter().all(|at| (0.0..MAP as f64).contains(at));
            let shaded = inside && self.nearest[at[1] as usize * MAP + at[0] as usize] > depth;
            free += if shaded { 0.0 } else { 1.0 };
        }
        free / 9.0
    }
}
