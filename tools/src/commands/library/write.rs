//! `motorium library write`: the movement that writes a letter from its picture.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use motorium_learners::perception::{Coupling, Picture, length};
use motorium_pictures::chart::{Tile, tiles};
use nalgebra::DMatrix;

use crate::out::{out, outln};
use crate::output::{Overwrite, check_format, write_file};
use crate::values::positive;

/// Write a letter from its picture, by a coupling that `motorium library couple` trained.
///
/// A picture shows no speed: the pen moves evenly along the stroke, at the average speed of the learned
/// letters or at `--pen-speed`.
///
/// Example: motorium library write letters.coupling a.pgm --size 0.1 --output a.csv
#[derive(Debug, clap::Args)]
pub(super) struct Write {
    /// The coupling
    #[arg(value_name = "COUPLING")]
    coupling: PathBuf,
    /// The picture: a grey map (.pgm) of one letter, dark on light or light on dark
    #[arg(value_name = "PICTURE")]
    picture: PathBuf,
    /// Larger side of the written letter, m (or any other unit)
    #[arg(long, default_value_t = 1.0, value_parser = positive)]
    size: f64,
    /// Speed of the pen, in units of the size per second
    #[arg(long, value_name = "SPEED", value_parser = positive)]
    pen_speed: Option<f64>,
    /// Write to this CSV file instead of standard output
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Draw the letter into this SVG file
    #[arg(long, value_name = "SVG")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl Write {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let outputs = self.output.iter().chain(&self.plot);
        self.overwrite.check([&self.coupling, &self.picture], outputs)?;
        self.output.iter().try_for_each(|output| check_format(output, &["csv"]))?;
        self.plot.iter().try_for_each(|plot| check_format(plot, &["svg"]))?;
        let coupling = Coupling::read(&self.coupling)?;
        let picture = Picture::read(&self.picture)?;
        let movement = coupling.written(&picture, self.pen_speed.map(|speed| speed / self.size));
        let path = movement.path(coupling.library()) * self.size;
        let duration = movement.frame.duration;
        let speeds = speeds(&path, duration);
        let (mean, most) = (length(&path) / duration, speeds.iter().copied().fold(0.0, f64::max));
        if let Some(plot) = &self.plot {
            let name =
                self.picture.file_stem().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            let found = path.row_iter().map(|row| [row[0], row[1]]).collect();
            let drawn = tiles("", &[Tile { name, known: Vec::new(), found }], 1);
            write_file(plot, drawn)?;
        }
        if let Some(output) = &self.output {
            write_file(output, csv(&path, duration))?;
        }
        if self.json {
            let report = serde_json::json!({
                "duration_s": duration,
                "length": length(&path),
                "pen_speed": { "mean": mean, "largest": most },
                "weights": movement.weights,
                "x": path.column(0).as_slice(),
                "y": path.column(1).as_slice(),
            });
            outln!("{}", serde_json::to_string_pretty(&report)?);
        } else if self.output.is_none() && self.plot.is_none() {
            out!("{}", csv(&path, duration));
        } else {
            let wrote = |what: &str, file: &Option<PathBuf>| {
                file.as_deref().map_or_else(String::new, |file: &Path| format!("{what} {}\n", file.display()))
            };
            out!("{}{}", wrote("wrote", &self.output), wrote("drew", &self.plot));
            outln!(
                "{duration:.3} s, {:.3} long, pen speed {mean:.3} per second on average, {most:.3} at most",
                length(&path)
            );
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Returns the speed of each step of a path.
fn speeds(path: &DMatrix<f64>, duration: f64) -> Vec<f64> {
    let step = duration / (path.nrows() - 1).max(1) as f64;
    (1..path.nrows()).map(|k| (path.row(k) - path.row(k - 1)).norm() / step).collect()
}

fn csv(path: &DMatrix<f64>, duration: f64) -> String {
    let step = duration / (path.nrows() - 1).max(1) as f64;
    let rows =
        path.row_iter().enumerate().map(|(k, row)| format!("{},{},{}\n", k as f64 * step, row[0], row[1]));
    std::iter::once("t,x,y\n".to_string()).chain(rows).collect()
}
