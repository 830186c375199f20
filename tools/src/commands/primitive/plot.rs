//! Curves over time as SVG, a panel for each dimension.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::Context as _;

use motorium_primitives::rollout::Trajectory;

const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 150.0;
const LEFT: f64 = 80.0;
const RIGHT: f64 = 16.0;
const GAP: f64 = 34.0;
const TOP: f64 = 14.0;

/// A few curves with one pair of axes.
#[derive(Debug, Clone)]
pub(super) struct Panel {
    title: String,
    curves: Vec<Curve>,
    /// Time, lower and upper edge.
    bands: Vec<Vec<(f64, f64, f64)>>,
}

#[derive(Debug, Clone)]
struct Curve {
    points: Vec<(f64, f64)>,
    shown: bool,
}

impl Panel {
    pub(super) fn new(title: &str) -> Self {
        Self { title: title.to_string(), curves: Vec::new(), bands: Vec::new() }
    }

    /// A curve that was recorded: grey and dashed.
    pub(super) fn demonstration(&mut self, points: Vec<(f64, f64)>) {
        self.curves.push(Curve { points, shown: true });
    }

    /// A curve.
    pub(super) fn line(&mut self, points: Vec<(f64, f64)>) {
        self.curves.push(Curve { points, shown: false });
    }

    /// A dimension of a movement, with two standard deviations where they are known.
    pub(super) fn trajectory(&mut self, trajectory: &Trajectory, dimension: usize) {
        let times = trajectory.time.iter().copied();
        if let Some(deviations) = &trajectory.deviation {
            let edges = trajectory.position.iter().zip(deviations).map(|(place, deviation)| {
                (place[dimension] - 2.0 * deviation[dimension], place[dimension] + 2.0 * deviation[dimension])
            });
            self.bands.push(times.clone().zip(edges).map(|(time, (low, high))| (time, low, high)).collect());
        }
        self.line(times.zip(trajectory.position.iter().map(|place| place[dimension])).collect());
    }

    /// Least and greatest time and value.
    fn extent(&self) -> [(f64, f64); 2] {
        let points = self.curves.iter().flat_map(|curve| curve.points.iter().copied());
        let edges = self.bands.iter().flatten().flat_map(|(t, low, high)| [(*t, *low), (*t, *high)]);
        let mut extent = [(f64::INFINITY, f64::NEG_INFINITY); 2];
        for (t, y) in points.chain(edges).filter(|(t, y)| t.is_finite() && y.is_finite()) {
            for (range, value) in extent.iter_mut().zip([t, y]) {
                *range = (range.0.min(value), range.1.max(value));
            }
        }
        extent.map(|(low, high)| match high - low {
            // nothing at all, or a constant
            width if !width.is_finite() => (0.0, 1.0),
            width if width < 1e-12 * (1.0 + high.abs()) => (low - 0.5, high + 0.5),
            width => (low - 0.04 * width, high + 0.04 * width),
        })
    }
}

/// Draws panels below each other into a file.
pub(super) fn write(path: &Path, panels: &[Panel]) -> anyhow::Result<()> {
    std::fs::write(path, svg(panels)).with_context(|| path.display().to_string())
}

fn svg(panels: &[Panel]) -> String {
    let height = TOP + panels.len() as f64 * (HEIGHT + GAP);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{height}\" viewBox=\"0 0 {WIDTH} {height}\" font-family=\"sans-serif\" font-size=\"11\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    for (index, panel) in panels.iter().enumerate() {
        draw(&mut out, panel, TOP + index as f64 * (HEIGHT + GAP));
    }
    out.push_str("</svg>\n");
    out
}

fn draw(out: &mut String, panel: &Panel, top: f64) {
    let [(t0, t1), (y0, y1)] = panel.extent();
    let x = |t: f64| LEFT + (t - t0) / (t1 - t0) * (WIDTH - LEFT - RIGHT);
    let y = |value: f64| top + HEIGHT - (value - y0) / (y1 - y0) * HEIGHT;
    let (right, bottom) = (WIDTH - RIGHT, top + HEIGHT);
    for (tick, text) in ticks(t0, t1) {
        let at = x(tick);
        let _ = writeln!(
            out,
            "<path d=\"M{at:.1} {top:.1}V{bottom:.1}\" stroke=\"#e5e5e5\"/><text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"#555\">{text}</text>",
            bottom + 14.0
        );
    }
    for (tick, text) in ticks(y0, y1) {
        let at = y(tick);
        let _ = writeln!(
            out,
            "<path d=\"M{LEFT:.1} {at:.1}H{right:.1}\" stroke=\"#e5e5e5\"/><text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"#555\">{text}</text>",
            LEFT - 6.0,
            at + 4.0
        );
    }
    for band in &panel.bands {
        let upper = band.iter().map(|(t, _, high)| format!("{:.1},{:.1}", x(*t), y(*high)));
        let lower = band.iter().rev().map(|(t, low, _)| format!("{:.1},{:.1}", x(*t), y(*low)));
        let points: Vec<String> = upper.chain(lower).collect();
        let _ = writeln!(
            out,
            "<polygon points=\"{}\" fill=\"#1f77b4\" fill-opacity=\"0.15\"/>",
            points.join(" ")
        );
    }
    for curve in &panel.curves {
        let style = if curve.shown {
            "stroke=\"#888\" stroke-dasharray=\"5 3\" stroke-width=\"1.2\""
        } else {
            "stroke=\"#1f77b4\" stroke-width=\"1.6\""
        };
        let points: Vec<String> =
            curve.points.iter().map(|(t, value)| format!("{:.1},{:.1}", x(*t), y(*value))).collect();
        let _ = writeln!(out, "<polyline points=\"{}\" fill=\"none\" {style}/>", points.join(" "));
    }
    let (width, title) = (right - LEFT, escaped(&panel.title));
    let _ = writeln!(
        out,
        "<rect x=\"{LEFT}\" y=\"{top}\" width=\"{width}\" height=\"{HEIGHT}\" fill=\"none\" stroke=\"#999\"/><text x=\"{:.1}\" y=\"{:.1}\" font-weight=\"bold\">{title}</text>",
        LEFT + 8.0,
        top + 16.0
    );
}

/// About five round numbers within a range, and how they are written.
fn ticks(low: f64, high: f64) -> Vec<(f64, String)> {
    let raw = (high - low) / 5.0;
    let power = 10.0_f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|step| *step >= raw).unwrap_or(raw);
    let digits = (-step.log10().floor()).max(0.0) as usize;
    let first = (low / step).ceil() as i64;
    let last = (high / step).floor() as i64;
    let written = |value: f64| {
        if digits > 6 || value.abs() >= 1e7 { format!("{value:.1e}") } else { format!("{value:.digits$}") }
    };
    // a zero is no negative zero
    (first..=last).map(|k| (k as f64 * step + 0.0, written(k as f64 * step + 0.0))).collect()
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_within_the_range() {
        let words = |low, high| ticks(low, high).into_iter().map(|(_, text)| text).collect::<Vec<_>>();
        assert_eq!(words(0.0, 1.0), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(words(-0.013, 0.028), ["-0.01", "0.00", "0.01", "0.02"]);
        assert_eq!(words(-1200.0, 900.0), ["-1000", "-500", "0", "500"]);
    }

    #[test]
    fn a_drawing_is_well_formed_also_of_nothing_and_of_constants() {
        let mut curve = Panel::new("a < b & c");
        curve.demonstration(vec![(0.0, 1.0), (1.0, 2.0)]);
        curve.line(vec![(0.0, 1.0), (1.0, 1.5)]);
        let mut constant = Panel::new("constant");
        constant.line(vec![(0.0, 3.0), (1.0, 3.0)]);
        let text = svg(&[curve, constant, Panel::new("nothing")]);
        let document = roxmltree::Document::parse(&text).unwrap();
        let count = |name: &str| document.descendants().filter(|node| node.has_tag_name(name)).count();
        assert_eq!(count("polyline"), 3);
        assert!(!text.contains("NaN") && !text.contains("inf"));
    }
}
