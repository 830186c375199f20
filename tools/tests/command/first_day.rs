//! Typical mistakes on the first day: each causes an error or a warning that names it.
//!
//! In graphs: a goal out of reach, a start out of limits, a wrong frame, no unit and a wrong one, numbers of
//! another type and count, degrees, keys that are misspelt or missing. On the command line: a wrong option, a
//! time without a unit; others are in `typed.rs`. In robots: missing meshes, xacro, nothing to collide with,
//! settings that do not fit. In other files: a recording without a time, an invalid number, and one kind of
//! file in place of another. `expect.rs` has a goal out of reach that is tried anyway.

use std::path::Path;

use crate::program::run;

pub(crate) const REACH: &str = "../graphs/panda-reach.toml";

/// Exit code and standard error.
pub(crate) fn tried(arguments: &[&str]) -> (Option<i32>, String) {
    let output = run(arguments);
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn broken_graph_is_refused_with_value_and_advice() {
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
        // Degrees in place of radians.
        (
            "physics.config.position=[90.0,0.0,0.0,-1.5,0.0,1.5,0.0,0.0]",
            &["joint `panda_joint1` starts at 90", "in rad: 90 degrees are 1.5708 rad"],
        ),
        ("robot.panda.start=[0.0,-45.0,0.0,-1.5,0.0,1.5,0.0,0.0]", &["-45 degrees are -0.7854 rad"]),
        ("physics.config.pose=hoem", &["no pose is named \"hoem\""]),
        // A frame that does not exist, and one that no joint moves.
        ("policy.config.frame=panda_hnad", &["did you mean \"panda_hand\"?"]),
        ("policy.config.frame=panda_link0", &["no joint moves it", "panda_hand_tcp"]),
        // A joint that does not exist, and one that is held outside its limits.
        (
            "robot.panda.joints=[\"panda_joint11\"]",
            &["no joint `panda_joint11`", "did you mean `panda_joint1`?"],
        ),
        ("robot.panda.fixed={panda_finger_joint1=0.5}", &["held at 0.5, outside its limits 0 to 0.04"]),
        // Two models.
        ("robot.panda.mjcf=\"panda\"", &["robot `panda` has two models", "keep one of `urdf` and `mjcf`"]),
        // No unit, and a wrong one.
        ("policy.config.goals=[{offset=[0.1,0.0,0.0],duration=1}]", &["expected a time with its unit"]),
        (
            "policy.config.goals=[{offset=[0.1,0.0,0.0],duration=\"1 m\"}]",
            &["unknown unit \"m\"", "ns, us, ms, s and min"],
        ),
        ("physics.rate=1000", &["add its unit: \"1000 Hz\""]),
        // Numbers of another type, and of another count.
        (
            "controller.config.kp=\"stiff\"",
            &["expected one number, or a list with one number per joint", "controller.config.kp=\"stiff\""],
        ),
        ("controller.config.kp=[1.0,2.0]", &["2 numbers, expected 8: one per joint", "panda_joint1"]),
        ("controller.config.damping=\"some\"", &["found \"some\", expected a number"]),
        (
            "policy.config.goals=[{offset=[0.1,0.0],duration=\"1 s\"}]",
            &["found 2 values, expected a list of 3"],
        ),
        // Keys that are misspelt, missing, or in the wrong table.
        ("policy.config.goals=[{offset=[0.1,0.0,0.0],duraton=\"1 s\"}]", &["did you mean `duration`?"]),
        ("policy.config={}", &["key `goals` is missing"]),
        ("controller.config.tasks=[{cartesain={}}]", &["found `cartesain`", "did you mean `cartesian`?"]),
        ("policy.params={speed=5.0}", &["parameter `speed` is 5, expected from 0 to 2"]),
    ] {
        let (code, errors) = tried(&["check", REACH, "--set", mistake]);
        assert_eq!(code, Some(3), "{mistake}: {errors}");
        // Long lines wrap between words.
        let errors = errors.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(words.iter().all(|words| errors.contains(words)), "{mistake}: {errors}");
    }
}

#[test]
fn unknown_option_is_answered_with_the_nearest() {
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
    assert!(
        code == Some(2) && errors.contains("'--for <DURATION>'") && errors.contains("without a unit"),
        "{errors}"
    );
}

#[test]
fn limits_in_degrees_are_reported_in_radians() {
    let folder = tempfile::tempdir().expect("a folder");
    let [urdf, _] = bare_robot(folder.path());
    let text = std::fs::read_to_string(&urdf).expect("it was written");
    let text = text.replace("lower=\"-1\" upper=\"1\"", "lower=\"-90\" upper=\"180\"");
    let (code, errors) = tried(&["robot", "check", &file(folder.path(), "degrees.urdf", &text)]);
    let message = errors.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(code == Some(0) && message.contains("if these are degrees, write -1.5708 to 3.1416"), "{errors}");
}

/// Writes a file into a folder and returns its path.
pub(crate) fn file(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    std::fs::write(&path, text).expect("the folder takes files");
    path.to_str().expect("a plain path").to_string()
}

/// A robot without shapes or a profile, and a graph with it and a table.
pub(crate) fn bare_robot(folder: &Path) -> [String; 2] {
    let urdf = r#"<robot name="bare"><link name="base"/><link name="arm"><inertial><mass value="1"/>
        <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="elbow" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
        <limit lower="-1" upper="1" effort="10" velocity="1"/></joint></robot>"#;
    let graph = r#"
        name = "bare"

        [[world.objects]]
        name     = "table"
        shape    = { box = { size = [1.0, 1.0, 0.1] } }
        position = [0.0, 0.0, -0.5]

        [robot.arm]
        urdf  = "bare.urdf"
        start = 0.25
        gains = { kp = 20.0, kd = [2.0] }
        frame = "arm"

        [component.physics]
        kind      = "physics.articulated"
        robot     = "arm"
        rate      = "1 kHz"
        budget    = "100 us"
        subscribe = { joint_command = "joint_command" }
        publish   = { joint_state = "joint_state" }

        [component.controller]
        kind      = "control.qp"
        robot     = "arm"
        rate      = "500 Hz"
        budget    = "100 us"
        subscribe = { joint_state = "joint_state" }
        publish   = { joint_command = "joint_command" }
        config    = { tasks = [{ posture = {} }] }
        "#;
    [file(folder, "bare.urdf", urdf), file(folder, "bare.toml", graph)]
}

#[test]
fn robot_without_shapes_warns_in_every_command() {
    let folder = tempfile::tempdir().expect("a folder");
    let [urdf, graph] = bare_robot(folder.path());
    for arguments in [
        &["robot", "check", &urdf][..],
        &["check", &graph],
        &["run", &graph, "--clock", "lockstep", "--hosting", "inline", "--for", "0.1 s"],
    ] {
        let (code, errors) = tried(arguments);
        let words = errors.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(code, Some(0), "{arguments:?}: {errors}");
        assert!(words.contains("passes through the ground and all objects"), "{arguments:?}: {errors}");
    }
}

#[test]
fn graph_settings_of_a_robot_reach_all_components() {
    let folder = tempfile::tempdir().expect("a folder");
    let [_, graph] = bare_robot(folder.path());
    let output =
        run(&["run", &graph, "--clock", "lockstep", "--hosting", "inline", "--for", "1 s", "--json"]);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("a report");
    // It starts there without a profile, and the controller holds its home pose with the gains.
    let held = report["results"]["physics"]["joint_position"][0].as_f64().expect("a position");
    assert!((held - 0.25).abs() < 1e-3, "{held}");
    for (mistake, words) in [
        ("robot.arm.start=9.0", &["joint `elbow` starts at 9, outside its limits -1 to 1"][..]),
        ("robot.arm.start=[0.1,0.2]", &["2 numbers, expected 1: one per joint, in this order: elbow"]),
        ("robot.arm.start=\"redy\"", &["no pose is named \"redy\" (there are zero)"]),
        ("robot.arm.frame=\"amr\"", &["has no link \"amr\"", "did you mean \"arm\"?"]),
        ("robot.arm.frame=\"base\"", &["no joint moves it"]),
        ("robot.arm.gains={kp=-1.0,kd=1.0}", &["`kp` has -1, expected a finite number of at least 0"]),
        ("robot.arm.gains={kp=1.0,ki=1.0}", &["unknown key `ki`"]),
    ] {
        let (code, errors) = tried(&["check", &graph, "--set", mistake]);
        let message = errors.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(code, Some(3), "{mistake}: {errors}");
        assert!(words.iter().all(|words| message.contains(words)), "{mistake}: {errors}");
    }
}

#[test]
fn wrong_files_and_untimed_recordings_are_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let letters = file(folder.path(), "letters.jsonl", "{\"duration\": 1.0, \"x\": [0, 1, 2]}\n");
    let untimed = file(folder.path(), "untimed.csv", "x,y\n0,0\n1,2\n2,3\n3,4\n");
    let wordy = file(folder.path(), "wordy.csv", "time_s,x\n0,0\n0.1,one\n");
    let output = folder.path().join("out.json");
    let output = output.to_str().expect("a plain path");
    for (arguments, words) in [
        (&["library", "inspect", &letters][..], "not a motion library: it begins with `{\\\"durati`"),
        (
            &["primitive", "show", &letters],
            "the file is not a movement primitive; `motorium primitive fit` creates primitives",
        ),
        (&["primitive", "fit", &untimed, "--output", output], "by `--rate HZ`"),
        (
            &["primitive", "fit", &wordy, "--output", output],
            "line 3, column 2 (`x`): found `one`, expected a number",
        ),
        (
            &["library", "build", &wordy, "--output", output],
            "line 3, column 2 (`x`): found `one`, expected a number",
        ),
    ] {
        let (code, errors) = tried(arguments);
        let message = errors.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(code == Some(1) && message.contains(words), "{arguments:?}: {errors}");
    }
}

/// A robot whose only shape is a missing mesh file, as URDF and as MJCF, each with a graph.
fn robots_of_a_missing_mesh(folder: &Path) -> [[String; 2]; 2] {
    let urdf = r#"<robot name="mesh"><link name="base"/><link name="arm"><inertial><mass value="1"/>
        <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry>
        <mesh filename="package://nowhere/arm.stl"/></geometry></collision></link><joint name="j" type="revolute">
        <parent link="base"/><child link="arm"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="10" velocity="1"/>
        </joint></robot>"#;
    let graph = r#"
        name = "mesh"
        safety = { stale_after = "25 ms" }

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
    file(folder, "own.toml", profile);
    let mjcf = r#"<mujoco model="mesh"><compiler meshdir="nowhere"/><asset><mesh file="arm.stl"/></asset><worldbody>
        <body name="arm"><joint name="j" axis="0 1 0" range="-57 57" limited="true" actuatorfrcrange="-10 10"/>
        <inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/><geom type="mesh" mesh="arm"/></body></worldbody></mujoco>"#;
    // MJCF has no limits of velocities.
    let graph_of_mjcf = graph.replace("urdf    = \"mesh.urdf\"", "mjcf    = \"mesh.xml\"")
        + "config = { limits = { velocity = 1.0 } }\n";
    [
        [file(folder, "mesh.urdf", urdf), file(folder, "mesh.toml", graph)],
        [file(folder, "mesh.xml", mjcf), file(folder, "mjcf.toml", &graph_of_mjcf)],
    ]
}

#[test]
fn every_command_warns_of_a_missing_mesh() {
    let folder = tempfile::tempdir().expect("a folder");
    for [robot, graph] in robots_of_a_missing_mesh(folder.path()) {
        for arguments in [
            &["robot", "check", &robot][..],
            &["check", &graph],
            &["run", &graph, "--clock", "lockstep", "--hosting", "inline", "--for", "0.1 s"],
        ] {
            let (code, errors) = tried(arguments);
            assert_eq!(code, Some(0), "{arguments:?}: {errors}");
            let message = errors.split_whitespace().collect::<Vec<_>>().join(" ");
            assert!(
                message.contains("warning")
                    && message.contains("link \"arm\": mesh \"")
                    && message.contains("nowhere"),
                "{arguments:?}: {errors}"
            );
            assert!(message.contains("arm.stl\" not found in "), "{arguments:?}: {errors}");
        }
    }
}

/// A robot with one mesh for collisions, and that mesh and another one as visuals, as URDF and as MJCF.
fn robots_of_seen_meshes(folder: &Path) -> [String; 2] {
    let shape =
        |kind: &str, mesh: &str| format!("<{kind}><geometry><mesh filename=\"{mesh}\"/></geometry></{kind}>");
    let shapes = [("collision", "both.stl"), ("visual", "both.stl"), ("visual", "seen.stl")];
    let shapes: String = shapes.iter().map(|(kind, mesh)| shape(kind, mesh)).collect();
    let urdf = format!(
        r#"<robot name="own"><link name="base"/><link name="arm"><inertial><mass value="1"/>
        <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>{shapes}</link><joint name="hinge"
        type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="5"
        velocity="3"/></joint></robot>"#
    );
    let mjcf = r#"<mujoco model="own"><asset><mesh file="both.stl"/><mesh file="seen.stl"/></asset><worldbody>
        <body name="arm"><joint name="hinge"/><inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 0.1"/>
        <geom type="mesh" mesh="both"/><geom type="mesh" mesh="seen" contype="0" conaffinity="0"/></body></worldbody></mujoco>"#;
    [file(folder, "own.urdf", &urdf), file(folder, "own.xml", mjcf)]
}

#[test]
fn missing_visual_mesh_warns_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let robots = robots_of_seen_meshes(folder.path());
    let seen = "visual of link \"arm\": mesh \"seen.stl\" not found";
    let both = "warning: link \"arm\": mesh \"both.stl\" not found";
    for robot in &robots {
        let (code, errors) = tried(&["robot", "check", robot]);
        assert_eq!(code, Some(0), "{errors}");
        for words in [seen, both] {
            assert_eq!(errors.matches(words).count(), 1, "{robot}: {errors}");
        }
        assert_eq!(errors.matches("not found").count(), 2, "{robot}: {errors}");
        assert_eq!(tried(&["robot", "check", robot, "--strict"]).0, Some(3));
    }
    let facet =
        "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
    for mesh in ["both.stl", "seen.stl"] {
        file(folder.path(), mesh, &format!("solid\n{facet}endsolid\n"));
    }
    for robot in robots.iter().map(String::as_str).chain(["panda"]) {
        let (code, errors) = tried(&["robot", "check", robot, "--strict"]);
        assert!(code == Some(0) && errors.is_empty(), "{robot}: {errors}");
    }
}

#[test]
fn unreadable_meshes_are_reported_one_by_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let robots = robots_of_seen_meshes(folder.path());
    file(folder.path(), "both.stl", "solid\nfacet\n");
    file(folder.path(), "seen.stl", "PLY");
    for robot in &robots {
        let (code, errors) = tried(&["robot", "check", robot]);
        let message = errors.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(code, Some(0), "{errors}");
        for (words, line) in [
            (
                "warning: link \"arm\": mesh \"both.stl\" (",
                "cut off; expected a complete .stl, .obj or .dae file",
            ),
            ("warning: visual of link \"arm\": mesh \"seen.stl\" (", "ends after 3 bytes"),
        ] {
            assert_eq!(message.matches(words).count(), 1, "{robot}: {errors}");
            assert!(message.contains(line), "{robot}: {errors}");
        }
        // the position of the reference
        assert_eq!(message.matches(&format!("({robot}:")).count(), 2, "{robot}: {errors}");
        assert_eq!(tried(&["robot", "check", robot, "--strict"]).0, Some(3), "{robot}");
        let (code, errors) = tried(&["robot", "draw", robot]);
        assert!(code == Some(0) && errors.contains("mesh \"both.stl\" ("), "{robot}: {errors}");
        let (code, errors) = tried(&["robot", "draw", robot, "--visual"]);
        assert!(code == Some(0) && errors.contains("mesh \"seen.stl\" ("), "{robot}: {errors}");
    }
}

#[test]
fn robots_in_degrees_and_millimetres_fail_a_strict_check() {
    let folder = tempfile::tempdir().expect("a folder");
    let urdf = |mass: &str, kind: &str, limits: &str, rpy: &str| {
        format!(
            r#"<robot name="own"><link name="base"/><link name="arm"><inertial><mass value="1"/>
        <inertia ixx="{mass}" iyy="{mass}" izz="{mass}" ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry>
        <sphere radius="0.1"/></geometry></collision></link><joint name="j" type="{kind}"><parent link="base"/>
        <child link="arm"/><origin xyz="0 0 0.1" rpy="{rpy}"/><axis xyz="0 0 1"/><limit {limits} effort="5"/></joint></robot>"#
        )
    };
    let slide = "lower=\"0\" upper=\"0.3\" velocity=\"0.2\"";
    for (text, words) in [
        (urdf("0.01", "prismatic", slide, "0 3.14159 -4.7"), None),
        (urdf("1e-12", "prismatic", slide, "0 0 0"), Some("expected at least 1.9e-4")),
        (urdf("0.01", "prismatic", slide, "0 0 90"), Some("if these are degrees, write 1.5708")),
        (
            urdf("0.01", "prismatic", "lower=\"0\" upper=\"300\" velocity=\"0.2\"", "0 0 0"),
            Some("limits 0 to 300 m, expected a range of at most 20 m"),
        ),
        (
            urdf("0.01", "prismatic", "lower=\"0\" upper=\"0.3\" velocity=\"200\"", "0 0 0"),
            Some("velocity limit of 200 m/s, expected at most 100 m/s"),
        ),
    ] {
        let robot = file(folder.path(), "own.urdf", &text);
        let (code, errors) = tried(&["robot", "check", &robot, "--strict"]);
        let message = errors.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(code, Some(if words.is_some() { 3 } else { 0 }), "{errors}");
        assert!(words.is_none_or(|words| message.contains(words)), "{errors}");
    }
}

#[test]
fn orientations_of_a_graph_in_degrees_are_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let graph = |base: &str, object: &str| {
        let text = format!(
            "name = \"turned\"\n[robot.arm]\nurdf = \"panda\"\nbase = {{ rpy = [0.0, 0.0, {base}] }}\n\
             [[world.objects]]\nname = \"box\"\nshape = {{ box = {{ size = [0.1, 0.1, 0.1] }} }}\n\
             position = [2.0, 0.0, 0.5]\nrpy = [{object}, 0.0, 0.0]\n\
             [component.physics]\nkind = \"physics.articulated\"\nrobot = \"arm\"\nrate = \"1 kHz\"\nbudget = \"500 us\"\n\
             subscribe = {{ joint_command = \"arm/joint_command\" }}\npublish = {{ joint_state = \"arm/joint_state\" }}\n\
             [component.policy]\nkind = \"policy.home\"\nrobot = \"arm\"\nrate = \"100 Hz\"\nbudget = \"500 us\"\n\
             subscribe = {{ joint_state = \"arm/joint_state\" }}\npublish = {{ joint_command = \"arm/joint_command\" }}\n"
        );
        let (code, errors) = tried(&["check", &file(folder.path(), "turned.toml", &text)]);
        assert!(code.is_some(), "{errors}");
        errors.split_whitespace().collect::<Vec<_>>().join(" ")
    };
    let found = graph("90.0", "45.0");
    assert!(found.contains("`rpy` of `base` has an angle of 90 rad"), "{found}");
    assert!(found.contains("`rpy` of object `box` has an angle of 45 rad"), "{found}");
    assert!(!graph("-4.7", "3.14159").contains("degrees"), "{}", graph("-4.7", "3.14159"));
}

#[test]
fn a_run_with_json_prints_warnings_on_standard_error() {
    let folder = tempfile::tempdir().expect("a folder");
    let world =
        "<mujoco><worldbody><geom type=\"plane\" size=\"0 0 1\" priority=\"2\"/></worldbody></mujoco>";
    let world = format!("world.file={:?}", file(folder.path(), "world.xml", world));
    let [[_, graph], _] = robots_of_a_missing_mesh(folder.path());
    let arguments =
        ["run", &graph, "--clock", "lockstep", "--hosting", "inline", "--for", "10 ms", "--set", &world];
    for json in [&[][..], &["--json"]] {
        let output = run(&[&arguments[..], json].concat());
        let errors = String::from_utf8_lossy(&output.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(errors.contains("priority of <geom> ignored"), "{errors}");
        let report = String::from_utf8_lossy(&output.stdout);
        assert!(!report.contains("priority of <geom>"), "{report}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&report).is_ok(), !json.is_empty(), "{report}");
    }
}

#[test]
fn mistake_in_a_world_is_reported_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let graph = |world: &str| {
        let text = format!(
            "name = \"seen\"\n[robot.dog]\nurdf = \"quadruped\"\n{world}\n\
             [component.physics]\nkind = \"physics.articulated\"\nrobot = \"dog\"\nrate = \"1 kHz\"\nbudget = \"500 us\"\n\
             subscribe = {{ joint_command = \"command\" }}\n\
             publish = {{ joint_state = \"joints\", base_state = \"base\" }}\n\
             [component.imu]\nkind = \"sensor.imu\"\nrobot = \"dog\"\nrate = \"500 Hz\"\nbudget = \"50 us\"\n\
             subscribe = {{ base_state = \"base\" }}\npublish = {{ imu = \"imu\" }}\n\
             [component.lidar]\nkind = \"sensor.lidar\"\nrobot = \"dog\"\nrate = \"10 Hz\"\nbudget = \"1 ms\"\n\
             subscribe = {{ base_state = \"base\", joint_state = \"joints\" }}\npublish = {{ ranges = \"ranges\" }}\n"
        );
        let (code, errors) = tried(&["check", &file(folder.path(), "seen.toml", &text)]);
        assert_eq!(code, Some(3), "{errors}");
        errors
    };
    let mjcf = "<mujoco><worldbody>\n<geom type=\"box\" size=\"1 1\"/></worldbody></mujoco>";
    let sdf = "<sdf version=\"1.9\"><world name=\"w\"><model name=\"m\"><static>true</static><link name=\"l\">\
               <collision name=\"c\"><geometry><box>\n<size>1 1</size></box></geometry></collision></link></model></world></sdf>";
    for (name, text) in [("a.xml", mjcf), ("b.sdf", sdf)] {
        let path = file(folder.path(), name, text);
        let errors = graph(&format!("[world]\nfile = \"{path}\""));
        assert_eq!(errors.matches(&format!("{name}:2:1: ")).count(), 1, "{errors}");
    }
    for (world, found) in [
        ("[world]\ngravity = [0.0, 0.0, -9810.0]\n", "`gravity` is -9810"),
        ("[world.ground]\nfrictoin = 0.5\n", "did you mean `friction`?"),
        ("[world.ground]\nfriction = -0.5\n", "`friction` is -0.5"),
    ] {
        let errors = graph(world);
        assert_eq!(errors.matches(found).count(), 1, "{errors}");
    }
}

#[test]
fn xacro_file_is_distinguished_from_a_faulty_urdf() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("arm.urdf.xacro");
    std::fs::write(&file, "<robot name=\"r\">\n<xacro:include filename=\"x\"/></robot>").expect("a file");
    let (code, errors) = tried(&["robot", "check", file.to_str().expect("plain")]);
    assert!(code == Some(3) && errors.contains("this is a xacro file, not yet URDF"), "{errors}");
}
