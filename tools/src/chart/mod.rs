//! Charts as SVG and PNG: lines with error bars, paths in tiles, and latencies against percentiles.

mod braille;
mod font;
mod latency;
mod raster;

use std::fmt::Write as _;

use crate::draw::escape;

pub(crate) use braille::braille;
pub(crate) use latency::plot;

/// One line of a chart.
#[derive(Clone, Debug)]
pub(crate) struct Series {
    pub(crate) name: String,
    /// x, y and half the length of an error bar (0: none).
    pub(crate) points: Vec<[f64; 3]>,
}

/// A chart with one x axis and one y axis.
#[derive(Clone, Debug)]
pub(crate) struct Chart {
    pub(crate) title: String,
    pub(crate) x: String,
    pub(crate) y: String,
    pub(crate) log_x: bool,
    pub(crate) log_y: bool,
    pub(crate) series: Vec<Series>,
}

const COLOURS: [&str; 8] =
    ["#1f6feb", "#d1242f", "#1a7f37", "#9a6700", "#8250df", "#0b7285", "#bf3989", "#57606a"];
const SIZE: [f64; 2] = [760.0, 440.0];
/// Margins around the plot: left, top, right, bottom.
const MARGIN: [f64; 4] = [78.0, 40.0, 190.0, 56.0];

/// An axis: from values to positions in the plot.
struct Axis {
    low: f64,
    high: f64,
    log: bool,
}

impl Axis {
    fn of(values: impl Iterator<Item = f64>, log: bool) -> Self {
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        for value in values.filter(|value| value.is_finite() && (!log || *value > 0.0)) {
            range = [range[0].min(value), range[1].max(value)];
        }
        let [mut low, mut high] = if range[0] > range[1] { [0.1, 1.0] } else { range };
        if log {
            (low, high) =
                (10.0_f64.powf((low.log10() - 0.05).floor()), 10.0_f64.powf((high.log10() + 0.02).ceil()));
        } else {
            low = low.min(0.0);
            high += 0.04 * (high - low).max(1e-12);
        }
        Self { low, high, log }
    }

    /// From 0 to 1 along the axis.
    fn fraction(&self, value: f64) -> f64 {
        let at = |x: f64| if self.log { x.max(self.low * 1e-3).log10() } else { x };
        ((at(value) - at(self.low)) / (at(self.high) - at(self.low))).clamp(0.0, 1.0)
    }

    fn ticks(&self) -> Vec<f64> {
        if self.log {
            let decades = self.low.log10().round() as i32..=self.high.log10().round() as i32;
            return decades.map(|d| 10.0_f64.powi(d)).collect();
        }
        let raw = (self.high - self.low) / 6.0;
        let power = 10.0_f64.powf(raw.log10().floor());
        let step =
            [1.0, 2.0, 5.0, 10.0].into_iter().map(|k| k * power).find(|step| *step >= raw).unwrap_or(raw);
        let first = (self.low / step).ceil() as i64;
        let last = (self.high / step).floor() as i64;
        (first..=last).map(|k| k as f64 * step).collect()
    }
}

fn number(value: f64) -> String {
    if value == 0.0 {
        "0".into()
    } else if value.abs() < 1e-3 || value.abs() >= 1e5 {
        format!("{value:.0e}")
    } else {
        let text = format!("{value:.3}");
        text.trim_end_matches('0').trim_end_matches('.').to_string()
    }
}

fn begin(width: f64, height: f64) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
         height=\"{height}\" font-family=\"sans-serif\" font-size=\"13\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    )
}

impl Chart {
    pub(crate) fn svg(&self) -> String {
        let [left, top, right, bottom] = MARGIN;
        let (width, height) = (SIZE[0] - left - right, SIZE[1] - top - bottom);
        let points = || self.series.iter().flat_map(|series| &series.points);
        let x_axis = Axis::of(points().map(|p| p[0]), self.log_x);
        let y_axis = Axis::of(points().flat_map(|p| [p[1] - p[2], p[1], p[1] + p[2]]), self.log_y);
        let x = |value: f64| left + width * x_axis.fraction(value);
        let y = |value: f64| top + height * (1.0 - y_axis.fraction(value));
        let mut svg = begin(SIZE[0], SIZE[1]);
        let _ = writeln!(svg, "<text x=\"{left}\" y=\"24\" font-size=\"15\">{}</text>", escape(&self.title));
        for tick in x_axis.ticks() {
            let (at, end) = (x(tick), top + height);
            let _ = writeln!(svg, "<path d=\"M{at:.1} {top}V{end}\" stroke=\"#e4e8ec\"/>");
            let _ = writeln!(
                svg,
                "<text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                end + 18.0,
                number(tick)
            );
        }
        for tick in y_axis.ticks() {
            let (at, end) = (y(tick), left + width);
            let _ = writeln!(svg, "<path d=\"M{left} {at:.1}H{end}\" stroke=\"#e4e8ec\"/>");
            let _ = writeln!(
                svg,
                "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                left - 7.0,
                at + 4.0,
                number(tick)
            );
        }
        let _ = writeln!(
            svg,
            "<rect x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\" fill=\"none\" stroke=\"#57606a\"/>"
        );
        for (k, series) in self.series.iter().enumerate() {
            let colour = COLOURS[k % COLOURS.len()];
            let mut line = String::new();
            for (i, [px, py, bar]) in series.points.iter().enumerate().filter(|(_, p)| p[1].is_finite()) {
                let _ = write!(line, "{}{:.1} {:.1}", if i == 0 { "M" } else { "L" }, x(*px), y(*py));
                if *bar > 0.0 {
                    let (at, low, high) = (x(*px), y(py - bar), y(py + bar));
                    let _ = writeln!(
                        svg,
                        "<path d=\"M{at:.1} {low:.1}V{high:.1}M{:.1} {low:.1}h6M{:.1} {high:.1}h6\" stroke=\"{colour}\" opacity=\"0.6\"/>",
                        at - 3.0,
                        at - 3.0
                    );
                }
                if series.points.len() < 60 {
                    let _ = writeln!(
                        svg,
                        "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"2.6\" fill=\"{colour}\"/>",
                        x(*px),
                        y(*py)
                    );
                }
            }
            let _ =
                writeln!(svg, "<path d=\"{line}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.8\"/>");
            let (key_x, key_y) = (left + width + 14.0, top + 12.0 + 20.0 * k as f64);
            let _ = writeln!(svg, "<path d=\"M{key_x} {key_y}h18\" stroke=\"{colour}\" stroke-width=\"3\"/>");
            let _ = writeln!(
                svg,
                "<text x=\"{}\" y=\"{}\">{}</text>",
                key_x + 24.0,
                key_y + 4.0,
                escape(&series.name)
            );
        }
        let (middle_x, middle_y) = (left + 0.5 * width, top + 0.5 * height);
        let _ = writeln!(
            svg,
            "<text x=\"{middle_x}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
            SIZE[1] - 12.0,
            escape(&self.x)
        );
        let _ = writeln!(
            svg,
            "<text transform=\"translate(18 {middle_y}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            escape(&self.y)
        );
        svg + "</svg>\n"
    }

    /// The same numbers: series, x, y, error.
    pub(crate) fn csv(&self) -> String {
        let mut csv = String::from("series,x,y,error\n");
        for series in &self.series {
            for [x, y, bar] in &series.points {
                let _ = writeln!(csv, "{},{x},{y},{bar}", series.name.replace(',', ";"));
            }
        }
        csv
    }
}

/// Paths in one tile: a name, and curves (thin and grey, or thick and coloured) of x and y.
#[derive(Clone, Debug)]
pub(crate) struct Tile {
    pub(crate) name: String,
    pub(crate) known: Vec<[f64; 2]>,
    pub(crate) found: Vec<[f64; 2]>,
}

/// Tiles in rows of `columns`: the known path in grey, the one found in blue.
pub(crate) fn tiles(title: &str, tiles: &[Tile], columns: usize) -> String {
    const SIDE: f64 = 130.0;
    let columns = columns.max(1);
    let rows = tiles.len().div_ceil(columns);
    let mut svg = begin(SIDE * columns as f64, 40.0 + (SIDE + 20.0) * rows as f64);
    let _ = writeln!(svg, "<text x=\"8\" y=\"24\" font-size=\"15\">{}</text>", escape(title));
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
            (&tile.known, "stroke=\"#c9d1d9\" stroke-width=\"4\""),
            (&tile.found, "stroke=\"#1f6feb\" stroke-width=\"1.8\""),
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
            "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\" font-size=\"12\">{}</text>",
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
    fn a_chart_is_well_formed_and_shows_every_series() {
        let series =
            |name: &str| Series { name: name.into(), points: vec![[1.0, 0.5, 0.1], [10.0, 0.05, 0.0]] };
        let (x, y) = ("n <terms>".to_string(), "error".to_string());
        let chart = Chart {
            title: "a & b".into(),
            x,
            y,
            log_x: true,
            log_y: true,
            series: vec![series("one"), series("two")],
        };
        let svg = chart.svg();
        let parsed = roxmltree::Document::parse(&svg).unwrap();
        let texts: Vec<&str> = parsed.descendants().filter_map(|node| node.text()).collect();
        assert!(["one", "two", "a & b", "n <terms>"].iter().all(|text| texts.contains(text)), "{texts:?}");
        assert_eq!(chart.csv().lines().count(), 5);
    }

    #[test]
    fn tiles_hold_both_paths_inside_the_picture() {
        let tile = Tile {
            name: "a".into(),
            known: vec![[0.0, 0.0], [1.0, 2.0]],
            found: vec![[0.0, 0.1], [1.0, 1.9]],
        };
        let svg = tiles("letters", &[tile.clone(), tile], 2);
        assert_eq!(
            roxmltree::Document::parse(&svg)
                .unwrap()
                .descendants()
                .filter(|n| n.has_tag_name("path"))
                .count(),
            4
        );
    }
}
