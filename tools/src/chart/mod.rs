//! Charts as SVG and PNG: lines with errors, panels over time, paths in tiles, and latencies against
//! percentiles.

mod axis;
mod braille;
mod eigenforces;
mod families;
mod font;
mod latency;
mod panels;
mod raster;
mod svg;
mod theme;
mod tiles;

use std::fmt::Write as _;

pub(crate) use braille::braille;
pub(crate) use eigenforces::eigenforces;
pub(crate) use latency::plot;
pub(crate) use panels::{Panel, panels};
pub(crate) use tiles::{Tile, tiles};

/// One line of a chart.
#[derive(Clone, Debug)]
pub(crate) struct Series {
    pub(crate) name: String,
    /// x, y and half the length of an error bar (0: none).
    pub(crate) points: Vec<[f64; 3]>,
}

/// A chart with one x axis and one y axis, both named with their units.
#[derive(Clone, Debug)]
pub(crate) struct Chart {
    pub(crate) title: String,
    pub(crate) x: String,
    pub(crate) y: String,
    pub(crate) log_x: bool,
    pub(crate) log_y: bool,
    pub(crate) series: Vec<Series>,
}

impl Chart {
    /// Returns the numbers as CSV: series, x, y, error.
    pub(crate) fn csv(&self) -> String {
        let mut csv = String::from("series,x,y,error\n");
        for series in &self.series {
            for [x, y, bar] in &series.points {
                let _ = writeln!(csv, "{},{x},{y},{bar}", series.name.replace(',', ";"));
            }
        }
        csv
    }
}
