//! `motorium new`: creates a component crate and a graph that are ready to build and run.

mod files;
mod name;
mod sources;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use serde::Serialize;

use crate::out::outln;
use crate::style;
use sources::Sources;

/// Create a component crate and a graph that are ready to build and run.
///
/// Example: motorium new my-controller && cd my-controller && cargo build --release && motorium run
/// graph.toml --for 2s
#[derive(Debug, clap::Args)]
pub(crate) struct New {
    /// Name of the crate: lower-case letters, digits, `-` and `_`
    name: String,
    /// Folder to create it in
    #[arg(long, value_name = "DIR", default_value = ".")]
    path: PathBuf,
    /// Print the created files as JSON
    #[arg(long)]
    json: bool,
}

/// The created crate, as JSON.
#[derive(Debug, Serialize)]
struct Made {
    name: String,
    folder: PathBuf,
    files: Vec<&'static str>,
}

impl New {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        name::check(&self.name)?;
        let sources = Sources::find();
        let files = files::files(&self.name, sources.as_ref());
        let folder = files::write(&self.path, &self.name, &files)?;
        let made = Made { name: self.name, folder, files: files.into_iter().map(|(name, _)| name).collect() };
        if self.json {
            outln!("{}", serde_json::to_string_pretty(&made)?);
        } else {
            outln!("{}", next_steps(&made, &self.path));
        }
        Ok(ExitCode::SUCCESS)
    }
}

fn next_steps(made: &Made, path: &Path) -> String {
    let folder = path.join(&made.name);
    let folder = folder.strip_prefix(".").unwrap_or(&folder).display();
    format!(
        "{} {folder}: {}\nNow:\n  cd {folder}\n  cargo test\n  cargo build --release\n  motorium run graph.toml --for 5s",
        style::good("made"),
        made.files.join(", ")
    )
}
