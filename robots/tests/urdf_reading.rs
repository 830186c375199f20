//! Models read from URDF files.

use std::path::Path;

use approx::assert_relative_eq;
use motorium_robots::{
    Dynamics, Geometry, JointKind, Kinematics, LoadError, MimicMode, Model, ModelWarning, PackagePath,
    Reference, UrdfRobot, load, parse_urdf,
};
use nalgebra::{DMatrix, Matrix3, Vector3};

const BRANCHING: &str = include_str!("fixtures/branching.urdf");

fn read(text: &str) -> UrdfRobot {
    parse_urdf(text, None, MimicMode::Follow, &PackagePath::default()).unwrap()
}

fn warnings(text: &str) -> Vec<String> {
    read(text).warnings.iter().map(ToString::to_string).collect()
}

/// A robot whose link `b` has this mass and these principal moments, on a hinge about z.
fn with_inertial(inertial: &str) -> String {
    format!(
        "<robot name=\"r\"><link name=\"a\"/><link name=\"b\">{inertial}</link>\
         <joint name=\"j\" type=\"continuous\"><parent link=\"a\"/><child link=\"b\"/><axis xyz=\"0 0 1\"/></joint></robot>"
    )
}

fn inertial(mass: f64, [x, y, z]: [f64; 3]) -> String {
    format!(
        "<inertial><mass value=\"{mass}\"/>\
         <inertia ixx=\"{x}\" ixy=\"0\" ixz=\"0\" iyy=\"{y}\" iyz=\"0\" izz=\"{z}\"/></inertial>"
    )
}

#[test]
fn joints_are_parents_first_and_every_link_has_a_frame() {
    let UrdfRobot { model, warnings } = read(BRANCHING);
    let bodies: Vec<_> = model.bodies().iter().map(|body| body.name.as_str()).collect();
    assert_eq!(bodies, ["torso", "lift", "upper", "lower", "slider", "wheel"]);
    assert_eq!(model.joint_names(), ["waist", "lift_joint", "shoulder", "wheel_joint"]);
    let parents: Vec<_> = model.bodies().iter().map(|body| body.parent).collect();
    assert_eq!(parents, [None, Some(0), Some(1), Some(2), Some(3), None]);
    assert_eq!(model.frames().len(), 10);
    assert_eq!((model.nq(), model.nv(), model.joint_index("shoulder")), (4, 4, Some(2)));
    assert_eq!(model.joint_index("elbow"), None);
    assert_eq!(model.joint(1).kind, JointKind::Prismatic);
    // "1 2 -2" has length three; the elbow at 3 rad and 3 rad/s limits the shoulder to 2.2 rad and 2 rad/s
    let [
        ModelWarning::AxisLength { joint, length },
        ModelWarning::FollowerRange { .. },
        ModelWarning::FollowerVelocity { .. },
    ] = &warnings[..]
    else {
        panic!("{warnings:?}")
    };
    assert_eq!((joint.as_str(), *length), ("waist", 3.0));
}

#[test]
fn missing_limits_are_infinite() {
    let model = read(BRANCHING).model;
    let wheel = model.joint_index("wheel_joint").unwrap();
    assert_eq!(model.lower()[wheel], f64::NEG_INFINITY);
    assert_eq!(model.upper()[wheel], f64::INFINITY);
    assert_eq!(model.velocity_limit()[wheel], f64::INFINITY);
    assert_eq!(model.effort_limit()[wheel], f64::INFINITY);
    assert_eq!((model.joint(wheel).dynamics.damping, model.joint(wheel).dynamics.friction), (0.2, 0.1));
    let lift = model.joint_index("lift_joint").unwrap();
    assert_eq!((model.lower()[lift], model.upper()[lift]), (-0.2, 0.4));
    assert_eq!((model.velocity_limit()[lift], model.effort_limit()[lift]), (1.0, 500.0));
}

#[test]
fn welded_links_merge_by_the_parallel_axis_theorem() {
    // two points of 1 kg, 2 m apart along x: about the middle 0, 2, 2 kg m2
    let point = "<inertial><mass value=\"1\"/><inertia ixx=\"0\" ixy=\"0\" ixz=\"0\" iyy=\"0\" iyz=\"0\" izz=\"0\"/></inertial>";
    let text = format!(
        "<robot name=\"r\"><link name=\"a\"/><link name=\"b\">{point}</link><link name=\"c\">{point}</link>\
         <joint name=\"j\" type=\"continuous\"><parent link=\"a\"/><child link=\"b\"/><axis xyz=\"0 0 1\"/></joint>\
         <joint name=\"w\" type=\"fixed\"><parent link=\"b\"/><child link=\"c\"/><origin xyz=\"2 0 0\" rpy=\"1 2 3\"/></joint>\
         </robot>"
    );
    let model = read(&text).model;
    let body = &model.bodies()[0].inertia;
    assert_eq!(body.mass, 2.0);
    assert_relative_eq!(body.com, Vector3::new(1.0, 0.0, 0.0), epsilon = 1e-15);
    assert_relative_eq!(
        body.rotational,
        Matrix3::from_diagonal(&Vector3::new(0.0, 2.0, 2.0)),
        epsilon = 1e-14
    );
    let mut mass = DMatrix::zeros(1, 1);
    Dynamics::new(&model).crba(&model, &[0.3], &mut mass);
    assert_relative_eq!(mass[(0, 0)], 4.0, epsilon = 1e-14);
}

#[test]
fn independent_mimics_have_separate_columns() {
    let options = (MimicMode::Independent, PackagePath::default());
    let model = parse_urdf(BRANCHING, None, options.0, &options.1).unwrap().model;
    assert_eq!(model.joint_names(), ["waist", "lift_joint", "shoulder", "elbow", "slide", "wheel_joint"]);
}

#[test]
fn mimics_match_independent_joints_moved_together() {
    let followed = read(BRANCHING).model;
    let free = parse_urdf(BRANCHING, None, MimicMode::Independent, &PackagePath::default()).unwrap().model;
    let (q, v) = ([0.3, -0.1, 0.7, 1.1], [0.5, 0.2, -0.8, 2.0]);
    let elbow = -1.5 * q[2] + 0.3;
    let q_free = [q[0], q[1], q[2], elbow, 0.1 * elbow - 0.05, q[3]];
    let v_free = [v[0], v[1], v[2], -1.5 * v[2], -0.15 * v[2], v[3]];
    let pose = |model: &Model, q: &[f64], v: &[f64]| {
        let mut kinematics = Kinematics::new(model);
        kinematics.update_with_velocity(model, q, v);
        let tool = model.frame("tool").unwrap();
        (kinematics.pose(model, tool), kinematics.velocity_in(model, tool, Reference::World).vector())
    };
    let (ours, theirs) = (pose(&followed, &q, &v), pose(&free, &q_free, &v_free));
    assert_relative_eq!(ours.0, theirs.0, epsilon = 1e-14);
    assert_relative_eq!(ours.1, theirs.1, epsilon = 1e-14);
    // virtual work: the master carries the efforts of its followers, multiplied by their ratios
    let gravity = Vector3::new(0.0, 0.0, -9.81);
    let (mut tau, mut tau_free) = ([0.0; 4], [0.0; 6]);
    Dynamics::new(&followed).bias(&followed, &q, &v, gravity, &mut tau);
    Dynamics::new(&free).bias(&free, &q_free, &v_free, gravity, &mut tau_free);
    let folded = tau_free[2] - 1.5 * tau_free[3] - 0.15 * tau_free[4];
    assert_relative_eq!(tau[2], folded, epsilon = 1e-13);
}

#[test]
fn impossible_inertias_load_with_a_warning() {
    assert_eq!(warnings(&with_inertial(&inertial(1.0, [1.0, 1.0, 1.5]))), [""; 0]);
    assert_eq!(
        warnings(&with_inertial(&inertial(1.0, [1.0, -1.0, 1.5]))),
        ["link \"b\": rotational inertia is not positive definite (principal moments -1, 1, 1.5 kg m2)"]
    );
    assert_eq!(
        warnings(&with_inertial(&inertial(1.0, [1.0, 1.0, 2.5]))),
        ["link \"b\": rotational inertia breaks the triangle inequality \
          (principal moments 1, 1, 2.5 kg m2: the largest exceeds the sum of the others)"]
    );
    assert_eq!(
        warnings(&with_inertial(&inertial(0.0, [1.0, 1.0, 1.0]))),
        ["link \"b\": rotational inertia is set, but the mass is zero"]
    );
}

#[test]
fn massless_joint_loads_but_has_no_forward_dynamics() {
    let UrdfRobot { model, warnings } = read(&with_inertial(""));
    let [ModelWarning::NoInertia { link, joint }] = &warnings[..] else { panic!("{warnings:?}") };
    assert_eq!((link.as_str(), joint.as_str()), ("b", "j"));
    let mut a = [0.0];
    let error =
        Dynamics::new(&model).forward(&model, &[0.0], &[0.0], &[1.0], Vector3::zeros(), &mut a).unwrap_err();
    assert_eq!(error.index, 0);
}

#[test]
fn suspicious_limits_are_reported() {
    let text = "<robot name=\"r\"><link name=\"a\"/><link name=\"b\">INERTIAL</link>\
                <joint name=\"j\" type=\"revolute\"><parent link=\"a\"/><child link=\"b\"/>LIMIT</joint></robot>"
        .replace("INERTIAL", &inertial(1.0, [1.0, 1.0, 1.0]));
    let warnings = |limit: &str| warnings(&text.replace("LIMIT", limit));
    assert_eq!(
        warnings(r#"<limit velocity="0" effort="0"/>"#),
        [
            "joint \"j\": velocity limit is 0, taken literally; leave it out or raise it if it means unknown",
            "joint \"j\": effort limit is 0, taken literally; leave it out or raise it if it means unknown",
            "joint \"j\": lower and upper limit are both 0; it cannot move",
        ]
    );
    assert_eq!(
        warnings(r#"<limit lower="-1" upper="1" velocity="1"/>"#),
        ["joint \"j\": <limit> has no effort; treated as unlimited"]
    );
}

/// A lift with two stages: the upper one moves from 0 to 0.4 m, and the other follows it with these
/// attributes.
fn lift(limit: &str, mimic: &str) -> String {
    let mass = inertial(5.0, [0.05; 3]);
    format!(
        r#"<robot name="r"><link name="base"/><link name="one">{mass}</link><link name="two">{mass}</link>
        <joint name="upper" type="prismatic"><parent link="base"/><child link="one"/><axis xyz="0 0 1"/>
        <limit lower="0" upper="0.4" effort="500" velocity="0.5"/></joint>
        <joint name="lower" type="prismatic"><parent link="one"/><child link="two"/><axis xyz="0 0 1"/>
        <limit {limit} effort="500"/><mimic joint="upper" {mimic}/></joint></robot>"#
    )
}

#[test]
fn follower_narrows_the_limits_of_its_leader() {
    let narrow = lift(r#"lower="0" upper="0.25" velocity="0.5""#, r#"multiplier="2""#);
    let UrdfRobot { model, .. } = read(&narrow);
    assert_eq!((model.lower()[0], model.upper()[0], model.velocity_limit()[0]), (0.0, 0.125, 0.25));
    assert_eq!(
        warnings(&narrow),
        [
            "joint \"upper\": its follower \"lower\" limits its range to 0 to 0.125; the file has 0 to 0.4",
            "joint \"upper\": its follower \"lower\" limits its velocity to 0.25; the file has 0.5",
        ]
    );
    // the reverse, with an offset: -0.5 x + 0.1 is within -0.05 to 0.1 from 0 to 0.3
    let mirrored = lift(r#"lower="-0.05" upper="0.1" velocity="0.5""#, r#"multiplier="-0.5" offset="0.1""#);
    let UrdfRobot { model, warnings } = read(&mirrored);
    assert_relative_eq!(model.upper()[0], 0.3, epsilon = 1e-12);
    assert!(matches!(&warnings[..], [ModelWarning::FollowerRange { .. }]), "{warnings:?}");
    // equal limits do not narrow the range although 0.36 / 0.9 is not exactly 0.4, nor does an unknown
    // velocity
    let equal = lift(r#"lower="0" upper="0.36" velocity="0""#, r#"multiplier="0.9""#);
    let UrdfRobot { model, warnings } = read(&equal);
    assert_eq!((model.upper()[0], model.velocity_limit()[0]), (0.4, 0.5));
    assert!(matches!(&warnings[..], [ModelWarning::ZeroLimit { .. }]), "{warnings:?}");
    // independent joints keep the limits of the file
    let alone = parse_urdf(&narrow, None, MimicMode::Independent, &PackagePath::default()).unwrap();
    assert_eq!((alone.model.upper()[0], alone.warnings.len()), (0.4, 0));
}

#[test]
fn follower_without_a_common_position_is_reported() {
    let text = lift(r#"lower="2" upper="3" velocity="9""#, r#"multiplier="1""#);
    assert_eq!(
        warnings(&text),
        [
            "joint \"lower\": its limits 2 to 3 exclude every position it has as a follower of \"upper\"; ignored"
        ]
    );
    assert_eq!(read(&text).model.upper()[0], 0.4);
}

#[test]
fn couplings_of_mjcf_narrow_their_leader() {
    let text = r#"<mujoco><worldbody><body><joint name="a" range="0 1" axis="0 0 1" type="slide"/><geom size="0.1"/>
        <body><joint name="b" range="0 0.5" axis="0 0 1" type="slide"/><geom size="0.1"/></body></body></worldbody>
        <equality><joint joint1="b" joint2="a"/></equality></mujoco>"#;
    let robot = motorium_robots::parse_mjcf(text, None, &Default::default()).unwrap();
    assert_eq!(robot.model.upper()[0], 0.5);
    assert!(matches!(&robot.warnings[..], [ModelWarning::FollowerRange { .. }]), "{:?}", robot.warnings);
}

#[test]
fn sizes_in_millimetres_are_reported() {
    let robot = |inside: &str, origin: &str| {
        format!(
            r#"<robot name="r"><link name="a"/><link name="b">{inside}</link><link name="c"/>
            <joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint>
            <joint name="k" type="fixed"><parent link="b"/><child link="c"/><origin xyz="{origin}"/></joint></robot>"#
        )
    };
    let shape = |size: &str| format!(r#"<collision><geometry><box size="{size}"/></geometry></collision>"#);
    let good = inertial(1.2, [0.0012, 0.009, 0.009]);
    assert_eq!(warnings(&robot(&(good.clone() + &shape("0.3 0.04 0.04")), "0 0 0.3")), [""; 0]);
    let doubt = |what: &str, link: &str| {
        format!(
            "link \"{link}\": {what}; if lengths in the file are millimetres, divide them by 1000 and inertias by 1e6"
        )
    };
    let long = warnings(&robot(&(good.clone() + &shape("300 40 40")), "0 0 0.3"));
    assert_eq!(long, [doubt("collision shape of 300.0 m", "b")]);
    let heavy = warnings(&robot(&inertial(1.2, [1200.0, 9000.0, 9000.0]), "0 0 0.3"));
    assert_eq!(heavy, [doubt("radius of gyration of 86.6 m", "b")]);
    let far = warnings(&robot(&good, "0 0 300"));
    assert_eq!(far, [doubt("distance from its parent of 300.0 m", "c")]);
    let all = read(&robot(&inertial(1.2, [1200.0, 9000.0, 9000.0]), "0 0 300")).warnings;
    let [summary] = &ModelWarning::summarise(&all)[..] else { panic!("{all:?}") };
    assert!(summary.starts_with("links \"b\", \"c\": lengths of more than 20 m"), "{summary}");
}

#[test]
fn total_mass_includes_fixed_links() {
    let heavy = inertial(3.0, [1.0; 3]);
    let text = with_inertial(&inertial(1.0, [1.0; 3]))
        .replace(r#"<link name="a"/>"#, &format!(r#"<link name="a">{heavy}</link>"#));
    let model = read(&text).model;
    assert_eq!((model.mass(), model.total_mass()), (1.0, 4.0));
}

#[test]
fn visuals_and_extensions_are_skipped() {
    // a texture without a file and a missing mesh, in parts that are not read
    let text = "<robot name=\"r\"><material name=\"m\"><texture/></material><gazebo><plugin/></gazebo>\
                <link name=\"a\"><visual><geometry><mesh filename=\"package://no/such\"/></geometry>\
                <material name=\"é\"><texture/></material></visual></link></robot>";
    assert_eq!(warnings(text), [""; 0]);
}

#[test]
fn collision_shapes_are_placed_in_their_body() {
    let model = load("panda", Path::new(".")).unwrap().model;
    assert!(!model.base_shapes().is_empty());
    let hand = model.bodies().iter().find(|body| body.name == "panda_link7").unwrap();
    let shape = hand.shapes.iter().find(|shape| shape.link == "panda_hand").unwrap();
    assert_relative_eq!(shape.placement.translation.vector, Vector3::new(0.0, 0.0, 0.14), epsilon = 1e-12);
    assert_relative_eq!(
        shape.placement.rotation.euler_angles().2,
        -std::f64::consts::FRAC_PI_4,
        epsilon = 1e-12
    );
    assert!(matches!(shape.geometry, Geometry::Box { .. }));
}

#[test]
fn meshes_are_found_by_folders_prefixes_and_ancestors() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    let make = |path: &str| {
        let path = root.join(path);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, "").unwrap();
        path
    };
    let listed = make("ros/listed/m.stl");
    let installed = make("prefix/share/installed/m.stl");
    let own = make("ws/own/meshes/m.stl");
    let urdf = make("ws/own/urdf/robot.urdf");
    let packages = PackagePath { folders: vec![root.join("ros")], prefixes: vec![root.join("prefix")] };
    let find = |uri: &str| packages.resolve(uri, Some(&urdf));
    assert_eq!(find("package://listed/m.stl"), Ok(listed));
    assert_eq!(find("package://installed/m.stl"), Ok(installed));
    assert_eq!(find("package://own/meshes/m.stl"), Ok(own.clone()));
    assert_eq!(find("../meshes/m.stl").unwrap().canonicalize().unwrap(), own.canonicalize().unwrap());
    assert_eq!(find(&format!("file://{}", own.display())), Ok(own));
    let tried = find("package://missing/m.stl").unwrap_err();
    assert!(tried.contains(&root.join("ros/missing")), "{tried:?}");

    let text = "<robot name=\"r\"><link name=\"a\"><collision><geometry>\
                <mesh filename=\"package://missing/m.stl\" scale=\"1 2 3\"/></geometry></collision></link></robot>";
    let UrdfRobot { model, warnings } = parse_urdf(text, Some(&urdf), MimicMode::Follow, &packages).unwrap();
    assert!(matches!(&warnings[..], [ModelWarning::MissingMesh { link, .. }] if link == "a"), "{warnings:?}");
    let Geometry::Mesh { path: None, scale, .. } = &model.base_shapes()[0].geometry else { panic!() };
    assert_eq!(*scale, Vector3::new(1.0, 2.0, 3.0));
}

#[test]
fn unknown_frame_suggests_the_nearest() {
    let model = load("panda", Path::new(".")).unwrap().model;
    assert_eq!(
        model.frame("panda_hnd_tcp").unwrap_err().to_string(),
        "robot \"panda\" has no link \"panda_hnd_tcp\" (did you mean \"panda_hand_tcp\"?)"
    );
}

#[test]
fn folder_is_loaded_with_the_profile_next_to_its_urdf() {
    let folder = tempfile::tempdir().unwrap();
    let root = folder.path();
    std::fs::create_dir(root.join("mine")).unwrap();
    std::fs::write(root.join("mine/arm.urdf"), with_inertial(&inertial(1.0, [1.0, 1.0, 1.0]))).unwrap();
    assert!(load("mine", root).unwrap().profile.is_none());

    let profile = "title = \"Mine\"\nsources = []\njoints = [\"j\"]\nhome = \"up\"\n[poses]\nup = [0.5]\n";
    std::fs::write(root.join("mine/arm.toml"), profile).unwrap();
    let loaded = load("mine", root).unwrap();
    assert_eq!(loaded.path, Some(root.join("mine/arm.urdf")));
    assert_eq!(loaded.profile.unwrap().home(&loaded.model).unwrap().as_slice(), [0.5]);

    std::fs::write(root.join("mine/arm.toml"), profile.replace("\"j\"", "\"k\"")).unwrap();
    let error = load("mine/arm.urdf", root).unwrap_err();
    assert!(matches!(error, LoadError::Profile { .. }), "{error}");
    assert!(
        error
            .to_string()
            .ends_with("`joints` names joint \"k\", which is not an independent joint of robot \"r\""),
        "{error}"
    );
}

#[test]
fn range_of_a_continuous_joint_is_reported() {
    let robot = |limits: &str| {
        warnings(&format!(
            "<robot name=\"r\"><link name=\"a\"/><link name=\"b\"><inertial><mass value=\"1\"/>\
             <inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial></link>\
             <joint name=\"j\" type=\"continuous\"><parent link=\"a\"/><child link=\"b\"/><axis xyz=\"0 0 1\"/>\
             <limit {limits} effort=\"9\" velocity=\"2\"/></joint></robot>"
        ))
    };
    let warns =
        |limits: &str| robot(limits).iter().any(|warning| warning.contains("no effect on a continuous"));
    assert!(warns("lower=\"-1.57\" upper=\"1.57\""));
    assert!(!warns("") && !warns("lower=\"-3.1416\" upper=\"3.1416\"") && !warns("lower=\"0\" upper=\"0\""));
}

#[test]
fn misspelt_names_degrees_and_empty_shapes_are_reported() {
    let joint = |inside: &str| {
        format!(
            "<robot name=\"r\"><link name=\"a\"/><link name=\"b\">{}</link>\n<joint name=\"j\" type=\"revolute\"><parent \
             link=\"a\"/><child link=\"b\"/>{inside}</joint></robot>",
            inertial(1.0, [1.0, 1.0, 1.5])
        )
    };
    let limit = r#"<limit lower="-1" upper="1" effort="1" velocity="1"/>"#;
    let low = r#"<limit low="-1" upper="1" effort="1" velocity="1" acceleration="3"/>"#;
    let degrees = format!(r#"{limit}<origin xyz="0 0 1" rpy="0 90 0"/>"#);
    let axis = format!(r#"{limit}<axes xyz="0 0 1"/>"#);
    for (inside, expected) in [
        (
            low,
            "\"low\" of <limit> of <joint name=\"j\"> is unknown and has no effect (line 2, column 68); did you mean \"lower\"?",
        ),
        (
            &degrees,
            "rpy of <origin> of <joint name=\"j\"> has an angle of 90 rad (line 2, column 121); URDF has radians: if these are degrees, write 1.5708",
        ),
        (
            &axis,
            "\"axes\" of <joint name=\"j\"> is unknown and has no effect (line 2, column 1); did you mean \"axis\"?",
        ),
    ] {
        assert_eq!(warnings(&joint(inside)), [expected], "{inside}");
    }
    assert_eq!(warnings(&joint(limit)), [""; 0]);
    let elsewhere = |text: &str, found: &str, element: &str, expected: &str| {
        let all = warnings(text).join("; ");
        let warning = format!("<{found}> in <{element}> has no effect (line ");
        assert!(
            all.contains(&warning) && all.contains(&format!("; expected it in <{expected}>")),
            "{text}: {all}"
        );
    };
    let mass = r#"<mass value="1"/>"#;
    let inside = format!("{limit}<origin xyz=\"0 0 1\"/>{mass}<link name=\"c\"/>");
    elsewhere(&joint(&inside), "mass", "joint name=\"j\"", "inertial");
    elsewhere(&joint(&inside), "link", "joint name=\"j\"", "robot");
    let inside = format!("<origin xyz=\"0 0 1\"/>{}", inertial(1.0, [1.0, 1.0, 1.5]));
    elsewhere(&with_inertial(&inside), "origin", "link name=\"b\"", "joint");
    let text = joint(limit).replace("</robot>", "<limit lower=\"0\"/></robot>");
    elsewhere(&text, "limit", "robot", "joint");
    let sensor = format!("<sensor><origin xyz=\"0 0 1\"/></sensor>{}", inertial(1.0, [1.0, 1.0, 1.5]));
    assert_eq!(warnings(&with_inertial(&sensor)), [""; 0], "an element of another program");
    let shape = |shape: &str| {
        let inside =
            format!("<collision><geometry>{shape}</geometry></collision>{}", inertial(1.0, [1.0, 1.0, 1.5]));
        warnings(&with_inertial(&inside)).join("; ")
    };
    for (text, expected) in [
        (r#"<sphere radius="-0.1"/>"#, "radius of <sphere> of <link name=\"b\"> is -0.1"),
        (r#"<box size="1 0 1"/>"#, "size of <box> of <link name=\"b\"> is 0"),
        (r#"<mesh filename="x.stl" scale="1 0 1"/>"#, "scale of <mesh> of <link name=\"b\"> is 0"),
    ] {
        assert!(shape(text).contains(expected), "{}", shape(text));
    }
    assert_eq!(shape(r#"<capsule radius="0.1" length="0"/>"#), "");
}

#[test]
fn second_shape_of_a_geometry_is_rejected() {
    let text = with_inertial(
        "\n<collision><geometry><sphere radius=\"0.1\"/><box size=\"1 1 1\"/></geometry></collision>",
    );
    let error = parse_urdf(&text, None, MimicMode::Follow, &PackagePath::default()).unwrap_err();
    assert_eq!(error.to_string(), "URDF:2:44: <geometry> of <link name=\"b\"> has more than one <shape>");
}
