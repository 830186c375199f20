//! Robots included in the crate, one folder each: `catalogue/<name>/<name>.urdf` and `<name>.toml`.

use std::sync::LazyLock;

use crate::Profile;

/// A robot of the catalogue.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Name of the robot in graph files.
    pub name: &'static str,
    /// Its URDF.
    pub urdf: &'static str,
    /// Poses, end effectors and gains.
    pub profile: Profile,
}

macro_rules! entry {
    ($name:literal) => {
        Entry {
            name: $name,
            urdf: include_str!(concat!("../catalogue/", $name, "/", $name, ".urdf")),
            profile: Profile::parse(include_str!(concat!("../catalogue/", $name, "/", $name, ".toml")))
                .expect(concat!("the profile of ", $name, " is part of the program and tested")),
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
        entry!("humanoid"),
        entry!("iiwa14"),
        entry!("mobile-manipulator"),
        entry!("panda"),
        entry!("pendulum"),
        entry!("planar-3r"),
        entry!("planar-biped"),
        entry!("quadrotor"),
        entry!("quadruped"),
        entry!("rrbot"),
        entry!("so101"),
        entry!("ur5e"),
    ]
});

/// Returns all robots of the catalogue, in alphabetical order.
pub fn catalogue() -> &'static [Entry] {
    &ENTRIES
}
