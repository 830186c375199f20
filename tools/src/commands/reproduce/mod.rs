//! `motorium reproduce`: recomputation of published figures.

mod ball_in_cup;
mod body;
mod cartpole;
mod chapter3;
mod chapter4;
mod letters;
mod locomotion;
mod perception;
mod qp;
mod search;
mod writer;

use std::process::ExitCode;

/// Recompute published figures, and report which of their claims hold.
///
/// Example: motorium reproduce chapter3 --output out/chapter3
#[derive(Debug, clap::Args)]
pub(crate) struct Reproduce {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    Chapter3(chapter3::Chapter3),
    Chapter4(chapter4::Chapter4),
    Qp(qp::Qp),
    Locomotion(locomotion::Locomotion),
    Cartpole(cartpole::Cartpole),
    BallInCup(ball_in_cup::BallInCup),
}

impl Reproduce {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        match self.command {
            Command::Chapter3(command) => command.run(),
            Command::Chapter4(command) => command.run(),
            Command::Qp(command) => command.run(),
            Command::Locomotion(command) => command.run(),
            Command::Cartpole(command) => command.run(),
            Command::BallInCup(command) => command.run(),
        }
    }
}
