//! Charts as SVG and PNG: lines with errors, panels over time, paths in tiles, and latencies against
//! percentiles.

mod axis;
mod families;
mod font;
mod latency;
mod panels;
mod raster;
mod svg;
mod theme;
mod tiles;

use std::fmt::Write as _;

pub use axis::number;
pub use latency::{Latencies, latencies};
pub use panels::{Panel, panels};
pub use tiles::{Tile, tiles};

/// One line of a chart.
#[derive(Clone, Debug)]
pub struct Series {
    /// Text of the legend; empty for a series without one.
    pub name: String,
    /// Points: x, y, and half the length of the error bar, or 0 without an error bar.
    pub points: Vec<[f64; 3]>,
}

/// A chart with one x axis and one y axis, both named with their units.
#[derive(Clone, Debug)]
pub struct Chart {
    /// Text above the plot.
    pub title: String,
    /// Name of the x axis, with its unit.
    pub x: String,
    /// Name of the y axis, with its unit.
    pub y: String,
    /// Logarithmic x axis; values that are not positive are drawn at its lower end.
    pub log_x: bool,
    /// Logarithmic y axis; values that are not positive are drawn at its lower end.
    pub log_y: bool,
    /// Lines in the order of the legend.
    pub series: Vec<Series>,
}

impl Chart {
    /// Returns the numbers as CSV: series, x, y, error.
    pub fn csv(&self) -> String {
        let mut csv = String::from("series,x,y,error\n");
        for series in &self.series {
            for [x, y, bar] in &series.points {
                let _ = writeln!(csv, "{},{x},{y},{bar}", series.name.replace(',', ";"));
            }
        }
        csv
    }
}
