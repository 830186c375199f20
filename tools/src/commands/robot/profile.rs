//! `motorium robot profile`: a first profile of a robot.

use std::fs::OpenOptions;
use std::io::{ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context as _;
use motorium_robots::{Loaded, MimicMode, ModelWarning, ProfileChoice, draft_profile};

use super::source::RobotArgs;
use crate::out::{errln, out, outln};
use crate::style;

/// Write a first profile of a robot, to be edited: feet, end effectors, home pose, gains and limits.
///
/// Feet and end effectors come from the SRDF, or from the names of links; the home pose stands or lies
/// inside the limits, gains
/// and accelerations follow from inertias and effort limits. A graph names it by `profile` in its
/// `[robot.NAME]`; a profile of the same name in the folder of the robot's file needs no entry.
///
/// Example: motorium robot profile arm.urdf --output my-arm.toml
#[derive(Debug, clap::Args)]
pub(super) struct Profile {
    #[command(flatten)]
    robot: RobotArgs,
    /// File to write, which must not exist yet [default: standard output]
    #[arg(long, short, value_name = "FILE")]
    output: Option<PathBuf>,
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
        outln!("{} {}", style::good("wrote"), file.display());
        outln!("{}", next_steps(&robot, &self.robot.robot, file));
        Ok(ExitCode::SUCCESS)
    }
}

/// Writes a file that does not exist yet: one that somebody has edited is not lost.
fn write_new(file: &Path, text: &str) -> anyhow::Result<()> {
    let mut opened =
        OpenOptions::new().write(true).create_new(true).open(file).map_err(|error| match error.kind() {
            ErrorKind::AlreadyExists => anyhow::anyhow!(
                "{} exists already and is not overwritten; name another file, or remove it",
                file.display()
            ),
            _ => anyhow::Error::new(error).context(format!("writing {}", file.display())),
        })?;
    opened.write_all(text.as_bytes()).with_context(|| format!("writing {}", file.display()))
}

fn next_steps(robot: &Loaded, named: &str, file: &Path) -> String {
    let name: String = robot
        .model
        .name()
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' })
        .collect();
    let table = if name.is_empty() { "robot" } else { &name };
    format!(
        "Check it, correct it, and name it in a graph:\n  [robot.{table}]\n  urdf    = {named:?}\n  profile = {:?}",
        file.display().to_string()
    )
}
