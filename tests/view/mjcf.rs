//! A robot described only by MJCF, and an object with a mesh, on the page in a headless browser.

use std::path::Path;

use motorium_view::browser::Browser;
use serde_json::{Value as Json, json};

use crate::client::Client;
use crate::page::{until, without_browser};
use crate::support::{Run, machine};
use crate::viewer::Viewer;

/// A capsule, a mesh in the file, and a mesh in another file next to it.
const ROBOT: &str = r#"<mujoco model="crane">
  <asset>
    <mesh name="jib" vertex="0 0 0  0.4 0 0  0 0.1 0  0 0 0.1"/>
    <mesh name="hook" file="meshes/hook.obj" scale="0.5 0.5 0.5"/>
  </asset>
  <worldbody>
    <body name="mast" pos="0 0 0.1">
      <geom type="capsule" size="0.05 0.2" pos="0 0 0.2" rgba="0.9 0.4 0.1 1"/>
      <body name="arm" pos="0 0 0.45">
        <joint name="slew" axis="0 0 1" range="-170 170" actuatorfrcrange="-50 50" damping="1"/>
        <inertial pos="0.1 0 0" mass="1" diaginertia="0.01 0.02 0.02"/>
        <geom type="mesh" mesh="jib"/>
        <body name="block" pos="0.4 0 0">
          <joint name="hoist" type="slide" axis="0 0 -1" range="0 0.3" actuatorfrcrange="-50 50" damping="5"/>
          <inertial pos="0 0 0" mass="0.5" diaginertia="0.001 0.001 0.001"/>
          <geom type="mesh" mesh="hook"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>"#;

const CUBE: &str = "v 0 0 0\nv 0.1 0 0\nv 0.1 0.1 0\nv 0 0.1 0\nv 0 0 0.1\nv 0.1 0 0.1\nv 0.1 0.1 0.1\nv 0 0.1 0.1\n\
f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

const GRAPH: &str = r#"
name = "crane"

[robot.crane]
urdf = "crane.xml"

[world]
ground  = {}
objects = [{ name = "crate", shape = { mesh = { file = "meshes/hook.obj", scale = [2.0, 2.0, 2.0] } }, density = 100.0, position = [0.6, 0.0, 0.0] }]

[component.physics]
kind      = "physics.articulated"
robot     = "crane"
rate      = "500 Hz"
subscribe = { joint_command = "crane/joint_command" }
publish   = { joint_state = "crane/joint_state", object_poses = "world/objects" }

[component.policy]
kind      = "policy.trajectory"
robot     = "crane"
trigger   = "crane/joint_state"
subscribe = { joint_state = "crane/joint_state" }
publish   = { joint_command = "crane/joint_command" }
config    = { goals = [{ position = [1.0, 0.2] }], joint_command = { kp = 200.0, kd = 20.0 }, limits = { velocity = [1.0, 0.2], acceleration = [2.0, 1.0] } }
"#;

fn write(folder: &Path) -> std::path::PathBuf {
    std::fs::create_dir_all(folder.join("meshes")).unwrap();
    std::fs::write(folder.join("meshes/hook.obj"), CUBE).unwrap();
    std::fs::write(folder.join("crane.xml"), ROBOT).unwrap();
    let graph = folder.join("crane.toml");
    std::fs::write(&graph, GRAPH).unwrap();
    graph
}

#[test]
fn an_mjcf_robot_is_described_as_urdf_with_meshes() {
    let _machine = machine();
    let folder = tempfile::tempdir().unwrap();
    let run = Run::start(&write(folder.path()), &["--for", "300s", "--clock", "lockstep", "--pace", "1"]);
    let viewer = Viewer::start(&["--run", run.folder.id()], &[]);
    let mut client = Client::connect(viewer.port, "", "foxglove.sdk.v1").unwrap();
    client.await_channels(&["/robot_description"]);
    let text = client.next_json("/robot_description");
    let urdf = text["data"].as_str().unwrap();
    assert!(urdf.contains("<robot name=\"crane\">") && urdf.contains("<joint name=\"hoist\""), "{urdf}");
    assert!(urdf.contains(r#"<color rgba="0.9 0.4 0.1 1"/>"#), "the colour of the mast: {urdf}");
    let names: Vec<&str> =
        urdf.split("filename=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
    assert_eq!(names.len(), 3, "the capsule, the mesh of the file, and the one beside it: {names:?}");
    for name in names {
        let mesh = client.fetch(name).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(mesh.starts_with(b"v "), "{name}");
    }
}

#[test]
fn mjcf_robot_and_mesh_object_are_drawn_in_place() {
    if without_browser() {
        return;
    }
    let _machine = machine();
    let folder = tempfile::tempdir().unwrap();
    let run = Run::start(&write(folder.path()), &["--for", "300s", "--clock", "lockstep", "--pace", "0.2"]);
    let viewer = Viewer::start(&["--run", run.folder.id()], &[]);
    let mut browser = Browser::open(&viewer.address(), (1000, 700)).unwrap();
    // A capsule of rings, a tetrahedron, two cubes, the ground: meshes follow the robot.
    let state = until(&mut browser, "the robot is drawn with its meshes", |state| {
        let robot = &state["robots"][0];
        robot["drawn"] == true && robot["deviation_m"].is_number() && state["triangles"].as_u64() > Some(200)
    });
    let deviation = state["robots"][0]["deviation_m"].as_f64().unwrap();
    assert!(deviation < 1e-5, "links are drawn {deviation} m from where the run has them");
    let joints = state["robots"][0]["joints"].as_object().unwrap();
    assert_eq!(joints.keys().map(String::as_str).collect::<Vec<_>>(), ["hoist", "slew"]);
    assert_eq!(state["errors"], serde_json::json!([]));
}

/// A body of a mesh, with a box to collide with.
const PUSHER: &str = r#"<robot name="pusher">
  <link name="rail"><visual><geometry><box size="1 0.1 0.05"/></geometry></visual></link>
  <joint name="slide" type="prismatic">
    <parent link="rail"/><child link="slider"/><origin xyz="0 0 0.1"/><axis xyz="1 0 0"/>
    <limit lower="-0.4" upper="0.4" velocity="1" effort="50"/>
  </joint>
  <link name="slider">
    <inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>
    <visual><geometry><mesh filename="meshes/hook.obj"/></geometry></visual>
    <collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>
  </link>
</robot>"#;

#[test]
fn a_link_without_its_mesh_is_drawn_as_its_hull() {
    if without_browser() {
        return;
    }
    let _machine = machine();
    let folder = tempfile::tempdir().unwrap();
    let crane = write(folder.path());
    std::fs::write(folder.path().join("pusher.urdf"), PUSHER).unwrap();
    let text = std::fs::read_to_string(crane).unwrap();
    let text = text.replace("crane.xml", "pusher.urdf").replace("crane", "pusher");
    let text = text
        .replace("position = [1.0, 0.2]", "position = [0.2]")
        .replace("velocity = [1.0, 0.2]", "velocity = [0.2]")
        .replace("acceleration = [2.0, 1.0]", "acceleration = [1.0]");
    let graph = folder.path().join("pusher.toml");
    std::fs::write(&graph, text).unwrap();
    let run = Run::start(&graph, &["--for", "300s", "--clock", "lockstep", "--pace", "0.2"]);
    let viewer = Viewer::start(&["--run", run.folder.id()], &[]);
    let mut browser = Browser::open(&viewer.address(), (1000, 700)).unwrap();
    let drawn = |state: &Json| state["robots"][0]["drawn"] == true;
    let state = until(&mut browser, "the robot is drawn", drawn);
    let robot = &state["robots"][0];
    assert_eq!((&robot["meshes"], &robot["hulls"]), (&json!([1, 1]), &json!([])), "{robot}");

    std::fs::remove_file(folder.path().join("meshes/hook.obj")).unwrap();
    let mut browser = Browser::open(&viewer.address(), (1000, 700)).unwrap();
    let state = until(&mut browser, "the robot is drawn without its mesh", |state| {
        drawn(state) && state["errors"].as_array().is_some_and(|errors| !errors.is_empty())
    });
    assert_eq!(state["robots"][0]["hulls"], json!(["slider"]), "{state}");
    assert!(state["errors"][0].as_str().is_some_and(|error| error.contains("hook.obj")), "{state}");
}
