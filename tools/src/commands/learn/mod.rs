//! `motorium learn`: training of policies, and tuning of graphs.

mod compare;
mod curves;
mod evaluate;
mod imitate;
mod list;
mod operator;
pub(crate) mod threads;
mod train;
mod tune;
mod warnings;

use std::process::ExitCode;

/// Train, evaluate and compare policies on tasks, list tasks, and tune graphs.
///
/// Example: motorium learn train tasks/cart-pole.toml --seed 1 --output out/cart-pole
#[derive(Debug, clap::Args)]
pub(crate) struct Learn {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    Train(train::Train),
    Resume(train::Resume),
    Evaluate(evaluate::Evaluate),
    Compare(compare::Compare),
    Imitate(imitate::Imitate),
    Tune(tune::Tune),
    List(list::List),
}

impl Learn {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        match self.command {
            Command::Train(command) => command.run(),
            Command::Resume(command) => command.run(),
            Command::Evaluate(command) => command.run(),
            Command::Compare(command) => command.run(),
            Command::Imitate(command) => command.run(),
            Command::Tune(command) => command.run(),
            Command::List(command) => command.run(),
        }
    }
}
