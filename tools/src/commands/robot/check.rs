//! `motorium robot check`: errors and warnings of a robot's file.

use std::process::ExitCode;

use motorium_robots::{Loaded, MimicMode, Model, ModelWarning, ProfileChoice, ShapeSource};
use serde_json::json;

use super::facts;
use super::source::RobotArgs;
use crate::out::{errln, outln};
use crate::{exit, style};

/// Check a robot's URDF or MJCF, and report every defect with its link or joint.
///
/// A fault that prevents loading is reported with line and column, and causes exit code 3. Common defects of
/// real robot files are warnings, such as values that are probably in degrees or millimetres, and unreadable
/// meshes. With --strict, warnings also cause exit code 3.
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
        let loaded = match self.robot.open(MimicMode::Follow) {
            Ok(loaded) => loaded,
            Err(code) => return Ok(code),
        };
        let mut warnings = warnings(&loaded);
        warnings.extend(self.of_visuals(&loaded));
        if self.json {
            outln!("{}", serde_json::to_string_pretty(&report(&loaded, &warnings))?);
        } else {
            print(&loaded, &warnings, &self.robot.robot);
        }
        let refused = self.strict && !warnings.is_empty();
        Ok(if refused { exit::invalid() } else { ExitCode::SUCCESS })
    }

    /// Returns the defects of the robot's visuals, which pictures and viewers omit. Defects shared with the
    /// robot's other shapes are left out.
    fn of_visuals(&self, robot: &Loaded) -> Vec<String> {
        match self.robot.load_with(MimicMode::Follow, ProfileChoice::Without, ShapeSource::Visual) {
            Ok(seen) => {
                let known = unusable_meshes(robot, ShapeSource::Collision);
                let known: Vec<_> = known.iter().map(mesh).collect();
                let mut unusable = unusable_meshes(&seen, ShapeSource::Visual);
                unusable.retain(|warning| !known.contains(&mesh(warning)));
                ModelWarning::summarise(&unusable).iter().map(|mesh| format!("visual of {mesh}")).collect()
            }
            Err(error) => vec![format!("its visuals cannot be read: {error}")],
        }
    }
}

/// Returns the defects of the robot's file, and a warning for a robot without collision shapes.
fn warnings(robot: &Loaded) -> Vec<String> {
    let defects = [&robot.warnings[..], &robot.mesh_warnings(ShapeSource::Collision)].concat();
    let mut warnings = ModelWarning::summarise(&defects);
    if !robot.model.has_shapes() {
        let warning = "no link has a collision shape: in physics the robot passes through the ground and all objects; \
                    `motorium robot hulls` gives its links the hulls of their visuals";
        warnings.push(warning.to_string());
    }
    warnings
}

/// Prints warnings of the meshes of a robot that are missing or cannot be read.
pub(super) fn warn_of_meshes(robot: &Loaded, shapes: ShapeSource) {
    for warning in ModelWarning::summarise(&unusable_meshes(robot, shapes)) {
        errln!("{}: {warning}", style::warning("warning"));
    }
}

/// Returns the warnings of meshes that are missing or cannot be read, without duplicates.
fn unusable_meshes(robot: &Loaded, shapes: ShapeSource) -> Vec<ModelWarning> {
    let mut unusable: Vec<ModelWarning> = Vec::new();
    for warning in robot.warnings.iter().chain(&robot.mesh_warnings(shapes)) {
        if mesh(warning).is_some() && !unusable.contains(warning) {
            unusable.push(warning.clone());
        }
    }
    unusable
}

/// Returns link and file name of a mesh that is missing or cannot be read.
fn mesh(warning: &ModelWarning) -> Option<(&str, &str)> {
    match warning {
        ModelWarning::MissingMesh { link, uri, .. } | ModelWarning::UnreadableMesh { link, uri, .. } => {
            Some((link, uri))
        }
        _ => None,
    }
}

fn report(robot: &Loaded, warnings: &[String]) -> serde_json::Value {
    json!({
        "valid": true,
        "name": robot.model.name(),
        "file": robot.path.as_ref().map(|path| path.display().to_string()),
        "size": facts::size(&robot.model),
        "warnings": warnings,
    })
}

fn print(robot: &Loaded, warnings: &[String], asked: &str) {
    for warning in warnings {
        errln!("{}: {warning}", style::warning("warning"));
    }
    let count = match warnings.len() {
        0 => style::good("ok:"),
        1 => format!("{} it loads with 1 warning:", style::good("ok:")),
        count => format!("{} it loads with {count} warnings:", style::good("ok:")),
    };
    let file = robot.path.as_ref().map_or_else(|| asked.to_string(), |path| path.display().to_string());
    outln!("{count} {file}: {}", summary(&robot.model));
}

/// Describes the robot in one line.
fn summary(model: &Model) -> String {
    format!(
        "robot `{}`, {} base, {} links, {} {}, {}",
        model.name(),
        facts::base(model),
        model.frames().len(),
        model.joint_count(),
        if model.joint_count() == 1 { "joint" } else { "joints" },
        facts::mass(model)
    )
}
