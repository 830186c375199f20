//! The reduced Talos (32 joints and a free base) of the PyPI package example-robot-data, in the half-sitting
//! posture of its SRDF. It is written as files that motorium and the peers read: a URDF with absolute mesh
//! paths, and a profile with the posture and stiff gains.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use motorium_physics::{ArticulatedSimulator, Ground, Options, RobotSetup, Simulator, World};
use motorium_robots::{BaseMode, LoadOptions, Loaded, installed, load_with};

/// Deflection at which a drive reaches its full effort \[rad\], and the damping of its gains as a time
/// constant \[s\].
const STIFF: [f64; 2] = [0.02, 0.02];

/// Message if the package is missing.
const HINT: &str = "no Talos: set MOTORIUM_EXAMPLE_ROBOT_DATA to the folder `robots` of the PyPI package example-robot-data, or \
                    `motorium robot install example-robot-data`";

/// Writes the two files to the temporary folder and returns the URDF; `None`, reported once, if the package
/// is missing.
pub(crate) fn files() -> Option<PathBuf> {
    let given = std::env::var_os("MOTORIUM_EXAMPLE_ROBOT_DATA").map(PathBuf::from);
    let given =
        given.map(|folder| folder.join("talos_data/robots/talos_reduced.urdf")).filter(|file| file.is_file());
    let installed =
        || installed().into_iter().find(|robot| robot.name == "talos_reduced").map(|robot| robot.urdf);
    let Some(source) = given.or_else(installed) else {
        eprintln!("{HINT}");
        return None;
    };
    let written = write(&source).map_err(|error| eprintln!("Talos is left out: {error}"));
    written.ok()
}

/// Loads the robot of these files.
pub(crate) fn load(urdf: &Path) -> Result<Loaded, String> {
    let options = LoadOptions { base: BaseMode::Floating, ..LoadOptions::default() };
    load_with(&urdf.display().to_string(), Path::new(""), &options).map_err(|error| error.to_string())
}

fn write(source: &Path) -> Result<PathBuf, String> {
    let failed = |error: std::io::Error| error.to_string();
    let folder = std::env::temp_dir().join(format!("motorium-bench-talos-{}", std::process::id()));
    std::fs::create_dir_all(&folder).map_err(failed)?;
    let robots = source.ancestors().nth(3).ok_or("the package has another layout")?;
    let text = std::fs::read_to_string(source).map_err(failed)?;
    let text = text.replace("package://example-robot-data/robots", &robots.display().to_string());
    let urdf = folder.join("talos.urdf");
    std::fs::write(&urdf, text).map_err(failed)?;
    // The posture of its makers, on its soles.
    let robot = load(source)?;
    let posture =
        robot.postures.iter().find(|one| one.name == "half_sitting").ok_or("no posture half_sitting")?;
    let model = &robot.model;
    let q = posture.configuration(model);
    let setup = RobotSetup::from_loaded(&robot).map_err(|error| error.to_string())?;
    let world = World { ground: Some(Ground::default()), ..World::default() };
    let mut simulation = ArticulatedSimulator::new(setup, world, q.as_slice(), Options::default())
        .map_err(|error| error.to_string())?;
    simulation.place_on_ground();
    let height = simulation.base_pose().translation.z;
    let kp: Vec<f64> = model.effort_limit().iter().map(|effort| effort / STIFF[0]).collect();
    let kd: Vec<f64> = kp.iter().map(|kp| kp * STIFF[1]).collect();
    let mut profile = String::new();
    let written = writeln!(
        profile,
        "title = \"Talos\"\nsources = [\"example-robot-data\"]\nbase = \"floating\"\njoints = {:?}\nhome = \"home\"\n[poses]\nhome = {:?}\n[base_poses]\nhome = {{ position = [0.0, 0.0, {height:?}] }}\n\
         [gains]\nkp = {kp:?}\nkd = {kd:?}",
        model.joint_names(),
        simulation.positions(),
    );
    written.map_err(|error| error.to_string())?;
    std::fs::write(urdf.with_extension("toml"), profile).map_err(failed)?;
    Ok(urdf)
}
