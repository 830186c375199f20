//! `motorium primitive`: movement primitives from recordings.

mod fit;
mod plot;
mod replay;
mod show;

use std::process::ExitCode;

/// Fit movement primitives to recordings, show and replay them.
///
/// Example: motorium primitive fit demonstration.csv --output reach.json --plot reach.svg
#[derive(Debug, clap::Args)]
pub(crate) struct PrimitiveCommand {
    #[command(subcommand)]
    command: Command,
}

// Each help text is on the argument type: a doc comment on a variant would hide it.
#[derive(Debug, clap::Subcommand)]
enum Command {
    Fit(fit::Fit),
    Show(show::Show),
    Replay(replay::Replay),
}

impl PrimitiveCommand {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        match self.command {
            Command::Fit(command) => command.run(),
            Command::Show(command) => command.run(),
            Command::Replay(command) => command.run(),
        }
    }
}

/// Numbers as written on the command line: `0.1,-2,3e-2`.
#[derive(Debug, Clone, PartialEq)]
struct Numbers(Vec<f64>);

/// The numbers of an option, one for each dimension; one number stands for all.
pub(super) fn per_dimension(option: &str, given: &[f64], names: &[String]) -> anyhow::Result<Vec<f64>> {
    match given {
        [all] => Ok(vec![*all; names.len()]),
        each if each.len() == names.len() => Ok(each.to_vec()),
        each => anyhow::bail!(
            "{option} has {} numbers, expected one for all, or one for each of {}",
            each.len(),
            names.join(", ")
        ),
    }
}

fn numbers(text: &str) -> Result<Numbers, String> {
    let number = |part: &str| match part.trim().parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(format!("`{part}` is not a number; expected numbers separated by commas, such as 0.1,-2")),
    };
    text.split(',').map(number).collect::<Result<_, _>>().map(Numbers)
}
