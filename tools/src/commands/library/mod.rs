//! `motorium library`: motion libraries in files.

mod build;
mod couple;
mod evaluate;
mod generate;
mod inspect;
mod letters;
mod output;
mod recognise;
mod reshape;
mod source;
mod write;

use std::process::ExitCode;

/// Learn, inspect, split, merge and use motion libraries: movements as weights of a few eigenforces.
///
/// Example: motorium library letters --output letters.jsonl && motorium library build letters.jsonl --output
/// letters.library
#[derive(Debug, clap::Args)]
pub(crate) struct Library {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    Build(build::Build),
    Inspect(inspect::Inspect),
    Split(reshape::Split),
    Merge(reshape::Merge),
    Update(reshape::Update),
    Recognise(recognise::Recognise),
    Generate(generate::Generate),
    Evaluate(evaluate::Evaluate),
    Letters(letters::Letters),
    Couple(couple::Couple),
    Write(write::Write),
}

impl Library {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        match self.command {
            Command::Build(command) => command.run(),
            Command::Inspect(command) => command.run(),
            Command::Split(command) => command.run(),
            Command::Merge(command) => command.run(),
            Command::Update(command) => command.run(),
            Command::Recognise(command) => command.run(),
            Command::Generate(command) => command.run(),
            Command::Evaluate(command) => command.run(),
            Command::Letters(command) => command.run(),
            Command::Couple(command) => command.run(),
            Command::Write(command) => command.run(),
        }
    }
}
