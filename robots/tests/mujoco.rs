//! Files of both formats compared with MuJoCo, which shares no code with Pinocchio; `mujoco/generate.py`
//! writes the vectors.

use std::path::{Path, PathBuf};

use approx::assert_relative_eq;
use motorium_robots::{
    CollisionModel, CollisionOptions, LinkColours, LoadOptions, MimicMode, Model, ModelWarning, ShapeSource,
    load_with, parse_mjcf,
};
use serde_json::Value;

mod compare;
mod scene;
mod traps;

fn read(path: &Path) -> Model {
    let options = LoadOptions { mimic: MimicMode::Independent, ..LoadOptions::default() };
    if path.extension().is_some_and(|extension| extension == "urdf") {
        return load_with(path.to_str().unwrap(), Path::new("."), &options).unwrap().model;
    }
    let robot = parse_mjcf(&std::fs::read_to_string(path).unwrap(), Some(path), &options).unwrap();
    let defect = |warning: &&ModelWarning| !matches!(warning, ModelWarning::Ignored { .. });
    assert_eq!(robot.warnings.iter().find(defect), None, "{}", path.display());
    robot.model
}

/// Largest relative error over all quantities and cases.
fn compare(model: &Model, robot: &Value) -> f64 {
    let floating = model.base().floating;
    let joints: Vec<&str> =
        robot["joints"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect();
    assert_eq!(joints[usize::from(floating)..], *model.joint_names(), "order of the joints");
    let mut worst: f64 = 0.0;
    let mut check = |what: &str, ours: &[f64], theirs: &[f64]| {
        let error = compare::error(ours, theirs);
        assert!(error < 1e-10, "{what}: {error:e}\n{ours:?}\n{theirs:?}");
        worst = worst.max(error);
    };
    for case in robot["cases"].as_array().unwrap() {
        compare::case(model, case, &mut check);
    }
    worst
}

#[test]
fn both_formats_agree_with_mujoco() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/mujoco");
    let document: Value = serde_json::from_str(include_str!("mujoco/vectors.json")).unwrap();
    let robots = document["robots"].as_array().unwrap();
    assert_eq!(robots.len(), 5);
    for robot in robots {
        let file = robot["file"].as_str().unwrap();
        let places = ["", "../fixtures", "../../catalogue/panda"];
        let path = places.map(|place| folder.join(place).join(file)).into_iter().find(|path| path.is_file());
        let worst = compare(&read(&path.unwrap()), robot);
        println!("{file}: {worst:.1e}");
    }
}

#[test]
fn configured_total_mass_is_distributed_over_bodies() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/mujoco/runner.xml");
    let model = read(&path);
    assert_relative_eq!(model.mass(), 14.0, epsilon = 1e-12);
    // the mass ratios are kept: as with 1000 kg/m3
    let plain = std::fs::read_to_string(&path).unwrap().replace(" settotalmass=\"14\"", "");
    let plain = parse_mjcf(&plain, None, &LoadOptions::default()).unwrap().model;
    for (set, own) in model.bodies().iter().zip(plain.bodies()) {
        assert_relative_eq!(set.inertia.mass / 14.0, own.inertia.mass / plain.mass(), epsilon = 1e-12);
        assert_relative_eq!(
            set.inertia.rotational * (plain.mass() / 14.0),
            own.inertia.rotational,
            epsilon = 1e-12
        );
    }
}

/// Other files: `MOTORIUM_MUJOCO_VECTORS` names the script's output, which is next to the files themselves.
#[test]
fn external_files_agree_with_mujoco() {
    let Some(path) = std::env::var_os("MOTORIUM_MUJOCO_VECTORS").map(PathBuf::from) else {
        println!(
            "skipped: set MOTORIUM_MUJOCO_VECTORS to the vectors that mujoco/generate.py wrote of some files"
        );
        return;
    };
    let document: Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
    for robot in document["robots"].as_array().unwrap() {
        let file = path.with_file_name(robot["file"].as_str().unwrap());
        println!("{}: {:.1e}", file.display(), compare(&read(&file), robot));
    }
}

#[test]
fn collision_masks_are_read() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/mujoco/walker.xml");
    let text = std::fs::read_to_string(&path).unwrap();
    let robot = parse_mjcf(&text, Some(&path), &LoadOptions::default()).unwrap();
    let model = &robot.model;
    // Floor and step are in the world, box and sphere on the trunk; its cylinder does not collide.
    assert_eq!((model.base().world_shapes.len(), model.base_shapes().len()), (2, 2));
    let options = CollisionOptions { srdf: robot.exclusions, ..CollisionOptions::default() };
    let solids = CollisionModel::new(model, &options).unwrap();
    let names: Vec<_> = (0..solids.pairs().len()).map(|pair| solids.pair_links(pair)).collect();
    assert!(names.contains(&["world", "left_shin"]) || names.contains(&["left_shin", "world"]));
    assert!(!names.contains(&["trunk", "left_shin"]) && !names.contains(&["trunk", "left_thigh"]));
    assert!(names.contains(&["left_shin", "right_thigh"]));
    let knee = model.joint(model.joint_index("left_knee").unwrap());
    assert_relative_eq!(knee.limits.lower, -60.0_f64.to_radians(), epsilon = 1e-15);
    assert_eq!((knee.dynamics.damping, knee.drive.armature()), (0.5, 0.02));
}

#[test]
fn bodies_whose_geoms_never_collide_in_mujoco_are_excluded() {
    let excluded = |floor: &str, robot: &str| {
        let text = format!(
            "<mujoco><default><geom {robot}/></default><worldbody><geom {floor} type=\"plane\"/>\
             <body name=\"a\"><joint/><geom size=\"0.1\"/><body name=\"b\"><joint/><geom size=\"0.1\"/></body></body></worldbody></mujoco>"
        );
        parse_mjcf(&text, None, &LoadOptions::default()).unwrap().exclusions.disabled
    };
    let pair = |one: &str, other: &str| (one.to_owned(), other.to_owned());
    assert_eq!(excluded("", ""), []);
    // a floor that collides with the robot, which has no self-collision
    assert_eq!(excluded("conaffinity=\"0\" contype=\"1\"", "contype=\"0\""), [pair("a", "b")]);
    assert_eq!(excluded("contype=\"2\" conaffinity=\"2\"", ""), [pair("a", "world"), pair("b", "world")]);
    // bit 31 is treated like any other
    assert_eq!(
        excluded("contype=\"2147483648\" conaffinity=\"0\"", "contype=\"0\" conaffinity=\"2147483648\""),
        [pair("a", "b")]
    );
}

/// Colours of the geoms of this file by `mjv_updateScene` of MuJoCo 3.17, without opacity.
const PAINTED: &str = r#"<mujoco model="painted">
  <default>
    <geom rgba="0.1 0.2 0.3 1"/>
    <default class="bare"><geom rgba="0.5 0.5 0.5 1"/></default>
    <default class="dull"><material rgba="0.3 0.3 0.9 1"/></default>
  </default>
  <asset>
    <material name="red" rgba="0.8 0.1 0.1 1"/>
    <material name="white" specular="0.2"/>
    <material name="blue" class="dull"/>
  </asset>
  <worldbody>
    <geom name="own" size="0.1" rgba="0.9 0.8 0.7 1"/>
    <body name="arm" pos="0 0 0.5">
      <joint name="turn" axis="0 0 1" range="-170 170"/>
      <inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>
      <geom name="of_default" size="0.1"/>
      <geom name="over_material" size="0.1" material="red" rgba="0 1 0 0.5"/>
      <geom name="of_material" class="bare" size="0.1" material="red"/>
      <geom name="of_plain_material" class="bare" size="0.1" material="white"/>
      <geom name="of_class_of_material" class="bare" size="0.1" material="blue"/>
      <geom name="unseen" size="0.1" rgba="1 0 0 0"/>
    </body>
  </worldbody>
</mujoco>"#;

#[test]
fn geom_colours_match_mujoco_and_survive_urdf() {
    let options = LoadOptions { shapes: ShapeSource::Visual, ..LoadOptions::default() };
    let robot = parse_mjcf(PAINTED, None, &options).unwrap();
    assert_eq!(robot.colours.of_shape("world", 0, None), [0.9, 0.8, 0.7]);
    let drawn = [[0.1, 0.2, 0.3], [0.0, 1.0, 0.0], [0.8, 0.1, 0.1], [1.0; 3], [0.3, 0.3, 0.9]];
    assert_eq!(robot.model.bodies()[0].shapes.len(), drawn.len(), "invisible geoms are omitted");
    for (place, colour) in drawn.into_iter().enumerate() {
        assert_eq!(robot.colours.of_shape("arm", place, Some(0)), colour, "geom {place}");
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("painted.xml");
    std::fs::write(&file, PAINTED).unwrap();
    let loaded = load_with(file.to_str().unwrap(), folder.path(), &LoadOptions::default()).unwrap();
    let urdf = loaded.drawn().unwrap().unwrap().text;
    let again = LinkColours::of_urdf(&urdf);
    for (place, colour) in drawn.into_iter().enumerate() {
        assert_eq!(again.of_shape("arm", place, Some(0)), colour, "geom {place} in {urdf}");
    }
    // The colliding shapes are all shapes, including the invisible one.
    let colliding = loaded.link_colours(ShapeSource::Collision).unwrap();
    assert_eq!(colliding.of_shape("arm", 5, Some(0)), [1.0, 0.0, 0.0]);
}

#[test]
fn missing_link_colours_come_from_visual_geoms() {
    let text = r#"<mujoco><worldbody><body name="arm"><joint axis="0 0 1"/>
        <inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/>
        <geom size="0.1" contype="0" conaffinity="0" rgba="0.2 0.4 0.6 1"/><geom size="0.1" group="3"/>
        </body></worldbody></mujoco>"#;
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("arm.xml");
    std::fs::write(&file, text).unwrap();
    let loaded = load_with(file.to_str().unwrap(), folder.path(), &LoadOptions::default()).unwrap();
    let colours = loaded.link_colours(ShapeSource::Collision).unwrap();
    assert_eq!(colours.of_shape("arm", 0, Some(0)), [0.2, 0.4, 0.6]);
}

#[test]
fn unknown_materials_and_short_colours_are_rejected() {
    let geom = |looks: &str| {
        refusal(&format!(
            "<asset><material name=\"red\"/></asset><worldbody><geom size=\"0.1\" {looks}/></worldbody>"
        ))
    };
    let error = geom("material=\"rde\"");
    assert!(error.contains("\"rde\"") && error.contains("\"red\""), "{error}");
    let error = geom("rgba=\"1 0 0\"");
    assert!(error.contains("rgba") && error.contains("4 numbers"), "{error}");
}

fn refusal(body: &str) -> String {
    let text = format!("<mujoco>\n{body}\n</mujoco>");
    parse_mjcf(&text, None, &LoadOptions::default()).unwrap_err().to_string()
}

#[test]
fn unsupported_content_is_rejected_with_its_position() {
    let world =
        |content: &str| refusal(&format!("<worldbody><body name=\"b\">\n{content}</body></worldbody>"));
    assert!(
        refusal("<include file=\"x.xml\"/>")
            .starts_with("MJCF:2:1: <include> of \"x.xml\": a text that is not from a file")
    );
    assert!(
        refusal("<compiler coordinate=\"global\"/>")
            .starts_with("MJCF:2:1: coordinate=\"global\" of <compiler>")
    );
    assert!(world("<joint type=\"ball\"/>").contains("MJCF:3:1: type=\"ball\" of <joint>"));
    assert!(
        world("<joint name=\"j\" axis=\"0 0\"/>")
            .contains("axis=\"0 0\" of <joint name=\"j\">: expected 3 numbers")
    );
    assert!(world("<geom type=\"ellipsoid\" size=\"1 1 1\"/>").contains("use a sphere"));
    assert!(world("<geom size=\"-1\"/>").contains("expected 1 numbers above 0 for a sphere"));
    assert!(world("<geom siez=\"1\"/>").contains("siez=\"1\" of <geom>"));
    assert!(world("<geom class=\"x\" size=\"1\"/>").contains("names the class \"x\", which does not exist"));
    assert!(world("<replicate count=\"3\"/>").contains("<replicate>"));
    assert!(world("<body name=\"b\"/>").contains("a second body is named \"b\""));
    assert!(
        world("<body name=\"c\"><freejoint/></body>")
            .contains("only a body of the world can have a free joint")
    );
    let two = "<worldbody><body><freejoint/><geom size=\"1\"/></body>\n<body><joint/><geom size=\"1\"/></body></worldbody>";
    assert!(refusal(two).starts_with("MJCF:3:1: next to a body with a free joint, no other body may move"));
    assert!(refusal("<worldbody><body><joint/></worldbody>").contains("MJCF:2:"));
    assert!(
        refusal("<equality><weld body1=\"a\"/></equality>").contains("<weld> of <equality> is not supported")
    );
}

#[test]
fn first_order_coupling_is_a_mimic_joint() {
    let text = "<mujoco><compiler angle=\"radian\"/><worldbody><body name=\"a\"><joint name=\"one\" ref=\"0.2\"/>\
                <geom size=\"0.1\"/><body name=\"b\" pos=\"1 0 0\"><joint name=\"two\" ref=\"0.5\"/><geom size=\"0.1\"/></body></body>\
                </worldbody><equality><joint joint1=\"two\" joint2=\"one\" polycoef=\"0.1 -2 0 0 0\"/></equality></mujoco>";
    let model = parse_mjcf(text, None, &LoadOptions::default()).unwrap().model;
    assert_eq!(model.joint_names(), ["one"]);
    // two - 0.5 = 0.1 - 2 (one - 0.2)
    assert_relative_eq!(model.bodies()[1].joint.coordinate.position(&[0.6]), -0.2, epsilon = 1e-15);
    let free = LoadOptions { mimic: MimicMode::Independent, ..LoadOptions::default() };
    assert_eq!(parse_mjcf(text, None, &free).unwrap().model.nv(), 2);
}

/// `kp` and `kd` of MuJoCo 4.0.0: `gainprm[0]`, and `-biasprm[2]`.
#[test]
fn actuators_of_a_class_share_one_default() {
    let general = r#"<general biastype="affine" gainprm="200" biasprm="0 -200 -10"/>"#;
    for (class, actuator, gains) in [
        (general, "<position joint=\"j\"/>", Some((200.0, 10.0))),
        (general, "<position joint=\"j\" kp=\"300\"/>", Some((300.0, 10.0))),
        (general, "<general joint=\"j\"/>", Some((200.0, 10.0))),
        (r#"<position kp="50" kv="3"/>"#, "<general joint=\"j\"/>", Some((50.0, 3.0))),
        (r#"<position kp="50" kv="3"/>"#, "<position joint=\"j\" kv=\"4\"/>", Some((50.0, 4.0))),
        (r#"<position kp="50"/>"#, "<general joint=\"j\" gainprm=\"60\"/>", None),
        ("<motor/>", "<position joint=\"j\" kp=\"7\"/>", Some((7.0, 0.0))),
        (r#"<velocity kv="9"/>"#, "<general joint=\"j\"/>", None),
        // values of another kind do not count, except values of a general actuator with a fixed gain
        (r#"<velocity kv="12"/>"#, "<position joint=\"j\"/>", Some((1.0, 0.0))),
        (r#"<intvelocity kp="33" kv="2"/>"#, "<position joint=\"j\"/>", Some((1.0, 0.0))),
        (r#"<damper kv="2" ctrlrange="0 1"/>"#, "<position joint=\"j\"/>", Some((1.0, 0.0))),
        (r#"<position kp="40" kv="3"/><motor/>"#, "<position joint=\"j\"/>", Some((1.0, 0.0))),
        (r#"<position kp="40" kv="3"/><velocity kv="12"/>"#, "<position joint=\"j\"/>", Some((1.0, 0.0))),
        (
            r#"<position kp="40" kv="3"/><motor/><general gear="1"/>"#,
            "<position joint=\"j\"/>",
            Some((1.0, 0.0)),
        ),
        (r#"<general gainprm="80"/><position kv="3"/>"#, "<position joint=\"j\"/>", Some((80.0, 3.0))),
        (r#"<velocity kv="4"/><general gainprm="80"/>"#, "<position joint=\"j\"/>", Some((80.0, 4.0))),
        (r#"<general gainprm="80" gaintype="affine"/>"#, "<position joint=\"j\"/>", Some((1.0, 0.0))),
        (
            r#"<position kp="40" kv="3"/><default class="a"><motor/></default>"#,
            "<position class=\"a\" joint=\"j\"/>",
            Some((40.0, 3.0)),
        ),
        (
            r#"<position kp="40" kv="3"/><default class="a"><velocity kv="12"/><position kv="5"/></default>"#,
            "<position class=\"a\" joint=\"j\"/>",
            Some((40.0, 5.0)),
        ),
        (
            r#"<general gainprm="80" biasprm="0 -50 -5"/><default class="a"><velocity kv="4"/></default>"#,
            "<position class=\"a\" joint=\"j\"/>",
            Some((80.0, 5.0)),
        ),
        (
            r#"<position kp="40"/><default class="a"><general gainprm="80"/><motor/><default class="b"><motor/></default></default>"#,
            "<position class=\"b\" joint=\"j\"/>",
            Some((40.0, 0.0)),
        ),
    ] {
        let text = format!(
            "<mujoco><default>{class}</default><worldbody><body><joint name=\"j\"/><geom size=\"0.1\"/></body></worldbody>\
             <actuator>{actuator}</actuator></mujoco>"
        );
        let robot = parse_mjcf(&text, None, &LoadOptions::default()).unwrap();
        let profile = robot.profile.as_ref();
        let found = profile.and_then(|profile| profile.gains(&robot.model).ok());
        let found = found.map(|gains| (gains.kp[0], gains.kd[0]));
        assert_eq!(found, gains, "{class} {actuator}");
    }
}
