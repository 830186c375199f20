//! `motorium primitive`: movement primitives from recordings.

mod fit;
mod numbers;
mod plot;
mod replay;
mod show;

use std::process::ExitCode;

pub(super) use numbers::per_dimension;

/// Fit movement primitives to recordings, show and replay them.
///
/// Example: motorium primitive fit demonstration.csv --output reach.json --plot reach.svg
#[derive(Debug, clap::Args)]
pub(crate) struct PrimitiveCommand {
    #[command(subcommand)]
    command: Command,
}

// Each help text is on the argument type: a doc comment on a variant would hide it.
#[derive(Debug, clap::Subcommand)]
enum Command {
    Fit(fit::Fit),
    Show(show::Show),
    Replay(replay::Replay),
}

impl PrimitiveCommand {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        match self.command {
            Command::Fit(command) => command.run(),
            Command::Show(command) => command.run(),
            Command::Replay(command) => command.run(),
        }
    }
}
