//! One gravity for all components of a graph, regardless of where the world specifies it.

use std::path::Path;

use crate::support::{machine, run, workspace};

/// A world on the Moon that specifies only its gravity.
const MOON: &str = r#"<mujoco><option gravity="0 0 -1.62"/></mujoco>"#;

/// Returns the state hash of a sample with another world.
fn hash(folder: &Path, sample: &str, world: &str) -> String {
    let below = workspace().join("graphs").join(sample);
    let path = folder.join(format!("moon-{sample}"));
    std::fs::write(&path, format!("extends = \"{}\"\n{world}", below.display())).unwrap();
    let ended = run(&path, &["--clock", "lockstep", "--for", "300 ms", "--no-expect"]);
    ended.report().state_hash.clone().unwrap_or_else(|| panic!("{sample}: no hash"))
}

#[test]
fn the_gravity_of_a_world_file_reaches_every_component() {
    let _machine = machine();
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("moon.xml"), MOON).unwrap();
    // Together they cover: control.qp, control.mpc, control.multirotor, control.wheels, force-torque sensor,
    // IMU, estimator, trajectory, pattern generator.
    for sample in [
        "panda-wrist.toml",
        "quadruped-mpc.toml",
        "hover.toml",
        "drive-square.toml",
        "pick-and-place.toml",
        "quadruped-trot.toml",
    ] {
        let of = |world: &str| hash(folder.path(), sample, world);
        let of_file = of("[world]\nfile = \"moon.xml\"\n");
        assert_eq!(of_file, of("[world]\ngravity = [0.0, 0.0, -1.62]\n"), "{sample}");
        assert_ne!(of_file, of(""), "{sample}");
        // Gravity stated in the graph overrides the gravity of the file.
        assert_eq!(of("[world]\nfile = \"moon.xml\"\ngravity = [0.0, 0.0, -9.81]\n"), of(""), "{sample}");
    }
}
