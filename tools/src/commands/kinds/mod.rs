//! `motorium kinds`: lists the kinds of components, or describes a single kind from its declaration.

mod example;
mod keys;
mod print;
mod sheet;
mod source;

use std::path::PathBuf;
use std::process::ExitCode;

use motorium::nearest::suggest;

use crate::out::{out, outln};
use crate::registry;
use sheet::Sheet;
use source::KindSource;

/// List the kinds of components, or describe one: ports, parameters, configuration, an example.
///
/// The description comes from the kind's declaration and the JSON Schema of its configuration. Ports and
/// parameters may depend on the robot and the configuration; the printed ones belong to the example.
///
/// Example: motorium kinds control.qp
#[derive(Debug, clap::Args)]
pub(crate) struct Kinds {
    /// The kind to describe, such as `policy.dmp` [default: list all]
    #[arg(add = crate::complete::kinds())]
    kind: Option<String>,
    /// Describe the kind in this component program instead of the built-in kinds
    #[arg(long, value_name = "PROGRAM")]
    exec: Option<PathBuf>,
    /// The robot for which the kind declares its ports [default: a supported one of the catalogue]
    #[arg(long, value_name = "ROBOT", add = crate::complete::robots())]
    robot: Option<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl Kinds {
    pub(crate) fn run(self) -> anyhow::Result<ExitCode> {
        let known = registry::registry();
        let kinds = match &self.exec {
            Some(program) => source::of_program(program)?,
            None => source::installed(&known),
        };
        let chosen = match (&self.kind, kinds.as_slice()) {
            (Some(name), kinds) => Some(find(name, kinds)?),
            (None, [only]) if self.exec.is_some() => Some(only),
            (None, _) => None,
        };
        let Some(kind) = chosen else {
            self.list(&kinds)?;
            return Ok(ExitCode::SUCCESS);
        };
        let sheet = Sheet::from_kind(kind, self.robot.as_deref());
        match self.json {
            true => outln!("{}", serde_json::to_string_pretty(&sheet)?),
            false => out!("{}", print::sheet(&sheet)),
        }
        Ok(ExitCode::SUCCESS)
    }

    fn list(&self, kinds: &[KindSource<'_>]) -> anyhow::Result<()> {
        if self.json {
            let lines: Vec<_> = kinds.iter().map(KindSource::line).collect();
            outln!("{}", serde_json::to_string_pretty(&lines)?);
        } else {
            out!("{}", print::list(kinds));
        }
        Ok(())
    }
}

fn find<'k, 'a>(name: &str, kinds: &'k [KindSource<'a>]) -> anyhow::Result<&'k KindSource<'a>> {
    kinds.iter().find(|kind| kind.name() == name).ok_or_else(|| {
        // The first part of a name selects all kinds that begin with it.
        let begins = |kind: &&str| kind.split('.').next() == Some(name);
        let family: Vec<String> =
            kinds.iter().map(KindSource::name).filter(begins).map(|kind| format!("`{kind}`")).collect();
        let advice = match family.as_slice() {
            [] => suggest(name, kinds.iter().map(KindSource::name), "there are"),
            family => format!("there are {}", family.join(", ")),
        };
        anyhow::anyhow!("no kind is called `{name}`; {advice}")
    })
}
