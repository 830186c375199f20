//! Terrain as triangles.

use motorium_robots::TriangleMesh;
use motorium_worlds::HeightField;
use nalgebra::Vector3;

/// Approximate maximum number of points of a drawn terrain.
const TERRAIN_POINTS: f64 = 15_000.0;

/// Converts a terrain to triangles, at reduced resolution if it has very many heights.
pub fn terrain_mesh(field: &HeightField) -> TriangleMesh {
    let (corner, counts) = field.grid();
    let lengths = counts.map(|count| (count.max(2) - 1) as f64 * field.spacing());
    let step = field.spacing().max((lengths[0] * lengths[1] / TERRAIN_POINTS).sqrt());
    let many = lengths.map(|length| (length / step).round().max(1.0) as usize);
    let along = |axis: usize, at: usize| corner[axis] + lengths[axis] * at as f64 / many[axis] as f64;
    let points = (0..=many[1]).flat_map(|row| (0..=many[0]).map(move |column| (column, row)));
    let points = points.map(|(column, row)| {
        let (x, y) = (along(0, column), along(1, row));
        Vector3::new(x, y, field.height(x, y))
    });
    let point = |column: usize, row: usize| (row * (many[0] + 1) + column) as u32;
    let squares = (0..many[1]).flat_map(|row| (0..many[0]).map(move |column| (column, row)));
    let triangles = squares.flat_map(|(column, row)| {
        let [a, b] = [point(column, row), point(column + 1, row)];
        let [c, d] = [point(column, row + 1), point(column + 1, row + 1)];
        [[a, b, d], [a, d, c]]
    });
    TriangleMesh { points: points.collect(), triangles: triangles.collect() }
}
