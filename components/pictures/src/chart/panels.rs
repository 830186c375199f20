//! Curves over time, a panel for each dimension, below each other.

use std::fmt::Write as _;

use super::axis::Axis;
use super::theme;

const WIDTH: f64 = 820.0;
const HEIGHT: f64 = 150.0;
const LEFT: f64 = 96.0;
const RIGHT: f64 = 16.0;
const GAP: f64 = 36.0;
const TOP: f64 = 34.0;
const BOTTOM: f64 = 22.0;

/// A few curves with one pair of axes.
#[derive(Debug, Clone)]
pub struct Panel {
    /// Name of the dimension, with its unit where it has one.
    title: String,
    curves: Vec<Curve>,
    /// Time, lower and upper edge.
    bands: Vec<Vec<(f64, f64, f64)>>,
}

#[derive(Debug, Clone)]
struct Curve {
    points: Vec<(f64, f64)>,
    is_reference: bool,
}

impl Panel {
    /// Creates a panel without curves; the title names the dimension, with its unit.
    pub fn new(title: &str) -> Self {
        Self { title: title.to_string(), curves: Vec::new(), bands: Vec::new() }
    }

    /// Adds a reference curve, such as a recorded or commanded curve, which is drawn grey and dashed. Points
    /// are time \[s\] and value.
    pub fn reference(&mut self, points: Vec<(f64, f64)>) {
        self.curves.push(Curve { points, is_reference: true });
    }

    /// Adds a curve of time \[s\] and value.
    pub fn line(&mut self, points: Vec<(f64, f64)>) {
        self.curves.push(Curve { points, is_reference: false });
    }

    /// Adds a band: time \[s\], lower and upper edge.
    pub fn band(&mut self, edges: Vec<(f64, f64, f64)>) {
        self.bands.push(edges);
    }

    fn axes(&self) -> [Axis; 2] {
        let points = || self.curves.iter().flat_map(|curve| curve.points.iter().copied());
        let bands = || self.bands.iter().flatten().copied();
        let times = points().map(|point| point.0).chain(bands().map(|edge| edge.0));
        let values = points().map(|point| point.1).chain(bands().flat_map(|edge| [edge.1, edge.2]));
        [Axis::along(times, false), Axis::values(values, false)]
    }
}

/// Draws panels below each other, with the legend above the first panel and the time axis below the last
/// panel. `names` are the legend texts of the reference curves and of all other curves.
pub fn panels(panels: &[Panel], names: [&str; 2]) -> String {
    let height = TOP + panels.len() as f64 * (HEIGHT + GAP) + BOTTOM;
    let mut svg = theme::begin(WIDTH, height);
    svg += &legend(panels, names);
    for (index, panel) in panels.iter().enumerate() {
        draw(&mut svg, panel, TOP + index as f64 * (HEIGHT + GAP));
    }
    let middle = LEFT + 0.5 * (WIDTH - LEFT - RIGHT);
    svg += &theme::text(middle, height - 10.0, "text-anchor=\"middle\"", "time, s");
    svg + "</svg>\n"
}

const REFERENCE: &str = "class=\"old\" stroke=\"#8c959f\" stroke-dasharray=\"5 3\" stroke-width=\"1.2\"";

fn legend(panels: &[Panel], [reference, curve]: [&str; 2]) -> String {
    let any = |test: &dyn Fn(&Panel) -> bool| panels.iter().any(test);
    let line = format!("{} stroke-width=\"1.8\"", theme::stroke(0));
    let mut entries: Vec<(&str, &str)> = Vec::new();
    if any(&|panel| panel.curves.iter().any(|curve| curve.is_reference)) {
        entries.push((REFERENCE, reference));
        entries.push((&line, curve));
    }
    let band = format!("{} stroke-opacity=\"0.25\" stroke-width=\"9\"", theme::stroke(0));
    if any(&|panel| !panel.bands.is_empty()) {
        entries.push((&band, "two standard deviations"));
    }
    let (mut svg, mut at) = (String::new(), LEFT);
    for (stroke, words) in entries {
        let _ = writeln!(svg, "<path d=\"M{at:.1} 16h22\" {stroke}/>");
        svg += &theme::text(at + 28.0, 20.0, "", words);
        at += 28.0 + 7.2 * words.len() as f64 + 20.0;
    }
    svg
}

fn draw(svg: &mut String, panel: &Panel, top: f64) {
    let [times, values] = panel.axes();
    let x = |t: f64| LEFT + times.fraction(t) * (WIDTH - LEFT - RIGHT);
    let y = |value: f64| top + HEIGHT - values.fraction(value) * HEIGHT;
    let (right, bottom) = (WIDTH - RIGHT, top + HEIGHT);
    for (tick, words) in times.ticks(6.0) {
        let at = x(tick);
        let _ =
            writeln!(svg, "<path class=\"grid\" d=\"M{at:.1} {top:.1}V{bottom:.1}\" stroke=\"#e4e8ec\"/>");
        *svg += &theme::text(at, bottom + 15.0, "text-anchor=\"middle\" font-size=\"11\"", &words);
    }
    for (tick, words) in values.ticks(5.0) {
        let at = y(tick);
        let _ =
            writeln!(svg, "<path class=\"grid\" d=\"M{LEFT:.1} {at:.1}H{right:.1}\" stroke=\"#e4e8ec\"/>");
        *svg += &theme::text(LEFT - 6.0, at + 4.0, "text-anchor=\"end\" font-size=\"11\"", &words);
    }
    for band in &panel.bands {
        let upper = band.iter().map(|(t, _, high)| format!("{:.1},{:.1}", x(*t), y(*high)));
        let lower = band.iter().rev().map(|(t, low, _)| format!("{:.1},{:.1}", x(*t), y(*low)));
        let points: Vec<String> = upper.chain(lower).collect();
        let fill = theme::fill(0);
        let _ = writeln!(svg, "<polygon points=\"{}\" {fill} fill-opacity=\"0.15\"/>", points.join(" "));
    }
    for curve in &panel.curves {
        let stroke = match curve.is_reference {
            true => REFERENCE.to_string(),
            false => format!("{} stroke-width=\"1.6\"", theme::stroke(0)),
        };
        let points: Vec<String> =
            curve.points.iter().map(|(t, value)| format!("{:.1},{:.1}", x(*t), y(*value))).collect();
        let _ = writeln!(svg, "<polyline points=\"{}\" fill=\"none\" {stroke}/>", points.join(" "));
    }
    let width = right - LEFT;
    let _ = writeln!(
        svg,
        "<rect class=\"frame\" x=\"{LEFT}\" y=\"{top}\" width=\"{width}\" height=\"{HEIGHT}\" fill=\"none\" stroke=\"#57606a\"/>"
    );
    *svg += &theme::text(LEFT + 8.0, top + 16.0, "font-weight=\"bold\"", &panel.title);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_of_empty_and_constant_data_are_well_formed() {
        let mut curve = Panel::new("a < b & c");
        curve.reference(vec![(0.0, 1.0), (1.0, 2.0)]);
        curve.line(vec![(0.0, 1.0), (1.0, 1.5)]);
        curve.band(vec![(0.0, 0.9, 1.1), (1.0, 1.4, 1.6)]);
        let mut constant = Panel::new("constant");
        constant.line(vec![(0.0, 3.0), (1.0, 3.0)]);
        let text = panels(&[curve, constant, Panel::new("nothing")], ["recorded", "primitive"]);
        let document = roxmltree::Document::parse(&text).unwrap();
        let count = |name: &str| document.descendants().filter(|node| node.has_tag_name(name)).count();
        assert_eq!([count("polyline"), count("polygon")], [3, 1]);
        for words in ["time, s", "recorded", "two standard deviations", "a &lt; b &amp; c"] {
            assert!(text.contains(words), "{words}");
        }
        assert!(!text.contains("NaN") && !text.contains("inf"));
    }
}
