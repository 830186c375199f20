//! `motorium robot check`: errors and warnings of a robot's file.

use std::process::ExitCode;

use motorium_robots::{Loaded, MimicMode, Model};
use serde_json::json;

use super::source::{RobotArgs, code, explain, position_of};
use super::{facts, facts::short};
use crate::out::{errln, outln};
use crate::{exit, style};

/// Check a robot's URDF or MJCF: every defect, named with its link or joint.
///
/// A fault that keeps the robot from loading comes with its line and column, and the exit code is 3. Defects that real
/// robots' files have are warnings; with --strict they make the exit code 3, too.
///
/// Example: motorium robot check arm.urdf --package-path ~/ros/src
#[derive(Debug, clap::Args)]
pub(super) struct Check {
    #[command(flatten)]
    robot: RobotArgs,
    /// Exit with code 3 if there are warnings
    #[arg(long)]
    strict: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl Check {
    pub(super) fn run(self) -> anyhow::Result<ExitCode> {
        let loaded = self.robot.load(MimicMode::Follow);
        let refused = loaded.as_ref().err().map(code);
        let warned = loaded.as_ref().is_ok_and(|robot| !robot.warnings.is_empty());
        if self.json {
            outln!("{}", serde_json::to_string_pretty(&report(loaded))?);
        } else {
            match loaded {
                Ok(robot) => print(&robot, &self.robot.robot),
                Err(error) => errln!("{}: {}", style::error("error"), explain(&error)),
            }
        }
        Ok(match refused {
            Some(code) => code,
            None if warned && self.strict => exit::invalid(),
            None => ExitCode::SUCCESS,
        })
    }
}

fn report(loaded: Result<Loaded, motorium_robots::LoadError>) -> serde_json::Value {
    match loaded {
        Ok(robot) => json!({
            "valid": true,
            "name": robot.model.name(),
            "file": robot.path,
            "size": facts::size(&robot.model),
            "warnings": robot.warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
        }),
        Err(error) => {
            let (_, at) = position_of(&error);
            json!({
                "valid": false,
                "error": error.to_string(),
                "line": at.map(|at| at.line),
                "column": at.map(|at| at.column),
                "warnings": [],
            })
        }
    }
}

fn print(robot: &Loaded, asked: &str) {
    for warning in &robot.warnings {
        errln!("{}: {warning}", style::warning("warning"));
    }
    let count = match robot.warnings.len() {
        0 => style::good("ok:"),
        1 => format!("{} it loads with 1 warning:", style::good("ok:")),
        count => format!("{} it loads with {count} warnings:", style::good("ok:")),
    };
    let file = robot.path.as_ref().map_or_else(|| asked.to_string(), |path| path.display().to_string());
    outln!("{count} {file}: {}", summary(&robot.model));
}

/// The robot in a line.
fn summary(model: &Model) -> String {
    format!(
        "robot `{}`, {} base, {} links, {} joints, {} kg",
        model.name(),
        facts::base(model),
        model.frames().len(),
        model.joint_count(),
        short(model.mass())
    )
}
