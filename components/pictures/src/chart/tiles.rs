//! Paths in tiles.

use std::fmt::Write as _;

use super::theme::begin;
use crate::text::escape;

/// Paths in one tile: a known path, thick and grey, and a computed path, thin and coloured, each in x and y.
#[derive(Clone, Debug)]
pub struct Tile {
    /// Text below the paths.
    pub name: String,
    /// Known path, such as a demonstration.
    pub known: Vec<[f64; 2]>,
    /// Computed path.
    pub found: Vec<[f64; 2]>,
}

/// Draws tiles in rows of `columns` as SVG: the known path in grey, the computed path in blue.
pub fn tiles(title: &str, tiles: &[Tile], columns: usize) -> String {
    const SIDE: f64 = 130.0;
    let columns = columns.max(1);
    let rows = tiles.len().div_ceil(columns);
    let mut svg = begin(SIDE * columns as f64, 40.0 + (SIDE + 20.0) * rows as f64);
    let _ = writeln!(
        svg,
        "<text class=\"ink\" fill=\"#1f2328\" x=\"8\" y=\"24\" font-size=\"15\">{}</text>",
        escape(title)
    );
    for (k, tile) in tiles.iter().enumerate() {
        let (x0, y0) = (SIDE * (k % columns) as f64, 40.0 + (SIDE + 20.0) * (k / columns) as f64);
        let all = || tile.known.iter().chain(&tile.found);
        let range = |d: usize| {
            all().fold([f64::INFINITY, f64::NEG_INFINITY], |r, p| [r[0].min(p[d]), r[1].max(p[d])])
        };
        let (x, y) = (range(0), range(1));
        let scale = (SIDE - 24.0) / (x[1] - x[0]).max(y[1] - y[0]).max(1e-12);
        let place = |p: &[f64; 2]| {
            let px = x0 + 0.5 * SIDE + scale * (p[0] - 0.5 * (x[0] + x[1]));
            (px, y0 + 0.5 * SIDE - scale * (p[1] - 0.5 * (y[0] + y[1])))
        };
        for (path, style) in [
            (&tile.known, "class=\"old\" stroke=\"#c9d1d9\" stroke-width=\"4\""),
            (&tile.found, "class=\"c0\" stroke=\"#1f6feb\" stroke-width=\"1.8\""),
        ] {
            let mut line = String::new();
            for (i, point) in path.iter().enumerate() {
                let (px, py) = place(point);
                let _ = write!(line, "{}{px:.1} {py:.1}", if i == 0 { "M" } else { "L" });
            }
            if !line.is_empty() {
                let _ = writeln!(svg, "<path d=\"{line}\" fill=\"none\" stroke-linecap=\"round\" {style}/>");
            }
        }
        let _ = writeln!(
            svg,
            "<text class=\"ink\" fill=\"#1f2328\" x=\"{}\" y=\"{}\" text-anchor=\"middle\" font-size=\"12\">{}</text>",
            x0 + 0.5 * SIDE,
            y0 + SIDE + 10.0,
            escape(&tile.name)
        );
    }
    svg + "</svg>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_draw_both_paths_inside_the_picture() {
        let tile = Tile {
            name: "a".into(),
            known: vec![[0.0, 0.0], [1.0, 2.0]],
            found: vec![[0.0, 0.1], [1.0, 1.9]],
        };
        let svg = tiles("letters", &[tile.clone(), tile], 2);
        let document = roxmltree::Document::parse(&svg).unwrap();
        assert_eq!(document.descendants().filter(|node| node.has_tag_name("path")).count(), 4);
    }
}
