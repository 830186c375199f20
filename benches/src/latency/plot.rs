//! Latency against percentile, both on scales that show the tail, as SVG.

use std::fmt::Write as _;

use super::Measurement;

const WIDTH: f64 = 1080.0;
const HEIGHT: f64 = 560.0;
const LEFT: f64 = 70.0;
const RIGHT: f64 = 450.0;
const TOP: f64 = 40.0;
const BOTTOM: f64 = 60.0;
/// Twelve colours that can be told apart on white (Tol's "bright" and "muted").
const COLOURS: [&str; 12] = [
    "#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee", "#aa3377", "#332288", "#88ccee", "#44aa99",
    "#999933", "#cc6677", "#882255",
];

/// Draws the curves of some measurements. The horizontal axis counts nines: 90 %, 99 %, 99.9 % are equally far apart.
pub fn plot(title: &str, measurements: &[&Measurement]) -> String {
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
         <text x=\"{LEFT}\" y=\"24\">{}</text>\n",
        escape(title)
    );
    let (left, right, top, bottom) = (LEFT, WIDTH - RIGHT, TOP, HEIGHT - BOTTOM);
    for power in low as i32..=high as i32 {
        let at = y(10f64.powi(power));
        let _ = writeln!(
            svg,
            "<line x1=\"{left}\" y1=\"{at:.1}\" x2=\"{right}\" y2=\"{at:.1}\" stroke=\"#ddd\"/>\
             <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            left - 6.0,
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
    for (i, measurement) in measurements.iter().enumerate() {
        let colour = COLOURS[i % COLOURS.len()];
        let dash = if i < COLOURS.len() { "" } else { " stroke-dasharray=\"5 3\"" };
        let mut points = String::new();
        for (share, ns) in measurement.ns.curve() {
            // The last sample has no share above it: it stands at the end of the axis for its count.
            let above = (1.0 - share).max(1.0 / measurement.ns.count.max(1) as f64);
            let _ = write!(points, "{:.1},{:.1} ", x(-above.log10()), y(ns as f64));
        }
        let row = TOP + 16.0 * i as f64 + 8.0;
        let _ = writeln!(
            svg,
            "<polyline fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.5\"{dash} points=\"{}\"/>\n\
             <line x1=\"{:.1}\" y1=\"{row:.1}\" x2=\"{:.1}\" y2=\"{row:.1}\" stroke=\"{colour}\" \
             stroke-width=\"2\"{dash}/><text x=\"{:.1}\" y=\"{:.1}\">{}</text>",
            points.trim_end(),
            right + 12.0,
            right + 34.0,
            right + 40.0,
            row + 4.0,
            escape(&measurement.what)
        );
    }
    svg.push_str("</svg>\n");
    svg
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

    fn measured(what: &str, samples: Vec<u64>) -> Measurement {
        Measurement {
            name: "x".to_string(),
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
        let (fast, slow) =
            (measured("a < b", (1..5_000).collect()), measured("c", (1..5_000).map(|n| n * n).collect()));
        let curves = curves(&plot("latency", &[&fast, &slow]));
        assert_eq!(curves.len(), 2);
        for curve in &curves {
            assert!(curve.windows(2).all(|pair| pair[0].0 <= pair[1].0 && pair[0].1 >= pair[1].1));
            for (x, y) in curve {
                assert!((LEFT..=WIDTH - RIGHT + 0.1).contains(x), "{x}");
                assert!((TOP - 0.1..=HEIGHT - BOTTOM + 0.1).contains(y), "{y}");
            }
        }
    }

    #[test]
    fn nothing_measured_is_an_empty_frame_and_no_fault() {
        assert!(curves(&plot("nothing", &[])).is_empty());
    }
}
