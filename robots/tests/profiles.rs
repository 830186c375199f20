//! Profiles: parsed, refused, and queried.

use std::path::Path;

use approx::assert_relative_eq;
use motorium_robots::{
    BaseMode, Kinematics, LoadOptions, Profile, ProfileError, Steering, TaskRows, catalogue, draft_profile,
    load, load_with,
};

fn profile(name: &str) -> Profile {
    catalogue().iter().find(|entry| entry.name == name).unwrap().profile.clone()
}

const SMALL: &str = "title = \"t\"\nsources = []\njoints = [\"hinge\"]\nhome = \"a\"\n[poses]\na = [0.0]\n";

fn refused(text: &str) -> ProfileError {
    Profile::parse(text).unwrap_err()
}

#[test]
fn a_profile_with_a_fault_is_refused() {
    let model = load("pendulum", Path::new(".")).unwrap().model;
    let small = Profile::parse(SMALL).unwrap();
    assert!(matches!(small.gains(&model), Err(ProfileError::NoGains)));
    assert!(matches!(refused(&SMALL.replace("[0.0]", "[0.0, 1.0]")), ProfileError::Length { .. }));
    assert!(matches!(refused(&SMALL.replace("home", "hom")), ProfileError::Toml(_)));
    assert!(matches!(refused(&SMALL.replace("\"a\"", "\"b\"")), ProfileError::UnknownPose { .. }));
    let pendulum = profile("pendulum");
    assert_eq!(
        pendulum.pose(&model, "hangin").unwrap_err().to_string(),
        "no pose is named \"hangin\" (did you mean \"hanging\"?)"
    );
    let panda = load("panda", Path::new(".")).unwrap().model;
    assert!(matches!(pendulum.check(&panda), Err(ProfileError::UnknownJoint { .. })));
    assert!(matches!(pendulum.home(&panda), Err(ProfileError::MissingJoint { .. })));
}

#[test]
fn one_number_in_a_profile_stands_for_all_joints() {
    let model = load("planar-3r", Path::new(".")).unwrap().model;
    let text = "title = \"t\"\nsources = []\njoints = [\"joint1\", \"joint2\", \"joint3\"]\nhome = \"zero\"\n\
                [poses]\nzero = 0\nbent = [0.1, 0.2, 0.3]\n[gains]\nkp = 40.0\nkd = [3.0, 2.0, 1.0]\n\
                [limits]\nvelocity = 1.5\n";
    let profile = Profile::parse(text).unwrap();
    profile.check(&model).unwrap();
    assert_eq!(profile.home(&model).unwrap().as_slice(), [0.0; 3]);
    assert_eq!(profile.gains(&model).unwrap().kp.as_slice(), [40.0; 3]);
    assert_eq!(profile.gains(&model).unwrap().kd.as_slice(), [3.0, 2.0, 1.0]);
    assert_eq!(profile.velocity_limit(&model).unwrap().as_slice(), [1.5; 3]);
    // A list of one number is a list of the wrong length.
    let error = refused(&text.replace("kp = 40.0", "kp = [40.0]")).to_string();
    assert_eq!(error, "gains.kp has 1 entries, expected 3: one per joint of `joints`");
    let error = refused(&text.replace("kp = 40.0", "kp = \"stiff\"")).to_string();
    assert!(error.contains("expected one number, or a list with one number per joint"), "{error}");
    let error = refused(&text.replace("velocity = 1.5", "velocity = 0")).to_string();
    assert!(error.contains("the velocity limit of joint \"joint1\" is 0"), "{error}");
}

#[test]
fn what_stands_and_drives_is_checked_too() {
    let with = |tail: &str| refused(&format!("{SMALL}{tail}")).to_string();
    let placed = with("[base_poses]\na = { position = [0.0, 0.0, 1.0] }\n");
    assert!(placed.contains("base = \"floating\""), "{placed}");
    let foot = "[feet.left]\nframe = \"rod\"\n";
    let both = with(&format!("{foot}radius = 0.1\nsole = [0.1, 0.2]\n"));
    assert!(both.contains("foot \"left\" has both"), "{both}");
    let flat = with(&format!("{foot}sole = [0.1, 0.0]\n"));
    assert!(flat.contains("is 0, expected a positive number"), "{flat}");
    let base = "[mobile_base]\nframe = \"rod\"\nwheels = [\"hinge\"]\nwheel_radius = 0.1\n";
    let car = with(&format!("{base}drive = \"ackermann\"\nsteering = [\"hinge\"]\ntrack = 0.3\n"));
    assert_eq!(car, "the mobile base is ackermann, which needs `wheelbase`");
    let differential = with(&format!("{base}drive = \"differential\"\n"));
    assert!(differential.contains("needs `track`"), "{differential}");
    let model = load("pendulum", Path::new(".")).unwrap().model;
    let unknown = Profile::parse(&format!("{SMALL}[feet.left]\nframe = \"rot\"\n")).unwrap();
    let unknown = unknown.check(&model).unwrap_err().to_string();
    assert!(unknown.contains("no link \"rot\" (did you mean \"rod\"?)"), "{unknown}");
    let passive = Profile::parse(&SMALL.replace("[poses]", "passive = [\"hing\"]\n[poses]")).unwrap();
    assert!(matches!(passive.check(&model), Err(ProfileError::UnknownJoint { .. })));
}

#[test]
fn a_floating_robot_stands_where_its_profile_puts_it() {
    let robot = load("quadruped", Path::new(".")).unwrap();
    let (model, profile) = (robot.model, robot.profile.unwrap());
    let q = profile.configuration(&model, "standing").unwrap();
    assert_eq!(q.len(), 19);
    assert_eq!(&q.as_slice()[..2], [0.0, 0.0]);
    // Two segments of 0.16 m at 0.8 rad, and the radius of the foot.
    assert_relative_eq!(q[2], 0.32 * 0.8_f64.cos() + 0.0165, epsilon = 1e-9);
    assert_eq!(&q.as_slice()[3..7], [0.0, 0.0, 0.0, 1.0]);
    assert_eq!(q.rows(7, 12), profile.pose(&model, "standing").unwrap());
}

#[test]
fn the_base_follows_the_profile_unless_configured() {
    let floating = |base| {
        let options = LoadOptions { base, ..LoadOptions::default() };
        let robot = load_with("quadruped", Path::new("."), &options).unwrap();
        let q = robot.profile.unwrap().configuration(&robot.model, "standing").unwrap();
        assert_eq!(q.len(), robot.model.nq());
        robot.model.base().floating
    };
    assert!(floating(BaseMode::AsFile) && floating(BaseMode::Floating) && !floating(BaseMode::Fixed));
}

#[test]
fn a_profile_beside_a_file_makes_its_base_float() {
    let folder = tempfile::tempdir().unwrap();
    let entry = catalogue().iter().find(|entry| entry.name == "pendulum").unwrap();
    std::fs::write(folder.path().join("swing.urdf"), entry.urdf).unwrap();
    let text = SMALL.replace("[poses]", "base = \"floating\"\n[poses]");
    let text = format!("{text}[base_poses]\na = {{ position = [1.0, 2.0, 3.0], rpy = [0.0, 0.0, 1.5] }}\n");
    std::fs::write(folder.path().join("swing.toml"), text).unwrap();
    let robot = load("swing.urdf", folder.path()).unwrap();
    assert_eq!((robot.model.nq(), robot.model.nv()), (8, 7));
    let q = robot.profile.unwrap().configuration(&robot.model, "a").unwrap();
    assert_eq!(&q.as_slice()[..3], [1.0, 2.0, 3.0]);
    assert_relative_eq!(q[5], 0.75_f64.sin(), epsilon = 1e-12);
    assert_relative_eq!(q[6], 0.75_f64.cos(), epsilon = 1e-12);
}

#[test]
fn facts_of_bases_and_rotors_are_there() {
    let car = profile("ackermann").mobile_base.unwrap();
    assert_eq!(car.drive, Steering::Ackermann);
    assert_relative_eq!(car.wheelbase.unwrap(), 0.15875 + 0.17145);
    assert_eq!((car.wheels.len(), car.steering.len()), (4, 2));
    let burger = profile("differential-drive").mobile_base.unwrap();
    assert_eq!((burger.wheel_radius, burger.track), (Some(0.033), Some(0.16)));
    assert_eq!(profile("quadrotor").rotors.len(), 4);
}

/// At zero a `ur5e` is straight in its elbow and turned flat in its wrist: no joint alone leaves that
/// posture.
#[test]
fn the_first_home_of_an_arm_moves_its_tool_in_all_directions() {
    for name in ["ur5e", "panda", "iiwa14"] {
        let arm = load(name, Path::new(".")).unwrap();
        let mut kinematics = Kinematics::new(&arm.model);
        let tool = arm.end_effector(None).unwrap();
        let mut measure = |q: &[f64]| {
            kinematics.update(&arm.model, q);
            kinematics.manipulability(&arm.model, tool, TaskRows::POSE)
        };
        let text = draft_profile(&arm);
        let drafted = measure(Profile::parse(&text).unwrap().home(&arm.model).unwrap().as_slice());
        let makers = measure(arm.profile.as_ref().unwrap().home(&arm.model).unwrap().as_slice());
        assert!(drafted > 0.3 * makers, "{name}: {drafted}, {makers} at its maker's");
        assert!(
            name != "ur5e" || text.contains("inside the limits, and away from singular postures."),
            "{text}"
        );
    }
    let wheels = load("differential-drive", Path::new(".")).unwrap();
    assert!(draft_profile(&wheels).contains("inside the limits.\n"), "it has no arm that could be bent");
}
