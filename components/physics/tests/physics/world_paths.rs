//! Files of worlds in graphs whose files lie in several folders.

use std::path::Path;

use motorium::graph::load;

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
fn files_of_a_world_begin_at_the_folder_of_the_file_that_names_them() {
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
