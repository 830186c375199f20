//! `motorium can`: CAN buses, the devices on them, and their frames.

mod attach;
mod calibrate;
mod check;
mod interface;
mod log;
mod monitor;
mod scan;
mod send;
mod serial;
mod traffic;
mod words;

use std::process::ExitCode;

/// Scan and monitor CAN buses, send frames, write logs, and check the bus load.
///
/// Example: motorium can scan can0
#[derive(Debug, clap::Args)]
pub(crate) struct Can {
    #[command(subcommand)]
    command: Command,
}

// Each help text is on the argument type: a doc comment on a variant would hide it.
#[derive(Debug, clap::Subcommand)]
enum Command {
    Scan(scan::Scan),
    Check(check::Check),
    Monitor(monitor::Monitor),
    Send(send::Send),
    Log(log::Log),
    Attach(attach::Attach),
    Calibrate(calibrate::Calibrate),
}

impl Can {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        match self.command {
            Command::Scan(command) => command.run(),
            Command::Check(command) => command.run(),
            Command::Monitor(command) => command.run(),
            Command::Send(command) => command.run(),
            Command::Log(command) => command.run(),
            Command::Attach(command) => command.run(),
            Command::Calibrate(command) => command.run(),
        }
    }
}
