//! Values in the wrong unit, and meshes that cannot be read: the warnings, and the files without any.

use std::path::Path;

use motorium_robots::{
    BasePose, LoadOptions, MimicMode, ModelWarning, PackagePath, RobotSource, ShapeSource, catalogue, load,
    load_with, parse_mjcf, parse_urdf,
};

fn texts(warnings: &[ModelWarning]) -> Vec<String> {
    warnings.iter().map(ToString::to_string).collect()
}

fn of_urdf(text: &str) -> Vec<String> {
    texts(&parse_urdf(text, None, MimicMode::Follow, &PackagePath::default()).unwrap().warnings)
}

/// A robot whose link `b` of `mass` with three equal moments slides or turns by these limits.
fn joint(kind: &str, limits: [f64; 3], mass: f64, moment: f64) -> String {
    let [lower, upper, velocity] = limits;
    format!(
        r#"<robot name="r"><link name="a"/><link name="b"><inertial><mass value="{mass}"/>
        <inertia ixx="{moment}" ixy="0" ixz="0" iyy="{moment}" iyz="0" izz="{moment}"/></inertial></link>
        <joint name="j" type="{kind}"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>
        <limit lower="{lower}" upper="{upper}" velocity="{velocity}" effort="10"/></joint></robot>"#
    )
}

#[test]
fn angles_in_degrees_are_reported_once_per_origin() {
    let rpy = |rpy: &str| {
        let text = joint("revolute", [-1.0, 1.0, 1.0], 1.0, 0.01);
        of_urdf(&text.replace("<axis", &format!("<origin rpy=\"{rpy}\"/><axis")))
    };
    for good in ["0 3.14159 0", "6.28 -6.2832 -4.7", "0 0 7.853981634", "12.566370614 -9.4248 0"] {
        assert_eq!(rpy(good), [""; 0], "{good}");
    }
    for bad in ["0 90 0", "-90 0 180", "0 0 7", "45.5 0 0", "355 0 0"] {
        assert!(matches!(&rpy(bad)[..], [found] if found.contains("if these are degrees, write")), "{bad}");
    }
}

#[test]
fn limits_in_degrees_are_reported() {
    let limits = |lower, upper| of_urdf(&joint("revolute", [lower, upper, 1.0], 1.0, 0.01));
    for [lower, upper] in [[-10.0, 10.0], [-9.42477796, 9.42477796], [-6.3, 6.3], [-1e3, 1e3]] {
        assert_eq!(limits(lower, upper), [""; 0], "{lower} to {upper}");
    }
    for [lower, upper] in [[-170.0, 170.0], [0.0, 45.0], [-360.0, 360.0]] {
        assert!(
            matches!(&limits(lower, upper)[..], [found] if found.contains("URDF has radians")),
            "{lower}"
        );
    }
}

#[test]
fn slides_in_millimetres_are_reported() {
    let slide = |limits| of_urdf(&joint("prismatic", limits, 1.0, 0.01));
    assert_eq!(slide([-0.5, 19.0, 5.0]), [""; 0]);
    assert_eq!(
        slide([0.0, 300.0, 1.0]),
        [
            "joint \"j\": limits 0 to 300 m, expected a range of at most 20 m; if these are millimetres, divide them by 1000"
        ]
    );
    assert_eq!(
        slide([0.0, 0.3, 200.0]),
        [
            "joint \"j\": velocity limit of 200 m/s, expected at most 100 m/s; if it is in mm/s, divide it by 1000"
        ]
    );
    // a placeholder for no limit, and a base that moves in the plane
    assert_eq!(slide([-1e6, 1e6, 1e6]), [""; 0]);
    assert_eq!(slide([-50.0, 50.0, 1.0]), [""; 0]);
    let shape = "<collision><geometry><sphere radius=\"0.1\"/></geometry></collision></link><joint";
    let text = joint("prismatic", [-150.0, 150.0, 1.0], 1.0, 0.01).replace("</link>\n        <joint", shape);
    assert!(matches!(&of_urdf(&text)[..], [found] if found.contains("limits -150 to 150 m")), "{text}");
    assert_eq!(of_urdf(&joint("revolute", [-1.0, 1.0, 200.0], 1.0, 0.01)), [""; 0]);
}

#[test]
fn inertias_below_the_densest_ball_are_reported() {
    let body = |mass, moment| of_urdf(&joint("revolute", [-1.0, 1.0, 1.0], mass, moment));
    let [found] = &body(1.0, 1e-12)[..] else { panic!("{:?}", body(1.0, 1e-12)) };
    // 2/5 m r^2 of a ball of osmium of 1 kg, whose radius is 21.95 mm
    let least: f64 = found.split("at least ").nth(1).unwrap().split(',').next().unwrap().parse().unwrap();
    assert!((least - 0.4 * 0.021_945_f64.powi(2)).abs() < 1e-5, "{least}");
    assert!(found.starts_with("link \"b\": largest principal moment of 1.0e-12 kg m2 for 1 kg"), "{found}");
    // rough estimates of real files, and small parts
    for (mass, moment) in [(0.3, 3e-8), (1e-3, 1e-9), (1e-6, 1e-6), (1.0, 1e-4), (0.4, 1.0)] {
        assert_eq!(body(mass, moment), [""; 0], "{mass} {moment}");
    }
    // kg mm2 of a link of some centimetres
    let large = body(1.0, 100.0);
    assert!(matches!(&large[..], [found] if found.contains("radius of gyration of 10.0 m")), "{large:?}");
}

#[test]
fn mjcf_in_radians_with_degrees_is_reported() {
    let of = |angle: &str, euler: &str, range: &str| {
        let text = format!(
            "<mujoco><compiler angle=\"{angle}\"/><worldbody>\n<body name=\"b\" euler=\"{euler}\">\
             <joint name=\"j\" range=\"{range}\"/><geom size=\"0.1\"/></body></worldbody></mujoco>"
        );
        texts(&parse_mjcf(&text, None, &LoadOptions::default()).unwrap().warnings)
    };
    assert_eq!(of("degree", "90 0 0", "-170 170"), [""; 0]);
    assert_eq!(of("radian", "1.5708 -6.28 0", "-2.9 2.9"), [""; 0]);
    assert_eq!(
        of("radian", "90 0 0", "-170 170"),
        [
            "euler of <body name=\"b\"> has an angle of 90 rad (line 2, column 1); the file has angle=\"radian\": if these are \
             degrees, write 1.5708",
            "joint \"j\": limits -170 to 170 rad are 54 turns; the file has angle=\"radian\": if these are degrees, write \
             -2.9671 to 2.9671",
        ]
    );
}

#[test]
fn base_of_a_graph_in_degrees_is_reported() {
    let base = |yaw: f64| {
        let pose = Some(BasePose { position: [0.0; 3], rpy: [0.0, 0.0, yaw] });
        let source = RobotSource { name: "arm", text: "panda", pose, ..RobotSource::default() };
        texts(&source.load().unwrap().warnings)
    };
    assert_eq!(base(-4.7), [""; 0]);
    assert_eq!(
        base(90.0),
        ["`rpy` of `base` has an angle of 90 rad; angles are in radians: if these are degrees, write 1.5708"]
    );
}

#[test]
fn robots_of_the_catalogue_have_no_doubtful_units() {
    for entry in catalogue() {
        let robot = load(entry.name, Path::new(".")).unwrap();
        let is_doubt = |warning: &&ModelWarning| {
            matches!(
                warning,
                ModelWarning::Degrees { .. }
                    | ModelWarning::ManyTurns { .. }
                    | ModelWarning::Oversized { .. }
                    | ModelWarning::TinyInertia { .. }
                    | ModelWarning::LongSlide { .. }
                    | ModelWarning::FastSlide { .. }
            )
        };
        let doubts: Vec<_> = robot.warnings.iter().filter(is_doubt).collect();
        assert!(doubts.is_empty(), "{}: {doubts:?}", entry.name);
        assert_eq!(texts(&robot.mesh_warnings(ShapeSource::Collision)), [""; 0], "{}", entry.name);
    }
}

#[test]
fn unreadable_meshes_are_reported_with_their_reference() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, content: &[u8]| std::fs::write(folder.path().join(name), content).unwrap();
    let mut stl = vec![0; 80];
    stl.extend(7_u32.to_le_bytes());
    stl.resize(184, 0);
    write("cut.stl", &stl);
    write("wrong.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n");
    write("scan.ply", b"ply\n");
    write("good.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n");
    let shape = |name: &str| format!("<geometry><mesh filename=\"{name}\"/></geometry>");
    let names = ["cut.stl", "wrong.obj", "good.obj", "scan.ply"];
    let collisions = names.map(|name| format!("<collision>{}</collision>\n", shape(name))).concat();
    let text = format!(
        "<robot name=\"r\"><link name=\"a\">\n<visual>{}</visual>\n{collisions}</link></robot>",
        shape("lost.stl")
    );
    write("r.urdf", text.as_bytes());
    let within = |found: Vec<String>| -> Vec<String> {
        found.iter().map(|text| text.replace(&format!("{}/", folder.path().display()), "")).collect()
    };
    let robot = load("r.urdf", folder.path()).unwrap();
    assert_eq!(
        within(texts(&robot.mesh_warnings(ShapeSource::Collision))),
        [
            "link \"a\": mesh \"cut.stl\" (r.urdf:3:22): cut.stl: ends after 184 bytes where its header states 434; expected \
             a complete .stl, .obj or .dae file; export it again",
            "link \"a\": mesh \"wrong.obj\" (r.urdf:4:22): wrong.obj:4: a face names corner 9, expected 1 to 3; expected a \
             complete .stl, .obj or .dae file; export it again",
            "link \"a\": mesh \"scan.ply\" (r.urdf:6:22): scan.ply: not a supported mesh format; convert it to .stl, \
             .obj or .dae",
        ]
    );
    let options = LoadOptions { shapes: ShapeSource::Visual, ..LoadOptions::default() };
    let seen = load_with("r.urdf", folder.path(), &options).unwrap();
    let missing = within(texts(&seen.warnings));
    assert!(
        missing[0].starts_with("link \"a\": mesh \"lost.stl\" not found in ")
            && missing[0].ends_with("(r.urdf:2:19)"),
        "{missing:?}"
    );
    // an included file of assets
    write("assets.xml", b"<mujoco><asset>\n<mesh name=\"m\" file=\"cut.stl\"/></asset></mujoco>");
    write(
        "r.xml",
        b"<mujoco><include file=\"assets.xml\"/><worldbody><body name=\"b\"><joint/>\
          <inertial pos=\"0 0 0\" mass=\"1\" diaginertia=\"1 1 1\"/><geom type=\"mesh\" mesh=\"m\"/></body></worldbody></mujoco>",
    );
    let robot = load("r.xml", folder.path()).unwrap();
    let found = within(texts(&robot.mesh_warnings(ShapeSource::Collision)));
    assert!(
        found.len() == 1 && found[0].contains("mesh \"cut.stl\" (assets.xml:2:1): cut.stl: ends"),
        "{found:?}"
    );
}

#[test]
fn missing_meshes_are_named() {
    let geometry = |n: usize| format!("<geometry><mesh filename=\"m{n}.stl\"/></geometry>");
    let robot = |links: &[&[usize]]| {
        let link = |(index, meshes): (usize, &&[usize])| {
            let shapes: String =
                meshes.iter().map(|n| format!("<collision>{}</collision>", geometry(*n))).collect();
            format!("<link name=\"l{index}\">{shapes}</link>")
        };
        let links: String = links.iter().enumerate().map(link).collect();
        let joint = |n: usize| {
            format!("<joint name=\"j{n}\" type=\"fixed\"><parent link=\"l0\"/><child link=\"l{n}\"/></joint>")
        };
        let joints: String = (1..4).filter(|n| links.contains(&format!("\"l{n}\""))).map(joint).collect();
        let text = format!("<robot name=\"r\">{links}{joints}</robot>");
        let warnings = parse_urdf(&text, None, MimicMode::Follow, &PackagePath::default()).unwrap().warnings;
        let meshes: Vec<_> = warnings
            .into_iter()
            .filter(|warning| matches!(warning, ModelWarning::MissingMesh { .. }))
            .collect();
        ModelWarning::summarise(&meshes)
    };
    let folder = "not found in .";
    assert_eq!(robot(&[&[1]]), ["link \"l0\": mesh \"m1.stl\" not found in ."]);
    assert_eq!(robot(&[&[1, 1]]), ["link \"l0\": mesh \"m1.stl\" not found in ."], "visual and collision");
    assert_eq!(robot(&[&[1, 2]]), [format!("link \"l0\": meshes \"m1.stl\", \"m2.stl\" {folder}")]);
    assert_eq!(
        robot(&[&[1], &[2], &[3, 4]]),
        [format!(
            "links \"l0\", \"l1\", \"l2\": meshes \"m1.stl\", \"m2.stl\", \"m3.stl\" and 1 more {folder}"
        )]
    );
}
