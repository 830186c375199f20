//! `motorium library couple`: trains a coupling from pictures of letters to their movements.

use std::io::IsTerminal as _;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use indicatif::{ProgressBar, ProgressStyle};
use motorium_learners::perception::{Coupling, Training};
use motorium_library::{DAMPING, SampledSpring};

use super::source::Source;
use crate::out::outln;
use crate::output::{Overwrite, make_folder};

/// Train a network that writes letters from their pictures.
///
/// Learns from letters with two coordinates, for `motorium library write` and `policy.library`.
///
/// Example: motorium library couple letters.jsonl --output letters.coupling
#[derive(Debug, clap::Args)]
pub(super) struct Couple {
    #[command(flatten)]
    source: Source,
    /// The file to write
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Number of weights per letter
    #[arg(long, default_value_t = Training::default().eigenforces, value_name = "N")]
    eigenforces: usize,
    /// Number of passes over all letters
    #[arg(long, default_value_t = Training::default().epochs, value_name = "N")]
    epochs: usize,
    /// Seed of the network and of the order of the letters
    #[arg(long, default_value_t = Training::default().seed)]
    seed: u64,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

/// Samples of a letter.
const SAMPLES: usize = 100;

impl Couple {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        self.overwrite.check(&self.source.data, [&self.output])?;
        let letters = self.source.read()?;
        let dofs = letters.names.len();
        anyhow::ensure!(
            dofs == 2,
            "letters have two degrees of freedom, but these recordings have {dofs}: choose two with --columns"
        );
        anyhow::ensure!(self.epochs > 0, "--epochs is 0, expected at least 1");
        let spring = SampledSpring::new(SAMPLES, DAMPING)?;
        let training = Training {
            eigenforces: self.eigenforces,
            epochs: self.epochs,
            seed: self.seed,
            ..Training::default()
        };
        let shown = !self.json && std::io::stderr().is_terminal();
        let bar = if shown { ProgressBar::new(self.epochs as u64) } else { ProgressBar::hidden() };
        if let Ok(style) = ProgressStyle::with_template("epoch {pos} of {len} {bar:40} {elapsed}, loss {msg}")
        {
            bar.set_style(style);
        }
        let mut losses = Vec::new();
        let coupling = Coupling::train(&letters, spring, &training, |_, loss| {
            losses.push(loss);
            bar.set_message(format!("{loss:.2e}"));
            bar.inc(1);
        })?;
        bar.finish_and_clear();
        make_folder(&self.output)?;
        coupling.write(&self.output).with_context(|| self.output.display().to_string())?;
        let (first, last) = (losses[0], losses[losses.len() - 1]);
        if self.json {
            let report = serde_json::json!({
                "file": self.output.display().to_string(),
                "letters": letters.trajectories.len(),
                "eigenforces": coupling.library().rank(),
                "epochs": self.epochs,
                "loss": { "first": first, "last": last },
                "pen_speed": coupling.pen_speed(),
            });
            outln!("{}", serde_json::to_string_pretty(&report)?);
            return Ok(ExitCode::SUCCESS);
        }
        outln!(
            "{}: {} letters, {} weights each; squared error of position {first:.4} after the first epoch, {last:.4} after {} \
             (letter sizes); it writes at {:.2} letter sizes per second by default",
            self.output.display(),
            letters.trajectories.len(),
            coupling.library().rank(),
            self.epochs,
            coupling.pen_speed(),
        );
        Ok(ExitCode::SUCCESS)
    }
}
