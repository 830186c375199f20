//! Charts as raster pictures.

use crate::png;

use super::font::{self, ADVANCE, BASE};
use super::svg::Layout;
use super::{Chart, theme};

/// Dots per unit of the chart.
const SCALE: f64 = 2.0;
/// Size of letters: units of the chart per unit of their grid, for 13 px text.
const LETTER: f64 = 1.45;
/// Width of a letter of the legend, in units of the chart.
pub(super) const CHARACTER: f64 = ADVANCE * LETTER;
const INK: [u8; 3] = [31, 35, 40];
const GRID: [u8; 3] = [228, 232, 236];
const FRAME: [u8; 3] = [87, 96, 106];

/// The anchored side of a text.
#[derive(Clone, Copy)]
enum Anchor {
    Begin,
    Middle,
    End,
}

/// A white canvas.
struct Canvas {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
    /// Coverage of each dot by the current line, 0 to 255.
    cover: Vec<u8>,
}

impl Canvas {
    fn new(size: [f64; 2]) -> Self {
        let [width, height] = size.map(|length| (length * SCALE).ceil() as usize);
        Self { width, height, pixels: vec![255; 3 * width * height], cover: vec![0; width * height] }
    }

    /// Draws lines of one colour, in units of the chart. Crossings are no darker than the lines.
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

    /// Covers the dots within half a width of a segment; dots on its edge partially.
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

    /// Writes a text with its baseline at `at`, in the size of `points` pixels.
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

/// Parses a colour, `#rrggbb`.
fn colour(text: &str) -> [u8; 3] {
    let channel =
        |at: usize| text.get(at..at + 2).and_then(|two| u8::from_str_radix(two, 16).ok()).unwrap_or(0);
    [channel(1), channel(3), channel(5)]
}

/// Splits a line into dashes of these stroke and gap lengths; without lengths it stays whole.
fn dashed(line: &[[f64; 2]], dashes: &[f64]) -> Vec<Vec<[f64; 2]>> {
    if dashes.is_empty() {
        return vec![line.to_vec()];
    }
    let (mut strokes, mut place, mut left) = (vec![vec![line[0]]], 0, dashes[0]);
    for ends in line.windows(2) {
        let ([x0, y0], [x1, y1]) = (ends[0], ends[1]);
        let (length, mut at) = ((x1 - x0).hypot(y1 - y0), 0.0);
        while at + left < length {
            at += left;
            let point = [x0 + (x1 - x0) * at / length, y0 + (y1 - y0) * at / length];
            match place % 2 {
                0 => strokes.last_mut().expect("a stroke has begun").push(point),
                _ => strokes.push(vec![point]),
            }
            place += 1;
            left = dashes[place % dashes.len()];
        }
        left -= length - at;
        if place % 2 == 0 {
            strokes.last_mut().expect("a stroke has begun").push([x1, y1]);
        }
    }
    strokes
}

impl Chart {
    /// Returns the chart as a PNG file: the content of [`svg`](Self::svg) at two dots per unit.
    pub fn png(&self) -> Vec<u8> {
        let layout = Layout::for_chart(self, CHARACTER);
        let Layout { left, top, width, height, .. } = layout;
        let (x, y) = (|value| layout.x(value), |value| layout.y(value));
        let mut canvas = Canvas::new(layout.size);
        let (across, along) = (layout.x_axis.ticks(6.0), layout.y_axis.ticks(6.0));
        let lines = across.iter().map(|(tick, _)| vec![[x(*tick), top], [x(*tick), top + height]]);
        let lines =
            lines.chain(along.iter().map(|(tick, _)| vec![[left, y(*tick)], [left + width, y(*tick)]]));
        canvas.lines(&lines.collect::<Vec<_>>(), 1.0, GRID);
        let corners = [[left, top], [left + width, top], [left + width, top + height], [left, top + height]];
        canvas.lines(&[corners.into_iter().chain([corners[0]]).collect()], 1.0, FRAME);
        for (tick, words) in &across {
            canvas.text(words, [x(*tick), top + height + 18.0], 13.0, Anchor::Middle);
        }
        for (tick, words) in &along {
            canvas.text(words, [left - 7.0, y(*tick) + 4.0], 13.0, Anchor::End);
        }
        canvas.text(&self.title, [left, 24.0], 15.0, Anchor::Begin);
        for (index, series) in self.series.iter().enumerate() {
            let ink = colour(theme::COLOURS[index % theme::COLOURS.len()]);
            let dashes = theme::DASHES[index % theme::DASHES.len()];
            let bars = series.points.iter().filter(|[.., bar]| *bar > 0.0);
            let bars: Vec<_> =
                bars.map(|[px, py, bar]| vec![[x(*px), y(py - bar)], [x(*px), y(py + bar)]]).collect();
            match series.has_band() {
                // Only the edges of a band are drawn.
                true => {
                    let edge = |side: usize| bars.iter().map(|bar| bar[side]).collect::<Vec<_>>();
                    canvas.lines(&[edge(0), edge(1)], 0.7, ink);
                }
                false => canvas.lines(&bars, 1.0, ink),
            }
            let mut lines: Vec<Vec<[f64; 2]>> = Vec::new();
            for run in series.runs() {
                let line: Vec<[f64; 2]> = run.iter().map(|[px, py, _]| [x(*px), y(*py)]).collect();
                // A single point is a dot.
                lines.extend(if line.len() == 1 {
                    vec![vec![line[0], line[0]]]
                } else {
                    dashed(&line, dashes)
                });
            }
            canvas.lines(&lines, 1.8, ink);
            let key = layout.key(index);
            canvas.lines(&dashed(&[key, [key[0] + 22.0, key[1]]], dashes), 3.0, ink);
            canvas.text(&layout.names[index], [key[0] + 28.0, key[1] + 4.0], 13.0, Anchor::Begin);
        }
        canvas.text(&self.x, [left + 0.5 * width, layout.size[1] - 12.0], 13.0, Anchor::Middle);
        canvas.turned_text(&self.y, [18.0, top + 0.5 * height], 13.0, Anchor::Middle, true);
        png::encode(canvas.width, canvas.height, &canvas.pixels)
    }
}
