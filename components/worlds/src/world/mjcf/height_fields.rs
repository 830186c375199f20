//! `<hfield>`: grids of heights.

use std::collections::HashMap;
use std::path::Path;

use motorium_robots::mjcf::{Attributes, Compiler, Element, HFIELD, MAIN, MjcfError, MjcfProblem, named};
use motorium_robots::{TriangleMesh, read_bounded};
use nalgebra::Vector3;
use roxmltree::Node;

use crate::terrain::Picture;

/// Maximum number of heights of a field.
const MOST: usize = 250_000;

/// Reads the solids below the height fields of a file, by name.
///
/// As in MuJoCo, heights are scaled to range from 0 to the third number of `size`, and cells are split along
/// the same diagonal.
pub(super) fn read<'a, 'i>(
    root: Node<'a, 'i>,
    attributes: &Attributes<'a, 'i>,
    compiler: &Compiler,
    file: Option<&Path>,
) -> Result<HashMap<String, TriangleMesh>, MjcfError> {
    let sections = root.children().filter(|section| section.has_tag_name("asset"));
    let fields = sections.flat_map(|section| section.children()).filter(|node| node.has_tag_name("hfield"));
    let mut solids = HashMap::new();
    for node in fields {
        let asset = attributes.element(node, MAIN, &HFIELD)?;
        let size = asset.numbers::<4>("size")?.ok_or_else(|| asset.missing("size"))?;
        if size.iter().any(|number| *number <= 0.0) {
            return Err(number(&asset, "size", "4 numbers above 0"));
        }
        let (grid, heights) = heights(&asset, compiler, file)?;
        let path = asset.get("file").map(Path::new);
        let stem = path.and_then(Path::file_stem).and_then(|stem| stem.to_str());
        let name = node.attribute("name").or(stem).ok_or_else(|| asset.missing("name"))?.to_owned();
        if solids.insert(name.clone(), solid(grid, &heights, size)).is_some() {
            return Err(asset.error(MjcfProblem::Duplicate { what: "hfield", name }));
        }
    }
    Ok(solids)
}

fn number(asset: &Element<'_, '_, '_>, attribute: &str, expected: &str) -> MjcfError {
    let value = asset.get(attribute).unwrap_or_default().chars().take(40).collect();
    let (attribute, expected) = (attribute.to_owned(), expected.to_owned());
    asset.error(MjcfProblem::Number { element: named(asset.node), attribute, value, expected })
}

/// Returns the number of rows and columns, and the heights from 0 to 1, starting with the row of smallest y.
fn heights(
    asset: &Element<'_, '_, '_>,
    compiler: &Compiler,
    file: Option<&Path>,
) -> Result<([usize; 2], Vec<f64>), MjcfError> {
    let (grid, mut heights) = match asset.get("file").filter(|name| !name.is_empty()) {
        Some(name) => {
            let folder = file.and_then(Path::parent).unwrap_or(Path::new(""));
            let mut within = Path::new(name);
            if compiler.strip_path {
                within = within.file_name().map_or(within, Path::new);
            }
            let path = folder.join(&compiler.mesh_folder).join(within);
            let fault = |problem: String| asset.fault(format!("file=\"{name}\" of <hfield>: {problem}"));
            of_file(&path).map_err(fault)?
        }
        None => {
            let count = |name: &'static str| {
                let value = asset.number(name, 0.0)?;
                let good = value.fract() == 0.0 && (2.0..=MOST as f64).contains(&value);
                if good { Ok(value as usize) } else { Err(number(asset, name, "a whole number from 2 up")) }
            };
            let [rows, columns] = [count("nrow")?, count("ncol")?];
            let all = within_most(asset, [rows, columns])?;
            let heights = match asset.get("elevation") {
                None => vec![0.0; all],
                Some(text) => asset
                    .attributes
                    .parse(asset.node, "elevation", text, all..=all)
                    .map_err(|_| number(asset, "elevation", &format!("{all} numbers, nrow times ncol")))?,
            };
            // Written like a map: the row of the largest y is first.
            ([rows, columns], heights.chunks(columns).rev().flatten().copied().collect())
        }
    };
    within_most(asset, grid)?;
    let (low, high) = heights.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), height| {
        (low.min(*height), high.max(*height))
    });
    let range = if high > low { high - low } else { 1.0 };
    heights.iter_mut().for_each(|height| *height = (*height - low) / range);
    Ok((grid, heights))
}

/// Checks the number of heights of a grid against the maximum.
fn within_most(asset: &Element<'_, '_, '_>, [rows, columns]: [usize; 2]) -> Result<usize, MjcfError> {
    rows.checked_mul(columns).filter(|all| *all <= MOST).ok_or_else(|| {
        asset.fault(format!(
            "a height field of {rows} x {columns} heights, expected at most {MOST}; use a `terrain` of the world for more"
        ))
    })
}

/// Reads a PNG file, whose top row has the largest y, or a binary file: two `i32`, rows and columns, and
/// `f32` heights from the smallest y.
fn of_file(path: &Path) -> Result<([usize; 2], Vec<f64>), String> {
    if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png")) {
        let picture = Picture::read(path)?;
        let [columns, rows] = picture.size();
        if columns < 2 || rows < 2 {
            return Err(format!("a picture of {columns} x {rows} pixels, expected at least 2 x 2"));
        }
        let heights = picture.grey().chunks(columns).rev().flatten().copied().collect();
        return Ok(([rows, columns], heights));
    }
    let bytes = read_bounded(path, (8 + 4 * MOST) as u64).map_err(|error| error.to_string())?;
    let mut words = bytes.chunks_exact(4).map(|word| [word[0], word[1], word[2], word[3]]);
    let mut count = || words.next().map(i32::from_le_bytes).and_then(|count| usize::try_from(count).ok());
    let (rows, columns) = (count().unwrap_or(0), count().unwrap_or(0));
    let heights: Vec<f64> = words.map(|word| f64::from(f32::from_le_bytes(word))).collect();
    let whole = rows >= 2 && columns >= 2 && rows.checked_mul(columns) == Some(heights.len());
    if !whole || bytes.len() % 4 != 0 || !heights.iter().all(|height| height.is_finite()) {
        return Err(
            "expected two 32-bit whole numbers, rows and columns from 2 up, and as many 32-bit heights"
                .to_owned(),
        );
    }
    Ok(([rows, columns], heights))
}

/// Returns the solid between the heights and the base below.
fn solid([rows, columns]: [usize; 2], heights: &[f64], [x, y, top, base]: [f64; 4]) -> TriangleMesh {
    let at = |row: usize, column: usize| (row * columns + column) as u32;
    let place = |row: usize, column: usize, z: f64| {
        let share = |index: usize, count: usize| 2.0 * index as f64 / (count - 1) as f64 - 1.0;
        Vector3::new(x * share(column, columns), y * share(row, rows), z)
    };
    let mut points: Vec<_> = (0..rows * columns)
        .map(|index| place(index / columns, index % columns, top * heights[index]))
        .collect();
    let mut triangles = Vec::with_capacity(2 * rows * columns);
    for row in 0..rows - 1 {
        for column in 0..columns - 1 {
            let (a, b) = (at(row, column), at(row, column + 1));
            let (c, d) = (at(row + 1, column), at(row + 1, column + 1));
            triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    // The rim, counter-clockwise as seen from above, with a point below each of its points.
    let rim: Vec<(usize, usize)> = (0..columns - 1)
        .map(|column| (0, column))
        .chain((0..rows - 1).map(|row| (row, columns - 1)))
        .chain((1..columns).rev().map(|column| (rows - 1, column)))
        .chain((1..rows).rev().map(|row| (row, 0)))
        .collect();
    let first = points.len() as u32;
    points.extend(rim.iter().map(|&(row, column)| place(row, column, -base)));
    let middle = points.len() as u32;
    points.push(Vector3::new(0.0, 0.0, -base));
    for (index, &(row, column)) in rim.iter().enumerate() {
        let next = (index + 1) % rim.len();
        let (above, beside) = (at(row, column), at(rim[next].0, rim[next].1));
        let (below, after) = (first + index as u32, first + next as u32);
        triangles.extend([[below, after, above], [after, beside, above], [after, below, middle]]);
    }
    TriangleMesh { points, triangles }
}
