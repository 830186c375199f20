//! `motorium completions`: completion scripts for shells.

use std::process::ExitCode;

use anyhow::Context as _;
use clap_complete::Shell;
use clap_complete::env::Shells;

use crate::out::out;

/// Print a completion script for a shell.
///
/// The script calls `motorium`, which completes commands, options and their values, graphs, robots and kinds,
/// and the topics, components and parameters of the newest run.
///
/// Example: motorium completions bash > ~/.local/share/bash-completion/completions/motorium
#[derive(Debug, clap::Args)]
pub(crate) struct Completions {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

impl Completions {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let name = self.shell.to_string();
        let shells = Shells::builtins();
        let completer = shells.completer(&name).with_context(|| format!("no completions for {name}"))?;
        let mut script = Vec::new();
        completer.write_registration("COMPLETE", "motorium", "motorium", "motorium", &mut script)?;
        out!("{}", String::from_utf8_lossy(&script));
        Ok(ExitCode::SUCCESS)
    }
}
