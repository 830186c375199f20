//! Subcommands, one file each.

mod bench;
mod calibrate;
mod can;
mod check;
mod completions;
mod doctor;
mod draw;
mod events;
mod examples;
mod goto;
mod kill;
mod kinds;
mod latent;
mod learn;
mod library;
mod loading;
mod model;
mod new;
mod param;
mod play;
mod primitive;
mod qp;
mod recording;
mod reproduce;
mod robot;
mod run;
mod samples;
mod schema;
mod step;
mod stop;
mod top;
mod topic;
mod trace;
mod view;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// A zero-copy shared-memory robotics runtime.
///
/// Without a subcommand it runs graphs/panda-reach.toml: a robot arm, controlled by several processes.
#[derive(Debug, Parser)]
#[command(name = "motorium", version, max_term_width = 110, arg_required_else_help = false)]
pub(crate) struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
}

// Each help text is on the argument type: a doc comment on a variant would hide it.
#[derive(Debug, Subcommand)]
enum Command {
    Run(run::Run),
    Check(check::Check),
    Kinds(kinds::Kinds),
    Calibrate(calibrate::Calibrate),
    Graph(draw::Draw),
    Top(top::Top),
    View(view::View),
    Events(events::Events),
    Trace(trace::Trace),
    Topic(topic::Topic),
    Goto(goto::Goto),
    Param(param::Param),
    Play(play::Play),
    Replay(recording::Replay),
    Recover(recording::Recover),
    Plot(recording::Plot),
    Report(recording::Report),
    Animate(recording::Animate),
    Score(recording::Score),
    Export(recording::Export),
    Stop(stop::Stop),
    Resume(stop::Resume),
    Step(step::Step),
    Kill(kill::Kill),
    Bench(bench::Bench),
    Can(can::Can),
    Robot(robot::Robot),
    Model(model::Model),
    Primitive(primitive::PrimitiveCommand),
    Qp(qp::Qp),
    Doctor(doctor::Doctor),
    Schema(schema::Schema),
    Library(library::Library),
    Latent(latent::Latent),
    Learn(learn::Learn),
    Reproduce(reproduce::Reproduce),
    New(new::New),
    Completions(completions::Completions),
}

impl Cli {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        match self.command {
            None => run::Run::default().run(),
            Some(Command::Run(command)) => command.run(),
            Some(Command::Check(command)) => command.run(),
            Some(Command::Kinds(command)) => command.run(),
            Some(Command::Calibrate(command)) => command.run(),
            Some(Command::Graph(command)) => command.run(),
            Some(Command::Top(command)) => command.run(),
            Some(Command::View(command)) => command.run(),
            Some(Command::Events(command)) => command.run(),
            Some(Command::Trace(command)) => command.run(),
            Some(Command::Topic(command)) => command.run(),
            Some(Command::Goto(command)) => command.run(),
            Some(Command::Param(command)) => command.run(),
            Some(Command::Play(command)) => command.run(),
            Some(Command::Replay(command)) => command.run(),
            Some(Command::Recover(command)) => command.run(),
            Some(Command::Plot(command)) => command.run(),
            Some(Command::Report(command)) => command.run(),
            Some(Command::Animate(command)) => command.run(),
            Some(Command::Score(command)) => command.run(),
            Some(Command::Export(command)) => command.run(),
            Some(Command::Stop(command)) => command.run(),
            Some(Command::Resume(command)) => command.run(),
            Some(Command::Step(command)) => command.run(),
            Some(Command::Kill(command)) => command.run(),
            Some(Command::Bench(command)) => command.run(),
            Some(Command::Can(command)) => command.run(),
            Some(Command::Robot(command)) => command.run(),
            Some(Command::Model(command)) => command.run(),
            Some(Command::Primitive(command)) => command.run(),
            Some(Command::Qp(command)) => command.run(),
            Some(Command::Doctor(command)) => command.run(),
            Some(Command::Schema(command)) => command.run(),
            Some(Command::Library(command)) => command.run(),
            Some(Command::Latent(command)) => command.run(),
            Some(Command::Learn(command)) => command.run(),
            Some(Command::Reproduce(command)) => command.run(),
            Some(Command::New(command)) => command.run(),
            Some(Command::Completions(command)) => command.run(),
        }
    }
}
