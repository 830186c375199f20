//! Wavefront OBJ files: corners and faces; other elements do not affect the shape.

use nalgebra::Vector3;

use super::{Fault, MeshProblem, TriangleMesh, ears, number};

pub(super) fn parse(text: &str) -> Result<TriangleMesh, Fault> {
    let mut mesh = TriangleMesh::default();
    for (index, content) in text.lines().enumerate() {
        let line = index as u32 + 1;
        let at = |problem| (line, problem);
        let mut words = content.split_whitespace();
        match words.next() {
            Some("v") => {
                let mut point = Vector3::zeros();
                for x in point.iter_mut() {
                    *x = number(words.next().unwrap_or("")).map_err(at)?;
                }
                mesh.points.push(point);
            }
            Some("f") => {
                let corners: Vec<u32> = words
                    .map(|word| corner(word, mesh.points.len()))
                    .collect::<Result<_, _>>()
                    .map_err(at)?;
                if corners.len() < 3 {
                    let message = format!("a face has {} corners", corners.len());
                    return Err(at(MeshProblem::Malformed(message)));
                }
                ears::triangulate(&mesh.points, &corners, &mut mesh.triangles);
            }
            _ => {}
        }
    }
    Ok(mesh)
}

/// Index of a corner from `7`, `7/1`, `7//2` or `7/1/2`: counted from 1, or from the end if negative.
fn corner(word: &str, count: usize) -> Result<u32, MeshProblem> {
    let first = word.split('/').next().unwrap_or("");
    let index: i64 = first.parse().map_err(|_| MeshProblem::Number(word.to_owned()))?;
    let index = if index < 0 { count as i64 + index } else { index - 1 };
    match usize::try_from(index) {
        Ok(found) if found < count => Ok(found as u32),
        _ => Err(MeshProblem::Index { index, count }),
    }
}
