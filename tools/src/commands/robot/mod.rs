//! `motorium robot`: commands for robots of the catalogue, installed robots, and robot files.

mod bench;
mod check;
mod draw;
mod eval;
mod facts;
mod hulls;
mod install;
mod list;
mod pose;
mod profile;
mod show;
mod source;
mod urdf_text;

use std::process::ExitCode;

pub(super) use draw::size;

/// Show, check and draw robots: the catalogue's, installed ones, and any URDF or MJCF file.
///
/// Example: motorium robot draw panda --output panda.svg
#[derive(Debug, clap::Args)]
pub(crate) struct Robot {
    #[command(subcommand)]
    command: Command,
}

// Each help text is on the argument type: a doc comment on a variant would hide it.
#[derive(Debug, clap::Subcommand)]
enum Command {
    List(list::List),
    Show(show::Show),
    Check(check::Check),
    Draw(draw::Draw),
    Bench(bench::Bench),
    Eval(eval::Eval),
    Profile(profile::Profile),
    Hulls(hulls::Hulls),
    Install(install::Install),
}

impl Robot {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        match self.command {
            Command::List(command) => command.run(),
            Command::Show(command) => command.run(),
            Command::Check(command) => command.run(),
            Command::Draw(command) => command.run(),
            Command::Bench(command) => command.run(),
            Command::Eval(command) => command.run(),
            Command::Profile(command) => command.run(),
            Command::Hulls(command) => command.run(),
            Command::Install(command) => command.run(),
        }
    }
}
