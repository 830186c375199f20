//! `motorium library generate`.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use motorium_library::{MotionLibrary, Superposition, file};
use motorium_pictures::chart::{Chart, Series, Tile, tiles};

use crate::commands::primitive::per_dimension;
use crate::out::{out, outln};
use crate::output::{Overwrite, check_format, write_file};
use crate::values::{at_least, finite, fraction, positive};

/// Generate a movement: from the library, from given weights, or as a blend of two movements.
///
/// Example: motorium library generate letters.library --movement a --with d --blend 0.3 --plot between.svg
#[derive(Debug, clap::Args)]
pub(super) struct Generate {
    /// The library
    file: PathBuf,
    /// A movement of the library by its id, or the mean of a label
    #[arg(long, required_unless_present = "weights")]
    movement: Option<String>,
    /// A second movement of the library to blend with
    #[arg(long, requires = "movement")]
    with: Option<String>,
    /// Fraction of the second movement, 0 to 1
    #[arg(long, default_value_t = 0.5, value_parser = fraction)]
    blend: f64,
    /// Weights of the first eigenforces, instead of a movement; start and goal default to 0
    #[arg(
        long, value_delimiter = ',', conflicts_with = "movement", allow_hyphen_values = true, value_parser = finite
    )]
    weights: Vec<f64>,
    /// Number of eigenforces to use [default: all]
    #[arg(long, value_parser = at_least(1))]
    eigenforces: Option<usize>,
    /// Start position, one number for each degree of freedom or for all; the goal is shifted with it
    #[arg(long, value_delimiter = ',', allow_hyphen_values = true, value_parser = finite)]
    start: Vec<f64>,
    /// Goal position, one number for each degree of freedom or for all
    #[arg(long, value_delimiter = ',', allow_hyphen_values = true, value_parser = finite)]
    goal: Vec<f64>,
    /// Seconds from start to goal
    #[arg(long, value_parser = positive)]
    duration: Option<f64>,
    /// Draw the movement into this SVG file
    #[arg(long, value_name = "SVG")]
    plot: Option<PathBuf>,
    /// Write to this CSV file instead of standard output
    #[arg(long, short)]
    output: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl Generate {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        self.overwrite.check([&self.file], self.output.iter().chain(&self.plot))?;
        self.output.iter().try_for_each(|output| check_format(output, &["csv"]))?;
        self.plot.iter().try_for_each(|plot| check_format(plot, &["svg"]))?;
        let library = file::read(&self.file)?;
        let movement = self.movement(&library)?;
        let given = |option: &str, values: &[f64]| {
            let given = Some(values).filter(|values| !values.is_empty());
            given.map(|values| per_dimension(option, values, library.layout().names())).transpose()
        };
        let (start, goal) = (given("--start", &self.start)?, given("--goal", &self.goal)?);
        let movement = movement.placed(start.as_deref(), goal.as_deref(), self.duration);
        let path = movement.path(&library);
        let time = |k: usize| movement.frame.duration * k as f64 * library.spring().step();
        if let Some(plot) = &self.plot {
            write_file(plot, picture(&library, &path))?;
        }
        if self.json {
            let columns: serde_json::Map<String, serde_json::Value> = library
                .layout()
                .names()
                .iter()
                .zip(path.column_iter())
                .map(|(name, column)| (name.clone(), column.as_slice().into()))
                .collect();
            let report = serde_json::json!({
                "duration": movement.frame.duration,
                "weights": movement.weights,
                "start": movement.frame.start,
                "goal": movement.frame.goal,
                "positions": columns,
            });
            outln!("{}", serde_json::to_string_pretty(&report)?);
            return Ok(ExitCode::SUCCESS);
        }
        let mut csv = format!("t,{}\n", library.layout().names().join(","));
        for (k, row) in path.row_iter().enumerate() {
            let _ = write!(csv, "{}", time(k));
            row.iter().for_each(|value| {
                let _ = write!(csv, ",{value}");
            });
            csv.push('\n');
        }
        match &self.output {
            Some(output) => write_file(output, csv)?,
            None => out!("{csv}"),
        }
        Ok(ExitCode::SUCCESS)
    }

    fn movement(&self, library: &MotionLibrary) -> anyhow::Result<Superposition> {
        let eigenforces = self.eigenforces.unwrap_or(library.rank());
        let named = |name: &str| {
            let one = library.entries().iter().position(|entry| entry.id == name);
            one.map(|entry| Superposition::from_entry(library, entry, eigenforces))
                .or_else(|| Superposition::mean_of(library, name, eigenforces))
                .with_context(|| {
                    let mut labels: Vec<&str> =
                        library.entries().iter().filter_map(|entry| entry.label.as_deref()).collect();
                    labels.sort_unstable();
                    labels.dedup();
                    format!("no movement and no label `{name}`; the labels are {}", labels.join(", "))
                })
        };
        if let Some(name) = &self.movement {
            let first = named(name)?;
            return Ok(match &self.with {
                Some(second) => first.blend(&named(second)?, self.blend),
                None => first,
            });
        }
        anyhow::ensure!(
            self.weights.len() <= library.rank(),
            "{} weights, but the library has only {} eigenforces",
            self.weights.len(),
            library.rank()
        );
        let zero = vec![0.0; library.layout().dofs()];
        let frame = motorium_library::Frame {
            start: zero.clone(),
            goal: zero.clone(),
            velocity: zero,
            duration: 1.0,
        };
        Ok(Superposition { weights: self.weights.clone(), frame })
    }
}

/// Returns two degrees of freedom as a curve, others over time.
fn picture(library: &MotionLibrary, path: &nalgebra::DMatrix<f64>) -> String {
    let names = library.layout().names();
    if names.len() == 2 {
        let found = path.row_iter().map(|row| [row[0], row[1]]).collect();
        return tiles("", &[Tile { name: names.join(", "), known: Vec::new(), found }], 1);
    }
    let series = names.iter().zip(path.column_iter()).map(|(name, column)| Series {
        name: name.clone(),
        points: column
            .iter()
            .enumerate()
            .map(|(k, y)| [k as f64 * library.spring().step(), *y, 0.0])
            .collect(),
    });
    let (x, y) = ("time, durations".to_string(), "position, units of the recordings".to_string());
    Chart { title: String::new(), x, y, log_x: false, log_y: false, series: series.collect() }.svg()
}
