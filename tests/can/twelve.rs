//! An arm of twelve joints on two CAN FD buses.

use std::fmt::Write as _;
use std::path::Path;

use super::arms;

/// Writes its model, drive table and graph, and a drive table whose interface does not exist.
pub(crate) fn write(folder: &Path) {
    let put = |name: &str, text: String| std::fs::write(folder.join(name), text).expect("a file");
    put("twelve.urdf", urdf());
    put("drives/twelve.toml", table());
    let graph = arms::graph("twelve", "twelve.urdf", "4 kHz", "drives/twelve.toml");
    put("two-buses.toml", graph + CONTROL);
    let panda = std::fs::read_to_string(folder.join("drives/panda-vcan.toml")).expect("the drive table");
    put("drives/missing.toml", panda.replace("\"vcan0\"", "\"vcan7\""));
}

fn urdf() -> String {
    let mut text = String::from("<robot name=\"twelve\">\n  <link name=\"link0\"/>\n");
    for i in 1..=12 {
        let (before, axis) = (i - 1, if i % 2 == 0 { "0 1 0" } else { "0 0 1" });
        let _ = write!(
            text,
            r#"  <link name="link{i}">
    <inertial><origin xyz="0 0 0.05"/><mass value="0.3"/>
      <inertia ixx="0.002" ixy="0" ixz="0" iyy="0.002" iyz="0" izz="0.002"/></inertial>
  </link>
  <joint name="joint{i}" type="revolute">
    <parent link="link{before}"/><child link="link{i}"/><origin xyz="0 0 0.08"/><axis xyz="{axis}"/>
    <limit lower="-2.5" upper="2.5" velocity="3" effort="30"/><dynamics damping="0.5"/>
  </joint>
"#
        );
    }
    text + "</robot>\n"
}

fn table() -> String {
    let ranges = [3.0, 6.0, 30.0];
    let drive = |i| {
        let (bus, node) = if i <= 6 { ("left", i) } else { ("right", i - 6) };
        let protocol = format!("protocol = \"damiao\"\nnode = {node}");
        arms::drive(&format!("joint{i}"), bus, &protocol, ranges)
    };
    let drives: String = (1..=12).map(drive).collect();
    arms::bus("left", "vcan0", true) + &arms::bus("right", "vcan1", true) + &drives
}

/// The adapter, the trajectory policy whose commands it sends to the drives, and the safety settings of their
/// graph.
const CONTROL: &str = r#"
[component.adapter]
kind      = "can.adapter"
robot     = "arm"
rate      = "1 kHz"
budget    = "100 us"
subscribe = { joint_command = "joint_command" }
publish   = { joint_state = "joint_state" }
config    = { drives = "drives/twelve.toml", command_within = "200 us" }

[component.policy]
kind      = "policy.trajectory"
robot     = "arm"
trigger   = "joint_state"
budget    = "60 us"
subscribe = { joint_state = "joint_state" }
publish   = { joint_command = "joint_command" }

[component.policy.config]
repeat        = "forever"
limits        = { fraction = 0.3, acceleration = 4.0 }
tolerance     = 0.05
joint_command = { kp = 60.0, kd = 2.0 }
goals         = [
    { offset = [0.1, 0.1, 0.1, -0.1, 0.1, 0.1, 0.1, -0.1, 0.1, 0.1, 0.1, -0.1], dwell = "200 ms" },
    { offset = [-0.1, -0.1, -0.1, 0.1, -0.1, -0.1, -0.1, 0.1, -0.1, -0.1, -0.1, 0.1], dwell = "200 ms" },
]

[safety]
stale_after = "5 ms"
safe_state  = "hold"
settle      = "100 ms"
"#;
