//! Surfaces, masses and frames of worlds in SDF and MJCF: read, or named.

use motorium_robots::{World, parse_mjcf_world};

/// The world of a moving ball with these parts, and its warnings; or the error.
fn ball(outside: &str, model: &str, link: &str, collision: &str) -> Result<(World, Vec<String>), String> {
    let folder = tempfile::tempdir().unwrap();
    let text = format!(
        "<sdf version=\"1.9\"><world name=\"w\">{outside}\n<model name=\"ball\" {model}\n<link name=\"l\">{link}\n\
         <collision name=\"c\"><geometry><sphere><radius>0.1</radius></sphere></geometry>\n{collision}</collision></link>\
         </model></world></sdf>"
    );
    std::fs::write(folder.path().join("w.sdf"), text).unwrap();
    let mut world: World = toml::from_str("file = \"w.sdf\"").unwrap();
    let warnings = world.locate(folder.path()).map_err(|error| error.to_string())?;
    Ok((world, warnings.iter().map(ToString::to_string).collect()))
}

#[test]
fn gravity_of_sdf_1_4_is_inside_physics() {
    let physics = "<physics type=\"ode\"><gravity>0 0 -1.62</gravity></physics>";
    assert_eq!(ball(physics, ">", "", "").unwrap().0.gravity, [0.0, 0.0, -1.62]);
    let both = format!("{physics}<gravity>0 0 -3</gravity>");
    assert_eq!(ball(&both, ">", "", "").unwrap().0.gravity, [0.0, 0.0, -3.0]);
    let both = format!("<gravity>0 0 -3</gravity>{physics}");
    assert_eq!(ball(&both, ">", "", "").unwrap().0.gravity, [0.0, 0.0, -3.0]);
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
    let bounce = "<bounce><restitution_coefficient>0.8</restitution_coefficient></bounce>";
    let (world, warnings) = surface(bounce).unwrap();
    assert_eq!((world.objects[0].restitution, warnings.len()), (0.8, 0));
    for (inside, name) in [
        ("<friction><ode><mu>0.9</mu><mu2>0.1</mu2></ode></friction>", "<mu2>"),
        ("<friction><ode><fdir1>1 0 0</fdir1></ode></friction>", "<fdir1>"),
        ("<friction><ode><slip1>0.5</slip1></ode></friction>", "<slip1>"),
        ("<friction><bullet><friction>0.05</friction></bullet></friction>", "<friction> of <bullet>"),
        ("<friction><torsional><coefficient>1</coefficient></torsional></friction>", "<torsional>"),
        ("<contact><ode><kp>1000</kp></ode></contact>", "<kp>"),
        ("<bounce><threshold>0.1</threshold></bounce>", "<threshold>"),
    ] {
        let warnings = surface(inside).unwrap().1;
        assert!(warnings.iter().any(|w| w.contains(name) && w.contains("line 5")), "{name}: {warnings:?}");
    }
    for name in ["collide_without_contact", "collide_bitmask", "category_bitmask"] {
        let error = surface(&format!("<contact><{name}>1</{name}></contact>")).unwrap_err();
        assert!(error.contains(&format!("w.sdf:5:19: <{name}>")), "{error}");
    }
    let defaults = "<contact><collide_bitmask>65535</collide_bitmask><collide_without_contact>false</collide_without_contact>\
                    </contact><friction><ode><mu>0.5</mu><mu2>0.5</mu2><slip1>0</slip1></ode></friction>";
    assert_eq!(surface(defaults).unwrap().1, Vec::<String>::new());
    assert!(surface("<glue/>").unwrap_err().contains("<glue> is not among the SDF"));
}

#[test]
fn sdf_frames_that_are_not_read_are_refused() {
    for pose in ["<pose/>", "<pose></pose>", "<pose relative_to=\"\"> </pose>"] {
        assert_eq!(ball("", &format!(">{pose}"), "", "").unwrap().0.objects[0].position, [0.0; 3]);
    }
    for (model, expected) in [
        ("placement_frame=\"l\">", "w.sdf:2:1: placement_frame=\"l\" is not read"),
        ("><pose frame=\"ground\">0 0 1 0 0 0</pose>", "found frame=\"ground\""),
        ("><pose relative_to=\"ground\">0 0 1 0 0 0</pose>", "found relative_to=\"ground\""),
        ("><pose rotation_format=\"quat_xyzw\">0 0 1 0 0 0 1</pose>", "rotation_format=\"quat_xyzw\""),
        ("><frame name=\"f\"/>", "<frame> is not among the SDF"),
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
fn mjcf_masks_that_part_a_pair_are_refused() {
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
