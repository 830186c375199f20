//! `motorium reproduce chapter3`.

use std::path::PathBuf;
use std::process::ExitCode;

use motorium_library::{DAMPING, Metric, MotionLibrary, Recordings, SampledSpring, Truncation};
use motorium_recordings::Selection;

use super::writer::FigureWriter;
use super::{body, letters, perception, search};

/// The motion library of Delhaisse's thesis (2019), chapter 3: figures 3.9 to 3.12 and 3.14 to 3.19.
///
/// Writes each figure as CSV and SVG (bars: standard errors), and reports which claims hold for these data.
/// An interrupted run continues when started again with the same options.
///
/// Example: motorium reproduce chapter3 --data recordings/ --output out/chapter3
#[derive(Debug, clap::Args)]
pub(super) struct Chapter3 {
    /// The folder with uci-char-trajectories/train.jsonl and cmu-mocap/*.csv
    #[arg(long)]
    data: PathBuf,
    /// The folder to write to
    #[arg(long, short, value_name = "DIR", default_value = "out/chapter3")]
    output: PathBuf,
    /// Number of samples per letter
    #[arg(long, default_value_t = 200)]
    samples: usize,
    /// Number of letters, and of seeds, of each policy search
    #[arg(long, default_value_t = 10)]
    searches: usize,
    /// Number of training epochs of the network
    #[arg(long, default_value_t = 220)]
    epochs: usize,
    /// Number of networks to train, each with a different seed
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u64).range(1..=100))]
    networks: u64,
    /// Number of random splits of the letters over which position errors are averaged
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=100))]
    splits: u64,
    /// Discard the results of an earlier run in this folder, and start again
    #[arg(long)]
    restart: bool,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl Chapter3 {
    /// Returns the options, and the size of each file of the data.
    fn figures_depend_on(&self) -> serde_json::Value {
        let mut files: Vec<(String, u64)> = Vec::new();
        for folder in ["uci-char-trajectories", "cmu-mocap"] {
            let entries = std::fs::read_dir(self.data.join(folder)).into_iter().flatten().flatten();
            files.extend(entries.map(|entry| {
                let size = entry.metadata().map_or(0, |metadata| metadata.len());
                (entry.path().display().to_string(), size)
            }));
        }
        files.sort();
        serde_json::json!({
            "version": env!("CARGO_PKG_VERSION"),
            "data": files,
            "samples": self.samples,
            "searches": self.searches,
            "epochs": self.epochs,
            "networks": self.networks,
            "splits": self.splits,
        })
    }

    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let file = self.data.join("uci-char-trajectories/train.jsonl");
        let all = Recordings::read([&file], &Selection { rate: Some(200.0), ..Selection::default() })?;
        let spring = SampledSpring::new(self.samples, DAMPING)?;
        let steps = 24 + self.epochs as u64 * self.networks + 5 * self.splits;
        let of = self.figures_depend_on();
        let mut writer = FigureWriter::resuming(self.output.clone(), "chapter3", steps, of, self.restart)?;
        let (seen, held) = all.hold_out(5);
        anyhow::ensure!(
            !held.trajectories.is_empty(),
            "{}: too few letters to hold some out",
            file.display()
        );
        writer.part("letters", |writer| letters::figures(writer, &seen, &held, spring))?;
        writer.part("splits of the letters", |writer| letters::splits(writer, &all, spring, self.splits))?;
        writer.part("policy search", |writer| {
            let force = MotionLibrary::build(&seen, spring, Metric::Force, Truncation::All)?;
            search::figure(writer, &force, &held, self.searches)
        })?;
        writer.part("letters from pictures", |writer| {
            perception::figure(writer, &all, self.epochs, self.networks)
        })?;
        writer.part("movements of a body", |writer| {
            body::figures(writer, &self.data.join("cmu-mocap"), self.searches)
        })?;
        writer.finish(self.json)
    }
}
