//! The subcommands, one file each.

mod check;
mod completions;
mod doctor;
mod draw;
mod loading;
mod new;
mod param;
mod run;
mod runs;
mod schema;
mod topic;

use std::process::ExitCode;

pub(crate) use run::line;

use clap::{Parser, Subcommand};

/// A zero-copy shared-memory robotics runtime.
///
/// Without a subcommand it runs graphs/panda-reach.toml: a robot arm under control through several processes.
#[derive(Debug, Parser)]
#[command(name = "motorium", version, max_term_width = 110, arg_required_else_help = false)]
pub(crate) struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Launch a graph: every component as its own process
    Run(run::Run),
    /// Check a graph file without starting anything
    Check(check::Check),
    /// Draw a graph
    Graph(draw::Draw),
    /// Look at the topics of a running graph
    Topic(topic::Topic),
    /// Look at and change the parameters of a running graph
    Param(param::Param),
    /// Is this machine fit for real time? What to change, and how
    Doctor(doctor::Doctor),
    /// Print the JSON Schema of graph files or of a report
    Schema(schema::Schema),
    /// Make a component crate and a graph that build and run at once
    New(new::New),
    /// Print a completion script for a shell
    Completions(completions::Completions),
}

impl Cli {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        match self.command {
            None => run::Run::default().run(),
            Some(Command::Run(command)) => command.run(),
            Some(Command::Check(command)) => command.run(),
            Some(Command::Graph(command)) => command.run(),
            Some(Command::Topic(command)) => command.run(),
            Some(Command::Param(command)) => command.run(),
            Some(Command::Doctor(command)) => command.run(),
            Some(Command::Schema(command)) => command.run(),
            Some(Command::New(command)) => command.run(),
            Some(Command::Completions(command)) => command.run(),
        }
    }
}
