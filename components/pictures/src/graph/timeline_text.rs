//! A timeline as text: a bar for every component, whose height is its share of the core.

use std::fmt::Write as _;

use motorium::schedule::{Activity, CoreTimeline, Lane, Timeline};

use super::timeline::{mark, marks, percent};

/// Cells of a bar.
const CELLS: usize = 80;
/// Levels of a cell in eighths; any share above 0 is visible.
const LEVELS: [char; 9] = [' ', '▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
/// A cell in which a component mostly spins.
const SPINS: char = '░';

/// Returns the timeline as text, for a typeface of fixed width.
pub fn timeline_text(timeline: &Timeline) -> String {
    let names = timeline.cores.iter().flat_map(|core| &core.lanes).map(|lane| lane.component.chars().count());
    let indent = names.max().unwrap_or(0).max("core 99".len()) + 2;
    let mut text = String::new();
    for core in &timeline.cores {
        draw_core(&mut text, core, timeline.length_ns, indent);
    }
    if !timeline.cores.is_empty() {
        axis(&mut text, timeline.length_ns, indent);
        let _ = writeln!(text, "{:indent$}█ steps, {SPINS} spins before its release", "");
    }
    for note in &timeline.notes {
        let _ = writeln!(text, "{:indent$}{note}", "");
    }
    text
}

fn draw_core(text: &mut String, core: &CoreTimeline, length_ns: u64, indent: usize) {
    let idle = percent(core.idle_ns(length_ns), length_ns);
    let _ = writeln!(text, "{:<indent$}{idle} left to others", format!("core {}", core.core));
    for lane in &core.lanes {
        let bar: String = (0..CELLS).map(|cell| draw_cell(lane, cell, length_ns)).collect();
        let late = match lane.late_ns.len() {
            0 => String::new(),
            1 => "  late once".to_string(),
            times => format!("  late {times} times"),
        };
        let _ = writeln!(text, "{:<indent$}{}", lane.component, format!("{bar}{late}").trim_end());
    }
}

/// Limits of a cell, ns.
fn limits(cell: usize, length_ns: u64) -> (u64, u64) {
    let at = |cell: usize| (u128::from(length_ns) * cell as u128 / CELLS as u128) as u64;
    (at(cell), at(cell + 1))
}

fn draw_cell(lane: &Lane, cell: usize, length_ns: u64) -> char {
    let (from, to) = limits(cell, length_ns);
    let share = |activity: Activity| -> u64 {
        let first = lane.segments.partition_point(|segment| segment.end_ns <= from);
        let inside = lane.segments[first..].iter().take_while(|segment| segment.start_ns < to);
        inside
            .filter(|segment| segment.activity == activity)
            .map(|segment| segment.end_ns.min(to) - segment.start_ns.max(from))
            .sum()
    };
    let (steps, spins) = (share(Activity::Step), share(Activity::Spin));
    if spins > steps {
        return SPINS;
    }
    let eighths = (u128::from(steps) * 8).div_ceil(u128::from((to - from).max(1)));
    LEVELS[usize::try_from(eighths).unwrap_or(8).min(8)]
}

fn axis(text: &mut String, length_ns: u64, indent: usize) {
    let (mut line, mut labels) = (vec!['─'; CELLS], String::new());
    for time in marks(length_ns) {
        let column = ((u128::from(time) * CELLS as u128) / u128::from(length_ns.max(1))) as usize;
        if let Some(cell) = line.get_mut(column) {
            *cell = '┬';
        }
        let label = mark(time);
        let width = labels.chars().count();
        if column >= width {
            labels.push_str(&" ".repeat(column - width));
            labels.push_str(&label);
            labels.push(' ');
        }
    }
    let line: String = line.into_iter().collect();
    let _ = writeln!(text, "{:indent$}{line}", "");
    let _ = writeln!(text, "{:indent$}{}", "", labels.trim_end());
}

#[cfg(test)]
mod tests {
    use motorium::schedule::Segment;

    use super::*;

    fn segment(start_ns: u64, end_ns: u64, activity: Activity) -> Segment {
        Segment { start_ns, end_ns, activity }
    }

    /// A component that spins for a tenth of the period and steps for three tenths, one behind it, and one
    /// with a very short step.
    pub(super) fn drawn() -> Timeline {
        let lane = |component: &str, segments: Vec<Segment>, late_ns: Vec<u64>| Lane {
            component: component.to_string(),
            priority: 80,
            releases_ns: vec![0],
            segments,
            late_ns,
        };
        let head = vec![segment(0, 300_000, Activity::Step), segment(900_000, 1_000_000, Activity::Spin)];
        Timeline {
            length_ns: 1_000_000,
            hyperperiod_ns: Some(1_000_000),
            cores: vec![CoreTimeline {
                core: 1,
                lanes: vec![
                    lane("physics", head, Vec::new()),
                    lane("controller", vec![segment(300_000, 500_000, Activity::Step)], vec![500_000]),
                    lane("watch", vec![segment(600_000, 601_000, Activity::Step)], Vec::new()),
                ],
            }],
            notes: vec!["not real-time, not drawn: `view`".to_string()],
        }
    }

    #[test]
    fn bars_show_when_components_have_the_core() {
        let expected = "\
core 1      40 % left to others
physics     ████████████████████████                                                ░░░░░░░░
controller                          ████████████████                                          late once
watch                                                       ▁
            ┬───────────────┬───────────────┬───────────────┬───────────────┬───────────────
            0               200 us          400 us          600 us          800 us          1 ms
            █ steps, ░ spins before its release
            not real-time, not drawn: `view`
";
        assert_eq!(timeline_text(&drawn()), expected);
    }

    #[test]
    fn a_graph_without_real_time_draws_nothing() {
        let nothing =
            Timeline { length_ns: 1, hyperperiod_ns: Some(1), cores: Vec::new(), notes: Vec::new() };
        assert_eq!(timeline_text(&nothing), "");
    }
}
