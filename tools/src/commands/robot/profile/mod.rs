//! `motorium robot profile`: creates a first profile of a robot, and a first graph.

mod graph;

use std::fs::OpenOptions;
use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context as _;
use motorium_robots::{Loaded, MimicMode, ModelWarning, ProfileChoice, draft_profile};

use super::facts;
use super::source::RobotArgs;
use crate::out::{errln, out, outln};
use crate::style;

/// Write a first profile of a robot, to be edited: feet, end effectors, home pose, gains and limits.
///
/// Feet and end effectors come from the SRDF next to the file. Without one, they are derived from the link
/// names and the tip of the longest chain of joints. The home pose of a robot with feet is a standing pose,
/// and its base floats. The home pose of an arm is bent and within the limits. Gains and accelerations follow
/// from inertias, friction and effort limits.
///
/// A graph names the profile with the key `profile` in `[robot.NAME]`. A profile with the same name as the
/// robot's file, in the same folder, needs no entry.
///
/// Example: motorium robot profile arm.urdf --output my-arm.toml --graph reach.toml
#[derive(Debug, clap::Args)]
pub(super) struct Profile {
    #[command(flatten)]
    robot: RobotArgs,
    /// File to write, which must not exist yet [default: standard output]
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Graph to write, which must not exist yet: the robot holds its home pose, then reaches another
    #[arg(long, value_name = "FILE", requires = "output")]
    graph: Option<PathBuf>,
}

impl Profile {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let robot = match self.robot.open_with(MimicMode::Follow, ProfileChoice::Without) {
            Ok(robot) => robot,
            Err(code) => return Ok(code),
        };
        for warning in ModelWarning::summarise(&robot.warnings) {
            errln!("{}: {warning}", style::warning("warning"));
        }
        let text = draft_profile(&robot, self.robot.base());
        let Some(file) = &self.output else {
            out!("{text}");
            return Ok(ExitCode::SUCCESS);
        };
        write_new(file, &text)?;
        outln!("{} {}: {}", style::good("wrote"), file.display(), facts::mass(&robot.model));
        let table = table_name(&robot);
        let Some(graph) = &self.graph else {
            outln!("{}", next_steps(&table, &self.robot.robot, file));
            return Ok(ExitCode::SUCCESS);
        };
        let robot = match self.robot.open_with(MimicMode::Follow, ProfileChoice::File(file.clone())) {
            Ok(robot) => robot,
            Err(code) => return Ok(code),
        };
        let profile = robot.profile.as_ref().context("the profile is loaded with the robot")?;
        write_new(graph, &graph::first_graph(&robot, profile, &table, &self.robot.robot, file))?;
        let graph = graph.display();
        outln!("{} {graph}; run it with `motorium run {graph}`", style::good("wrote"));
        Ok(ExitCode::SUCCESS)
    }
}

/// Writes a new file; an existing one, which may have been edited, is never overwritten.
fn write_new(file: &Path, text: &str) -> anyhow::Result<()> {
    let mut opened =
        OpenOptions::new().write(true).create_new(true).open(file).map_err(|error| match error.kind() {
            ErrorKind::AlreadyExists => anyhow::anyhow!(
                "{} already exists and is not overwritten; name another file, or remove it",
                file.display()
            ),
            _ => anyhow::Error::new(error).context(format!("writing {}", file.display())),
        })?;
    opened.write_all(text.as_bytes()).with_context(|| format!("writing {}", file.display()))
}

/// Returns the name of the robot's table in a graph.
fn table_name(robot: &Loaded) -> String {
    let name = robot.model.name().chars();
    let name: String =
        name.map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect();
    if name.is_empty() { "robot".to_owned() } else { name }
}

fn next_steps(table: &str, named: &str, file: &Path) -> String {
    format!(
        "Check it, correct it, and name it in a graph:\n  [robot.{table}]\n  urdf    = {named:?}\n  profile = {:?}",
        file.display().to_string()
    )
}
