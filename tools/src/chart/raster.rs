//! Charts as pictures of dots.

use motorium_bridges::png;

use super::font::{self, ADVANCE, BASE};
use super::{Axis, Chart, MARGIN, SIZE, number};

/// Dots per unit of the chart.
const SCALE: f64 = 2.0;
/// Size of letters: units of the chart per unit of their grid, for 13 px text.
const LETTER: f64 = 1.45;
const INK: [u8; 3] = [31, 35, 40];
const GRID: [u8; 3] = [228, 232, 236];
const FRAME: [u8; 3] = [87, 96, 106];

/// The side of a text that stands at its place.
#[derive(Clone, Copy)]
enum Anchor {
    Begin,
    Middle,
    End,
}

/// A white picture that is drawn on.
struct Canvas {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
    /// Share of each dot that the line being drawn covers, of 255.
    cover: Vec<u8>,
}

impl Canvas {
    fn new(size: [f64; 2]) -> Self {
        let [width, height] = size.map(|length| (length * SCALE).ceil() as usize);
        Self { width, height, pixels: vec![255; 3 * width * height], cover: vec![0; width * height] }
    }

    /// Draws lines of one colour, in units of the chart. Where they cross each other they are no darker.
    fn lines(&mut self, lines: &[Vec<[f64; 2]>], width: f64, colour: [u8; 3]) {
        for line in lines {
            line.windows(2).for_each(|ends| self.segment(ends[0], ends[1], width));
        }
        for (pixel, cover) in self.pixels.chunks_exact_mut(3).zip(&mut self.cover) {
            let part = u32::from(core::mem::take(cover));
            if part > 0 {
                for (channel, ink) in pixel.iter_mut().zip(colour) {
                    *channel = ((u32::from(*channel) * (255 - part) + u32::from(ink) * part) / 255) as u8;
                }
            }
        }
    }

    /// Covers the dots within half a width of a segment; those on its edge in part.
    fn segment(&mut self, from: [f64; 2], to: [f64; 2], width: f64) {
        let ([x0, y0], [x1, y1]) = (from.map(|at| at * SCALE), to.map(|at| at * SCALE));
        if ![x0, y0, x1, y1].iter().all(|at| at.is_finite()) {
            return;
        }
        let reach = 0.5 * width * SCALE + 0.5;
        let span = |a: f64, b: f64, size: usize| {
            let first = (a.min(b) - reach).floor().max(0.0) as usize;
            first..((a.max(b) + reach).ceil().max(0.0) as usize).min(size)
        };
        let (dx, dy) = (x1 - x0, y1 - y0);
        let length = (dx * dx + dy * dy).max(1e-12);
        for row in span(y0, y1, self.height) {
            for column in span(x0, x1, self.width) {
                let (px, py) = (column as f64 + 0.5 - x0, row as f64 + 0.5 - y0);
                let along = ((px * dx + py * dy) / length).clamp(0.0, 1.0);
                let distance = (px - along * dx).hypot(py - along * dy);
                let part = (255.0 * (reach - distance).clamp(0.0, 1.0)) as u8;
                let cover = &mut self.cover[row * self.width + column];
                *cover = part.max(*cover);
            }
        }
    }

    /// Writes a text that stands on `at`, in the size of `points` pixels.
    fn text(&mut self, text: &str, at: [f64; 2], points: f64, anchor: Anchor) {
        self.turned_text(text, at, points, anchor, false);
    }

    fn turned_text(&mut self, text: &str, at: [f64; 2], points: f64, anchor: Anchor, upwards: bool) {
        let unit = LETTER * points / 13.0;
        let width = (ADVANCE * text.chars().count() as f64 - (ADVANCE - 4.0)) * unit;
        let begin = match anchor {
            Anchor::Begin => 0.0,
            Anchor::Middle => -0.5 * width,
            Anchor::End => -width,
        };
        let mut lines = Vec::new();
        for (place, letter) in text.chars().enumerate() {
            let left = begin + ADVANCE * unit * place as f64;
            let stand = |[x, y]: [f64; 2]| {
                let (along, down) = (left + unit * x, unit * (y - BASE));
                if upwards { [at[0] + down, at[1] - along] } else { [at[0] + along, at[1] + down] }
            };
            lines
                .extend(font::letter(letter).map(|stroke| stroke.into_iter().map(stand).collect::<Vec<_>>()));
        }
        self.lines(&lines, 1.1 * points / 13.0, INK);
    }
}

/// The colour of `#rrggbb`.
fn colour(text: &str) -> [u8; 3] {
    let channel =
        |at: usize| text.get(at..at + 2).and_then(|two| u8::from_str_radix(two, 16).ok()).unwrap_or(0);
    [channel(1), channel(3), channel(5)]
}

impl Chart {
    /// The chart as a PNG file: what [`svg`](Self::svg) draws, two dots a unit.
    pub(crate) fn png(&self) -> Vec<u8> {
        let [left, top, right, bottom] = MARGIN;
        let (width, height) = (SIZE[0] - left - right, SIZE[1] - top - bottom);
        let points = || self.series.iter().flat_map(|series| &series.points);
        let x_axis = Axis::of(points().map(|p| p[0]), self.log_x);
        let y_axis = Axis::of(points().flat_map(|p| [p[1] - p[2], p[1], p[1] + p[2]]), self.log_y);
        let x = |value: f64| left + width * x_axis.fraction(value);
        let y = |value: f64| top + height * (1.0 - y_axis.fraction(value));
        let mut canvas = Canvas::new(SIZE);
        let across = x_axis.ticks().into_iter().map(|tick| vec![[x(tick), top], [x(tick), top + height]]);
        let along = y_axis.ticks().into_iter().map(|tick| vec![[left, y(tick)], [left + width, y(tick)]]);
        canvas.lines(&across.chain(along).collect::<Vec<_>>(), 1.0, GRID);
        let corners = [[left, top], [left + width, top], [left + width, top + height], [left, top + height]];
        canvas.lines(&[corners.into_iter().chain([corners[0]]).collect()], 1.0, FRAME);
        for tick in x_axis.ticks() {
            canvas.text(&number(tick), [x(tick), top + height + 18.0], 13.0, Anchor::Middle);
        }
        for tick in y_axis.ticks() {
            canvas.text(&number(tick), [left - 7.0, y(tick) + 4.0], 13.0, Anchor::End);
        }
        canvas.text(&self.title, [left, 24.0], 15.0, Anchor::Begin);
        for (index, series) in self.series.iter().enumerate() {
            let ink = colour(super::COLOURS[index % super::COLOURS.len()]);
            let line: Vec<[f64; 2]> = series.points.iter().map(|[px, py, _]| [x(*px), y(*py)]).collect();
            let bars = series.points.iter().filter(|[.., bar]| *bar > 0.0);
            let bars = bars.map(|[px, py, bar]| vec![[x(*px), y(py - bar)], [x(*px), y(py + bar)]]);
            let mut lines: Vec<Vec<[f64; 2]>> = bars.collect();
            // A single point is a dot.
            lines.push(if line.len() == 1 { vec![line[0], line[0]] } else { line });
            canvas.lines(&lines, 1.8, ink);
            let key = [left + width + 14.0, top + 12.0 + 20.0 * index as f64];
            canvas.lines(&[vec![key, [key[0] + 18.0, key[1]]]], 3.0, ink);
            canvas.text(&series.name, [key[0] + 24.0, key[1] + 4.0], 13.0, Anchor::Begin);
        }
        canvas.text(&self.x, [left + 0.5 * width, SIZE[1] - 12.0], 13.0, Anchor::Middle);
        canvas.turned_text(&self.y, [18.0, top + 0.5 * height], 13.0, Anchor::Middle, true);
        png::encode(canvas.width, canvas.height, &canvas.pixels)
    }
}
