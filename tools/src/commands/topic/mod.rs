//! `motorium topic`: reads the topics of a running graph, and publishes values from outside.

mod content;
mod echo;
mod find;
mod hz;
mod info;
mod json;
mod list;
mod log;
mod pace;
mod pose;
pub(crate) mod publish;
mod text;
pub(crate) mod watch;

use std::process::ExitCode;

/// Show the topics of a running graph, and publish on topics that accept values from outside.
///
/// No component ever waits for an observer.
///
/// Example: motorium topic echo panda/joint_state --rate 2
#[derive(Debug, clap::Args)]
pub(crate) struct Topic {
    #[command(subcommand)]
    command: Command,
}

// Each help text is on the argument type: a doc comment on a variant would hide it.
#[derive(Debug, clap::Subcommand)]
enum Command {
    List(list::List),
    Echo(echo::Echo),
    Hz(hz::Hz),
    Info(info::Info),
    Pub(publish::Pub),
}

impl Topic {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        match self.command {
            Command::List(command) => command.run(),
            Command::Echo(command) => command.run(),
            Command::Hz(command) => command.run(),
            Command::Info(command) => command.run(),
            Command::Pub(command) => command.run(),
        }
    }
}
