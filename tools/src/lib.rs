//! The `motorium` command: launches component graphs and looks into them.

mod chart;
mod commands;
mod draw;
mod exit;
mod gate;
mod metrics;
mod out;
mod overheads;
mod registry;
mod report;
mod runs;
mod screen;
mod style;

use std::process::ExitCode;

use crate::out::errln;
use clap::Parser as _;
use motorium::program::{Program, run_worker};

/// The description of the command line: every command, option and help text.
pub fn command() -> clap::Command {
    <commands::Cli as clap::CommandFactory>::command()
}

/// The whole program; its `main` only adds the allocator that counts.
pub fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().collect();
    // This program is also the process of every built-in component, and the guard.
    match Program::from_arguments(&arguments) {
        Some(Program::Worker { folder, component }) => {
            let registry = registry::with_benches();
            return run_worker(&folder, &component, |plan| match &plan.program {
                motorium::plan::Program::Builtin { kind } => registry.find(kind).copied(),
                motorium::plan::Program::Exec { .. } => None,
            });
        }
        Some(Program::Guard(folder)) => return motorium::launcher::guard::main(&folder),
        Some(Program::Describe) | None => {}
    }
    if let Some(part) = motorium_benches::Part::from_arguments(&arguments) {
        return part.run();
    }
    motorium::transport::quieten();
    let command = commands::Cli::parse();
    match command.run() {
        Ok(code) => code,
        Err(error) => {
            errln!("{}: {error:#}", style::error("error"));
            exit::FAILED
        }
    }
}
