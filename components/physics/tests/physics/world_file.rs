//! Worlds described by files.

use motorium_physics::{Object, ObjectShape, World};

const TEXT: &str = r#"
ground = { friction = 0.5 }

[[objects]]
name = "table"
shape = { box = { size = [0.8, 1.2, 0.04] } }
position = [0.6, 0.0, 0.38]

[[objects]]
name = "can"
shape = { cylinder = { radius = 0.033, length = 0.12 } }
mass = 0.35
position = [0.5, 0.1, 0.46]
rpy = [0.0, 0.0, 1.57]
"#;

#[test]
fn a_world_is_read_with_its_defaults() {
    let world: World = toml::from_str(TEXT).unwrap();
    assert_eq!(world.gravity, [0.0, 0.0, -9.81]);
    let ground = world.ground.unwrap();
    assert_eq!((ground.height, ground.friction, ground.restitution), (0.0, 0.5, 0.0));
    assert!(!world.objects[0].is_dynamic() && world.objects[1].is_dynamic());
    assert_eq!(world.objects[1].shape, ObjectShape::Cylinder { radius: 0.033, length: 0.12 });
    assert!((world.objects[1].pose().rotation.angle() - 1.57).abs() < 1e-12);
    assert!(world.check(std::iter::empty()).is_ok());
    assert_eq!(toml::from_str::<World>("").unwrap(), World::default());
}

#[test]
fn misspelt_key_error_lists_the_known_keys() {
    let error = toml::from_str::<World>(&TEXT.replace("mass", "weight")).unwrap_err().to_string();
    assert!(error.contains("weight") && error.contains("`mass`"), "{error}");
    let error = toml::from_str::<World>(&TEXT.replace("cylinder", "tube")).unwrap_err().to_string();
    assert!(error.contains("tube") && error.contains("`cylinder`"), "{error}");
}

#[test]
fn values_out_of_range_name_the_object_the_field_and_the_range() {
    let broken = |edit: fn(&mut Object)| {
        let mut world: World = toml::from_str(TEXT).unwrap();
        edit(&mut world.objects[1]);
        world.check(std::iter::empty()).unwrap_err().to_string()
    };
    let error = broken(|can| can.restitution = 1.5);
    assert_eq!(error, "can: `restitution` is 1.5, expected a number from 0 to 1");
    let error = broken(|can| can.shape = ObjectShape::Cylinder { radius: -0.1, length: 1.0 });
    assert_eq!(error, "can: `radius` is -0.1, expected a positive number");
    let error = broken(|can| can.position[1] = f64::NAN);
    assert_eq!(error, "can: `position` is NaN, expected a finite number");
}

#[test]
fn the_schema_documents_every_key_with_its_unit() {
    let schema = serde_json::to_string(&schemars::schema_for!(World)).unwrap();
    for expected in
        ["Mass (kg)", "Radius (m)", "roll, pitch, yaw", "Gravitational acceleration (m/s2)", "\"maximum\":1"]
    {
        assert!(schema.contains(expected), "no {expected} in {schema}");
    }
}
