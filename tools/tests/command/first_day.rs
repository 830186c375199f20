//! Mistakes of a first day: each ends in an error or a warning that names it.

use std::path::Path;

use crate::program::run;

const REACH: &str = "../graphs/panda-reach.toml";

/// Exit code and standard error.
fn tried(arguments: &[&str]) -> (Option<i32>, String) {
    let output = run(arguments);
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn a_graph_with_a_mistake_is_refused_with_the_value_and_what_to_try() {
    for (mistake, words) in [
        // A goal out of reach.
        (
            "policy.config.goals=[{position=[5.0,0.0,0.5],duration=\"1 s\"}]",
            &["goal 0 is 5.003 m from the first joint", "links reach 1.090 m", "bring the goal nearer"][..],
        ),
        // A start out of limits, and one that does not exist.
        (
            "physics.config.position=[9.0,0.0,0.0,-1.5,0.0,1.5,0.0,0.0]",
            &["joint `panda_joint1` starts at 9, outside its limits -2.8973 to 2.8973", "start it at 2.8973"],
        ),
        ("physics.config.pose=hoem", &["no pose is named \"hoem\""]),
        // A frame that does not exist, and one that no joint moves.
        ("policy.config.frame=panda_hnad", &["did you mean \"panda_hand\"?"]),
        ("policy.config.frame=panda_link0", &["no joint moves it", "panda_hand_tcp"]),
        // No unit, and a wrong one.
        ("policy.config.goals=[{offset=[0.1,0.0,0.0],duration=1}]", &["expected a time with its unit"]),
        (
            "policy.config.goals=[{offset=[0.1,0.0,0.0],duration=\"1 m\"}]",
            &["unknown unit \"m\"", "ns, us, ms, s and min"],
        ),
        ("physics.rate=1000", &["give it its unit: \"1000 Hz\""]),
    ] {
        let (code, errors) = tried(&["check", REACH, "--set", mistake]);
        assert_eq!(code, Some(3), "{mistake}: {errors}");
        // Long lines are broken between words.
        let errors = errors.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(words.iter().all(|words| errors.contains(words)), "{mistake}: {errors}");
    }
}

#[test]
fn a_wrong_option_is_told_with_the_one_that_was_meant() {
    for (arguments, words) in [
        (&["run", REACH, "--clok", "lockstep"][..], "'--clock'"),
        (&["run", REACH, "--clock", "lockstpe"], "'lockstep'"),
        (&["robot", "drwa", "panda"], "'draw'"),
    ] {
        let (code, errors) = tried(arguments);
        assert_eq!(code, Some(2), "{errors}");
        assert!(errors.contains(words), "{errors}");
    }
    let (code, errors) = tried(&["run", REACH, "--for", "5"]);
    assert!(code == Some(3) && errors.contains("without a unit"), "{errors}");
}

/// A robot whose only shape is a mesh that is nowhere, and a graph of it with the same name beside it.
fn robot_of_a_missing_mesh(folder: &Path) -> [String; 2] {
    let urdf = r#"<robot name="mesh"><link name="base"/><link name="arm"><inertial><mass value="1"/>
        <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry>
        <mesh filename="package://nowhere/arm.stl"/></geometry></collision></link><joint name="j" type="revolute">
        <parent link="base"/><child link="arm"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="10" velocity="1"/>
        </joint></robot>"#;
    let graph = r#"
        name = "mesh"

        [robot.mesh]
        urdf    = "mesh.urdf"
        profile = "own.toml"

        [component.physics]
        kind      = "physics.articulated"
        robot     = "mesh"
        rate      = "1 kHz"
        budget    = "500 us"
        subscribe = { joint_command = "mesh/joint_command" }
        publish   = { joint_state = "mesh/joint_state" }

        [component.policy]
        kind      = "policy.home"
        robot     = "mesh"
        rate      = "100 Hz"
        budget    = "500 us"
        subscribe = { joint_state = "mesh/joint_state" }
        publish   = { joint_command = "mesh/joint_command" }
        "#;
    let profile = "title = \"mesh\"\nsources = []\njoints = [\"j\"]\nhome = \"home\"\n[poses]\nhome = [0.1]\n\
                   [gains]\nkp = [10.0]\nkd = [1.0]\n";
    let files = [("mesh.urdf", urdf), ("mesh.toml", graph), ("own.toml", profile)];
    let [urdf, graph, _] = files.map(|(name, text)| {
        let path = folder.join(name);
        std::fs::write(&path, text).expect("the folder takes files");
        path.to_str().expect("a plain path").to_string()
    });
    [urdf, graph]
}

#[test]
fn a_missing_mesh_is_warned_of_by_every_command_that_meets_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let [urdf, graph] = robot_of_a_missing_mesh(folder.path());
    for arguments in [
        &["robot", "check", &urdf][..],
        &["check", &graph],
        &["run", &graph, "--clock", "lockstep", "--hosting", "inline", "--for", "0.1 s"],
    ] {
        let (code, errors) = tried(arguments);
        assert_eq!(code, Some(0), "{arguments:?}: {errors}");
        assert!(
            errors.contains("warning") && errors.contains("package://nowhere/arm.stl"),
            "{arguments:?}: {errors}"
        );
    }
}

#[test]
fn a_xacro_file_is_told_from_a_faulty_urdf() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("arm.urdf.xacro");
    std::fs::write(&file, "<robot name=\"r\">\n<xacro:include filename=\"x\"/></robot>").expect("a file");
    let (code, errors) = tried(&["robot", "check", file.to_str().expect("plain")]);
    assert!(code == Some(3) && errors.contains("this is a xacro file, not yet URDF"), "{errors}");
}
