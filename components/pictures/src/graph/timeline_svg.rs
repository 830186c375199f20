//! A timeline as a picture.

use std::fmt::Write as _;

use motorium::schedule::{Activity, CoreTimeline, Lane, Timeline};

use super::labels;
use super::style::STYLE;
use super::timeline::{mark, marks, percent};
use crate::text::{escape, width};

/// Colours in addition to the graph's.
const COLOURS: &str = "
.step { fill: #3b5b8c; }
.spin { fill: #3b5b8c; fill-opacity: 0.25; }
.grid { stroke: #d5dae1; stroke-width: 1; }
.release { stroke: #0b6b63; stroke-width: 1.5; }
.late { fill: #c2410c; }
@media (prefers-color-scheme: dark) {
  .step, .spin { fill: #7fa3d9; }
  .grid { stroke: #2b323b; }
  .release { stroke: #3fd0be; }
  .late { fill: #fb923c; }
}
";

/// Margin of the page.
const MARGIN: f64 = 28.0;
/// Height below the title at which the first core begins.
const TOP: f64 = 72.0;
/// Height of the line that names a core.
const CORE: f64 = 30.0;
/// Height of the line of a component.
const LANE: f64 = 26.0;
/// Height of a bar.
const BAR: f64 = 16.0;
/// Width of the time axis.
const AXIS: f64 = 760.0;
/// Size of the text next to the bars.
const TEXT: f64 = 12.5;
/// Height below the axis: times, legend.
const BELOW: f64 = 62.0;

/// Coordinates of the parts of the picture.
struct Page {
    left: f64,
    bottom: f64,
    length_ns: u64,
}

impl Page {
    fn x(&self, ns: u64) -> f64 {
        self.left + AXIS * (ns as f64 / self.length_ns.max(1) as f64)
    }
}

/// Returns the timeline of a graph as SVG.
pub fn timeline_svg(name: &str, timeline: &Timeline) -> String {
    let lanes = || timeline.cores.iter().flat_map(|core| &core.lanes);
    let names = lanes().map(|lane| width(&label(lane), TEXT)).fold(0.0, f64::max);
    let rows = timeline.cores.len() as f64 * CORE + lanes().count() as f64 * LANE;
    let page = Page { left: MARGIN + names + 14.0, bottom: TOP + rows, length_ns: timeline.length_ns };
    let w = (page.left + AXIS + MARGIN + 20.0).ceil();
    let h = (page.bottom + BELOW + 16.0 * timeline.notes.len() as f64).ceil();
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\" width=\"{w}\" height=\"{h}\" role=\"img\">\n"
    );
    let _ = writeln!(
        svg,
        "<title>{}</title>\n<style>{STYLE}{COLOURS}</style>",
        escape(&format!("{name}: timeline"))
    );
    let _ = writeln!(
        svg,
        "<rect class=\"page\" x=\"0.5\" y=\"0.5\" width=\"{}\" height=\"{}\" rx=\"10\"/>",
        w - 1.0,
        h - 1.0
    );
    text(&mut svg, "title", MARGIN, 34.0, name);
    text(&mut svg, "fact", MARGIN, 53.0, &subtitle(timeline));
    axis(&mut svg, &page);
    let mut y = TOP;
    for core in &timeline.cores {
        draw_core(&mut svg, core, &page, &mut y);
    }
    legend(&mut svg, &page, timeline);
    svg.push_str("</svg>\n");
    svg
}

fn label(lane: &Lane) -> String {
    format!("{}  {}", lane.component, lane.priority)
}

fn subtitle(timeline: &Timeline) -> String {
    let length = labels::time(timeline.length_ns);
    let what = match timeline.hyperperiod_ns {
        Some(whole) if whole == timeline.length_ns => format!("one hyperperiod of {length}"),
        _ => format!("the first {length}"),
    };
    format!("{what}, every component using up its budget")
}

fn text(svg: &mut String, class: &str, x: f64, y: f64, content: &str) {
    let _ = writeln!(svg, "<text class=\"{class}\" x=\"{x:.1}\" y=\"{y:.1}\">{}</text>", escape(content));
}

fn axis(svg: &mut String, page: &Page) {
    for time in marks(page.length_ns) {
        let x = page.x(time);
        let _ = writeln!(
            svg,
            "<line class=\"grid\" x1=\"{x:.1}\" y1=\"{TOP}\" x2=\"{x:.1}\" y2=\"{:.1}\"/>",
            page.bottom + 4.0
        );
        let label = mark(time);
        text(svg, "small", x - width(&label, 11.0) / 2.0, page.bottom + 18.0, &label);
    }
}

fn draw_core(svg: &mut String, core: &CoreTimeline, page: &Page, y: &mut f64) {
    text(svg, "name", MARGIN, *y + CORE - 9.0, &format!("core {}", core.core));
    let idle = format!("{} left to others", percent(core.idle_ns(page.length_ns), page.length_ns));
    text(svg, "fact", page.left + 8.0, *y + CORE - 9.0, &idle);
    *y += CORE;
    for lane in &core.lanes {
        draw_lane(svg, lane, page, *y);
        *y += LANE;
    }
}

fn draw_lane(svg: &mut String, lane: &Lane, page: &Page, y: f64) {
    let top = y + (LANE - BAR) / 2.0;
    text(svg, "topic", MARGIN, top + BAR - 3.5, &lane.component);
    let priority = lane.priority.to_string();
    text(svg, "small", page.left - 10.0 - width(&priority, 11.0), top + BAR - 3.5, &priority);
    for segment in &lane.segments {
        let (class, does) = match segment.activity {
            Activity::Step | Activity::Reserved => ("step", "steps"),
            Activity::Spin => ("spin", "spins"),
        };
        let (x, end) = (page.x(segment.start_ns), page.x(segment.end_ns));
        let title =
            format!("{} {does} from {} to {}", lane.component, mark(segment.start_ns), mark(segment.end_ns));
        // bars shorter than a pixel stay visible
        let _ = writeln!(
            svg,
            "<rect class=\"{class}\" x=\"{x:.2}\" y=\"{top:.1}\" width=\"{:.2}\" height=\"{BAR}\">\
             <title>{}</title></rect>",
            (end - x).max(0.5),
            escape(&title)
        );
    }
    for release in lane.releases_ns.iter().filter(|release| **release <= page.length_ns) {
        let x = page.x(*release);
        let _ = writeln!(
            svg,
            "<line class=\"release\" x1=\"{x:.2}\" y1=\"{:.1}\" x2=\"{x:.2}\" y2=\"{:.1}\"/>",
            top - 3.0,
            top + BAR
        );
    }
    for late in &lane.late_ns {
        let _ = writeln!(
            svg,
            "<circle class=\"late\" cx=\"{:.2}\" cy=\"{:.1}\" r=\"3.5\"><title>{}</title></circle>",
            page.x(*late),
            top + BAR / 2.0,
            escape(&format!("{} is late at {}", lane.component, mark(*late)))
        );
    }
}

fn legend(svg: &mut String, page: &Page, timeline: &Timeline) {
    let y = page.bottom + 44.0;
    let mut x = page.left;
    for (class, does) in [("step", "steps"), ("spin", "spins before its release")] {
        let _ = writeln!(
            svg,
            "<rect class=\"{class}\" x=\"{x:.1}\" y=\"{:.1}\" width=\"22\" height=\"11\"/>",
            y - 10.0
        );
        text(svg, "small", x + 29.0, y, does);
        x += 29.0 + width(does, 11.0) + 20.0;
    }
    let _ = writeln!(
        svg,
        "<line class=\"release\" x1=\"{x:.1}\" y1=\"{:.1}\" x2=\"{x:.1}\" y2=\"{y:.1}\"/>",
        y - 11.0
    );
    text(svg, "small", x + 8.0, y, "is released");
    x += 8.0 + width("is released", 11.0) + 20.0;
    if timeline.cores.iter().flat_map(|core| &core.lanes).any(|lane| !lane.late_ns.is_empty()) {
        let _ = writeln!(svg, "<circle class=\"late\" cx=\"{x:.1}\" cy=\"{:.1}\" r=\"3.5\"/>", y - 4.0);
        text(svg, "small", x + 9.0, y, "ends after its next release");
    }
    for (index, note) in timeline.notes.iter().enumerate() {
        text(svg, "small", MARGIN, y + 18.0 + 16.0 * index as f64, note);
    }
}

#[cfg(test)]
mod tests {
    use motorium::schedule::Segment;

    use super::*;

    fn drawn(late: bool) -> Timeline {
        let lane = Lane {
            component: "<arm>".to_string(),
            priority: 80,
            releases_ns: vec![0, 500],
            segments: vec![
                Segment { start_ns: 0, end_ns: 250, activity: Activity::Step },
                Segment { start_ns: 400, end_ns: 500, activity: Activity::Spin },
                Segment { start_ns: 500, end_ns: 501, activity: Activity::Step },
            ],
            late_ns: if late { vec![250] } else { Vec::new() },
        };
        Timeline {
            length_ns: 1_000,
            hyperperiod_ns: Some(1_000),
            cores: vec![CoreTimeline { core: 1, lanes: vec![lane] }],
            notes: vec!["a & b".to_string()],
        }
    }

    #[test]
    fn the_picture_is_xml_with_every_segment_in_its_place() {
        let picture = timeline_svg("some <graph>", &drawn(true));
        let document = roxmltree::Document::parse(&picture).expect("well-formed XML");
        let of = |class: &str| -> Vec<_> {
            document.descendants().filter(|node| node.attribute("class") == Some(class)).collect()
        };
        let number = |node: &roxmltree::Node<'_, '_>, name: &str| -> f64 {
            node.attribute(name).and_then(|text| text.parse().ok()).expect("a number")
        };
        // the last of each belongs to the legend
        let (steps, spins) = (of("step"), of("spin"));
        assert_eq!((steps.len(), spins.len(), of("release").len(), of("late").len()), (3, 2, 3, 2));
        assert!((number(&steps[0], "width") - AXIS / 4.0).abs() < 0.01);
        let gap = number(&spins[0], "x") - number(&steps[0], "x");
        assert!((gap - AXIS * 0.4).abs() < 0.01, "{gap}");
        assert!(number(&steps[1], "width") >= 0.5, "a short step stays visible");
        let title =
            spins[0].descendants().find(|node| node.has_tag_name("title")).and_then(|node| node.text());
        assert_eq!(title, Some("<arm> spins from 400 ns to 500 ns"));
        let w: f64 = number(&document.root_element(), "width");
        for node in document.descendants().filter(|node| node.has_tag_name("rect")) {
            assert!(number(&node, "x") + number(&node, "width") <= w);
        }
    }

    #[test]
    fn legend_explains_lateness_only_if_present() {
        assert!(timeline_svg("g", &drawn(true)).contains("ends after its next release"));
        assert!(!timeline_svg("g", &drawn(false)).contains("ends after its next release"));
    }
}
