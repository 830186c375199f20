//! `motorium library letters`.

use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use motorium_library::letters::{ALPHABET, Variation, letters};
use motorium_pictures::chart::{Tile, tiles};

use crate::out::outln;
use crate::output::{Overwrite, check_format, make_folder, write_file};
use crate::values::at_least;

/// Generate letters from built-in strokes, with seeded variation, as recordings.
///
/// Example: motorium library letters --output letters.jsonl
#[derive(Debug, clap::Args)]
pub(super) struct Letters {
    /// The .jsonl file to write
    #[arg(long, short)]
    output: PathBuf,
    /// Number of variations of each letter
    #[arg(long, default_value_t = 10, value_parser = at_least(1))]
    each: usize,
    /// Seed; equal seeds give equal letters
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Draw the first variation of each letter into this SVG file
    #[arg(long, value_name = "SVG")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl Letters {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        self.overwrite.check(&[], [&self.output].into_iter().chain(&self.plot))?;
        check_format(&self.output, &["jsonl", "ndjson"])?;
        self.plot.iter().try_for_each(|plot| check_format(plot, &["svg"]))?;
        let set = letters(self.each, Variation::default(), self.seed);
        make_folder(&self.output)?;
        let file = std::fs::File::create(&self.output).with_context(|| self.output.display().to_string())?;
        let mut file = std::io::BufWriter::new(file);
        let round = |column: &[f64]| column.iter().map(|x| (x * 1e6).round() / 1e6).collect::<Vec<f64>>();
        for letter in &set.trajectories {
            let (x, y) =
                (round(letter.positions.column(0).as_slice()), round(letter.positions.column(1).as_slice()));
            let line = serde_json::json!({
                "id": letter.id, "label": letter.label, "duration": letter.duration, "x": x, "y": y,
            });
            writeln!(file, "{line}")?;
        }
        file.flush()?;
        if let Some(plot) = &self.plot {
            let first = set.trajectories.iter().step_by(self.each.max(1));
            let tile = |letter: &motorium_library::Trajectory| Tile {
                name: letter.id.clone(),
                known: Vec::new(),
                found: letter.positions.row_iter().map(|row| [row[0], row[1]]).collect(),
            };
            write_file(plot, tiles("", &first.map(tile).collect::<Vec<_>>(), 5))?;
        }
        let count = set.trajectories.len();
        if self.json {
            let file = self.output.display().to_string();
            outln!("{}", serde_json::json!({ "file": file, "recordings": count, "labels": ALPHABET }));
        } else {
            outln!("{count} letters ({ALPHABET}) in {}", self.output.display());
        }
        Ok(ExitCode::SUCCESS)
    }
}
