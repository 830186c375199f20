//! `motorium robot profile`: from a robot's file alone to a robot that holds its pose.

use std::path::{Path, PathBuf};

use crate::program::{complaint, json, printed, run};
use serde_json::Value;

/// A folder with a robot's file, without the profile of the test robot.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new(robot: &str) -> Self {
        let folder = Self(tempfile::tempdir().expect("a folder"));
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(robot);
        std::fs::copy(&file, folder.path("my-robot.urdf")).unwrap_or_else(|error| panic!("{robot}: {error}"));
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        self.path(name).to_str().expect("a path of text").to_string()
    }

    /// Writes the first profile.
    fn profile(&self) {
        let message = printed(&[
            "robot",
            "profile",
            &self.text("my-robot.urdf"),
            "--output",
            &self.text("lab/first.toml"),
        ]);
        assert!(message.contains("profile = ") && message.contains("first.toml"), "{message}");
    }

    /// A graph that holds the home pose by the controller, with the file and the profile in separate folders.
    fn graph(&self) -> String {
        let graph = r#"
            name = "hold"
            clock = "lockstep"
            duration = "2 s"

            [robot.mine]
            urdf = "../my-robot.urdf"
            profile = "../lab/first.toml"

            [component.physics]
            kind = "physics.articulated"
            robot = "mine"
            rate = "1 kHz"
            subscribe = { joint_command = "command" }
            publish = { joint_state = "true_state" }

            [component.encoder]
            kind = "sensor.joint_encoder"
            robot = "mine"
            trigger = "true_state"
            subscribe = { joint_state = "true_state" }
            publish = { measured = "state" }

            [component.controller]
            kind = "control.qp"
            robot = "mine"
            trigger = "state"
            subscribe = { joint_state = "state" }
            publish = { joint_command = "command" }
            config = { tasks = [{ posture = {} }] }
        "#;
        std::fs::create_dir_all(self.path("graphs")).expect("a folder");
        std::fs::write(self.path("graphs/hold.toml"), graph).expect("written");
        self.text("graphs/hold.toml")
    }
}

#[test]
fn bare_robot_holds_the_pose_of_its_first_profile() {
    for robot in [
        "robots/catalogue/iiwa14/iiwa14.urdf",
        "robots/catalogue/ur5e/ur5e.urdf",
        "robots/catalogue/panda/panda.urdf",
        "robots/tests/fixtures/branching.urdf",
    ] {
        let folder = Folder::new(robot);
        std::fs::create_dir(folder.path("lab")).expect("a folder");
        folder.profile();
        let graph = folder.graph();
        let output = run(&["run", &graph, "--hosting", "inline", "--json"]);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{robot}: {errors}");
        let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
        let physics = &report["results"]["physics"];
        // A posture task holds the home pose that the profile names.
        let shown = json(&["robot", "show", &folder.text("my-robot.urdf"), "--json"]);
        assert!(shown["profile"].is_null(), "the profile is found by the graph alone");
        let profile = std::fs::read_to_string(folder.path("lab/first.toml")).expect("readable");
        let home =
            motorium_robots::Profile::parse(&profile).expect("a profile").poses["home"].values().to_vec();
        let held = physics["joint_position"].as_array().expect("positions");
        assert_eq!(held.len(), home.len(), "{robot}");
        for (joint, (held, home)) in held.iter().zip(&home).enumerate() {
            let held = held.as_f64().expect("a number");
            assert!(
                (held - home).abs() < 0.02,
                "{robot}: joint {joint} is at {held}, home is {home}\n{profile}"
            );
        }
        assert!(physics["steps_at_a_joint_limit"].as_u64() == Some(0), "{robot}: {physics}");
    }
}

#[test]
fn first_graph_stands_or_holds_and_reaches_a_pose() {
    for robot in [
        "robots/catalogue/quadruped/quadruped.urdf",
        "robots/catalogue/humanoid/humanoid.urdf",
        "robots/catalogue/panda/panda.urdf",
        "robots/tests/fixtures/branching.urdf",
    ] {
        let folder = Folder::new(robot);
        let (file, profile, graph) =
            (folder.text("my-robot.urdf"), folder.text("first.toml"), folder.text("reach.toml"));
        let message = printed(&["robot", "profile", &file, "--output", &profile, "--graph", &graph]);
        assert!(message.contains("motorium run ") && message.contains(" kg"), "{message}");
        let output = run(&["run", &graph, "--hosting", "inline", "--json"]);
        let (errors, graph) =
            (String::from_utf8_lossy(&output.stderr), std::fs::read_to_string(&graph).expect("readable"));
        assert!(output.status.success(), "{robot}: {errors}\n{graph}");
        let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
        let reached = ["policy", "controller"].map(|name| report["results"][name]["goals_reached"].as_u64());
        assert!(reached.contains(&Some(2)), "{robot}: {report}");
    }
}

/// Uncomments the tables of a base on wheels, and adds its floating base.
fn uncomment_wheels(profile: &Path) {
    let text = std::fs::read_to_string(profile).expect("readable");
    let (head, rest) = text.split_once("\n# [mobile_base]\n").expect("wheels, as a comment");
    let (table, tail) = rest.split_once("\n\n").expect("further tables");
    let table: String = table.lines().map(|line| line[1..].to_owned() + "\n").collect();
    let head = head.replacen("\njoints = ", "\nbase = \"floating\"\njoints = ", 1);
    std::fs::write(profile, format!("{head}\n[mobile_base]\n{table}\n{tail}")).expect("written");
}

#[test]
fn base_drives_on_its_drafted_wheels_and_casters() {
    let folder = Folder::new("robots/catalogue/differential-drive/differential-drive.urdf");
    std::fs::create_dir(folder.path("lab")).expect("a folder");
    folder.profile();
    uncomment_wheels(&folder.path("lab/first.toml"));
    let graph = r#"
        name = "drive"
        clock = "lockstep"
        duration = "12 s"

        [world]
        ground = { friction = 0.8 }

        [robot.mine]
        urdf = "my-robot.urdf"
        profile = "lab/first.toml"

        [component.physics]
        kind = "physics.articulated"
        robot = "mine"
        rate = "500 Hz"
        subscribe = { joint_command = "command" }
        publish = { joint_state = "state", base_state = "base" }

        [component.controller]
        kind = "control.wheels"
        robot = "mine"
        trigger = "state"
        subscribe = { joint_state = "state", target = "velocity" }
        publish = { joint_command = "command", odometry = "odometry" }

        [component.policy]
        kind = "policy.waypoints"
        robot = "mine"
        trigger = "odometry"
        subscribe = { odometry = "odometry", true_base = "base" }
        publish = { target = "velocity" }
        config = { goals = [{ position = [0.4, 0.0], yaw = 1.5708 }, { position = [0.4, 0.4], yaw = 3.1416 }] }
    "#;
    std::fs::write(folder.path("drive.toml"), graph).expect("written");
    let report = json(&["run", &folder.text("drive.toml"), "--hosting", "inline", "--json"]);
    let base = &report["results"]["physics"]["base_position"];
    let error = [0.4, 0.4].iter().zip(0..).map(|(goal, axis): (&f64, usize)| {
        let position = base[axis].as_f64().expect("a number");
        (position - goal).abs()
    });
    assert!(error.fold(0.0, f64::max) < 5e-3, "{base}");
    let policy = &report["results"]["policy"];
    assert_eq!(policy["goals_reached"], 2, "{report}");
    // a caster with friction pulls the base 60 um off its line
    assert!(policy["path_error_m"].as_f64().is_some_and(|error| error < 1e-5), "{policy}");
}

#[test]
fn first_graph_of_a_floating_base_on_wheels_does_not_stand() {
    let folder = Folder::new("robots/catalogue/differential-drive/differential-drive.urdf");
    let (file, profile, graph) =
        (folder.text("my-robot.urdf"), folder.text("first.toml"), folder.text("reach.toml"));
    let arguments = ["robot", "profile", &file, "--floating-base", "--output", &profile, "--graph", &graph];
    printed(&arguments);
    let text = std::fs::read_to_string(folder.path("first.toml")).expect("readable");
    assert!(text.contains("\n[feet.caster]\n") && !text.contains("-0.0"), "{text}");
    let graph = std::fs::read_to_string(&graph).expect("readable");
    assert!(graph.contains("policy.trajectory") && !graph.contains("control.qp"), "{graph}");
}

#[test]
fn first_profile_has_a_tip_and_a_bent_arm() {
    let text = printed(&["robot", "profile", "ur5e"]);
    assert!(text.contains("frame  = \"tool0\""), "{text}");
    let profile = motorium_robots::Profile::parse(&text).expect("a profile");
    let home = profile.poses["home"].values();
    assert!(home[2].abs() > 0.5, "the elbow is bent: {home:?}");
    let arm = motorium_robots::load("ur5e", Path::new(".")).expect("there").model;
    profile.check(&arm).expect("it fits");
    let (gains, limits) =
        (profile.gains(&arm).expect("gains"), profile.acceleration_limit(&arm).expect("limits"));
    assert!(gains.kp.iter().chain(gains.kd.iter()).chain(limits.iter()).all(|number| *number > 0.0));
    assert!(text.lines().all(|line| line.chars().count() <= 120), "{text}");
}

#[test]
fn an_edited_profile_is_not_overwritten() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("mine.toml");
    let file = file.to_str().expect("a path of text");
    printed(&["robot", "profile", "iiwa14", "--output", file]);
    std::fs::write(file, "edited").expect("written");
    let message = complaint(&["robot", "profile", "iiwa14", "--output", file]);
    assert!(message.contains("is not overwritten"), "{message}");
    assert_eq!(std::fs::read_to_string(file).expect("readable"), "edited");
}

#[test]
fn bad_profile_is_reported_at_its_place_in_the_graph() {
    let folder = Folder::new("robots/catalogue/iiwa14/iiwa14.urdf");
    std::fs::create_dir(folder.path("lab")).expect("a folder");
    let graph = folder.graph();
    let message = complaint(&["check", &graph]);
    assert!(
        message.contains("hold.toml:8:23") && message.contains("this profile cannot be used"),
        "{message}"
    );
    assert!(message.contains("motorium robot profile FILE"), "{message}");
    let other = printed(&["robot", "profile", "ur5e"]);
    std::fs::write(folder.path("lab/first.toml"), other).expect("written");
    let message = complaint(&["check", &graph]);
    assert!(message.contains("shoulder_pan_joint") && message.contains("hold.toml:8:23"), "{message}");
}
