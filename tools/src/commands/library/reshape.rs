//! `motorium library split`, `merge` and `update`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use motorium_library::{
    MotionLibrary, RecursiveLibrary, file, merge_independent, merge_movements, merge_parts,
};

use super::build::TruncationOptions;
use super::source::Source;
use crate::out::{errln, outln};
use crate::output::Overwrite;
use crate::style;
use crate::values::at_least;

/// Extract libraries of body parts from a library of the whole body, without the recordings.
///
/// Example: motorium library split body.library arms='larm*,rarm*' left='l*' --output parts
#[derive(Debug, clap::Args)]
pub(super) struct Split {
    /// The library
    file: PathBuf,
    /// Parts: NAME=PATTERN[,PATTERN...]; a pattern is the name of a degree of freedom, or a prefix and `*`
    #[arg(required = true)]
    parts: Vec<String>,
    /// The folder to write to: NAME.library for each part
    #[arg(long, short, value_name = "DIR", default_value = ".")]
    output: PathBuf,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl Split {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let library = file::read(&self.file)?;
        let parts: Vec<_> =
            self.parts.iter().map(|part| library.layout().part(part)).collect::<Result<_, _>>()?;
        let is_name = |name: &str| Path::new(name).file_name().is_some_and(|file| file == name);
        if let Some(part) = parts.iter().find(|part| !is_name(&part.name)) {
            anyhow::bail!(
                "the part `{}` is not the name of a file, expected NAME=PATTERN such as left=l*",
                part.name
            );
        }
        let path = |name: &str| self.output.join(format!("{name}.library"));
        let paths: Vec<PathBuf> = parts.iter().map(|part| path(&part.name)).collect();
        self.overwrite.check([&self.file], &paths)?;
        let splits: Vec<MotionLibrary> =
            parts.iter().map(|part| library.split(part)).collect::<Result<_, _>>()?;
        let mut all = Vec::new();
        for (split, path) in splits.into_iter().zip(paths) {
            super::output::write(&split, &path)?;
            if self.json {
                all.push(super::output::summary(&split, Some(&path)));
            } else {
                super::output::show(&split, Some(&path), false)?;
            }
        }
        if self.json {
            outln!("{}", serde_json::to_string_pretty(&all)?);
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Merge several libraries into one.
///
/// Libraries with the same degrees of freedom become a library of all their movements. Libraries with
/// different degrees of freedom become a library of the whole body. Its parts are correlated if all were
/// learned from the same movements.
///
/// Example: motorium library merge left.library right.library --independent --output body.library
#[derive(Debug, clap::Args)]
pub(super) struct Merge {
    /// The libraries
    #[arg(required = true, num_args = 2..)]
    files: Vec<PathBuf>,
    /// The file to write
    #[arg(long, short)]
    output: PathBuf,
    /// Treat the parts of a body as independent, even if they were learned from the same movements
    #[arg(long)]
    independent: bool,
    #[command(flatten)]
    truncation: TruncationOptions,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl Merge {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        self.overwrite.check(&self.files, [&self.output])?;
        let libraries: Vec<MotionLibrary> =
            self.files.iter().map(|path| file::read(path)).collect::<Result<_, _>>()?;
        let all: Vec<&MotionLibrary> = libraries.iter().collect();
        let same = all.iter().all(|library| library.layout() == all[0].layout());
        let truncation = self.truncation.truncation();
        let merged = match (same, self.independent) {
            (true, _) => merge_movements(&all, truncation)?,
            (false, true) => merge_independent(&all, truncation)?,
            (false, false) => merge_parts(&all, truncation)?,
        };
        super::output::write(&merged, &self.output)?;
        super::output::show(&merged, Some(&self.output), self.json)
    }
}

/// Add recordings to a library one by one, without its training recordings.
///
/// Example: motorium library update letters.library more.jsonl --output letters.library --overwrite
#[derive(Debug, clap::Args)]
pub(super) struct Update {
    /// The library
    file: PathBuf,
    #[command(flatten)]
    source: Source,
    /// The file to write
    #[arg(long, short)]
    output: PathBuf,
    /// Maximum number of eigenforces to keep: about twice the number in use
    #[arg(long, default_value_t = 50, value_parser = at_least(1))]
    capacity: usize,
    /// Factor on the weight of earlier movements per new movement; 1 forgets nothing
    #[arg(long, default_value_t = 1.0)]
    forgetting: f64,
    #[command(flatten)]
    overwrite: Overwrite,
    /// Print as JSON
    #[arg(long)]
    json: bool,
}

impl Update {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        anyhow::ensure!(
            self.forgetting > 0.0 && self.forgetting <= 1.0,
            "--forgetting is {}, expected a number above 0 and at most 1",
            self.forgetting
        );
        // the library itself may be replaced
        self.overwrite.check(&self.source.data, [&self.output])?;
        let library = file::read(&self.file)?;
        let recordings = self.source.read()?;
        anyhow::ensure!(
            recordings.names == library.layout().names(),
            "the recordings have the degrees of freedom {}, but the library has {}",
            recordings.names.join(", "),
            library.layout().names().join(", ")
        );
        let had = library.rank();
        let mut recursive = RecursiveLibrary::new(library, self.capacity, self.forgetting);
        for trajectory in &recordings.trajectories {
            recursive.add(trajectory)?;
        }
        let updated = recursive.into_library();
        if had > self.capacity {
            errln!(
                "{}: {} of the {had} eigenforces of {} are kept; --capacity {had} keeps all",
                style::warning("warning"),
                updated.rank(),
                self.file.display()
            );
        }
        super::output::write(&updated, &self.output)?;
        super::output::show(&updated, Some(&self.output), self.json)
    }
}
