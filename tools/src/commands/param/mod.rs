//! `motorium param`: the parameters of a running graph.

mod render;

use std::process::ExitCode;

use anyhow::Context as _;
use motorium::declare::{ParameterKind, ParameterValue};
use motorium::nearest::suggest;
use motorium::transport::ParameterTable;
use serde::Serialize;

use crate::out::{errln, outln};
use crate::runs::{LivingRun, RunArg};
use crate::style;
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

// Each help text is on the argument type: a doc comment on a variant would hide it.
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

/// List all parameters: value, range, unit.
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
    #[arg(value_name = "COMPONENT.PARAMETER", add = crate::complete::parameters())]
    path: String,
    #[command(flatten)]
    run: RunArg,
    /// Print the parameter with its type, range and unit as JSON
    #[arg(long)]
    json: bool,
}

/// Change one or several parameters.
///
/// Parameters of one component that are set together take effect simultaneously. If one value is refused, no
/// parameter is changed.
///
/// Example: motorium param set policy.gait=trot policy.frequency=1.5
#[derive(Debug, clap::Args)]
struct Set {
    /// The parameter and its value, or each as COMPONENT.PARAMETER=VALUE. A value is a number, `true` or
    /// `false`, one of the choices, or an array such as `[0, 0.5]`, for which a single number applies to all
    /// entries
    #[arg(value_name = "COMPONENT.PARAMETER VALUE", required = true, num_args = 1.., allow_negative_numbers = true,
          add = crate::complete::parameters())]
    values: Vec<String>,
    #[command(flatten)]
    run: RunArg,
    /// Print the change as JSON
    #[arg(long)]
    json: bool,
}

/// Parses the parameters to set, with their values as text.
fn assignments(values: &[String]) -> anyhow::Result<Vec<(&str, &str)>> {
    if let [path, value] = values
        && !path.contains('=')
    {
        return Ok(vec![(path, value)]);
    }
    let split = |text: &'_ String| -> anyhow::Result<(usize, usize)> {
        let at = text.find('=').filter(|at| *at > 0);
        let at = at.with_context(|| format!("`{text}` is not of the form `COMPONENT.PARAMETER=VALUE`"))?;
        Ok((at, at + 1))
    };
    values.iter().map(|text| split(text).map(|(end, start)| (&text[..end], &text[start..]))).collect()
}

/// Parses a command-line value for a parameter of this kind.
fn value(text: &str, kind: ParameterKind) -> Result<ParameterValue, String> {
    match kind {
        ParameterKind::Choice => return Ok(text.into()),
        ParameterKind::Array => return array(text),
        ParameterKind::Float | ParameterKind::Integer | ParameterKind::Boolean => {}
    }
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

/// Parses numbers with or without brackets; one number without brackets is used for the whole array.
fn array(text: &str) -> Result<ParameterValue, String> {
    let inside = text.trim();
    if let Some(all) = inside.parse::<f64>().ok().filter(|all| all.is_finite()) {
        return Ok(ParameterValue::Float(all));
    }
    let inside = inside.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')).unwrap_or(inside);
    let numbers = inside.split(',').map(|number| number.trim().parse::<f64>());
    let numbers: Result<Vec<f64>, _> = numbers.collect();
    match numbers {
        Ok(numbers) if numbers.iter().all(|number| number.is_finite()) => Ok(numbers.into()),
        _ => Err(format!("`{text}`: expected finite numbers, such as `[0, 0.5]`")),
    }
}

/// Returns the parameters of a run.
fn parameters(run: &LivingRun) -> anyhow::Result<(ParameterTable, Vec<Row>)> {
    let table = ParameterTable::open(&run.folder.domain()?, run.plan.clone())?;
    let rows = table.list().context("reading the parameters of the run")?;
    let rows = rows.into_iter().map(|(component, plan, value)| Row::new(component, plan, value)).collect();
    Ok((table, rows))
}

/// Returns the parameter of this name.
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
        let run = self.run.look()?;
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
        let run = self.run.look()?;
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

/// JSON output of a change.
#[derive(Debug, Serialize)]
struct Change<'a> {
    name: &'a str,
    old: &'a ParameterValue,
    new: &'a ParameterValue,
    unit: &'a str,
}

impl Set {
    fn run(self) -> anyhow::Result<ExitCode> {
        let run = self.run.open()?;
        let (table, rows) = parameters(&run)?;
        let mut wanted = Vec::new();
        for (path, text) in assignments(&self.values)? {
            let row = find(&rows, path, &run.plan.name)?;
            let value = value(text, row.kind).map_err(|message| anyhow::anyhow!("`{path}`: {message}"))?;
            wanted.push((row, value));
        }
        let set = table.set_many(wanted.iter().map(|(row, value)| (row.name.as_str(), value.clone())));
        let new = match (set, wanted.as_slice()) {
            (Ok(new), _) => new,
            (Err(error), [(row, _)]) => {
                anyhow::bail!("{error}; the value remains {}", row.with_unit(&row.value));
            }
            (Err(error), _) => anyhow::bail!("{error}; no parameter was changed"),
        };
        let changes = wanted.iter().zip(&new).map(|((row, _), new)| Change {
            name: &row.name,
            old: &row.value,
            new,
            unit: &row.unit,
        });
        let changes: Vec<_> = changes.collect();
        match changes.as_slice() {
            [change] if self.json => outln!("{}", serde_json::to_string_pretty(change)?),
            changes if self.json => outln!("{}", serde_json::to_string_pretty(changes)?),
            _ => {
                for ((row, _), new) in wanted.iter().zip(&new) {
                    outln!("{}: {} -> {}", style::strong(&row.name), row.value, row.with_unit(new));
                }
            }
        }
        Ok(ExitCode::SUCCESS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_parsed_in_their_usual_notation() {
        let float = |text| value(text, ParameterKind::Float);
        assert_eq!(value("true", ParameterKind::Boolean), Ok(ParameterValue::Boolean(true)));
        assert_eq!(float("-3"), Ok(ParameterValue::Integer(-3)));
        assert_eq!(float("2.5e-3"), Ok(ParameterValue::Float(0.0025)));
        for text in ["nan", "inf", "fast", "", "1 kHz"] {
            assert!(float(text).unwrap_err().contains("finite number"), "{text}");
        }
        assert_eq!(value("2", ParameterKind::Choice), Ok("2".into()));
        for text in ["[1, -2.5]", "1,-2.5", " [ 1 , -2.5 ] "] {
            assert_eq!(value(text, ParameterKind::Array), Ok([1.0, -2.5].into()), "{text}");
        }
        assert_eq!(value("0.2", ParameterKind::Array), Ok(ParameterValue::Float(0.2)));
        assert_eq!(value("[0.2]", ParameterKind::Array), Ok([0.2].into()));
        for text in ["[1, nan]", "[]", "[1", "one", "nan"] {
            assert!(value(text, ParameterKind::Array).unwrap_err().contains("finite numbers"), "{text}");
        }
    }

    #[test]
    fn parameters_are_set_by_assignments_or_a_pair() {
        let owned = |texts: &[&str]| -> Vec<String> { texts.iter().map(ToString::to_string).collect() };
        let one = owned(&["policy.speed", "-1"]);
        assert_eq!(assignments(&one).unwrap(), [("policy.speed", "-1")]);
        let two = owned(&["policy.speed=1", "policy.gait=trot"]);
        assert_eq!(assignments(&two).unwrap(), [("policy.speed", "1"), ("policy.gait", "trot")]);
        let error = assignments(&owned(&["policy.speed"])).unwrap_err().to_string();
        assert!(error.contains("of the form `COMPONENT.PARAMETER=VALUE`"), "{error}");
    }
}
