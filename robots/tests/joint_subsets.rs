//! Robots with a subset of their joints moved by a graph, and robots in MJCF files.

use std::path::Path;

use motorium_robots::{
    Dynamics, Kinematics, LoadOptions, Loaded, MimicMode, Model, PackagePath, RobotSource, RobotSourceError,
    parse_urdf,
};
use nalgebra::DMatrix;
use serde_json::{Value, json};

fn load(text: &str, settings: &Value) -> Result<Loaded, RobotSourceError> {
    RobotSource {
        name: "robot",
        text,
        base: Path::new("."),
        settings: Some(settings),
        ..RobotSource::default()
    }
    .load()
}

fn whole(text: &str) -> Loaded {
    motorium_robots::load(text, Path::new(".")).unwrap()
}

fn refused(text: &str, settings: Value) -> String {
    load(text, &settings).unwrap_err().to_string()
}

const ARM: [&str; 7] = [
    "panda_joint1",
    "panda_joint2",
    "panda_joint3",
    "panda_joint4",
    "panda_joint5",
    "panda_joint6",
    "panda_joint7",
];

#[test]
fn arm_without_fingers_keeps_the_data_of_its_joints() {
    let all = whole("panda");
    let (full, home) =
        (all.profile.as_ref().unwrap(), all.profile.as_ref().unwrap().home(&all.model).unwrap());
    // by its joints, by its end effector, and by the held joints alone
    for settings in [
        json!({ "joints": ARM }),
        json!({ "joints": ["hand"] }),
        json!({ "fixed": { "panda_finger_joint1": home[7] } }),
    ] {
        let arm = load("panda", &settings).unwrap();
        let (model, profile) = (&arm.model, arm.profile.as_ref().unwrap());
        assert_eq!(model.joint_names(), ARM);
        assert_eq!(profile.home(model).unwrap().as_slice(), &home.as_slice()[..7]);
        let (gains, of_all) = (profile.gains(model).unwrap(), full.gains(&all.model).unwrap());
        assert_eq!(gains.kp.as_slice(), &of_all.kp.as_slice()[..7]);
        let limits = profile.acceleration_limit(model).unwrap();
        assert_eq!(limits.as_slice(), &full.acceleration_limit(&all.model).unwrap().as_slice()[..7]);
        profile.check(model).unwrap();
        assert!(profile.end_effectors["hand"].fingers.is_empty());
        // held parts are carried: the mass matrix is a block of the whole robot's
        assert!((model.mass() - all.model.mass()).abs() < 1e-12);
        let mass = |model: &motorium_robots::Model, q: &[f64]| {
            let mut mass = DMatrix::zeros(model.nv(), model.nv());
            Dynamics::new(model).crba(model, q, &mut mass);
            mass
        };
        let difference =
            mass(model, &home.as_slice()[..7]) - mass(&all.model, home.as_slice()).view((0, 0), (7, 7));
        assert!(difference.amax() < 1e-9, "{difference}");
    }
}

#[test]
fn joint_is_held_at_its_configured_or_initial_position() {
    let humanoid = whole("humanoid");
    let profile = humanoid.profile.as_ref().unwrap();
    let left = &profile.end_effectors["left_hand"].joints;
    let arm = load("humanoid", &json!({ "joints": ["left_hand"] })).unwrap();
    let mut names: Vec<_> = left.clone();
    names.sort_by_key(|name| humanoid.model.joint_index(name));
    assert_eq!(arm.model.joint_names(), names);
    let kept = arm.profile.as_ref().unwrap();
    assert!(kept.end_effectors.contains_key("left_hand"));
    kept.check(&arm.model).unwrap();
    // with the fingers of a Panda wide open, a fingertip is where it is in the whole robot at that position
    let place = |robot: &Loaded, q: &[f64]| {
        let mut kinematics = motorium_robots::Kinematics::new(&robot.model);
        kinematics.update(&robot.model, q);
        kinematics.pose(&robot.model, robot.model.frame("panda_leftfinger").unwrap())
    };
    let (all, open) =
        (whole("panda"), load("panda", &json!({ "fixed": { "panda_finger_joint1": 0.03 } })).unwrap());
    let mut q = all.profile.as_ref().unwrap().home(&all.model).unwrap();
    let arm = q.as_slice()[..7].to_vec();
    q[7] = 0.03;
    let moved = place(&open, &arm).inverse() * place(&all, q.as_slice());
    assert!(moved.translation.vector.norm() < 1e-12, "{moved}");
}

#[test]
fn gains_and_start_apply_to_the_moving_joints() {
    let start = [0.1, -0.5, 0.0, -2.0, 0.0, 1.5, 0.7];
    let arm =
        load("panda", &json!({ "joints": ["hand"], "start": start, "gains": { "kp": 300.0, "kd": 20.0 } }))
            .unwrap();
    let profile = arm.profile.unwrap();
    assert_eq!(profile.home(&arm.model).unwrap().as_slice(), start);
    assert_eq!(profile.gains(&arm.model).unwrap().kp.as_slice(), [300.0; 7]);
}

#[test]
fn unknown_joints_are_refused_with_a_suggestion() {
    let message = refused("panda", json!({ "joints": ["panda_joint11"] }));
    assert!(message.contains("`joints`") && message.contains("did you mean `panda_joint1`?"), "{message}");
    let message = refused("panda", json!({ "joints": ["hnad"] }));
    assert!(message.contains("did you mean `hand`?"), "{message}");
    let message = refused("panda", json!({ "fixed": { "finger": 0.0 } }));
    assert!(message.contains("`fixed`") && message.contains("no joint `finger`"), "{message}");
    let message = refused("panda", json!({ "fixed": { "panda_finger_joint1": 0.5 } }));
    assert!(message.contains("held at 0.5, outside its limits 0 to 0.04"), "{message}");
    let message = refused("panda", json!({ "joints": ["panda_joint1"], "fixed": { "panda_joint1": 0.0 } }));
    assert!(message.contains("either moves or is held"), "{message}");
    let message = refused("panda", json!({ "joints": [] }));
    assert!(message.contains("all joints are held"), "{message}");
}

const SWING: &str = r#"<mujoco model="swing"><worldbody><body name="rod" pos="0 0 1">
  <joint name="hinge" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02"/>
</body></worldbody></mujoco>"#;
const BAR: &str = r#"<robot name="bar"><link name="bar"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"#;

#[test]
fn mjcf_file_is_preferred_if_the_graph_requests_it() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("swing.xml"), SWING).unwrap();
    std::fs::write(folder.path().join("bar.urdf"), BAR).unwrap();
    let settings = json!({ "mjcf": true });
    let load = |text: &str| {
        RobotSource {
            name: "robot",
            text,
            base: folder.path(),
            settings: Some(&settings),
            ..RobotSource::default()
        }
        .load()
    };
    assert_eq!(load("swing.xml").unwrap().model.joint_names(), ["hinge"]);
    assert_eq!(load(".").unwrap().model.name(), "swing");
    assert_eq!(motorium_robots::load(".", folder.path()).unwrap().model.name(), "bar");
    for text in ["bar.urdf", "panda"] {
        let message = load(text).unwrap_err().to_string();
        assert!(message.contains("is not an MJCF file") && message.contains("`urdf`"), "{message}");
    }
}

/// Returns the model for viewers.
fn seen(robot: &Loaded) -> Model {
    let drawn = robot.drawn().unwrap().unwrap();
    let read = parse_urdf(&drawn.text, None, MimicMode::Follow, &PackagePath::default());
    read.unwrap_or_else(|error| panic!("{error}\n{}", drawn.text)).model
}

/// Returns the largest distance, m and rad, between frames of two models at the same joint positions,
/// relative to the root of each.
fn apart(one: &Model, other: &Model) -> f64 {
    assert_eq!(one.joint_names(), other.joint_names());
    let poses = |model: &Model| {
        let mut kinematics = Kinematics::new(model);
        let mut q = model.neutral();
        let first = q.len() - model.joint_count();
        q[first..].iter_mut().enumerate().for_each(|(joint, q)| *q = 0.1 + 0.05 * joint as f64);
        kinematics.update(model, &q);
        let frames = || one.frames().iter().filter(|frame| !frame.in_world);
        let root = frames().find(|frame| frame.body.is_none()).unwrap();
        let of = |name: &str| kinematics.pose(model, model.frame(name).unwrap());
        frames().map(|frame| of(&root.name).inv_mul(&of(&frame.name))).collect::<Vec<_>>()
    };
    let pairs = poses(one).into_iter().zip(poses(other));
    let distance = pairs.map(|(one, other)| (one.to_homogeneous() - other.to_homogeneous()).norm());
    distance.fold(0.0, f64::max)
}

#[test]
fn held_joints_are_drawn_at_their_positions() {
    for (name, settings) in [
        ("panda", json!({ "joints": ["hand"], "fixed": { "panda_finger_joint1": 0.03 } })),
        ("humanoid", json!({ "joints": ["left_hand"] })),
        ("quadruped", json!({ "fixed": { "front_left_knee": -1.0 } })),
    ] {
        let robot = load(name, &settings).unwrap();
        let distance = apart(&robot.model, &seen(&robot));
        assert!(distance < 1e-9, "{name}: a link is drawn {distance} off");
        // the visuals of a link are unchanged from the file
        let (whole, text) = (whole(name).text().unwrap().unwrap(), robot.drawn().unwrap().unwrap().text);
        assert_eq!(text.matches("<visual").count(), whole.matches("<visual").count(), "{name}");
        assert!(text.matches("type=\"fixed\"").count() > whole.matches("type=\"fixed\"").count(), "{name}");
    }
}

const GRIPPER: &str = r#"<mujoco model="gripper"><worldbody><body name="palm" pos="0 0 1">
  <joint name="turn" axis="0 0 1"/><geom type="box" size="0.05 0.05 0.02"/>
  <body name="left" pos="0 0.02 0.05"><joint name="left" type="slide" axis="0 1 0" range="0 0.04"/>
    <geom type="box" size="0.01 0.01 0.03" group="3"/>
    <geom type="sphere" size="0.0123" group="2" contype="0" conaffinity="0" mass="0"/></body>
</body></worldbody></mujoco>"#;

#[test]
fn mjcf_robot_with_held_joints_shows_its_visual_shapes() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("gripper.xml"), GRIPPER).unwrap();
    let settings = json!({ "fixed": { "left": 0.03 } });
    let source = RobotSource {
        name: "robot",
        text: "gripper.xml",
        base: folder.path(),
        settings: Some(&settings),
        ..RobotSource::default()
    };
    let robot = source.load().unwrap();
    assert_eq!(robot.model.joint_names(), ["turn"]);
    assert!(apart(&robot.model, &seen(&robot)) < 1e-9);
    let text = robot.drawn().unwrap().unwrap().text;
    assert!(text.contains("<sphere radius=\"0.0123\"/>") && !text.contains("0.02 0.02 0.06"), "{text}");
}

#[test]
fn profile_is_created_when_needed() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("swing.xml"), SWING).unwrap();
    let profile = |settings: Value| {
        let source = RobotSource {
            name: "robot",
            text: "swing.xml",
            base: folder.path(),
            settings: Some(&settings),
            ..RobotSource::default()
        };
        source.load().unwrap().profile
    };
    assert!(motorium_robots::load("swing.xml", folder.path()).unwrap().profile.is_none());
    assert!(profile(json!({ "mjcf": true })).is_none());
    assert!(profile(json!({ "joints": ["hinge"] })).is_none());
    assert_eq!(profile(json!({ "mjcf": true, "start": 0.3 })).unwrap().home, "start");
    assert!(profile(json!({ "gains": { "kp": 1.0, "kd": 0.1 } })).is_some());
}

#[test]
fn mismatched_home_pose_is_reported_at_its_key() {
    // the profile has no joint that mimics another
    let options = LoadOptions { mimic: MimicMode::Independent, ..LoadOptions::default() };
    for (key, settings) in
        [("fixed", json!({ "fixed": { "panda_joint1": 0.0 } })), ("joints", json!({ "joints": ["hand"] }))]
    {
        let source =
            RobotSource { name: "robot", text: "panda", settings: Some(&settings), ..RobotSource::default() };
        let message = source.load_with(&options).unwrap_err().to_string();
        assert!(message.contains(&format!("`{key}`: ")), "{message}");
    }
}
