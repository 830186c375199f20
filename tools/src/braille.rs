//! Charts for the terminal, in characters of eight dots.

use motorium_pictures::chart::{Chart, number};
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};
use ratatui::symbols::Marker;
use ratatui::text::Line;
use ratatui::widgets::{Axis, Dataset, GraphType, Widget as _};

/// The colours of the lines, in turn.
const COLOURS: [Color; 12] = [
    Color::Blue,
    Color::Red,
    Color::Green,
    Color::Yellow,
    Color::Magenta,
    Color::Cyan,
    Color::LightBlue,
    Color::LightRed,
    Color::LightGreen,
    Color::LightYellow,
    Color::LightMagenta,
    Color::LightCyan,
];

/// Rows of the smallest chart.
const LEAST_ROWS: u16 = 10;

/// A chart as text of the given columns and rows, with its title above and its names and last values below;
/// with colour escape codes if the terminal supports them.
pub(crate) fn braille(chart: &Chart, (columns, rows): (u16, u16), colour: bool) -> String {
    let points: Vec<Vec<(f64, f64)>> =
        chart.series.iter().map(|series| series.points.iter().map(|[x, y, _]| (*x, *y)).collect()).collect();
    let bounds = |pick: fn(&(f64, f64)) -> f64| {
        let values = points.iter().flatten().map(pick).filter(|value| value.is_finite());
        let [low, high] = values
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(value), high.max(value)]);
        if low < high { [low, high] } else { [low.min(0.0) - 1e-9, high.max(0.0) + 1e-9] }
    };
    let (x, y) = (bounds(|point| point.0), bounds(|point| point.1));
    let ends = |[low, high]: [f64; 2]| [number(low), number(high)].map(Line::from).to_vec();
    let sets = points.iter().enumerate().map(|(index, points)| {
        Dataset::default()
            .marker(Marker::Braille)
            .graph_type(GraphType::Line)
            .style(Style::new().fg(COLOURS[index % COLOURS.len()]))
            .data(points)
    });
    let legend = legend(chart, columns.into(), colour);
    // The rows include title and legend.
    let around = 1 + u16::try_from(legend.lines().count()).unwrap_or(u16::MAX);
    let rows = rows.saturating_sub(around).max(LEAST_ROWS);
    let area = Rect::new(0, 0, columns, rows);
    let mut buffer = Buffer::empty(area);
    ratatui::widgets::Chart::new(sets.collect())
        .x_axis(Axis::default().bounds(x).labels(ends(x)))
        .y_axis(Axis::default().bounds(y).labels(ends(y)))
        .render(area, &mut buffer);
    let title = [chart.title.as_str(), &chart.y].into_iter().filter(|part| !part.is_empty());
    let mut text = format!("{}; across: {}\n", title.collect::<Vec<_>>().join(": "), chart.x);
    for row in 0..rows {
        let mut line = String::new();
        let mut before = Color::Reset;
        for column in 0..columns {
            let cell = &buffer[(column, row)];
            if colour && cell.fg != before {
                before = cell.fg;
                line += code(before);
            }
            line += cell.symbol();
        }
        if before != Color::Reset {
            line += code(Color::Reset);
        }
        text += line.trim_end();
        text.push('\n');
    }
    text + &legend
}

/// The legend: the name of each line with its colour and last value, in as many columns as fit.
fn legend(chart: &Chart, columns: usize, colour: bool) -> String {
    let width = |text: &str| text.chars().count();
    let longest = chart.series.iter().map(|series| width(&series.name)).max().unwrap_or(0);
    let entries: Vec<String> = (chart.series.iter().enumerate())
        .map(|(index, series)| {
            let last = series.points.last().map_or_else(|| "-".to_string(), |point| number(point[1]));
            let (on, off) =
                if colour { (code(COLOURS[index % COLOURS.len()]), code(Color::Reset)) } else { ("", "") };
            format!("{on}\u{2500}\u{2500}{off} {:longest$} {last:>8}", series.name)
        })
        .collect();
    let many = (columns / (longest + 14)).clamp(1, entries.len().max(1));
    let lines = entries.len().div_ceil(many);
    let line =
        |row: usize| entries.iter().skip(row).step_by(lines.max(1)).cloned().collect::<Vec<_>>().join("  ");
    (0..lines).map(|row| line(row) + "\n").collect()
}

/// The escape code of a colour.
fn code(colour: Color) -> &'static str {
    match colour {
        Color::Blue => "\u{1b}[34m",
        Color::Red => "\u{1b}[31m",
        Color::Green => "\u{1b}[32m",
        Color::Yellow => "\u{1b}[33m",
        Color::Magenta => "\u{1b}[35m",
        Color::Cyan => "\u{1b}[36m",
        Color::LightBlue => "\u{1b}[94m",
        Color::LightRed => "\u{1b}[91m",
        Color::LightGreen => "\u{1b}[92m",
        Color::LightYellow => "\u{1b}[93m",
        Color::LightMagenta => "\u{1b}[95m",
        Color::LightCyan => "\u{1b}[96m",
        _ => "\u{1b}[0m",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motorium_pictures::chart::Series;

    #[test]
    fn a_line_rises_from_the_lower_left_to_the_upper_right() {
        let points = (0..100).map(|i| [f64::from(i), f64::from(i) * 2.0, 0.0]).collect();
        let chart = Chart {
            title: String::new(),
            x: "time, s".into(),
            y: "q".into(),
            log_x: false,
            log_y: false,
            series: vec![Series { name: "rise".into(), points }],
        };
        let text = braille(&chart, (60, 15), false);
        let is_dot = |character: char| ('\u{2801}'..='\u{28ff}').contains(&character);
        let column = |line: &str| line.chars().position(is_dot);
        let columns: Vec<usize> = text.lines().filter_map(column).collect();
        assert!(columns.len() > 8, "{text}");
        assert!(columns.first().unwrap() > columns.last().unwrap(), "{text}");
        assert!(text.contains("rise") && text.contains("198") && !text.contains('\u{1b}'), "{text}");
        assert!(text.starts_with("q; across: time, s\n"), "{text}");
    }

    #[test]
    fn legend_names_every_line_in_its_colour() {
        let series = |index: usize| Series {
            name: format!("left_joint_{index}"),
            points: vec![[0.0, index as f64, 0.0]],
        };
        let chart = Chart {
            title: String::new(),
            x: "time, s".into(),
            y: "q".into(),
            log_x: false,
            log_y: false,
            series: (0..31).map(series).collect(),
        };
        let text = braille(&chart, (80, 15), true);
        for index in 0..31 {
            let named = format!(
                "{}\u{2500}\u{2500}{} left_joint_{index} ",
                code(COLOURS[index % 12]),
                code(Color::Reset)
            );
            assert!(text.contains(&named), "{named} of {text}");
        }
        let plain = braille(&chart, (80, 15), false);
        assert!(plain.lines().all(|line| line.chars().count() <= 80), "{plain}");
    }
}
