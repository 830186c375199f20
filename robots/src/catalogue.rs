//! Robots included in the crate. The folder `catalogue/<name>` of a robot contains `<name>.urdf`,
//! `<name>.toml` and, in `shells`, the meshes of its links.

use std::sync::{Arc, LazyLock};

use crate::{Profile, TriangleMesh};

/// A robot of the catalogue.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Name of the robot in graph files.
    pub name: &'static str,
    /// URDF text of the robot.
    pub urdf: &'static str,
    /// Profile of the robot: poses, end effectors and gains.
    pub profile: Profile,
    /// Shells: visual meshes of the links. Each entry is the mesh's name in the URDF,
    /// `package://ROBOT/shells/PART.obj`, and the mesh as Wavefront OBJ text.
    pub shells: &'static [(&'static str, &'static str)],
}

macro_rules! entry {
    ($name:literal $(, $part:literal)*) => {
        Entry {
            name: $name,
            urdf: include_str!(concat!("../catalogue/", $name, "/", $name, ".urdf")),
            profile: Profile::parse(include_str!(concat!("../catalogue/", $name, "/", $name, ".toml")))
                .expect(concat!("the profile of ", $name, " is part of the program and tested")),
            shells: &[$((
                concat!("package://", $name, "/shells/", $part, ".obj"),
                include_str!(concat!("../catalogue/", $name, "/shells/", $part, ".obj")),
            )),*],
        }
    };
}

static ENTRIES: LazyLock<Vec<Entry>> = LazyLock::new(|| {
    vec![
        entry!("ackermann"),
        entry!("acrobot"),
        entry!("biped"),
        entry!("cart-pole"),
        entry!("centaur"),
        entry!("differential-drive"),
        entry!("double-pendulum"),
        entry!("hexapod"),
        entry!(
            "humanoid",
            "ankle",
            "bellows",
            "fingers",
            "foot",
            "foot_cover",
            "forearm",
            "forearm_metal",
            "forearm_sleeve",
            "hand",
            "head",
            "head_dark",
            "head_eyes",
            "hip_roll",
            "hip_yaw",
            "neck",
            "pelvis",
            "pelvis_belt",
            "shank",
            "shank_cover",
            "shank_metal",
            "shoulder",
            "shoulder_cap",
            "shoulder_roll",
            "thigh",
            "thigh_dark",
            "torso",
            "torso_dark",
            "torso_lamp",
            "upper_arm",
            "upper_arm_dark",
            "waist",
            "wrist",
            "wrist_pitch"
        ),
        entry!("iiwa14"),
        entry!("mobile-manipulator"),
        entry!(
            "panda",
            "finger",
            "hand",
            "hand_dark",
            "link0",
            "link0_dark",
            "link1",
            "link1_dark",
            "link2",
            "link2_column",
            "link3",
            "link3_dark",
            "link3_elbow",
            "link4",
            "link4_bend",
            "link5",
            "link5_blade",
            "link5_dark",
            "link5_wrist",
            "link6",
            "link6_dark",
            "link6_head",
            "link7",
            "link7_dark"
        ),
        entry!("pendulum"),
        entry!("planar-3r"),
        entry!("planar-biped"),
        entry!("quadrotor"),
        entry!(
            "quadruped",
            "base",
            "base_dark",
            "base_metal",
            "foot",
            "hip",
            "hip_metal",
            "shank",
            "thigh",
            "thigh_metal",
            "thigh_plate"
        ),
        entry!("rrbot"),
        entry!("so101"),
        entry!(
            "ur5e",
            "base",
            "base_dark",
            "forearm",
            "forearm_caps",
            "forearm_dark",
            "forearm_joints",
            "shoulder",
            "shoulder_cap",
            "shoulder_dark",
            "upper_arm",
            "upper_arm_caps",
            "upper_arm_dark",
            "upper_arm_elbow",
            "upper_arm_tube",
            "wrist_1",
            "wrist_1_cap",
            "wrist_1_dark",
            "wrist_2",
            "wrist_2_cap",
            "wrist_2_dark",
            "wrist_3"
        ),
    ]
});

/// Returns all robots of the catalogue, in alphabetical order.
pub fn catalogue() -> &'static [Entry] {
    &ENTRIES
}

/// Returns the shell of the catalogue with this name in URDF files, if any.
pub(crate) fn shell(uri: &str) -> Option<Arc<TriangleMesh>> {
    let mut shells = catalogue().iter().flat_map(|entry| entry.shells);
    let (_, text) = shells.find(|(name, _)| *name == uri)?;
    TriangleMesh::from_obj(text).ok().map(Arc::new)
}

/// Returns the names of the catalogue's shells in the text of a URDF file.
pub(crate) fn shells_in(text: &str) -> impl Iterator<Item = &'static str> {
    let shells = catalogue().iter().flat_map(|entry| entry.shells).map(|(name, _)| *name);
    shells.filter(move |name| text.contains(&format!("\"{name}\"")))
}
