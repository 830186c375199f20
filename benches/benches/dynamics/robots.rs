//! The measured robots: published files, if available on the machine.

use std::path::{Path, PathBuf};

use motorium_robots::{BaseMode, LoadOptions, MimicMode, Model, parse_urdf_with};

/// A robot and the file both sides read.
pub(crate) struct Subject {
    pub(crate) name: &'static str,
    pub(crate) urdf: PathBuf,
    pub(crate) floating: bool,
    pub(crate) model: Model,
    /// Frame whose Jacobian is measured.
    pub(crate) frame: &'static str,
}

/// Returns the Panda with locked fingers (7), Solo12 (18) and the reduced Talos (38), of the PyPI package
/// example-robot-data, in the folder `MOTORIUM_EXAMPLE_ROBOT_DATA`. Missing robots are reported and skipped.
pub(crate) fn subjects(scratch: &Path) -> Vec<Subject> {
    let Some(folder) = std::env::var_os("MOTORIUM_EXAMPLE_ROBOT_DATA").map(PathBuf::from) else {
        eprintln!(
            "set MOTORIUM_EXAMPLE_ROBOT_DATA to the folder `robots` of the PyPI package example-robot-data \
             (pip download --no-deps example-robot-data==6.0.0, unzip, cmeel.prefix/share/example-robot-data/robots); \
             measuring the catalogue's Panda alone"
        );
        let text =
            motorium_robots::catalogue().iter().find(|entry| entry.name == "panda").map(|entry| entry.urdf);
        return text
            .into_iter()
            .filter_map(|text| subject("panda", text, false, "panda_hand", scratch))
            .collect();
    };
    let files = [
        ("panda", "panda_description/urdf/panda.urdf", false, "panda_hand"),
        ("solo12", "solo_description/robots/solo12.urdf", true, "HR_FOOT"),
        ("talos", "talos_data/robots/talos_reduced.urdf", true, "arm_left_7_link"),
    ];
    files
        .into_iter()
        .filter_map(|(name, file, floating, frame)| match std::fs::read_to_string(folder.join(file)) {
            Ok(text) => subject(name, &text, floating, frame, scratch),
            Err(error) => {
                eprintln!("left out {name}: {}: {error}", folder.join(file).display());
                None
            }
        })
        .collect()
}

/// Writes the file both sides read (fingers locked, every mimic joint independent) and loads it.
fn subject(
    name: &'static str,
    text: &str,
    floating: bool,
    frame: &'static str,
    scratch: &Path,
) -> Option<Subject> {
    let text =
        if name == "panda" { text.replace("type=\"prismatic\"", "type=\"fixed\"") } else { text.to_owned() };
    let urdf = scratch.join(name).with_extension("urdf");
    let base = if floating { BaseMode::Floating } else { BaseMode::AsFile };
    let options = LoadOptions { base, mimic: MimicMode::Independent, ..LoadOptions::default() };
    let loaded = parse_urdf_with(&text, None, &options).map_err(|error| error.to_string());
    let written = std::fs::write(&urdf, &text).map_err(|error| error.to_string());
    match written.and(loaded) {
        Ok(robot) => Some(Subject { name, urdf, floating, model: robot.model, frame }),
        Err(error) => {
            eprintln!("left out {name}: {error}");
            None
        }
    }
}
