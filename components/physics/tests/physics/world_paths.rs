//! Worlds of graphs: files in several folders, and the locations of errors.

use std::path::Path;

use motorium::graph::{Machine, check, load};

use crate::component::registry;
use crate::meshes::box_between;

const BASE: &str = r#"
name = "paths"
clock = "lockstep"
duration = "10 ms"

[robot.one]
urdf = "rrbot"

[component.physics]
kind = "physics.articulated"
robot = "one"
rate = "1 kHz"
publish = { joint_state = "one/joint_state" }
subscribe = { joint_command = "one/joint_command" }

[component.driver]
kind = "test.driver"
trigger = "one/joint_state"
config = { offset = 0.1, until = 0, stiffness = 1.0 }
subscribe = { state = "one/joint_state" }
publish = { command = "one/joint_command" }
"#;

const SDF: &str = r#"<sdf version="1.9"><model name="slab"><static>true</static><link name="l">
<collision name="c"><geometry><box><size>1 1 0.1</size></box></geometry></collision></link></model></sdf>"#;

#[test]
fn world_files_are_relative_to_the_file_naming_them() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("world_paths");
    for name in ["base", "own"] {
        std::fs::create_dir_all(folder.join(name)).unwrap();
    }
    std::fs::write(folder.join("base/base.toml"), BASE).unwrap();
    let cube = box_between([0.0; 3], [0.1; 3]).to_obj();
    std::fs::write(folder.join("own/rock.obj"), &cube).unwrap();
    std::fs::write(folder.join("own/drawn.obj"), &cube).unwrap();
    std::fs::write(folder.join("own/slab.sdf"), SDF).unwrap();
    let own = r#"
extends = "../base/base.toml"

[world]
file = "slab.sdf"
objects = [{ name = "rock", position = [1.0, 0.0, 3.0], shape = { mesh = { file = "rock.obj", visual = "drawn.obj" } } }]
"#;
    let path = folder.join("own/graph.toml");
    std::fs::write(&path, own).unwrap();
    let check = || load(&path, &[], &registry());
    let plan = check().unwrap_or_else(|error| panic!("{}", error.render(false))).plan;
    let world = &plan.components[0].config["world"];
    let mesh = &world["objects"][0]["shape"]["mesh"];
    for (found, name) in
        [(&world["file"], "slab.sdf"), (&mesh["file"], "rock.obj"), (&mesh["visual"], "drawn.obj")]
    {
        let found = Path::new(found.as_str().unwrap());
        assert_eq!(found.canonicalize().unwrap(), folder.join("own").join(name).canonicalize().unwrap());
    }
    std::fs::remove_file(folder.join("own/rock.obj")).unwrap();
    let refused = check().unwrap_err().render(false);
    assert!(refused.contains("rock.obj") && refused.contains("own"), "{refused}");
}

/// Checks a graph with this world and returns the messages.
fn said(world: &str) -> String {
    let text = format!("{BASE}\n{world}");
    let checked = check(Path::new("world.toml"), text, &[], &registry(), &Machine::detect());
    checked.map_or_else(|error| error.render(false), |_| String::new())
}

#[test]
fn world_errors_point_at_their_position() {
    let good = r#"[world]
objects = [
    { name = "one", shape = { sphere = { radius = 0.1 } }, position = [2.0, 0.0, 1.0], mass = 1.0 },
    { name = "two", shape = { box = { size = [0.1, 0.1, 0.1] } }, position = [3.0, 0.0, 1.0], mass = 1.0 },
]

[world.terrain]
size   = [2.0, 2.0]
layers = [{ equation = { height = "sin(x)" } }]
"#;
    assert_eq!(said(good), "");
    let lines: Vec<String> = format!("{BASE}\n{good}").lines().map(str::to_owned).collect();
    let line_of = |text: &str| 1 + lines.iter().position(|line| line.contains(text)).unwrap();
    for (from, to, place, expected) in [
        ("radius = 0.1", "radius = 0.0", "name = \"one\"", "one: `radius` is 0, expected a positive number"),
        (
            "0.1] } }, position = [3.0, 0.0, 1.0], mass = 1.0",
            "0.1] } }, position = [3.0, 0.0, 1.0], mass = -1.0",
            "name = \"two\"",
            "two: `mass` is -1",
        ),
        ("sin(x)", "sin(x", "[world.terrain]", "`layers[0].equation.height`"),
        (
            "size   = [2.0, 2.0]",
            "size   = [2.0e4, 2.0]",
            "[world.terrain]",
            "raise `spacing` or lower `size`",
        ),
    ] {
        let said = said(&good.replacen(from, to, 1));
        let place = format!("world.toml:{}:", line_of(place));
        assert!(said.contains(expected) && said.contains(&place), "{to}, {place}:\n{said}");
    }
}

#[test]
fn overlapping_start_poses_cause_one_warning() {
    use motorium_physics::{ArticulatedSimulator, BuildWarning, Options, Simulator, World};
    let world = r#"
ground  = {}
objects = [
    { name = "a", shape = { box = { size = [0.1, 0.1, 0.1] } }, mass = 1.0, position = [3.0, 0.0, 0.05], copies = { count = [3, 1, 1], spacing = [0.08, 0.0, 0.0] } },
    { name = "b", shape = { sphere = { radius = 0.1 } }, mass = 1.0, position = [5.0, 0.0, 0.0999] },
]"#;
    let world: World = toml::from_str(world).unwrap();
    let model = motorium_robots::load("pendulum", Path::new(".")).unwrap().model;
    let model = model.placed(&nalgebra::Isometry3::translation(0.0, 0.0, 5.0));
    let simulation = ArticulatedSimulator::new(model, world, &[0.0], Options::default()).unwrap();
    let overlap = |first: &str, second: &str| BuildWarning::ObjectsOverlap {
        first: first.into(),
        second: second.into(),
        depth: 0.02,
    };
    let summary = BuildWarning::summarise(simulation.warnings());
    let expected = BuildWarning::summarise(&[overlap("a_0", "a_1"), overlap("a_1", "a_2")]);
    assert_eq!(summary, expected);
    assert!(
        summary[0].starts_with("2 pairs of objects overlap, the first: \"a_0\" and \"a_1\" start 20.0 mm")
    );
}
