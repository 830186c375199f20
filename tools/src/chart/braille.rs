//! Charts for the terminal, in characters of eight dots.

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};
use ratatui::symbols::Marker;
use ratatui::text::Line;
use ratatui::widgets::{Axis, Dataset, GraphType, Widget as _};

use super::Chart;
use super::axis::number;

/// The colours of the lines, in turn.
const COLOURS: [Color; 6] =
    [Color::Blue, Color::Red, Color::Green, Color::Yellow, Color::Magenta, Color::Cyan];

/// A chart as text of so many columns and rows; with escape codes for colours if the terminal shows them.
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
    let sets = chart.series.iter().zip(&points).enumerate().map(|(index, (series, points))| {
        Dataset::default()
            .name(series.name.clone())
            .marker(Marker::Braille)
            .graph_type(GraphType::Line)
            .style(Style::new().fg(COLOURS[index % COLOURS.len()]))
            .data(points)
    });
    let area = Rect::new(0, 0, columns, rows);
    let mut buffer = Buffer::empty(area);
    ratatui::widgets::Chart::new(sets.collect())
        .x_axis(Axis::default().title(chart.x.clone()).bounds(x).labels(ends(x)))
        .y_axis(Axis::default().title(chart.y.clone()).bounds(y).labels(ends(y)))
        .render(area, &mut buffer);
    let mut text = String::new();
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
    text
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
        _ => "\u{1b}[0m",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::Series;

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
    }
}
