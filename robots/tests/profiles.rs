//! Profiles: parsing, errors and queries.

use std::path::Path;

use approx::assert_relative_eq;
use motorium_robots::{
    BaseKind, BaseMode, Kinematics, LoadOptions, Loaded, Profile, ProfileChoice, ProfileError, Steering,
    TaskRows, catalogue, draft_profile, load, load_with,
};

fn profile(name: &str) -> Profile {
    catalogue().iter().find(|entry| entry.name == name).unwrap().profile.clone()
}

const SMALL: &str = "title = \"t\"\nsources = []\njoints = [\"hinge\"]\nhome = \"a\"\n[poses]\na = [0.0]\n";

fn refused(text: &str) -> ProfileError {
    Profile::parse(text).unwrap_err()
}

#[test]
fn invalid_profile_is_rejected() {
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
fn single_number_in_a_profile_applies_to_all_joints() {
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
    // a list with one number has the wrong length
    let error = refused(&text.replace("kp = 40.0", "kp = [40.0]")).to_string();
    assert_eq!(error, "gains.kp has 1 entries, expected 3: one per joint of `joints`");
    let error = refused(&text.replace("kp = 40.0", "kp = \"stiff\"")).to_string();
    assert!(error.contains("expected one number, or a list with one number per joint"), "{error}");
    let error = refused(&text.replace("velocity = 1.5", "velocity = 0")).to_string();
    assert!(error.contains("the velocity limit of joint \"joint1\" is 0"), "{error}");
}

#[test]
fn feet_and_mobile_bases_are_checked() {
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
    assert_eq!(car, "the mobile base is ackermann, which requires `wheelbase`");
    let differential = with(&format!("{base}drive = \"differential\"\n"));
    assert!(differential.contains("requires `track`"), "{differential}");
    let model = load("pendulum", Path::new(".")).unwrap().model;
    let unknown = Profile::parse(&format!("{SMALL}[feet.left]\nframe = \"rot\"\n")).unwrap();
    let unknown = unknown.check(&model).unwrap_err().to_string();
    assert!(unknown.contains("no link \"rot\" (did you mean \"rod\"?)"), "{unknown}");
    let passive = Profile::parse(&SMALL.replace("[poses]", "passive = [\"hing\"]\n[poses]")).unwrap();
    assert!(matches!(passive.check(&model), Err(ProfileError::UnknownJoint { .. })));
}

#[test]
fn floating_robot_starts_at_its_profile_pose() {
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
fn profile_next_to_a_file_makes_its_base_float() {
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
fn mobile_bases_and_rotors_have_their_properties() {
    let car = profile("ackermann").mobile_base.unwrap();
    assert_eq!(car.drive, Steering::Ackermann);
    assert_relative_eq!(car.wheelbase.unwrap(), 0.15875 + 0.17145);
    assert_eq!((car.wheels.len(), car.steering.len()), (4, 2));
    let burger = profile("differential-drive").mobile_base.unwrap();
    assert_eq!((burger.wheel_radius, burger.track), (Some(0.033), Some(0.16)));
    assert_eq!(profile("quadrotor").rotors.len(), 4);
}

/// At zero a `ur5e` has a straight elbow and a flat wrist: no single joint leaves that posture.
#[test]
fn drafted_home_of_an_arm_is_not_singular() {
    for name in ["ur5e", "panda", "iiwa14"] {
        let arm = load(name, Path::new(".")).unwrap();
        let mut kinematics = Kinematics::new(&arm.model);
        let tool = arm.end_effector(None).unwrap();
        let mut measure = |q: &[f64]| {
            kinematics.update(&arm.model, q);
            kinematics.manipulability(&arm.model, tool, TaskRows::POSE)
        };
        let text = draft_profile(&arm, BaseMode::AsFile);
        let drafted = measure(Profile::parse(&text).unwrap().home(&arm.model).unwrap().as_slice());
        let makers = measure(arm.profile.as_ref().unwrap().home(&arm.model).unwrap().as_slice());
        assert!(drafted > 0.3 * makers, "{name}: {drafted}, {makers} at its maker's");
        assert!(
            name != "ur5e" || text.contains("inside the limits, and away from singular postures."),
            "{text}"
        );
    }
    let wheels = load("differential-drive", Path::new(".")).unwrap();
    assert!(
        draft_profile(&wheels, BaseMode::AsFile).contains("inside the limits.\n"),
        "it has no arm to bend"
    );
}

/// Returns the robot without its profile, and the draft profile for it.
fn drafted(reference: &str) -> (Loaded, Profile, String) {
    let options = LoadOptions { profile: ProfileChoice::Without, ..LoadOptions::default() };
    let robot = load_with(reference, Path::new("."), &options).unwrap();
    let text = draft_profile(&robot, BaseMode::AsFile);
    let profile = Profile::parse(&text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    profile.check(&robot.model).unwrap();
    (robot, profile, text)
}

#[test]
fn legged_robots_stand_in_their_drafted_home() {
    for (name, feet) in [("quadruped", 4), ("humanoid", 2)] {
        let (robot, profile, text) = drafted(name);
        assert_eq!((profile.base, profile.feet.len()), (BaseKind::Floating, feet), "{text}");
        assert!(text.contains(&format!("# It stands on its {feet} feet")), "{text}");
        let options = LoadOptions {
            base: BaseMode::Floating,
            profile: ProfileChoice::Without,
            ..LoadOptions::default()
        };
        let model = load_with(name, Path::new("."), &options).unwrap().model;
        let q = profile.configuration(&model, &profile.home).unwrap();
        let mut kinematics = Kinematics::new(&model);
        kinematics.update(&model, q.as_slice());
        let centre_of_mass = kinematics.centre_of_mass(&model).position;
        let [mut least, mut most] = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        for foot in profile.feet.values() {
            let position = kinematics.pose(&model, model.frame(&foot.frame).unwrap()).translation.vector;
            assert_relative_eq!(position.z, foot.radius.unwrap_or(0.0), epsilon = 2e-3);
            let sides = foot.sole.unwrap_or_default();
            for axis in 0..2 {
                least[axis] = least[axis].min(position[axis] - sides[axis] / 2.0);
                most[axis] = most[axis].max(position[axis] + sides[axis] / 2.0);
            }
        }
        for axis in 0..2 {
            let (room, middle) = (most[axis] - least[axis], (most[axis] + least[axis]) / 2.0);
            assert!((centre_of_mass[axis] - middle).abs() < 0.1 * room, "{name}: axis {axis}\n{text}");
        }
        for (index, joint) in robot.model.joint_names().iter().enumerate() {
            let range = robot.model.lower()[index]..=robot.model.upper()[index];
            assert!(range.contains(&profile.poses["home"].values()[index]), "{name}: {joint}\n{text}");
        }
    }
}

/// Returns the first profile of a base on wheels with its commented tables uncommented.
fn uncommented(text: &str) -> Profile {
    let (before, table) = text.split_once("\n# [mobile_base]\n").expect("the wheels, as a comment");
    let (table, gains) = table.split_once("\n\n").unwrap();
    let table: String = table.lines().map(|line| line[1..].to_owned() + "\n").collect();
    let text = format!("base = \"floating\"\n{before}\n[mobile_base]\n{table}\n{gains}");
    Profile::parse(&text).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

#[test]
fn first_profile_finds_wheels_and_casters_of_a_base() {
    let own = profile("differential-drive");
    let (_, _, text) = drafted("differential-drive");
    let found = uncommented(&text);
    let options =
        LoadOptions { base: BaseMode::Floating, profile: ProfileChoice::Without, ..LoadOptions::default() };
    let robot = load_with("differential-drive", Path::new("."), &options).unwrap();
    found.check(&robot.model).unwrap();
    // a base that floats in its file needs no comment
    let floating = Profile::parse(&draft_profile(&robot, BaseMode::Floating)).unwrap();
    for drafted in [found, floating] {
        let (base, own_base) = (drafted.mobile_base.as_ref().unwrap(), own.mobile_base.as_ref().unwrap());
        assert_eq!(
            (base.drive, &base.frame, &base.wheels),
            (own_base.drive, &own_base.frame, &own_base.wheels)
        );
        assert_relative_eq!(base.wheel_radius.unwrap(), own_base.wheel_radius.unwrap(), epsilon = 1e-6);
        assert_relative_eq!(base.track.unwrap(), own_base.track.unwrap(), epsilon = 1e-6);
        assert_relative_eq!(drafted.base_poses["home"].position[2], 0.033, epsilon = 1e-6);
        assert_eq!((drafted.feet.len(), &drafted.feet["caster"]), (1, &own.feet["caster"]), "{text}");
    }
    assert!(text.contains("# # Other links that reach the ground: casters"), "{text}");
    // 1 kg on two wheels of 33 mm: critical damping of its share, not of the light wheel
    let gains = drafted("differential-drive").1.gains(&robot.model).unwrap();
    assert_relative_eq!(
        gains.kd[0],
        2.0 * (gains.kp[0] * 0.5 * 0.033_f64.powi(2)).sqrt(),
        max_relative = 0.1
    );
    assert!(!text.contains("-0.0,") && !text.contains("-0.0]"), "{text}");
}

/// A caster of two joints: its fork ends above the ground, its wheel on it.
#[test]
fn drafted_casters_are_the_links_at_the_ground() {
    let folder = tempfile::tempdir().unwrap();
    let urdf = catalogue().iter().find(|entry| entry.name == "differential-drive").unwrap().urdf;
    let ball = |link: &str| {
        format!(
            "<link name=\"{link}\"><inertial><mass value=\"0.01\"/>\
             <inertia ixx=\"1e-6\" iyy=\"1e-6\" izz=\"1e-6\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>\
             <collision><geometry><sphere radius=\"0.01\"/></geometry></collision></link>"
        )
    };
    let joint = |name: &str, parent: &str, child: &str, xyz: &str, axis: &str| {
        format!(
            "<joint name=\"{name}\" type=\"continuous\"><parent link=\"{parent}\"/><child link=\"{child}\"/>\
             <origin xyz=\"{xyz}\"/><axis xyz=\"{axis}\"/></joint>"
        )
    };
    let more = [
        ball("fork"),
        ball("roller"),
        joint("swivel", "base", "fork", "0.07 0 -0.005", "0 0 1"),
        joint("roll", "fork", "roller", "-0.01 0 -0.018", "0 1 0"),
        "</robot>".into(),
    ];
    let file = folder.path().join("rover.urdf");
    std::fs::write(&file, urdf.replace("</robot>", &more.concat())).unwrap();
    let profile = uncommented(&drafted(file.to_str().unwrap()).2);
    let feet: Vec<&str> = profile.feet.keys().map(String::as_str).collect();
    // the fork ends 18 mm above the ground
    assert_eq!(feet, ["caster", "roller"]);
    let roller = &profile.feet["roller"];
    assert_eq!((&roller.joints[..], roller.friction), (&["swivel".into(), "roll".into()][..], Some(0.0)));
    assert_relative_eq!(roller.radius.unwrap(), 0.01, epsilon = 1e-6);
}

#[test]
fn first_profile_of_an_arm_or_a_walker_has_no_wheels() {
    for name in ["panda", "quadruped", "humanoid", "rrbot", "cart-pole"] {
        let text = drafted(name).2;
        assert!(!text.contains("mobile_base") && !text.contains("caster"), "{name}\n{text}");
    }
}

#[test]
fn first_profile_keeps_a_requested_fixed_base() {
    let options = LoadOptions { profile: ProfileChoice::Without, ..LoadOptions::default() };
    let robot = load_with("quadruped", Path::new("."), &options).unwrap();
    let profile = Profile::parse(&draft_profile(&robot, BaseMode::Fixed)).unwrap();
    assert_eq!(profile.base, BaseKind::Fixed);
    assert!(profile.feet.is_empty() && profile.base_poses.is_empty());
}

#[test]
fn first_profile_follows_the_srdf() {
    let folder = tempfile::tempdir().unwrap();
    let urdf = catalogue().iter().find(|entry| entry.name == "quadruped").unwrap().urdf;
    let file = folder.path().join("walker.urdf");
    std::fs::write(&file, urdf).unwrap();
    let own = profile("quadruped");
    let ends: String = own
        .feet
        .values()
        .zip(["a", "b", "c", "d"])
        .map(|(foot, name)| {
            format!("<end_effector name=\"leg_{name}\" parent_link=\"{}\" group=\"leg\"/>", foot.frame)
        })
        .collect();
    let standing = own.poses["standing"].values().iter().zip(&own.joints);
    let state: String =
        standing.map(|(value, joint)| format!("<joint name=\"{joint}\" value=\"{value}\"/>")).collect();
    let srdf = format!(
        "<robot name=\"walker\">{ends}<group_state name=\"standing\" group=\"all\">{state}</group_state></robot>"
    );
    std::fs::write(folder.path().join("walker.srdf"), srdf).unwrap();
    let (_, profile, text) = drafted(file.to_str().unwrap());
    let names: Vec<_> = profile.feet.keys().map(String::as_str).collect();
    assert_eq!(names, ["leg_a", "leg_b", "leg_c", "leg_d"], "{text}");
    assert!(text.contains("like \"standing\" of the SRDF"), "{text}");
    assert!(profile.base_poses.contains_key("standing") && profile.base_poses.contains_key("home"));
    for (home, standing) in profile.poses["home"].values().iter().zip(own.poses["standing"].values()) {
        assert_relative_eq!(home, standing, epsilon = 0.1);
    }
}

/// An arm whose wrist has friction and little inertia, with a jaw beyond it.
const GRIPPER_ARM: &str = r#"<robot name="arm"><link name="root"/>
    <link name="upper"><inertial><origin xyz="0.2 0 0"/><mass value="2"/>
        <inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <link name="wrist"><inertial><mass value="0.05"/>
        <inertia ixx="1e-5" iyy="1e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <link name="jaw"><inertial><mass value="0.02"/>
        <inertia ixx="1e-6" iyy="1e-6" izz="1e-6" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <joint name="shoulder" type="revolute"><parent link="root"/><child link="upper"/><axis xyz="0 1 0"/>
        <limit lower="-2" upper="2" velocity="2" effort="30"/></joint>
    <joint name="turn" type="revolute"><parent link="upper"/><child link="wrist"/><origin xyz="0.4 0 0"/>
        <axis xyz="1 0 0"/><limit lower="-2" upper="2" velocity="2" effort="5"/><dynamics friction="1.0"/></joint>
    <joint name="jointGripper" type="revolute"><parent link="wrist"/><child link="jaw"/><axis xyz="0 1 0"/>
        <limit lower="-1.5" upper="0" velocity="2" effort="5"/></joint></robot>"#;

#[test]
fn first_gains_overcome_the_friction_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("arm.urdf");
    std::fs::write(&file, GRIPPER_ARM).unwrap();
    let (robot, profile, text) = drafted(file.to_str().unwrap());
    let gains = profile.gains(&robot.model).unwrap();
    let turn = robot.model.joint_index("turn").unwrap();
    assert!(gains.kp[turn] >= 1.0 / 0.005, "{text}");
}

#[test]
fn first_tool_is_before_its_fingers() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("arm.urdf");
    std::fs::write(&file, GRIPPER_ARM).unwrap();
    let check = |name: &str| {
        let (_, profile, text) = drafted(file.to_str().unwrap());
        let tool = &profile.end_effectors[name];
        assert_eq!(
            (tool.frame.as_str(), &tool.fingers[..]),
            ("wrist", &["jointGripper".into()][..]),
            "{text}"
        );
        assert_eq!(tool.joints, ["shoulder", "turn"]);
    };
    check("tool");
    // the SRDF of a gripper names its moving jaw
    let srdf =
        "<robot name=\"arm\"><end_effector name=\"hand\" parent_link=\"jaw\" group=\"gripper\"/></robot>";
    std::fs::write(folder.path().join("arm.srdf"), srdf).unwrap();
    check("hand");
}

/// An arm of four joints whose hand has three fingers of two joints each, named after no finger.
#[test]
fn drafted_tool_is_the_palm_of_a_hand_with_fingers() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("hand.urdf");
    let link = |name: &str| {
        format!(
            "<link name=\"{name}\"><inertial><origin xyz=\"0.1 0 0\"/><mass value=\"0.1\"/>\
             <inertia ixx=\"1e-3\" iyy=\"1e-3\" izz=\"1e-3\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link>"
        )
    };
    let joint = |parent: &str, child: &str, axis: &str| {
        format!(
            "<joint name=\"to_{child}\" type=\"revolute\"><parent link=\"{parent}\"/><child link=\"{child}\"/>\
             <origin xyz=\"0.2 0 0\"/><axis xyz=\"{axis}\"/>\
             <limit lower=\"-1.6\" upper=\"1.6\" velocity=\"2\" effort=\"20\"/></joint>"
        )
    };
    let mut text = "<robot name=\"hand\"><link name=\"root\"/>".to_owned();
    let arm = [("root", "a"), ("a", "b"), ("b", "c"), ("c", "palm")];
    for ((parent, child), axis) in arm.into_iter().zip(["0 0 1", "0 1 0", "0 1 0", "1 0 0"]) {
        text += &(link(child) + &joint(parent, child, axis));
    }
    for (one, two) in [("i1", "i2"), ("m1", "m2"), ("r1", "r2")] {
        text += &(link(one) + &joint("palm", one, "0 1 0") + &link(two) + &joint(one, two, "0 1 0"));
    }
    std::fs::write(&file, text + "</robot>").unwrap();
    let (_, profile, text) = drafted(file.to_str().unwrap());
    let tool = &profile.end_effectors["tool"];
    assert_eq!((tool.frame.as_str(), tool.joints.len(), tool.fingers.len()), ("palm", 4, 6), "{text}");
}

/// Two links whose root drive cannot hold them stretched out.
#[test]
fn drafted_home_of_a_weak_arm_is_holdable() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("weak.urdf");
    let link = |name: &str| {
        format!(
            "<link name=\"{name}\"><inertial><origin xyz=\"0.2 0 0\"/><mass value=\"1\"/>\
             <inertia ixx=\"0.01\" iyy=\"0.01\" izz=\"0.01\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial></link>"
        )
    };
    let joint = |name: &str, parent: &str, child: &str, effort: f64| {
        format!(
            "<joint name=\"{name}\" type=\"revolute\"><parent link=\"{parent}\"/><child link=\"{child}\"/>\
             <origin xyz=\"0.4 0 0\"/><axis xyz=\"0 1 0\"/>\
             <limit lower=\"-1.6\" upper=\"1.6\" velocity=\"2\" effort=\"{effort}\"/></joint>"
        )
    };
    let (a, b) = (joint("a", "root", "upper", 5.0), joint("b", "upper", "lower", 3.0));
    let (upper, lower) = (link("upper"), link("lower"));
    std::fs::write(&file, format!("<robot name=\"weak\"><link name=\"root\"/>{upper}{lower}{a}{b}</robot>"))
        .unwrap();
    let (robot, profile, text) = drafted(file.to_str().unwrap());
    let q = profile.home(&robot.model).unwrap();
    let mut effort = [0.0; 2];
    let gravity = nalgebra::Vector3::new(0.0, 0.0, -9.81);
    motorium_robots::Dynamics::new(&robot.model).gravity(&robot.model, q.as_slice(), gravity, &mut effort);
    assert!(effort[0].abs() <= 3.5 && effort[1].abs() <= 2.1, "{effort:?}\n{text}");
}
