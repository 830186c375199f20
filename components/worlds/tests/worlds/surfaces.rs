//! Surfaces, masses and frames of worlds in SDF and MJCF are read, or reported.

use motorium_worlds::{FrictionCombine, MeshCollision, ObjectShape, World, parse_mjcf_world};

/// Returns the world of a moving ball with these parts, and its warnings, or the error. Without a separate
/// link, the ball has the inertia of its shape.
fn ball(outside: &str, model: &str, link: &str, collision: &str) -> Result<(World, Vec<String>), String> {
    let link = if link.is_empty() { "<inertial auto=\"true\"/>" } else { link };
    read(&format!(
        "<sdf version=\"1.9\"><world name=\"w\">{outside}\n<model name=\"ball\" {model}\n<link name=\"l\">{link}\n\
         <collision name=\"c\"><geometry><sphere><radius>0.1</radius></sphere></geometry>\n{collision}</collision></link>\
         </model></world></sdf>"
    ))
}

/// Returns the world of an SDF text, and its warnings, or the error.
pub(crate) fn read(text: &str) -> Result<(World, Vec<String>), String> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("w.sdf"), text).unwrap();
    let mut world: World = toml::from_str("file = \"w.sdf\"").unwrap();
    let warnings = world.locate(folder.path()).map_err(|error| error.to_string())?;
    Ok((world, warnings.iter().map(ToString::to_string).collect()))
}

#[test]
fn gravity_of_sdf_1_4_is_inside_physics() {
    let world = |version: &str, inside: &str| {
        let read = read(&format!("<sdf version=\"{version}\"><world name=\"w\">{inside}</world></sdf>"));
        read.map(|(world, _)| world.gravity)
    };
    let physics = "<physics type=\"ode\"><gravity>0 0 -1.62</gravity></physics>";
    for version in ["1.4", "1.5"] {
        assert_eq!(world(version, physics), Ok([0.0, 0.0, -1.62]));
        assert_eq!(world(version, &format!("{physics}<gravity>0 0 -3</gravity>")), Ok([0.0, 0.0, -3.0]));
        assert_eq!(world(version, &format!("<gravity>0 0 -3</gravity>{physics}")), Ok([0.0, 0.0, -3.0]));
        assert_eq!(world(version, ""), Ok([0.0, 0.0, -9.8]));
    }
    let error = world("1.6", physics).unwrap_err();
    assert!(error.contains("w.sdf:1:56: <gravity> in <physics> is not supported from SDF 1.6 on"), "{error}");
    assert_eq!(world("1.11", "<physics/>"), Ok([0.0, 0.0, -9.8]));
}

#[test]
fn sdf_densities_give_masses() {
    let volume = 4.0 / 3.0 * core::f64::consts::PI * 1e-3;
    let mass =
        |link: &str, collision: &str| ball("", ">", link, collision).unwrap().0.objects[0].mass.unwrap();
    let density = "<density>2500</density>";
    let in_link = "<inertial auto=\"true\"><density>500</density></inertial>";
    for (found, density) in [
        (mass("<inertial auto=\"true\"/>", density), 2500.0),
        (mass(in_link, ""), 500.0),
        (mass(in_link, density), 2500.0),
        (mass("<inertial auto=\"true\"/>", ""), 1000.0),
    ] {
        assert!((found - density * volume).abs() < 1e-9, "{found}");
    }
    assert_eq!(mass("<inertial auto=\"false\"><mass>2</mass></inertial>", density), 2.0);
}

#[test]
fn sdf_surfaces_are_read_or_warned_of() {
    let surface = |inside: &str| ball("", ">", "", &format!("<surface>{inside}</surface>"));
    let bounce =
        "<bounce><restitution_coefficient>0.8</restitution_coefficient><threshold>0</threshold></bounce>";
    let (world, warnings) = surface(bounce).unwrap();
    assert_eq!((world.objects[0].restitution, warnings.len()), (0.8, 0));
    for (inside, name) in [
        ("<friction><ode><mu>0.9</mu><mu2>0.1</mu2></ode></friction>", "<mu2>"),
        ("<friction><ode><fdir1>1 0 0</fdir1></ode></friction>", "<fdir1>"),
        ("<friction><ode><slip1>0.5</slip1></ode></friction>", "<slip1>"),
        ("<friction><bullet><friction>0.05</friction></bullet></friction>", "<friction> of <bullet>"),
        ("<friction><torsional><coefficient>1</coefficient></torsional></friction>", "<torsional>"),
        ("<contact><ode><kp>1000</kp></ode></contact>", "<kp>"),
        ("<contact><ode><soft_cfm>0.1</soft_cfm></ode></contact>", "<soft_cfm>"),
        ("<contact><ode><min_depth>0.001</min_depth></ode></contact>", "<min_depth>"),
        ("<contact><elastic_modulus>1e8</elastic_modulus></contact>", "<elastic_modulus>"),
        ("<friction><ode><mu>0.4</mu></ode></friction>", "the default <mu2> of 1"),
        ("<bounce><threshold>0.1</threshold></bounce>", "<threshold>"),
        ("<bounce><restitution_coefficient>1</restitution_coefficient></bounce>", "the default <threshold>"),
    ] {
        let warnings = surface(inside).unwrap().1;
        assert!(warnings.iter().any(|w| w.contains(name) && w.contains("line 5")), "{name}: {warnings:?}");
    }
    for name in ["collide_without_contact", "collide_bitmask", "category_bitmask"] {
        let error = surface(&format!("<contact><{name}>1</{name}></contact>")).unwrap_err();
        assert!(error.contains(&format!("w.sdf:5:19: <{name}>")), "{error}");
    }
    let defaults = "<contact><collide_bitmask>65535</collide_bitmask><collide_without_contact>false</collide_without_contact>\
                    <ode><kp>1e12</kp><kd>1</kd></ode></contact>\
                    <friction><ode><mu>0.5</mu><mu2>0.5</mu2><slip1>0</slip1><fdir1>0 0 0</fdir1></ode></friction>";
    assert_eq!(surface(defaults).unwrap().1, Vec::<String>::new());
    let error = surface("<glue/>").unwrap_err();
    assert!(error.contains("5:10: <glue> in <surface> is not supported; remove it"), "{error}");
}

#[test]
fn sdf_frames_that_are_not_read_are_refused() {
    for pose in ["<pose/>", "<pose></pose>", "<pose relative_to=\"\"> </pose>"] {
        assert_eq!(ball("", &format!(">{pose}"), "", "").unwrap().0.objects[0].position, [0.0; 3]);
    }
    for (model, expected) in [
        ("placement_frame=\"l\">", "w.sdf:2:1: placement_frame=\"l\" is not supported"),
        ("><pose frame=\"ground\">0 0 1 0 0 0</pose>", "frame=\"ground\" in <pose> is not supported"),
        ("><pose relative_to=\"ground\">0 0 1 0 0 0</pose>", "relative to the element that contains <model>"),
        ("><pose rotation_format=\"axis\">0 0 1 0 0 0 1</pose>", "rotation_format=\"axis\" is not supported"),
        ("><pose rotation_format=\"quat_xyzw\">0 0 1 0 0 0 0</pose>", "the quaternion is zero"),
        (
            "><pose rotation_format=\"quat_xyzw\" degrees=\"1\">0 0 1 0 0 0 1</pose>",
            "does not apply to a quaternion",
        ),
        ("><frame name=\"f\"/>", "<frame> in <model> is not supported; write each <pose>"),
    ] {
        let error = ball("", model, "", "").unwrap_err();
        assert!(error.contains(expected), "{error}");
    }
    let (_, warnings) = ball("", ">", "<velocity_decay><linear>2</linear></velocity_decay>", "").unwrap();
    assert!(warnings.iter().any(|warning| warning.contains("<velocity_decay>")), "{warnings:?}");
    assert!(
        ball("<state world_name=\"w\"/>", ">", "", "")
            .unwrap_err()
            .contains("w.sdf:1:36: <state> of <world>")
    );
}

#[test]
fn mjcf_masks_that_exclude_a_pair_are_rejected() {
    let world = |floor: &str, ghost: &str| {
        let text = format!(
            "<mujoco><worldbody><geom type=\"plane\" size=\"0 0 1\" {floor}/>\n\
             <body pos=\"0 0 1\"><freejoint/><geom name=\"ghost\" size=\"0.1\" {ghost}/></body></worldbody></mujoco>"
        );
        parse_mjcf_world(&text, None)
    };
    let apart = world("contype=\"1\" conaffinity=\"0\"", "contype=\"2\" conaffinity=\"2\"");
    let error = apart.unwrap_err().to_string();
    assert!(error.contains("2:31: contype and conaffinity keep it from touching"), "{error}");
    assert!(world("contype=\"1\" conaffinity=\"0\"", "contype=\"2\" conaffinity=\"1\"").is_ok());
    assert!(world("", "").unwrap().warnings.is_empty());
    for attribute in ["margin=\"0.05\"", "solref=\"-500 -1\"", "solimp=\"0.9 0.95 0.001\"", "priority=\"1\""]
    {
        let warnings = world(attribute, "").unwrap().warnings;
        let name = attribute.split('=').next().unwrap();
        assert!(
            warnings.iter().any(|warning| warning.to_string().contains(name)),
            "{attribute}: {warnings:?}"
        );
    }
    assert!(world("margin=\"0\"", "").unwrap().warnings.is_empty());
}

#[test]
fn comments_inside_sdf_values_are_left_out() {
    let pose = ">\n<!-- x y z r p y --><pose><!-- m, rad -->1 <!-- y -->2 3 0 0 0</pose>";
    assert_eq!(ball("", pose, "", "").unwrap().0.objects[0].position, [1.0, 2.0, 3.0]);
    let fixed = "><static><!-- a wall -->True</static>";
    assert!(!ball("", fixed, "", "").unwrap().0.objects[0].is_dynamic());
    let error = ball("", "><static>yes</static>", "", "").unwrap_err();
    assert!(error.contains("<static> is \"yes\", expected true or false"), "{error}");
    let mass = "<inertial><mass><!-- kg -->2</mass></inertial>";
    assert_eq!(ball("", ">", mass, "").unwrap().0.objects[0].mass, Some(2.0));
}

#[test]
fn world_files_combine_friction_as_in_their_simulator() {
    let sdf = |ground: f64| {
        let plane = format!(
            "<model name=\"ground\"><static>true</static><link name=\"l\"><collision name=\"c\"><geometry><plane/></geometry>\
             <surface><friction><ode><mu>{ground}</mu></ode></friction></surface></collision></link></model>"
        );
        let world = ball(&plane, ">", "", "").unwrap().0;
        let ground = world.ground.unwrap();
        let object = &world.objects[0];
        (
            ground.friction_combine,
            FrictionCombine::combined(
                (ground.friction, ground.friction_combine),
                (object.friction, object.friction_combine),
            ),
        )
    };
    assert_eq!(sdf(0.4), (Some(FrictionCombine::Min), 0.4));
    assert_eq!(sdf(1.0), (None, 1.0));
    let mjcf = |ground: f64| {
        let text = format!(
            "<mujoco><worldbody><geom type=\"plane\" size=\"0 0 1\" friction=\"{ground}\"/>\
             <body><freejoint/><geom size=\"0.1\" friction=\"0.3\"/></body></worldbody></mujoco>"
        );
        let world = parse_mjcf_world(&text, None).unwrap().world;
        let (ground, object) = (world.ground.unwrap(), &world.objects[0]);
        (
            ground.friction_combine,
            FrictionCombine::combined(
                (ground.friction, ground.friction_combine),
                (object.friction, object.friction_combine),
            ),
        )
    };
    assert_eq!(mjcf(0.9), (Some(FrictionCombine::Max), 0.9));
    assert_eq!(mjcf(0.0), (Some(FrictionCombine::Max), 0.3));
    assert_eq!(mjcf(0.3), (None, 0.3));
}

#[test]
fn mjcf_flags_and_free_joints_are_applied_or_reported() {
    let world = |option: &str, joint: &str| {
        let text = format!(
            "<mujoco><option>{option}</option><default><joint damping=\"0\"/></default><worldbody>\n\
             <body><joint type=\"free\" {joint}/><geom size=\"0.1\"/></body></worldbody></mujoco>"
        );
        parse_mjcf_world(&text, None)
    };
    for flag in
        ["constraint=\"disable\"", "contact=\"disable\"", "equality=\"disable\"", "override=\"enable\""]
    {
        let error = world(&format!("<flag {flag}/>"), "").unwrap_err().to_string();
        assert!(error.contains(flag), "{error}");
    }
    assert!(world("<flag constraint=\"enable\" energy=\"enable\"/>", "").unwrap().warnings.is_empty());
    for name in ["damping", "frictionloss", "armature", "stiffness"] {
        let warnings = world("", &format!("{name}=\"0.5\"")).unwrap().warnings;
        let warning = warnings[0].to_string();
        assert!(
            warnings.len() == 1 && warning.contains(&format!("{name} of <joint> ignored (line 2")),
            "{warning}"
        );
    }
}

/// A prism over an L, and a tetrahedron, as OBJ files.
const CONCAVE: &str = "v 0 0 0\nv 3 0 0\nv 3 1 0\nv 1 1 0\nv 1 3 0\nv 0 3 0\nv 0 0 1\nv 3 0 1\nv 3 1 1\nv 1 1 1\nv 1 3 1\n\
                       v 0 3 1\nf 6 5 4 3 2 1\nf 7 8 9 10 11 12\nf 1 2 8 7\nf 2 3 9 8\nf 3 4 10 9\nf 4 5 11 10\n\
                       f 5 6 12 11\nf 6 1 7 12\n";
const CONVEX: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";

#[test]
fn fixed_meshes_of_sdf_and_urdf_touch_by_their_triangles() {
    let folder = tempfile::tempdir().unwrap();
    let read = |file: &str, text: &str| {
        std::fs::write(folder.path().join(file), text).unwrap();
        let mut world: World = toml::from_str(&format!("file = \"{file}\"")).unwrap();
        let warnings = world.locate(folder.path()).unwrap();
        world.check(std::iter::empty()).unwrap();
        let ObjectShape::Mesh(mesh) = &world.objects[0].shape else { panic!("a mesh") };
        (mesh.collision, warnings.iter().map(ToString::to_string).collect::<Vec<_>>())
    };
    for (name, text) in [("concave.obj", CONCAVE), ("convex.obj", CONVEX)] {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    std::fs::write(folder.path().join("twisted.obj"), CONCAVE.replace("f 1 2 8 7", "f 7 8 2 1")).unwrap();
    let sdf = |mesh: &str, fixed: bool| {
        format!(
            "<sdf version=\"1.9\"><model name=\"m\"><static>{fixed}</static><link name=\"l\"><inertial auto=\"1\"/><collision name=\"c\">\
             <geometry><mesh><uri>{mesh}</uri></mesh></geometry></collision></link></model></sdf>"
        )
    };
    assert_eq!(read("w.sdf", &sdf("concave.obj", true)), (MeshCollision::Triangles, vec![]));
    assert_eq!(read("w.sdf", &sdf("convex.obj", true)), (MeshCollision::Hull, vec![]));
    assert_eq!(read("w.sdf", &sdf("convex.obj", false)), (MeshCollision::Hull, vec![]));
    for (mesh, fixed, reason) in
        [("concave.obj", false, "a moving object"), ("twisted.obj", true, "face both sides")]
    {
        let (collision, warnings) = read("w.sdf", &sdf(mesh, fixed));
        assert_eq!(collision, MeshCollision::Hull);
        assert!(warnings.len() == 1 && warnings[0].contains(reason), "{warnings:?}");
    }
    let urdf = "<robot name=\"r\"><link name=\"hall\"><collision><geometry><mesh filename=\"concave.obj\"/></geometry>\
                </collision></link></robot>";
    assert_eq!(read("w.urdf", urdf).0, MeshCollision::Triangles);
}

#[test]
fn planes_are_infinite() {
    let mjcf = |planes: &str| {
        let text = format!(
            "<mujoco><worldbody>{planes}<body pos=\"9 0 1\"><freejoint/><geom size=\"0.1\"/></body></worldbody></mujoco>"
        );
        parse_mjcf_world(&text, None)
    };
    let finite = mjcf("<geom type=\"plane\" size=\"5 5 0.1\" pos=\"1 2 0.3\"/>").unwrap();
    assert!((finite.world.ground.unwrap().height - 0.3).abs() < 1e-12 && finite.world.objects.len() == 1);
    assert!(finite.warnings[0].to_string().contains("size of <geom> ignored"), "{:?}", finite.warnings);
    assert!(mjcf("<geom type=\"plane\" size=\"0 0 1\"/>").unwrap().warnings.is_empty());
    let slope = mjcf("<geom type=\"plane\" size=\"5 5 0.1\" euler=\"20 0 0\"/>").unwrap();
    assert!(slope.world.ground.is_none() && slope.warnings.len() == 1, "{:?}", slope.warnings);
    let two =
        mjcf("<geom type=\"plane\" size=\"1 1 1\"/>\n<geom type=\"plane\" size=\"1 1 1\" pos=\"0 0 1\"/>");
    assert!(two.unwrap_err().to_string().contains("2:1: a second level plane"));
    let sdf = |pose: &str| {
        let plane = format!(
            "<model name=\"hill\"><pose>{pose}</pose><static>true</static><link name=\"l\"><collision name=\"c\"><geometry>\
             <plane><normal>0 0 1</normal><size>2 2</size></plane></geometry></collision></link></model>"
        );
        ball(&plane, ">", "", "").unwrap().0
    };
    assert!(sdf("0 0 0.5 0 0 0").ground.is_some_and(|ground| ground.height == 0.5));
    let ObjectShape::Box { size } = sdf("0 0 0.5 0.3 0 0").objects[0].shape else { panic!("a box") };
    assert!(size[0] >= 100.0 && size[1] >= 100.0);
}

#[test]
fn soft_welds_and_urdf_dialect_surfaces_are_reported() {
    let weld = |attributes: &str| {
        let text = format!(
            "<mujoco><worldbody><body name=\"b\"><freejoint/><geom size=\"0.1\"/></body></worldbody>\n\
             <equality><weld body1=\"b\" {attributes}/></equality></mujoco>"
        );
        let warnings = parse_mjcf_world(&text, None).unwrap().warnings;
        warnings.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    for (attributes, name) in [("solref=\"1 1\"", "solref"), ("torquescale=\"0\"", "torquescale")] {
        let warnings = weld(attributes);
        let expected = format!("{name} of <weld> ignored (line 2");
        assert!(warnings.len() == 1 && warnings[0].contains(&expected), "{warnings:?}");
    }
    assert_eq!(weld("torquescale=\"1\""), Vec::<String>::new());
    let urdf = |collision: &str, link: &str, robot: &str| {
        let folder = tempfile::tempdir().unwrap();
        let text = format!(
            "<robot name=\"r\">\n<link name=\"l\">{link}<collision>{collision}<geometry><sphere radius=\"1\"/></geometry></collision></link>\
             {robot}</robot>"
        );
        std::fs::write(folder.path().join("w.urdf"), text).unwrap();
        let mut world: World = toml::from_str("file = \"w.urdf\"").unwrap();
        let warnings = world.locate(folder.path()).map_err(|error| error.to_string())?;
        Ok::<_, String>(warnings.iter().map(ToString::to_string).collect::<Vec<_>>())
    };
    assert_eq!(urdf("", "", "<gazebo><plugin/></gazebo>"), Ok(vec![]));
    for (collision, link, robot, name) in [
        ("", "<contact><lateral_friction value=\"0.1\"/></contact>", "", "<contact>"),
        ("", "", "<gazebo reference=\"l\"><mu1>0.1</mu1></gazebo>", "<gazebo>"),
        (
            "<drake:proximity_properties xmlns:drake=\"d\"><drake:mu_static value=\"0\"/></drake:proximity_properties>",
            "",
            "",
            "<proximity_properties>",
        ),
    ] {
        let warnings = urdf(collision, link, robot).unwrap();
        let expected = format!("the surface in {name} ignored (line 2");
        assert!(warnings.len() == 1 && warnings[0].contains(&expected), "{warnings:?}");
    }
    let error = urdf("<origin quat_xyzw=\"0 0 1 0\"/>", "", "").unwrap_err();
    assert!(error.contains("quat_xyzw of <origin> is not supported"), "{error}");
}

/// Returns the sliding, torsional and rolling friction of the contact between the first object of an MJCF
/// world and the ground.
fn friction_of_contact(ground: &str, geom: &str, more: &str) -> ([f64; 3], usize) {
    let text = format!(
        "<mujoco><worldbody><geom type=\"plane\" size=\"0 0 1\" {ground}/><body><freejoint/><geom size=\"0.1\" {geom}/>\
         </body>{more}</worldbody></mujoco>"
    );
    let read = parse_mjcf_world(&text, None).unwrap();
    let (ground, object) = (read.world.ground.unwrap(), &read.world.objects[0]);
    let rules = [ground.friction_combine, object.friction_combine];
    let lengths = |one, other| FrictionCombine::combined_lengths((one, rules[0]), (other, rules[1]));
    let sliding = FrictionCombine::combined((ground.friction, rules[0]), (object.friction, rules[1]));
    let torsional = lengths(ground.torsional_friction, object.torsional_friction);
    ([sliding, torsional, lengths(ground.rolling_friction, object.rolling_friction)], read.warnings.len())
}

#[test]
fn mjcf_contacts_have_the_larger_condim_and_friction() {
    // MuJoCo: a contact has the maxima of `condim` and of each coefficient of both geoms.
    let (slippery, rough) = ("friction=\"0.1 0.005 0.0001\"", "friction=\"1 0.005 0.02\"");
    for (ground, geom, expected) in [
        (format!("condim=\"3\" {slippery}"), format!("condim=\"1\" {rough}"), [1.0, 0.0, 0.0]),
        (format!("condim=\"1\" {rough}"), format!("condim=\"3\" {slippery}"), [1.0, 0.0, 0.0]),
        (format!("condim=\"1\" {slippery}"), format!("condim=\"1\" {rough}"), [0.0; 3]),
        (String::new(), format!("condim=\"4\" {rough}"), [1.0, 0.005, 0.0]),
        (String::new(), format!("condim=\"6\" {rough}"), [1.0, 0.005, 0.02]),
        (rough.to_owned(), format!("condim=\"6\" {slippery}"), [1.0, 0.005, 0.02]),
        (format!("condim=\"6\" {slippery}"), format!("condim=\"6\" {rough}"), [1.0, 0.005, 0.02]),
        (slippery.to_owned(), rough.to_owned(), [1.0, 0.0, 0.0]),
    ] {
        assert_eq!(friction_of_contact(&ground, &geom, ""), (expected, 0), "{ground}, {geom}");
    }
    // A third geom without friction would have friction on the first geom.
    let ball = "<body pos=\"1 0 1\"><freejoint/><geom size=\"0.1\" condim=\"1\"/></body>";
    let (friction, warnings) = friction_of_contact(slippery, &format!("condim=\"1\" {rough}"), ball);
    assert_eq!((friction, warnings), ([1.0, 0.0, 0.0], 1));
}
