//! `motorium library recognise`.

use std::path::PathBuf;
use std::process::ExitCode;

use motorium_library::{Recogniser, file};

use super::source::Source;
use crate::out::outln;
use crate::values::at_least;

/// Find the nearest movement of a library for each recording, and the novelty of the recording.
///
/// Example: motorium library recognise letters.library letters.jsonl --eigenforces 8
#[derive(Debug, clap::Args)]
pub(super) struct Recognise {
    /// The library
    file: PathBuf,
    #[command(flatten)]
    source: Source,
    /// Number of eigenforces used for recognition
    #[arg(long, default_value_t = 16, value_parser = at_least(1))]
    eigenforces: usize,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl Recognise {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let library = file::read(&self.file)?;
        let recordings = self.source.read()?;
        anyhow::ensure!(
            recordings.names == library.layout().names(),
            "the recordings have the degrees of freedom {}, but the library has {}",
            recordings.names.join(", "),
            library.layout().names().join(", ")
        );
        let mut recogniser = Recogniser::new(&library, self.eigenforces);
        let mut all = Vec::new();
        let mut table =
            crate::report::table(["recording", "label", "like", "its label", "distance", "novelty"]);
        let (mut right, mut labelled) = (0, 0);
        for trajectory in &recordings.trajectories {
            let found = recogniser.recognise(trajectory);
            let like = found.nearest.map(|(index, distance)| (&library.entries()[index], distance));
            let label = like.and_then(|(entry, _)| entry.label.clone());
            if trajectory.label.is_some() {
                labelled += 1;
                right += usize::from(label == trajectory.label);
            }
            table.add_row([
                trajectory.id.clone(),
                trajectory.label.clone().unwrap_or_default(),
                like.map_or(String::new(), |(entry, _)| entry.id.clone()),
                label.clone().unwrap_or_default(),
                like.map_or(String::new(), |(_, distance)| format!("{distance:.3}")),
                format!("{:.3}", found.novelty),
            ]);
            all.push(serde_json::json!({
                "id": trajectory.id,
                "label": trajectory.label,
                "like": like.map(|(entry, _)| &entry.id),
                "like_label": label,
                "distance": like.map(|(_, distance)| distance),
                "novelty": found.novelty,
                "weights": found.weights,
            }));
        }
        if self.json {
            let report = serde_json::json!({ "recordings": all, "labelled": labelled, "right": right });
            outln!("{}", serde_json::to_string_pretty(&report)?);
        } else {
            outln!("{}", table.trim_fmt());
            if labelled > 0 {
                outln!("{right} of {labelled} labels right");
            }
        }
        Ok(ExitCode::SUCCESS)
    }
}
