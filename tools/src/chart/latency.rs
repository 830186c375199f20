//! Latency against percentile, both on scales that show the tail, as SVG.

use std::fmt::Write as _;

use motorium_benches::latency::Measurement;

use super::families::{FAMILIES, on_dark};
use super::theme;

const WIDTH: f64 = 1200.0;
/// Minimum height; a long legend makes it larger.
const HEIGHT: f64 = 640.0;
const LEFT: f64 = 96.0;
const RIGHT: f64 = 470.0;
const TOP: f64 = 76.0;
const BOTTOM: f64 = 60.0;
/// Height of a line of the legend.
const LINE: f64 = 17.0;
/// The longest line of the subtitle, characters.
const SUBTITLE: usize = 160;
/// The longest line of the legend, characters.
const LEGEND: usize = 62;
/// Points of a curve that are nearer to each other than this are drawn as one.
const NEAR: f64 = 0.7;

/// The frame that the curves are drawn in: nines to the right, decades upwards.
struct Frame {
    low: f64,
    high: f64,
    nines: f64,
    height: f64,
}

impl Frame {
    fn around(measurements: &[&Measurement], height: f64) -> Self {
        let bounds =
            measurements.iter().flat_map(|measurement| measurement.ns.curve()).map(|(_, ns)| ns.max(1));
        let (low, high) = bounds.fold((u64::MAX, 10), |(low, high), ns| (low.min(ns), high.max(ns)));
        let low = decade(low.min(high)).floor();
        let most = measurements.iter().map(|measurement| measurement.ns.count).max().unwrap_or(1);
        Self { low, high: decade(high).ceil().max(low + 1.0), nines: decade(most.max(10)).max(2.0), height }
    }

    fn x(&self, nines: f64) -> f64 {
        LEFT + (WIDTH - LEFT - RIGHT) * nines / self.nines
    }

    fn y(&self, ns: f64) -> f64 {
        let share = (ns.max(1.0).log10() - self.low) / (self.high - self.low);
        self.bottom() - (self.bottom() - TOP) * share
    }

    fn bottom(&self) -> f64 {
        self.height - BOTTOM
    }

    /// The grid, what its lines stand for, and the titles of both axes.
    fn axes(&self) -> String {
        let mut svg = String::new();
        let (right, bottom) = (WIDTH - RIGHT, self.bottom());
        for power in self.low as i32..=self.high as i32 {
            let at = self.y(10f64.powi(power));
            let _ = writeln!(svg, "<path class=\"grid\" d=\"M{LEFT} {at:.1}H{right}\" stroke=\"#dddddd\"/>");
            svg += &theme::text(LEFT - 8.0, at + 4.0, "text-anchor=\"end\"", &time(power));
        }
        let median = ("50 %".to_string(), 2f64.log10());
        let marks = (0..=self.nines as i32).map(|nines| (percent(nines), f64::from(nines)));
        for (words, nines) in core::iter::once(median).chain(marks) {
            let at = self.x(nines);
            let _ =
                writeln!(svg, "<path class=\"grid\" d=\"M{at:.1} {TOP}V{bottom:.1}\" stroke=\"#dddddd\"/>");
            svg += &theme::text(at, bottom + 18.0, "text-anchor=\"middle\"", &words);
        }
        let (across, down) = ((LEFT + right) / 2.0, (TOP + bottom) / 2.0);
        let middle = "text-anchor=\"middle\"";
        svg += &theme::text(across, self.height - 16.0, middle, "share of samples that are at most so long");
        let turned = format!("{middle} transform=\"rotate(-90 22 {down:.1})\"");
        svg += &theme::text(22.0, down, &turned, "latency");
        svg
    }

    /// The points of a curve, without points too close to another to be visible.
    fn points(&self, measurement: &Measurement) -> String {
        // The last sample has no share above it, so it is drawn at the end of the axis for its count.
        let least = 1.0 / measurement.ns.count.max(1) as f64;
        let curve = measurement.ns.curve();
        let mut points = String::new();
        let mut drawn: Option<(f64, f64)> = None;
        for (i, (share, ns)) in curve.iter().enumerate() {
            let at = (self.x(-(1.0 - share).max(least).log10()), self.y(*ns as f64));
            let is_near =
                drawn.is_some_and(|drawn| (at.0 - drawn.0).abs() < NEAR && (at.1 - drawn.1).abs() < NEAR);
            if !is_near || i + 1 == curve.len() {
                let _ = write!(points, "{:.1},{:.1} ", at.0, at.1);
                drawn = Some(at);
            }
        }
        points.trim_end().to_string()
    }
}

/// Draws the curves of some measurements, made on this machine. The horizontal axis counts nines: 90 %, 99 %,
/// 99.9 % are equally far apart. A curve ends at its longest sample, above the percentile that its number of
/// samples reaches.
pub(crate) fn plot(machine: &str, measurements: &[&Measurement]) -> String {
    // of a peer that keeps its samples to itself there is no curve
    let has_curve = |measurement: &&&Measurement| !measurement.ns.buckets.is_empty();
    let measurements: Vec<&Measurement> = measurements.iter().filter(has_curve).copied().collect();
    let (legend, curves) = legend(&measurements);
    let height = HEIGHT.max(curves.bottom + BOTTOM);
    let frame = Frame::around(&measurements, height);
    let mut svg = theme::begin_with(WIDTH, height, 12, &on_dark());
    svg += &theme::text(
        LEFT,
        24.0,
        "font-size=\"16\" font-weight=\"bold\"",
        "Latency against percentile, nothing trimmed",
    );
    for (i, line) in wrapped(machine, SUBTITLE).iter().enumerate() {
        svg += &theme::text(LEFT, 42.0 + 14.0 * i as f64, "font-size=\"11\"", line);
    }
    svg += &frame.axes();
    svg += &legend;
    for Stroke { measurement, style } in &curves.strokes {
        let points = frame.points(measurement);
        let _ = writeln!(svg, "<polyline fill=\"none\" stroke-width=\"1.6\"{style} points=\"{points}\"/>");
    }
    svg.push_str("</svg>\n");
    svg
}

/// A curve and its style.
struct Stroke<'a> {
    measurement: &'a Measurement,
    style: String,
}

struct Curves<'a> {
    strokes: Vec<Stroke<'a>>,
    /// Lower end of the legend, px.
    bottom: f64,
}

/// The legend next to the frame, family by family.
fn legend<'a>(measurements: &[&'a Measurement]) -> (String, Curves<'a>) {
    let left = WIDTH - RIGHT + 16.0;
    let mut svg = String::new();
    let mut strokes = Vec::new();
    let mut row = TOP + 4.0;
    for family in &FAMILIES {
        let members: Vec<&Measurement> =
            measurements.iter().filter(|one| (family.is_member)(&one.name)).copied().collect();
        if members.is_empty() {
            continue;
        }
        svg += &theme::text(left, row + 4.0, "font-weight=\"bold\"", family.title);
        row += LINE;
        for (i, measurement) in members.into_iter().enumerate() {
            let colour = i % family.colours.len();
            let style = format!(
                " class=\"{}{colour}\" stroke=\"{}\"{}",
                family.class, family.colours[colour], family.dashes
            );
            let _ = writeln!(
                svg,
                "<line x1=\"{left:.1}\" y1=\"{row:.1}\" x2=\"{:.1}\" y2=\"{row:.1}\" stroke-width=\"2\"{style}/>",
                left + 30.0,
            );
            for line in wrapped(&measurement.what, LEGEND) {
                svg += &theme::text(left + 38.0, row + 4.0, "", &line);
                row += LINE;
            }
            strokes.push(Stroke { measurement, style });
        }
        row += LINE / 2.0;
    }
    (svg, Curves { strokes, bottom: row })
}

/// Breaks a text between words into lines of at most `most` characters.
fn wrapped(text: &str, most: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= most => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_string()),
        }
    }
    lines
}

fn decade(value: u64) -> f64 {
    (value.max(1) as f64).log10()
}

fn time(power: i32) -> String {
    let (unit, rest) = match power {
        ..3 => ("ns", power),
        3..6 => ("us", power - 3),
        6..9 => ("ms", power - 6),
        9.. => ("s", power - 9),
    };
    format!("{} {unit}", 10i64.pow(rest.max(0) as u32))
}

fn percent(nines: i32) -> String {
    match nines {
        0 => "0 %".to_string(),
        1 => "90 %".to_string(),
        2 => "99 %".to_string(),
        more => format!("99.{} %", "9".repeat(more as usize - 2)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motorium_benches::Distribution;
    use motorium_benches::host::HostShare;

    fn measured(name: &str, what: &str, samples: Vec<u64>) -> Measurement {
        Measurement {
            name: name.to_string(),
            what: what.to_string(),
            ns: Distribution::from_samples(samples),
            fifo: 0,
            host: HostShare::default(),
            slices_p50: Vec::new(),
        }
    }

    /// The points of the curves, as numbers.
    fn curves(svg: &str) -> Vec<Vec<(f64, f64)>> {
        let document = roxmltree::Document::parse(svg).unwrap();
        let lines = document.descendants().filter(|node| node.has_tag_name("polyline"));
        let points = |node: roxmltree::Node<'_, '_>| {
            let pairs = node.attribute("points").unwrap().split_whitespace();
            pairs
                .map(|pair| {
                    let (x, y) = pair.split_once(',').unwrap();
                    (x.parse().unwrap(), y.parse().unwrap())
                })
                .collect()
        };
        lines.map(points).collect()
    }

    #[test]
    fn measurements_are_rising_curves_within_the_frame() {
        let fast = measured("hop.x", "a < b", (1..5_000).collect());
        let slow = measured("floor.x", "c", (1..5_000).map(|n| n * n).collect());
        let peer = measured("iceoryx2.x", "d", (1..5_000).map(|n| 2 * n).collect());
        let curves = curves(&plot("a machine", &[&fast, &slow, &peer]));
        assert_eq!(curves.len(), 3, "each family draws its own, and none twice");
        for curve in &curves {
            assert!(curve.windows(2).all(|pair| pair[0].0 <= pair[1].0 && pair[0].1 >= pair[1].1));
            for (x, y) in curve {
                assert!((LEFT..=WIDTH - RIGHT + 0.1).contains(x), "{x}");
                assert!((TOP - 0.1..=HEIGHT - BOTTOM + 0.1).contains(y), "{y}");
            }
        }
    }

    #[test]
    fn long_curves_are_thinned_and_keep_their_maximum() {
        let many = measured("hop.x", "a", (0..50_000).map(|n| 20_000 + 3 * n).collect());
        let svg = plot("a machine", &[&many]);
        let curve = &curves(&svg)[0];
        assert!((50..3_000).contains(&curve.len()), "{} points", curve.len());
        let frame = Frame::around(&[&many], HEIGHT);
        let (x, y) = (frame.x(50_000f64.log10()), frame.y(many.ns.max as f64));
        let last = curve.last().unwrap();
        assert!((last.0 - x).abs() < 0.1 && (last.1 - y).abs() < 0.1, "{last:?} for {x} {y}");
    }

    #[test]
    fn chart_text_stays_inside_and_never_overlaps() {
        let what =
            "a word and 512 B of plain memory across cores, written and read, at a length nobody expects";
        let all: Vec<Measurement> =
            (0..70).map(|i| measured(&format!("hop.{i}"), what, (1..100).collect())).collect();
        let svg = plot("a machine", &all.iter().collect::<Vec<_>>());
        let document = roxmltree::Document::parse(&svg).unwrap();
        let root = document.root_element();
        let height: f64 = root.attribute("viewBox").unwrap().split(' ').nth(3).unwrap().parse().unwrap();
        let mut places: Vec<(i64, i64)> = Vec::new();
        for text in root.descendants().filter(|node| node.has_tag_name("text")) {
            let at = |name| text.attribute(name).unwrap().parse::<f64>().unwrap();
            assert!(at("y") < height, "{:?} at {} of {height}", text.text(), at("y"));
            // 6.6 px a character: what the widest of the usual sans-serif fonts takes at this size.
            let width = 6.6 * text.text().unwrap().chars().count() as f64;
            let begins = text.attribute("text-anchor").is_none();
            assert!(!begins || at("x") + width < WIDTH, "{:?}", text.text());
            let place = ((at("x") * 10.0) as i64, (at("y") * 10.0) as i64);
            assert!(!places.contains(&place), "{:?} lies on another", text.text());
            places.push(place);
        }
    }

    #[test]
    fn curve_colour_follows_the_dark_theme() {
        let svg = plot("a machine", &[&measured("floor.x", "a", (1..50).collect())]);
        assert!(
            svg.contains("prefers-color-scheme:dark") && svg.contains(" class=\"m0\" stroke=\"#000000\"")
        );
    }

    #[test]
    fn both_axes_name_their_units_and_the_median_is_marked() {
        let svg = plot("a machine", &[&measured("hop.x", "a", (1..5_000).collect())]);
        for words in [">latency<", ">share of samples", ">1 ns<", ">1 us<", ">50 %<", ">99.9 %<"] {
            assert!(svg.contains(words), "{words} in {svg}");
        }
    }

    #[test]
    fn a_long_line_about_the_machine_is_broken_between_words() {
        assert_eq!(wrapped("one two three four", 9), ["one two", "three", "four"]);
        assert_eq!(wrapped("", 9), Vec::<String>::new());
    }

    #[test]
    fn nothing_measured_is_an_empty_frame_and_no_fault() {
        assert!(curves(&plot("nothing", &[])).is_empty());
    }
}
