//! `motorium model`: trained networks.

mod check;
mod eval;
mod import;

use std::process::ExitCode;

/// Run trained networks from ONNX files, import policies, and check them against robots.
///
/// Example: motorium model eval policy.onnx --inputs in.json --json
#[derive(Debug, clap::Args)]
pub(crate) struct Model {
    #[command(subcommand)]
    command: Command,
}

// The help of each is that of its own type: a doc comment on a variant would hide it.
#[derive(Debug, clap::Subcommand)]
enum Command {
    Eval(eval::Eval),
    Check(check::Check),
    Import(import::Import),
}

impl Model {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        match self.command {
            Command::Eval(command) => command.run(),
            Command::Check(command) => command.run(),
            Command::Import(command) => command.run(),
        }
    }
}
