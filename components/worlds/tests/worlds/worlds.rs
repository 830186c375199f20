//! Worlds of files that other programs read, and meshes of objects.

use std::path::Path;

use motorium_robots::TriangleMesh;
use motorium_worlds::{
    MeshShape, Object, ObjectShape, Ray, RayScene, World, WorldError, WorldFileError, parse_mjcf_world,
};
use nalgebra::{Point3, Vector3};

/// A square frame: outer sides of 2 m, a hole of 1 m, 0.5 m thick, about a corner. In OBJ.
fn frame() -> String {
    let ring = |half: f64, z: f64| {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| (x * half + 1.0, y * half + 1.0, z))
    };
    let points = [ring(1.0, 0.0), ring(0.5, 0.0), ring(1.0, 0.5), ring(0.5, 0.5)].concat();
    let mut text: String = points.iter().map(|(x, y, z)| format!("v {x} {y} {z}\n")).collect();
    for side in 0..4 {
        let next = (side + 1) % 4;
        let [a, b, c, d] = [side, next, 4 + next, 4 + side];
        // Below, above, outside, inside: outward.
        for face in [[d, c, b, a], [a + 8, b + 8, c + 8, d + 8], [a, b, b + 8, a + 8], [c, d, d + 8, c + 8]] {
            let [p, q, r, s] = face.map(|corner| corner + 1);
            text += &format!("f {p} {q} {r} {s}\n");
        }
    }
    text
}

#[test]
fn a_hollow_mesh_has_the_inertia_of_two_boxes() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("frame.obj"), frame()).unwrap();
    let text = r#"
[[objects]]
name = "frame"
shape = { mesh = { file = "frame.obj", scale = [0.1, 0.1, 0.1], collision = { parts = 8 } } }
density = 2700.0
position = [1.0, 2.0, 3.0]
"#;
    let mut world: World = toml::from_str(text).unwrap();
    world.locate(folder.path()).unwrap();
    world.check(std::iter::empty()).unwrap();
    let own = world.objects[0].mass_properties().unwrap();
    // An outer box minus an inner box with the same centre.
    let of_box = |side: f64, height: f64| {
        let mass = 2700.0 * side * side * height;
        (mass, mass * (side * side + height * height) / 12.0, mass * (side * side + side * side) / 12.0)
    };
    let ((m, ix, iz), (n, jx, jz)) = (of_box(0.2, 0.05), of_box(0.1, 0.05));
    assert!((own.mass - (m - n)).abs() < 1e-9, "{}", own.mass);
    let mut moments: Vec<f64> = own.moments.iter().copied().collect();
    moments.sort_by(f64::total_cmp);
    for (found, expected) in moments.iter().zip([ix - jx, ix - jx, iz - jz]) {
        assert!((found - expected).abs() < 1e-9, "{found}, {expected}");
    }
    let centre = own.frame.unwrap().translation.vector;
    assert!((centre - Vector3::new(0.1, 0.1, 0.025)).norm() < 1e-12, "{centre}");
}

#[test]
fn rays_pass_through_the_hole_of_a_mesh_and_hit_its_rim() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("frame.obj"), frame()).unwrap();
    let mesh = MeshShape::new(folder.path().join("frame.obj"));
    let object = Object {
        name: "frame".to_owned(),
        shape: ObjectShape::Mesh(mesh),
        position: [-1.0, -1.0, 2.0],
        ..Object::default()
    };
    let mut scene = RayScene::default();
    scene.add_world(&World { objects: vec![object], ..World::default() });
    let cast = |x: f64, y: f64, z: f64, up: bool| {
        let direction = if up { Vector3::z_axis() } else { -Vector3::z_axis() };
        scene.cast(&Ray { origin: Point3::new(x, y, z), direction }, 20.0)
    };
    assert!(cast(0.1, 0.2, 5.0, false).is_none(), "the hole");
    let top = cast(0.7, 0.2, 5.0, false).unwrap();
    assert!((top.distance - 2.5).abs() < 1e-12 && top.normal == Vector3::z(), "{top:?}");
    let below = cast(0.7, 0.2, 0.0, true).unwrap();
    assert!((below.distance - 2.0).abs() < 1e-12 && below.normal == -Vector3::z(), "{below:?}");
    let inside = cast(0.7, 0.2, 2.25, true).unwrap();
    assert!((inside.distance - 0.25).abs() < 1e-12 && inside.normal == -Vector3::z(), "{inside:?}");
}

const MJCF: &str = r#"<mujoco model="yard">
  <compiler angle="degree"/>
  <option gravity="0 0 -3.7" wind="1 0 0"/>
  <default><geom friction="0.9 0.01 0.002"/></default>
  <worldbody>
    <light pos="0 0 3"/>
    <geom name="floor" type="plane" size="0 0 .1" pos="0 0 0.2" condim="6"/>
    <body name="shed" pos="2 0 0.2" euler="0 0 90">
      <geom type="box" size="1 0.5 0.4" pos="0 0 0.4"/>
      <geom name="mast" type="capsule" size="0.05" fromto="0 0 0.8 0 0 1.8"/>
    </body>
    <body name="can" pos="0 0 1"><freejoint/><geom type="cylinder" size="0.03 0.06" density="500" friction="0.5"/></body>
    <geom name="haze" type="sphere" size="3" contype="0" conaffinity="0"/>
  </worldbody>
</mujoco>"#;

#[test]
fn mjcf_world_has_its_gravity_geoms_and_free_bodies() {
    let read = parse_mjcf_world(MJCF, None).unwrap();
    let world = &read.world;
    assert_eq!((world.gravity, world.wind), ([0.0, 0.0, -3.7], [1.0, 0.0, 0.0]));
    let ground = world.ground.unwrap();
    assert!((ground.height - 0.2).abs() < 1e-12);
    assert_eq!((ground.friction, ground.torsional_friction, ground.rolling_friction), (0.9, 0.01, 0.002));
    let names: Vec<&str> = world.objects.iter().map(|object| object.name.as_str()).collect();
    assert_eq!(names, ["shed", "mast", "can"]);
    let [shed, mast, can] = &world.objects[..] else { panic!() };
    assert_eq!(shed.shape, ObjectShape::Box { size: [2.0, 1.0, 0.8] });
    assert!(
        (shed.position[2] - 0.6).abs() < 1e-12 && (shed.rpy[2] - core::f64::consts::FRAC_PI_2).abs() < 1e-12
    );
    assert!((mast.position[2] - 1.5).abs() < 1e-12 && !mast.is_dynamic(), "{mast:?}");
    assert_eq!((shed.torsional_friction, can.friction), (0.0, 0.5));
    let volume = core::f64::consts::PI * 0.03 * 0.03 * 0.12;
    assert!((can.mass.unwrap() - 500.0 * volume).abs() < 1e-12);
    let left_out: Vec<String> = read.warnings.iter().map(ToString::to_string).collect();
    assert!(left_out.iter().any(|warning| warning.contains("touches nothing")), "{left_out:?}");
    world.check(std::iter::empty()).unwrap();
}

#[test]
fn unsupported_world_content_is_rejected_with_position() {
    for (old, new, expected) in [
        ("<freejoint/>", "<joint/>", "12:34: a body with a joint is part of a robot"),
        (
            "<light pos=\"0 0 3\"/>",
            "<geom type=\"hfield\" hfield=\"h\"/>",
            "6:5: <geom> names the hfield \"h\"",
        ),
        (
            "<geom type=\"cylinder\"",
            "<body><joint/></body><geom type=\"cylinder\"",
            "a body with a joint is part of a robot",
        ),
        ("</mujoco>", "<actuator/></mujoco>", "<actuator> describes a robot"),
        ("<light", "<tree", "<tree> is not supported"),
    ] {
        let error = parse_mjcf_world(&MJCF.replacen(old, new, 1), None).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

fn of_file(name: &str, text: &str) -> Result<World, WorldError> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join(name), text).unwrap();
    let mut world: World = toml::from_str(&format!("file = \"{name}\"")).unwrap();
    world.locate(folder.path()).map(|_| world)
}

/// The warnings of a world in TOML.
fn doubts(text: &str) -> Vec<String> {
    let mut world: World = toml::from_str(text).unwrap();
    let warnings = world.locate(Path::new("")).unwrap();
    warnings.iter().map(ToString::to_string).collect()
}

#[test]
fn objects_in_degrees_or_millimetres_are_reported() {
    let object = |sides: &str, rest: &str| {
        doubts(&format!(
            "[[objects]]\nname = \"crate\"\nposition = [0.0, 0.0, 1.0]\nshape = {{ box = {{ size = {sides} }} }}\n{rest}"
        ))
    };
    for good in ["rpy = [3.14159, -6.28, 4.7]", "mass = 2.0", "mass = 2.0\nrpy = [0.0, 7.853981634, 0.0]"] {
        assert_eq!(object("[3.0, 0.4, 19.0]", good), [""; 0], "{good}");
    }
    assert_eq!(
        object(
            "[0.4, 0.4, 0.4]",
            "rpy = [0.0, 0.0, 90.0]\ncopies = { count = [3, 1, 1], spacing = [1.0, 0.0, 0.0] }"
        ),
        [
            "`rpy` of object `crate_0` has an angle of 90 rad; angles are in radians: if these are degrees, write 1.5708"
        ]
    );
    assert_eq!(
        object("[300.0, 40.0, 40.0]", "mass = 2.0"),
        [
            "object \"crate\": longest side of 300.0 m, expected at most 20 m; if lengths are in millimetres, divide them by 1000"
        ]
    );
    // a fixed object may be a building, and its walls are thin
    assert_eq!(object("[300.0, 40.0, 40.0]", ""), [""; 0]);
    let table = object("[1500.0, 800.0, 750.0]", "");
    assert!(matches!(&table[..], [found] if found.contains("shortest side of 750.0 m")), "{table:?}");
    let parts = "[[objects]]\nname = \"rod\"\nposition = [0.0, 0.0, 1.0]\nmass = 1.0\nshape = { compound = [\
                 { shape = { sphere = { radius = 0.1 } } }, \
                 { shape = { sphere = { radius = 0.1 } }, position = [0.0, 0.0, 450.0], rpy = [45.0, 0.0, 0.0] }] }";
    let found = doubts(parts);
    assert!(found.len() == 2 && found[0].starts_with("`rpy` of part 1 of object `rod`"), "{found:?}");
    assert!(found[1].starts_with("object \"rod\": longest side of 450.2 m"), "{found:?}");
}

#[test]
fn masses_and_velocities_in_other_units_are_reported() {
    let ball = |rest: &str| {
        doubts(&format!(
            "[[objects]]\nname = \"ball\"\nshape = {{ sphere = {{ radius = 0.1 }} }}\nposition = [0.0, 0.0, 1.0]\n{rest}"
        ))
    };
    for good in
        ["mass = 90.0", "density = 7850.0", "density = 10.0", "mass = 1.0\nvelocity = [300.0, 0.0, 0.0]"]
    {
        assert_eq!(ball(good), [""; 0], "{good}");
    }
    for (rest, found) in [
        (
            "density = 7.85",
            "object \"ball\": `density` is 7.85 kg/m3, expected at least 10 kg/m3; if it is in g/cm3, multiply it by 1000",
        ),
        (
            "mass = 500.0",
            "object \"ball\": the density of its mass is 119366 kg/m3, expected at most 22590 kg/m3, osmium's; if the mass is in grams, divide it by 1000",
        ),
        (
            "mass = 1.0\nvelocity = [0.0, 1500.0, 0.0]",
            "object \"ball\": `velocity` is 1500 m/s, expected at most 1000 m/s; if it is in mm/s, divide it by 1000",
        ),
    ] {
        assert_eq!(ball(rest), [found]);
    }
    for (world, found) in [
        (
            "ground = { height = -1200.0 }",
            "ground: `height` is -1200 m, expected -1000 to 1000 m; if it is in millimetres, divide it by 1000",
        ),
        (
            "air_density = 1225.0",
            "world: `air_density` is 1225 kg/m3, expected at most 1100 kg/m3; if it is in g/m3, divide it by 1000",
        ),
        (
            "wind = [3000.0, 0.0, 0.0]",
            "world: `wind` is 3000 m/s, expected at most 100 m/s; if it is in mm/s, divide it by 1000",
        ),
        (
            "ground = { conveyor = { velocity = [500.0, 0.0, 0.0] } }",
            "ground: `conveyor.velocity` is 500 m/s, expected at most 100 m/s; if it is in mm/s, divide it by 1000",
        ),
        (
            "objects = [{ name = \"a\", shape = { sphere = { radius = 0.1 } }, position = [1500.0, 0.0, 0.0] }]",
            "object \"a\": `position` is 1500 m, expected at most 1000 m; if it is in millimetres, divide it by 1000",
        ),
    ] {
        assert_eq!(doubts(world), [found]);
    }
}

#[test]
fn sdf_in_degrees_or_millimetres_is_reported() {
    let model = |pose: &str, size: &str| {
        let text = format!(
            "<sdf version=\"1.9\"><world name=\"w\"><model name=\"crate\">\n{pose}<link name=\"l\"><inertial auto=\"true\"/>\
             <collision name=\"c\"><geometry><box><size>{size}</size></box></geometry></collision></link></model></world></sdf>"
        );
        super::surfaces::read(&text).unwrap().1
    };
    for good in ["0 0 1 0 3.14159 6.28", "0 0 1 0 0 -4.7"] {
        assert_eq!(model(&format!("<pose>{good}</pose>"), "0.3 0.2 0.1"), [""; 0], "{good}");
    }
    assert_eq!(model("<pose degrees=\"true\">0 0 1 0 90 0</pose>", "0.3 0.2 0.1"), [""; 0]);
    assert_eq!(
        model("<pose>0 0 1 0 90 0</pose>", "0.3 0.2 0.1"),
        [
            "<pose> of <model name=\"crate\"> has an angle of 90 rad (line 2, column 1); SDF angles are in radians without degrees=\"true\": \
             if these are degrees, write 1.5708"
        ]
    );
    let large = model("", "300 200 100");
    assert!(
        matches!(&large[..], [found] if found.contains("longest side of 300.0 m, expected at most 20 m")),
        "{large:?}"
    );
}

#[test]
fn gravity_in_millimetres_and_empty_names_are_refused() {
    let refused = |world: World| world.check(std::iter::empty()).expect_err("it is refused").to_string();
    let gravity = [0.0, 0.0, -9810.0];
    assert_eq!(
        refused(World { gravity, ..World::default() }),
        "world: `gravity` is -9810, expected -1000 to 1000 m/s2"
    );
    let shape = ObjectShape::Sphere { radius: 0.1 };
    let object = |name: &str| Object { name: name.to_owned(), shape: shape.clone(), ..Object::default() };
    let objects = vec![object("ball"), object("")];
    assert_eq!(refused(World { objects, ..World::default() }), "object 1: its `name` is empty");
}

#[test]
fn keys_next_to_a_file_extend_its_world() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("yard.xml"), MJCF).unwrap();
    let text = r#"
file = "yard.xml"
objects = [{ name = "ball", shape = { sphere = { radius = 0.1 } }, mass = 1.0, position = [0.0, 0.0, 2.0] }]
appearance = { colours = { shed = [0.5, 0.2, 0.1] } }
"#;
    let mut world: World = toml::from_str(text).unwrap();
    world.locate(folder.path()).unwrap();
    world.check(std::iter::empty()).unwrap();
    assert_eq!((world.gravity[2], world.objects.len()), (-3.7, 4));
    assert_eq!(world.objects[3].name, "ball");
    for stated in [-1.6, -9.81] {
        let text = format!("file = \"yard.xml\"\ngravity = [0.0, 0.0, {stated}]");
        let mut world: World = toml::from_str(&text).unwrap();
        world.locate(folder.path()).unwrap();
        assert_eq!(world.gravity[2], stated);
    }
}

/// Hidden colliding geoms and visible non-colliding geoms, as in many files, with colours of geoms, classes
/// and materials.
const COLOURED: &str = r#"<mujoco>
  <default>
    <default class="touched"><geom group="3" rgba="0 1 1 0.3"/></default>
    <default class="seen"><geom group="2" contype="0" conaffinity="0" mass="0"/></default>
  </default>
  <asset>
    <texture name="squares" type="2d" builtin="checker" rgb1="0 0 0" rgb2="1 1 1" width="8" height="8"/>
    <material name="squares" texture="squares"/>
    <material name="wood" rgba="0.6 0.4 0.2 1"/>
    <hfield name="hill" nrow="2" ncol="2" size="1 1 1 1" elevation="0 1 1 0"/>
  </asset>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1" rgba="0.1 0.2 0.3 1"/>
    <geom name="table" type="box" size="1 1 0.1" material="wood"/>
    <geom name="wall" type="box" size="1 0.1 1" pos="0 3 1" material="squares"/>
    <geom name="hill" type="hfield" hfield="hill" pos="5 5 0" rgba="0.3 0.5 0.1 1"/>
    <body name="mug" pos="0 0 1"><freejoint/>
      <geom class="touched" type="cylinder" size="0.04 0.05"/>
      <geom class="touched" type="sphere" size="0.02" pos="0.05 0 0"/>
      <geom class="seen" type="cylinder" size="0.04 0.05" rgba="0.9 0.8 0.7 1"/>
    </body>
    <body name="stone" pos="1 0 1"><freejoint/><geom class="touched" size="0.1"/></body>
    <body name="cup" pos="2 0 1"><freejoint/><geom size="0.1"/></body>
    <body name="cup2" pos="3 0 1"><freejoint/><geom size="0.1" rgba="1 0 0 1"/></body>
  </worldbody>
</mujoco>"#;

#[test]
fn objects_of_mjcf_keep_their_colours_unless_overridden() {
    let mut world = of_file("table.xml", COLOURED).unwrap();
    world.check(std::iter::empty()).unwrap();
    let colours = |world: &World| {
        let of = |(name, colour): (&String, &[f64; 3])| (name.clone(), *colour);
        world.appearance.colours.iter().map(of).collect::<Vec<_>>()
    };
    let expected = [
        ("cup2", [1.0, 0.0, 0.0]),
        ("ground", [0.1, 0.2, 0.3]),
        ("hill", [0.3, 0.5, 0.1]),
        ("mug", [0.9, 0.8, 0.7]),
        ("stone", [0.0, 1.0, 1.0]),
        ("table", [0.6, 0.4, 0.2]),
    ];
    assert_eq!(colours(&world), expected.map(|(name, colour)| (name.to_string(), colour)));
    assert_eq!(world.appearance.ground(), [0.1, 0.2, 0.3]);

    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("table.xml"), COLOURED).unwrap();
    let text = "file = \"table.xml\"\nground = {}\nappearance = { colours = { mug = [0.0, 0.0, 1.0] } }";
    world = toml::from_str(text).unwrap();
    world.locate(folder.path()).unwrap();
    assert_eq!(world.appearance.colours["mug"], [0.0, 0.0, 1.0]);
    assert!(!world.appearance.colours.contains_key("ground"), "the ground is not the file's");
    assert_eq!(world.appearance.colours["table"], [0.6, 0.4, 0.2]);
}

#[test]
fn fixed_urdf_becomes_its_collision_shapes() {
    let urdf = r#"<robot name="shelf">
  <link name="frame"><visual><geometry><box size="1 1 1"/></geometry><material name="m"><color rgba="0.2 0.3 0.4 1"/></material></visual>
    <collision><origin xyz="0 0 1"/><geometry><box size="1 0.3 2"/></geometry></collision></link>
  <link name="board"><collision><geometry><cylinder radius="0.2" length="0.02"/></geometry></collision></link>
  <joint name="screwed" type="fixed"><parent link="frame"/><child link="board"/><origin xyz="0 0.3 0.5"/></joint>
</robot>"#;
    let world = of_file("shelf.urdf", urdf).unwrap();
    let found: Vec<_> = world.objects.iter().map(|object| (object.name.as_str(), object.position)).collect();
    assert_eq!(found, [("frame", [0.0, 0.0, 1.0]), ("board", [0.0, 0.3, 0.5])]);
    let colours: Vec<_> = world.appearance.colours.into_iter().collect();
    assert_eq!(colours, [("frame".to_string(), [0.2, 0.3, 0.4])]);
    let refused = of_file(
        "door.urdf",
        &urdf.replace("\"fixed\"", "\"revolute\"").replace(
            "</joint>",
            "<axis xyz=\"0 0 1\"/><limit lower=\"0\" upper=\"1\" effort=\"1\" velocity=\"1\"/></joint>",
        ),
    );
    let refused = refused.unwrap_err().to_string();
    assert!(refused.contains("door.urdf:5:3: joint \"screwed\" moves"), "{refused}");
}

const SDF: &str = r#"<sdf version="1.9"><world name="w">
<gravity>0 0 -9.8</gravity>
<model name="ground"><static>true</static><link name="l"><collision name="c"><geometry><plane><normal>0 0 1</normal><size>9 9</size></plane></geometry>
  <surface><friction><ode><mu>0.7</mu><mu2>0.7</mu2></ode></friction></surface></collision></link></model>
<model name="crate"><pose>1 0 0.25 0 0 0.5</pose><link name="l"><inertial><mass>3</mass><inertia><ixx>0.125</ixx><iyy>0.125</iyy><izz>0.125</izz></inertia></inertial>
  <collision name="c"><geometry><box><size>0.5 0.5 0.5</size></box></geometry></collision>
  <visual name="v"/></link></model>
</world></sdf>"#;

#[test]
fn a_world_of_sdf_is_read_and_robots_in_it_are_refused() {
    let world = of_file("w.sdf", SDF).unwrap();
    assert_eq!((world.gravity[2], world.ground.unwrap().friction), (-9.8, 0.7));
    let [crate_] = &world.objects[..] else { panic!("{:?}", world.objects) };
    assert_eq!((crate_.mass, crate_.friction, crate_.position), (Some(3.0), 1.0, [1.0, 0.0, 0.25]));
    assert!((crate_.rpy[2] - 0.5).abs() < 1e-12);
    let brown = SDF.replace(
        "<visual name=\"v\"/>",
        "<visual name=\"v\"><material><diffuse>0.5 0.3 0.1 1</diffuse></material></visual>",
    );
    let colours: Vec<_> = of_file("w.sdf", &brown).unwrap().appearance.colours.into_iter().collect();
    assert_eq!((colours, world.appearance.colours.len()), (vec![("crate".to_string(), [0.5, 0.3, 0.1])], 0));
    for (old, new, expected) in [
        ("<gravity>0 0 -9.8<", "<gravity>0 0<", "w.sdf:2:1: <gravity> is \"0 0\", expected 3 numbers"),
        ("<visual name=\"v\"/></link>", "</link><joint name=\"j\"/>", "model \"crate\" has a joint"),
        ("<gravity>", "<include/><gravity>", "<include> in <world> is not supported; copy the model"),
        (
            "<box><size>0.5 0.5 0.5</size></box>",
            "<heightmap/>",
            "<heightmap> in <geometry> is not supported; write the world in TOML",
        ),
        ("<inertial>", "<gravity>false</gravity><inertial>", "w.sdf:5:65: <gravity> is \"false\""),
        ("<inertial>", "<kinematic>1</kinematic><inertial>", "w.sdf:5:65: <kinematic> is \"1\""),
        (
            "<box><size>0.5 0.5 0.5</size></box>",
            "<mesh><uri>a.obj</uri><submesh><name>b</name></submesh></mesh>",
            "<submesh> in <mesh> is not supported",
        ),
    ] {
        let refused = of_file("w.sdf", &SDF.replacen(old, new, 1)).unwrap_err().to_string();
        assert!(refused.contains(expected), "{refused}");
    }
    let refused = of_file("w.xml", "<tree/>");
    assert!(matches!(refused, Err(WorldError::File(WorldFileError::Format { .. }))), "{refused:?}");
}

#[test]
fn models_of_sdf_with_one_name_are_refused() {
    let model = |name: &str| format!("<model name=\"{name}\"><link name=\"l\">{BALL}</link></model>");
    let world = |models: &str| {
        of_file("w.sdf", &format!("<sdf version=\"1.9\"><world name=\"w\">\n{models}</world></sdf>"))
    };
    let names = |world: World| world.objects.into_iter().map(|object| object.name).collect::<Vec<_>>();
    assert_eq!(names(world(&[model("a"), model("b")].concat()).unwrap()), ["a", "b"]);
    let error = world(&[model("a"), "\n".into(), model("a")].concat()).unwrap_err().to_string();
    assert!(error.ends_with("w.sdf:3:1: a second <model> is named \"a\"; give it another name"), "{error}");
}

const BALL: &str =
    "<collision name=\"c\"><geometry><sphere><radius>0.1</radius></sphere></geometry></collision>";

#[test]
fn sdf_motion_settings_are_applied_or_reported() {
    let warned = |old: &str, new: &str| {
        let folder = tempfile::tempdir().unwrap();
        let text = SDF.replacen(old, new, 1);
        std::fs::write(folder.path().join("w.sdf"), text).unwrap();
        let mut world: World = toml::from_str("file = \"w.sdf\"").unwrap();
        let warnings = world.locate(folder.path()).unwrap();
        (world, warnings.iter().map(ToString::to_string).collect::<Vec<_>>())
    };
    let usual = "<gravity>true</gravity><kinematic>false</kinematic><inertial><pose>0 0 0 0 0 0</pose>";
    assert_eq!(warned("<inertial>", usual).1, Vec::<String>::new());
    let (world, named) = warned("<mass>", "<pose>0 0 0.1 0 0 0</pose><mass>");
    assert_eq!(world.objects[0].mass, Some(3.0));
    assert!(
        named.len() == 1 && named[0].contains("<pose> of <inertial>") && named[0].contains("line 5"),
        "{named:?}"
    );
    for (old, new, name) in [
        ("<ixx>0.125<", "<ixx>0.126<", "<inertia> of <inertial>"),
        ("<iyy>0.125</iyy>", "<ixz>0.01</ixz>", "<inertia> of <inertial>"),
        (
            "<inertia><ixx>0.125</ixx><iyy>0.125</iyy><izz>0.125</izz></inertia>",
            "",
            "the default <inertia> of 1 kg m2",
        ),
        (
            "<collision name=\"c\"><geometry><box>",
            "<collision name=\"c\"><pose>0 0 1 0 0 0</pose><geometry><box>",
            "<pose> of <inertial>",
        ),
        ("<visual", "<enable_wind>true</enable_wind><visual", "<enable_wind> of <link>"),
        ("<static>", "<plugin filename=\"libTrackController.so\"/><static>", "<plugin> of <model>"),
        ("<gravity>0 0", "<plugin filename=\"gz-sim-buoyancy-system\"/><gravity>0 0", "<plugin> of <world>"),
        ("<mu>0.7</mu>", "<mu>0.7</mu><v:mu xmlns:v=\"v\">9</v:mu>", "<mu> of another program"),
    ] {
        let (world, named) = warned(old, new);
        assert!(named.len() == 1 && named[0].contains(name), "{new}: {named:?}");
        assert_eq!((world.ground.unwrap().friction, world.objects[0].mass), (0.7, Some(3.0)), "{new}");
    }
    let system = "<plugin filename=\"gz-sim-physics-system\" name=\"p\"/><gravity>0 0";
    assert_eq!(warned("<gravity>0 0", system).1, Vec::<String>::new());
    for yes in ["true", "1"] {
        let turned = format!("<pose degrees=\"{yes}\">1 0 0.25 0 0 90<");
        let (world, _) = warned("<pose>1 0 0.25 0 0 0.5<", &turned);
        let yaw = world.objects[0].rpy[2];
        assert!((yaw - core::f64::consts::FRAC_PI_2).abs() < 1e-12, "{yaw}");
    }
}

/// The only part of a compound and its position in the object.
fn only_part(object: &Object) -> (&ObjectShape, [f64; 3]) {
    let ObjectShape::Compound(parts) = &object.shape else { panic!("{object:?}") };
    let [part] = &parts[..] else { panic!("{parts:?}") };
    (&part.shape, part.position)
}

#[test]
fn objects_have_the_pose_of_their_body_of_mjcf() {
    let moved = MJCF.replace("<geom type=\"cylinder\"", "<geom type=\"cylinder\" pos=\"0.1 0 0\"");
    let world = parse_mjcf_world(&moved, None).unwrap().world;
    let can = &world.objects[2];
    assert_eq!((can.position, can.rpy), ([0.0, 0.0, 1.0], [0.0; 3]));
    let (shape, position) = only_part(can);
    assert_eq!((shape, position), (&ObjectShape::Cylinder { radius: 0.03, length: 0.12 }, [0.1, 0.0, 0.0]));
    let usual = &parse_mjcf_world(MJCF, None).unwrap().world.objects[2];
    assert!((can.mass.unwrap() - usual.mass.unwrap()).abs() < 1e-15);
    world.check(std::iter::empty()).unwrap();
}

#[test]
fn objects_have_the_pose_of_their_model_of_sdf() {
    let moved = SDF
        .replace("<link name=\"l\"><inertial>", "<link name=\"l\"><pose>0 0 0.2 0 0 0</pose><inertial>")
        .replace(
            "<collision name=\"c\"><geometry><box>",
            "<collision name=\"c\"><pose>0 0.1 0 0 0 0</pose><geometry><box>",
        );
    let world = of_file("w.sdf", &moved).unwrap();
    let [crate_] = &world.objects[..] else { panic!("{:?}", world.objects) };
    assert_eq!((crate_.mass, crate_.position), (Some(3.0), [1.0, 0.0, 0.25]));
    let (shape, position) = only_part(crate_);
    assert_eq!((shape, position), (&ObjectShape::Box { size: [0.5; 3] }, [0.0, 0.1, 0.2]));
}

#[test]
fn a_mesh_with_a_hole_is_open_and_has_its_hull_volume() {
    let corner = |x, y, z| Vector3::new(x, y, z);
    let points =
        vec![corner(0.0, 0.0, 0.0), corner(1.0, 0.0, 0.0), corner(0.0, 1.0, 0.0), corner(0.0, 0.0, 1.0)];
    let whole = TriangleMesh { points, triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]] };
    let open = TriangleMesh { triangles: whole.triangles[1..].to_vec(), ..whole.clone() };
    assert!(whole.is_closed() && !open.is_closed());
    let inside_out = TriangleMesh {
        triangles: whole.triangles.iter().map(|[a, b, c]| [*a, *c, *b]).collect(),
        ..whole.clone()
    };
    assert!(!inside_out.is_closed(), "its triangles face inward");
    for mesh in [open, inside_out] {
        let shape = ObjectShape::Mesh(MeshShape::of_mesh("pyramid", mesh, Default::default()));
        assert!((shape.volume().unwrap() - 1.0 / 6.0).abs() < 1e-12);
    }
}
