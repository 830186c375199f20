//! `motorium reproduce`: published figures, computed anew.

pub(super) mod chart;

use std::process::ExitCode;

/// Compute published figures anew, and say where their claims hold.
#[derive(Debug, clap::Args)]
pub(crate) struct Reproduce {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, clap::Subcommand)]
enum Command {}

impl Reproduce {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        match self.command {}
    }
}
