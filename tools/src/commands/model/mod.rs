//! `motorium model`: trained networks.

mod check;
mod eval;
mod import;
mod list;
mod yaml;

use std::process::ExitCode;

/// Run trained networks from ONNX files, import policies, check them against robots, and list kinds of
/// models.
///
/// Example: motorium model eval policy.onnx --inputs in.json --json
#[derive(Debug, clap::Args)]
pub(crate) struct Model {
    #[command(subcommand)]
    command: Command,
}

// Each help text is on the argument type: a doc comment on a variant would hide it.
#[derive(Debug, clap::Subcommand)]
enum Command {
    Eval(eval::Eval),
    Check(check::Check),
    List(list::List),
    Import(import::Import),
}

impl Model {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        match self.command {
            Command::Eval(command) => command.run(),
            Command::Check(command) => command.run(),
            Command::List(command) => command.run(),
            Command::Import(command) => command.run(),
        }
    }
}
