//! Latency against percentile as SVG, on scales that show the tail.

use std::fmt::Write as _;

use super::families::{FAMILIES, Group, has_counterpart, is_peer, on_dark};
use super::theme;

const WIDTH: f64 = 1200.0;
/// Minimum height of a frame; many labels make it larger.
const HEIGHT: f64 = 400.0;
const LEFT: f64 = 96.0;
/// Width of the column of labels, right of the frames.
const RIGHT: f64 = 450.0;
const TOP: f64 = 92.0;
/// Height of the tick labels and the axis title below a frame.
const BOTTOM: f64 = 48.0;
/// Distance between a panel and the title of the next.
const GAP: f64 = 34.0;
/// Height of a line of a label.
const LINE: f64 = 16.0;
/// The longest line of the subtitle, characters.
const SUBTITLE: usize = 160;
/// The longest line of a label, characters.
const LABEL: usize = 56;
/// Distance below which points of a curve are merged.
const NEAR: f64 = 0.7;

/// The latencies of one measurement.
#[derive(Clone, Debug)]
pub struct Latencies<'a> {
    /// Name of the measurement; its beginning selects the family: `floor.`, `peer.`, `iceoryx2.`, or motorium
    /// for any other name.
    pub name: &'a str,
    /// Text of the label.
    pub what: &'a str,
    /// Number of samples.
    pub count: u64,
    /// Points of the curve: a fraction of all samples, 0 to 1 and ascending, and the latency \[ns\] that this
    /// fraction of the samples does not exceed. Empty for a measurement without samples, which is not drawn.
    pub curve: Vec<(f64, u64)>,
}

/// The curves of one comparison.
struct Panel<'a> {
    title: &'static str,
    curves: Vec<Curve<'a>>,
}

/// A curve, its style and the lines of its label.
#[derive(Clone)]
struct Curve<'a> {
    measurement: &'a Latencies<'a>,
    style: String,
    label: Vec<String>,
}

impl Panel<'_> {
    /// Height of all labels.
    fn labels_height(&self) -> f64 {
        self.curves.iter().map(Curve::label_height).sum()
    }
}

impl Curve<'_> {
    fn label_height(&self) -> f64 {
        LINE * self.label.len() as f64 + 3.0
    }
}

/// The scales of all panels: nines to the right, decades upwards.
#[derive(Clone, Copy)]
struct Scales {
    low: f64,
    high: f64,
    nines: f64,
}

impl Scales {
    fn around(measurements: &[&Latencies<'_>]) -> Self {
        let bounds =
            measurements.iter().flat_map(|measurement| &measurement.curve).map(|(_, ns)| (*ns).max(1));
        let (low, high) = bounds.fold((u64::MAX, 10), |(low, high), ns| (low.min(ns), high.max(ns)));
        let low = decade(low.min(high)).floor();
        let most = measurements.iter().map(|measurement| measurement.count).max().unwrap_or(1);
        Self { low, high: decade(high).ceil().max(low + 1.0), nines: decade(most.max(10)).max(2.0) }
    }
}

/// The plotting area of a panel.
struct Frame {
    scales: Scales,
    top: f64,
    height: f64,
}

impl Frame {
    fn x(&self, nines: f64) -> f64 {
        LEFT + (WIDTH - LEFT - RIGHT) * nines / self.scales.nines
    }

    fn y(&self, ns: f64) -> f64 {
        let share = (ns.max(1.0).log10() - self.scales.low) / (self.scales.high - self.scales.low);
        self.bottom() - self.height * share
    }

    fn bottom(&self) -> f64 {
        self.top + self.height
    }

    /// The grid, its tick labels, and the titles of both axes.
    fn axes(&self) -> String {
        let mut svg = String::new();
        let (top, right, bottom) = (self.top, WIDTH - RIGHT, self.bottom());
        for power in self.scales.low as i32..=self.scales.high as i32 {
            let at = self.y(10f64.powi(power));
            let _ = writeln!(svg, "<path class=\"grid\" d=\"M{LEFT} {at:.1}H{right}\" stroke=\"#dddddd\"/>");
            svg += &theme::text(LEFT - 8.0, at + 4.0, "text-anchor=\"end\"", &time(power));
        }
        let median = ("50 %".to_string(), 2f64.log10());
        let marks = (0..=self.scales.nines as i32).map(|nines| (percent(nines), f64::from(nines)));
        for (words, nines) in core::iter::once(median).chain(marks) {
            let at = self.x(nines);
            let _ = writeln!(
                svg,
                "<path class=\"grid\" d=\"M{at:.1} {top:.1}V{bottom:.1}\" stroke=\"#dddddd\"/>"
            );
            svg += &theme::text(at, bottom + 18.0, "text-anchor=\"middle\"", &words);
        }
        let (across, down) = ((LEFT + right) / 2.0, (top + bottom) / 2.0);
        let middle = "text-anchor=\"middle\"";
        svg += &theme::text(across, bottom + 38.0, middle, "share of samples at or below this latency");
        let turned = format!("{middle} transform=\"rotate(-90 22 {down:.1})\"");
        svg += &theme::text(22.0, down, &turned, "latency");
        svg
    }

    /// The points of a curve, without points too close to another to be visible.
    fn points(&self, measurement: &Latencies<'_>) -> Vec<(f64, f64)> {
        // The last sample has no share above it, so it is drawn at the end of the axis for its count.
        let least = 1.0 / measurement.count.max(1) as f64;
        let curve = &measurement.curve;
        let mut points: Vec<(f64, f64)> = Vec::new();
        for (i, (share, ns)) in curve.iter().enumerate() {
            let at = (self.x(-(1.0 - share).max(least).log10()), self.y(*ns as f64));
            let is_near = points
                .last()
                .is_some_and(|last| (at.0 - last.0).abs() < NEAR && (at.1 - last.1).abs() < NEAR);
            if !is_near || i + 1 == curve.len() {
                points.push(at);
            }
        }
        points
    }

    /// Draws the curves, and joins the end of each to its label in the column on the right.
    fn curves(&self, curves: &[Curve<'_>]) -> String {
        let mut svg = String::new();
        let mut ends = Vec::new();
        for curve in curves {
            let points = self.points(curve.measurement);
            let words: Vec<String> = points.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
            let (style, words) = (&curve.style, words.join(" "));
            let _ = writeln!(svg, "<polyline fill=\"none\" stroke-width=\"1.6\"{style} points=\"{words}\"/>");
            ends.extend(points.last().map(|end| (*end, curve)));
        }
        ends.sort_by(|one, other| one.0.1.total_cmp(&other.0.1));
        let heights: Vec<f64> = ends.iter().map(|(_, curve)| curve.label_height()).collect();
        let wanted: Vec<f64> = ends.iter().map(|((_, y), _)| *y).collect();
        let tops = spread(&wanted, &heights, self.top - 8.0, self.bottom() + 8.0);
        let column = WIDTH - RIGHT;
        for (((x, y), curve), top) in ends.into_iter().zip(tops) {
            let row = top + LINE / 2.0;
            let style = &curve.style;
            let _ = writeln!(
                svg,
                "<path fill=\"none\" stroke-width=\"0.8\" opacity=\"0.6\"{style} d=\"M{x:.1} {y:.1}L{:.1} {row:.1}\"/>\n\
                 <path fill=\"none\" stroke-width=\"2\"{style} d=\"M{:.1} {row:.1}h26\"/>",
                column + 14.0,
                column + 14.0,
            );
            for (line, words) in curve.label.iter().enumerate() {
                svg += &theme::text(column + 46.0, row + 4.0 + LINE * line as f64, "", words);
            }
        }
        svg
    }
}

/// Returns the upper ends of labels with these heights, in order: near their `wanted` positions, without
/// overlap, and from `top` to `bottom` (beyond it if they do not fit).
fn spread(wanted: &[f64], heights: &[f64], top: f64, bottom: f64) -> Vec<f64> {
    let mut tops = Vec::with_capacity(wanted.len());
    let mut free = top;
    for (wanted, height) in wanted.iter().zip(heights) {
        let at = (wanted - LINE / 2.0).max(free);
        tops.push(at);
        free = at + height;
    }
    let mut limit = bottom.max(top + heights.iter().sum::<f64>());
    for (at, height) in tops.iter_mut().zip(heights).rev() {
        *at = at.min(limit - height);
        limit = *at;
    }
    tops
}

/// Draws the latencies of measurements on one machine against percentiles, as SVG. The first panel shows
/// motorium and the floors, which are the lowest latencies that the machine allows. The second panel shows
/// motorium and other systems. The horizontal axis counts nines: 90 %, 99 %, 99.9 % are equally far apart. A
/// curve ends at its longest sample, above the percentile that its number of samples reaches.
pub fn latencies(machine: &str, measurements: &[Latencies<'_>]) -> String {
    // peers that report no samples have no curve
    let measurements: Vec<&Latencies<'_>> =
        measurements.iter().filter(|measurement| !measurement.curve.is_empty()).collect();
    let scales = Scales::around(&measurements);
    let mut body = String::new();
    let mut top = TOP;
    for panel in panels(&measurements) {
        let frame = Frame { scales, top, height: HEIGHT.max(panel.labels_height()) };
        body += &theme::text(LEFT, top - 14.0, "font-size=\"13\" font-weight=\"bold\"", panel.title);
        body += &frame.axes();
        body += &frame.curves(&panel.curves);
        top = frame.bottom() + BOTTOM + GAP;
    }
    let mut svg = theme::begin_with(WIDTH, top - GAP, 12, &on_dark());
    let title = "font-size=\"16\" font-weight=\"bold\"";
    svg += &theme::text(LEFT, 24.0, title, "Latency against percentile, nothing trimmed");
    for (i, line) in wrapped(machine, SUBTITLE).iter().enumerate() {
        svg += &theme::text(LEFT, 42.0 + 14.0 * i as f64, "font-size=\"11\"", line);
    }
    svg + &body + "</svg>\n"
}

/// Sorts measurements into panels; the first panel always exists.
fn panels<'a>(measurements: &[&'a Latencies<'a>]) -> Vec<Panel<'a>> {
    let mut floors = Panel { title: "motorium and the floors of this machine", curves: Vec::new() };
    let mut peers = Panel { title: "motorium and other systems", curves: Vec::new() };
    for family in &FAMILIES {
        let members = measurements.iter().filter(|measurement| (family.is_member)(measurement.name));
        for (i, measurement) in members.enumerate() {
            let colour = i % family.colours.len();
            let style = format!(
                " class=\"{}{colour}\" stroke=\"{}\"{}",
                family.class, family.colours[colour], family.dashes
            );
            let curve = Curve { measurement, style, label: wrapped(measurement.what, LABEL) };
            match family.group {
                Group::Floors => floors.curves.push(curve),
                Group::Peers => peers.curves.push(curve),
                Group::Motorium => {
                    if has_counterpart(measurement.name) {
                        peers.curves.push(curve.clone());
                    }
                    floors.curves.push(curve);
                }
            }
        }
    }
    let has_peers = peers.curves.iter().any(|curve| is_peer(curve.measurement.name));
    core::iter::once(floors).chain(has_peers.then_some(peers)).collect()
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

    /// The latencies of these samples, in ascending order.
    fn measured<'a>(name: &'a str, what: &'a str, samples: Vec<u64>) -> Latencies<'a> {
        let count = samples.len() as u64;
        let curve = (1..=count).zip(samples).map(|(rank, ns)| (rank as f64 / count as f64, ns));
        Latencies { name, what, count, curve: curve.collect() }
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
        let curves = curves(&latencies("a machine", &[fast, slow, peer]));
        assert_eq!(curves.len(), 3, "each family draws its own; motorium has no counterpart here");
        for curve in &curves {
            assert!(curve.windows(2).all(|pair| pair[0].0 <= pair[1].0 && pair[0].1 >= pair[1].1));
            for (x, y) in curve {
                assert!((LEFT..=WIDTH - RIGHT + 0.1).contains(x), "{x}");
                assert!((TOP - 0.1..=TOP + 2.0 * HEIGHT + BOTTOM + GAP + 0.1).contains(y), "{y}");
            }
        }
    }

    #[test]
    fn long_curves_are_thinned_and_keep_their_maximum() {
        let many = measured("hop.x", "a", (0..50_000).map(|n| 20_000 + 3 * n).collect());
        let svg = latencies("a machine", std::slice::from_ref(&many));
        let curve = &curves(&svg)[0];
        assert!((50..3_000).contains(&curve.len()), "{} points", curve.len());
        let frame = Frame { scales: Scales::around(&[&many]), top: TOP, height: HEIGHT };
        let (x, y) = (frame.x(50_000f64.log10()), frame.y(169_997.0));
        let last = curve.last().unwrap();
        assert!((last.0 - x).abs() < 0.1 && (last.1 - y).abs() < 0.1, "{last:?} for {x} {y}");
    }

    #[test]
    fn chart_text_stays_inside_and_never_overlaps() {
        let what =
            "a word and 512 B of plain memory across cores, written and read, at a length nobody expects";
        let names: Vec<String> = (0..70).map(|i| format!("hop.{i}")).collect();
        let all: Vec<_> = names.iter().map(|name| measured(name, what, (1..100).collect())).collect();
        let svg = latencies("a machine", &all);
        let document = roxmltree::Document::parse(&svg).unwrap();
        let root = document.root_element();
        let height: f64 = root.attribute("viewBox").unwrap().split(' ').nth(3).unwrap().parse().unwrap();
        let mut places: Vec<(i64, i64)> = Vec::new();
        for text in root.descendants().filter(|node| node.has_tag_name("text")) {
            let at = |name| text.attribute(name).unwrap().parse::<f64>().unwrap();
            assert!(at("y") < height, "{:?} at {} of {height}", text.text(), at("y"));
            // 6.6 px per character: the width in the widest common sans-serif font at this size.
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
        let svg = latencies("a machine", &[measured("floor.x", "a", (1..50).collect())]);
        assert!(
            svg.contains("prefers-color-scheme:dark") && svg.contains(" class=\"m0\" stroke=\"#000000\"")
        );
    }

    #[test]
    fn both_axes_name_their_units_and_the_median_is_marked() {
        let svg = latencies("a machine", &[measured("hop.x", "a", (1..5_000).collect())]);
        for words in [">latency<", ">share of samples at", ">1 ns<", ">1 us<", ">50 %<", ">99.9 %<"] {
            assert!(svg.contains(words), "{words} in {svg}");
        }
    }

    #[test]
    fn long_machine_description_wraps_between_words() {
        assert_eq!(wrapped("one two three four", 9), ["one two", "three", "four"]);
        assert_eq!(wrapped("", 9), Vec::<String>::new());
    }

    #[test]
    fn chart_without_measurements_is_an_empty_frame() {
        assert!(curves(&latencies("nothing", &[])).is_empty());
    }

    #[test]
    fn other_systems_have_a_panel_beside_their_counterparts() {
        let one = |name| measured(name, name, (1..2_000).collect());
        let all = ["floor.x", "hop.blocking.same.512", "panda", "iceoryx2.same.512", "peer.lcm"].map(one);
        let svg = latencies("a machine", &all);
        let document = roxmltree::Document::parse(&svg).unwrap();
        let nodes = document.descendants().filter(|node| node.has_tag_name("text"));
        let texts: Vec<&str> = nodes.filter_map(|node| node.text()).collect();
        let count = |name: &str| texts.iter().filter(|text| **text == name).count();
        let panels = ["motorium and the floors of this machine", "motorium and other systems"];
        assert_eq!(panels.map(count), [1, 1], "{texts:?}");
        assert_eq!(all.each_ref().map(|one| count(one.name)), [1, 2, 1, 1, 1], "{texts:?}");
        let without_peers = latencies("a machine", &all[..3]);
        assert!(!without_peers.contains("other systems"));
    }

    #[test]
    fn labels_are_near_their_curves_and_do_not_overlap() {
        assert_eq!(spread(&[58.0, 108.0], &[19.0, 19.0], 0.0, 200.0), [50.0, 100.0]);
        assert_eq!(spread(&[58.0, 60.0], &[19.0, 19.0], 0.0, 200.0), [50.0, 69.0]);
        assert_eq!(spread(&[190.0, 195.0], &[20.0, 20.0], 0.0, 200.0), [160.0, 180.0]);
        assert_eq!(spread(&[5.0; 3], &[20.0; 3], 0.0, 30.0), [0.0, 20.0, 40.0], "too many for the space");
    }
}
