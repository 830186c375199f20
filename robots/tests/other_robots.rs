//! Third-party robots compared with Pinocchio, if their files are installed; each test reports why it is
//! skipped.
//!
//! Vectors are in `MOTORIUM_GOLDEN`, or in `../shared/golden` next to the repository. URDFs are in
//! `MOTORIUM_EXAMPLE_ROBOT_DATA` (a folder with `panda_description` and others in it), or in the PyPI package
//! `example-robot-data` of the `python3` in the path.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::golden::Golden;
use motorium_robots::{
    BaseMode, LoadError, LoadOptions, Loaded, MimicMode, Profile, draft_profile, load, load_with,
};

const ROBOTS: &str = "cmeel.prefix/share/example-robot-data/robots";

fn independent(reference: &str, folder: &Path, base: BaseMode) -> Loaded {
    let options = LoadOptions { mimic: MimicMode::Independent, base, ..LoadOptions::default() };
    load_with(reference, folder, &options).unwrap()
}

fn vectors(name: &str) -> Option<Golden> {
    let folder = std::env::var_os("MOTORIUM_GOLDEN")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/golden"), PathBuf::from);
    let path = folder.join(name).with_extension("json");
    if path.is_file() {
        return Some(Golden::parse(&std::fs::read_to_string(&path).unwrap()));
    }
    println!("skipped: no vectors of {name} at {}", path.display());
    None
}

fn robots() -> Option<PathBuf> {
    if let Some(folder) = std::env::var_os("MOTORIUM_EXAMPLE_ROBOT_DATA") {
        return Some(PathBuf::from(folder));
    }
    let output = Command::new("python3")
        .args(["-c", "import sysconfig; print(sysconfig.get_path('purelib'))"])
        .output()
        .ok()?;
    let folder = Path::new(String::from_utf8(output.stdout).ok()?.trim()).join(ROBOTS);
    if folder.is_dir() {
        return Some(folder);
    }
    println!("skipped: set MOTORIUM_EXAMPLE_ROBOT_DATA, or pip install --no-deps example-robot-data==6.0.0");
    None
}

fn agrees(name: &str, urdf: &str, base: BaseMode) {
    let (Some(golden), Some(robots)) = (vectors(name), robots()) else { return };
    let robot = independent(urdf, &robots, base);
    let errors = golden.compare(&robot.model);
    println!("{name}: {} warnings; {}", robot.warnings.len(), errors.summary());
    errors.stay_below(1e-10, 1e-8);
}

#[test]
fn catalogue_panda_agrees_with_frankas_panda() {
    let Some(golden) = vectors("panda") else { return };
    let panda = independent("panda", Path::new("."), BaseMode::AsFile);
    let errors = golden.compare(&panda.model);
    println!("our panda: {}", errors.summary());
    errors.stay_below(1e-10, 1e-8);
    golden.compare_limits(&panda.model);
}

#[test]
fn frankas_panda_agrees_with_pinocchio() {
    agrees("panda", "panda_description/urdf/panda.urdf", BaseMode::AsFile);
}

#[test]
fn ur5_agrees_with_pinocchio() {
    agrees("ur5", "ur_description/urdf/ur5_robot.urdf", BaseMode::AsFile);
}

#[test]
fn solo12_agrees_with_pinocchio() {
    agrees("solo12", "solo_description/robots/solo12.urdf", BaseMode::Floating);
}

#[test]
fn talos_agrees_with_pinocchio() {
    agrees("talos_full", "talos_data/robots/talos_full_v2.urdf", BaseMode::Floating);
}

/// Its knee has the axis `0 1.22465e-16 -1`. The vectors come from `golden/axes.py`.
#[test]
fn icub_with_an_axis_near_minus_z_matches_pinocchio() {
    let Some(robots) = robots() else { return };
    let golden = Golden::parse(include_str!("golden/icub.json"));
    let icub = independent("icub_description/robots/icub_reduced.urdf", &robots, BaseMode::AsFile);
    let errors = golden.compare(&icub.model);
    println!("icub_reduced: {}", errors.summary());
    assert!(errors.0.len() >= 30, "{}", errors.summary());
    errors.stay_below(1e-10, 1e-8);
}

#[test]
fn tiago_with_its_impossible_inertias_agrees_with_pinocchio() {
    agrees("tiago", "tiago_description/robots/tiago.urdf", BaseMode::AsFile);
}

#[test]
fn tiago_drafts_its_wheels_casters_and_palm() {
    let Some(robots) = robots() else { return };
    let tiago = load("tiago_description/robots/tiago.urdf", &robots).unwrap();
    let text = draft_profile(&tiago, BaseMode::AsFile);
    println!("{text}");
    for side in ["front_right", "front_left", "back_right", "back_left"] {
        let link = format!("caster_{side}_2_link");
        let caster = format!("# [feet.{link}]\n# frame = \"{link}\"\n# radius = 0.025\n# friction = 0.0\n");
        assert!(text.contains(&caster), "{link}");
    }
    assert_eq!(text.matches("# [feet.").count(), 4);
    assert!(text.contains("# home = { position = [0.0, 0.0, 0.0], rpy = [0.0, 0.0, 0.0] }\n"));
    let profile = Profile::parse(&text).unwrap();
    let tool = &profile.end_effectors["tool"];
    // torso and arm, before the 36 joints of the hand
    assert_eq!((tool.joints.len(), tool.fingers.len()), (8, 36), "{tool:?}");
}

#[test]
fn every_package_robot_loads_or_fails_with_a_line() {
    let Some(robots) = robots() else { return };
    let mut files = Vec::new();
    find_urdfs(&robots, &mut files);
    let (mut loaded, mut refused) = (0, 0);
    for file in files {
        match load(file.to_str().unwrap(), Path::new("")) {
            Ok(robot) => {
                loaded += 1;
                assert!(robot.model.frames().len() > robot.model.bodies().len(), "{}", file.display());
            }
            Err(LoadError::Urdf(error)) => {
                refused += 1;
                println!("{error}");
                assert!(error.at.is_some(), "{error}");
            }
            Err(error) => panic!("{error}"),
        }
    }
    println!("{loaded} loaded, {refused} rejected");
    assert!(loaded > 20 * refused);
}

fn find_urdfs(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            find_urdfs(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "urdf") {
            found.push(path);
        }
    }
}
