//! `motorium param`: the parameters of a running graph.

mod render;

use std::process::ExitCode;

use anyhow::Context as _;
use motorium::declare::ParameterValue;
use motorium::nearest::suggest;
use motorium::transport::ParameterTable;
use serde::Serialize;

use crate::out::{errln, outln};
use crate::runs::{LivingRun, RunArg};
use crate::{exit, style};
use render::Row;

/// Show and change the parameters of a running graph.
///
/// A change takes effect between two steps of the component.
///
/// Example: motorium param set controller.frequency 1
#[derive(Debug, clap::Args)]
pub(crate) struct Param {
    #[command(subcommand)]
    command: Command,
}

// The help of each is that of its own type: a doc comment on a variant would hide it.
#[derive(Debug, clap::Subcommand)]
enum Command {
    List(List),
    Get(Get),
    Set(Set),
}

impl Param {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        match self.command {
            Command::List(command) => command.run(),
            Command::Get(command) => command.run(),
            Command::Set(command) => command.run(),
        }
    }
}

/// All parameters: value, range, unit.
///
/// Example: motorium param list --json
#[derive(Debug, clap::Args)]
struct List {
    #[command(flatten)]
    run: RunArg,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Print the value of a parameter.
///
/// Example: motorium param get controller.frequency
#[derive(Debug, clap::Args)]
struct Get {
    /// The parameter
    #[arg(value_name = "COMPONENT.PARAMETER")]
    path: String,
    #[command(flatten)]
    run: RunArg,
    /// Print the parameter with its type, range and unit as JSON
    #[arg(long)]
    json: bool,
}

/// Change a parameter.
///
/// Example: motorium param set controller.frequency 1
#[derive(Debug, clap::Args)]
struct Set {
    /// The parameter
    #[arg(value_name = "COMPONENT.PARAMETER")]
    path: String,
    /// Its new value: a number, `true` or `false`
    #[arg(value_parser = value, allow_hyphen_values = true)]
    value: ParameterValue,
    #[command(flatten)]
    run: RunArg,
    /// Print the change as JSON
    #[arg(long)]
    json: bool,
}

/// Parses a value as it is written on the command line.
fn value(text: &str) -> Result<ParameterValue, String> {
    match text {
        "true" => return Ok(ParameterValue::Boolean(true)),
        "false" => return Ok(ParameterValue::Boolean(false)),
        _ => {}
    }
    if let Ok(integer) = text.parse() {
        return Ok(ParameterValue::Integer(integer));
    }
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(ParameterValue::Float(number)),
        _ => Err("expected a finite number, `true` or `false`".to_string()),
    }
}

/// The parameters of a run.
fn parameters(run: &LivingRun) -> anyhow::Result<(ParameterTable, Vec<Row>)> {
    let table = ParameterTable::open(&run.folder.domain()?, run.plan.clone())?;
    let rows = table.list().context("reading the parameters of the run")?;
    let rows = rows.into_iter().map(|(component, plan, value)| Row::new(component, plan, value)).collect();
    Ok((table, rows))
}

/// The parameter of this name.
fn find<'a>(rows: &'a [Row], path: &str, graph: &str) -> anyhow::Result<&'a Row> {
    rows.iter().find(|row| row.name == path).ok_or_else(|| {
        if rows.is_empty() {
            return anyhow::anyhow!("graph `{graph}` has no parameters");
        }
        let advice = suggest(path, rows.iter().map(|row| row.name.as_str()), "there are");
        anyhow::anyhow!("graph `{graph}` has no parameter `{path}`; {advice}")
    })
}

impl List {
    fn run(self) -> anyhow::Result<ExitCode> {
        let run = self.run.open()?;
        let (_, rows) = parameters(&run)?;
        if self.json {
            outln!("{}", serde_json::to_string_pretty(&rows)?);
        } else if rows.is_empty() {
            errln!("graph `{}` has no parameters", run.plan.name);
        } else {
            outln!("{}", render::table(&rows));
        }
        Ok(ExitCode::SUCCESS)
    }
}

impl Get {
    fn run(self) -> anyhow::Result<ExitCode> {
        let run = self.run.open()?;
        let (_, rows) = parameters(&run)?;
        let row = find(&rows, &self.path, &run.plan.name)?;
        if self.json {
            outln!("{}", serde_json::to_string_pretty(row)?);
        } else {
            outln!("{}", row.value);
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// A change as JSON.
#[derive(Debug, Serialize)]
struct Change<'a> {
    name: &'a str,
    old: ParameterValue,
    new: ParameterValue,
    unit: &'a str,
}

impl Set {
    fn run(self) -> anyhow::Result<ExitCode> {
        let run = self.run.open()?;
        let (table, rows) = parameters(&run)?;
        let row = find(&rows, &self.path, &run.plan.name)?;
        let new = match table.set(&self.path, self.value) {
            Ok(new) => new,
            Err(error) => {
                errln!("{}: {error}; it stays {}", style::error("error"), row.with_unit(row.value));
                return Ok(exit::FAILED);
            }
        };
        if self.json {
            let change = Change { name: &row.name, old: row.value, new, unit: &row.unit };
            outln!("{}", serde_json::to_string_pretty(&change)?);
        } else {
            outln!("{}: {} -> {}", style::strong(&row.name), row.value, row.with_unit(new));
        }
        Ok(ExitCode::SUCCESS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_read_as_people_write_them() {
        assert_eq!(value("true"), Ok(ParameterValue::Boolean(true)));
        assert_eq!(value("-3"), Ok(ParameterValue::Integer(-3)));
        assert_eq!(value("2.5e-3"), Ok(ParameterValue::Float(0.0025)));
        for text in ["nan", "inf", "fast", "", "1 kHz"] {
            assert!(value(text).unwrap_err().contains("finite number"), "{text}");
        }
    }
}
