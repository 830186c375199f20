//! The `motorium` command: launches and inspects component graphs.

mod braille;
mod commands;
mod complete;
mod eigenforces;
mod exit;
mod failure;
mod gate;
mod html;
mod input;
mod interrupt;
mod metrics;
mod out;
mod output;
mod overheads;
mod printer;
mod progress;
mod registry;
mod report;
mod robots;
mod rollout;
mod runs;
mod screen;
mod style;
mod trace;
mod values;
mod wrap;

use std::process::ExitCode;

use clap::FromArgMatches as _;
use motorium::program::{Program, run_worker};

pub use rollout::allowed_cores;

/// Returns the clap description of the command line, with every command, option and help text. Shell
/// completions and manual pages are generated from it.
pub fn command() -> clap::Command {
    numeric(<commands::Cli as clap::CommandFactory>::command())
}

/// Returns a command whose options accept negative numbers as values; each option validates its own.
fn numeric(command: clap::Command) -> clap::Command {
    command.allow_negative_numbers(true).mut_subcommands(numeric)
}

/// Returns the registry of the component kinds and robots that the command supports.
pub fn registry() -> motorium::worker::Registry {
    registry::registry()
}

/// Runs the command line program and returns its exit code. The binary only adds the counting allocator.
pub fn main() -> ExitCode {
    // The command that reads an argument checks it for UTF-8; it may be valid as a path.
    let arguments: Vec<String> =
        std::env::args_os().map(|argument| argument.to_string_lossy().into_owned()).collect();
    // This program is also the process of every built-in component, and the guard.
    match Program::from_arguments(&arguments) {
        Some(Program::Worker { folder, component }) => {
            let registry = registry::with_hidden();
            return run_worker(&folder, &component, |plan| match &plan.program {
                motorium::plan::Program::Builtin { kind } => registry.find(kind).copied(),
                motorium::plan::Program::Exec { .. } | motorium::plan::Program::Sibling { .. } => None,
            });
        }
        Some(Program::Guard(folder)) => return motorium::launcher::guard::main(&folder),
        Some(Program::Cleaner(folder)) => return motorium::program::clean(&folder),
        Some(Program::Describe | Program::Kinds) | None => {}
    }
    if let Some(role) = motorium_benches::Role::from_arguments(&arguments) {
        return role.run();
    }
    motorium::transport::quieten();
    // A shell's request for completions prints them and nothing else.
    clap_complete::CompleteEnv::with_factory(command).complete();
    failure::arrange(&arguments);
    let parsed = command().try_get_matches().and_then(|matches| commands::Cli::from_arg_matches(&matches));
    let command = match parsed {
        Ok(command) => command,
        Err(error) => return failure::usage(&error),
    };
    command.run().unwrap_or_else(|error| failure::Failure::from_error(&error).report())
}
