//! Robots loaded by the names and files in a graph: URDF, MJCF, or folders of either.

use std::path::Path;

use motorium_robots::{LoadError, load};

const MJCF: &str = r#"<?xml version="1.0"?>
<!-- a swing -->
<mujoco model="swing">
  <compiler angle="radian"/>
  <worldbody>
    <body name="rod" pos="0 0 1">
      <joint name="hinge" axis="0 1 0" range="-1 1"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02"/>
    </body>
  </worldbody>
</mujoco>
"#;

const URDF: &str = r#"<robot name="bar"><link name="bar"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"#;

#[test]
fn mjcf_file_loads_like_a_urdf() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("swing.xml"), MJCF).unwrap();
    for reference in ["swing.xml", "./swing.xml", "."] {
        let robot = load(reference, folder.path()).unwrap();
        assert_eq!(robot.model.joint_names(), ["hinge"], "{reference}");
        assert!(robot.path.unwrap().ends_with("swing.xml"));
    }
    // in a folder with a URDF that file is used, and other XML files are not robots
    std::fs::write(folder.path().join("package.xml"), "<package/>").unwrap();
    assert_eq!(load(".", folder.path()).unwrap().model.name(), "swing");
    std::fs::write(folder.path().join("bar.urdf"), URDF).unwrap();
    assert_eq!(load(".", folder.path()).unwrap().model.name(), "bar");
}

#[test]
fn profile_next_to_an_mjcf_file_is_loaded() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("swing.xml"), MJCF).unwrap();
    let profile =
        "title = \"A swing\"\nsources = []\njoints = [\"hinge\"]\nhome = \"down\"\n[poses]\ndown = [0.0]\n";
    std::fs::write(folder.path().join("swing.toml"), profile).unwrap();
    assert_eq!(load("swing.xml", folder.path()).unwrap().profile.unwrap().title, "A swing");
    std::fs::write(folder.path().join("swing.toml"), profile.replace("hinge", "hinje")).unwrap();
    assert!(load("swing.xml", folder.path()).unwrap_err().to_string().contains("hinje"));
}

#[test]
fn mjcf_errors_have_line_and_column() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("swing.xml"), MJCF.replace("axis=\"0 1 0\"", "axis=\"0 1\"")).unwrap();
    let error = load("swing.xml", folder.path()).unwrap_err();
    assert!(error.to_string().contains("swing.xml:7:7: axis=\"0 1\" of <joint name=\"hinge\">"), "{error}");
    let LoadError::Mjcf(mjcf) = error else { panic!("{error:?}") };
    assert_eq!((mjcf.at.line, mjcf.at.column), (7, 7));
}

#[test]
fn srdf_key_poses_are_loaded_with_the_robot() {
    let folder = tempfile::tempdir().unwrap();
    for (file, text) in [
        ("urdf/swing.xml", MJCF),
        (
            "srdf/swing.srdf",
            r#"<robot name="swing"><group_state name="out" group="all"><joint name="hinge" value="0.5"/></group_state></robot>"#,
        ),
    ] {
        let path = folder.path().join(file);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    let robot = load("urdf/swing.xml", folder.path()).unwrap();
    assert_eq!(robot.postures.len(), 1);
    assert_eq!((robot.postures[0].name.as_str(), robot.postures[0].joints.as_slice()), ("out", &[0.5][..]));
    assert!(load("panda", Path::new(".")).unwrap().postures.is_empty());
}

#[test]
fn file_that_is_not_utf8_is_rejected_with_position() {
    let folder = tempfile::tempdir().unwrap();
    for (name, before) in
        [("arm.urdf", "<robot name=\"r\">\n  <!-- grün "), ("arm.xml", "<mujoco>\n  <!-- grün ")]
    {
        let text = [before.as_bytes(), b"gr\xfcn --></robot>"].concat();
        std::fs::write(folder.path().join(name), text).unwrap();
        let error = load(name, folder.path()).unwrap_err();
        assert!(matches!(error, LoadError::NotText { .. }), "{error:?}");
        let message = error.to_string();
        assert!(
            message.ends_with(&format!("{name}:2:15: byte 0xfc is not UTF-8; save the file as UTF-8")),
            "{message}"
        );
    }
}
