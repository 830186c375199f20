//! STL files, text and binary (Burns, "Automated Fabrication", 1993, section 6.5).

use std::collections::HashMap;

use nalgebra::Vector3;

use super::error::{Fault, MeshProblem, number};
use super::triangle_mesh::TriangleMesh;

const HEADER: usize = 84;
const FACET: usize = 50;
/// First word of a text file. Words of text files may be in upper case.
const SOLID: &[u8] = b"solid";

pub(super) fn parse(bytes: &[u8]) -> Result<TriangleMesh, Fault> {
    // Some binary files start with "solid" like text files; their length distinguishes them.
    let count =
        bytes.get(80..HEADER).map(|count| u32::from_le_bytes([count[0], count[1], count[2], count[3]]));
    let expected = count.map(|count| HEADER + FACET * count as usize);
    let start = bytes.trim_ascii_start().get(..SOLID.len());
    let text = start.is_some_and(|start| start.eq_ignore_ascii_case(SOLID));
    match expected {
        // The header states fewer triangles than the file contains: it was not updated, or belongs to another
        // file.
        Some(expected) if !text && expected + FACET <= bytes.len() => {
            let (found, promised) = ((bytes.len() - HEADER) / FACET, (expected - HEADER) / FACET);
            let message = format!("its header states {promised} triangles, but there is room for {found}");
            Err((0, MeshProblem::Malformed(message)))
        }
        Some(expected) if expected == bytes.len() || !text && expected < bytes.len() => {
            Ok(binary(bytes, expected))
        }
        _ if text => {
            let text = std::str::from_utf8(bytes).map_err(|_| (0, MeshProblem::NotText))?;
            ascii(text)
        }
        expected => {
            let expected = expected.unwrap_or(HEADER);
            Err((0, MeshProblem::Short { found: bytes.len(), expected }))
        }
    }
}

fn binary(bytes: &[u8], end: usize) -> TriangleMesh {
    let mut soup = Soup::default();
    for facet in bytes[HEADER..end].chunks_exact(FACET) {
        let float = |at: usize| f32::from_le_bytes([facet[at], facet[at + 1], facet[at + 2], facet[at + 3]]);
        soup.add([12, 24, 36].map(|at| [at, at + 4, at + 8].map(|at| f64::from(float(at)))));
    }
    soup.mesh
}

fn ascii(text: &str) -> Result<TriangleMesh, Fault> {
    let mut soup = Soup::default();
    let mut corners = Vec::with_capacity(3);
    let (mut open, mut last) = (false, 0);
    for (line, words) in
        text.lines().enumerate().map(|(line, text)| (line as u32 + 1, text.split_whitespace()))
    {
        let mut words = words;
        last = line;
        match words.next().map(str::to_ascii_lowercase).as_deref() {
            Some("vertex") => {
                let mut corner = [0.0; 3];
                for x in &mut corner {
                    *x = number(words.next().unwrap_or("")).map_err(|problem| (line, problem))?;
                }
                corners.push(corner);
            }
            Some("endloop") => {
                let Ok(triangle) = <[[f64; 3]; 3]>::try_from(&corners[..]) else {
                    let message = format!("a facet has {} corners instead of 3", corners.len());
                    return Err((line, MeshProblem::Malformed(message)));
                };
                soup.add(triangle);
                corners.clear();
            }
            Some("solid") => open = true,
            Some("endsolid") => open = false,
            Some("facet" | "outer" | "endfacet") | None => {}
            Some(word) => {
                return Err((
                    line,
                    MeshProblem::Malformed(format!("\"{word}\" is not valid in an STL file")),
                ));
            }
        }
    }
    if open || !corners.is_empty() {
        let message = "the file ends without `endsolid`: it was cut off".to_owned();
        return Err((last, MeshProblem::Malformed(message)));
    }
    Ok(soup.mesh)
}

/// Triangles whose bitwise equal corners are merged.
#[derive(Default)]
struct Soup {
    mesh: TriangleMesh,
    known: HashMap<[u64; 3], u32>,
}

impl Soup {
    fn add(&mut self, corners: [[f64; 3]; 3]) {
        let points = &mut self.mesh.points;
        let triangle = corners.map(|corner| {
            // adding zero makes both zeros equal
            *self.known.entry(corner.map(|x| (x + 0.0).to_bits())).or_insert_with(|| {
                points.push(Vector3::from(corner));
                points.len() as u32 - 1
            })
        });
        self.mesh.triangles.push(triangle);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_may_be_in_upper_case() {
        let lower = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1E0 0\nendloop\n\
                     endfacet\nendsolid a\n";
        let upper = parse(lower.to_uppercase().as_bytes()).unwrap();
        assert_eq!(upper, parse(lower.as_bytes()).unwrap());
        assert_eq!((upper.points.len(), upper.points[2].y), (3, 1.0));
    }

    #[test]
    fn truncated_text_is_rejected() {
        let facet =
            "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
        let whole = format!("solid part\n{facet}{facet}endsolid part\nsolid other\n{facet}endsolid\n");
        assert_eq!(parse(whole.as_bytes()).unwrap().triangles.len(), 3);
        let cut = |text: &str| parse(text.as_bytes()).unwrap_err();
        for text in [&whole[..whole.len() - 9], &whole[..whole.len() - 40], &whole[..30 + facet.len()]] {
            let (_, problem) = cut(text);
            assert!(problem.to_string().contains("cut off"), "{text}: {problem}");
        }
    }

    #[test]
    fn binary_file_with_excess_triangles_is_rejected() {
        let file = |promised: u32, triangles: usize, rest: usize| {
            let mut bytes = vec![0; 80];
            bytes.extend(promised.to_le_bytes());
            bytes.resize(HEADER + FACET * triangles + rest, 0);
            parse(&bytes)
        };
        assert_eq!(file(2, 2, 0).unwrap().triangles.len(), 2);
        assert_eq!(file(2, 2, 7).unwrap().triangles.len(), 2);
        for promised in [0, 1] {
            let (_, problem) = file(promised, 2, 0).unwrap_err();
            assert!(problem.to_string().contains("room for 2"), "{problem}");
        }
    }
}
