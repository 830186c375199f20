//! Wavefront OBJ files: corners and faces; other elements do not affect the shape.

use nalgebra::Vector3;

use super::ears;
use super::error::{Fault, MeshProblem, number};
use super::triangle_mesh::TriangleMesh;

pub(super) fn parse(text: &str) -> Result<TriangleMesh, Fault> {
    let mut mesh = TriangleMesh::default();
    // A byte-order mark would hide the first corner and thereby shift all faces.
    let mut lines = text.trim_start_matches('\u{feff}').lines().enumerate();
    while let Some((index, content)) = lines.next() {
        let line = index as u32 + 1;
        let at = |problem| (line, problem);
        let without_comment = |content: &str| content.split('#').next().unwrap_or("").trim_end().to_owned();
        let mut content = without_comment(content);
        while content.ends_with('\\') {
            content.pop();
            let Some((_, next)) = lines.next() else { break };
            content = format!("{content} {}", without_comment(next));
        }
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

/// Parses the index of a corner from `7`, `7/1`, `7//2` or `7/1/2`: counted from 1, or from the end if
/// negative.
fn corner(word: &str, count: usize) -> Result<u32, MeshProblem> {
    let first = word.split('/').next().unwrap_or("");
    let index: i64 = first.parse().map_err(|_| MeshProblem::Number(word.to_owned()))?;
    let from_zero = if index < 0 { index.checked_add(count as i64) } else { index.checked_sub(1) };
    match from_zero.map(usize::try_from) {
        Some(Ok(found)) if found < count => Ok(found as u32),
        _ => Err(MeshProblem::Index { index, first: 1, count }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_comments_and_continued_lines_are_read() {
        let plain = parse("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n").unwrap();
        for text in [
            "\u{feff}v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n",
            "v 0 0 0 # origin\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4 # top\n",
            "v 0 0 \\\n0\nv 1 0 0\r\nv 1 1 0\nv 0 1 0\nf 1 2 \\\r\n 3 \\\n4\n",
        ] {
            assert_eq!(parse(text).unwrap(), plain, "{text}");
        }
        assert_eq!(parse("v 0 0 \\\n 0\nf 1 1 9\n").unwrap_err().0, 3);
    }
}
