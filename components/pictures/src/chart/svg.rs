//! A chart as SVG.

use std::fmt::Write as _;

use super::axis::Axis;
use super::{Chart, Series, theme};
use crate::text::escape;

/// Width and minimum height of the picture.
const SIZE: [f64; 2] = [820.0, 440.0];
/// Margins around the plot: left, top, bottom.
const MARGIN: [f64; 3] = [78.0, 40.0, 56.0];
/// Width of a character of the legend, and the longest text in characters.
const CHARACTER: f64 = 7.2;
const WIDEST: usize = 40;
/// Height of a line of the legend.
const LINE: f64 = 20.0;
/// Minimum number of points for an error band; with fewer points, errors are bars.
const BAND: usize = 25;
/// Number of points below which each one is marked.
const MARKED: usize = 60;

/// Layout of a chart: the plot within the picture, the axes, and the texts of the legend.
pub(super) struct Layout {
    pub(super) size: [f64; 2],
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) x_axis: Axis,
    pub(super) y_axis: Axis,
    pub(super) names: Vec<String>,
}

impl Layout {
    /// Computes the layout. The legend is as wide as its longest name at this character width, and the
    /// picture is high enough for its lines.
    pub(super) fn for_chart(chart: &Chart, character: f64) -> Self {
        let names: Vec<String> = chart.series.iter().map(|series| shortened(&series.name)).collect();
        let longest = names.iter().map(|name| name.chars().count()).max().unwrap_or(0);
        let legend = if longest == 0 { 16.0 } else { 48.0 + character * longest as f64 };
        let [left, top, bottom] = MARGIN;
        let height = SIZE[1].max(top + bottom + LINE * names.len() as f64);
        let points = || chart.series.iter().flat_map(|series| &series.points);
        Self {
            size: [SIZE[0], height],
            left,
            top,
            width: SIZE[0] - left - legend,
            height: height - top - bottom,
            x_axis: Axis::along(points().map(|p| p[0]), chart.log_x),
            y_axis: Axis::values(points().flat_map(|p| [p[1] - p[2], p[1], p[1] + p[2]]), chart.log_y),
            names,
        }
    }

    pub(super) fn x(&self, value: f64) -> f64 {
        self.left + self.width * self.x_axis.fraction(value)
    }

    pub(super) fn y(&self, value: f64) -> f64 {
        self.top + self.height * (1.0 - self.y_axis.fraction(value))
    }

    /// The left end of a line of the legend.
    pub(super) fn key(&self, index: usize) -> [f64; 2] {
        [self.left + self.width + 14.0, self.top + 12.0 + LINE * index as f64]
    }
}

/// Shortens a name to fit the legend by omitting its middle.
fn shortened(name: &str) -> String {
    let letters: Vec<char> = name.chars().collect();
    if letters.len() <= WIDEST {
        return name.to_string();
    }
    let half = WIDEST / 2 - 2;
    letters[..half].iter().chain(&[' ', '.', '.', ' ']).chain(&letters[letters.len() - half..]).collect()
}

impl Series {
    /// Returns `true` if the errors are drawn as a band.
    pub(super) fn has_band(&self) -> bool {
        self.points.len() >= BAND && self.points.iter().any(|point| point[2] > 0.0)
    }

    /// Returns the runs of consecutive finite points; anything else interrupts the line.
    pub(super) fn runs(&self) -> impl Iterator<Item = &[[f64; 3]]> {
        self.points
            .split(|point| !(point[0].is_finite() && point[1].is_finite()))
            .filter(|run| !run.is_empty())
    }
}

impl Chart {
    /// Returns the chart as an SVG picture, which is light or dark according to the reader's preference.
    pub fn svg(&self) -> String {
        let layout = Layout::for_chart(self, CHARACTER);
        let mut svg = theme::begin(layout.size[0], layout.size[1]);
        svg += &theme::text(layout.left, 24.0, "font-size=\"15\"", &self.title);
        svg += &layout.grid();
        for (index, series) in self.series.iter().enumerate() {
            svg += &layout.series(index, series);
        }
        let Layout { left, top, width, height, .. } = layout;
        svg += &theme::text(left + 0.5 * width, layout.size[1] - 12.0, "text-anchor=\"middle\"", &self.x);
        let _ = writeln!(
            svg,
            "<text class=\"ink\" fill=\"#1f2328\" transform=\"translate(18 {:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            top + 0.5 * height,
            escape(&self.y)
        );
        svg + "</svg>\n"
    }
}

impl Layout {
    fn grid(&self) -> String {
        let Self { left, top, width, height, .. } = *self;
        let (end, bottom) = (left + width, top + height);
        let mut svg = String::new();
        for (tick, words) in self.x_axis.ticks(6.0) {
            let at = self.x(tick);
            let _ = writeln!(svg, "<path class=\"grid\" d=\"M{at:.1} {top}V{bottom}\" stroke=\"#e4e8ec\"/>");
            svg += &theme::text(at, bottom + 18.0, "text-anchor=\"middle\"", &words);
        }
        for (tick, words) in self.y_axis.ticks(6.0) {
            let at = self.y(tick);
            let _ = writeln!(svg, "<path class=\"grid\" d=\"M{left} {at:.1}H{end}\" stroke=\"#e4e8ec\"/>");
            svg += &theme::text(left - 7.0, at + 4.0, "text-anchor=\"end\"", &words);
        }
        let _ = writeln!(
            svg,
            "<rect class=\"frame\" x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\" fill=\"none\" stroke=\"#57606a\"/>"
        );
        svg
    }

    /// Band or bars, marks and line of a series, and its line of the legend.
    fn series(&self, index: usize, series: &Series) -> String {
        let (mut svg, stroke, fill) = (String::new(), theme::stroke(index), theme::fill(index));
        let colour = theme::COLOURS[index % theme::COLOURS.len()];
        let of = |run: &[[f64; 3]], side: f64| -> Vec<String> {
            run.iter()
                .map(|[px, py, bar]| format!("{:.1} {:.1}", self.x(*px), self.y(py + side * bar)))
                .collect()
        };
        for run in series.runs() {
            if series.has_band() {
                let lower: Vec<String> = of(run, -1.0).into_iter().rev().collect();
                let outline = [of(run, 1.0).join("L"), lower.join("L")].join("L");
                let _ =
                    writeln!(svg, "<path d=\"M{outline}Z\" {fill} fill-opacity=\"0.15\" stroke=\"none\"/>");
            }
            for [px, py, bar] in run {
                let (at, middle) = (self.x(*px), self.y(*py));
                if *bar > 0.0 && !series.has_band() {
                    let (low, high) = (self.y(py - bar), self.y(py + bar));
                    let _ = writeln!(
                        svg,
                        "<path class=\"c{}\" d=\"M{at:.1} {low:.1}V{high:.1}M{:.1} {low:.1}h6M{:.1} {high:.1}h6\" stroke=\"{colour}\" opacity=\"0.6\"/>",
                        index % theme::COLOURS.len(),
                        at - 3.0,
                        at - 3.0
                    );
                }
                if series.points.len() < MARKED {
                    let _ = writeln!(svg, "<circle cx=\"{at:.1}\" cy=\"{middle:.1}\" r=\"2.6\" {fill}/>");
                }
            }
            let line = of(run, 0.0).join("L");
            let _ = writeln!(
                svg,
                "<path d=\"M{line}\" fill=\"none\" {stroke} stroke-width=\"1.8\" stroke-linejoin=\"round\"/>"
            );
        }
        if !self.names[index].is_empty() {
            let [x, y] = self.key(index);
            let _ = writeln!(svg, "<path d=\"M{x:.1} {y:.1}h22\" {stroke} stroke-width=\"3\"/>");
            svg += &theme::text(x + 28.0, y + 4.0, "", &self.names[index]);
        }
        svg
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(names: &[&str], points: usize) -> Chart {
        let series = |name: &&str| Series {
            name: (*name).to_string(),
            points: (0..points).map(|k| [1.0 + k as f64, 0.5 / (1.0 + k as f64), 0.1]).collect(),
        };
        let (x, y) = ("n <terms>".to_string(), "error, m".to_string());
        let series = names.iter().map(series).collect();
        Chart { title: "a & b".into(), x, y, log_x: true, log_y: true, series }
    }

    #[test]
    fn chart_is_well_formed_with_distinct_series() {
        let svg = chart(&["one", "two"], 3).svg();
        let parsed = roxmltree::Document::parse(&svg).unwrap();
        let texts: Vec<&str> = parsed.descendants().filter_map(|node| node.text()).collect();
        assert!(
            ["one", "two", "a & b", "n <terms>", "error, m"].iter().all(|text| texts.contains(text)),
            "{texts:?}"
        );
        let all: Vec<String> = (0..24).map(theme::stroke).collect();
        for (index, stroke) in all.iter().enumerate() {
            assert!(!all[..index].contains(stroke), "line {index} looks like another");
        }
        assert_eq!(chart(&["one", "two"], 2).csv().lines().count(), 5);
    }

    #[test]
    fn legends_with_long_or_many_names_fit_the_picture() {
        let long = "left_leg_ankle_pitch_joint of the robot that stands at the far left";
        let names: Vec<&str> = std::iter::repeat_n(long, 40).collect();
        for character in [CHARACTER, super::super::raster::CHARACTER] {
            let layout = Layout::for_chart(&chart(&names, 2), character);
            let [x, y] = layout.key(39);
            assert!(y < layout.size[1] && layout.width > 200.0, "{character}");
            assert!(x + 28.0 + character * layout.names[0].chars().count() as f64 <= layout.size[0]);
            assert!(layout.names[0].starts_with("left_leg") && layout.names[0].ends_with("far left"));
        }
    }

    #[test]
    fn many_points_have_a_band_of_errors_and_few_have_bars() {
        let count = |points: usize, part: &str| chart(&["one"], points).svg().matches(part).count();
        assert_eq!([count(100, "fill-opacity"), count(100, "opacity=\"0.6\"")], [1, 0]);
        assert_eq!([count(5, "fill-opacity"), count(5, "opacity=\"0.6\"")], [0, 5]);
    }

    #[test]
    fn every_element_has_a_colour_attribute() {
        // Programs without style sheets draw elements without a colour attribute in black.
        let svg = chart(&["one", "two"], 30).svg();
        let document = roxmltree::Document::parse(&svg).unwrap();
        for node in document.descendants().filter(|node| node.attribute("class").is_some()) {
            let coloured = ["fill", "stroke"]
                .iter()
                .any(|name| node.attribute(*name).is_some_and(|value| value.starts_with('#')));
            assert!(coloured, "{:?}", node.attribute("class"));
        }
        assert!(svg.contains("prefers-color-scheme:dark"));
    }

    #[test]
    fn missing_numbers_interrupt_the_line() {
        let mut gap = chart(&["one"], 5);
        gap.series[0].points[2][1] = f64::NAN;
        let svg = gap.svg();
        assert!(!svg.contains("NaN"));
        assert_eq!(svg.matches("stroke-linejoin").count(), 2);
    }
}
