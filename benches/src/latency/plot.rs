//! Latency against percentile, both on scales that show the tail, as SVG.

use std::fmt::Write as _;

use super::Measurement;

const WIDTH: f64 = 1160.0;
const HEIGHT: f64 = 640.0;
const LEFT: f64 = 80.0;
const RIGHT: f64 = 440.0;
const TOP: f64 = 76.0;
const BOTTOM: f64 = 60.0;
/// Height of a line of the legend.
const LINE: f64 = 17.0;
/// The longest line of the subtitle, characters.
const SUBTITLE: usize = 150;

/// What a curve belongs to: each family has its own dashes, colours and place in the legend.
struct Family {
    title: &'static str,
    dashes: &'static str,
    colours: &'static [&'static str],
    is_member: fn(&str) -> bool,
}

/// Colours that can be told apart on white, by people who see few of them too (P. Tol's "bright" and "muted").
const FAMILIES: [Family; 3] = [
    Family {
        title: "floors of this machine",
        dashes: " stroke-dasharray=\"2 3\"",
        colours: &["#000000", "#777777", "#b08000", "#5a4fa0"],
        is_member: |name| name.starts_with("floor."),
    },
    Family {
        title: "motorium",
        dashes: "",
        colours: &[
            "#4477aa", "#ee6677", "#228833", "#aa3377", "#66ccee", "#ddaa33", "#332288", "#117733",
            "#882255", "#999933",
        ],
        is_member: |name| !name.starts_with("floor.") && !is_peer(name),
    },
    Family {
        title: "other systems",
        dashes: " stroke-dasharray=\"8 3\"",
        colours: &[
            "#cc3311", "#ee7733", "#0077bb", "#009988", "#ee3377", "#664400", "#444444", "#6699cc",
            "#aa4499", "#000000",
        ],
        is_member: is_peer,
    },
];

fn is_peer(name: &str) -> bool {
    name.starts_with("peer.") || name.starts_with("iceoryx2.")
}

/// Draws the curves of some measurements, made on this machine. The horizontal axis counts nines: 90 %, 99 %, 99.9 % are
/// equally far apart. A curve ends at its longest sample, above the percentile that its number of samples reaches.
pub fn plot(machine: &str, measurements: &[&Measurement]) -> String {
    // of a peer that keeps its samples to itself there is no curve
    let has_curve = |measurement: &&&Measurement| !measurement.ns.buckets.is_empty();
    let measurements: Vec<&Measurement> = measurements.iter().filter(has_curve).copied().collect();
    let bounds = measurements.iter().flat_map(|measurement| measurement.ns.curve()).map(|(_, ns)| ns.max(1));
    let (low, high) = bounds.fold((u64::MAX, 10), |(low, high), ns| (low.min(ns), high.max(ns)));
    let low = decade(low.min(high)).floor();
    let high = decade(high).ceil().max(low + 1.0);
    let most = measurements.iter().map(|measurement| measurement.ns.count).max().unwrap_or(1);
    let nines = decade(most.max(10)).max(2.0);
    let x = |nine: f64| LEFT + (WIDTH - LEFT - RIGHT) * nine / nines;
    let y = |ns: f64| HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * (ns.max(1.0).log10() - low) / (high - low);

    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" font-family=\"sans-serif\" \
         font-size=\"12\">\n<rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"white\"/>\n\
         <text x=\"{LEFT}\" y=\"24\" font-size=\"16\" font-weight=\"bold\">Latency against percentile, nothing \
         trimmed</text>\n"
    );
    for (i, line) in wrapped(machine, SUBTITLE).iter().enumerate() {
        let at = 42.0 + 14.0 * i as f64;
        let _ = writeln!(
            svg,
            "<text x=\"{LEFT}\" y=\"{at:.1}\" font-size=\"11\" fill=\"#555\">{}</text>",
            escape(line)
        );
    }
    let (left, right, top, bottom) = (LEFT, WIDTH - RIGHT, TOP, HEIGHT - BOTTOM);
    for power in low as i32..=high as i32 {
        let at = y(10f64.powi(power));
        let _ = writeln!(
            svg,
            "<line x1=\"{left}\" y1=\"{at:.1}\" x2=\"{right}\" y2=\"{at:.1}\" stroke=\"#ddd\"/>\
             <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            left - 8.0,
            at + 4.0,
            time(power)
        );
    }
    for nine in 0..=nines as i32 {
        let at = x(f64::from(nine));
        let _ = writeln!(
            svg,
            "<line x1=\"{at:.1}\" y1=\"{top}\" x2=\"{at:.1}\" y2=\"{bottom}\" stroke=\"#ddd\"/>\
             <text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
            bottom + 18.0,
            percent(nine)
        );
    }
    let _ = writeln!(
        svg,
        "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">percentile</text>",
        (left + right) / 2.0,
        HEIGHT - 16.0
    );
    let mut row = TOP + 4.0;
    for family in &FAMILIES {
        let members: Vec<&&Measurement> =
            measurements.iter().filter(|measurement| (family.is_member)(&measurement.name)).collect();
        if members.is_empty() {
            continue;
        }
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" font-weight=\"bold\">{}</text>",
            right + 16.0,
            row + 4.0,
            family.title
        );
        row += LINE;
        for (i, measurement) in members.into_iter().enumerate() {
            let (colour, dashes) = (family.colours[i % family.colours.len()], family.dashes);
            // The last sample has no share above it: it stands at the end of the axis for its count.
            let least = 1.0 / measurement.ns.count.max(1) as f64;
            let mut points = String::new();
            for (share, ns) in measurement.ns.curve() {
                let _ = write!(points, "{:.1},{:.1} ", x(-(1.0 - share).max(least).log10()), y(ns as f64));
            }
            let _ = writeln!(
                svg,
                "<polyline fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.6\"{dashes} points=\"{}\"/>\n\
                 <line x1=\"{:.1}\" y1=\"{row:.1}\" x2=\"{:.1}\" y2=\"{row:.1}\" stroke=\"{colour}\" \
                 stroke-width=\"2\"{dashes}/><text x=\"{:.1}\" y=\"{:.1}\">{}</text>",
                points.trim_end(),
                right + 16.0,
                right + 46.0,
                right + 54.0,
                row + 4.0,
                escape(&measurement.what)
            );
            row += LINE;
        }
        row += LINE / 2.0;
    }
    svg.push_str("</svg>\n");
    svg
}

/// Lines of at most so many characters, broken between words.
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

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Distribution;
    use crate::host::HostShare;

    fn measured(name: &str, what: &str, samples: Vec<u64>) -> Measurement {
        Measurement {
            name: name.to_string(),
            what: what.to_string(),
            ns: Distribution::of(samples),
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
    fn every_measurement_is_a_curve_that_rises_and_stays_in_its_frame() {
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
    fn a_long_line_about_the_machine_is_broken_between_words() {
        assert_eq!(wrapped("one two three four", 9), ["one two", "three", "four"]);
        assert_eq!(wrapped("", 9), Vec::<String>::new());
    }

    #[test]
    fn nothing_measured_is_an_empty_frame_and_no_fault() {
        assert!(curves(&plot("nothing", &[])).is_empty());
    }
}
