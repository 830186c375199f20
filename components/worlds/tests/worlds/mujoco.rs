//! A world with a height field, a body with several geoms, and connected bodies. `world.py` writes MuJoCo's
//! result.

use approx::assert_relative_eq;
use motorium_worlds::{ConnectionKind, Ray, RayScene, World, parse_mjcf_world};
use nalgebra::{Matrix3, Point3, Vector3};
use serde_json::Value;

const TEXT: &str = include_str!("mujoco/world.xml");

fn numbers(value: &Value) -> Vec<f64> {
    serde_json::from_value(value.clone()).unwrap()
}

fn golden() -> Value {
    serde_json::from_str(include_str!("mujoco/world.json")).unwrap()
}

fn world() -> World {
    let world = parse_mjcf_world(TEXT, None).unwrap().world;
    world.check(std::iter::empty()).unwrap();
    world
}

#[test]
fn rays_hit_a_height_field_as_in_mujoco() {
    let (world, golden) = (world(), golden());
    let mut scene = RayScene::default();
    let objects = world.objects.into_iter().filter(|object| object.name == "field").collect();
    scene.add_world(&World { objects, ..World::default() });
    let heights = numbers(&golden["heights"]);
    let mut range = (f64::INFINITY, f64::NEG_INFINITY);
    for (place, height) in golden["places"].as_array().unwrap().iter().zip(heights) {
        let [x, y] = [0, 1].map(|axis| place[axis].as_f64().unwrap());
        let ray = Ray { origin: Point3::new(x, y, 5.0), direction: -Vector3::z_axis() };
        let found = 5.0 - scene.cast(&ray, 10.0).unwrap().distance;
        assert!((found - height).abs() < 1e-6, "{found} m at {x}, {y}, {height} m in MuJoCo");
        range = (range.0.min(height), range.1.max(height));
    }
    assert!(range.1 - range.0 > 0.3, "the heights differ: {range:?}");
}

#[test]
fn inertia_of_several_geoms_matches_mujoco() {
    let (world, golden) = (world(), golden());
    let hammer = world.objects.iter().find(|object| object.name == "hammer").unwrap();
    let own = hammer.mass_properties().unwrap();
    // MuJoCo keeps the corners of meshes in single precision.
    assert_relative_eq!(own.mass, golden["mass"].as_f64().unwrap(), max_relative = 1e-7);
    let frame = own.frame.unwrap();
    let centre = Vector3::from_column_slice(&numbers(&golden["centre"]));
    assert_relative_eq!(frame.translation.vector, centre, epsilon = 1e-8);
    let turn = frame.rotation.to_rotation_matrix().into_inner();
    let about_centre = turn * Matrix3::from_diagonal(&own.moments) * turn.transpose();
    let shift = Matrix3::from_diagonal_element(centre.norm_squared()) - centre * centre.transpose();
    let expected = Matrix3::from_row_slice(&numbers(&golden["inertia"]));
    assert_relative_eq!(about_centre + shift * own.mass, expected, epsilon = 1e-8);
}

#[test]
fn equality_constraints_become_connections() {
    let world = world();
    let [ball, spike] = &world.connections[..] else { panic!("{:?}", world.connections) };
    assert_eq!((ball.kind, &ball.parts), (ConnectionKind::Ball, &["ball".to_owned(), "world".to_owned()]));
    let point = Vector3::from(ball.point);
    assert_relative_eq!(point, Vector3::new(-0.3, 0.0, 0.2), epsilon = 1e-12);
    let parts = ["hammer".to_owned(), "ball".to_owned()];
    assert_eq!((spike.kind, &spike.parts), (ConnectionKind::Fixed, &parts));
}

#[test]
fn invalid_fields_and_bodies_are_rejected_with_position() {
    for (old, new, expected) in [
        ("elevation=\"0 1", "elevation=\"0", "4:5: elevation=\"0 2 1 0"),
        (
            "nrow=\"4\"",
            "nrow=\"4.5\"",
            "4:5: nrow=\"4.5\" of <hfield name=\"hills\">: expected a whole number",
        ),
        ("hfield=\"hills\"", "hfield=\"hill\"", "9:5: <geom name=\"field\"> names the hfield \"hill\""),
        ("<geom size=\"0.05\" pos", "<geom type=\"hfield\" hfield=\"hills\" pos", "18:"),
        ("mass=\"0\"/>", "mass=\"1\"/>", "16:7: a non-colliding geom has a mass"),
        ("mass=\"0.15\"", "mass=\"0.15\" friction=\"0.2\"", "its friction differs"),
        (
            "body2=\"post\"",
            "body2=\"pots\"",
            "names the body \"pots\", which does not exist (did you mean \"post\"?)",
        ),
        ("anchor=\"-0.3 0 0.2\"", "", "21:5: <connect> has no attribute \"anchor\""),
        (
            "body1=\"spike\" body2=\"ball\"",
            "body1=\"spike\" body2=\"hammer\"",
            "do not move relative to each other",
        ),
        ("body2=\"ball\"/>", "body2=\"ball\" relpose=\"0 0 1 1 0 0 0\"/>", "bodies are fixed in their poses"),
        ("<weld body1=\"spike\" body2=\"ball\"/>", "<joint joint1=\"a\"/>", "it couples joints"),
        ("<compiler", "<compiler settotalmass=\"3\"", "it changes masses"),
    ] {
        assert!(TEXT.contains(old), "{old}");
        let error = parse_mjcf_world(&TEXT.replacen(old, new, 1), None).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn oversized_height_field_is_rejected_before_allocation() {
    let attributes = r#"name="hills" nrow="250000" ncol="250000" size="1 1 1 0.1""#;
    for rest in ["", r#" elevation="0 1""#] {
        let text = format!(
            "<mujoco><asset><hfield {attributes}{rest}/></asset>\
             <worldbody><geom type=\"hfield\" hfield=\"hills\"/></worldbody></mujoco>"
        );
        let refused = parse_mjcf_world(&text, None).unwrap_err().to_string();
        assert!(
            refused.contains("1:16: ")
                && refused.contains("250000 x 250000 heights, expected at most 250000"),
            "{refused}"
        );
    }
}

#[test]
fn unsupported_mesh_inertia_is_rejected_if_mass_is_needed() {
    let density = "<geom type=\"mesh\" mesh=\"wedge\" density=\"2000\"";
    let vertex = "<mesh name=\"wedge\" vertex";
    assert!(TEXT.contains(density) && TEXT.contains(vertex));
    let of = |old: &str, new: &str| {
        parse_mjcf_world(&TEXT.replacen(old, new, 1), None).map_err(|error| error.to_string())
    };
    let shell = of(density, &format!("{density} shellinertia=\"true\"")).unwrap_err();
    assert!(shell.contains(": shellinertia=\"true\" of <geom"), "{shell}");
    for inertia in ["shell", "convex"] {
        let refused = of(vertex, &format!("<mesh name=\"wedge\" inertia=\"{inertia}\" vertex")).unwrap_err();
        assert!(
            refused.contains(&format!("6:5: inertia=\"{inertia}\" of <mesh name=\"wedge\">")),
            "{refused}"
        );
    }
    let same = of(vertex, "<mesh name=\"wedge\" inertia=\"exact\" vertex").unwrap().world;
    assert_eq!(same, world());
    // A mesh without mass needs no inertia.
    let weightless = TEXT.replacen(density, "<geom type=\"mesh\" mesh=\"wedge\" mass=\"0\"", 1);
    let weightless = weightless.replacen(vertex, "<mesh name=\"wedge\" inertia=\"shell\" vertex", 1);
    assert!(parse_mjcf_world(&weightless, None).is_ok());
}

#[test]
fn image_and_file_heights_keep_their_row_order() {
    let folder = tempfile::tempdir().unwrap();
    // Two rows of three heights, starting with the row of smallest y.
    let mut bytes = [2_i32, 3].map(i32::to_le_bytes).concat();
    bytes.extend([0.0_f32, 1.0, 2.0, 4.0, 3.0, 2.0].into_iter().flat_map(f32::to_le_bytes));
    std::fs::write(folder.path().join("ramp.bin"), bytes).unwrap();
    let text = |file: &str| {
        format!(
            "<mujoco><asset><hfield name=\"h\" file=\"{file}\" size=\"1 1 2 0.1\"/></asset>\
             <worldbody><geom type=\"hfield\" hfield=\"h\"/></worldbody></mujoco>"
        )
    };
    let main = folder.path().join("main.xml");
    let world = parse_mjcf_world(&text("ramp.bin"), Some(&main)).unwrap().world;
    let mut scene = RayScene::default();
    scene.add_world(&world);
    let height = |x: f64, y: f64| {
        let ray = Ray { origin: Point3::new(x, y, 5.0), direction: -Vector3::z_axis() };
        5.0 - scene.cast(&ray, 10.0).unwrap().distance
    };
    for (x, y, expected) in [(-0.999, -0.999, 0.0), (0.999, -0.999, 1.0), (-0.999, 0.999, 2.0)] {
        assert!((height(x, y) - expected).abs() < 5e-3, "{} m at {x}, {y}", height(x, y));
    }
    let short = folder.path().join("short.bin");
    std::fs::write(short, [0; 6]).unwrap();
    let refused = parse_mjcf_world(&text("short.bin"), Some(&main)).unwrap_err().to_string();
    assert!(refused.contains("main.xml:1:16: file=\"short.bin\" of <hfield>"), "{refused}");
}

#[test]
fn too_deeply_nested_bodies_are_rejected() {
    let nested = |depth: usize| {
        let (open, close) = ("<body>".repeat(depth), "</body>".repeat(depth));
        format!("<mujoco><worldbody>{open}<geom size=\"1\"/>{close}</worldbody></mujoco>")
    };
    for depth in [200, 5000] {
        let refused = parse_mjcf_world(&nested(depth), None).unwrap_err().to_string();
        assert!(refused.contains("nested bodies and frames are not supported"), "{depth}: {refused}");
    }
    assert!(parse_mjcf_world(&nested(100), None).is_ok());
}
