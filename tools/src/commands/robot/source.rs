//! Options that select the robot of a command and how it is loaded.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::builder::NonEmptyStringValueParser;
use motorium_robots::{
    BaseMode, LoadError, LoadOptions, Loaded, MimicMode, PackagePath, Position, ProfileChoice, ShapeSource,
    load_with,
};

use crate::failure::Failure;
use crate::out::errln;
use crate::style;

/// A robot and how to load it.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct RobotArgs {
    /// A catalogue or installed robot, a URDF or MJCF file, or a folder with one
    #[arg(
        value_name = "ROBOT", add = crate::complete::robots(), value_parser = NonEmptyStringValueParser::new()
    )]
    pub(super) robot: String,
    /// Let the root link move freely, overriding the robot's files
    #[arg(long, conflicts_with = "fixed_base")]
    pub(super) floating_base: bool,
    /// Fix the root link to the world, overriding the profile
    #[arg(long)]
    pub(super) fixed_base: bool,
    /// Search `package://` files in this folder first; may be repeated
    #[arg(long, value_name = "FOLDER")]
    pub(super) package_path: Vec<PathBuf>,
}

/// A robot with an optional profile.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct ProfiledArgs {
    #[command(flatten)]
    pub(super) robot: RobotArgs,
    /// Profile to use instead of the robot's own
    #[arg(long, value_name = "FILE.toml")]
    pub(super) profile: Option<PathBuf>,
}

impl ProfiledArgs {
    fn choice(&self) -> ProfileChoice {
        self.profile.clone().map_or(ProfileChoice::Own, ProfileChoice::File)
    }

    /// Loads the robot; errors go to standard error, and the exit code is returned as error.
    pub(super) fn open(&self, mimic: MimicMode) -> Result<Loaded, ExitCode> {
        self.robot.open_with(mimic, self.choice())
    }

    /// Returns the robot with the shapes of its visuals.
    pub(super) fn open_visual(&self, mimic: MimicMode) -> Result<Loaded, ExitCode> {
        self.robot.load_with(mimic, self.choice(), ShapeSource::Visual).map_err(|error| refused(&error))
    }
}

impl RobotArgs {
    /// Loads the robot relative to the current folder.
    pub(super) fn load(&self, mimic: MimicMode) -> Result<Loaded, LoadError> {
        self.load_with(mimic, ProfileChoice::Own, ShapeSource::Collision)
    }

    /// Returns the requested base.
    pub(super) fn base(&self) -> BaseMode {
        match (self.floating_base, self.fixed_base) {
            (true, _) => BaseMode::Floating,
            (_, true) => BaseMode::Fixed,
            _ => BaseMode::AsFile,
        }
    }

    /// Loads the robot with another profile, without one, or with other shapes.
    pub(super) fn load_with(
        &self,
        mimic: MimicMode,
        profile: ProfileChoice,
        shapes: ShapeSource,
    ) -> Result<Loaded, LoadError> {
        let base = self.base();
        let packages = PackagePath { folders: self.package_path.clone(), prefixes: Vec::new() };
        let options = LoadOptions { base, mimic, packages, profile, shapes, ..LoadOptions::default() };
        load_with(&self.robot, Path::new(""), &options)
    }

    /// Loads the robot; errors go to standard error, and the exit code is returned as error.
    pub(super) fn open(&self, mimic: MimicMode) -> Result<Loaded, ExitCode> {
        self.open_with(mimic, ProfileChoice::Own)
    }

    /// Opens the robot with another profile, or without one.
    pub(super) fn open_with(&self, mimic: MimicMode, profile: ProfileChoice) -> Result<Loaded, ExitCode> {
        self.load_with(mimic, profile, ShapeSource::Collision).map_err(|error| refused(&error))
    }
}

/// Prints the error of a robot and returns the exit code.
fn refused(error: &LoadError) -> ExitCode {
    errln!("{}: {}", style::error("error"), explain(error));
    Failure::of_error(error).print_json()
}

/// Returns the message, with the position in the file if known.
fn explain(error: &LoadError) -> String {
    let message = error.to_string();
    let (Some(file), Some(at)) = position_of(error) else { return message };
    let excerpt = std::fs::read_to_string(file).ok().and_then(|text| excerpt(&text, at));
    excerpt.map_or(message.clone(), |excerpt| format!("{message}\n{excerpt}"))
}

/// Returns file and position of an error, if known.
fn position_of(error: &LoadError) -> (Option<&PathBuf>, Option<Position>) {
    match error {
        LoadError::Urdf(urdf) => (urdf.file.as_ref(), urdf.at),
        LoadError::Mjcf(mjcf) => (mjcf.file.as_ref(), Some(mjcf.at)),
        LoadError::NotText { path, at, .. } => (Some(path), Some(*at)),
        _ => (None, None),
    }
}

/// Returns the faulty line with a mark under its column.
fn excerpt(text: &str, at: Position) -> Option<String> {
    let line = text.lines().nth(at.line as usize - 1)?;
    let before: String = line.chars().take(at.column as usize - 1).collect();
    // Tabs are kept, so that the mark is at the fault.
    let blank: String = before.chars().map(|c| if c == '\t' { '\t' } else { ' ' }).collect();
    let number = at.line.to_string();
    let margin = " ".repeat(number.len());
    Some(format!("{number} | {line}\n{margin} | {blank}^"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fault_is_marked_in_its_line() {
        let text = "<robot>\n\t <link/>\n</robot>";
        let marked = excerpt(text, Position { line: 2, column: 3 }).unwrap();
        assert_eq!(marked, "2 | \t <link/>\n  | \t ^");
        assert_eq!(excerpt(text, Position { line: 9, column: 1 }), None);
    }
}
