//! Humanoids: the humanoid of the catalogue, and the reduced Talos (32 joints) of the PyPI package
//! example-robot-data.

use std::path::{Path, PathBuf};

use motorium_control::inverse_dynamics::{Contact, ContactShape};
use motorium_robots::{BaseMode, FrameId, LoadOptions, Model, load, parse_urdf_with};

/// A humanoid in a standing posture, and its frames.
pub(crate) struct Biped {
    pub(crate) model: Model,
    /// Configuration, nq.
    pub(crate) q: Vec<f64>,
    pub(crate) feet: [FrameId; 2],
    pub(crate) hands: [FrameId; 2],
    pub(crate) contacts: Vec<Contact>,
}

impl Biped {
    /// Returns the humanoid of the catalogue: 31 joints.
    pub(crate) fn catalogue() -> Self {
        let humanoid = load("humanoid", Path::new(".")).expect("it is in the catalogue");
        let (model, profile) = (humanoid.model, humanoid.profile.expect("it has a profile"));
        let q = profile.configuration(&model, "standing").expect("a standing pose");
        let feet = profile.feet.iter();
        let contacts =
            feet.map(|(name, foot)| Contact::of_foot(&model, name, foot).expect("its frame exists"));
        let frames = |names: [&str; 2]| names.map(|name| model.frame(name).expect("it has it"));
        Self {
            q: q.as_slice().to_vec(),
            feet: frames(["left_sole", "right_sole"]),
            hands: frames(["left_palm", "right_palm"]),
            contacts: contacts.collect(),
            model,
        }
    }

    /// Returns the reduced Talos of a URDF.
    pub(crate) fn talos(urdf: &Path) -> Result<Self, String> {
        let text = std::fs::read_to_string(urdf).map_err(|error| format!("{}: {error}", urdf.display()))?;
        let options = LoadOptions { base: BaseMode::Floating, ..LoadOptions::default() };
        let model = parse_urdf_with(&text, None, &options).map_err(|error| error.to_string())?.model;
        let mut q = model.neutral();
        let joints = q.len() - model.joint_count();
        for (angle, name) in q[joints..].iter_mut().zip(model.joint_names()) {
            *angle = talos_home(name);
        }
        let frames = |names: [&str; 2]| -> Result<[FrameId; 2], String> {
            let frame = |name| model.frame(name).map_err(|error| error.to_string());
            Ok([frame(names[0])?, frame(names[1])?])
        };
        let feet = frames(["left_sole_link", "right_sole_link"])?;
        let hands = frames(["arm_left_7_link", "arm_right_7_link"])?;
        let sole = ContactShape::Sole { sides: [0.2, 0.12] };
        let contacts =
            ["left", "right"].into_iter().zip(feet).map(|(name, frame)| Contact::new(name, frame, sole));
        Ok(Self { q, feet, hands, contacts: contacts.collect(), model })
    }
}

/// Returns the posture that the peers use as well: bent knees, arms down.
fn talos_home(joint: &str) -> f64 {
    let part = joint.replace("left", "_").replace("right", "_");
    let side = if joint.contains("left") { 1.0 } else { -1.0 };
    match part.get(..7) {
        Some("leg___3" | "leg___5") => -0.4,
        Some("leg___4") => 0.8,
        Some("arm___4") => -1.0,
        Some("arm___2") => 0.3 * side,
        _ => 0.0,
    }
}

/// Robot files that peers read as well.
pub(crate) struct Files {
    pub(crate) panda: PathBuf,
    pub(crate) talos: PathBuf,
}

impl Files {
    /// Finds the files in the folder `MOTORIUM_EXAMPLE_ROBOT_DATA`, or in the Python of the peers. The
    /// Panda's fingers are locked in a copy in `scratch`.
    pub(crate) fn find(python: &Path, scratch: &Path) -> Result<Self, String> {
        let folder = match std::env::var_os("MOTORIUM_EXAMPLE_ROBOT_DATA") {
            Some(folder) => PathBuf::from(folder),
            None => {
                let output = std::process::Command::new(python)
                    .args(["-c", "import sysconfig; print(sysconfig.get_path('purelib'))"])
                    .output()
                    .map_err(|error| format!("cannot run {}: {error}", python.display()))?;
                let packages = PathBuf::from(String::from_utf8_lossy(&output.stdout).trim());
                packages.join("cmeel.prefix/share/example-robot-data/robots")
            }
        };
        let panda = folder.join("panda_description/urdf/panda.urdf");
        let text =
            std::fs::read_to_string(&panda).map_err(|error| format!("{}: {error}", panda.display()))?;
        let locked = scratch.join("panda-locked.urdf");
        std::fs::write(&locked, text.replace("type=\"prismatic\"", "type=\"fixed\""))
            .map_err(|error| format!("{}: {error}", locked.display()))?;
        Ok(Self { panda: locked, talos: folder.join("talos_data/robots/talos_reduced.urdf") })
    }
}
